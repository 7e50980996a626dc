//! Support points of a body for a grid of directions, approximately: where a cold start begins.
//! Nothing is proven by it.
//!
//! The point of a convex set farthest along a unit vector e, as a function of e, is the gradient of
//! the support function: its derivative K is symmetric, not negative, and `K e = 0`. Over a small
//! cell of directions about m it is nearly `z + K (e - m)`, that is `z + K e`; z and K are fitted
//! to the support points along the corners and the middle of the cell, which also gives flat sides,
//! edges and corners a K to go by. Cells are those of normalized coordinates, where no body is much
//! longer than wide: with W the inverse of their map M, the body's point farthest along n is the
//! one with the z for `e = Wᵀn / |Wᵀn|`, that is `W z + W K Wᵀ n / |Wᵀn|`.

use super::Constraint;
use super::direction_grid::{self, CELLS, CORNERS, corner, middle};
use super::radial::radius;
use super::sphere::Sphere;
use crate::polynomial::{Number, Simd};
use nalgebra::{Const, DimMin, Matrix2, Matrix3, Matrix3x2, SMatrix, SVector, Vector3};

/// Numbers of a cell: `W z`, and `W K Wᵀ` by its distinct entries.
const FIELDS: usize = 9;

/// Size of the ellipsoid that stands for the body, relative to the smallest one of its shape around
/// the body; dimensionless.
///
/// It lies between that and the largest one inside. Only guesses depend on it: other values make
/// cold starts slower. Pinned by `the_ellipsoid_of_a_ball_is_a_smaller_ball`.
const FULLNESS: f64 = 0.75;

/// Square of the ratio of the longest to the shortest half axis of the ellipsoid, from which the
/// body counts as thin; dimensionless. It is 6 times longer than thick then.
///
/// It changes time only: below, a start of the other kind takes as long. No test pins it.
const THIN_SQUARED: f64 = 36.0;

/// An ellipsoid about as large as the body, and for each cell of directions about where the body is
/// farthest along them, with the constraint that is active along its middle.
///
/// Points are seen from the centre of the normalization, body frame, metres.
#[derive(Clone, Debug)]
pub struct Outline {
    inverse: Matrix3<f64>,
    reach: f64,
    shape: Matrix3<f64>,
    is_thin: bool,
    cells: Vec<[f64; FIELDS]>,
    active: Vec<u8>,
}

/// Where a body is farthest along unit vectors n near the one that the cell was looked up for:
/// about `point + turn n`, a lane each.
#[derive(Clone, Copy, Debug)]
pub struct Cell<N> {
    /// Where the cell is kept.
    pub place: N,
    /// Point for the middle of the cell, from the centre of the normalization, body frame, metres.
    pub point: [N; 3],
    /// Symmetric derivative by n, metres: xx, xy, xz, yy, yz, zz.
    pub turn: [N; 6],
}

impl<N: Copy> Cell<N> {
    /// About the point farthest along the unit vectors, from the centre of the normalization on,
    /// body frame, metres.
    #[inline(always)]
    pub fn farthest<S: Simd>(&self, _: S, n: [N; 3]) -> [N; 3]
    where
        N: Number<S>,
    {
        let [xx, xy, xz, yy, yz, zz] = self.turn;
        let row = |x: N, y: N, z: N| z.mul_add(n[2], y.mul_add(n[1], x * n[0]));
        let turned = [row(xx, xy, xz), row(xy, yy, yz), row(xz, yz, zz)];
        [self.point[0] + turned[0], self.point[1] + turned[1], self.point[2] + turned[2]]
    }
}

/// The support points along the corners of the cells, face by face and row by row, with the
/// constraints that are active there.
pub(super) type Corners = Vec<(Vector3<f64>, Vec<usize>)>;

impl Outline {
    /// `interior` is the interior point in normalized coordinates. Also the support points that it
    /// was made from.
    pub(super) fn new(constraints: &[Constraint], inverse: &Matrix3<f64>, interior: &Vector3<f64>) -> (Self, Corners) {
        let mut traced = Vec::with_capacity(6 * CORNERS * CORNERS);
        let mut support = SupportTracer::new(constraints, interior);
        let (mut cells, mut active) = (Vec::with_capacity(6 * CELLS * CELLS), Vec::with_capacity(6 * CELLS * CELLS));
        let mut along_corners = direction_grid::corners().map(|corner| corner.normalize());
        for face in 0..6 {
            // Along the corners of all cells of the face.
            let corners: Vec<_> = along_corners
                .by_ref()
                .take(CORNERS * CORNERS)
                .map(|e| {
                    let sample = support.along(e);
                    traced.push((sample.1, support.active.clone()));
                    sample
                })
                .collect();
            for i in 0..CELLS {
                for j in 0..CELLS {
                    let middle = support.along(middle(face, i, j).normalize());
                    active.push(support.active[0] as u8);
                    let around = [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)];
                    let around = around.map(|(i, j)| &corners[corner(0, i, j)]);
                    cells.push(fitted(&middle, around, constraints.len() == 1, inverse));
                }
            }
        }
        let reach = support.reach;
        let shape = inverse * inverse.transpose() * (FULLNESS * reach).powi(2);
        let singular = inverse.singular_values();
        let is_thin = singular.max().powi(2) > THIN_SQUARED * singular.min().powi(2);
        (Self { inverse: *inverse, reach, shape, is_thin, cells, active }, traced)
    }

    /// Largest norm of the normalized coordinates of all support points: what lies between them
    /// reaches hardly farther.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// The point of the cell kept there.
    #[inline(always)]
    pub fn point<S: Simd, N: Number<S>>(&self, simd: S, place: N) -> [N; 3] {
        let [x, y, z, ..] = N::gather(simd, &self.cells, place);
        [x, y, z]
    }

    /// The ellipsoid, as the matrix Σ of its support function `√(nᵀ Σ n)`, m².
    pub fn shape(&self) -> &Matrix3<f64> {
        &self.shape
    }

    /// Radius of the ellipsoid in normalized coordinates, where it is a ball.
    #[inline(always)]
    pub fn radius(&self) -> f64 {
        FULLNESS * self.reach
    }

    /// Whether the ellipsoid is several times longer than thick.
    #[inline(always)]
    pub fn is_thin(&self) -> bool {
        self.is_thin
    }

    /// Where the cell of a direction is kept; body frame, any length.
    #[inline(always)]
    pub fn place<S: Simd, N: Number<S>>(&self, simd: S, n: [N; 3]) -> N {
        direction_grid::cell(simd, self.normalized(simd, n))
    }

    /// The cell of a unit vector, body frame.
    #[inline(always)]
    pub fn cell<S: Simd, N: Number<S>>(&self, simd: S, n: [N; 3]) -> Cell<N> {
        let e = self.normalized(simd, n);
        let place = direction_grid::cell(simd, e);
        let scale = N::splat(simd, 1.0) / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sqrt();
        let [x, y, z, xx, xy, xz, yy, yz, zz] = N::gather(simd, &self.cells, place);
        Cell { place, point: [x, y, z], turn: [xx * scale, xy * scale, xz * scale, yy * scale, yz * scale, zz * scale] }
    }

    /// `Wᵀ n`.
    #[inline(always)]
    fn normalized<S: Simd, N: Number<S>>(&self, simd: S, [x, y, z]: [N; 3]) -> [N; 3] {
        let entry = N::splat;
        let w = &self.inverse;
        [
            entry(simd, w.m11).mul_add(x, entry(simd, w.m21).mul_add(y, entry(simd, w.m31) * z)),
            entry(simd, w.m12).mul_add(x, entry(simd, w.m22).mul_add(y, entry(simd, w.m32) * z)),
            entry(simd, w.m13).mul_add(x, entry(simd, w.m23).mul_add(y, entry(simd, w.m33) * z)),
        ]
    }

    /// The active constraint of the cell kept there.
    #[inline(always)]
    pub fn active(&self, place: f64) -> usize {
        usize::from(self.active[(place as usize).min(self.active.len() - 1)])
    }
}

/// A direction and the support point along it, in normalized coordinates.
type Sample = (Vector3<f64>, Vector3<f64>);

/// The fields of the cell with these samples, of a body with a smooth surface or one with edges.
fn fitted((e, z): &Sample, corners: [&Sample; 4], smooth: bool, inverse: &Matrix3<f64>) -> [f64; FIELDS] {
    let mean = corners.iter().fold(Vector3::zeros(), |sum, corner| sum + corner.1) / 4.0;
    // What bends like a paraboloid is a third of the corners' value on average; at corners of the
    // body nothing bends.
    let point = inverse * if smooth { (z * 2.0 + mean) / 3.0 } else { *z };
    let first = e.cross(&Vector3::ith(e.iamin(), 1.0)).normalize();
    let tangents = Matrix3x2::from_columns(&[first, e.cross(&first)]);
    // Least squares for `K Tᵀe = Tᵀz` with a symmetric matrix: its entries 00, 01, 11 have these
    // coefficients.
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (direction, corner) in corners {
        let (e, z) = (tangents.tr_mul(direction), tangents.tr_mul(&(corner - mean)));
        for (row, value) in [(Vector3::new(e.x, e.y, 0.0), z.x), (Vector3::new(0.0, e.x, e.y), z.y)] {
            normal += row * row.transpose();
            right += row * value;
        }
    }
    let turn = normal.cholesky().map_or(Vector3::zeros(), |factor| factor.solve(&right));
    let mut turn = Matrix2::new(turn.x, turn.y, turn.y, turn.z).symmetric_eigen();
    turn.eigenvalues = turn.eigenvalues.map(|value: f64| value.max(0.0));
    let tangents = inverse * tangents;
    let turn = tangents * turn.recompose() * tangents.transpose();
    [point.x, point.y, point.z, turn.m11, turn.m12, turn.m13, turn.m22, turn.m23, turn.m33]
}

/// Finds support points, one after the other along directions that lie close together.
struct SupportTracer<'a> {
    constraints: &'a [Constraint],
    interior: &'a Vector3<f64>,
    /// Boundary points all around, normalized coordinates.
    rays: Vec<Vector3<f64>>,
    /// The last support point, normalized coordinates, and the constraints active there, the one
    /// with the most force first.
    last: Vector3<f64>,
    active: Vec<usize>,
    /// Largest norm of all support points so far.
    reach: f64,
}

impl<'a> SupportTracer<'a> {
    fn new(constraints: &'a [Constraint], interior: &'a Vector3<f64>) -> Self {
        let ray = |u: &Vector3<f64>| interior + u * radius(constraints, interior, u);
        let rays = Sphere::fine().vertices().iter().map(ray).collect();
        Self { constraints, interior, rays, last: *interior, active: vec![0], reach: 0.0 }
    }

    fn along(&mut self, e: Vector3<f64>) -> Sample {
        let found = self.farther(&e, &self.last, &self.active);
        (self.last, self.active) = found.unwrap_or_else(|| self.again(&e));
        self.reach = self.reach.max(self.last.norm());
        (e, self.last)
    }

    /// A support point and its active constraints from the ray that leads farthest.
    fn again(&self, e: &Vector3<f64>) -> (Vector3<f64>, Vec<usize>) {
        let farthest = self.rays.iter().max_by(|p, q| e.dot(p).total_cmp(&e.dot(q)));
        let start = farthest.copied().unwrap_or(*self.interior);
        let value = |index: &usize| self.constraints[*index].polynomial.evaluate(&start).value;
        let mut order: Vec<usize> = (0..self.constraints.len()).collect();
        order.sort_by(|i, j| value(j).total_cmp(&value(i)));
        // Inside a surface, on an edge, at a corner.
        let sets = (1..=order.len().min(3)).map(|count| &order[..count]);
        let found = sets.filter_map(|set| self.farther(e, &start, set)).next();
        found.unwrap_or((start, vec![order[0]]))
    }

    /// The point of the body farthest along `e` (normalized coordinates), and the constraints that
    /// are active there, from a guess of both; at most three are active.
    fn farther(&self, e: &Vector3<f64>, start: &Vector3<f64>, active: &[usize]) -> Option<(Vector3<f64>, Vec<usize>)> {
        match active.len() {
            1 => self.newton::<4>(e, start, active),
            2 => self.newton::<5>(e, start, active),
            _ => self.newton::<6>(e, start, active),
        }
    }

    /// Newton's method on `e = Σ ν_i ∇g_i`, `g_i = 1` over the active constraints, for N unknowns:
    /// the point and the multipliers. None where it does not converge, as where the surface is
    /// flat, or other constraints are active.
    fn newton<const N: usize>(
        &self,
        e: &Vector3<f64>,
        start: &Vector3<f64>,
        active: &[usize],
    ) -> Option<(Vector3<f64>, Vec<usize>)>
    where
        Const<N>: DimMin<Const<N>, Output = Const<N>>,
    {
        let count = active.len();
        let mut z = *start;
        let mut weights: Option<Vector3<f64>> = None;
        for _ in 0..16 {
            let mut gradients = Matrix3::zeros();
            let mut matrix = SMatrix::<f64, N, N>::zeros();
            let mut right = SVector::<f64, N>::zeros();
            right.fixed_rows_mut::<3>(0).copy_from(e);
            let jets = active.iter().map(|&i| self.constraints[i].polynomial.evaluate(&z));
            let mut hessians = [Matrix3::zeros(); 3];
            for (k, jet) in jets.enumerate() {
                gradients.set_column(k, &jet.gradient);
                matrix.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&jet.gradient);
                matrix.fixed_view_mut::<1, 3>(3 + k, 0).copy_from(&jet.gradient.transpose());
                right[3 + k] = 1.0 - jet.value;
                hessians[k] = jet.hessian;
            }
            let known = match weights {
                Some(known) => known,
                None => {
                    let mut normal = gradients.tr_mul(&gradients);
                    (count..3).for_each(|k| normal[(k, k)] = 1.0);
                    normal.cholesky()?.solve(&gradients.tr_mul(e))
                }
            };
            let bent = hessians[0] * known.x + hessians[1] * known.y + hessians[2] * known.z;
            matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&bent);
            let solution = matrix.lu().solve(&right)?;
            let step = solution.fixed_rows::<3>(0).into_owned();
            // Multipliers of constraints beyond the active ones are zero.
            let next = Vector3::from_fn(|k, _| if k < count { solution[3 + k] } else { 0.0 });
            let length = step.norm();
            z += step * (0.25 / length).min(1.0);
            if length < 1e-6 {
                let inside = |constraint: &Constraint| constraint.polynomial.evaluate(&z).value <= 1.0 + 1e-9;
                let pressed = (0..count).all(|k| next[k] > 0.0);
                let force = |k: &usize| next[*k] * gradients.column(*k).norm();
                let mut active = active.to_vec();
                if let Some(first) = (0..count).max_by(|i, j| force(i).total_cmp(&force(j))) {
                    active.swap(0, first);
                }
                return (pressed && self.constraints.iter().all(inside)).then_some((z, active));
            }
            weights = Some(next);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use crate::body::Body;
    use crate::polynomial::{Lanes, Scalar, Simd, Vector, WithSimd, dispatch_lanes};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// `point + turn n`.
    fn support(body: &Body, n: &Vector3<f64>) -> Vector3<f64> {
        let cell = body.outline().cell::<_, f64>(Scalar, (*n).into());
        assert_eq!(body.outline().active(cell.place), 0);
        Vector3::from(cell.farthest(Scalar, (*n).into()))
    }

    #[test]
    fn cells_reach_nearly_as_far_as_the_body() {
        let half = Vector3::new(1.0, 0.7, 0.4);
        let body = Body::superellipsoid("q6", Vector3::new(1.0, 2.0, 3.0), half, 6).unwrap();
        let mut random = Seeded(11);
        for _ in 0..2000 {
            let n = Vector3::from_fn(|_, _| random.signed()).normalize();
            let reach = n.dot(&support(&body, &n));
            // The conjugate exponent of 6 is 6/5.
            let most = (0..3).map(|i| (half[i] * n[i]).abs().powf(1.2)).sum::<f64>().powf(1.0 / 1.2);
            assert!((reach - most).abs() < 0.025, "{n:?}: {reach} of {most}");
        }
    }

    #[test]
    fn cells_of_an_ellipsoid_are_as_good_as_their_size() {
        let half = Vector3::new(1.0, 0.7, 0.4);
        let body = Body::ellipsoid("e", Vector3::new(1.0, 2.0, 3.0), half).unwrap();
        let mut random = Seeded(12);
        for _ in 0..2000 {
            let n = Vector3::from_fn(|_, _| random.signed()).normalize();
            let farthest = half.component_mul(&half).component_mul(&n) / half.component_mul(&n).norm();
            assert!((support(&body, &n) - farthest).norm() < 0.01, "{n:?}");
        }
    }

    #[test]
    fn the_ellipsoid_of_a_ball_is_a_smaller_ball() {
        let body = Body::ball("ball", Vector3::new(1.0, 2.0, 3.0), 2.0).unwrap();
        for radius in body.outline().shape().symmetric_eigenvalues().map(f64::sqrt).iter() {
            assert!((1.4..1.6).contains(radius), "{radius}");
        }
    }

    /// Cells of directions, in lanes.
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
                let cell = self.body.outline().cell(simd, direction);
                cell.point[1].store(&mut found[0][start..]);
                cell.turn[5].store(&mut found[1][start..]);
            }
            found
        }
    }

    #[test]
    fn lanes_find_the_same_cells() {
        let body = Body::superellipsoid("q6", Vector3::zeros(), Vector3::new(1.0, 0.7, 0.4), 6).unwrap();
        let mut random = Seeded(5);
        for _ in 0..200 {
            let mut directions = [[0.0; 16]; 3];
            directions.iter_mut().flatten().for_each(|entry| *entry = random.signed());
            let found = dispatch_lanes(Look { body: &body, directions });
            for lane in 0..16 {
                let cell = body.outline().cell::<_, f64>(Scalar, directions.map(|row| row[lane]));
                assert_eq!([cell.point[1], cell.turn[5]], [found[0][lane], found[1][lane]]);
            }
        }
        // Nonsense finds something.
        assert!(body.outline().cell::<_, f64>(Scalar, [f64::NAN; 3]).point.iter().all(|entry| entry.is_finite()));
    }
}
