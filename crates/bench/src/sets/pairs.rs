//! Random pairs of sets that bend inwards, as in section IV-A of the paper, bracketed by both
//! methods.

use crate::comparison::{ComparisonError, Random};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel::body::{Aabb, BasicSet, Normalization};
use sublevel::branch_and_bound::{BoundedSet, BranchAndBound, Limits, PlacedSet};
use sublevel::fit;
use sublevel::measure::Pose;
use sublevel::polynomial::Polynomial;

/// Degrees, with the pairs of each, and of a quick run.
const PAIRS: [(usize, usize, usize); 2] = [(4, 200, 20), (6, 40, 5)];

/// Divisions after which branch and bound is stopped, one bracket for each.
const STEPS: [usize; 9] = [64, 256, 512, 1024, 2048, 4096, 8192, 16_384, 65_536];

/// Half the edge of a box around the sets, without unit.
const HALF: f64 = 2.0;

/// Relative width at which branch and bound ends by itself.
const NARROW: f64 = 1e-7;

/// A method as rows name it.
pub(super) const BRANCH: &str = "branch and bound";

/// Of a level of the hierarchy.
pub(super) fn level_name(level: usize) -> String {
    format!("level {level}")
}

/// A bracket of the distance of a pair.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bracket {
    pub(super) degree: usize,
    /// Seed of the pair.
    pub(super) pair: u64,
    pub(super) method: String,
    /// Divisions allowed; 0 of the hierarchy.
    pub(super) steps: usize,
    pub(super) seconds: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// Whether the method says that its lower bound is the distance.
    pub(super) exact: bool,
}

/// Coordinates as they are.
pub(super) const UNIT: Normalization = Normalization {
    center: Vector3::new(0.0, 0.0, 0.0),
    linear: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
};

/// Brackets of all pairs by both methods; the next level of the hierarchy where level 0 is not
/// exact.
///
/// # Errors
/// Stopped, or brackets of one pair that do not meet.
pub(super) fn brackets(
    quick: bool,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Vec<Bracket>, ComparisonError> {
    let mut all = Vec::new();
    for (degree, many, few) in PAIRS {
        for pair in 0..if quick { few } else { many } as u64 {
            if pair.is_multiple_of(10) {
                announce(&format!("pairs of degree {degree}: {pair}"))?;
            }
            all.extend(of_pair(degree, pair)?);
        }
    }
    Ok(all)
}

fn of_pair(degree: usize, pair: u64) -> Result<Vec<Bracket>, ComparisonError> {
    let mut random = Random(pair + 1);
    let polynomials = [lumpy(&mut random, degree)?, lumpy(&mut random, degree)?];
    let away = random.direction() * (4.0 + random.signed());
    let turn = UnitQuaternion::from_scaled_axis(random.direction() * (3.0 * random.signed()));
    let pose = Pose::from_quaternion(away, turn.coords.into())?;
    let bounding_box = Aabb { min: Vector3::repeat(-HALF), max: Vector3::repeat(HALF) };
    let basic = |k: usize| BasicSet { normalization: &UNIT, polynomials: vec![&polynomials[k]] };
    let placed = |k: usize, pose: Pose| PlacedSet::new(BoundedSet { set: basic(k), bounding_box, id: None }, pose);
    let sets = [placed(0, Pose::identity()), placed(1, pose)];
    let failed = |what: String| ComparisonError::Representation {
        mesh: "random pairs",
        method: format!("degree {degree}, pair {pair}"),
        what,
    };
    let bracket = |method: String, steps: usize, seconds: f64, lower: f64, upper: f64, exact: bool| Bracket {
        degree,
        pair,
        method,
        steps,
        seconds,
        lower,
        upper,
        exact,
    };
    let mut found = Vec::new();
    for max_steps in STEPS {
        let limits = Limits { accuracy: NARROW, max_steps, ..Limits::default() };
        let start = Instant::now();
        let made = BranchAndBound::new().distance(&sets[0], &sets[1], &limits);
        let seconds = start.elapsed().as_secs_f64();
        let made = made.map_err(|(_, error)| failed(error.to_string()))?;
        found.push(bracket(BRANCH.into(), max_steps, seconds, made.lower_m, made.upper_m, false));
    }
    let near_boundary = |k: usize| near_boundary(&polynomials[k], &mut Random(pair + 7));
    let of_hierarchy = |k: usize, pose: Isometry3<f64>| fit::PlacedSet {
        set: basic(k),
        bounding_box,
        pose,
        near_boundary: near_boundary(k),
    };
    let second = Isometry3::from_parts(Translation3::from(away), turn);
    let hierarchy = [of_hierarchy(0, Isometry3::identity()), of_hierarchy(1, second)];
    for level in 0..=1 {
        let made = fit::hierarchy_distance([&hierarchy[0], &hierarchy[1]], level, &mut |_| ControlFlow::Continue(()));
        let made = made.map_err(|error| failed(error.to_string()))?;
        found.push(bracket(level_name(level), 0, made.seconds, made.lower_m, made.upper_m, made.is_exact));
        if made.is_exact || degree > 4 {
            break;
        }
    }
    let lower = found.iter().map(|bracket| bracket.lower).fold(0.0, f64::max);
    let upper = found.iter().map(|bracket| bracket.upper).fold(f64::INFINITY, f64::min);
    if lower > upper {
        return Err(failed(format!("brackets do not meet: a lower bound is {lower}, an upper one {upper}")));
    }
    Ok(found)
}

/// A polynomial of this degree with random lower terms, bounded, whose set bends inwards.
fn lumpy(random: &mut Random, degree: usize) -> Result<Polynomial, ComparisonError> {
    let top = degree as u8;
    let mut terms = vec![([top, 0, 0], 1.0), ([0, top, 0], 1.0), ([0, 0, top], 1.0)];
    for e in [[2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 1, 0], [1, 0, 1], [0, 1, 1], [3, 0, 0], [0, 1, 0], [0, 0, 1]] {
        terms.push((e, 0.9 * random.signed()));
    }
    Polynomial::new(terms).map_err(|error| ComparisonError::Representation {
        mesh: "random pairs",
        method: format!("degree {degree}"),
        what: error.to_string(),
    })
}

/// Points of the set at which p is nearly 1.
pub(super) fn near_boundary(polynomial: &Polynomial, random: &mut Random) -> Vec<Vector3<f64>> {
    let mut points = Vec::new();
    for _ in 0..200 {
        let u = random.direction();
        let inside = |r: f64| polynomial.evaluate(&(u * r)).value <= 1.0;
        let steps = 100;
        let outermost = (0..steps).rev().map(|k| HALF * f64::from(k) / f64::from(steps)).find(|&r| inside(r));
        points.extend(outermost.map(|r| u * r));
    }
    points
}
