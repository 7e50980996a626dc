//! The directions across the pieces of the surface of the difference of a box and a cylinder.
//!
//! From inside, the nearest boundary point of a convex set has one normal n only: a ball about the
//! point inside touches there. The faces of the difference across n are sums of those of both
//! shapes, and n is alone where two of these have no other common normal: across a side of the box
//! or a cap, or along an edge (n across it) with any point of the rim, or along the wall (n across
//! the axis) with any corner. A corner and a point of the rim share normals all around n. So the
//! depth is the least of the overlap along the axis and the depths, each in a plane, of the four
//! shadows along the edges and along the axis.
//!
//! Along the axis the shadow is a hexagon enlarged by the radius: least is the overlap across its
//! sides, or from a point beyond them the one towards the nearest corner, `r - |w|`.
//!
//! Along an edge it is a hexagon enlarged by an ellipse, of the semi-axes r across the axis and
//! `ζ r` along it, ζ the cosine of the angle between axis and edge. Towards `(u, 1)`, in units of
//! `sqrt(1 + u²)`, and with w from the centre of the ellipse at a corner to the point, the overlap
//! and its slope are
//!
//! ```text
//! f = (r sqrt(u² + ζ²) - u w_x - w_y) / sqrt(1 + u²),   f' = -g(u) / sqrt(1 + u²)³,
//! g(u) = w_x - w_y u - κ u / sqrt(u² + ζ²),             κ = r (1 - ζ²).
//! ```
//!
//! g falls through 0 where f is least. Where `w_x >= 0` it does so at no `u < 0`, and for `u > 0`
//! it is convex: Newton's method from where g is positive stays below that root, and there is none
//! where it passes the end of the arc or the slope of g turns positive. Between an iterate and the
//! root is `0 <= g <= g(u)`, so that f falls no farther than by g(u) times what remains of
//! `u / sqrt(1 + u²)` up to 1. The corners change where n is across a side of the box; arcs whose
//! chord is as far from the point as the best overlap known have nothing better.

use super::cuboid_axes::{ALIGNED, LeastOverlap};
use crate::measure::frames::vector::V3;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Number of directions that may be found: across 3 sides, the axis, and 3 edges and the axis;
/// towards 8 corners, and on 6 arcs across each edge.
const MOST: usize = 7 + 8 + 18;

/// Along which line the difference is straight across a direction.
#[derive(Clone, Copy, Debug)]
enum Straight {
    /// All around.
    Face,
    /// Along an edge of the box.
    Edge(usize),
    /// Along the cylinder's axis.
    Axis,
}

/// A direction across which the boundary of the difference may be nearest.
#[derive(Clone, Copy, Debug)]
struct Facing {
    /// Unit vector from the box to the cylinder, in the box's frame.
    n: Vector3<f64>,
    /// By how much the shapes overlap along it, metres.
    overlap: f64,
    /// How far places have to be off for it to be off by a radian, metres.
    arm: f64,
    straight: Straight,
}

/// All that are found, and what they prove.
struct Facings {
    all: [Facing; MOST],
    count: usize,
    /// None of those found so far overlaps less, but for rounding; metres.
    least: f64,
}

/// An arc of an ellipse; lengths in metres.
pub(super) struct EllipseArc {
    pub(super) radius: f64,
    /// Ratio of the semi-axes.
    pub(super) zeta: f64,
    /// From the centre of the ellipse to the point, along its major and minor semi-axis.
    pub(super) w: [f64; 2],
    /// Normals `(u, 1)` at the ends.
    pub(super) ends: [f64; 2],
}

/// A box and a cylinder, which is seen from the box.
#[derive(Clone, Copy, Debug)]
pub(super) struct CuboidCylinder {
    pub(super) half: V3<f64>,
    pub(super) radius: f64,
    pub(super) half_height: f64,
    /// Unit vector along the cylinder's axis, in the box's frame.
    pub(super) axis: Vector3<f64>,
    /// From the box's centre to the cylinder's, in the box's frame, metres.
    pub(super) between: Vector3<f64>,
    /// Bounds of the error of the axis, and of places that are not turned by it, metres.
    pub(super) turned: f64,
    pub(super) displacement: f64,
}

impl Facings {
    fn push(&mut self, facing: Facing, lower: f64) {
        self.all[self.count] = facing;
        self.count += 1;
        self.least = self.least.min(lower);
    }

    fn iter(&self) -> impl Iterator<Item = &Facing> {
        self.all[..self.count].iter()
    }
}

impl CuboidCylinder {
    /// Bound of the error of the overlap along a direction, metres.
    pub(super) fn error(&self) -> f64 {
        self.displacement + (self.turned + gamma(64)) * self.reach()
    }

    /// Both sizes and the vector between the centres, metres.
    fn reach(&self) -> f64 {
        Vector3::from(self.half).norm() + self.radius.hypot(self.half_height) + self.between.norm()
    }

    /// By how much the shapes overlap along a unit vector from the box to the cylinder, metres.
    fn overlap(&self, n: &Vector3<f64>) -> f64 {
        let of_box: f64 = (0..3).map(|i| self.half[i] * n[i].abs()).sum();
        let of_cylinder = self.radius * n.cross(&self.axis).norm() + self.half_height * n.dot(&self.axis).abs();
        of_box + of_cylinder - n.dot(&self.between)
    }

    /// The direction along which they overlap least; none where it is not known to 1e-7. Directions
    /// at an angle with a cosine below `elsewhere` are others; those that overlap by no more than
    /// `within` times the least are looked for. The lower bound is that of shapes that do overlap:
    /// apart, there may be a separating direction that is none of these.
    pub(super) fn least_overlap(&self, elsewhere: f64, within: f64) -> Option<LeastOverlap> {
        let error = self.error();
        let mut found = self.flat();
        let first = found.iter().min_by(|p, q| p.overlap.total_cmp(&q.overlap))?;
        if first.overlap + error < 0.0 {
            let upper = first.overlap + error;
            return Some(LeastOverlap { lower: f64::NEG_INFINITY, upper, n: first.n.into(), elsewhere: f64::INFINITY });
        }
        self.corners(&mut found);
        (0..3).for_each(|i| self.arcs(i, within, &mut found));
        let accurate = || found.iter().filter(|facing| error <= ALIGNED * facing.arm);
        let by_overlap = |p: &&Facing, q: &&Facing| p.overlap.total_cmp(&q.overlap);
        let best = accurate().min_by(by_overlap)?;
        // Just past the end of a side, what is there overlaps by as much but for rounding, and its
        // normal is another.
        let past = accurate().filter(|facing| !matches!(facing.straight, Straight::Face));
        let past = past.filter(|facing| facing.overlap <= best.overlap + error && facing.n.dot(&best.n) > elsewhere);
        let best = past.min_by(by_overlap).unwrap_or(best);
        // One error for what is rounded here, one for that of the places.
        let rounding = 2.0 * error;
        if !(best.overlap - found.least <= rounding) {
            return None;
        }
        let n = best.n;
        let others = found.iter().filter(|facing| facing.n.dot(&n) < elsewhere).map(|facing| facing.overlap);
        let opposite = best.overlap + 2.0 * n.dot(&self.between);
        let mut least = others.fold(opposite, f64::min);
        let line = match best.straight {
            Straight::Face => None,
            Straight::Edge(i) => Some(Vector3::ith(i, 1.0)),
            Straight::Axis => Some(self.axis),
        };
        if let Some(line) = line {
            // Arcs have normals all around.
            let around = n.cross(&line) * (1.0 - elsewhere * elsewhere).sqrt();
            for turned in [n * elsewhere + around, n * elsewhere - around] {
                least = least.min(self.overlap(&turned));
            }
        }
        Some(LeastOverlap { lower: found.least - rounding, upper: best.overlap + error, n: n.into(), elsewhere: least })
    }

    /// Across the sides of the box, the axis, and edges and the axis: these first three, last.
    fn flat(&self) -> Facings {
        let facing = |n: Vector3<f64>, arm: f64| {
            let n = n * 1_f64.copysign(n.dot(&self.between));
            Facing { n, overlap: self.overlap(&n), arm, straight: Straight::Face }
        };
        let first = facing(Vector3::x(), f64::INFINITY);
        let mut found = Facings { all: [first; MOST], count: 1, least: first.overlap };
        let mut push = |facing: Facing| found.push(facing, facing.overlap);
        push(facing(Vector3::y(), f64::INFINITY));
        push(facing(Vector3::z(), f64::INFINITY));
        push(facing(self.axis, f64::INFINITY));
        for i in 0..3 {
            let ([l, m], tilt) = self.tilt(i);
            let mut n = Vector3::zeros();
            (n[(i + 1) % 3], n[(i + 2) % 3]) = (-m, l);
            // The axis is off by `turned`, and n by that over the sine of its angle with the edge.
            push(facing(n, tilt * self.reach()));
        }
        found
    }

    /// The direction of the axis in the plane across an edge, any if it is along the edge, and how
    /// long its shadow is there: the sine of its angle with the edge.
    fn tilt(&self, edge: usize) -> ([f64; 2], f64) {
        let (j, k) = (self.axis[(edge + 1) % 3], self.axis[(edge + 2) % 3]);
        let tilt = (j * j + k * k).sqrt();
        (if tilt > 0.0 { [j / tilt, k / tilt] } else { [1.0, 0.0] }, tilt)
    }

    /// Across the axis towards corners of the box.
    fn corners(&self, found: &mut Facings) {
        // From within all sides of the hexagon no corner is nearer than they are.
        if found.all[4..7].iter().all(|across| across.overlap >= self.radius) {
            return;
        }
        for mask in 0..8 {
            let sign = Vector3::from_fn(|i, _| if mask >> i & 1 == 0 { 1.0 } else { -1.0 });
            let from = self.between - sign.component_mul(&Vector3::from(self.half));
            let w = from - self.axis * self.axis.dot(&from);
            let distance = w.norm();
            // Whether the hexagon has its corner there as seen from the point, but for rounding: a
            // corner too many is as far away as it is.
            if distance > 0.0 && (0..3).all(|i| w[i] * sign[i] >= -gamma(16) * self.reach()) {
                let n = w / distance;
                let facing = Facing { n, overlap: self.overlap(&n), arm: distance, straight: Straight::Axis };
                found.push(facing, self.radius - distance);
            }
        }
    }

    /// Across an edge, on the arcs of its shadow that reach within a factor of the best.
    fn arcs(&self, edge: usize, within: f64, found: &mut Facings) {
        let (j, k) = ((edge + 1) % 3, (edge + 2) % 3);
        let (r, zeta) = (self.radius, self.axis[edge].abs().min(1.0));
        let ([l, m], tilt) = self.tilt(edge);
        // Mirrored so that the axis points up both ways.
        let mirror = [1_f64.copysign(l), 1_f64.copysign(m)];
        let (l, m) = (l.abs(), m.abs());
        let rise = self.half_height * tilt;
        let on_ellipse = |x: f64, y: f64| {
            let length = (x * x + zeta * y * (zeta * y)).sqrt();
            if length > 0.0 { [r * x / length, r * zeta * zeta * y / length] } else { [0.0; 2] }
        };
        // Where n is across the sides of the box.
        let (low, high) = (-m / l, l / m);
        let (at_low, at_high) = (on_ellipse(-m, l), on_ellipse(l, m));
        let (a, b) = (self.half[j], self.half[k]);
        for side in [1.0, -1.0] {
            let turn = mirror.map(|sign| sign * side);
            for (ends, [from, to], corner) in [
                ([f64::NEG_INFINITY, low], [[-r, 0.0], at_low], [a, -b]),
                ([low, high], [at_low, at_high], [a, b]),
                ([high, f64::INFINITY], [at_high, [r, 0.0]], [-a, b]),
            ] {
                let off = [
                    turn[0] * self.between[j] - corner[0] - rise * l,
                    turn[1] * self.between[k] - corner[1] - rise * m,
                ];
                let w = [l * off[1] - m * off[0], l * off[0] + m * off[1]];
                let limit = within * found.least.max(0.0);
                if !(ends[0] < ends[1]) || is_beyond(w, from, to, limit) {
                    continue;
                }
                let arc = EllipseArc { radius: r, zeta, w, ends };
                let Some((u, lower)) = arc.least(gamma(32) * self.reach()) else { continue };
                let root = u.hypot(1.0);
                let mut n = Vector3::zeros();
                (n[j], n[k]) = (turn[0] * (l - u * m) / root, turn[1] * (m + u * l) / root);
                let overlap = self.overlap(&n);
                // Radius of the curvature of the ellipse less that of the ball that touches it.
                let arm = r * zeta * zeta * (root / (u * u + zeta * zeta).sqrt()).powi(3) - overlap;
                found.push(Facing { n, overlap, arm, straight: Straight::Edge(edge) }, lower);
            }
        }
    }
}

/// Whether a chord with the set on its right is at least that far from a point on that side.
fn is_beyond(point: [f64; 2], from: [f64; 2], to: [f64; 2], limit: f64) -> bool {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let area = x * (from[1] - point[1]) - y * (from[0] - point[0]);
    area > 0.0 && area * area >= limit * limit * (x * x + y * y)
}

impl EllipseArc {
    /// Where the overlap is least on it, as the slope u, and a lower bound of that, metres; none
    /// where it is least at an end. g counts as 0 from the tolerance on, metres.
    pub(super) fn least(&self, tolerance: f64) -> Option<(f64, f64)> {
        let Self { radius, zeta, w: [x, y], ends } = *self;
        let (x, [from, to]) = if x < 0.0 { (-x, [-ends[1], -ends[0]]) } else { (x, ends) };
        let bent = radius * (1.0 - zeta) * (1.0 + zeta);
        // The bent part of g is at most κ and at most its tangent at 0.
        if !(to > 0.0) || x > bent && y <= 0.0 {
            return None;
        }
        let start = if y < 0.0 {
            let sine = x / bent;
            if sine < 1.0 { zeta * sine / ((1.0 - sine) * (1.0 + sine)).sqrt() } else { 0.0 }
        } else {
            let saturated = if x > bent { (x - bent) / y } else { 0.0 };
            saturated.max(if x > 0.0 { x * zeta / (y * zeta + bent) } else { 0.0 })
        };
        let mut u = from.max(start).max(0.0);
        let mut steps = 0;
        let (g, root) = loop {
            let root = (u * u + zeta * zeta).sqrt();
            // Without width the ellipse has a straight side there, across the axis.
            if !(u < to && root > 0.0) {
                return None;
            }
            let g = x - y * u - bent * u / root;
            // The bound holds after any number of steps, but may be wide.
            if g <= tolerance || steps == 32 {
                break (g, root);
            }
            let share = zeta / root;
            let slope = -y - bent * share * share / root;
            if !(slope < 0.0) {
                if g > 4.0 * tolerance {
                    return None;
                }
                break (g, root);
            }
            let next = u - g / slope;
            if next == u {
                break (g, root);
            }
            (u, steps) = (next, steps + 1);
        };
        // At an end of the arc, as across the side there.
        if g <= 0.0 && u == from && u > 0.0 {
            return None;
        }
        let length = (1.0 + u * u).sqrt();
        let overlap = (radius * root - u * x - y) / length;
        let lower = overlap - g.max(0.0) / (length * (length + u));
        Some((if self.w[0] < 0.0 { -u } else { u }, lower))
    }
}

#[cfg(test)]
mod tests {
    use super::CuboidCylinder;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// A cylinder whose axis is all but along an edge of the box, which is just inside its wall:
    /// the corners at both ends of the edge are as near but for rounding, and count.
    #[test]
    fn corners_at_the_ends_of_an_edge_along_the_axis_count() {
        let (mut answered, count) = (0, 4000);
        for seed in 0..count {
            let mut random = Seeded(seed);
            let tilt = 10_f64.powf(-9.0 + 3.0 * random.positive());
            let axis = Vector3::new(tilt * random.signed(), tilt * random.signed(), 1.0_f64.next_down());
            let mut beyond = || 10_f64.powf(-9.0 + 2.0 * random.positive());
            let half = [0.5, 0.6, 1.0];
            let between = Vector3::new(half[0] + beyond(), half[1] + beyond(), 0.5 * random.signed());
            let pair = CuboidCylinder {
                half,
                radius: 0.5,
                half_height: 5.0,
                axis: if seed % 2 == 0 { axis } else { axis.normalize() },
                between,
                turned: 0.0,
                displacement: 0.0,
            };
            let Some(found) = pair.least_overlap(0.99, 1.0) else { continue };
            answered += 1;
            for end in [1.0, -1.0] {
                let from = between - Vector3::new(half[0], half[1], end * half[2]);
                let across = from - pair.axis * pair.axis.dot(&from);
                let overlap = pair.overlap(&across.normalize());
                assert!(found.lower <= overlap, "seed {seed}: {} {overlap}", found.lower);
            }
        }
        assert!(answered > count / 4, "{answered} of {count}");
    }
}
