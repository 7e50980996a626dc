//! What a body looks like from outside, roughly, for any direction: where a cold start begins. Nothing is proven by it.

use super::Constraint;
use super::sphere::Sphere;
use super::surface::radius;
use crate::polynomial::{Number, NumberJet, Simd};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Cells along each edge of the faces of a cube around all directions.
const CELLS: usize = 12;

/// Numbers of a mark: point, value, gradient, Hessian.
const FIELDS: usize = 13;

/// Size of the ellipsoid that stands for the body, relative to the smallest one of its shape around the body: between that and
/// the largest one inside.
const FULLNESS: f64 = 0.75;

/// An ellipsoid about as large as the body, and for each cell of directions the point of the body that is farthest along the
/// middle of the cell, with the constraint that is active there.
///
/// Points are seen from the centre of the normalization, body frame, metres.
#[derive(Clone, Debug)]
pub struct Outline {
    shape: Matrix3<f64>,
    marks: Vec<[f64; FIELDS]>,
    active: Vec<u8>,
}

/// A point of an outline, a lane each.
#[derive(Clone, Copy, Debug)]
pub struct Mark<N> {
    /// Point, from the centre of the normalization, body frame, metres.
    pub point: [N; 3],
    /// The active constraint there, by normalized coordinates.
    pub jet: NumberJet<N>,
}

impl Outline {
    /// `interior` is the interior point in normalized coordinates, `reach` the largest norm of normalized coordinates of the
    /// body.
    pub(super) fn new(constraints: &[Constraint], inverse: &Matrix3<f64>, interior: &Vector3<f64>, reach: f64) -> Self {
        let rays: Vec<_> =
            Sphere::fine().vertices().iter().map(|u| interior + u * radius(constraints, interior, u)).collect();
        let cells = 6 * CELLS * CELLS;
        let (mut marks, mut active) = (Vec::with_capacity(cells), Vec::with_capacity(cells));
        for cell in 0..cells {
            let (face, i, j) = (cell / (CELLS * CELLS), cell / CELLS % CELLS, cell % CELLS);
            let middle = |i: usize| (2 * i + 1) as f64 / CELLS as f64 - 1.0;
            let mut direction = Vector3::zeros();
            direction[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
            direction[(face / 2 + 1) % 3] = middle(i);
            direction[(face / 2 + 2) % 3] = middle(j);
            let direction = (inverse.transpose() * direction).normalize();
            let farthest = rays.iter().max_by(|p, q| direction.dot(p).total_cmp(&direction.dot(q)));
            let start = farthest.copied().unwrap_or(*interior);
            let value = |index: &usize| constraints[*index].polynomial.evaluate(&start).value;
            let index = (0..constraints.len()).max_by(|i, j| value(i).total_cmp(&value(j))).unwrap_or(0);
            let z = farther(constraints, index, &direction, &start).unwrap_or(start);
            let jet = NumberJet::from(constraints[index].polynomial.evaluate(&z));
            let mut mark = [0.0; FIELDS];
            mark[..3].copy_from_slice((inverse * z).as_slice());
            mark[3] = jet.value;
            mark[4..7].copy_from_slice(&jet.gradient);
            mark[7..].copy_from_slice(&jet.hessian);
            marks.push(mark);
            active.push(index as u8);
        }
        let shape = inverse * inverse.transpose() * (FULLNESS * reach).powi(2);
        Self { shape, marks, active }
    }

    /// The point of the mark kept there.
    #[inline(always)]
    pub fn point(&self, place: f64) -> [f64; 3] {
        let [x, y, z, ..] = self.marks[(place as usize).min(self.marks.len() - 1)];
        [x, y, z]
    }

    /// The ellipsoid, as the matrix Σ of its support function `√(nᵀ Σ n)`, m².
    pub fn shape(&self) -> &Matrix3<f64> {
        &self.shape
    }

    /// Where the mark for a direction (body frame, any length) is kept.
    #[inline(always)]
    pub fn place<S: Simd, N: Number<S>>(simd: S, [x, y, z]: [N; 3]) -> N {
        let splat = |value: f64| N::splat(simd, value);
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let (on_x, on_y) = (N::and(simd, ay.le(ax), az.le(ax)), az.le(ay));
        let along = x.select(on_x, y.select(on_y, z));
        let first = y.select(on_x, z.select(on_y, x));
        let second = z.select(on_x, x.select(on_y, y));
        let axis = splat(0.0).select(on_x, splat(2.0).select(on_y, splat(4.0)));
        let face = axis + splat(0.0).select(splat(0.0).le(along), splat(1.0));
        let half = splat(0.5 * CELLS as f64);
        let scale = half / along.abs();
        let (i, j) = (cell(simd, first, scale), cell(simd, second, scale));
        let cells = splat(CELLS as f64);
        face.mul_add(cells, i).mul_add(cells, j)
    }

    /// The mark kept there.
    #[inline(always)]
    pub fn mark<S: Simd, N: Number<S>>(&self, simd: S, place: N) -> Mark<N> {
        let [x, y, z, value, gx, gy, gz, xx, xy, xz, yy, yz, zz] = N::gather(simd, &self.marks, place);
        let jet = NumberJet { value, gradient: [gx, gy, gz], hessian: [xx, xy, xz, yy, yz, zz] };
        Mark { point: [x, y, z], jet }
    }

    /// The constraint of the mark kept there.
    #[inline(always)]
    pub fn active(&self, place: f64) -> usize {
        usize::from(self.active[(place as usize).min(self.active.len() - 1)])
    }
}

/// Which cell along one edge of a face.
#[inline(always)]
fn cell<S: Simd, N: Number<S>>(simd: S, across: N, scale: N) -> N {
    // Adding so much leaves no room for fractions; which side ties go to is of no matter.
    let whole = N::splat(simd, 1.5 / f64::EPSILON);
    let rounded = (across.mul_add(scale, N::splat(simd, 0.5 * CELLS as f64 - 0.5)) + whole) - whole;
    rounded.max(N::splat(simd, 0.0)).min(N::splat(simd, CELLS as f64 - 1.0))
}

/// The point of the body farthest along `e` (normalized coordinates), by Newton's method on `e = ν ∇g`, `g = 1`. None where it
/// does not converge, as on edges and where the surface is flat.
fn farther(constraints: &[Constraint], active: usize, e: &Vector3<f64>, start: &Vector3<f64>) -> Option<Vector3<f64>> {
    let mut z = *start;
    for _ in 0..16 {
        let jet = constraints[active].polynomial.evaluate(&z);
        let along = jet.gradient.dot(e);
        if !(along > 1e-3 * jet.gradient.norm()) {
            return None;
        }
        let mut matrix = Matrix4::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&(jet.hessian / along));
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&jet.gradient);
        matrix.fixed_view_mut::<1, 3>(3, 0).copy_from(&jet.gradient.transpose());
        let residual = e - jet.gradient / along;
        let right = Vector4::new(residual.x, residual.y, residual.z, 1.0 - jet.value);
        let step = matrix.lu().solve(&right)?.xyz();
        let length = step.norm();
        z += step * (0.25 / length).min(1.0);
        if length < 1e-9 {
            let inside = constraints.iter().all(|constraint| constraint.polynomial.evaluate(&z).value <= 1.0 + 1e-9);
            return (inside && e.dot(&z) >= e.dot(start) - 1e-9).then_some(z);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::Outline;
    use crate::body::Body;
    use crate::polynomial::tests::Seeded;
    use crate::polynomial::{Lanes, Scalar, Simd, WithSimd, dispatch};
    use nalgebra::Vector3;

    #[test]
    fn marks_reach_nearly_as_far_as_the_body() {
        let half = Vector3::new(1.0, 0.7, 0.4);
        let body = Body::superellipsoid("q6", Vector3::new(1.0, 2.0, 3.0), half, 6).unwrap();
        let mut random = Seeded(11);
        for _ in 0..2000 {
            let n = Vector3::from_fn(|_, _| random.signed()).normalize();
            let place = Outline::place::<_, f64>(Scalar, n.into());
            let mark = body.outline().mark::<_, f64>(Scalar, place);
            let reach = n.dot(&(Vector3::from(mark.point)));
            // The conjugate exponent of 6 is 6/5.
            let most = (0..3).map(|i| (half[i] * n[i]).abs().powf(1.2)).sum::<f64>().powf(1.0 / 1.2);
            assert!(body.outline().active(place) == 0 && reach <= most + 1e-9, "{n:?}: {reach} of {most}");
            assert!(reach > most - 0.02, "{n:?}: {reach} of {most}");
            assert!((mark.jet.value - 1.0).abs() < 1e-6, "{n:?}: {mark:?}");
        }
    }

    #[test]
    fn the_ellipsoid_of_a_ball_is_a_smaller_ball() {
        let body = Body::ball("ball", Vector3::new(1.0, 2.0, 3.0), 2.0).unwrap();
        for radius in body.outline().shape().symmetric_eigenvalues().map(f64::sqrt).iter() {
            assert!((1.4..1.6).contains(radius), "{radius}");
        }
    }

    /// Marks for directions, in lanes.
    struct Look<'a> {
        body: &'a Body,
        directions: [[f64; 16]; 3],
    }

    impl WithSimd for Look<'_> {
        type Output = [[f64; 16]; 2];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let mut found = [[0.0; 16]; 2];
            for start in (0..16).step_by(Lanes::<S>::COUNT) {
                let direction = self.directions.map(|row| Lanes::load(simd, &row[start..]));
                let mark = self.body.outline().mark(simd, Outline::place(simd, direction));
                mark.point[1].store(&mut found[0][start..]);
                mark.jet.hessian[5].store(&mut found[1][start..]);
            }
            found
        }
    }

    #[test]
    fn lanes_find_the_same_marks() {
        let body = Body::superellipsoid("q6", Vector3::zeros(), Vector3::new(1.0, 0.7, 0.4), 6).unwrap();
        let mut random = Seeded(5);
        for _ in 0..200 {
            let mut directions = [[0.0; 16]; 3];
            directions.iter_mut().flatten().for_each(|entry| *entry = random.signed());
            let found = dispatch(Look { body: &body, directions });
            for lane in 0..16 {
                let place = Outline::place::<_, f64>(Scalar, directions.map(|row| row[lane]));
                let mark = body.outline().mark::<_, f64>(Scalar, place);
                assert_eq!([mark.point[1], mark.jet.hessian[5]], [found[0][lane], found[1][lane]]);
            }
        }
        // Nonsense finds something.
        let place = Outline::place::<_, f64>(Scalar, [f64::NAN; 3]);
        assert!(body.outline().mark::<_, f64>(Scalar, place).point.iter().all(|entry| entry.is_finite()));
    }
}
