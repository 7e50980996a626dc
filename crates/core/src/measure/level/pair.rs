//! Level distance of two bodies: continuation first, then the general search.

use super::answer::LevelDistance;
use super::over_shape::OverShape;
use super::saturated::saturated;
use super::search::Search;
use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::level_continuation::{FollowLevel, LevelProven, SeekLevel};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::support_table_gjk::lowest;
use crate::measure::solver::tangent_newton::SEEK_ROUNDS;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// Level distance of one body over another.
pub(super) fn between(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    let mut spent = 0;
    let mut settled = None;
    match &mut warm.hint {
        Hint::LevelSmooth(trace) if runs(Stage::Follow) => {
            match dispatch(FollowLevel { a, pose_a, b, pose_b, options, trace }) {
                Ok(proven) => return proven.answer(a, pose_a, pose_b),
                Err(lost) => (spent, settled) = (lost.rounds, lost.settled),
            }
        }
        Hint::Saturated if runs(Stage::Saturation) => {
            if let Some(answer) = saturated(a, pose_a, b, pose_b, options) {
                return answer;
            }
        }
        _ => {}
    }
    if runs(Stage::ClosedForm)
        && let Some(over) = OverShape::new((a, pose_a), (b, pose_b))
    {
        match over.solve(&warm.hint, options, spent) {
            Ok((answer, hint)) => {
                warm.hint = hint;
                return answer;
            }
            Err(rounds) => spent += rounds,
        }
        if runs(Stage::Saturation)
            && let Some(answer) = saturated(a, pose_a, b, pose_b, options)
        {
            warm.hint = Hint::Saturated;
            return LevelDistance { iterations: spent, ..answer };
        }
    }
    let pair = Pair::new(a, pose_a, b, pose_b);
    let followed = matches!(warm.hint, Hint::Level { .. }) || settled.is_some();
    let start = if followed || options.exhausted(spent) { None } else { Some(lowest(&pair)) };
    if start.as_ref().is_some_and(|start| start.common.is_some())
        && runs(Stage::Saturation)
        && let Some(answer) = saturated(a, pose_a, b, pose_b, options)
    {
        warm.hint = Hint::Saturated;
        return LevelDistance { iterations: spent, ..answer };
    }
    if let Some(start) = &start
        && pair.smooth()
        && runs(Stage::Seek)
    {
        let most = SEEK_ROUNDS.min(options.max_iterations() - spent);
        match dispatch(SeekLevel { a, pose_a, b, pose_b, from: &pair.to_b(&start.x), most, options }) {
            Ok((proven, trace)) => {
                warm.hint = Hint::LevelSmooth(trace);
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
    warm.hint = search.hint();
    search.answer(pose_a, pose_b)
}

impl LevelProven {
    fn answer(&self, a: &Body, pose_a: &Pose, pose_b: &Pose) -> LevelDistance {
        let witness = pose_a.transform_point(&(a.normalization().center + Vector3::from(self.x)));
        let gradient = pose_a.transform_direction(&Vector3::from(self.gradient));
        LevelDistance {
            status: Status::Converged,
            lower: self.lower,
            upper: self.upper,
            witness,
            multiplier: self.multiplier,
            saturated: false,
            gradient_a: Twist::of_gradient(-gradient, &witness, pose_a.translation()),
            gradient_b: Twist::of_gradient(gradient, &witness, pose_b.translation()),
            tied: false,
            iterations: self.rounds,
        }
    }
}
