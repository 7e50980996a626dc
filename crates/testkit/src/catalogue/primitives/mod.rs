//! The families between primitives: boxes, cylinders, balls and ellipsoids, and what no polynomial
//! describes: capsules, segments, points and half-spaces; with each other and beside smooth bodies.
//!
//! Every family goes through [`PAIRS`] by its index, so that each primitive takes part in each.

pub mod contact;
pub mod data;
mod flaw;
pub mod placement;
pub mod scale;
mod shape;
mod solved;

use super::{Case, Draws};
use crate::random::{pose, shifted};
pub use flaw::Flaw;
use nalgebra::{UnitQuaternion, Vector3};
pub use shape::{Kind, Shape};
pub use solved::{Reference, Solved};
use sublevel_core::measure::{DEFAULT_ACCURACY, MAX_ITERATIONS, Options, Pose, WarmStart};

/// Two shapes at their poses whose signed distance is asked for, and what is known of it.
#[derive(Clone, Debug)]
pub struct Pair {
    pub a: Shape,
    pub pose_a: Pose,
    pub b: Shape,
    pub pose_b: Pose,
    /// Accuracy asked for, relative to [`Pair::size`].
    pub accuracy: f64,
    /// Most iterations, where the family is about that.
    pub limit: Option<u32>,
    /// The distance where it is known, metres, 0 in overlap.
    pub exact: Option<f64>,
    /// Largest error of our answers, metres, where the family asks for more than a true bracket.
    pub bound: Option<f64>,
    /// Largest width, metres, that the bracket of a case below the rounding floor may keep.
    pub floor: f64,
    /// Shapes and settings in words.
    pub what: String,
}

impl Pair {
    /// At the default accuracy, with nothing known.
    pub fn new(a: Shape, pose_a: Pose, b: Shape, pose_b: Pose, what: impl AsRef<str>) -> Self {
        let what = format!("{}-{} {}", a.name(), b.name(), what.as_ref());
        Self {
            a,
            pose_a,
            b,
            pose_b,
            accuracy: DEFAULT_ACCURACY,
            limit: None,
            exact: None,
            bound: None,
            floor: 0.0,
            what,
        }
    }

    /// The pair as a case of bodies, if both are.
    pub fn bodies(&self) -> Option<Case> {
        let (Shape::Body(a), Shape::Body(b)) = (&self.a, &self.b) else { return None };
        let Self { accuracy, limit, exact, bound, floor, .. } = *self;
        let what = self.what.clone();
        Some(Case {
            a: (**a).clone(),
            pose_a: self.pose_a,
            b: (**b).clone(),
            pose_b: self.pose_b,
            accuracy,
            limit,
            exact,
            bound,
            floor,
            what,
        })
    }

    /// The length that accuracies are relative to, metres: the smaller size of those that have one,
    /// of two points their distance.
    pub fn size(&self) -> f64 {
        let sizes = [self.a.reach_m(), self.b.reach_m()];
        let least = sizes.into_iter().filter(|size| *size > 0.0).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { (self.pose_a.translation() - self.pose_b.translation()).norm() }
    }

    /// Sum of the sizes, metres.
    pub fn sum(&self) -> f64 {
        self.a.reach_m() + self.b.reach_m()
    }

    /// What the pair asks for.
    pub fn options(&self) -> Options<'static> {
        let options = Options::default().with_accuracy(self.accuracy).expect("in range");
        options.with_max_iterations(self.limit.unwrap_or(MAX_ITERATIONS)).expect("in range")
    }

    /// With the second shape moved along the line of the nearest points until the gap is this,
    /// metres; first they are apart. As exact as a distance of the pair's accuracy.
    #[must_use]
    pub fn moved_to(mut self, gap: f64) -> Self {
        let found = self.solve(&self.options(), &mut WarmStart::default());
        if let Some(n) = found.normal {
            self.pose_b = shifted(&self.pose_b, n * (found.value - gap));
        }
        self
    }

    /// With the arguments swapped.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { a: self.b, pose_a: self.pose_b, b: self.a, pose_b: self.pose_a, ..self }
    }

    /// With both poses changed alike.
    #[must_use]
    pub fn carried(self, change: impl Fn(&Pose) -> Pose) -> Self {
        Self { pose_a: change(&self.pose_a), pose_b: change(&self.pose_b), ..self }
    }
}

/// The pairs that measures are defined for, each with both orders.
pub const PAIRS: [[Kind; 2]; 36] = {
    use Kind::{Ball, Capsule, Cuboid, Cut, Cylinder, Ellipsoid, HalfSpace, Point, Segment, Smooth};
    // The first of them have every primitive.
    [
        [Cuboid, Capsule],
        [Ball, Cylinder],
        [HalfSpace, Cuboid],
        [Segment, Ellipsoid],
        [Point, Cylinder],
        [Cuboid, Cuboid],
        [Capsule, Smooth],
        [Cylinder, Cuboid],
        [Capsule, Capsule],
        [Ball, Cuboid],
        [HalfSpace, Cylinder],
        [Cylinder, Smooth],
        [Cylinder, Capsule],
        [Segment, Cuboid],
        [Cuboid, Ellipsoid],
        [Ball, Capsule],
        [Point, Smooth],
        [Cylinder, Cylinder],
        [Cuboid, Smooth],
        [Capsule, Ellipsoid],
        [HalfSpace, Smooth],
        [Segment, Cylinder],
        [Ball, Smooth],
        [Point, Cuboid],
        [Cylinder, Ellipsoid],
        [Segment, Smooth],
        [Segment, Capsule],
        [HalfSpace, Ball],
        [Ball, Ball],
        [Point, Ellipsoid],
        [Segment, Segment],
        [Ellipsoid, Ball],
        [Cut, Capsule],
        [Point, Cut],
        [Segment, Cut],
        [HalfSpace, Cut],
    ]
};

/// How many [`PAIRS`] there are.
pub const COUNT: u64 = PAIRS.len() as u64;

/// The shapes of a pair by its index, of these sizes in metres: every other time round in the other
/// order.
fn shapes(index: u64, sizes: [f64; 2], random: &mut dyn Draws) -> [Shape; 2] {
    let kinds = PAIRS[(index % COUNT) as usize];
    let [a, b] = [0, 1].map(|k| Shape::drawn(kinds[k], sizes[k], random));
    if (index / COUNT).is_multiple_of(2) { [a, b] } else { [b, a] }
}

/// Somewhere with the shapes' origins this far from each other, metres, half-spaces turned so that
/// their normals lead to the other one, about.
fn somewhere([a, b]: [Shape; 2], away: f64, reach: f64, random: &mut dyn Draws, what: &str) -> Pair {
    let (pose_a, far) = (random.pose(away), random.pose(reach));
    let pose_b = shifted(&far, *pose_a.translation());
    let between = pose_a.translation() - pose_b.translation();
    let aside = random.unit() * 0.3;
    let facing = |shape: &Shape, from: &Pose, towards: Vector3<f64>| {
        let Shape::HalfSpace = shape else { return *from };
        let n = towards.try_normalize(0.0).unwrap_or_else(Vector3::x) + aside;
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &n).unwrap_or_default();
        pose(*from.translation(), &turn)
    };
    let (pose_a, pose_b) = (facing(&a, &pose_a, -between), facing(&b, &pose_b, between));
    Pair::new(a, pose_a, b, pose_b, what)
}

/// Apart, by at least half of the sum of the sizes.
fn apart(shapes: [Shape; 2], random: &mut dyn Draws, what: &str) -> Pair {
    let sum: f64 = shapes.iter().map(Shape::reach_m).sum();
    // Of a half-space the height is 0.9 of the distance of the origins at least.
    let reach = 2.5 * if sum > 0.0 { sum } else { 1.0 };
    somewhere(shapes, 0.3, reach, random, what)
}
