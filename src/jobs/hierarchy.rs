//! Solves of the hierarchy: what they are asked for, checked before any work, and executed.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Translation3};

use super::request::{RequestError, check_request_id};
use crate::body::Obstacle;
use crate::fit::{
    self, HierarchyError, MAX_LEVEL, PlacedSet, check_hierarchy, check_hierarchy_level, hierarchy_distance,
    hierarchy_level_distance,
};
use crate::store::{HierarchyMeasure, HierarchyOutcome, HierarchyRequest, HierarchySet};

/// Names of the two sets in a [`RequestError`].
const SETS: [&str; 2] = ["a", "b"];

/// Checks what is known of a request without its bodies, and its id.
///
/// # Errors
/// The first field that cannot be used.
pub fn check_solve(request_id: &str, request: &HierarchyRequest) -> Result<(), RequestError> {
    check_request_id(request_id)?;
    if request.level > MAX_LEVEL {
        return Err(RequestError::new("level", HierarchyError::Level(request.level)));
    }
    Ok(())
}

/// Checks a request about these sets, without a solve; takes milliseconds.
///
/// # Errors
/// What is wrong with the level or with a set (of [`RequestError::field`] `a` or `b`), such as that
/// the program would be too large.
pub fn check_solve_of(request: &HierarchyRequest, sets: &[Obstacle; 2]) -> Result<(), RequestError> {
    let [a, b] = placed(request, sets);
    let checked = match request.measure {
        HierarchyMeasure::Distance => check_hierarchy([&a, &b], request.level),
        HierarchyMeasure::LevelAOnB => check_hierarchy_level([&a, &b], request.level),
    };
    checked.map_err(|error| match error {
        HierarchyError::Set { index, why } => RequestError::new(SETS[index.min(1)], why),
        HierarchyError::NoPolynomial(index) => RequestError::new(SETS[index.min(1)], error),
        _ => RequestError::new("level", error),
    })
}

/// Executes a request about these sets. `progress` can stop it.
///
/// # Errors
/// What is wrong with the request, and what could not be solved.
pub fn solve(
    request: &HierarchyRequest,
    sets: &[Obstacle; 2],
    progress: &mut dyn FnMut(fit::Progress) -> ControlFlow<()>,
) -> Result<HierarchyOutcome, HierarchyError> {
    let [a, b] = placed(request, sets);
    let outcome = match request.measure {
        HierarchyMeasure::Distance => {
            let bound = hierarchy_distance([&a, &b], request.level, progress)?;
            HierarchyOutcome {
                lower: bound.lower_m,
                upper: Some(bound.upper_m),
                points_m: bound.points.map(|points| points.map(Into::into)),
                is_exact: bound.is_exact,
                iterations: bound.iterations,
                seconds: bound.seconds,
            }
        }
        HierarchyMeasure::LevelAOnB => {
            let bound = hierarchy_level_distance([&a, &b], request.level, progress)?;
            HierarchyOutcome {
                lower: bound.lower,
                upper: Some(bound.upper),
                points_m: bound.point.map(|point| [point.into(); 2]),
                is_exact: bound.is_exact,
                iterations: bound.iterations,
                seconds: bound.seconds,
            }
        }
    };
    // What is kept as JSON is finite.
    Ok(HierarchyOutcome {
        lower: outcome.lower.max(f64::MIN),
        upper: outcome.upper.filter(|upper| upper.is_finite()),
        ..outcome
    })
}

fn placed<'a>(request: &HierarchyRequest, sets: &'a [Obstacle; 2]) -> [PlacedSet<'a>; 2] {
    std::array::from_fn(|index| {
        let HierarchySet { pose, .. } = &request.sets[index];
        let pose = Isometry3::from_parts(Translation3::from(*pose.translation()), *pose.rotation());
        PlacedSet::of(&sets[index], pose)
    })
}
