//! Signed distance of two bodies.

use super::answer::SignedDistance;
use super::closed_form::of_shapes;
use super::report::Answer;
use crate::body::Body;
use crate::measure::bounds::duality_bounds::distance_upper;
use crate::measure::distance::{Distance, distance};
use crate::measure::frames::query_frame::Pair;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::continuation::Follow;
use crate::measure::solver::depth::local_search::{Best, tolerance};
use crate::measure::solver::depth::sweep::prove;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::two_point_problem::Through;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{Scalar, dispatch};
use nalgebra::Vector3;

/// Signed distance of two bodies.
pub(super) fn between(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> SignedDistance {
    let mut spent = 0;
    if runs(Stage::ClosedForm) {
        match of_shapes((a, pose_a), (b, pose_b), options, warm) {
            Ok(found) => return found,
            Err(iterations) => spent = iterations,
        }
    }
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    if let Hint::Smooth(trace) = &mut warm.hint
        && runs(Stage::Follow)
    {
        let relation = Through { pose_a, pose_b, facing: None, tolerance };
        // Apart, or nearly, the normal proves all there is.
        match dispatch(Follow { a, b, relation, options, trace }) {
            Ok(proven) if proven.upper - proven.lower <= tolerance => {
                let [x, y, normal] = proven.world(Scalar, a, pose_a);
                return Answer::of(&proven).report((x, y), Some(normal), pose_a, pose_b);
            }
            Ok(proven) => spent += proven.rounds,
            Err(lost) => spent += lost.rounds,
        }
    }
    // Near contact a part of the width is left to each end of the bracket.
    let finer = options.with_accuracy(0.25 * options.accuracy()).unwrap_or(*options);
    let pair = Pair::new(a, pose_a, b, pose_b);
    let mut best = Best::new(&pair, pose_a, pose_b, options);
    best.iterations = spent;
    best.follow(&warm.hint);
    if best.depth.is_infinite() {
        best.seek(None);
    }
    let mut known = Known::of(&best);
    if best.depth.is_infinite() {
        // No answer to continue from: the distance decides whether the bodies are apart.
        let apart = distance(a, pose_a, b, pose_b, &options.after(best.iterations), warm);
        best.iterations += apart.iterations;
        if apart.lower > 0.0 {
            let iterations = best.iterations;
            let answer =
                Answer { lower: apart.lower, upper: apart.upper, tied: false, iterations, status: apart.status };
            return answer.report((apart.witness_a, apart.witness_b), apart.normal, pose_a, pose_b);
        }
        best.follow(&warm.hint);
        known = Known::of(&best);
        known.attain_distance(&pair, &apart);
    }
    if known.lower < 0.0 && !known.narrow(&best) {
        // Halfway between the deepest points is mostly a common one.
        let middle = (known.x + known.y) * 0.5;
        if pair.common(&middle) {
            known.attain(0.0, middle, middle);
        }
    }
    let mut tied = false;
    if best.depth > 0.0 && !known.narrow(&best) {
        let proof = prove(&mut best);
        tied = proof.tied;
        let before = known;
        known = Known::of(&best);
        if proof.lower > 0.0 {
            known.upper = -proof.lower;
        } else {
            known.attain(before.upper, before.x, before.y);
        }
    }
    if let Some(hint) = best.hint() {
        warm.hint = hint;
    }
    if known.upper > 0.0 && !known.narrow(&best) {
        // On which side of contact the bodies are is not known, or how far apart.
        let apart = distance(a, pose_a, b, pose_b, &finer.after(best.iterations), warm);
        best.iterations += apart.iterations;
        if apart.lower > 0.0 {
            let lower = apart.lower.max(known.lower * pair.unit());
            let status = Status::of(apart.upper - lower <= tolerance);
            let answer = Answer { lower, upper: apart.upper, tied, iterations: best.iterations, status };
            return answer.report((apart.witness_a, apart.witness_b), apart.normal, pose_a, pose_b);
        }
        if !options.exhausted(best.iterations) {
            best.options = &finer;
            best.follow(&warm.hint);
            best.options = options;
        }
        known.lower = known.lower.max(-best.depth);
        known.attain_distance(&pair, &apart);
    }
    let status = Status::of(known.narrow(&best));
    let unit = pair.unit();
    let answer =
        Answer { lower: known.lower * unit, upper: known.upper * unit, tied, iterations: best.iterations, status };
    let normal = best.n.map(|n| pair.direction_to_world(&n));
    answer.report((pair.to_world(&known.x), pair.to_world(&known.y)), normal, pose_a, pose_b)
}

/// A bracket of the signed distance in query units, and the points behind it.
struct Known {
    lower: f64,
    upper: f64,
    x: Vector3<f64>,
    y: Vector3<f64>,
}

impl Known {
    /// What the best direction shows, and the points of the bodies there.
    fn of(best: &Best<'_>) -> Self {
        let (lower, pair) = (-best.depth, best.pair);
        if let Some(upper) = best.attained {
            return Self { lower, upper, x: best.x, y: best.y };
        }
        match (pair.a.move_inside(&best.x), pair.b.move_inside(&best.y)) {
            (Some(x), Some(y)) => Self { lower, upper: distance_upper(pair, &x, &y), x, y },
            _ => Self { lower, upper: f64::INFINITY, x: best.x, y: best.y },
        }
    }

    /// Takes points that are nearer.
    fn attain(&mut self, upper: f64, x: Vector3<f64>, y: Vector3<f64>) {
        if upper < self.upper {
            (self.upper, self.x, self.y) = (upper, x, y);
        }
    }

    /// Takes the witnesses of a distance, if these are nearer.
    fn attain_distance(&mut self, pair: &Pair<'_>, apart: &Distance) {
        let [x, y] = [&apart.witness_a, &apart.witness_b].map(|witness| pair.world_to_query(witness));
        self.attain(apart.upper / pair.unit(), x, y);
    }

    fn narrow(&self, best: &Best<'_>) -> bool {
        let depth = if self.upper < 0.0 { -self.lower } else { 0.0 };
        self.upper - self.lower <= tolerance(best.pair, best.options, depth)
    }
}
