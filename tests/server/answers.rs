//! What answers contain besides their bracket, compared with closed forms of balls.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use sublevel::body::Body;
use sublevel::service::proto::{self, Answer, EvaluateRequest, Measure, UpdateSceneRequest};

use sublevel_testkit::sos_bodies::torus;

use crate::harness::{Clients, Numbers, Running, at, ball, field, moved, object, pair, question, rows};

/// Distance and both level distances of the objects `a` and `b` of the scene `room`, `b` elsewhere
/// for this call.
async fn answers(clients: &mut Clients, b: proto::Pose) -> (Answer, Answer, Answer) {
    let measures = [Measure::Distance, Measure::LevelDistanceAOnB, Measure::LevelDistanceBOnA];
    let request = EvaluateRequest {
        pose_overrides: rows(vec![moved("b", b)]),
        accuracy: Some(1e-12),
        ..question(vec![pair("a", "b")], &measures)
    };
    let answers = clients.queries.evaluate(request).await.expect("answers").into_inner().answers;
    <[Answer; 3]>::try_from(answers).expect("three answers").into()
}

/// A scene `room` of two bodies: `a` at this pose, `b` at the origin.
async fn room(clients: &mut Clients, (a, pose): (&Body, proto::Pose), b: &Body) {
    let (a, b) = (clients.put(a).await, clients.put(b).await);
    clients.make_scene("room").await;
    let upsert_objects = vec![object("a", &a, pose), object("b", &b, at(0.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
}

fn vector(v: Option<proto::Vector3>) -> Vector3<f64> {
    let v = v.expect("a vector");
    Vector3::new(v.x, v.y, v.z)
}

/// How far a gradient is from the force at a point, about the translation of a pose, relative to
/// the force.
fn off(gradient: Option<proto::PoseGradient>, force: &Vector3<f64>, arm: &Vector3<f64>) -> f64 {
    let gradient = gradient.expect("a gradient");
    let linear = (vector(gradient.linear) - force).norm();
    let angular = (vector(gradient.angular) - arm.cross(force)).norm();
    (linear + angular) / force.norm()
}

#[tokio::test(flavor = "multi_thread")]
async fn gradients_are_those_of_balls_off_their_origins() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (center_a, center_b) = (Vector3::new(0.3, -0.4, 0.2), Vector3::new(0.0, 0.5, -0.1));
    let (radius_a, radius_b) = (0.7, 0.4);
    let body = |center, radius| Body::ball("ball", center, radius).expect("a ball");
    let mut numbers = Numbers(17);
    let pose_a = numbers.pose();
    room(&mut clients, (&body(center_a, radius_a), pose_a), &body(center_b, radius_b)).await;

    let mut apart = 0;
    for step in 0..60 {
        let pose_b = numbers.pose();
        let arm = |pose: &proto::Pose, center: &Vector3<f64>| {
            let q = pose.rotation.expect("a rotation");
            UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z)) * center
        };
        let (arm_a, arm_b) = (arm(&pose_a, &center_a), arm(&pose_b, &center_b));
        let between = vector(pose_a.translation_m) + arm_a - vector(pose_b.translation_m) - arm_b;
        let (length, n) = (between.norm(), between.normalize());
        let (distance, ab, ba) = answers(&mut clients, pose_b).await;
        let label = format!("seed 17 step {step}: {distance:?} {ab:?} {ba:?}");
        assert!(!distance.not_unique && !ab.not_unique && !ba.not_unique, "{label}");
        assert_eq!((distance.part_a, distance.part_b, distance.objects_upper), (0, 0, None), "{label}");
        if length < radius_a + radius_b {
            assert!(distance.gradient_a.is_none() && distance.gradient_b.is_none(), "{label}");
            continue;
        }
        apart += 1;
        assert!(off(distance.gradient_a, &n, &arm_a) < 1e-6 && off(distance.gradient_b, &-n, &arm_b) < 1e-6, "{label}");
        // d(P‖Q) = ((length - r_Q) / r_P)², and the radius of Q grows with the root of its level.
        for (level, p, q, of_p, of_q, n) in
            [(ab, radius_a, radius_b, arm_a, arm_b, n), (ba, radius_b, radius_a, arm_b, arm_a, -n)]
        {
            let force = n * (2.0 * (length - q) / (p * p));
            // Gradients are in the order of the pair.
            let (force_a, force_b) = if of_p == arm_a { (force, -force) } else { (-force, force) };
            assert!(off(level.gradient_a, &force_a, &arm_a) < 1e-6, "{label}");
            assert!(off(level.gradient_b, &force_b, &arm_b) < 1e-6, "{label} {of_q}");
            let multiplier = (length - q) * q / (p * p);
            let found = level.multiplier.expect("a multiplier");
            assert!((found - multiplier).abs() <= 1e-6 * multiplier && !level.saturated, "{label}");
        }
    }
    assert!(apart > 30, "{apart} of 60 are apart");
}

#[tokio::test(flavor = "multi_thread")]
async fn gaps_widen_the_bracket_for_the_objects() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    // Balls of radius 1 and 2 that reach a quarter and a half beyond their objects.
    room(&mut clients, (&ball(1.0).with_gap(0.25), at(0.0)), &ball(2.0).with_gap(0.5)).await;
    for x in [5.0, 3.0 + 1e-9, 1.0] {
        let (distance, ..) = answers(&mut clients, at(x)).await;
        let hulls = distance.objects_upper.expect("both gaps are known");
        assert!(hulls >= distance.upper + 0.75 && hulls <= (distance.upper + 0.75) * (1.0 + 1e-15), "{distance:?}");
        assert!((distance.upper - (x - 3.0).max(0.0)).abs() < 1e-8, "{distance:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn saturated_levels_say_so() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    room(&mut clients, (&ball(1.0), at(0.0)), &ball(2.0)).await;
    // The centre of A lies in B, that of B outside A.
    let (distance, ab, ba) = answers(&mut clients, at(1.5)).await;
    assert!(distance.gradient_a.is_none() && distance.upper == 0.0, "{distance:?}");
    let still = proto::Vector3 { x: 0.0, y: 0.0, z: 0.0 };
    assert!(ab.saturated && ab.multiplier == Some(0.0) && ab.gradient_a.expect("one").linear == Some(still), "{ab:?}");
    let value = ba.value.expect("a value");
    assert!(!ba.saturated && (value - 0.0625).abs() < 1e-8 && ba.multiplier > Some(0.0), "{ba:?}");
}

/// A ball in the hole of a ring: the box around the ring says nothing, boxes in it say all.
#[tokio::test(flavor = "multi_thread")]
async fn sets_that_are_not_convex_are_measured_and_what_they_have_not_is_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let ring = clients.put_file(torus(0.2).to_json()).await;
    let ball = clients.put(&Body::ball("ball", Vector3::zeros(), 0.3).expect("a ball")).await;
    clients.make_scene("room").await;
    let upsert_objects = vec![object("ring", &ring, at(0.0)), object("ball", &ball, at(0.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    let measures = [Measure::Distance, Measure::LevelDistanceAOnB, Measure::Overlap];
    let asked = |x: f64, measures: &[Measure]| EvaluateRequest {
        pose_overrides: rows(vec![moved("ball", at(x))]),
        accuracy: Some(1e-2),
        ..question(vec![pair("ball", "ring")], measures)
    };
    // The middle of the hole, off the middle, in the tube.
    for (x, distance) in [(0.0, 0.5), (0.3, 0.2), (0.6, 0.0)] {
        let answers = clients.queries.evaluate(asked(x, &measures)).await.expect("answers").into_inner().answers;
        let [found, level, overlap] = <[Answer; 3]>::try_from(answers).expect("three");
        assert!((found.lower - 1e-6..=found.upper + 1e-6).contains(&distance), "{x}: {found:?}");
        assert!(found.upper - found.lower < 4e-3, "{x}: {found:?}");
        // Of the ball at the inner edge of the ring.
        let truth = ((0.8 - x) / 0.3).powi(2);
        assert!(distance == 0.0 || (level.upper - truth).abs() < 2e-2 * truth.max(1.0), "{x}: {level:?}");
        let expected = if distance > 0.0 { proto::Decision::No } else { proto::Decision::Yes };
        assert_eq!(overlap.decision(), expected, "{x}: {overlap:?}");
    }
    let refused = clients.queries.evaluate(asked(0.0, &[Measure::GrowthDistance])).await.expect_err("not convex");
    assert_eq!((refused.code(), field(&refused).as_str()), (tonic::Code::InvalidArgument, "pairs[0]"));
    assert!(refused.message().contains("compound"), "{refused:?}");
}
