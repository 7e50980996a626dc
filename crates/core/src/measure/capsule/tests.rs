use super::*;
use crate::body::Body;
use crate::measure::solver::stages::{Stage, asked, except};
use crate::measure::tests::edges::{cut, slab};
use crate::measure::tests::{random_pose, twisted, zoo};
use crate::measure::{Decision, MAX_ITERATIONS, Status, Twist, distance_to_point};
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

/// The distance of a body from the axis by golden sections, which use no derivatives.
fn brute_force(body: &Body, pose: &Pose, capsule: &Capsule, capsule_pose: &Pose) -> f64 {
    let axis = capsule_pose.transform_direction(&Vector3::z());
    let mut warm = WarmStart::default();
    let mut at = |t: f64| {
        let point = capsule_pose.translation() + axis * t;
        distance_to_point(body, pose, &point, &Options::default(), &mut warm).unwrap().upper
    };
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut low, mut high) = (-capsule.half_height_m(), capsule.half_height_m());
    for _ in 0..60 {
        let (p, q) = (high - golden * (high - low), low + golden * (high - low));
        if at(p) <= at(q) { high = q } else { low = p }
    }
    at(0.5 * (low + high)) - capsule.radius_m()
}

fn random_capsule(random: &mut Seeded, size: f64) -> Capsule {
    let mut length = || size * 10_f64.powf(random.signed() - 0.5);
    let (radius, half) = (length(), length());
    match random.next() % 6 {
        0 => Capsule::new(0.0, half),
        1 => Capsule::new(radius, 0.0),
        2 => Capsule::new(0.0, 0.0),
        _ => Capsule::new(radius, half),
    }
    .unwrap()
}

#[test]
fn capsules_are_as_far_as_points_of_their_axes() {
    let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
    let (mut apart, mut deep) = (0, 0);
    for seed in 0..1200 {
        let mut random = Seeded(81_000 + seed);
        let bodies = &zoos[(seed % 6) as usize];
        let body = &bodies[random.next() as usize % bodies.len()];
        let size = body.circumscribed().radius;
        let capsule = random_capsule(&mut random, size);
        let pose = random_pose(&mut random, 1.0);
        let middle = pose.transform_point(&body.circumscribed().center);
        let far = (size + capsule.reach_m()) * (0.2 + random.signed().abs());
        let turned = random_pose(&mut random, 0.0);
        let capsule_pose = turned.with_translation(middle + random.unit() * far);
        let truth = brute_force(body, &pose, &capsule, &capsule_pose);
        let mut warm = WarmStart::default();
        for round in 0..2 {
            let found = distance_to_capsule(body, &pose, &capsule, &capsule_pose, &Options::default(), &mut warm);
            let label = format!("seed {seed}, {}, {capsule:?}, round {round}: {found:?}, {truth}", body.name());
            let slack = 1e-7 * size;
            // Of balls depths are known beyond that.
            assert!(found.lower <= truth + slack, "{label}");
            if truth > slack - capsule.radius_m() {
                apart += 1;
                assert!(found.status == Status::Converged, "{label}");
                assert!(truth - slack <= found.upper && found.upper - truth < slack, "{label}");
                let n = found.normal.expect("the axis is outside");
                let along = (found.witness - found.witness_of_capsule).dot(&n);
                assert!((along - found.upper).abs() < slack, "{label}");
            } else if capsule.radius_m() > 0.0 && found.upper == -capsule.radius_m() {
                deep += 1;
                assert!(found.lower == f64::NEG_INFINITY && found.normal.is_none(), "{label}");
            }
        }
    }
    assert!(apart > 1200 && deep > 50, "{apart} {deep}");
}

#[test]
fn gradients_of_capsules_are_differences() {
    let egg = Body::ellipsoid("egg", Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 1.0, 0.8)).unwrap();
    let crate_ = Body::cuboid("crate", Vector3::new(0.3, 0.5, 0.7)).unwrap();
    let options = Options::default().with_accuracy(1e-12).unwrap();
    let mut count = 0;
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let body = if seed % 2 == 0 { &egg } else { &crate_ };
        let capsule = Capsule::new(0.4, 0.5).unwrap();
        let (pose, capsule_pose) = (random_pose(&mut random, 1.0), random_pose(&mut random, 2.2));
        let at = |pose: &Pose, capsule_pose: &Pose| {
            distance_to_capsule(body, pose, &capsule, capsule_pose, &options, &mut WarmStart::default())
        };
        let Some([of_body, of_capsule]) = at(&pose, &capsule_pose).gradients(&pose, &capsule_pose) else {
            continue;
        };
        for axis in 0..3 {
            let e = Vector3::ith(axis, 1.0);
            for turn in [false, true] {
                let part = |twist: &Twist| if turn { twist.angular[axis] } else { twist.linear[axis] };
                let h = 1e-5;
                let of = |step: f64| at(&twisted(&pose, &e, turn, step), &capsule_pose).value();
                let other = |step: f64| at(&pose, &twisted(&capsule_pose, &e, turn, step)).value();
                let slopes = [(of(h) - of(-h)) / (2.0 * h), (other(h) - other(-h)) / (2.0 * h)];
                let expected = [part(&of_body), part(&of_capsule)];
                // Where the nearest feature of a box changes, the second derivative jumps.
                assert!((0..2).all(|i| (slopes[i] - expected[i]).abs() < 1e-4), "seed {seed}: {slopes:?} {expected:?}");
            }
        }
        count += 1;
    }
    assert!(count > 100, "{count}");
}

#[test]
fn sizes_of_capsules_are_checked() {
    for bad in [-1.0, f64::NAN, f64::INFINITY, 1e16] {
        assert!(Capsule::new(bad, 1.0).is_err() && Capsule::new(1.0, bad).is_err());
    }
    // From needles to planets.
    for (radius, half) in [(1e-9, 1e3), (1e6, 1e-9), (0.0, 0.0), (1e9, 1e9)] {
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let capsule = Capsule::new(radius, half).unwrap();
        let pose = Pose::from_quaternion(Vector3::new(3.0 + radius, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
        let found = distance_to_capsule(
            &ball,
            &Pose::identity(),
            &capsule,
            &pose,
            &Options::default(),
            &mut WarmStart::default(),
        );
        assert!(found.lower <= 2.0 && 2.0 <= found.upper, "{radius} {half}: {found:?}");
    }
}

/// Beside bodies with several constraints the projection of the axis has the answer, and hardly
/// ever the distances of single points of it.
#[test]
fn capsules_beside_edged_bodies_are_solved_at_once() {
    let bodies: Vec<_> = (0..30).map(|seed| cut(&mut Seeded(seed))).collect();
    let (mut along_axis, mut undecided, mut count) = (0, 0, 0);
    for seed in 0..1500 {
        let mut random = Seeded(95_000 + seed);
        let body = &bodies[random.next() as usize % bodies.len()];
        let size = body.circumscribed().radius;
        let capsule = random_capsule(&mut random, size);
        let far = (size + capsule.reach_m()) * 2_f64.powf(random.signed());
        let (pose, capsule_pose) = (random_pose(&mut random, 0.1 * size), random_pose(&mut random, far));
        let options = Options::default();
        let (found, mut stages) =
            asked(|| distance_to_capsule(body, &pose, &capsule, &capsule_pose, &options, &mut WarmStart::default()));
        along_axis += u32::from(stages.any(|stage| stage == Stage::AlongAxis));
        let (contact, mut stages) =
            asked(|| overlap_with_capsule(body, &pose, &capsule, &capsule_pose, &options, &mut WarmStart::default()));
        undecided += u32::from(stages.any(|stage| stage == Stage::AlongAxis));
        match contact {
            Decision::Yes => assert!(found.lower <= 0.0, "seed {seed}: {found:?}"),
            Decision::No => assert!(found.upper > 0.0, "seed {seed}: {found:?}"),
            Decision::Undecided { .. } => assert!(found.lower <= 0.0 && found.upper > 0.0, "seed {seed}: {found:?}"),
        }
        count += 1;
    }
    println!("along the axis {along_axis} distances and {undecided} decisions of {count}");
    assert!(along_axis < count / 50 && undecided < count / 100, "{along_axis}, {undecided} of {count}");
}

/// A segment without a radius that leads through a body overlaps it, far from its inscribed ball,
/// too; and axes too short for their square to be a number are points.
#[test]
fn segments_through_edges_overlap_and_the_shortest_are_points() {
    let body = cut(&mut Seeded(3));
    let segment = Capsule::new(0.0, 5.0).unwrap();
    let (mut overlaps, mut count) = (0, 0);
    for seed in 0..400 {
        let mut random = Seeded(96_000 + seed);
        // Through a point of the body near its surface.
        let support = body.support(&random.unit()).point;
        let inside = body.interior_point().lerp(&support, 0.99);
        let turned = random_pose(&mut random, 0.0);
        let pose = turned.with_translation(inside);
        let options = Options::default();
        let found =
            overlap_with_capsule(&body, &Pose::identity(), &segment, &pose, &options, &mut WarmStart::default());
        count += 1;
        overlaps += u32::from(found == Decision::Yes);
        assert_ne!(found, Decision::No, "seed {seed}");

        let (tiny, ball) = (Capsule::new(0.1, 1e-170).unwrap(), Capsule::new(0.1, 0.0).unwrap());
        let pose = turned.with_translation(inside + random.unit() * 4.0);
        let [one, other] = [tiny, ball].map(|capsule| {
            distance_to_capsule(&body, &Pose::identity(), &capsule, &pose, &options, &mut WarmStart::default())
        });
        assert_eq!(one.status, Status::Converged, "seed {seed}");
        assert!((one.upper - other.upper).abs() < 1e-9 && one.iterations <= other.iterations + 2, "seed {seed}");
    }
    assert!(overlaps > count * 9 / 10, "{overlaps} of {count}");
}

/// A body and a capsule, and in the frame of the body, as it stands unturned: the nearest point of
/// the axis but for its distance, the direction to it, of length 3, and whether the axis is along z
/// or along (2, -2, -1), both across the direction.
struct Beside {
    body: Body,
    capsule: Capsule,
    nearest: Vector3<f64>,
    normal: Vector3<f64>,
    along_z: bool,
}

impl Beside {
    /// Poses of the body and the capsule at this distance of the axis, metres, in exact numbers,
    /// and the normal from the capsule to the body; both turned by a quarter about z, or not.
    fn at(&self, distance: f64, is_turned: bool) -> (Pose, Pose, Vector3<f64>) {
        // Rotations are of quaternions normalised exactly.
        let [third, sixth, half] = [3.0_f64, 6.0, 2.0].map(|square| 1.0 / square.sqrt());
        let turn = if is_turned { [0.0, 0.0, half, half] } else { [0.0, 0.0, 0.0, 1.0] };
        let capsule_turn = match (self.along_z, is_turned) {
            (true, _) => [0.0, 0.0, 0.0, 1.0],
            (false, false) => [third, third, 0.0, third],
            (false, true) => [0.0, 2.0 * sixth, sixth, sixth],
        };
        let axis = if self.along_z { Vector3::z() } else { Vector3::new(2.0, -2.0, -1.0) };
        // Off the middle of the axis.
        let off = axis * (self.capsule.half_height_m() * 0.125);
        let center = self.nearest + self.normal * (distance / 3.0) + off;
        let turned = |v: &Vector3<f64>| if is_turned { Vector3::new(-v.y, v.x, v.z) } else { *v };
        let place = Vector3::new(512.0, -2048.0, 1024.0);
        let pose = Pose::from_quaternion(place, turn).unwrap();
        let capsule_pose = Pose::from_quaternion(place + turned(&center), capsule_turn).unwrap();
        (pose, capsule_pose, turned(&self.normal) / -3.0)
    }
}

/// A body, and the same with a further constraint that does not matter: twice as wide, or on the
/// other side.
fn with_another(body: Body, a: Vector3<f64>, b: f64) -> [Body; 2] {
    let constraints = body.constraints().iter().cloned().chain([slab(&a, b)]).collect();
    let other = Body::new("cut", *body.normalization(), constraints).unwrap();
    [body, other]
}

/// Bodies of 1 cm beside capsules of 100 m, and the other way around. Sizes are powers of two, or
/// so small that the rounding of their inverses, 1e-18 m, is far below that of distances.
fn pairs_of_unlike_sizes() -> Vec<Beside> {
    let oblique = Vector3::new(2.0, 1.0, 2.0);
    let mut pairs = Vec::new();
    let mut add = |bodies: [Body; 2], capsule: Capsule, nearest: Vector3<f64>, normal: Vector3<f64>, along_z: bool| {
        pairs.extend(bodies.map(|body| Beside { body, capsule, nearest, normal, along_z }));
    };
    let (u, large) = (1.0 / 2048.0, Capsule::new(0.5, 128.0).unwrap());
    let pebble = Body::ellipsoid("pebble", Vector3::zeros(), Vector3::new(7.0, 21.0, 21.0) * u).unwrap();
    add(with_another(pebble, Vector3::x(), 0.5), large, Vector3::new(2.0, 9.0, 18.0) * u, oblique, false);
    let dice = Body::cuboid("dice", Vector3::new(16.0, 8.0, 32.0) * u).unwrap();
    add(with_another(dice, Vector3::x() * 0.5, 0.0), large, Vector3::new(16.0, 8.0, 32.0) * u, oblique, false);
    let marble = Body::ball("marble", Vector3::zeros(), 21.0 * u).unwrap();
    add(with_another(marble, Vector3::x(), 0.5), large, Vector3::new(14.0, 7.0, 14.0) * u, oblique, false);

    let small = Capsule::new(1.0 / 256.0, 1.0 / 128.0).unwrap();
    let half = Vector3::new(64.0, 32.0, 16.0);
    let house = Body::cuboid("house", half).unwrap();
    add(with_another(house, Vector3::x() * 0.5, 0.0), small, half, oblique, false);
    let hill = Body::ellipsoid("hill", Vector3::zeros(), half).unwrap();
    let top = Vector3::new(64.0, 0.0, 0.0);
    add(with_another(hill, Vector3::x(), 0.5), small, top, Vector3::x() * 3.0, true);
    pairs
}

#[test]
fn capsules_of_unlike_sizes_have_narrow_brackets() {
    let options = Options::default();
    let (mut wide, mut count) = (0, 0);
    for beside in pairs_of_unlike_sizes() {
        let Beside { body, capsule, .. } = &beside;
        for (distance, is_turned) in [0.75, 96.0, 1536.0, 9216.0].into_iter().flat_map(|d| [(d, false), (d, true)]) {
            let (pose, capsule_pose, normal) = beside.at(distance, is_turned);
            let truth = distance - capsule.radius_m();
            let solve = |warm: &mut WarmStart| distance_to_capsule(body, &pose, capsule, &capsule_pose, &options, warm);
            let mut warm = WarmStart::default();
            for round in 0..2 {
                let found = solve(&mut warm);
                let label = format!("{}, {truth} m, turned {is_turned}, round {round}: {found:?}", body.name());
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.lower <= truth && truth <= found.upper, "{label}");
                assert!((found.normal.unwrap() - normal).norm() < 1e-6, "{label}");
                let along = (found.witness - found.witness_of_capsule).dot(&normal);
                assert!((along - truth).abs() <= 1e-10 + 8.0 * f64::EPSILON * (distance + 4096.0), "{label}");
            }
            let without = except(&[Stage::Refinement], || solve(&mut WarmStart::default()));
            assert!(without.lower <= truth && truth <= without.upper, "{}: {without:?}, {truth}", body.name());
            wide += u32::from(without.status == Status::BracketWide);
            count += 1;
        }
    }
    assert!(4 * wide >= count, "{wide} of {count} are wide without refinement");
}

/// Narrower than doubles are spaced there is no bracket.
#[test]
fn brackets_of_capsules_end_where_doubles_do() {
    let options = Options::default().with_accuracy(1e-18).unwrap();
    for beside in pairs_of_unlike_sizes() {
        let Beside { body, capsule, .. } = &beside;
        let (distance, mut warm) = (1536.0, WarmStart::default());
        let (pose, capsule_pose, _) = beside.at(distance, true);
        let truth = distance - capsule.radius_m();
        let found = distance_to_capsule(body, &pose, capsule, &capsule_pose, &options, &mut warm);
        let label = format!("{}: {found:?} against {truth}", body.name());
        assert_eq!(found.status, Status::BracketWide, "{label}");
        assert!(found.lower <= truth && truth <= found.upper, "{label}");
        assert!(found.upper - found.lower <= 4.0 * f64::EPSILON * truth, "{label}");
        assert!(found.iterations < MAX_ITERATIONS / 2, "{label}");
    }
}

/// A long axis across the tip of a needle: where the normal turns by 1e-10 for what doubles round,
/// the ends of the axis move by more than is asked for.
#[test]
fn axes_across_needles_have_narrow_brackets() {
    let half = Vector3::new(1.0 / 16384.0, 1.0 / 16384.0, 1.0 / 128.0);
    let needle = Body::ellipsoid("needle", Vector3::zeros(), half).unwrap();
    let capsule = Capsule::new(0.5, 128.0).unwrap();
    let eighth = std::f64::consts::FRAC_1_SQRT_2;
    for distance in [1.0, 96.0, 1536.0, 9216.0] {
        // Its axis along x.
        let center = Vector3::new(16.0, 0.0, half.z + distance);
        let capsule_pose = Pose::from_quaternion(center, [0.0, eighth, 0.0, eighth]).unwrap();
        let (pose, mut warm) = (Pose::identity(), WarmStart::default());
        let found = distance_to_capsule(&needle, &pose, &capsule, &capsule_pose, &Options::default(), &mut warm);
        assert_eq!(found.status, Status::Converged, "{found:?}");
        assert!(found.lower <= distance - 0.5 && distance - 0.5 <= found.upper, "{distance}: {found:?}");
    }
}
