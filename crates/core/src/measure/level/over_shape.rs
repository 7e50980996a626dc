//! The level distance of a smooth body over a box or a cylinder.

use super::answer::LevelDistance;
use crate::body::{Body, ClosedForm};
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::exact_shape::{LevelMinimum, LevelQuery, active, direction_to_world, to_world};
use crate::measure::status::Status;
use crate::measure::warm::Hint;
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// Such a pair.
pub(super) struct OverShape<'a> {
    of_a: At<'a, Body>,
    of_b: At<'a, Body>,
    form: &'a ClosedForm,
}

impl<'a> OverShape<'a> {
    /// The pair, if it is one. Balls and ellipsoids are left to continuation, which is as fast.
    #[inline(always)]
    pub(super) fn new(of_a: At<'a, Body>, of_b: At<'a, Body>) -> Option<Self> {
        if !of_a.0.is_smooth() || of_b.0.is_smooth() {
            return None;
        }
        Some(Self { of_a, of_b, form: of_b.0.closed_form()? })
    }

    /// The answer with its hint.
    ///
    /// # Errors
    /// After how many evaluations the general search has to go on.
    pub(super) fn solve(&self, hint: &Hint, options: &Options<'_>, spent: u32) -> Result<(LevelDistance, Hint), u32> {
        let Self { of_a: (body, pose), of_b: (_, form_pose), form } = *self;
        let from = if let Hint::Level { x_b, .. } = hint { Some(*x_b) } else { None };
        let options = &options.after(spent);
        let found = dispatch(LevelQuery { body, pose, form, form_pose, options, from })?;
        Ok(self.answer(&found, spent))
    }

    fn answer(&self, found: &LevelMinimum, spent: u32) -> (LevelDistance, Hint) {
        let Self { of_a: (_, pose), of_b: (_, form_pose), form } = *self;
        let witness = to_world(form, form_pose, found.y);
        let gradient = direction_to_world(form, form_pose, found.gradient);
        let of_form = active(form.shape(), found.held);
        let x_b: Vector3<f64> = form_pose.rotation().inverse_transform_vector(&(witness - form_pose.translation()));
        let active_b = of_form.iter().fold(0, |bits, (index, _)| bits | 1 << index);
        let answer = LevelDistance {
            status: Status::Converged,
            lower: found.lower,
            upper: found.upper,
            witness,
            multiplier: of_form.iter().map(|(_, multiplier)| multiplier).sum(),
            saturated: false,
            gradient_a: Twist::of_gradient(-gradient, &witness, pose.translation()),
            gradient_b: Twist::of_gradient(gradient, &witness, form_pose.translation()),
            tied: false,
            iterations: spent + found.rounds,
        };
        (answer, Hint::Level { x_b, active_a: 1, active_b })
    }
}
