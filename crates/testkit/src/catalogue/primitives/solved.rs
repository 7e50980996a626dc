//! The answer of our measure for a pair, and what 200 bits say.

use super::pair::Pair;
use super::shape::Shape;
use crate::reference::big::{Big, big, double};
use crate::reference::{self, capsule, half_space};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{
    Capsule, CapsuleDistance, Distance, HalfSpace, HalfSpaceDistance, Options, Pose, Status, Twist, WarmStart,
    distance, distance_batch, distance_of_capsule_to_half_space, distance_of_capsules, distance_to_capsule,
    distance_to_capsule_batch, distance_to_half_space, distance_to_point, is_capsule_solved_in_lanes,
    is_solved_in_lanes,
};

/// An answer, of whatever measure: metres, world frame.
#[derive(Clone, Copy, Debug)]
pub struct Solved {
    pub status: Status,
    /// Minus infinity where no depth is measured.
    pub lower: f64,
    pub upper: f64,
    /// What callers are given as the distance.
    pub value: f64,
    pub witness_a: Vector3<f64>,
    pub witness_b: Vector3<f64>,
    /// From the second shape to the first.
    pub normal: Option<Vector3<f64>>,
    pub tied: bool,
    pub iterations: u32,
    /// With respect to both poses.
    pub gradients: Option<[Twist; 2]>,
}

impl Solved {
    /// The same of the shapes in the other order.
    fn swapped(self) -> Self {
        Self {
            witness_a: self.witness_b,
            witness_b: self.witness_a,
            normal: self.normal.map(|n| -n),
            gradients: self.gradients.map(|[a, b]| [b, a]),
            ..self
        }
    }

    /// Of two bodies at these poses.
    pub fn of_bodies(found: &Distance, pose_a: &Pose, pose_b: &Pose) -> Self {
        let Distance { status, lower, upper, witness_a, witness_b, normal, tied, iterations, .. } = *found;
        let (value, gradients) = (found.value(), found.gradients(pose_a, pose_b));
        Self { status, lower, upper, value, witness_a, witness_b, normal, tied, iterations, gradients }
    }

    /// Of a body and a capsule, or two capsules, at these poses.
    pub fn of_capsules(found: &CapsuleDistance, pose_a: &Pose, pose_b: &Pose) -> Self {
        let CapsuleDistance { status, lower, upper, normal, tied, iterations, .. } = *found;
        let (witness_a, witness_b) = (found.witness, found.witness_of_capsule);
        let gradients = found.gradients(pose_a, pose_b);
        let value = found.value();
        Self { status, lower, upper, value, witness_a, witness_b, normal, tied, iterations, gradients }
    }

    /// Of a body or a capsule and the half-space that [`Shape::HalfSpace`] is at its pose.
    fn of_half_space(found: &HalfSpaceDistance, pose_a: &Pose, (half_space, pose_b): (&HalfSpace, &Pose)) -> Self {
        let HalfSpaceDistance { status, lower, upper, witness, tied, iterations } = *found;
        let (n, x) = (*half_space.normal(), witness);
        let of_plane = Twist { linear: -n, angular: -(x - pose_b.translation()).cross(&n) };
        Self {
            status,
            lower,
            upper,
            value: found.value(),
            witness_a: x,
            witness_b: x - n * (n.dot(&(x - pose_b.translation()))),
            normal: Some(n),
            tied,
            iterations,
            gradients: Some([found.pose_gradient(pose_a, half_space), of_plane]),
        }
    }
}

/// What 200 bits say of a pair, in a bracket of its own, metres.
#[derive(Debug)]
pub struct Reference {
    /// None where no depth is known.
    pub lower: Option<Big>,
    pub upper: Big,
    /// From the second shape to the first, where it is known.
    pub normal: Option<Vector3<f64>>,
    /// Derivative with respect to the twists of both shapes, where there is a normal.
    pub gradient: [f64; 12],
}

impl Reference {
    /// Width of the bracket, metres; infinite without a lower end.
    pub fn width(&self) -> f64 {
        self.lower.as_ref().map_or(f64::INFINITY, |lower| double(&(&self.upper - lower)))
    }

    /// The upper end: the value, or where no depth is known what it is at most.
    pub fn value(&self) -> f64 {
        double(&self.upper)
    }

    /// Whether a bracket has the truth in it; of an unknown depth no lower end is proven.
    pub fn inside(&self, found: &Solved) -> bool {
        let above = self.lower.as_ref().is_none_or(|least| *least <= big(found.upper));
        let below = if found.lower == f64::NEG_INFINITY {
            true
        } else {
            self.lower.is_some() && big(found.lower) <= self.upper
        };
        above && below
    }

    /// Whether a bracket has all in it that the truth may be, which proves as much as a sharp truth.
    pub fn all_inside(&self, found: &Solved) -> bool {
        let lower = self.lower.as_ref();
        let below = lower.is_some_and(|lower| found.lower == f64::NEG_INFINITY || big(found.lower) <= *lower);
        below && self.upper <= big(found.upper)
    }

    fn swapped(self) -> Self {
        let g = self.gradient;
        let gradient = std::array::from_fn(|k| g[(k + 6) % 12]);
        Self { normal: self.normal.map(|n| -n), gradient, ..self }
    }

    fn of_capsule(found: capsule::Truth) -> Self {
        let capsule::Truth { lower, upper, normal, gradient } = found;
        Self { lower, upper, normal, gradient }
    }

    /// Of a body or a capsule and the half-space that [`Shape::HalfSpace`] is at its pose.
    fn of_half_space(truth: half_space::Truth, pose_a: &Pose, (half_space, pose_b): (&HalfSpace, &Pose)) -> Self {
        // The half-space turns about the translation of its own pose.
        let n = half_space.normal();
        let turning = Vector3::from_fn(|i, _| truth.gradient[3 + i]);
        let about_b = turning + (pose_a.translation() - pose_b.translation()).cross(n);
        let gradient = std::array::from_fn(|k| match k {
            0..6 => truth.gradient[k],
            6..9 => -n[k - 6],
            _ => -about_b[k - 9],
        });
        Self { lower: Some(truth.lower), upper: truth.upper, normal: Some(*n), gradient }
    }

    /// Distances that are 0 inside, whatever the depth.
    fn unsigned(self) -> Self {
        let positive = |value: Big| if value < Big::ZERO { big(0.0) } else { value };
        Self { lower: Some(self.lower.map_or(big(0.0), positive)), upper: positive(self.upper), ..self }
    }
}

impl Pair {
    /// Our answer to the pair.
    ///
    /// # Panics
    /// On pairs that no measure is for: two points or half-spaces, and a point beside a capsule or
    /// a half-space.
    pub fn solve(&self, options: &Options<'_>, warm: &mut WarmStart) -> Solved {
        let Self { a, pose_a, b, pose_b, .. } = self;
        match (a, b) {
            (Shape::Body(a), Shape::Body(b)) => {
                let found = distance(&**a, pose_a, &**b, pose_b, options, warm);
                Solved::of_bodies(&found, pose_a, pose_b)
            }
            (Shape::Body(body), Shape::Capsule(capsule)) => {
                let found = distance_to_capsule(&**body, pose_a, capsule, pose_b, options, warm);
                Solved::of_capsules(&found, pose_a, pose_b)
            }
            (Shape::Capsule(a), Shape::Capsule(b)) => {
                let found = distance_of_capsules(a, pose_a, b, pose_b, options);
                Solved::of_capsules(&found, pose_a, pose_b)
            }
            (Shape::Body(body), Shape::Point) => {
                let found = distance_to_point(&**body, pose_a, pose_b.translation(), options, warm).expect("finite");
                let of_point = |n: Vector3<f64>| Twist { linear: n, angular: Vector3::zeros() };
                Solved {
                    status: found.status,
                    lower: found.lower,
                    upper: found.upper,
                    value: found.value(),
                    witness_a: found.witness,
                    witness_b: *pose_b.translation(),
                    normal: found.normal.map(|n| -n),
                    tied: found.tied,
                    iterations: found.iterations,
                    gradients: found.pose_gradient(pose_a).zip(found.normal.map(of_point)).map(|(p, q)| [p, q]),
                }
            }
            (Shape::Body(body), Shape::HalfSpace) => {
                let half_space = Shape::half_space(pose_b);
                let found = distance_to_half_space(&**body, pose_a, &half_space, options, warm);
                Solved::of_half_space(&found, pose_a, (&half_space, pose_b))
            }
            (Shape::Capsule(capsule), Shape::HalfSpace) => {
                let half_space = Shape::half_space(pose_b);
                let found = distance_of_capsule_to_half_space(capsule, pose_a, &half_space, options);
                Solved::of_half_space(&found, pose_a, (&half_space, pose_b))
            }
            (_, Shape::Body(_)) | (Shape::HalfSpace, Shape::Capsule(_)) => {
                self.clone().swapped().solve(options, warm).swapped()
            }
            _ => panic!("{} has no measure", self.what),
        }
    }

    /// Our answer in a batch of the same pose several times over; none of pairs that batches solve
    /// one by one.
    ///
    /// # Panics
    /// Never: there are as many answers as poses.
    pub fn solve_in_lanes(&self, options: &Options<'_>) -> Option<Solved> {
        const COUNT: usize = 8;
        let Self { a, pose_a, b, pose_b, .. } = self;
        let poses = [*pose_b; COUNT];
        match (a, b) {
            (Shape::Body(a), Shape::Body(b)) if is_solved_in_lanes(&**a, &**b) => {
                let mut found = [Distance::default(); COUNT];
                distance_batch(&**a, pose_a, &**b, &poses, options, &mut found).expect("an answer for each pose");
                Some(Solved::of_bodies(&found[0], pose_a, pose_b))
            }
            (Shape::Body(a), Shape::Capsule(b)) if is_capsule_solved_in_lanes(&**a, b) => {
                let mut found = [CapsuleDistance::default(); COUNT];
                distance_to_capsule_batch(&**a, &[*pose_a], b, &poses, options, &mut found)
                    .expect("an answer for each pose");
                Some(Solved::of_capsules(&found[0], pose_a, pose_b))
            }
            (Shape::Capsule(_), Shape::Body(_)) => self.clone().swapped().solve_in_lanes(options).map(Solved::swapped),
            _ => None,
        }
    }

    /// What 200 bits say, from the witnesses of an answer: proven by its own bracket.
    ///
    /// # Panics
    /// As [`Pair::solve`].
    pub fn reference(&self, found: &Solved) -> Reference {
        let Self { a, pose_a, b, pose_b, .. } = self;
        let of_segment = |body: &Body, capsule: &Capsule| {
            let start = (&found.witness_a, found.normal);
            Reference::of_capsule(capsule::signed_distance((body, pose_a), (capsule, pose_b), start))
        };
        match (a, b) {
            (Shape::Body(a), Shape::Body(b)) => {
                let Solved { lower, upper, witness_a, witness_b, normal, .. } = *found;
                let answer = sublevel_core::measure::Distance {
                    lower,
                    upper,
                    witness_a,
                    witness_b,
                    normal,
                    ..Default::default()
                };
                let truth = reference::distance(a, pose_a, b, pose_b, &answer);
                let normal = (truth.lower > Big::ZERO).then(|| truth.normal());
                Reference { lower: Some(truth.lower), upper: truth.upper, normal, gradient: truth.gradient }
            }
            (Shape::Body(body), Shape::Capsule(capsule)) => of_segment(body, capsule),
            (Shape::Body(body), Shape::Point) => of_segment(body, &Capsule::POINT).unsigned(),
            (Shape::Capsule(a), Shape::Capsule(b)) => {
                Reference::of_capsule(capsule::signed_distance_of_two((a, pose_a), (b, pose_b)))
            }
            (Shape::Body(body), Shape::HalfSpace) => {
                let half_space = Shape::half_space(pose_b);
                let truth = half_space::signed_distance((body, pose_a), &half_space, &found.witness_a);
                Reference::of_half_space(truth, pose_a, (&half_space, pose_b))
            }
            (Shape::Capsule(capsule), Shape::HalfSpace) => {
                let half_space = Shape::half_space(pose_b);
                let truth = half_space::signed_distance_of_capsule((capsule, pose_a), &half_space);
                Reference::of_half_space(truth, pose_a, (&half_space, pose_b))
            }
            (_, Shape::Body(_)) | (Shape::HalfSpace, Shape::Capsule(_)) => {
                let found = found.swapped();
                self.clone().swapped().reference(&found).swapped()
            }
            _ => panic!("{} has no measure", self.what),
        }
    }
}
