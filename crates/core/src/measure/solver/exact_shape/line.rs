//! Where a line enters a shape.

use crate::body::ExactShape;
use nalgebra::Vector3;

/// `y(τ) = start + τ velocity`, metres, in the frame of a shape; the velocity is of about length 1.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Line {
    pub(in crate::measure) start: Vector3<f64>,
    pub(in crate::measure) velocity: Vector3<f64>,
}

impl Line {
    fn at(&self, s: f64) -> Vector3<f64> {
        self.start + self.velocity * s
    }
}

/// A set whose boundary a line meets at the roots of quadratics, about the origin of its frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) enum Target {
    Ball {
        radius: f64,
    },
    Cuboid {
        half: Vector3<f64>,
    },
    /// All points within a radius above 0 of a box.
    RoundedCuboid {
        half: Vector3<f64>,
        radius: f64,
    },
    Cylinder {
        radius: f64,
        half_height: f64,
    },
}

/// Parameters between two bounds; none if the first is larger.
type Span = (f64, f64);

const ALL: Span = (f64::NEG_INFINITY, f64::INFINITY);
const NONE: Span = (f64::INFINITY, f64::NEG_INFINITY);

impl Target {
    /// All points within a radius, metres, of a shape; none where no quadratic bounds them.
    pub(in crate::measure) fn within(radius: f64, shape: &ExactShape) -> Option<Self> {
        Some(match *shape {
            ExactShape::Capsule { radius_m, half_length_m: 0.0 } => Self::Ball { radius: radius_m + radius },
            ExactShape::Cuboid { half_extents_m, .. } if radius == 0.0 => Self::Cuboid { half: half_extents_m.into() },
            ExactShape::Cuboid { half_extents_m, .. } => Self::RoundedCuboid { half: half_extents_m.into(), radius },
            ExactShape::Cylinder { radius_m, half_height_m, .. } if radius == 0.0 => {
                Self::Cylinder { radius: radius_m, half_height: half_height_m }
            }
            _ => return None,
        })
    }

    /// Radius of the ball about the origin that contains the set, metres, but for rounding.
    pub(in crate::measure) fn reach(&self) -> f64 {
        match *self {
            Self::Ball { radius } => radius,
            Self::Cuboid { half } => half.norm(),
            Self::RoundedCuboid { half, radius } => half.norm() + radius,
            Self::Cylinder { radius, half_height } => radius.hypot(half_height),
        }
    }

    /// First parameter of a span at which a line is in the set with all sizes larger by a length,
    /// or smaller if it is negative; none if there is no such parameter.
    ///
    /// Rounding counts as if the sizes were others by [`Target::rounding`].
    #[inline(always)]
    pub(in crate::measure) fn first(&self, line: &Line, larger: f64, (from, to): Span) -> Option<f64> {
        let Line { start, velocity } = line;
        let slab = |i: usize, half: f64| slab(start[i], velocity[i], half + larger);
        let both = |a: Span, b: Span| (a.0.max(b.0), a.1.min(b.1));
        let (enters, leaves) = match *self {
            Self::Ball { radius } => round(start, velocity, radius + larger),
            Self::Cuboid { half } => both(both(slab(0, half.x), slab(1, half.y)), slab(2, half.z)),
            Self::RoundedCuboid { half, radius } => return rounded_cuboid(line, &half, radius + larger, (from, to)),
            Self::Cylinder { radius, half_height } => {
                let across = |v: &Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
                both(round(&across(start), &across(velocity), radius + larger), slab(2, half_height))
            }
        };
        let first = enters.max(from);
        (first <= leaves.min(to)).then_some(first)
    }

    /// By how much the sizes of the set would have to be others for [`Target::first`] to be exact,
    /// metres, on a line whose `start` is at most this far out, and at parameters within the reach
    /// of the set: what is rounded moves the line by a few roundings of these lengths.
    pub(in crate::measure) fn rounding(&self, start: f64) -> f64 {
        16.0 * f64::EPSILON * (self.reach() + start)
    }

    /// Outward unit normal of the surface through which a line enters at a parameter: of those that
    /// it moves towards, the one it is farthest beyond. None at the centre of a ball, and of
    /// rounded boxes.
    pub(in crate::measure) fn normal(&self, line: &Line, s: f64) -> Option<Vector3<f64>> {
        let (y, v) = (line.at(s), &line.velocity);
        let entered = |beyond: f64, outwards: f64| if outwards < 0.0 { beyond } else { f64::NEG_INFINITY };
        match *self {
            Self::Ball { .. } => y.try_normalize(0.0),
            Self::Cuboid { half } => {
                let axis = Vector3::from_fn(|i, _| entered(y[i].abs() - half[i], y[i] * v[i])).imax();
                let mut normal = Vector3::zeros();
                normal[axis] = 1_f64.copysign(y[axis]);
                Some(normal)
            }
            Self::Cylinder { radius, half_height } => {
                let out = y.x.hypot(y.y);
                let wall = entered(out - radius, y.x * v.x + y.y * v.y);
                let is_wall = wall > entered(y.z.abs() - half_height, y.z * v.z);
                let wall = || Vector3::new(y.x / out, y.y / out, 0.0);
                Some(if is_wall { wall() } else { Vector3::new(0.0, 0.0, 1_f64.copysign(y.z)) })
            }
            Self::RoundedCuboid { .. } => None,
        }
    }
}

/// Where `|y + τ v| <= half`.
#[inline(always)]
fn slab(y: f64, v: f64, half: f64) -> Span {
    if half < 0.0 {
        return NONE;
    }
    if v.abs() < f64::MIN_POSITIVE {
        return if y.abs() <= half { ALL } else { NONE };
    }
    let inverse = 1.0 / v;
    let (one, other) = ((-half - y) * inverse, (half - y) * inverse);
    (one.min(other), one.max(other))
}

/// Where `|y + τ v| <= radius`, the components that do not count being 0.
///
/// With b the parameter of the point nearest to the origin, and p that point, the roots are `b ±
/// √((r - |p|) (r + |p|)) / |v|`: no digits are lost where the line passes far from the origin, or
/// where it hardly moves.
#[inline(always)]
fn round(y: &Vector3<f64>, v: &Vector3<f64>, radius: f64) -> Span {
    if radius < 0.0 {
        return NONE;
    }
    let square = v.norm_squared();
    if square < f64::MIN_POSITIVE {
        return if y.norm() <= radius { ALL } else { NONE };
    }
    let nearest = -y.dot(v) / square;
    let aside = (y + v * nearest).norm();
    if aside > radius {
        return NONE;
    }
    let half = ((radius - aside) * (radius + aside) / square).sqrt();
    (nearest - half, nearest + half)
}

/// First parameter of a span at which a line is within a radius of a box: from one of the 27
/// regions about the box to the next, in each of which the distance is that from a face, an edge or
/// a corner, until one of these is near enough.
fn rounded_cuboid(line: &Line, half: &Vector3<f64>, radius: f64, (from, to): Span) -> Option<f64> {
    let Line { start, velocity } = line;
    if radius < 0.0 {
        return None;
    }
    let (mut s, mut to, mut sides) = (from, to, [ALL; 3]);
    for i in 0..3 {
        let (enters, leaves) = slab(start[i], velocity[i], half[i] + radius);
        (s, to) = (s.max(enters), to.min(leaves));
        sides[i] = slab(start[i], velocity[i], half[i]);
    }
    // Each of the six planes is crossed once at most.
    for _ in 0..7 {
        if !(s <= to) {
            return None;
        }
        let (mut y, mut v, mut next) = (Vector3::zeros(), Vector3::zeros(), to);
        for (i, &(enters, leaves)) in sides.iter().enumerate() {
            let side = if s < enters {
                -1_f64.copysign(velocity[i])
            } else if s >= leaves {
                1_f64.copysign(velocity[i])
            } else {
                0.0
            };
            // A line that does not move along an axis is on one side of it for good.
            let side = if (enters, leaves) == NONE { 1_f64.copysign(start[i]) } else { side };
            if side != 0.0 {
                (y[i], v[i]) = (start[i] - side * half[i], velocity[i]);
            }
            let crossing = if s < enters { enters } else { leaves };
            if crossing > s {
                next = next.min(crossing);
            }
        }
        let (enters, leaves) = round(&y, &v, radius);
        let first = enters.max(s);
        if first <= leaves.min(next) {
            return Some(first);
        }
        if !(next < to) {
            return None;
        }
        s = next;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::{Line, Target};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// How far a point is beyond the set, at least to its sign.
    fn beyond(target: &Target, y: &Vector3<f64>) -> f64 {
        match *target {
            Target::Ball { radius } => y.norm() - radius,
            Target::Cuboid { half } => (y.abs() - half).max(),
            Target::RoundedCuboid { half, radius } => (y.abs() - half).map(|beyond| beyond.max(0.0)).norm() - radius,
            Target::Cylinder { radius, half_height } => (y.x.hypot(y.y) - radius).max(y.z.abs() - half_height),
        }
    }

    /// A random set, with sizes over six decades among which needles are.
    fn target(random: &mut Seeded, kind: u64) -> Target {
        let mut size = || 10_f64.powf(3.0 * random.signed());
        let half = Vector3::new(size(), size(), size());
        let radius = size();
        match kind {
            0 => Target::Ball { radius },
            1 => Target::Cuboid { half },
            2 => Target::RoundedCuboid { half, radius },
            _ => Target::Cylinder { radius, half_height: half.z },
        }
    }

    /// All before the first parameter is outside, and there the line is on the boundary: by
    /// sampling and bisection along lines in any direction, along axes, and within roundings of
    /// these.
    #[test]
    fn lines_enter_where_the_set_begins() {
        let (mut hits, mut misses) = (0, 0);
        for seed in 0..12_000 {
            let mut random = Seeded(seed);
            let target = target(&mut random, seed % 4);
            let reach = target.reach();
            let mut velocity = match seed / 4 % 4 {
                0 => Vector3::ith((seed / 16 % 3) as usize, 1.0),
                1 => Vector3::ith((seed / 16 % 3) as usize, -1.0) + random.unit() * 1e-16,
                _ => random.unit(),
            };
            velocity = velocity.normalize();
            let aim = random.unit().component_mul(&match target {
                Target::Cuboid { half } | Target::RoundedCuboid { half, .. } => half,
                Target::Ball { radius } => Vector3::repeat(radius),
                Target::Cylinder { radius, half_height } => Vector3::new(radius, radius, half_height),
            }) * 1.3;
            let line = Line { start: aim - velocity * aim.dot(&velocity), velocity };
            let (from, to) = (-1.5 * reach, 1.5 * reach);
            let off = target.rounding(line.start.norm());
            let at = |s: f64| beyond(&target, &(line.start + velocity * s));
            let label = format!("seed {seed}: {target:?} {line:?}");
            let sampled = (0..=3000).map(|k| from + f64::from(k) * 1e-3 * reach).find(|s| at(*s) <= 0.0);
            let (outer, inner) = (target.first(&line, off, (from, to)), target.first(&line, -off, (from, to)));
            if let Some(sampled) = sampled {
                let outer = outer.unwrap_or_else(|| panic!("{label}: missed"));
                assert!(outer <= sampled, "{label}: {outer} after {sampled}");
            }
            if let Some(inner) = inner {
                hits += 1;
                let outer = outer.unwrap_or_else(|| panic!("{label}: missed"));
                assert!(outer <= inner, "{label}");
                assert!(at(inner) <= 0.0, "{label}: {}", at(inner));
                // Rounded, the set begins between both.
                assert!(outer == from || at(outer) >= 0.0, "{label}: {}", at(outer));
                assert!(sampled.is_none_or(|s| s >= outer), "{label}");
                // From within it is there at once.
                let middle = 0.5
                    * (inner
                        + target
                            .first(&Line { velocity: -velocity, ..line }, -off, (-to, -from))
                            .map_or(inner, |s| -s));
                assert_eq!(target.first(&line, 0.0, (middle, to)), Some(middle), "{label}");
            } else if outer.is_none() {
                misses += 1;
                assert!(sampled.is_none(), "{label}: {sampled:?}");
            }
        }
        assert!(hits > 5000 && misses > 1000, "{hits} {misses}");
    }
}
