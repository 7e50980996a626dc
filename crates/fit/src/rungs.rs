//! The rungs of a ladder, tried one by one until one is near enough, and what their queries cost.

use super::error::FitError;
use super::fitted::{Fit, Rung};
use super::object::Object;
use super::options::FitOptions;
use super::progress::Progress;
use super::slab::MAX_SLABS;
use std::ops::{ControlFlow, RangeInclusive};
use sublevel_core::body::Body;

/// Terms of a slab's quadratic.
const SLAB_TERMS: usize = 10;

/// Degrees of the rungs above the ball.
pub(super) const DEGREES: [usize; 4] = [2, 4, 6, 8];

/// What a warm distance query of a body costs, about, µs.
pub(super) struct Costs;

impl Costs {
    /// Of the ball and of [`DEGREES`].
    const RUNGS: [f64; 5] = [0.15, 0.15, 0.2, 0.25, 0.45];

    /// Of the cheapest body.
    pub(super) const CHEAPEST: f64 = 0.15;

    /// Of a body with edges.
    pub(super) const SLABBED: f64 = 3.0;

    /// Of a rung, counted from the ball.
    pub(super) fn of_rung(rung: usize) -> f64 {
        Self::RUNGS[rung]
    }

    /// Of a part of a compound, on a rung counted from the ball; none is taken above degree 6.
    pub(super) fn of_part(rung: usize) -> f64 {
        if rung < 4 { Self::of_rung(rung) } else { f64::INFINITY }
    }

    pub(super) fn of(body: &Body) -> f64 {
        if body.is_smooth() { Self::of_rung(body.degree() / 2) } else { Self::SLABBED }
    }
}

/// The rungs of an object on the way to a gap.
pub(super) struct Rungs<'a> {
    object: &'a Object<'a>,
    max_gap_m: f64,
    options: &'a FitOptions,
    /// Those that were not near enough.
    fits: Vec<Fit>,
    /// What fails is reported if nothing else does.
    closest: FitError,
}

impl<'a> Rungs<'a> {
    pub(super) fn new(object: &'a Object<'a>, max_gap_m: f64, options: &'a FitOptions) -> Self {
        let closest = FitError::Gap { asked_m: max_gap_m, reached_m: f64::INFINITY, degree: 0, slabs: 0 };
        Self { object, max_gap_m, options, fits: Vec::new(), closest }
    }

    /// The lowest of some rungs, counted from the ball, that is near enough.
    pub(super) fn climb(
        &mut self,
        rungs: RangeInclusive<usize>,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Option<Rung>, FitError> {
        for rung in rungs {
            if let Some(found) = self.try_one(rung, progress)? {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// One rung, counted from the ball, if it is near enough and the options reach that high.
    pub(super) fn try_one(
        &mut self,
        rung: usize,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Option<Rung>, FitError> {
        if rung == 0 {
            let ball = self.object.ball()?;
            return Ok((ball.gap.most_m <= self.max_gap_m).then_some(ball));
        }
        let Some(options) = degree_options(self.options).nth(rung - 1) else { return Ok(None) };
        match self.object.fit(&options, progress) {
            Ok(fit) if fit.gap.most_m <= self.max_gap_m => return Ok(Some(fit.into())),
            Ok(fit) => self.fits.push(fit),
            Err(FitError::Cancelled) => return Err(FitError::Cancelled),
            Err(error) => self.closest = error,
        }
        Ok(None)
    }

    /// The rungs cut by slabs: the one near enough with the fewest terms.
    pub(super) fn slabbed(mut self, progress: &mut dyn FnMut(Progress) -> ControlFlow<()>) -> Result<Rung, FitError> {
        let mut cheapest: Option<Fit> = None;
        for fit in self.fits {
            let room =
                cheapest.as_ref().map_or(usize::MAX, |known| terms(&known.body).saturating_sub(terms(&fit.body)));
            let slabs = MAX_SLABS.min(room.saturating_sub(1) / SLAB_TERMS);
            match self.object.cut(fit, slabs, self.max_gap_m, progress) {
                Ok(fit) if fit.gap.most_m <= self.max_gap_m => cheapest = Some(fit),
                Ok(Fit { body, gap, .. }) => {
                    if let FitError::Gap { reached_m, degree, slabs, .. } = &mut self.closest
                        && gap.most_m < *reached_m
                    {
                        (*reached_m, *degree, *slabs) = (gap.most_m, body.degree(), body.constraints().len() - 1);
                    }
                }
                Err(FitError::Cancelled) => return Err(FitError::Cancelled),
                Err(error) => self.closest = error,
            }
        }
        cheapest.map(Into::into).ok_or(self.closest)
    }
}

/// Terms of all constraints, which queries evaluate.
fn terms(body: &Body) -> usize {
    body.constraints().iter().map(|constraint| constraint.polynomial.terms().len()).sum()
}

/// The options of the rungs above the ball.
pub(super) fn degree_options(options: &FitOptions) -> impl Iterator<Item = FitOptions> {
    DEGREES
        .into_iter()
        .filter(|&degree| degree <= options.degree)
        .map(|degree| FitOptions { degree, ..options.clone() })
}
