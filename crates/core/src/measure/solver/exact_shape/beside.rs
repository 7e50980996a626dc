//! The signed distance of a point from a shape: minus the distance from its boundary inside.

use super::cuboid::Cuboid;
use super::cylinder::Cylinder;
use super::projectable::Projectable;
use super::segment::Segment;
use crate::body::ExactShape;
use crate::measure::frames::vector::{V3, add_scaled, dot, scaled};
use crate::polynomial::Scalar;

/// Where a point is beside the boundary of a shape, in its frame, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beside {
    /// What the normal proves of the signed distance, and the nearest point: equal but for rounding
    /// of some units of the lengths involved.
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// Outward unit normal at the nearest point of the boundary.
    pub(super) n: V3<f64>,
    /// That point.
    pub(super) nearest: V3<f64>,
    /// How far inside the shape the point is along directions elsewhere; the least of those that
    /// are known. Negative as the signed distance outside.
    pub(super) elsewhere: f64,
    /// How far the point would have to be moved to have any other normal; infinite above faces.
    pub(super) arm: f64,
}

/// The point as seen from the shape; directions at an angle with a cosine below `elsewhere` are
/// others.
pub(super) fn beside(shape: &ExactShape, y: V3<f64>, elsewhere: f64) -> Beside {
    match *shape {
        ExactShape::Cuboid { half_extents_m, .. } => {
            let set = Cuboid { half_extents: half_extents_m };
            outside(&set, 0.0, y, elsewhere).unwrap_or_else(|| in_cuboid(half_extents_m, y)).with(|n| {
                let beyond = |i: usize| {
                    let toward = if n[i] >= elsewhere { f64::INFINITY } else { half_extents_m[i] - y[i] };
                    let away = if -n[i] >= elsewhere { f64::INFINITY } else { half_extents_m[i] + y[i] };
                    toward.min(away)
                };
                beyond(0).min(beyond(1)).min(beyond(2))
            })
        }
        ExactShape::Cylinder { radius_m, half_height_m, .. } => {
            let set = Cylinder { radius: radius_m, half_height: half_height_m };
            let out = y[0].hypot(y[1]);
            outside(&set, 0.0, y, elsewhere).unwrap_or_else(|| in_cylinder((radius_m, half_height_m), y)).with(|n| {
                let caps = [n[2], -n[2]].map(|part| part >= elsewhere);
                let top = if caps[0] { f64::INFINITY } else { half_height_m - y[2] };
                let bottom = if caps[1] { f64::INFINITY } else { half_height_m + y[2] };
                // The wall is there all around.
                let is_wall = n[0].hypot(n[1]) >= elsewhere;
                top.min(bottom).min(radius_m - if is_wall { elsewhere * out } else { out })
            })
        }
        ExactShape::Capsule { radius_m, half_length_m } => {
            let set = Segment { half_length: half_length_m };
            let on_axis = Beside {
                lower: -radius_m,
                upper: -radius_m,
                n: [1.0, 0.0, 0.0],
                nearest: [radius_m, 0.0, y[2]],
                elsewhere: radius_m,
                arm: 0.0,
            };
            outside(&set, radius_m, y, elsewhere).unwrap_or(on_axis)
        }
    }
}

impl Beside {
    /// With what other directions say, given the normal.
    fn with(self, others: impl Fn(V3<f64>) -> f64) -> Self {
        Self { elsewhere: self.elsewhere.min(others(self.n)), ..self }
    }
}

/// Of a point outside a set, as seen from all points within a radius of it.
fn outside<P: Projectable>(set: &P, radius: f64, y: V3<f64>, elsewhere: f64) -> Option<Beside> {
    let seen = set.offset(Scalar, y);
    if !(seen.distance > 0.0) {
        return None;
    }
    let n = set.in_normal_cone(Scalar, seen.feature, seen.frame[2]);
    // Faces are flat, but walls, edges and corners have normals all around.
    let [k, m, l] = seen.curvature;
    let most = 0.5 * (k + l) + (0.5 * (k - l)).hypot(m);
    let is_round = most > 0.0;
    Some(Beside {
        lower: set.separation(Scalar, n, (y, 0.0)) - radius,
        upper: seen.distance - radius,
        n,
        nearest: add_scaled::<Scalar, f64>(set.project(Scalar, y), radius, n),
        elsewhere: if is_round { radius - elsewhere * seen.distance } else { f64::INFINITY },
        arm: if is_round { 1.0 / most } else { f64::INFINITY },
    })
}

/// Of a point in a box.
fn in_cuboid(half: V3<f64>, y: V3<f64>) -> Beside {
    let depth = |i: usize| half[i] - y[i].abs();
    let axis = (1..3).fold(0, |best, i| if depth(i) < depth(best) { i } else { best });
    let (mut n, mut nearest) = ([0.0; 3], y);
    n[axis] = 1_f64.copysign(y[axis]);
    nearest[axis] = half[axis].copysign(y[axis]);
    let value = -depth(axis);
    Beside { lower: value, upper: value, n, nearest, elsewhere: f64::INFINITY, arm: f64::INFINITY }
}

/// Of a point in a cylinder.
fn in_cylinder((radius, half_height): (f64, f64), y: V3<f64>) -> Beside {
    let out = y[0].hypot(y[1]);
    let (wall, cap) = (radius - out, half_height - y[2].abs());
    if wall < cap {
        let n = if out > 0.0 { [y[0] / out, y[1] / out, 0.0] } else { [1.0, 0.0, 0.0] };
        let on_wall = scaled::<Scalar, f64>(n, radius);
        let nearest = [on_wall[0], on_wall[1], y[2]];
        // Outwards the wall is as far as it may be.
        let lower = dot::<Scalar, f64>(n, y) - radius;
        return Beside { lower, upper: -wall, n, nearest, elsewhere: f64::INFINITY, arm: out };
    }
    let n = [0.0, 0.0, 1_f64.copysign(y[2])];
    let nearest = [y[0], y[1], half_height.copysign(y[2])];
    Beside { lower: -cap, upper: -cap, n, nearest, elsewhere: f64::INFINITY, arm: f64::INFINITY }
}
