mod level;
mod minimisers;
mod sign_symmetry;

use super::local_search::nearest_points;
use super::{HierarchyBound, HierarchyError, MAX_LEVEL, PlacedSet, check_hierarchy, hierarchy_distance};
use crate::FitError;
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;
use sublevel_core::body::{Aabb, BasicSet, Body, Normalization};
use sublevel_core::measure::{Options, Pose, WarmStart, distance};
use sublevel_core::polynomial::Polynomial;
use sublevel_testkit::Seeded;
use sublevel_testkit::random::few_or;

fn bound(sets: [&PlacedSet; 2], level: usize) -> Result<HierarchyBound, HierarchyError> {
    hierarchy_distance(sets, level, &mut |_| ControlFlow::Continue(()))
}

const UNIT: Normalization = Normalization {
    center: Vector3::new(0.0, 0.0, 0.0),
    linear: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
};

/// A set of a polynomial, within a cube.
fn set(polynomial: &Polynomial, half: f64, pose: Isometry3<f64>) -> PlacedSet<'_> {
    let set = BasicSet { normalization: &UNIT, polynomials: vec![polynomial] };
    let bounding_box = Aabb { min: Vector3::repeat(-half), max: Vector3::repeat(half) };
    let mut near_boundary = Vec::new();
    let mut random = Seeded(1);
    for _ in 0..40_000 {
        let x = Vector3::from_fn(|_, _| half * random.signed());
        if (0.9..1.0).contains(&polynomial.evaluate(&x).value) {
            near_boundary.push(x);
        }
    }
    PlacedSet { set, bounding_box, pose, near_boundary }
}

/// Two wells along x, the one at positive x the shallower: at most 1 about (-1, 0, 0) alone.
fn wells() -> Polynomial {
    Polynomial::new(vec![
        ([4, 0, 0], 1.0),
        ([2, 0, 0], -2.0),
        ([1, 0, 0], 0.5),
        ([0, 2, 0], 1.0),
        ([0, 0, 2], 1.0),
        ([0, 0, 0], 1.9),
    ])
    .unwrap()
}

/// A random quartic that bends inwards, bounded by half a cube of 4.
fn quartic(random: &mut Seeded) -> Polynomial {
    let mut terms = vec![([4, 0, 0], 1.0), ([0, 4, 0], 1.0), ([0, 0, 4], 1.0), ([2, 2, 0], 0.5), ([0, 2, 2], 0.5)];
    for e in [[2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 1, 0], [1, 0, 1], [0, 1, 1], [3, 0, 0], [0, 1, 0], [0, 0, 1]] {
        terms.push((e, 0.9 * random.signed()));
    }
    Polynomial::new(terms).unwrap()
}

#[test]
fn convex_bodies_are_exact_at_level_zero() {
    let mut random = Seeded(5);
    for case in 0..40 {
        let mut body = |name: &str| {
            let axes = Vector3::from_fn(|_, _| 0.2 + 0.4 * (1.0 + random.signed()));
            let degree = [2, 4, 6][random.index(3)];
            Body::superellipsoid(name, Vector3::zeros(), axes, degree).unwrap()
        };
        let bodies = [body("a"), body("b")];
        let mut pose = |far: f64| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| 2.0 * random.signed()));
            let at = Vector3::from_fn(|_, _| far * random.signed());
            (
                Isometry3::from_parts(Translation3::from(at), turn),
                Pose::from_quaternion(at, turn.coords.into()).unwrap(),
            )
        };
        let [(a, pose_a), (b, pose_b)] = [pose(0.5), pose(3.0)];
        let truth = distance(&bodies[0], &pose_a, &bodies[1], &pose_b, &Options::default(), &mut WarmStart::default());
        let sets = [PlacedSet::of_body(&bodies[0], a), PlacedSet::of_body(&bodies[1], b)];
        let found = bound([&sets[0], &sets[1]], 0).unwrap();
        println!("case {case}: {truth:?} {found:?}");
        assert!(found.lower_m <= truth.upper && found.upper_m >= truth.lower, "case {case}");
        // The square root of a bound near zero is worth little.
        assert!(truth.lower < 0.05 || found.is_exact, "case {case}: {found:?}");
    }
}

/// A set of two wells, the nearer of which is not deep enough, against a ball: level 0 is below the
/// distance, and is not called exact.
#[test]
fn the_counterexample_is_closed_by_a_higher_level() {
    let wells = wells();
    let ball = Body::ball("ball", Vector3::zeros(), 0.1).unwrap();
    let sets =
        [set(&wells, 2.0, Isometry3::identity()), PlacedSet::of_body(&ball, Isometry3::translation(2.0, 0.0, 0.0))];
    let mut last = 0.0;
    for level in 0..=1 {
        let found = bound([&sets[0], &sets[1]], level).unwrap();
        println!("level {level}: {found:?}");
        assert!(found.lower_m >= last - 1e-6 && found.lower_m <= 2.5047 + 1e-4);
        assert!((found.upper_m - 2.5047).abs() < 1e-4);
        if level == 0 {
            assert!((found.lower_m - 3.77040_f64.sqrt()).abs() < 1e-4 && !found.is_exact);
        }
        assert_eq!(found.is_exact, level == 1);
        last = found.lower_m;
    }
}

/// Random quartics that bend inwards: brackets contain distances of points that are in the sets,
/// those that are sampled and those that local searches from many starts find; 10 000 pairs where
/// `SUBLEVEL_LONG` is set.
#[test]
fn brackets_of_random_quartics_contain_what_is_found() {
    let (mut exact, mut widest, mut all, mut seconds, mut overlapping) = (0, (1.0, 0), 0, 0.0, 0);
    let pairs = few_or(60, 10_000);
    for seed in 0..pairs {
        let mut random = Seeded(seed);
        let polynomials = [quartic(&mut random), quartic(&mut random)];
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| random.signed()));
        let away = Vector3::from_fn(|_, _| random.signed()).normalize() * (4.0 + random.signed());
        let pose = Isometry3::from_parts(Translation3::from(away), turn);
        let sets = [set(&polynomials[0], 2.0, Isometry3::identity()), set(&polynomials[1], 2.0, pose)];
        let found = bound([&sets[0], &sets[1]], 0).unwrap();
        let placed: Vec<_> = sets[1].near_boundary.iter().map(|x| pose.transform_point(&(*x).into()).coords).collect();
        let sampled = sets[0].near_boundary.iter().flat_map(|x| placed.iter().map(move |y| (x - y).norm()));
        let sampled = sampled.fold(f64::INFINITY, f64::min);
        let first = &sets[0].near_boundary;
        let starts: Vec<_> =
            (0..24).map(|_| [first[random.index(first.len())], placed[random.index(placed.len())]]).collect();
        let searched = nearest_points([&sets[0], &sets[1]], &starts)[0].0;
        let least = sampled.min(searched);
        assert!(found.lower_m <= found.upper_m && found.lower_m <= least, "seed {seed}: {found:?} {least}");
        // Half the diagonals of the boxes are 2 √12 together.
        let tolerance = if found.is_exact { 1e-5 * 2.0 * 12_f64.sqrt() } else { f64::INFINITY };
        assert!(found.upper_m - least <= tolerance, "seed {seed}: {found:?} {least}");
        assert!(found.upper_m <= sampled + 1e-9, "seed {seed}: {found:?} {sampled}");
        assert!(found.is_exact || found.minimisers.is_empty(), "seed {seed}: {found:?}");
        exact += usize::from(found.is_exact);
        all += usize::from(found.has_all_minimisers);
        overlapping += usize::from(found.upper_m == 0.0);
        seconds += found.seconds;
        if found.lower_m > 0.0 && found.upper_m / found.lower_m > widest.0 {
            widest = (found.upper_m / found.lower_m, seed);
        }
    }
    println!(
        "{exact} of {pairs} exact at level 0, {all} with all minimisers, {overlapping} overlap; the widest ratio {} at \
         seed {}; {} ms each",
        widest.0,
        widest.1,
        1e3 * seconds / pairs as f64
    );
    assert!(2 * exact > pairs as usize);
}

#[test]
fn bad_input_is_refused_by_name() {
    let ball = Body::ball("ball", Vector3::zeros(), 0.1).unwrap();
    let good = PlacedSet::of_body(&ball, Isometry3::translation(1.0, 0.0, 0.0));
    let refused = |set: PlacedSet, level: usize| {
        let refused = bound([&good, &set], level).expect_err("bad input");
        // What needs no solve is known without one.
        let known = check_hierarchy([&good, &set], level).err();
        assert!(known.as_ref().is_none_or(|known| *known == refused), "{known:?} {refused}");
        assert_eq!(known.is_none(), refused == HierarchyError::Empty);
        refused
    };
    assert_eq!(refused(good.clone(), MAX_LEVEL + 1), HierarchyError::Level(MAX_LEVEL + 1));
    let empty = PlacedSet { set: BasicSet { normalization: &UNIT, polynomials: Vec::new() }, ..good.clone() };
    assert_eq!(refused(empty, 0), HierarchyError::NoPolynomial(1));
    let lost = PlacedSet { pose: Isometry3::translation(f64::NAN, 0.0, 0.0), ..good.clone() };
    assert!(refused(lost, 0).to_string().contains("sets[1]: its pose"));
    let unbounded = Aabb { min: Vector3::repeat(f64::NEG_INFINITY), max: Vector3::repeat(f64::INFINITY) };
    assert!(refused(PlacedSet { bounding_box: unbounded, ..good.clone() }, 0).to_string().contains("unbounded"));
    let stopped = hierarchy_distance([&good, &good], 1, &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(HierarchyError::Fit(FitError::Cancelled)));
    let drifted = nalgebra::Quaternion::new(1.0 + 1e-9, 0.0, 0.0, 0.0);
    let turn = UnitQuaternion::new_unchecked(drifted);
    let turned = PlacedSet { pose: Isometry3::from_parts(Translation3::identity(), turn), ..good.clone() };
    assert!(refused(turned, 0).to_string().contains("unit length"));
    let large = Body::superellipsoid("e", Vector3::zeros(), Vector3::repeat(1.0), 8).unwrap();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, 0.3, 0.2));
    let askew = PlacedSet::of_body(&large, Isometry3::from_parts(Translation3::new(3.0, 0.0, 0.0), turn));
    let large = PlacedSet::of_body(&large, Isometry3::identity());
    assert!(matches!(bound([&large, &askew], 2), Err(HierarchyError::TooLarge { level: 2, rows: 10820 })));
    assert_eq!(check_hierarchy([&large, &askew], 2), bound([&large, &askew], 2).map(drop));
    // With planes of symmetry in common the matrices fall apart.
    assert_eq!(check_hierarchy([&large, &large], 2), Ok(()));
    let nowhere =
        Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0, 0, 0], 2.0)]).unwrap();
    assert_eq!(refused(set(&nowhere, 1.0, Isometry3::identity()), 0), HierarchyError::Empty);
    // Far from the origin two balls that touch are as far apart as poses are rounded.
    let far = |x: f64| PlacedSet::of_body(&ball, Isometry3::translation(1e6, 0.0, x));
    let touching = bound([&far(0.0), &far(0.2)], 0).unwrap();
    assert!(touching.lower_m <= 1e-6 && touching.upper_m < 1e-6, "{touching:?}");
}
