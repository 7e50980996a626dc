use super::*;
use crate::body::{Aabb, BasicSet, Body, Normalization};
use crate::measure::{self, HalfSpace, Options, Pose, Status, WarmStart};
use crate::polynomial::Polynomial;
use nalgebra::{Matrix3, Vector3};
use std::time::Instant;
use sublevel_testkit::Seeded;

const UNIT: Normalization = Normalization {
    center: Vector3::new(0.0, 0.0, 0.0),
    linear: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
};

fn set(polynomial: &Polynomial, half: f64, pose: Pose) -> PlacedSet<'_> {
    let set = BasicSet { normalization: &UNIT, polynomials: vec![polynomial] };
    let bounding_box = Aabb { min: Vector3::repeat(-half), max: Vector3::repeat(half) };
    PlacedSet::new(BoundedSet { set, bounding_box, id: None }, pose)
}

fn random_pose(random: &mut Seeded, far: f64) -> Pose {
    let turn = random.rotation();
    Pose::from_quaternion(Vector3::from_fn(|_, _| far * random.signed()), turn.coords.into()).unwrap()
}

/// A quartic or sextic that bends inwards.
fn lumpy(random: &mut Seeded, degree: usize) -> Polynomial {
    let top = degree as u8;
    let mut terms = vec![([top, 0, 0], 1.0), ([0, top, 0], 1.0), ([0, 0, top], 1.0)];
    for e in [[2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 1, 0], [1, 0, 1], [0, 1, 1], [3, 0, 0], [0, 1, 0], [0, 0, 1]] {
        terms.push((e, 0.9 * random.signed()));
    }
    Polynomial::new(terms).unwrap()
}

#[test]
fn convex_bodies_have_the_distances_of_the_solver() {
    let mut branches = BranchAndBound::new();
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let mut body = |name: &str| {
            let axes = Vector3::from_fn(|_, _| 0.2 + 0.4 * (1.0 + random.signed()));
            Body::superellipsoid(name, Vector3::zeros(), axes, [2, 4, 6, 8][random.index(4)]).unwrap()
        };
        let bodies = [body("a"), body("b")];
        let poses = [random_pose(&mut random, 0.5), random_pose(&mut random, 3.0)];
        let sets = [0, 1].map(|k| PlacedSet::new(&bodies[k], poses[k]));
        let (options, mut warm) = (Options::default(), WarmStart::default());
        let truth = measure::distance(&bodies[0], &poses[0], &bodies[1], &poses[1], &options, &mut warm);
        let limits = Limits { accuracy: 1e-3, width: 1e-4, ..Limits::default() };
        let found = branches.distance(&sets[0], &sets[1], &limits).unwrap();
        assert!(found.lower_m <= truth.upper && truth.lower <= found.upper_m, "seed {seed}: {found:?} {truth:?}");
        assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?} {truth:?}");

        let level =
            measure::level_distance(&bodies[0], &poses[0], &bodies[1], &poses[1], &options, &mut WarmStart::default());
        let found = branches.level_distance(&sets[0], &sets[1], &limits).unwrap();
        assert!(found.lower <= level.upper && level.lower <= found.upper, "seed {seed}: {found:?} {level:?}");
        assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?} {level:?}");

        let half_space = HalfSpace::new(random.unit(), random.signed()).unwrap();
        let height =
            measure::distance_to_half_space(&bodies[0], &poses[0], &half_space, &options, &mut WarmStart::default());
        let found = branches.height(&sets[0], &half_space, &limits).unwrap();
        assert!(found.lower_m <= height.upper && height.lower <= found.upper_m, "seed {seed}: {found:?} {height:?}");
        assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?} {height:?}");

        let point = 2.0 * random.unit();
        let near =
            measure::distance_to_point(&bodies[0], &poses[0], &point, &options, &mut WarmStart::default()).unwrap();
        let found = branches.distance_to_point(&sets[0], &point, &limits).unwrap();
        assert!(found.lower_m <= near.upper && near.lower <= found.upper_m, "seed {seed}: {found:?} {near:?}");
        assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?} {near:?}");
    }
}

/// Points of the boundary of a star-shaped set about its centre, common frame.
fn boundary(set: &PlacedSet<'_>, rays: usize, random: &mut Seeded) -> Vec<Vector3<f64>> {
    let polynomial = set.of.set.polynomials[0];
    let mut found = Vec::new();
    for _ in 0..rays {
        let u = random.unit();
        let mut last = polynomial.evaluate(&Vector3::zeros()).value;
        for k in 1..=300 {
            let z = u * (0.01 * f64::from(k));
            let value = polynomial.evaluate(&z).value;
            if (value > 1.0) != (last > 1.0) {
                let inner = if value > 1.0 { z - u * 0.01 } else { z };
                found.push(set.pose.transform_point(&inner));
            }
            last = value;
        }
    }
    found
}

#[test]
fn brackets_contain_what_is_sampled_and_shrink_with_every_step() {
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let polynomials = [lumpy(&mut random, [4, 6][seed as usize % 2]), lumpy(&mut random, 4)];
        let away = random.unit() * (2.5 + 1.5 * random.signed());
        let pose = Pose::from_quaternion(away, random.rotation().coords.into()).unwrap();
        let sets = [set(&polynomials[0], 3.0, Pose::identity()), set(&polynomials[1], 3.0, pose)];
        let points = [boundary(&sets[0], 400, &mut random), boundary(&sets[1], 400, &mut random)];
        let sampled = points[0].iter().flat_map(|x| points[1].iter().map(move |y| (x - y).norm()));
        let sampled = sampled.fold(f64::INFINITY, f64::min);
        let (mut low, mut high) = (0.0, f64::INFINITY);
        for max_steps in [1, 10, 100, 1000, 100_000] {
            let limits = Limits { accuracy: 1e-4, width: 1e-5, max_steps, ..Limits::default() };
            let found = BranchAndBound::new().distance(&sets[0], &sets[1], &limits).unwrap();
            assert!(found.lower_m <= sampled && found.lower_m >= low, "seed {seed}: {found:?} {sampled}");
            assert!(found.upper_m >= low && found.upper_m <= high, "seed {seed}: {found:?}");
            (low, high) = (found.lower_m, found.upper_m);
            if let Some([x, y]) = found.points {
                assert!(sets[0].membership().unwrap().contains(&x) && sets[1].membership().unwrap().contains(&y));
                assert!((x - y).norm() <= found.upper_m, "seed {seed}");
            }
        }
        assert!(high <= sampled + 1e-9 && high - low <= 1e-4 * high + 1e-5, "seed {seed}: {low} {high} {sampled}");

        let limits = Limits { accuracy: 1e-3, ..Limits::default() };
        let level = BranchAndBound::new().level_distance(&sets[0], &sets[1], &limits).unwrap();
        let value = |x: &Vector3<f64>| polynomials[0].evaluate(&sets[0].normalized(x)).value;
        let sampled = points[1].iter().map(value).fold(f64::INFINITY, f64::min);
        assert!(level.lower <= sampled && level.upper <= sampled + 1e-6, "seed {seed}: {level:?} {sampled}");
        assert_eq!(level.status, Status::Converged, "seed {seed}: {level:?}");
        // At most 1 exactly where the distance is 0.
        assert!(level.lower <= 1.0 || high > 0.0, "seed {seed}");
        assert!(level.upper > 1.0 || low == 0.0, "seed {seed}");
    }
}

#[test]
fn edges_and_corners_have_the_distances_of_the_solver() {
    let mut branches = BranchAndBound::new();
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let mut size = || 0.3 + 0.5 * random.positive();
        let bodies = [
            Body::cuboid("box", Vector3::new(size(), size(), size())).unwrap(),
            Body::cylinder("rod", size(), size()).unwrap(),
        ];
        let poses = [random_pose(&mut random, 0.5), random_pose(&mut random, 3.0)];
        let of = [seed as usize % 2, seed as usize / 2 % 2];
        let sets = [0, 1].map(|k| PlacedSet::new(&bodies[of[k]], poses[k]));
        let mut warm = WarmStart::default();
        let truth =
            measure::distance(&bodies[of[0]], &poses[0], &bodies[of[1]], &poses[1], &Options::default(), &mut warm);
        let limits = Limits { accuracy: 1e-2, width: 1e-3, ..Limits::default() };
        let found = branches.distance(&sets[0], &sets[1], &limits).unwrap();
        assert!(found.lower_m <= truth.upper && truth.lower <= found.upper_m, "seed {seed}: {found:?} {truth:?}");
        assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?} {truth:?}");
    }
}

#[test]
fn comparisons_end_as_soon_as_they_are_proven() {
    let (mut branches, mut decided, mut whole) = (BranchAndBound::new(), 0, 0);
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let polynomials = [lumpy(&mut random, 4), lumpy(&mut random, 4)];
        let away = random.unit() * (2.5 + 1.5 * random.signed());
        let pose = Pose::from_quaternion(away, random.rotation().coords.into()).unwrap();
        let sets = [set(&polynomials[0], 3.0, Pose::identity()), set(&polynomials[1], 3.0, pose)];
        let full = branches.distance(&sets[0], &sets[1], &Limits { width: 1e-6, ..Limits::default() }).unwrap();
        whole += full.steps;
        for threshold in [0.0, 0.5, 2.0] {
            let limits = Limits { accuracy: 1e-9, threshold: Some(threshold), ..Limits::default() };
            let found = branches.distance(&sets[0], &sets[1], &limits).unwrap();
            decided += found.steps;
            let nearer = found.upper_m <= threshold;
            assert!(nearer || found.lower_m > threshold, "seed {seed}: {found:?}");
            assert!(if nearer { full.lower_m <= threshold } else { full.upper_m > threshold }, "seed {seed}");
        }
    }
    assert!(decided < whole, "{decided} {whole}");
}

/// Newton's method ends where the boundaries meet, which is no point of both; there is one near by.
#[test]
fn common_points_are_found_where_bodies_overlap() {
    let (mut branches, mut overlapping) = (BranchAndBound::new(), 0);
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let degree = [2, 4, 6][seed as usize % 3];
        let axes = Vector3::from_fn(|_, _| 0.2 + 0.4 * (1.0 + random.signed()));
        let a = Body::superellipsoid("a", Vector3::zeros(), axes, degree).unwrap();
        let b = Body::ball("b", Vector3::zeros(), 0.3).unwrap();
        let poses = [random_pose(&mut random, 0.5), random_pose(&mut random, 1.0)];
        let (options, mut warm) = (Options::default(), WarmStart::default());
        let truth = measure::distance(&a, &poses[0], &b, &poses[1], &options, &mut warm);
        let sets = [PlacedSet::new(&a, poses[0]), PlacedSet::new(&b, poses[1])];
        let limits = Limits { accuracy: 0.0, width: 1e-2, threshold: Some(0.0), ..Limits::default() };
        let found = branches.distance(&sets[0], &sets[1], &limits).unwrap();
        overlapping += u32::from(truth.upper == 0.0);
        assert_eq!(found.upper_m == 0.0, truth.upper == 0.0, "seed {seed}: {found:?} {truth:?}");
        assert_eq!(found.lower_m > 0.0, truth.lower > 0.0, "seed {seed}: {found:?} {truth:?}");
    }
    assert!(overlapping > 40, "{overlapping}");
}

#[test]
fn two_of_the_same_share_their_cover_and_far_ones_lose_what_poses_round() {
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    let at = |x: f64, far: f64| {
        PlacedSet::new(&ball, Pose::from_quaternion(Vector3::new(x, far, -far), [0.0, 0.0, 0.0, 1.0]).unwrap())
    };
    let mut branches = BranchAndBound::new();
    let limits = Limits { accuracy: 1e-6, width: 1e-9, ..Limits::default() };
    let near = branches.distance(&at(0.0, 0.0), &at(3.0, 0.0), &limits).unwrap();
    assert!(near.lower_m <= 2.0 && near.upper_m >= 2.0 && near.upper_m - near.lower_m < 1e-5, "{near:?}");
    let again = branches.distance(&at(0.0, 0.0), &at(3.0, 0.0), &limits).unwrap();
    assert_eq!((again.lower_m, again.upper_m), (near.lower_m, near.upper_m));
    let far = branches.distance(&at(0.0, 1e9), &at(3.0, 1e9), &limits).unwrap();
    assert!(far.lower_m <= 2.0 && far.upper_m >= 2.0 && far.lower_m > 1.99, "{far:?}");
    let touching = branches.distance(&at(0.0, 0.0), &at(1.0, 0.0), &limits).unwrap();
    assert!(touching.lower_m <= 1e-9 && touching.upper_m < 1e-6, "{touching:?}");
    let inside = branches.distance_to_point(&at(0.0, 0.0), &Vector3::new(0.1, 0.2, 0.0), &limits).unwrap();
    assert_eq!((inside.lower_m, inside.upper_m), (0.0, 0.0));
}

#[test]
fn what_is_stopped_is_true_and_bad_sets_are_refused_by_name() {
    let mut random = Seeded(3);
    let polynomials = [lumpy(&mut random, 8), lumpy(&mut random, 8)];
    let away = Pose::from_quaternion(Vector3::new(3.0, 1.0, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
    let sets = [set(&polynomials[0], 3.0, Pose::identity()), set(&polynomials[1], 3.0, away)];
    let full = BranchAndBound::new().distance(&sets[0], &sets[1], &Limits::default()).unwrap();
    assert_eq!(full.status, Status::Converged);
    let stop = std::sync::atomic::AtomicBool::new(true);
    let late = Limits { deadline: Some(Instant::now()), ..Limits::default() };
    for limits in [late, Limits { stop: Some(&stop), ..Limits::default() }] {
        let found = BranchAndBound::new().distance(&sets[0], &sets[1], &limits).unwrap();
        assert_eq!(found.status, Status::BracketWide);
        assert!(found.lower_m <= full.upper_m && found.upper_m >= full.lower_m);
    }
    let refused = |change: &dyn Fn(&mut PlacedSet<'_>)| {
        let mut bad = sets[1].clone();
        change(&mut bad);
        let (side, error) = BranchAndBound::new().distance(&sets[0], &bad, &Limits::default()).expect_err("bad");
        assert_eq!(side, 1);
        error
    };
    assert_eq!(refused(&|bad| bad.of.set.polynomials.clear()), PlacedSetError::NoPolynomial);
    assert_eq!(refused(&|bad| bad.of.bounding_box.max.x = f64::INFINITY), PlacedSetError::BoundingBox);
    assert_eq!(refused(&|bad| bad.of.bounding_box.max.x = -4.0), PlacedSetError::BoundingBox);
    let flat = Normalization { center: Vector3::zeros(), linear: Matrix3::zeros() };
    let mut bad = set(&polynomials[1], 3.0, away);
    bad.of.set.normalization = &flat;
    let error = BranchAndBound::new().distance(&sets[0], &bad, &Limits::default()).expect_err("bad");
    assert_eq!(error, (1, PlacedSetError::Normalization));
    // No point is in it.
    let nowhere =
        Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0, 0, 0], 2.0)]).unwrap();
    let found = BranchAndBound::new().distance(&sets[0], &set(&nowhere, 1.0, away), &Limits::default()).unwrap();
    assert_eq!(found.lower_m, f64::INFINITY);
}
