//! Level distance `d(A‖B) = min p_A(x)` over x in B, p the largest constraint.

mod bracket;
mod newton;
mod saturated;
mod search;
mod sides;
mod smooth;
#[cfg(test)]
mod tests;

use crate::body::{Body, Solid};
use crate::measure::Status;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::solver::support_table_gjk::lowest;
use crate::measure::union;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;
pub(in crate::measure) use newton::LevelNewton;
use saturated::saturated;
use search::Search;
pub(in crate::measure) use smooth::LevelTrace;
use smooth::{FollowLevel, LevelProven, SEEK_ROUNDS, SeekLevel};

/// Level distance with its proof; unit-free but for the witness.
#[derive(Clone, Copy, Debug)]
pub struct LevelDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound.
    pub lower: f64,
    /// Proven upper bound, attained at the witness.
    pub upper: f64,
    /// A point of the second body where the first one's polynomial is at most `upper`; world frame,
    /// metres.
    pub witness: Vector3<f64>,
    /// How fast d falls as the level of the second body rises from 1: the sum of the multipliers of
    /// its constraints.
    pub multiplier: f64,
    /// Whether the second body holds the minimiser of the first one's polynomial: d is its minimum,
    /// the multiplier and all derivatives are 0, and d says no more about depth.
    pub saturated: bool,
    /// Derivative of d with respect to the pose of the first body, 1/m and 1/rad: a twist (v, ω)
    /// changes d by `-g·v - ((x - t) × g)·ω`, g the gradient of the first body's polynomial at the
    /// witness x (of several active constraints, weighted by their multipliers) and t the
    /// translation.
    pub gradient_a: Twist,
    /// Derivative of d with respect to the pose of the second body: the same force the other way,
    /// about its own translation.
    pub gradient_b: Twist,
    /// Whether another pair of parts may be as low, their brackets meeting: witness, multiplier and
    /// gradients may then jump. Never for single bodies.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl LevelDistance {
    /// The answer inside the bracket: the upper bound, which the witness attains.
    pub fn value(&self) -> f64 {
        self.upper
    }
}

/// Level distance of `a` over `b`: the smallest value that the stored polynomial of `a` (the
/// largest of its constraints) takes on `b`. Above 1 the bodies are apart, at 1 they touch, below 1
/// they overlap; it is not symmetric.
///
/// The bracket is as narrow as `options` ask, relative to `max(1, |d|)`, or the status says that it
/// is not. When the minimiser of `a`'s polynomial lies in `b`, the answer is its minimum
/// ([`Body::min_value`]) and says no more about depth. Derivatives are by the envelope theorem: at
/// the minimiser x the gradients of both bodies balance, `g_a + μ g_b = 0`. `warm` is read and then
/// replaced by the hint for the next query of this pair in this order.
///
/// Of solids with several parts it is the least over the pairs of parts, the polynomial of a union
/// being the least of those of its parts: one part of `a` and the part of `b` where it is lowest,
/// to which witness, multiplier and `saturated` belong.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, level_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let d = level_distance(&ball, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((d.value() - 4.0).abs() < 1e-8); // |x|² is 4 at (2, 0, 0)
/// assert!((d.gradient_b.linear - Vector3::new(4.0, 0.0, 0.0)).norm() < 1e-6); // and its slope there 4
///
/// let pair = Compound::new("pair", vec![ball.clone(), Body::ball("far", Vector3::new(0.0, 5.0, 0.0), 1.0)?])?;
/// let e = level_distance(&pair, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((e.value() - d.value()).abs() < 1e-8 && !e.tied);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn level_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    union::level_distance(a, pose_a, b, pose_b, options, warm)
}

/// Level distance of one body over another.
pub(super) fn between(
    a: &Body,
    pose_a: &Pose,
    b: &Body,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    let mut spent = 0;
    let mut settled = None;
    match &mut warm.hint {
        Hint::LevelSmooth(trace) => match dispatch(FollowLevel { a, pose_a, b, pose_b, options, trace }) {
            Ok(proven) => return proven.answer(a, pose_a, pose_b),
            Err(lost) => (spent, settled) = (lost.rounds, lost.settled),
        },
        Hint::Saturated => {
            if let Some(answer) = saturated(a, pose_a, b, pose_b, options) {
                return answer;
            }
        }
        _ => {}
    }
    let pair = Pair::new(a, pose_a, b, pose_b);
    let followed = matches!(warm.hint, Hint::Level { .. }) || settled.is_some();
    let start = if followed || options.exhausted(spent) { None } else { Some(lowest(&pair)) };
    if start.as_ref().is_some_and(|start| start.common.is_some())
        && let Some(answer) = saturated(a, pose_a, b, pose_b, options)
    {
        *warm = Hint::Saturated.into();
        return LevelDistance { iterations: spent, ..answer };
    }
    if let Some(start) = &start
        && pair.smooth()
    {
        let most = SEEK_ROUNDS.min(options.max_iterations() - spent);
        match dispatch(SeekLevel { a, pose_a, b, pose_b, from: &pair.to_b(&start.x), most, options }) {
            Ok((proven, trace)) => {
                *warm = Hint::LevelSmooth(trace).into();
                let rounds = spent + proven.rounds;
                return LevelDistance { iterations: rounds, ..proven.answer(a, pose_a, pose_b) };
            }
            Err(lost) => (spent, settled) = (spent + lost.rounds, lost.settled),
        }
    }
    let mut search = Search::new(&pair, options, spent);
    if let Some(settled) = &settled {
        search.resume(settled);
    }
    search.run(&warm.hint, start.as_ref());
    *warm = search.hint().into();
    search.answer(pose_a, pose_b)
}

impl LevelProven {
    fn answer(&self, a: &Body, pose_a: &Pose, pose_b: &Pose) -> LevelDistance {
        let witness = pose_a.transform_point(&(a.normalization().center + Vector3::from(self.x)));
        let force = pose_a.transform_direction(&Vector3::from(self.gradient));
        LevelDistance {
            status: Status::Converged,
            lower: self.lower,
            upper: self.upper,
            witness,
            multiplier: self.multiplier,
            saturated: false,
            gradient_a: Twist::of_force(-force, &witness, pose_a.translation()),
            gradient_b: Twist::of_force(force, &witness, pose_b.translation()),
            tied: false,
            iterations: self.rounds,
        }
    }
}
