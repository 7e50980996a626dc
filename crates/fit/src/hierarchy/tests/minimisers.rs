//! Several nearest pairs, and pairs that are not finitely many.

use super::{bound, set};
use crate::hierarchy::{HierarchyBound, PlacedSet, hierarchy_level_distance};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;
use sublevel_core::body::Body;
use sublevel_core::polynomial::{Exponents, Polynomial};

fn polynomial(terms: &[(Exponents, f64)]) -> Polynomial {
    Polynomial::new(terms.to_vec()).unwrap()
}

/// Wells about (±1, 0, 0): `(x² - 1)² + y² + z² <= 0.1`.
fn two_wells() -> Polynomial {
    polynomial(&[([4, 0, 0], 1.0), ([2, 0, 0], -2.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0, 0, 0], 1.9)])
}

/// Every pair is as far apart as the nearest, and its points are in the sets.
fn check(found: &HierarchyBound, sets: [&PlacedSet; 2], expected: usize) {
    println!("{found:?}");
    assert!(found.is_exact);
    assert_eq!(found.minimisers.len(), expected);
    for points in &found.minimisers {
        assert!((points[0] - points[1]).norm() <= found.lower_m + 1e-5 * 4.0);
        for (set, point) in sets.iter().zip(points) {
            assert!(set.posed().unwrap().membership().unwrap().contains(point));
        }
    }
}

#[test]
fn both_wells_are_found_from_their_plane_of_symmetry() {
    let wells = two_wells();
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5));
    let pose = Isometry3::from_parts(Translation3::new(0.4, 0.1, -0.7), turn);
    for (away, level) in [(Vector3::new(0.0, 3.0, 0.0), 0), (Vector3::new(0.0, 2.0, 1.0), 1)] {
        let mut sets = [set(&wells, 1.5, pose), PlacedSet::of_body(&ball, pose * Translation3::from(away))];
        for _ in 0..2 {
            let found = bound([&sets[0], &sets[1]], level).unwrap();
            check(&found, [&sets[0], &sets[1]], 2);
            assert!(found.has_all_minimisers);
            sets.reverse();
        }
    }
    // Off the plane one is nearer.
    let off = pose * Translation3::new(0.2, 3.0, 0.0);
    let sets = [set(&wells, 1.5, pose), PlacedSet::of_body(&ball, off)];
    let found = bound([&sets[0], &sets[1]], 0).unwrap();
    check(&found, [&sets[0], &sets[1]], 1);
    assert!(found.has_all_minimisers);
}

/// Wells about (±1, ±1, 0) and a ball above: the moments of degree 2 of four points of a square
/// have a larger rank than those of degree 1, so level 0 does not call four pairs all, and level 1
/// does.
#[test]
fn four_wells_need_a_level_more() {
    let wells = polynomial(&[
        ([4, 0, 0], 1.0),
        ([2, 0, 0], -2.0),
        ([0, 4, 0], 1.0),
        ([0, 2, 0], -2.0),
        ([0, 0, 2], 1.0),
        ([0, 0, 0], 2.9),
    ]);
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    let sets =
        [set(&wells, 1.5, Isometry3::identity()), PlacedSet::of_body(&ball, Isometry3::translation(0.0, 0.0, 2.0))];
    for level in 0..=1 {
        let found = bound([&sets[0], &sets[1]], level).unwrap();
        check(&found, [&sets[0], &sets[1]], 4);
        assert_eq!(found.has_all_minimisers, level == 1);
    }
}

/// A ring `(x² + y² - 1)² + z² <= 0.1` about a ball at its middle: every direction is as near.
#[test]
fn a_ring_has_no_finite_list() {
    let ring = polynomial(&[
        ([4, 0, 0], 1.0),
        ([2, 2, 0], 2.0),
        ([0, 4, 0], 1.0),
        ([2, 0, 0], -2.0),
        ([0, 2, 0], -2.0),
        ([0, 0, 2], 1.0),
        ([0, 0, 0], 1.9),
    ]);
    let ball = Body::ball("ball", Vector3::zeros(), 0.2).unwrap();
    let sets = [set(&ring, 1.5, Isometry3::identity()), PlacedSet::of_body(&ball, Isometry3::identity())];
    // The inner radius is the root of 1 - √0.1.
    let truth = (1.0 - 0.1_f64.sqrt()).sqrt() - 0.2;
    for level in 0..=1 {
        let found = bound([&sets[0], &sets[1]], level).unwrap();
        println!("level {level}: {found:?}");
        assert!(found.lower_m <= truth && found.upper_m >= truth - 1e-9);
        assert!(!found.has_all_minimisers, "{found:?}");
    }
    let low =
        |level| hierarchy_level_distance([&sets[1], &sets[0]], level, &mut |_| ControlFlow::Continue(())).unwrap();
    for level in 0..=1 {
        let found = low(level);
        println!("level {level}: {found:?}");
        assert!(!found.has_all_minimisers && found.lower <= found.upper);
    }
}

/// The level distance of a ball on the plane of symmetry over two wells has two minimisers.
#[test]
fn level_distances_have_several_minimisers() {
    let wells = two_wells();
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let sets =
        [PlacedSet::of_body(&ball, Isometry3::translation(0.0, 1.5, 0.0)), set(&wells, 1.5, Isometry3::identity())];
    let found = hierarchy_level_distance([&sets[0], &sets[1]], 0, &mut |_| ControlFlow::Continue(())).unwrap();
    println!("{found:?}");
    assert!(found.is_exact && found.has_all_minimisers && found.minimisers.len() == 2);
    let mut sides: Vec<_> = found.minimisers.iter().map(|x| x[0].signum()).collect();
    sides.sort_by(f64::total_cmp);
    assert_eq!(sides, [-1.0, 1.0]);
    for x in &found.minimisers {
        let value = (x - Vector3::new(0.0, 1.5, 0.0)).norm_squared();
        assert!(wells.evaluate(x).value <= 1.0 && value <= found.lower + 1e-5 * value.max(1.0));
    }
}

/// Sets that share points are no distance apart, in one pair, and no list is complete.
#[test]
fn sets_that_overlap_have_one_point_in_common() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let sets = [0.0, 0.7].map(|x| PlacedSet::of_body(&ball, Isometry3::translation(x, 0.0, 0.0)));
    let found = bound([&sets[0], &sets[1]], 1).unwrap();
    assert!(found.is_exact && found.upper_m == 0.0 && found.minimisers.len() == 1, "{found:?}");
    assert!(found.minimisers[0][0] == found.minimisers[0][1] && !found.has_all_minimisers, "{found:?}");
}
