//! What boxes, cylinders and balls are besides their polynomials: shapes whose projection and
//! support function have closed forms.
//!
//! A shape is recognised from the constraints alone, so that a body read from a file has it as
//! well: the constraints are sums of squares `Σ z_i²` over disjoint axes of the normalized frame,
//! and the rows of its linear map L are orthogonal. With `L = D Qᵀ`, D diagonal and Q a rotation,
//! the body is `{c + Q y}` over the points y of the shape with the half-sizes `1 / D_i`, up to the
//! rounding of these numbers, which [`ClosedForm::displacement_m`] bounds.

use super::{Constraint, Normalization};
use nalgebra::{Matrix3, Vector3};

/// Largest deviation from orthogonality of the axes of a shape, dimensionless: rotating a body
/// within its frame leaves a few roundings. Beyond it a body counts as skew. Pinned by
/// `bodies_know_their_closed_forms`.
const ORTHOGONAL: f64 = 64.0 * f64::EPSILON;

/// Rounding of a height, relative to the sizes that it is the sum of; dimensionless. Eight
/// operations of half an epsilon each, and with axes that are not those of the body as many again.
///
/// A smaller value gives bounds that a height may leave, so that a plane could prove shapes apart
/// that touch; a larger one leaves more contacts undecided. Exercised by
/// `support_points_attain_the_heights`.
const HEIGHT_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// A shape about the origin of its own frame, with the constraints of its body that bound it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExactShape {
    /// `|y_i| <= half_extents_m[i]`.
    Cuboid {
        /// Half of the edge lengths along the axes, metres.
        half_extents_m: [f64; 3],
        /// Which constraint of the body bounds each axis.
        faces: [u8; 3],
    },
    /// `y_0² + y_1² <= radius_m²`, `|y_2| <= half_height_m`.
    Cylinder {
        /// Radius, metres.
        radius_m: f64,
        /// Half of the height, metres.
        half_height_m: f64,
        /// Which constraint of the body is the wall, and which one the caps.
        wall_and_caps: [u8; 2],
    },
    /// All points within `radius_m` of `y_0 = y_1 = 0`, `|y_2| <= half_length_m`: a ball of a half
    /// length of 0. Bodies are no other capsules: no polynomial has one for its set.
    Capsule {
        /// Radius, metres.
        radius_m: f64,
        /// Half of the length of the axis, metres.
        half_length_m: f64,
    },
}

impl ExactShape {
    /// Radius of a ball, metres; none of other shapes.
    #[inline(always)]
    pub(crate) fn ball_radius_m(&self) -> Option<f64> {
        match *self {
            Self::Capsule { radius_m, half_length_m: 0.0 } => Some(radius_m),
            _ => None,
        }
    }
}

/// A shape where it lies in the frame of its body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosedForm {
    shape: ExactShape,
    center: Vector3<f64>,
    axes: Option<Matrix3<f64>>,
    displacement_m: f64,
}

impl ClosedForm {
    /// The closed form of the set `{x : g_i(L (x - c)) <= 1}`, if it is one of the shapes.
    pub(super) fn of(normalization: &Normalization, constraints: &[Constraint]) -> Option<Self> {
        let linear = &normalization.linear;
        let mut owner = [0_u8; 3];
        let mut bounded = [false; 3];
        for (index, constraint) in constraints.iter().enumerate() {
            for &(exponents, coefficient) in constraint.polynomial.terms() {
                let axis = exponents.iter().position(|&power| power == 2)?;
                let square = exponents.iter().map(|&power| u32::from(power)).sum::<u32>() == 2;
                if coefficient != 1.0 || !square || bounded[axis] {
                    return None;
                }
                (owner[axis], bounded[axis]) = (index as u8, true);
            }
        }
        if bounded != [true; 3] {
            return None;
        }
        let half = Vector3::from_fn(|i, _| 1.0 / linear.row(i).norm());
        let is_diagonal =
            (0..3).all(|i| (0..3).all(|j| if i == j { linear[(i, j)] > 0.0 } else { linear[(i, j)] == 0.0 }));
        // Columns are the unit rows of L.
        let mut axes =
            if is_diagonal { Matrix3::identity() } else { Matrix3::from_fn(|i, j| linear[(j, i)] * half[j]) };
        let skew = (axes.transpose() * axes - Matrix3::identity()).norm();
        if skew > ORTHOGONAL || axes.determinant() < 0.0 {
            return None;
        }
        let round = |i: usize, j: usize| (half[i] - half[j]).abs() <= ORTHOGONAL * half[i];
        let (shape, spread) = match constraints.len() {
            3 => (ExactShape::Cuboid { half_extents_m: half.into(), faces: owner }, 0.0),
            2 => {
                // The axis that has a constraint of its own becomes the third.
                let axis = (0..3).find(|&i| owner.iter().filter(|&&o| o == owner[i]).count() == 1)?;
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                if !round(u, v) {
                    return None;
                }
                axes = Matrix3::from_columns(&[axes.column(u), axes.column(v), axes.column(axis)]);
                let shape = ExactShape::Cylinder {
                    radius_m: half[u],
                    half_height_m: half[axis],
                    wall_and_caps: [owner[u], owner[axis]],
                };
                (shape, (half[u] - half[v]).abs())
            }
            _ => {
                let spread = (half[0] - half[1]).abs().max((half[0] - half[2]).abs());
                if !(round(0, 1) && round(0, 2)) {
                    return None;
                }
                (ExactShape::Capsule { radius_m: half[0], half_length_m: 0.0 }, spread)
            }
        };
        // Lengths of rows and their reciprocals round five times, axes that are not quite
        // orthogonal are within twice their deviation of some that are.
        let turned = if is_diagonal { 0.0 } else { 2.0 * skew + 16.0 * f64::EPSILON };
        let displacement_m = (turned + 4.0 * f64::EPSILON) * half.norm() + 2.0 * spread;
        let axes = (axes != Matrix3::identity()).then_some(axes);
        Some(Self { shape, center: normalization.center, axes, displacement_m })
    }

    /// The capsule of a radius and a half length (metres) about the origin of its own frame.
    #[inline(always)]
    pub fn capsule(radius_m: f64, half_length_m: f64) -> Self {
        let shape = ExactShape::Capsule { radius_m, half_length_m };
        Self { shape, center: Vector3::zeros(), axes: None, displacement_m: 0.0 }
    }

    /// The shape in its own frame.
    #[inline(always)]
    pub fn shape(&self) -> &ExactShape {
        &self.shape
    }

    /// Its centre, body frame, metres.
    #[inline(always)]
    pub fn center(&self) -> &Vector3<f64> {
        &self.center
    }

    /// The rotation from the frame of the shape to that of the body; none where their axes agree.
    #[inline(always)]
    pub fn axes(&self) -> Option<&Matrix3<f64>> {
        self.axes.as_ref()
    }

    /// Proven upper bound of `n·(x - c)` over the points x of the body, c the centre; n of any
    /// length, body frame; metres times that length.
    #[inline(always)]
    pub fn height(&self, n: &Vector3<f64>) -> f64 {
        self.heights(n)[1]
    }

    /// Proven bracket of the largest `n·(x - c)` over the points x of the body, as
    /// [`ClosedForm::height`].
    #[inline(always)]
    pub(crate) fn heights(&self, n: &Vector3<f64>) -> [f64; 2] {
        let own = self.axes.map_or(*n, |axes| axes.tr_mul(n));
        let height = match self.shape {
            ExactShape::Cuboid { half_extents_m: [x, y, z], .. } => x * own.x.abs() + y * own.y.abs() + z * own.z.abs(),
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                radius_m * (own.x * own.x + own.y * own.y).sqrt() + half_height_m * own.z.abs()
            }
            ExactShape::Capsule { radius_m, half_length_m } => radius_m * own.norm() + half_length_m * own.z.abs(),
        };
        let displaced = self.displacement_m * n.norm();
        [height * (1.0 - HEIGHT_ROUNDING) - displaced, height * (1.0 + HEIGHT_ROUNDING) + displaced]
    }

    /// A point of the shape that is farthest along n, body frame, metres: where several are, on a
    /// face or along an edge, one in the middle of them.
    pub(crate) fn support_point(&self, n: &Vector3<f64>) -> Vector3<f64> {
        let own = self.axes.map_or(*n, |axes| axes.tr_mul(n));
        let sign = |v: f64| if v == 0.0 { 0.0 } else { v.signum() };
        let farthest = match self.shape {
            ExactShape::Cuboid { half_extents_m, .. } => Vector3::from_fn(|i, _| half_extents_m[i] * sign(own[i])),
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                let length = own.x.hypot(own.y);
                // The quotient first: the radius over a tiny length is infinite.
                let along = |v: f64| if length > 0.0 { v / length * radius_m } else { 0.0 };
                Vector3::new(along(own.x), along(own.y), half_height_m * sign(own.z))
            }
            ExactShape::Capsule { radius_m, half_length_m } => {
                own.try_normalize(0.0).unwrap_or_default() * radius_m + Vector3::z() * (half_length_m * sign(own.z))
            }
        };
        self.center + self.axes.map_or(farthest, |axes| axes * farthest)
    }

    /// Radius of the ball about its centre that contains the shape, metres, but for rounding.
    pub(crate) fn reach_m(&self) -> f64 {
        match self.shape {
            ExactShape::Cuboid { half_extents_m, .. } => Vector3::from(half_extents_m).norm(),
            ExactShape::Cylinder { radius_m, half_height_m, .. } => radius_m.hypot(half_height_m),
            ExactShape::Capsule { radius_m, half_length_m } => radius_m + half_length_m,
        }
    }

    /// Bound of how far a point of the body is from the shape, or one of the shape from the body,
    /// metres.
    #[inline(always)]
    pub fn displacement_m(&self) -> f64 {
        self.displacement_m
    }
}

#[cfg(test)]
mod tests {
    use super::ExactShape;
    use crate::body::{Body, Constraint, Normalization};
    use nalgebra::{Matrix3, UnitQuaternion, Vector3};
    use sublevel_testkit::Seeded;

    /// The constraints of a body in another order.
    fn reordered(body: &Body, order: &[usize]) -> Vec<Constraint> {
        order.iter().map(|&i| body.constraints()[i].clone()).collect()
    }

    #[test]
    fn bodies_know_their_closed_forms() {
        let half = Vector3::new(0.1, 0.7, 2.3);
        let cuboid = Body::cuboid("box", half).unwrap();
        let cylinder = Body::cylinder("can", 0.3, 0.9).unwrap();
        let ball = Body::ball("ball", Vector3::new(1.0, 2.0, 3.0), 0.25).unwrap();
        let mut random = Seeded(3);
        for turn in 0..50 {
            let q = nalgebra::Vector4::from_fn(|_, _| random.signed()).normalize();
            let rotation = UnitQuaternion::new_normalize(nalgebra::Quaternion::from(q));
            let shift = Vector3::from_fn(|_, _| random.signed()) * f64::from(turn);
            for body in [&cuboid, &cylinder, &ball] {
                let moved = if turn == 0 { body.clone() } else { body.moved(&rotation, &shift).unwrap() };
                let form = moved.closed_form().expect("a shape");
                let size = moved.circumscribed().radius;
                assert!(form.displacement_m() < 1e-13 * size, "{form:?}");
                // Points of the shape's boundary lie on that of the body.
                for _ in 0..100 {
                    let u = random.unit();
                    let y = match *form.shape() {
                        ExactShape::Cuboid { half_extents_m: h, .. } => {
                            let far = (0..3).map(|i| (u[i] / h[i]).abs()).fold(0.0, f64::max);
                            u / far
                        }
                        ExactShape::Cylinder { radius_m: r, half_height_m: h, .. } => {
                            u / (u.x.hypot(u.y) / r).max(u.z.abs() / h)
                        }
                        ExactShape::Capsule { radius_m, .. } => u * radius_m,
                    };
                    let x = form.axes().copied().unwrap_or_else(Matrix3::identity) * y + form.center();
                    assert!(
                        (moved.value(&x) - 1.0).abs() < 1e-12 * (1.0 + shift.norm() / size),
                        "turn {turn}: {}",
                        moved.value(&x)
                    );
                }
            }
        }
        // In any order of the constraints.
        let turned = Body::new("box", *cuboid.normalization(), reordered(&cuboid, &[2, 0, 1])).unwrap();
        let Some(ExactShape::Cuboid { half_extents_m, faces }) = turned.closed_form().map(|form| *form.shape()) else {
            panic!("a box")
        };
        assert!((Vector3::from(half_extents_m) - half).norm() < 1e-15 && faces == [1, 2, 0]);
    }

    /// Support points are on the shape, and their heights in the bracket, along axes as well.
    #[test]
    fn support_points_attain_the_heights() {
        let shapes = [
            Body::cuboid("box", Vector3::new(0.1, 0.7, 2.3)).unwrap(),
            Body::cylinder("can", 0.3, 0.9).unwrap(),
            Body::ball("ball", Vector3::new(1.0, 2.0, 3.0), 0.25).unwrap(),
        ];
        // 50 of each, turned and moved.
        let moved: Vec<Body> = (0..150)
            .map(|index| {
                let mut random = Seeded(10_000 + index);
                let rotation = random.rotation();
                shapes[(index % 3) as usize].moved(&rotation, &random.unit()).unwrap()
            })
            .collect();
        // Next to an axis by less than what has an inverse.
        for (body, z) in [(&shapes[0], 2.3), (&shapes[1], 0.9), (&shapes[2], 0.25)] {
            let form = body.closed_form().expect("a shape");
            let point = form.support_point(&Vector3::new(0.0, 2e-310, 1.0)) - form.center();
            assert!(point.iter().all(|v| v.is_finite()) && (point.z - z).abs() < 1e-12, "{}: {point:?}", body.name());
        }
        for seed in 0..3000 {
            let mut random = Seeded(seed);
            let body = if seed % 2 == 0 { &shapes[(seed % 3) as usize] } else { &moved[random.index(moved.len())] };
            let form = body.closed_form().expect("a shape");
            let axis = form.axes().map_or(Vector3::x(), |axes| axes.column(0).into());
            let n = match seed % 5 {
                0 => axis,
                1 => axis + random.unit() * 1e-9,
                _ => random.unit() * (0.1 + random.signed().abs()),
            };
            let (point, [least, most]) = (form.support_point(&n), form.heights(&n));
            assert!((body.value(&point) - 1.0).abs() < 1e-11, "seed {seed}: {}", body.value(&point));
            let height = n.dot(&(point - form.center()));
            assert!(least <= height + 1e-15 && height <= most + 1e-15, "seed {seed}: {least} {height} {most}");
            assert!(most - least < 1e-13, "seed {seed}");
        }
    }

    #[test]
    fn other_bodies_have_none() {
        let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 2.0)).unwrap();
        let cuboid = Body::cuboid("box", Vector3::new(1.0, 2.0, 3.0)).unwrap();
        let cylinder = Body::cylinder("can", 1.0, 2.0).unwrap();
        let skewed = |body: &Body| {
            let mut linear = body.normalization().linear;
            linear[(0, 1)] += 1e-9;
            let normalization = Normalization { linear, ..*body.normalization() };
            Body::new("skew", normalization, body.constraints().to_vec()).unwrap()
        };
        let oval =
            Normalization { linear: Matrix3::from_diagonal(&Vector3::new(1.0, 1.1, 1.0)), center: Vector3::zeros() };
        let oval = Body::new("oval", oval, cylinder.constraints().to_vec()).unwrap();
        let rounded = Body::superellipsoid("q4", Vector3::zeros(), Vector3::repeat(1.0), 4).unwrap();
        for body in [egg, skewed(&cuboid), skewed(&cylinder), oval, rounded] {
            assert_eq!(body.closed_form(), None, "{}", body.name());
        }
    }
}
