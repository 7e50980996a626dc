//! The questions that are put of a pair at its poses.

use super::super::library::{
    Body, Capsule, Decision, Distance, HalfSpace, ImpactOptions, ImpactStatus, Motion, Options, Pose, Ray, RayCast,
    Status, Sweep, WarmStart, cast_ball, cast_ray, distance, distance_batch, distance_to_capsule,
    distance_to_half_space, distance_to_point, growth_distance, level_distance, overlap, penetration, shifted,
    signed_distance, time_of_impact,
};
use nalgebra::Vector3;

/// Poses of one batch.
const BATCH: usize = 8;

/// Seconds that moving bodies are followed; the second one reaches the first after one.
const DURATION: f64 = 1.5;

/// Two bodies where they stand.
pub(crate) type Pair<'a> = ((&'a Body, &'a Pose), (&'a Body, &'a Pose));

/// What is asked. Shapes that are no bodies stand where the second one does and are as large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Query {
    Distance,
    Level,
    Growth,
    Overlap,
    Depth,
    Signed,
    Capsule,
    Point,
    HalfSpace,
    /// A ray towards the first body, from where the second one is.
    Ray,
    /// A ball on that way.
    Ball,
    /// The second body on that way, while the first turns.
    Impact,
    /// The second body at several poses at once, a hundredth of a size apart.
    Batch,
}

impl Query {
    /// Distances between bodies, and whether they overlap.
    pub(crate) const DISTANCES: [Self; 4] = [Self::Distance, Self::Level, Self::Growth, Self::Overlap];

    /// All other questions.
    pub(crate) const OTHERS: [Self; 9] = [
        Self::Depth,
        Self::Signed,
        Self::Capsule,
        Self::Point,
        Self::HalfSpace,
        Self::Ray,
        Self::Ball,
        Self::Impact,
        Self::Batch,
    ];
}

/// What is compared of an answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answer {
    /// Whether the bracket is as narrow as asked for, or the question decided.
    pub(crate) is_sure: bool,
    /// The value lies between these: metres, levels, factors, seconds; of a batch the sums.
    pub(crate) bracket: [f64; 2],
    pub(crate) iterations: u32,
}

impl Answer {
    fn new(status: Status, bracket: [f64; 2], iterations: u32) -> Self {
        Self { is_sure: status == Status::Converged, bracket, iterations }
    }

    fn of_decision(decision: Decision) -> Self {
        match decision {
            Decision::Yes => Self::new(Status::Converged, [0.0, 0.0], 0),
            Decision::No => Self::new(Status::Converged, [f64::MIN_POSITIVE, f64::INFINITY], 0),
            Decision::Undecided { lower, upper } => Self::new(Status::BracketWide, [lower, upper], 0),
        }
    }

    fn of_cast(cast: &RayCast) -> Self {
        match *cast {
            RayCast::Hit(hit) => Self::new(hit.status, [hit.lower, hit.upper], hit.iterations),
            // It may miss as well.
            RayCast::Undecided { lower, .. } => Self::new(Status::BracketWide, [lower, f64::INFINITY], 0),
            RayCast::Miss => Self::new(Status::Converged, [f64::INFINITY; 2], 0),
        }
    }

    /// What two brackets of one value may not be: apart.
    pub(crate) fn contradicts(&self, other: &Self) -> bool {
        self.bracket[0] > other.bracket[1] || other.bracket[0] > self.bracket[1]
    }
}

impl Query {
    pub(crate) fn solve(self, pair: Pair<'_>, options: &Options<'_>, warm: &mut WarmStart) -> Answer {
        let ((a, pose_a), (b, pose_b)) = pair;
        let size = b.circumscribed().radius;
        match self {
            Self::Distance => {
                let found = distance(a, pose_a, b, pose_b, options, warm);
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Level => {
                let found = level_distance(a, pose_a, b, pose_b, options, warm);
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Growth => {
                let found = growth_distance(a, pose_a, b, pose_b, options, warm);
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Overlap => Answer::of_decision(overlap(a, pose_a, b, pose_b, options, warm)),
            Self::Depth => {
                let found = penetration(a, pose_a, b, pose_b, options, warm);
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Signed => {
                let found = signed_distance(a, pose_a, b, pose_b, options, warm);
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Capsule => {
                let capsule = Capsule::new(0.3 * size, 0.7 * size).expect("sizes of a body");
                let found = distance_to_capsule(a, pose_a, &capsule, pose_b, options, warm);
                // How deep an axis is in a body is not measured, that it is in it is an answer.
                let is_sure = found.status == Status::Converged || found.upper <= 0.0;
                Answer { is_sure, bracket: [found.lower, found.upper], iterations: found.iterations }
            }
            Self::Point => {
                let found = distance_to_point(a, pose_a, pose_b.translation(), options, warm).expect("a point");
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::HalfSpace => {
                let n = pose_b.transform_direction(&Vector3::z());
                let half_space = HalfSpace::new(n, n.dot(pose_b.translation())).expect("a unit normal");
                let found = distance_to_half_space(a, pose_a, &half_space, options, warm);
                Answer::new(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Ray => Answer::of_cast(&cast_ray(a, pose_a, &towards(pair), options)),
            Self::Ball => {
                let sweep = Sweep::new(towards(pair), 0.3 * size).expect("a radius");
                Answer::of_cast(&cast_ball(a, pose_a, &sweep, options))
            }
            Self::Impact => {
                let spin = pose_b.transform_direction(&Vector3::x());
                let motions = [
                    Motion::new(*pose_a, Vector3::zeros(), spin, *pose_a.translation()),
                    Motion::new(*pose_b, way(pair), Vector3::zeros(), *pose_b.translation()),
                ];
                let [turning, coming] = motions.map(|motion| motion.expect("numbers"));
                let options = ImpactOptions::new(DURATION).expect("a duration");
                let found = time_of_impact(a, &turning, b, &coming, &options);
                // Until then they are apart.
                let bracket = [found.time, f64::INFINITY];
                Answer { is_sure: found.status != ImpactStatus::Stopped, bracket, iterations: found.queries }
            }
            Self::Batch => {
                let step = pose_b.transform_direction(&Vector3::x()) * (0.01 * size);
                let poses: [Pose; BATCH] = std::array::from_fn(|k| shifted(pose_b, step * k as f64));
                let mut answers = [Distance::default(); BATCH];
                distance_batch(a, pose_a, b, &poses, options, &mut answers).expect("as many places as poses");
                let sum = |value: fn(&Distance) -> f64| answers.iter().map(value).sum();
                Answer {
                    is_sure: answers.iter().all(|found| found.status == Status::Converged),
                    bracket: [sum(|found| found.lower), sum(|found| found.upper)],
                    iterations: answers.iter().map(|found| found.iterations).sum(),
                }
            }
        }
    }
}

/// From where the second body stands to a point in the first or beside it.
fn way(((a, pose_a), (_, pose_b)): Pair<'_>) -> Vector3<f64> {
    let aside = pose_b.transform_direction(&Vector3::y()) * (0.5 * a.circumscribed().radius);
    pose_a.transform_point(a.interior_point()) + aside - pose_b.translation()
}

fn towards(pair: Pair<'_>) -> Ray {
    Ray::new(*pair.1.1.translation(), way(pair), f64::INFINITY).expect("a direction")
}
