//! Level distances.

use super::{UNIT, quartic, set, wells};
use crate::FitError;
use crate::hierarchy::{HierarchyError, HierarchyLevelBound, MAX_LEVEL, PlacedSet, hierarchy_level_distance};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;
use sublevel_core::body::{Aabb, BasicSet, Body};
use sublevel_core::measure::{Options, Pose, WarmStart, level_distance};
use sublevel_core::polynomial::Polynomial;
use sublevel_testkit::Seeded;

fn bound(sets: [&PlacedSet; 2], level: usize) -> Result<HierarchyLevelBound, HierarchyError> {
    hierarchy_level_distance(sets, level, &mut |_| ControlFlow::Continue(()))
}

/// Against the measure of convex bodies, of one constraint and of several, apart and overlapping:
/// exact up to degree 4, and in most cases at degrees 6 and 8, where values of a polynomial may
/// range too widely over the other set for the solver.
#[test]
fn convex_bodies_are_exact_at_level_zero() {
    let mut random = Seeded(11);
    let (mut overlapping, mut several, mut saturated, mut exact) = (0, 0, 0, 0);
    for case in 0..80 {
        let mut body = |name: &str| {
            let axes = Vector3::from_fn(|_, _| 0.2 + 0.4 * (1.0 + random.signed()));
            match random.index(6) {
                kind @ 0..4 => Body::superellipsoid(name, Vector3::zeros(), axes, [2, 4, 6, 8][kind]).unwrap(),
                4 => Body::cylinder(name, axes[0], axes[1]).unwrap(),
                _ => Body::cuboid(name, axes).unwrap(),
            }
        };
        let [a, b] = [body("a"), body("b")];
        let mut pose = |far: f64| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| 2.0 * random.signed()));
            let at = Vector3::from_fn(|_, _| far * random.signed());
            (
                Isometry3::from_parts(Translation3::from(at), turn),
                Pose::from_quaternion(at, turn.coords.into()).unwrap(),
            )
        };
        let [(near, pose_a), (far, pose_b)] = [pose(0.5), pose([0.3, 2.0][case % 2])];
        let truth = level_distance(&a, &pose_a, &b, &pose_b, &Options::default(), &mut WarmStart::default());
        let sets = [PlacedSet::of_body(&a, near), PlacedSet::of_body(&b, far)];
        let found = bound([&sets[0], &sets[1]], 0).unwrap();
        println!("case {case}: {} to {}, {found:?}", truth.lower, truth.upper);
        assert!(found.lower <= truth.upper && found.upper >= truth.lower, "case {case}");
        // What the first set's polynomial is at most on the second set, over what it is at least.
        let values = b.boundary().iter().map(|x| {
            let x = far.transform_point(&(*x).into());
            a.value_upper(&near.inverse_transform_point(&x).coords)
        });
        let range = values.fold(0.0, f64::max) / truth.upper.max(1.0);
        println!("case {case}: range {range:e}, width {:e}", (found.upper - found.lower) / found.upper.max(1.0));
        assert!(a.degree().max(b.degree()) > 4 || found.is_exact, "case {case}: {truth:?} {found:?}");
        exact += usize::from(found.is_exact);
        let point = found.point.unwrap();
        assert!(b.value_upper(&far.inverse_transform_point(&point.into()).coords) <= 1.0 + 1e-12, "case {case}");
        overlapping += usize::from(truth.upper < 1.0);
        several += usize::from(!a.is_smooth());
        saturated += usize::from(truth.saturated);
    }
    println!("{exact} exact, {overlapping} overlapping, {several} with several constraints, {saturated} saturated");
    assert!(overlapping > 10 && several > 10 && saturated > 5 && exact >= 62);
}

/// Random quartics that bend inwards: brackets contain what is sampled, and rise with the level.
#[test]
fn brackets_of_random_quartics_contain_what_is_sampled() {
    let (mut exact, mut widest) = (0, 0.0_f64);
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let polynomials = [quartic(&mut random), quartic(&mut random)];
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| random.signed()));
        let away = Vector3::from_fn(|_, _| random.signed()).normalize() * (1.0 + 2.0 * random.positive());
        let pose = Isometry3::from_parts(Translation3::from(away), turn);
        let sets = [set(&polynomials[0], 2.0, Isometry3::identity()), set(&polynomials[1], 2.0, pose)];
        let found = bound([&sets[0], &sets[1]], 0).unwrap();
        let inside = (0..200_000).map(|_| Vector3::from_fn(|_, _| 2.0 * random.signed()));
        let inside = inside.filter(|x| polynomials[1].evaluate(x).value <= 1.0);
        let values = inside.map(|x| polynomials[0].evaluate(&pose.transform_point(&x.into()).coords).value);
        let sampled = values.fold(f64::INFINITY, f64::min);
        assert!(found.lower <= found.upper && found.lower <= sampled, "seed {seed}: {found:?} {sampled}");
        assert!(found.upper <= sampled + 1e-9, "seed {seed}: {found:?} {sampled}");
        exact += usize::from(found.is_exact);
        widest = widest.max((found.upper - found.lower) / found.upper.abs().max(1.0));
        if !found.is_exact {
            let next = bound([&sets[0], &sets[1]], 1).unwrap();
            assert!(next.lower >= found.lower - 1e-6 && next.lower <= sampled, "seed {seed}: {next:?}");
        }
    }
    println!("{exact} of 60 exact at level 0, the widest {widest}");
    assert!(exact > 30);
}

/// How low |x - (2, 0, 0)|² is on a set of two wells, the nearer of which is not deep enough: level
/// 0 is below, level 1 is exact. The distance of the wells to (2, 0, 0) is 2.6047.
#[test]
fn a_higher_level_closes_what_level_zero_leaves() {
    let wells = wells();
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let sets =
        [PlacedSet::of_body(&ball, Isometry3::translation(2.0, 0.0, 0.0)), set(&wells, 2.0, Isometry3::identity())];
    let found = [0, 1].map(|level| bound([&sets[0], &sets[1]], level).unwrap());
    println!("{found:?}");
    for bound in &found {
        assert!((bound.upper - 2.6047_f64.powi(2)).abs() < 1e-3, "{bound:?}");
        assert!(bound.lower <= bound.upper);
    }
    let [zero, one] = found;
    assert!(!zero.is_exact && zero.minimisers.is_empty() && zero.lower < 5.0, "{zero:?}");
    assert!(one.is_exact && one.minimisers.len() == 1 && one.has_all_minimisers, "{one:?}");
}

/// The larger of two polynomials on a ball is lowest where both are equal, above the least of each.
#[test]
fn several_polynomials_are_averaged() {
    let [left, right] = [-1.0, 1.0].map(|side| {
        Polynomial::new(vec![
            ([2, 0, 0], 1.0),
            ([0, 2, 0], 1.0),
            ([0, 0, 2], 1.0),
            ([1, 0, 0], 2.0 * side),
            ([0, 0, 0], 1.0),
        ])
        .unwrap()
    });
    let lens = PlacedSet {
        set: BasicSet { normalization: &UNIT, polynomials: vec![&left, &right] },
        bounding_box: Aabb { min: Vector3::repeat(-1.0), max: Vector3::repeat(1.0) },
        pose: Isometry3::identity(),
        near_boundary: Vec::new(),
    };
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    let ball = PlacedSet::of_body(&ball, Isometry3::translation(0.0, 2.0, 0.0));
    let found = bound([&lens, &ball], 0).unwrap();
    // Both are 1 + 1.5² at (0, 1.5, 0).
    assert!(found.is_exact && (found.lower - 3.25).abs() < 1e-5, "{found:?}");
    assert!((found.point.unwrap() - Vector3::new(0.0, 1.5, 0.0)).norm() < 1e-6, "{found:?}");
}

#[test]
fn bad_input_is_refused_by_name() {
    let ball = Body::ball("ball", Vector3::zeros(), 0.1).unwrap();
    let good = PlacedSet::of_body(&ball, Isometry3::translation(1.0, 0.0, 0.0));
    let refused = |set: PlacedSet, level: usize| bound([&good, &set], level).expect_err("bad input");
    assert_eq!(refused(good.clone(), MAX_LEVEL + 1), HierarchyError::Level(MAX_LEVEL + 1));
    let none = PlacedSet { set: BasicSet { normalization: &UNIT, polynomials: Vec::new() }, ..good.clone() };
    assert_eq!(bound([&none, &good], 0), Err(HierarchyError::NoPolynomial(0)));
    assert_eq!(refused(none, 0), HierarchyError::NoPolynomial(1));
    let lost = PlacedSet { pose: Isometry3::translation(f64::NAN, 0.0, 0.0), ..good.clone() };
    assert!(refused(lost, 0).to_string().contains("sets[1]: its pose"));
    let nowhere =
        Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0, 0, 0], 2.0)]).unwrap();
    assert_eq!(refused(set(&nowhere, 1.0, Isometry3::identity()), 0), HierarchyError::Empty);
    let stopped = hierarchy_level_distance([&good, &good], 1, &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(HierarchyError::Fit(FitError::Cancelled)));
}

/// Where constraints do not bound the second set, its box does, and nothing is called exact.
#[test]
fn a_slab_is_bounded_by_its_box() {
    let slab = Polynomial::new(vec![([2, 0, 0], 1.0)]).unwrap();
    let saddle = Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], -1.0)]).unwrap();
    let sets = [set(&saddle, 1.0, Isometry3::identity()), set(&slab, 1.0, Isometry3::identity())];
    let found = bound([&sets[0], &sets[1]], 0).unwrap();
    assert!(!found.is_exact && found.lower <= -1.0 && found.lower > -3.1, "{found:?}");
    assert!(found.upper >= -1.0 && found.minimisers.is_empty(), "{found:?}");
}

/// Far from the origin two unit balls that touch have level distance 1, as far as poses are known.
#[test]
fn rounding_of_far_poses_is_in_the_bracket() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let far = |x: f64| PlacedSet::of_body(&ball, Isometry3::translation(1e6, 0.0, x));
    let found = bound([&far(0.0), &far(2.0)], 0).unwrap();
    assert!(found.lower <= 1.0 && found.upper >= 1.0 && found.is_exact, "{found:?}");
}
