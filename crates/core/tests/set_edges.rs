//! Sets with edges and corners: what branch and bound finds there, beside the solver of convex
//! bodies.

use nalgebra::Vector3;
use sublevel_core::body::{Aabb, BasicSet, Body, Normalization};
use sublevel_core::branch_and_bound::{BoundedSet, BranchAndBound, Limits, PlacedSet, lowest_points, nearest_points};
use sublevel_core::measure::{self, Options, Pose, Status, WarmStart};
use sublevel_core::polynomial::Polynomial;
use sublevel_testkit::Seeded;

fn pose(random: &mut Seeded, far: f64) -> Pose {
    let turn = random.rotation();
    Pose::from_quaternion(Vector3::from_fn(|_, _| far * random.signed()), turn.coords.into()).unwrap()
}

fn bodies(random: &mut Seeded) -> [Body; 2] {
    let mut size = || 0.3 + 0.5 * random.positive();
    [Body::cuboid("box", Vector3::new(size(), size(), size())).unwrap(), Body::cylinder("rod", size(), size()).unwrap()]
}

/// Boxes and rods in every combination, and where they are.
fn pair(seed: u64) -> ([Body; 2], [Pose; 2]) {
    let mut random = Seeded(seed);
    let bodies = bodies(&mut random);
    let poses = [pose(&mut random, 0.5), pose(&mut random, 3.0)];
    ([seed as usize % 2, seed as usize / 2 % 2].map(|kind| bodies[kind].clone()), poses)
}

/// Points 0.3 m from the middles, towards each other: at the middles themselves polynomials of
/// boxes have no slope.
fn towards(poses: &[Pose; 2]) -> [Vector3<f64>; 2] {
    let [a, b] = [0, 1].map(|side| *poses[side].translation());
    let way = (b - a).normalize() * 0.3;
    [a + way, b - way]
}

/// One search from within ends at the nearest points, on faces, edges and corners; convex sets
/// have no other local minimum.
#[test]
fn points_on_edges_and_corners_are_exact() {
    let (mut apart, mut missed) = (0, Vec::new());
    for seed in 0..400 {
        let (bodies, poses) = pair(seed);
        let sets = [0, 1].map(|k| PlacedSet::new(&bodies[k], poses[k]));
        let (options, mut warm) = (Options::default(), WarmStart::default());
        let truth = measure::distance(&bodies[0], &poses[0], &bodies[1], &poses[1], &options, &mut warm);
        if truth.lower < 0.05 {
            continue;
        }
        apart += 1;
        let found = nearest_points([&sets[0], &sets[1]], [towards(&poses)])[0].0;
        assert!(found >= truth.lower, "seed {seed}: {found} {truth:?}");
        if found > truth.upper * (1.0 + 1e-9) {
            missed.push((seed, found - truth.upper));
        }
    }
    println!("{} of {apart} missed: {:?}", missed.len(), &missed[..missed.len().min(8)]);
    assert!(apart > 250, "{apart}");
    assert!(missed.is_empty(), "{missed:?}");
}

/// The same for the lowest level, which may be where several polynomials are equal: searches from
/// two starts, of which Newton's method may lead out of the sets.
#[test]
fn lowest_points_between_polynomials_are_exact() {
    let (mut cases, mut missed) = (0, Vec::new());
    for seed in 0..400 {
        let (bodies, poses) = pair(seed);
        let sets = [0, 1].map(|k| PlacedSet::new(&bodies[k], poses[k]));
        let options = Options::default();
        let truth =
            measure::level_distance(&bodies[0], &poses[0], &bodies[1], &poses[1], &options, &mut WarmStart::default());
        cases += 1;
        let found = lowest_points([&sets[0], &sets[1]], towards(&poses))[0].0;
        assert!(found >= truth.lower, "seed {seed}: {found} {truth:?}");
        if found > truth.upper * (1.0 + 1e-9) + 1e-12 {
            missed.push((seed, found - truth.upper));
        }
    }
    println!("{} of {cases} missed: {:?}", missed.len(), &missed[..missed.len().min(8)]);
    assert!(missed.len() * 50 <= cases, "{} of {cases} missed", missed.len());
}

/// A quartic that bends inwards.
fn lumpy(random: &mut Seeded) -> Polynomial {
    let mut terms = vec![([4, 0, 0], 1.0), ([0, 4, 0], 1.0), ([0, 0, 4], 1.0)];
    for e in [[2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 1, 0], [1, 0, 1], [0, 1, 1], [3, 0, 0], [0, 1, 0], [0, 0, 1]] {
        terms.push((e, 0.9 * random.signed()));
    }
    Polynomial::new(terms).unwrap()
}

/// Brackets of sets that bend inwards beside boxes and rods close to a millionth of the distance.
#[test]
fn brackets_close_beside_edges_and_corners() {
    let unit = Normalization { center: Vector3::zeros(), linear: nalgebra::Matrix3::identity() };
    let mut branches = BranchAndBound::new();
    let (mut steps, mut wide) = (Vec::new(), Vec::new());
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let bodies = bodies(&mut random);
        let polynomial = lumpy(&mut random);
        let set = BasicSet { normalization: &unit, polynomials: vec![&polynomial] };
        let bounding_box = Aabb { min: Vector3::repeat(-3.0), max: Vector3::repeat(3.0) };
        let lumpy = PlacedSet::new(BoundedSet { set, bounding_box, id: None }, Pose::identity());
        let away = random.unit() * (3.0 + random.positive());
        let at = Pose::from_quaternion(away, random.rotation().coords.into()).unwrap();
        let body = PlacedSet::new(&bodies[seed as usize % 2], at);
        let limits = Limits { accuracy: 1e-6, width: 0.0, max_steps: 50_000, ..Limits::default() };
        let found = branches.distance(&lumpy, &body, &limits).unwrap();
        steps.push(found.steps);
        if found.status != Status::Converged {
            wide.push((seed, found.lower_m, found.upper_m));
        }
    }
    steps.sort_unstable();
    println!("steps: median {}, most {}; wide: {wide:?}", steps[steps.len() / 2], steps[steps.len() - 1]);
    assert!(wide.is_empty(), "{wide:?}");
}
