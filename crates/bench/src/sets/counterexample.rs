//! A pair of sets for which level 0 of the hierarchy is not exact, as all examples of the paper are.

use super::pairs::{UNIT, near_boundary};
use crate::comparison::{ComparisonError, Random};
use nalgebra::{Isometry3, Vector3};
use std::ops::ControlFlow;
use sublevel::body::{Aabb, BasicSet, Body};
use sublevel::fit::{PlacedSet, hierarchy_distance};
use sublevel::polynomial::Polynomial;

/// Levels that are asked.
const LEVELS: usize = 3;

/// What a level of the hierarchy finds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    pub(super) level: usize,
    pub(super) seconds: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// Whether the level says that its lower bound is the distance.
    pub(super) exact: bool,
}

/// The levels for `(x^2 - 1)^2 + x/2 + y^2 + z^2 + 0.9 <= 1`, two wells along x of which only the
/// farther one is deep enough, and a ball of radius 0.1 about (2, 0, 0), metres: the multiplier of
/// level 0 is one number for both wells.
///
/// # Errors
/// A level that fails.
pub(super) fn counterexample() -> Result<Vec<Level>, ComparisonError> {
    let failed =
        |what: String| ComparisonError::Representation { mesh: "counterexample", method: "hierarchy".into(), what };
    let terms =
        [([4, 0, 0], 1.0), ([2, 0, 0], -2.0), ([1, 0, 0], 0.5), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0, 0, 0], 1.9)];
    let wells = Polynomial::new(terms.to_vec()).map_err(|error| failed(error.to_string()))?;
    let ball = Body::ball("ball", Vector3::zeros(), 0.1).map_err(|error| failed(error.to_string()))?;
    let half = Vector3::repeat(2.0);
    let near_boundary = near_boundary(&wells, &mut Random(7));
    let sets = [
        PlacedSet {
            set: BasicSet { normalization: &UNIT, polynomials: vec![&wells] },
            bounding_box: Aabb { min: -half, max: half },
            pose: Isometry3::identity(),
            near_boundary,
        },
        PlacedSet::of_body(&ball, Isometry3::translation(2.0, 0.0, 0.0)),
    ];
    let mut levels = Vec::new();
    for level in 0..LEVELS {
        let found = hierarchy_distance([&sets[0], &sets[1]], level, &mut |_| ControlFlow::Continue(()));
        let found = found.map_err(|error| failed(error.to_string()))?;
        let (lower, upper, exact) = (found.lower_m, found.upper_m, found.is_exact);
        levels.push(Level { level, seconds: found.seconds, lower, upper, exact });
        if exact {
            break;
        }
    }
    Ok(levels)
}
