//! Where a body reaches farthest, roughly, for any direction: where a cold start begins.

use nalgebra::Vector3;

/// Cells along each edge of the faces of a cube around all directions.
const CELLS: usize = 16;

/// A boundary point for each cell of directions: the farthest along the middle of the cell among the points it was made of.
///
/// Points are seen from the centre of the normalization, body frame, metres. Nothing is proven by them.
#[derive(Clone, Debug)]
pub struct Outline {
    points: Vec<([f64; 3], u8)>,
    cells: Vec<u16>,
}

impl Outline {
    /// From points and the constraint that is active at each.
    pub(super) fn new(points: Vec<(Vector3<f64>, u8)>) -> Self {
        let mut cells = Vec::with_capacity(6 * CELLS * CELLS);
        for face in 0..6 {
            for cell in 0..CELLS * CELLS {
                let middle = |i: usize| (2 * i + 1) as f64 / CELLS as f64 - 1.0;
                let mut direction = Vector3::zeros();
                direction[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
                direction[(face / 2 + 1) % 3] = middle(cell / CELLS);
                direction[(face / 2 + 2) % 3] = middle(cell % CELLS);
                let (mut most, mut farthest) = (f64::NEG_INFINITY, 0);
                for (index, (point, _)) in points.iter().enumerate() {
                    let height = direction.dot(point);
                    if height > most {
                        (most, farthest) = (height, index);
                    }
                }
                cells.push(farthest as u16);
            }
        }
        Self { points: points.into_iter().map(|(point, active)| (point.into(), active)).collect(), cells }
    }

    /// About the farthest point along `direction` (body frame, any length), and the constraint that is active there.
    #[inline(always)]
    pub fn farthest(&self, direction: [f64; 3]) -> ([f64; 3], u8) {
        let [x, y, z] = direction.map(f64::abs);
        let axis = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        let [along, first, second] = match axis {
            0 => direction,
            1 => [direction[1], direction[2], direction[0]],
            _ => [direction[2], direction[0], direction[1]],
        };
        let scale = 0.5 * CELLS as f64 / along.abs();
        // A NaN becomes 0.
        let cell = |across: f64| ((across * scale + 0.5 * CELLS as f64) as usize).min(CELLS - 1);
        let face = 2 * axis + usize::from(along < 0.0);
        self.points[usize::from(self.cells[(face * CELLS + cell(first)) * CELLS + cell(second)])]
    }
}

#[cfg(test)]
mod tests {
    use crate::body::Body;
    use crate::polynomial::tests::Seeded;
    use nalgebra::Vector3;

    #[test]
    fn reaches_nearly_as_far_as_the_body() {
        let body = Body::superellipsoid("q6", Vector3::new(1.0, 2.0, 3.0), Vector3::new(1.0, 0.7, 0.4), 6).unwrap();
        let mut random = Seeded(11);
        for _ in 0..2000 {
            let n = Vector3::from_fn(|_, _| random.signed()).normalize();
            let (point, active) = body.outline().farthest(n.into());
            let reach = n.dot(&(Vector3::from(point) + body.normalization().center));
            let most = body.boundary().iter().map(|x| n.dot(x)).fold(f64::MIN, f64::max);
            assert!(active == 0 && reach > most - 0.05, "{n:?}: {reach} of {most}");
        }
    }
}
