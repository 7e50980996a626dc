//! Proof that a set contains triangles, one by one: convexity proves nothing here.

use super::coverage::{Coverage, TriangleError, Uncovered};
use super::sos_body::SosBody;
use crate::polynomial::Peak;
use nalgebra::Vector3;

impl SosBody {
    /// Proves triangles inside, one by one (`Polynomial::peak`); `triangles` are indices of
    /// `points`, metres.
    ///
    /// # Errors
    /// An index that is out of range.
    pub fn coverage(&self, points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Result<Coverage, TriangleError> {
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&vertex| vertex >= points.len()) {
                return Err(TriangleError { triangle, vertex, points: points.len() });
            }
        }
        let mut coverage =
            Coverage { triangles: triangles.len(), uncovered: 0, area_m2: 0.0, uncovered_area_m2: 0.0, largest: None };
        for (triangle, corners) in triangles.iter().enumerate() {
            let corners = corners.map(|vertex| points[vertex]);
            let [a, b, c] = corners;
            let area_m2 = 0.5 * (b - a).cross(&(c - a)).norm();
            coverage.area_m2 += area_m2;
            let Peak { attained, most } = self.peak(&corners);
            // Not `>`: a NaN is not inside.
            if !(most <= 1.0) {
                coverage.uncovered += 1;
                coverage.uncovered_area_m2 += area_m2;
                if coverage.largest.is_none_or(|largest| area_m2 > largest.area_m2) {
                    coverage.largest = Some(Uncovered { triangle, area_m2, value: attained, value_upper: most });
                }
            }
        }
        Ok(coverage)
    }

    /// How high the polynomial reaches on a triangle of the body frame.
    fn peak(&self, corners: &[Vector3<f64>; 3]) -> Peak {
        let placement = &self.placement;
        let z = corners.map(|x| placement.linear() * (x - placement.origin()));
        // Every corner's exact image is this close to the computed one, in each coordinate, and so
        // are those of their mixtures.
        let displacement = corners.iter().map(|x| placement.displacement(x)).fold(0.0, f64::max);
        self.polynomial.peak(&z, displacement * placement.row_norms().amax() * (1.0 + 1e-14), 1.0)
    }
}
