//! The stages of a search. A stage that fails hands on to the next, so that a broken one would be
//! replaced without a trace: tests switch the others off and have each solve a catalogue alone
//! (`tests/stages/`), and the feature `ablation` lets the bench count what is lost without one.

// Outside of the crate these are seen with the feature `ablation` only.
#![cfg_attr(not(feature = "ablation"), allow(unreachable_pub))]

/// A method that finds an answer, or a part of one, which another one would find as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Newton's method on one body, smooth or with edges, against a shape with a closed form.
    ClosedForm,
    /// Continuation from the answer before.
    Follow,
    /// Continuation from the poses alone, or from GJK's points.
    Seek,
    /// Newton's method with an active set for each body.
    Edges,
    /// Newton's method on the optimality conditions with active sets.
    Newton,
    /// Sequential quadratic programming along a ray, which finds active sets.
    Ray,
    /// GJK, or a Minkowski portal, on support tables.
    SupportTables,
    /// The point deepest in both bodies, by sequential quadratic programming.
    Deepest,
    /// Interior-point method on the distance, or on the ray of growth distances.
    InteriorDistance,
    /// Interior-point method for the point deepest in both bodies, or the level.
    InteriorLevel,
    /// Newton's method and brackets in double-double arithmetic.
    Refinement,
    /// Newton's method until the normal is that of the solution.
    Alignment,
    /// The minimum of one body's polynomial where it lies in the other body.
    Saturation,
    /// Newton's method for several poses of a batch at once.
    Lanes,
    /// The gap between circumscribed balls, and what balls inside the bodies have in common.
    Balls,
    /// Bounds by planes across a few directions.
    Planes,
    /// A first sampling of all directions for the least depth.
    DirectionSampling,
    /// Search around a direction for a better one, where edges stop Newton's method.
    CompassSearch,
    /// Support points by Newton's method, several at once or one.
    SupportLanes,
    /// The distances of single points of a capsule's axis.
    AlongAxis,
    /// Sequential quadratic programming over one body.
    ProjectionSteps,
    /// An interior-point method over one body.
    ProjectionInterior,
    /// Where a ray enters a body, by an interpolation of the values along it.
    Interpolation,
    /// Where a ray or a ball comes to touch a body, by the curvature of what was evaluated.
    Curvature,
    /// The middle of the bracket of a cast.
    Halving,
    /// Proof that moving circumscribed balls stay apart.
    MovingBalls,
    /// A separating plane that turns with the first body.
    PlaneOfA,
    /// A separating plane that turns with the second body.
    PlaneOfB,
    // From here on parts of stages, which run only within these.
    /// Quadratic programs along the normal from the best points so far.
    Again,
    /// The deepest point where a narrow bracket does not say on which side of contact it is.
    UnsureDeepest,
    /// A restart of the closed forms from the least value over the shape.
    ExactLevel,
    /// Newton's method with an active set for a body with edges against a shape with a closed form.
    EdgesBesideShape,
}

#[cfg(any(test, feature = "ablation"))]
impl Stage {
    /// All of them, parts of stages last.
    pub const ALL: [Self; 32] = [
        Self::ClosedForm,
        Self::Follow,
        Self::Seek,
        Self::Edges,
        Self::Newton,
        Self::Ray,
        Self::SupportTables,
        Self::Deepest,
        Self::InteriorDistance,
        Self::InteriorLevel,
        Self::Refinement,
        Self::Alignment,
        Self::Saturation,
        Self::Lanes,
        Self::Balls,
        Self::Planes,
        Self::DirectionSampling,
        Self::CompassSearch,
        Self::SupportLanes,
        Self::AlongAxis,
        Self::ProjectionSteps,
        Self::ProjectionInterior,
        Self::Interpolation,
        Self::Curvature,
        Self::Halving,
        Self::MovingBalls,
        Self::PlaneOfA,
        Self::PlaneOfB,
        Self::Again,
        Self::UnsureDeepest,
        Self::ExactLevel,
        Self::EdgesBesideShape,
    ];
}

/// Whether a stage may run: always, but where stages are switched off for a count.
#[cfg(not(any(test, feature = "ablation")))]
#[inline(always)]
pub(in crate::measure) fn runs(_: Stage) -> bool {
    true
}

#[cfg(test)]
pub(in crate::measure) use mask::only;
#[cfg(any(test, feature = "ablation"))]
pub(in crate::measure) use mask::runs;
#[cfg(any(test, feature = "ablation"))]
pub use mask::{asked, except};

#[cfg(any(test, feature = "ablation"))]
mod mask {
    use super::Stage;
    use std::cell::Cell;

    thread_local! {
        /// A bit for each stage that may run on this thread.
        static MASK: Cell<u64> = const { Cell::new(u64::MAX) };
        /// A bit for each stage that has come to its turn.
        static ASKED: Cell<u64> = const { Cell::new(0) };
    }

    pub(in crate::measure) fn runs(stage: Stage) -> bool {
        ASKED.set(ASKED.get() | 1 << stage as u64);
        MASK.get() >> stage as u64 & 1 == 1
    }

    /// Does `work` on this thread, and which stages came to their turn.
    pub fn asked<T>(work: impl FnOnce() -> T) -> (T, impl Iterator<Item = Stage>) {
        ASKED.set(0);
        let done = work();
        let asked = ASKED.get();
        (done, Stage::ALL.into_iter().filter(move |stage| asked >> *stage as u64 & 1 == 1))
    }

    /// Does `work` with no other stages than these, and the parts of stages.
    #[cfg(test)]
    pub(in crate::measure) fn only<T>(stages: &[Stage], work: impl FnOnce() -> T) -> T {
        let parts = u64::MAX << Stage::Again as u64;
        with(stages.iter().fold(parts, |mask, stage| mask | 1 << *stage as u64), work)
    }

    /// Does `work` on this thread without these stages.
    pub fn except<T>(stages: &[Stage], work: impl FnOnce() -> T) -> T {
        with(stages.iter().fold(u64::MAX, |mask, stage| mask & !(1 << *stage as u64)), work)
    }

    fn with<T>(mask: u64, work: impl FnOnce() -> T) -> T {
        let before = MASK.replace(mask);
        let done = work();
        MASK.set(before);
        done
    }
}
