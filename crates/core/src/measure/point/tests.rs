use super::*;
use crate::body::{Compound, Normalization};
use crate::measure::MAX_ITERATIONS;
use crate::measure::solver::stages::except;
use crate::measure::tests::edges::slab;
use crate::measure::tests::{random_pose, zoo};
use nalgebra::Matrix3;
use sublevel_testkit::Seeded;

fn cold(solid: &impl Solid, pose: &Pose, point: &Vector3<f64>) -> PointDistance {
    distance_to_point(solid, pose, point, &Options::default(), &mut WarmStart::default()).unwrap()
}

#[test]
fn boxes_and_balls_have_closed_forms() {
    let half = Vector3::new(0.5, 1.0, 3.0);
    let bodies = [Body::cuboid("b", half).unwrap(), Body::ball("b", Vector3::zeros(), 1.5).unwrap()];
    for seed in 0..3000 {
        let mut random = Seeded(seed);
        let body = &bodies[(seed % 2) as usize];
        let pose = random_pose(&mut random, 2.0);
        // Over faces, edges and corners, near and far, inside and out.
        let x = Vector3::from_fn(|i, _| {
            half[i]
                * [0.3, 0.99, 1.0 + 1e-9, 1.001, 2.0, 100.0][(random.next() % 6) as usize]
                * random.signed().signum()
        });
        let truth = if seed % 2 == 0 { (x.abs() - half).map(|d| d.max(0.0)).norm() } else { (x.norm() - 1.5).max(0.0) };
        let found = cold(body, &pose, &pose.transform_point(&x));
        let label = format!("seed {seed}: {found:?} against {truth}");
        let floor = 1e-14 * (x.norm() + 2.0);
        assert_eq!(found.status, Status::Converged, "{label}");
        assert!(found.lower <= truth + floor && truth - floor <= found.upper, "{label}");
        assert!(!found.inside || truth <= floor, "{label}");
        let is_well_inside = if seed % 2 == 0 { (x.abs() - half).max() < -1e-9 } else { x.norm() < 1.5 - 1e-9 };
        assert!(found.inside || !is_well_inside, "{label}");
        let reached = (pose.transform_point(&x) - found.witness).norm();
        assert!((reached - found.upper).abs() <= 1e-12 * (1.0 + x.norm()), "{label}");
    }
}

#[test]
fn projections_are_optimal() {
    let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
    let (mut most, mut total, mut count) = (0, 0, 0);
    for seed in 0..3000 {
        let mut random = Seeded(11_000 + seed);
        let bodies = &zoos[(seed % 6) as usize];
        let body = &bodies[random.next() as usize % bodies.len()];
        let size = body.circumscribed().radius;
        let pose = random_pose(&mut random, 1.0);
        let x = body.circumscribed().center + random.unit() * size * 10_f64.powf(random.signed());
        let mut warm = WarmStart::default();
        for k in 0..3 {
            let point = pose.transform_point(&x) + Vector3::new(0.01, 0.02, 0.0) * size * f64::from(k);
            let found = distance_to_point(body, &pose, &point, &Options::default(), &mut warm).unwrap();
            let label = format!("seed {seed} {} step {k}: {found:?}", body.name());
            assert_eq!(found.status, Status::Converged, "{label}");
            (most, total, count) = (most.max(found.iterations), total + found.iterations, count + 1);
            let local = |v: &Vector3<f64>| pose.rotation().inverse_transform_vector(v);
            assert!(body.value(&local(&(found.witness - pose.translation()))) <= 1.0 + 1e-9, "{label}");
            assert_eq!(found.inside, body.value(&local(&(point - pose.translation()))) <= 1.0, "{label}");
            if let Some(n) = found.normal {
                // No sampled point of the body is beyond the separating plane.
                let plane = n.dot(&point) - found.lower;
                for y in body.boundary() {
                    assert!(n.dot(&pose.transform_point(y)) <= plane + 1e-9 * size, "{label}");
                }
            }
        }
    }
    assert!(total < 2 * count && most <= 60, "{total} of {count}, most {most}");
}

#[test]
fn gradients_are_differences() {
    let zoos: Vec<_> = (0..4).map(|seed| zoo(&mut Seeded(seed))).collect();
    let accurate = Options::default().with_accuracy(1e-13).unwrap();
    for seed in 0..400 {
        let mut random = Seeded(seed);
        let bodies = &zoos[(seed % 4) as usize];
        // Curved ones: the witness, and with it the gradient, is accurate to the root of the
        // bracket elsewhere.
        let body = &bodies[(seed as usize / 4) % 2];
        let size = body.circumscribed().radius;
        let pose = random_pose(&mut random, 1.0);
        let point = pose.transform_point(&(body.circumscribed().center + random.unit() * 2.5 * size));
        let value =
            |pose: &Pose| distance_to_point(body, pose, &point, &accurate, &mut WarmStart::default()).unwrap().value();
        let found = distance_to_point(body, &pose, &point, &accurate, &mut WarmStart::default()).unwrap();
        let gradient = found.pose_gradient(&pose).unwrap();
        let h = 1e-4 * size;
        for axis in 0..3 {
            let e = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
            let moved =
                |t: f64| Pose::from_quaternion(pose.translation() + e * t, pose.rotation().coords.into()).unwrap();
            let turned = |t: f64| {
                let turn = nalgebra::UnitQuaternion::from_scaled_axis(e * t) * pose.rotation();
                Pose::from_quaternion(*pose.translation(), turn.coords.into()).unwrap()
            };
            let slope = (value(&moved(h)) - value(&moved(-h))) / (2.0 * h);
            assert!((slope - gradient.linear[axis]).abs() < 1e-5, "seed {seed}: {slope} {gradient:?}");
            let slope = (value(&turned(1e-4)) - value(&turned(-1e-4))) / 2e-4;
            assert!((slope - gradient.angular[axis]).abs() < 1e-5 * (1.0 + size), "seed {seed}: {slope} {gradient:?}");
        }
    }
}

#[test]
fn the_nearest_part_counts_and_points_are_checked() {
    let at = |x: f64| Body::ball("part", Vector3::new(x, 0.0, 0.0), 1.0).unwrap();
    let row = Compound::new("row", vec![at(0.0), at(5.0), at(10.0)]).unwrap();
    let mut warm = WarmStart::default();
    for k in 0..120 {
        let x = -1.0 + 0.1 * f64::from(k);
        let point = Vector3::new(x, 3.0, 0.0);
        let truth = [0.0, 5.0, 10.0].map(|c| (x - c).hypot(3.0) - 1.0).into_iter().fold(f64::MAX, f64::min);
        let found = distance_to_point(&row, &Pose::identity(), &point, &Options::default(), &mut warm).unwrap();
        assert!((found.value() - truth).abs() < 1e-8 && found.lower <= truth && truth <= found.upper, "{x}: {found:?}");
    }
    for bad in [f64::NAN, f64::INFINITY, 1e16] {
        let point = Vector3::new(0.0, bad, 0.0);
        let found = distance_to_point(&row, &Pose::identity(), &point, &Options::default(), &mut warm);
        assert_eq!(found.unwrap_err(), PointError);
    }
}

/// A quaternion along (1, 2, 2, 4): its rotation has entries in 25ths.
const TURN: [f64; 4] = [0.2, 0.4, 0.4, 0.8];

/// Where a body that is turned by [`TURN`] sees a point, without rounding for coordinates that are
/// multiples of 25 times a power of two.
fn turned(p: Vector3<f64>) -> Vector3<f64> {
    let p = p / 25.0;
    Vector3::new(9.0 * p.x - 12.0 * p.y + 20.0 * p.z, 20.0 * p.x + 15.0 * p.y, -12.0 * p.x + 16.0 * p.y + 15.0 * p.z)
}

/// A body of about 1 cm, the same with a further constraint that does not matter, a point of its
/// surface, an outward normal there and the length of that.
type Known = ([Body; 2], Vector3<f64>, Vector3<f64>, f64);

/// Bodies of about 1 cm with points of their surfaces in exact numbers; what the sizes of the
/// bodies are off by rounding of their inverses is 1e-18 m.
fn small_bodies() -> Vec<Known> {
    let with_another = |body: Body, a: Vector3<f64>, b: f64| {
        let constraints = body.constraints().iter().cloned().chain([slab(&a, b)]).collect();
        let other = Body::new("cut", *body.normalization(), constraints).unwrap();
        [body, other]
    };
    let (large, u) = (25.0 / 2048.0, 25.0 / 65536.0);
    let half = Vector3::new(large, 0.5 * large, 0.25 * large);
    // Twice as wide as the box.
    let cuboid = || with_another(Body::cuboid("box", half).unwrap(), Vector3::x() * 0.5, 0.0);
    // Cut on the other side.
    let pebble = Body::ellipsoid("pebble", Vector3::zeros(), Vector3::new(7.0, 21.0, 21.0) * u).unwrap();
    let ball = Body::ball("ball", Vector3::zeros(), 21.0 * u).unwrap();
    let cylinder = Body::cylinder("cylinder", half.x, half.y).unwrap();
    vec![
        (cuboid(), half, Vector3::new(2.0, 3.0, 6.0), 7.0),
        (cuboid(), Vector3::new(half.x, half.y, 0.0), Vector3::new(3.0, 4.0, 0.0), 5.0),
        (cuboid(), Vector3::new(half.x, 0.0, 0.0), Vector3::x(), 1.0),
        (with_another(pebble, Vector3::x(), 0.5), Vector3::new(2.0, 9.0, 18.0) * u, Vector3::new(2.0, 1.0, 2.0), 3.0),
        (with_another(ball, Vector3::x(), 0.5), Vector3::new(14.0, 7.0, 14.0) * u, Vector3::new(2.0, 1.0, 2.0), 3.0),
        (
            with_another(cylinder, Vector3::x() * 0.5, 0.0),
            Vector3::new(half.x, 0.0, half.y),
            Vector3::new(3.0, 0.0, 4.0),
            5.0,
        ),
    ]
}

/// Hundred metres to ten kilometres away from bodies of 1 cm doubles leave brackets wider than is
/// asked for.
#[test]
fn far_points_have_narrow_brackets() {
    let place = Vector3::new(-512.0, 256.0, 1024.0);
    let options = Options::default();
    let pose = Pose::from_quaternion(place, TURN).unwrap();
    let mut wide = 0;
    for (bodies, x, n, length) in small_bodies() {
        for (body, times) in bodies.iter().flat_map(|body| [100.0, 800.0, 1600.0].map(|times| (body, times))) {
            let (point, truth) = (place + turned(x + n * times), length * times);
            let size = body.circumscribed().radius;
            let solve = |warm: &mut WarmStart| distance_to_point(body, &pose, &point, &options, warm).unwrap();
            let mut warm = WarmStart::default();
            for round in 0..2 {
                let found = solve(&mut warm);
                let label = format!("{} along {n:?}, {truth} m, round {round}: {found:?}", body.name());
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.lower <= truth && truth <= found.upper, "{label}");
                assert!(found.upper - found.lower <= 1e-9 * size, "{label}");
                assert!((found.normal.unwrap() - turned(n * 25.0) / (25.0 * length)).norm() < 1e-6, "{label}");
                let rounding = 4.0 * f64::EPSILON * (truth + place.norm());
                assert!(((point - found.witness).norm() - truth).abs() <= 1e-9 * size + rounding, "{label}");
            }
            let without = except(&[Stage::Refinement], || solve(&mut WarmStart::default()));
            assert!(without.lower <= truth && truth <= without.upper, "{}: {without:?}, {truth}", body.name());
            wide += u32::from(without.status == Status::BracketWide);
        }
    }
    // From two kilometres on all are.
    assert!(wide >= 20, "{wide} of 36 are wide without refinement");
}

/// Narrower than doubles are spaced there is no bracket.
#[test]
fn brackets_of_points_end_where_doubles_do() {
    let place = Vector3::new(-512.0, 256.0, 1024.0);
    let pose = Pose::from_quaternion(place, TURN).unwrap();
    let options = Options::default().with_accuracy(1e-18).unwrap();
    for (bodies, x, n, length) in small_bodies() {
        for body in &bodies {
            let (point, truth) = (place + turned(x + n * 100.0), 100.0 * length);
            let found = distance_to_point(body, &pose, &point, &options, &mut WarmStart::default()).unwrap();
            let label = format!("{} at {n:?}: {found:?} against {truth}", body.name());
            assert_eq!(found.status, Status::BracketWide, "{label}");
            assert!(found.lower <= truth && truth <= found.upper, "{label}");
            assert!(found.upper - found.lower <= 4.0 * f64::EPSILON * truth, "{label}");
            assert!(found.iterations < MAX_ITERATIONS / 2, "{label}");
        }
    }
}

/// An edge so sharp that steps off its two sides, by turns, do not lead into the body.
#[test]
fn far_sharp_edges_have_narrow_brackets() {
    let sides = [Vector3::new(1.0, 4.0, 0.0), Vector3::new(1.0, -4.0, 0.0), Vector3::z()];
    let constraints = sides.iter().map(|side| slab(side, 0.0)).collect();
    let normalization = Normalization { center: Vector3::zeros(), linear: Matrix3::identity() * 128.0 };
    let body = Body::new("blade", normalization, constraints).unwrap();
    let place = Vector3::new(-512.0, 256.0, 1024.0);
    let pose = Pose::from_quaternion(place, TURN).unwrap();
    let (point, truth) = (place + turned(Vector3::x() * 1025.0), 1025.0 - 1.0 / 128.0);
    let found = cold(&body, &pose, &point);
    assert_eq!(found.status, Status::Converged, "{found:?}");
    assert!(found.lower <= truth && truth <= found.upper, "{found:?} against {truth}");
}
