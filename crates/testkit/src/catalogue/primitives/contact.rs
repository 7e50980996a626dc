//! Touching, flat and nearly touching primitives: 1, 3, 8, 13, 14, 15, 20.

use super::super::Draws;
use super::super::contact::{GRAZE, SMOOTH, gaps};
use super::{COUNT, Kind, PAIRS, Pair, Shape, apart, shapes};
use crate::random::{pose, shifted};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
use sublevel_core::measure::Pose;

/// Cases of [`kissing`]: all pairs along 3 axes.
pub const KISSING: u64 = 3 * COUNT;

/// Sizes of [`kissing`], which add up without rounding.
const HALVES: [[f64; 3]; 2] = [[0.5, 0.25, 1.0], [0.25, 2.0, 0.5]];

/// Family 1. Along one of the axes, from a centimetre of overlap to a centimetre apart, over an ulp
/// of the offset and none: error of at most 1e-12 m, of capsules on the flat tip of a body of
/// degree 8 the floor that `Options::with_accuracy` states for flat surfaces.
pub fn kissing(index: u64) -> Vec<Pair> {
    let (kinds, axis) = (PAIRS[(index % COUNT) as usize], (index / COUNT % 3) as usize);
    let [half_a, half_b] = [0, 1].map(|k| Shape::halves(kinds[k], HALVES[k])[axis]);
    let offset = half_a + half_b;
    let still = UnitQuaternion::identity();
    // A half-space is the first of its pair, and looks along the axis.
    let turn = if kinds[0] == Kind::HalfSpace {
        UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::ith(axis, 1.0)).unwrap_or_default()
    } else {
        still
    };
    let case = |gap: f64| {
        let [a, b] = [0, 1].map(|k| Shape::of_sizes(kinds[k], HALVES[k]));
        let place = pose(Vector3::ith(axis, offset + gap), &still);
        let exact = (place.translation()[axis] - offset).max(0.0);
        let pair = Pair::new(a, pose(Vector3::zeros(), &turn), b, place, format!("along axis {axis}, gap {gap:e} m"));
        let is_flat = kinds.contains(&Kind::Smooth) && pair.bodies().is_none();
        let bound = if is_flat { 1e-12 * (pair.a.reach_m().max(pair.b.reach_m()) + offset) } else { 1e-12 };
        Pair { accuracy: 1e-13, exact: Some(exact), bound: Some(bound), floor: 1e-12, ..pair }
    };
    // Segments side by side are apart whatever the sign, and the origin of one in a half-space
    // would lie behind the other one.
    let is_flat = offset == 0.0;
    gaps(offset.max(0.5)).into_iter().filter(|gap| !is_flat || *gap >= 0.0).map(case).collect()
}

/// A shape with a flat side or a straight one upwards and downwards, turned that way, and how high
/// it is then.
#[derive(Clone, Copy, Debug)]
enum Flat {
    /// Its face.
    Cuboid,
    /// Its cap.
    Disc,
    /// Its wall, along x.
    Roller,
    /// Along x.
    Capsule,
    /// Along x.
    Segment,
    HalfSpace,
    /// Its face, of no curvature in the middle.
    Smooth,
    /// Its face, which a slab has cut.
    Cut,
}

impl Flat {
    /// All pairs that have a measure; a half-space is below.
    const PAIRS: [[Self; 2]; FLATS as usize] = [
        [Self::Cuboid, Self::Capsule],
        [Self::Cuboid, Self::Disc],
        [Self::HalfSpace, Self::Cuboid],
        [Self::Cuboid, Self::Segment],
        [Self::Cuboid, Self::Cuboid],
        [Self::Smooth, Self::Capsule],
        [Self::Cuboid, Self::Smooth],
        [Self::Disc, Self::Disc],
        [Self::Roller, Self::Cuboid],
        [Self::Capsule, Self::Capsule],
        [Self::Roller, Self::Capsule],
        [Self::HalfSpace, Self::Disc],
        [Self::Disc, Self::Smooth],
        [Self::Roller, Self::Roller],
        [Self::HalfSpace, Self::Roller],
        [Self::Segment, Self::Disc],
        [Self::Cut, Self::Cuboid],
        [Self::Disc, Self::Cut],
        [Self::Cut, Self::Capsule],
        [Self::HalfSpace, Self::Cut],
        [Self::Segment, Self::Cut],
        [Self::Cut, Self::Smooth],
        [Self::Cut, Self::Cut],
        [Self::Roller, Self::Cut],
        [Self::HalfSpace, Self::Smooth],
        [Self::Segment, Self::Smooth],
        [Self::Roller, Self::Smooth],
        [Self::Disc, Self::Capsule],
        [Self::Roller, Self::Disc],
        [Self::HalfSpace, Self::Capsule],
        [Self::HalfSpace, Self::Segment],
    ];

    fn make(self, [x, y, z]: [f64; 3]) -> (Shape, UnitQuaternion<f64>, f64) {
        let (upright, lying) = (UnitQuaternion::identity(), UnitQuaternion::from_scaled_axis(Vector3::y() * FRAC_PI_2));
        let of = |kind| Shape::of_sizes(kind, [x, y, z]);
        match self {
            Self::Cuboid => (of(Kind::Cuboid), upright, z),
            Self::Disc => (of(Kind::Cylinder), upright, z),
            Self::Roller => (of(Kind::Cylinder), lying, x),
            Self::Capsule => (of(Kind::Capsule), lying, x),
            Self::Segment => (of(Kind::Segment), lying, 0.0),
            Self::HalfSpace => (Shape::HalfSpace, upright, 0.0),
            Self::Smooth => (of(Kind::Smooth), upright, z),
            Self::Cut => (of(Kind::Cut), upright, 0.6 * z),
        }
    }

    /// The second above the first by a gap, metres, tilted by this, radians.
    fn pair(which: u64, gap: f64, tilt: Vector3<f64>) -> Pair {
        let [below, above] = Self::PAIRS[(which % Self::PAIRS.len() as u64) as usize];
        let ((a, turn_a, half_a), (b, turn_b, half_b)) = (below.make([1.0, 1.0, 0.5]), above.make([0.75, 1.25, 0.5]));
        let place = Vector3::new(0.0, 0.0, half_a + half_b + gap);
        let tilted = UnitQuaternion::from_scaled_axis(tilt) * turn_b;
        Pair::new(a, pose(Vector3::zeros(), &turn_a), b, pose(place, &UnitQuaternion::new_normalize(*tilted)), "")
    }
}

/// Pairs of flat and straight sides.
const FLATS: u64 = 31;

/// Cases of [`parallel_faces`]: all pairs, 10 gaps at 11 tilts.
pub const PARALLEL_FACES: u64 = FLATS * 10 * 11;

/// Family 3. Flat and straight sides, gap 1e-3 to 1e-12 m, tilt none and 1e-16 to 1e-3 rad.
pub fn parallel_faces(index: u64) -> Pair {
    let gap = 10_f64.powi(-3 - (index / FLATS % 10) as i32);
    let tilt = match index / (10 * FLATS) % 11 {
        0 => 0.0,
        // Below and above what a cosine keeps.
        k @ 1..=3 => 10_f64.powi(-18 + 2 * k as i32),
        k => 10_f64.powi(-13 + k as i32),
    };
    let pair = Flat::pair(index, gap, Vector3::new(0.6 * tilt, 0.8 * tilt, 0.0));
    Pair { what: format!("{}gap {gap:e} m, tilt {tilt:e} rad", pair.what), ..pair }
}

/// Cases of [`parallel_flats`]: all pairs at 9 tilts with 9 accuracies.
pub const PARALLEL_FLATS: u64 = FLATS * 9 * 9;

/// Family 13. Flats a tenth apart: the error falls to the floor that `Options::with_accuracy`
/// states for flat surfaces, beyond it the status says.
pub fn parallel_flats(index: u64) -> Pair {
    let tilt = [0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2][(index / FLATS % 9) as usize];
    let accuracy = 10_f64.powi(-[4, 6, 8, 9, 10, 11, 12, 13, 14][(index / (9 * FLATS) % 9) as usize]);
    let pair = Flat::pair(index, 0.1, Vector3::new(0.6 * tilt, -0.8 * tilt, 0.0));
    let floor = 1e-12 * (pair.a.reach_m().max(pair.b.reach_m()) + 0.1);
    let wanted = accuracy * pair.size();
    // A bracket has two sides.
    let wide = if wanted < floor { 2.0 * floor } else { 0.0 };
    let what = format!("{}tilt {tilt:e} rad, accuracy {accuracy:e}", pair.what);
    Pair { accuracy, floor: wide, bound: Some(wanted.max(floor)), what, ..pair }
}

/// Gaps of family 8, relative to the size of the pair.
pub const TOUCHING: [f64; 4] = [1e-3, 1e-6, 1e-8, 0.0];

/// Families 8 and 20. Apart, then moved to a gap, relative to the size of the pair.
pub fn at_gap(index: u64, gap: f64, random: &mut dyn Draws) -> Pair {
    let pair = apart(shapes(index, [1.0, 1.0], random), random, &format!("gap {gap:e} of the smaller"));
    // Moved by a value that is known to much less than the gap.
    let fine = Pair { accuracy: 1e-12, ..pair };
    let gap = gap * fine.size();
    Pair { accuracy: sublevel_core::measure::DEFAULT_ACCURACY, ..fine.moved_to(gap) }
}

/// Cases of [`tips`]: 9 tips on 5 flats, at 4 gaps in 4 places.
pub const TIPS: u64 = 720;

/// Family 14. A tip that points down at a flat: corners, rims, ends, and one of degree 8.
pub fn tips(index: u64, random: &mut dyn Draws) -> Option<Pair> {
    let turned = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
    let still = UnitQuaternion::identity();
    let (tip, turn, height) = match index % 9 {
        0 => (Shape::of_sizes(Kind::Capsule, [0.1, 0.1, 0.9]), still, 1.0),
        1 => {
            // A corner of a cube straight down.
            let turn = UnitQuaternion::rotation_between(&Vector3::new(1.0, 1.0, 1.0), &Vector3::z());
            (Shape::of_sizes(Kind::Cuboid, [0.2; 3]), turn.unwrap_or_default(), 0.2 * 3_f64.sqrt())
        }
        2 => (
            Shape::of_sizes(Kind::Cylinder, [0.1, 0.1, 1.0]),
            turned(Vector3::y(), 0.6),
            0.6_f64.cos() + 0.1 * 0.6_f64.sin(),
        ),
        3 => (Shape::of_sizes(Kind::Segment, [0.0, 0.0, 1.0]), turned(Vector3::x(), 0.4), 0.4_f64.cos()),
        4 => (Shape::Point, still, 0.0),
        5 => (Shape::of_sizes(Kind::Ball, [0.01; 3]), still, 0.01),
        6 => (Shape::of_sizes(Kind::Smooth, [0.1, 0.1, 1.0]), still, 1.0),
        7 => (Shape::of_sizes(Kind::Ellipsoid, [0.1, 0.2, 1.0]), still, 1.0),
        // An edge.
        _ => {
            (Shape::of_sizes(Kind::Cuboid, [0.2, 0.5, 0.2]), turned(Vector3::y(), FRAC_PI_2 * 0.5), 0.4 * FRAC_1_SQRT_2)
        }
    };
    let (flat, top) = match index / 9 % 5 {
        0 => (Shape::of_sizes(Kind::Cuboid, [1.0, 1.0, 0.1]), 0.1),
        1 => (Shape::HalfSpace, 0.0),
        2 => (Shape::of_sizes(Kind::Cylinder, [1.0, 1.0, 0.01]), 0.01),
        3 => (Shape::of_sizes(Kind::Cut, [1.0, 1.0, 0.1]), 0.06),
        _ => (Shape::of_sizes(Kind::Smooth, [1.0, 1.0, 0.1]), 0.1),
    };
    // The distance of a point from a half-space is not among the measures.
    if matches!((&tip, &flat), (Shape::Point, Shape::HalfSpace)) {
        return None;
    }
    let gap = [1e-9, 1e-6, 1e-3, 0.3][(index / 45 % 4) as usize];
    let aside = [0.0, 1e-6, 1e-3, 0.2][(index / 180 % 4) as usize];
    let turn = turned(Vector3::z(), random.signed()) * turn;
    let place = pose(Vector3::new(aside, -0.5 * aside, top + height + gap), &UnitQuaternion::new_normalize(*turn));
    Some(Pair::new(flat, Pose::identity(), tip, place, format!("gap {gap:e} m, {aside:e} m aside")))
}

/// Family 15. 20 cm, 2 mm apart or into each other: error of at most [`SMOOTH`].
pub fn grazing(index: u64, random: &mut dyn Draws) -> Pair {
    let gap = if (index / COUNT).is_multiple_of(2) { GRAZE } else { -GRAZE };
    let pair = apart(shapes(index, [0.1, 0.1], random), random, &format!("gap {gap:e} m"));
    let placed = Pair { accuracy: 1e-13, ..pair }.moved_to(gap);
    Pair { accuracy: SMOOTH / placed.size(), bound: Some(SMOOTH), ..placed }
}

/// A slide of a capsule, a segment or a half-space into another shape, to where their origins meet.
pub struct Slide {
    start: Pair,
    way: Vector3<f64>,
}

/// Family 16. From apart to concentric.
pub fn slide(index: u64, random: &mut dyn Draws) -> Option<Slide> {
    // About their origins, which lie inside of them.
    let shapes = PAIRS[(index % COUNT) as usize].map(|kind| Shape::centred(kind, 1.0, random));
    let start = apart(shapes, random, "sliding");
    let way = start.pose_a.translation() - start.pose_b.translation();
    Some(Slide { start, way }).filter(|slide| slide.start.bodies().is_none())
}

impl Slide {
    /// The pair after this share of the way.
    pub fn after(&self, share: f64) -> Pair {
        let pose_b = shifted(&self.start.pose_b, self.way * share);
        Pair { pose_b, what: format!("{} {share:e} of the way", self.start.what), ..self.start.clone() }
    }

    /// The whole way, metres.
    pub fn length(&self) -> f64 {
        self.way.norm()
    }

    /// Where to look: more of it about where a share is, as where they touch.
    pub fn shares(touching: f64) -> Vec<f64> {
        let mut shares: Vec<f64> = (0..=12).map(|k| f64::from(k) / 12.0).collect();
        for near in [1e-3, 1e-6, 1e-9, 1e-12] {
            shares.extend([touching - near, touching + near, 1.0 - near]);
        }
        shares.retain(|share| (0.0..=1.0).contains(share));
        shares.sort_by(f64::total_cmp);
        shares
    }
}
