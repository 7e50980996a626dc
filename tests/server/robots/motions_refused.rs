//! Motions and certificates that are refused, and values that lead out of the world.

use nalgebra::Vector3;
use sublevel::body::{Body, BodyId, Compound};
use sublevel::client::{CertificateQuestion, MotionsQuestion, StatesQuestion};
use sublevel::measure::Pose;
use sublevel::scene::query::StateVerdict;
use sublevel::scene::{Placement, Subject, Update};
use sublevel::service::proto::{CheckMotionsRequest, MovingObjects, PathKind, Verdict, VerifyMotionRequest};
use tonic::Code;

use super::motions::{refused_with, yard};
use super::questions::packed;
use super::{at, cell, joints, placement, served};
use crate::harness::{Running, field, reason};

/// A change that makes a request unusable.
type Change<'a> = &'a dyn Fn(&mut VerifyMotionRequest);

#[tokio::test(flavor = "multi_thread")]
async fn certificates_that_cannot_be_checked_are_refused_by_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let question = MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[-1.0]]).with_certificates();
    let found = client.check_motions("cell", question).await.expect("answered");
    let certificate = found.motions[0].certificate.clone().expect("a certificate");
    assert!(certificate.contains("\"margin_m\":0.0"), "{certificate}");
    let good = VerifyMotionRequest {
        certificate,
        scene: "cell".into(),
        robot: "one".into(),
        ..VerifyMotionRequest::default()
    };
    assert!(clients.queries.verify_motion(good.clone()).await.expect("answered").into_inner().holds);
    let alone = |request: &mut VerifyMotionRequest| {
        request.scene.clear();
        request.robot.clear();
    };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let cases: [(Code, &str, Change); 12] = [
        (invalid, "certificate", &|request| request.certificate.clear()),
        (invalid, "certificate", &|request| request.certificate.truncate(request.certificate.len() / 2)),
        (invalid, "certificate", &|request| {
            request.certificate = request.certificate.replacen("\"margin_m\":0.0", "\"margin_m\":-1.0", 1);
        }),
        (invalid, "certificate", &|request| {
            request.certificate = request.certificate.replacen("certificate 2", "certificate 3", 1);
        }),
        (invalid, "scene", &|request| request.scene.clear()),
        (invalid, "robot", &|request| request.robot.clear()),
        (missing, "scene", &|request| request.scene = "hall".into()),
        (missing, "robot", &|request| request.robot = "three".into()),
        (invalid, "margin_m", &|request| request.margin_m = f64::NAN),
        // What is about a robot in a scene.
        (invalid, "scene", &|request| {
            alone(request);
            request.margin_m = 0.1;
        }),
        (invalid, "scene", &|request| {
            alone(request);
            request.include_allowed = true;
        }),
        (invalid, "scene", &|request| {
            alone(request);
            request.moving = Some(MovingObjects::default());
        }),
    ];
    for (code, at, change) in cases {
        let mut request = good.clone();
        change(&mut request);
        refused_with(clients.queries.verify_motion(request).await, code, at);
    }
    let mut itself = good.clone();
    alone(&mut itself);
    assert!(clients.queries.verify_motion(itself).await.expect("answered").into_inner().holds);
    // Of a revision that is still to come.
    let later = Some(found.revision + 1);
    let verify = VerifyMotionRequest { at_least_revision: later, ..good };
    let check = CheckMotionsRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joint_values: packed(&[0.0; 4]),
        at_least_revision: later,
        ..CheckMotionsRequest::default()
    };
    let refusals = [
        clients.queries.verify_motion(verify).await.expect_err("not reached"),
        clients.queries.check_motions(check).await.expect_err("not reached"),
    ];
    for status in refusals {
        assert_eq!((status.code(), reason(&status).as_str()), (Code::Unavailable, "REVISION_NOT_REACHED"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn joint_values_that_lead_out_of_the_world_are_refused_or_prove_nothing() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let client = server.client().await;
    let robot = yard(&client, "planar").await;
    let drive = |x: f64| joints(&["drive"], &[x, 0.0, 0.0]);
    let base = |x: f64| Update { bases: vec![("cart".into(), at(x, 0.0, 0.0))], ..Update::default() };
    let mut other = placement(&robot, "other", 5.0);
    other.joints = drive(1e300);
    // Each has a pose by itself, and both together lead farther than poses go.
    client.set_joints("planar", "cart", drive(9e14)).await.expect("far away");
    let refusals = [
        (client.set_joints("planar", "cart", drive(1e300)).await, "set_joints[0].joints", "cart/base"),
        (client.update_scene("planar", &base(9e14)).await, "set_robot_bases[0].base", "cart/base"),
        (client.place_robot("planar", &other).await, "place_robots[0].joints", "other/base"),
    ];
    for (refusal, at, link) in refusals {
        let error = refusal.expect_err(at);
        assert_eq!((error.code(), error.field().as_deref()), (Some(Code::InvalidArgument), Some(at)), "{error}");
        assert!(error.to_string().contains(link), "{error}");
    }
    client.set_joints("planar", "cart", drive(0.0)).await.expect("back");
    let states = StatesQuestion::of_robot("cart", ["drive"]).with_joint_values(&[0.0, 0.0, 0.0, 0.0, 1e300, 0.0]);
    let found = client.check_states("planar", states).await.expect("answered");
    assert_eq!(found.verdicts, [StateVerdict::Free, StateVerdict::Invalid]);
    let why = found.reasons[1].as_deref().expect("a reason");
    assert!(why.starts_with("joint_values[1]: ") && why.contains("no usable pose"), "{why}");
    let mut motions = MotionsQuestion::of_robot("cart", ["drive"])
        .with_path([&[0.0; 3][..], &[0.0, 1e300, 0.0]])
        .with_path([&[0.0; 3][..], &[0.0, 1.0, 0.0]])
        .with_certificates();
    motions.request_mut().max_configurations = Some(1000);
    let found = client.check_motions("planar", motions).await.expect("answered");
    assert_eq!(found.verdicts(), [StateVerdict::Undecided, StateVerdict::Free]);
    assert!(found.motions[0].certificate.is_none() && found.motions[1].certificate.is_some() && !found.complete);
}

#[tokio::test(flavor = "multi_thread")]
async fn bezier_segments_of_planar_joints_are_checked_and_of_floating_ones_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    let ask = |kind: &str, points: &[Vec<f64>]| CheckMotionsRequest {
        scene: kind.into(),
        robot: "cart".into(),
        joints: vec!["drive".into()],
        joint_values: packed(&points.concat()),
        point_counts: u32::try_from(points.len()).expect("few").to_le_bytes().to_vec().into(),
        kind: PathKind::Bezier.into(),
        certificates: true,
        ..CheckMotionsRequest::default()
    };
    yard(&client, "planar").await;
    // Past the ball at x = 1 m, y = 0: the curve is there three quarters of its inner control
    // points away, and the base and the ball touch at 0.25 m.
    let past = |y: f64| [[0.0, 0.0], [0.0, y], [2.0, y], [2.0, 0.0]].map(|[x, y]| vec![x, y, 0.5]);
    for (y, expected) in [(1.0, Verdict::Free), (0.32, Verdict::Contact)] {
        let found = clients.queries.check_motions(ask("planar", &past(y))).await.expect("answered").into_inner();
        assert_eq!(found.verdicts[..], [expected as u8], "{y}");
        for certificate in found.certificates.into_iter().filter(|text| !text.is_empty()) {
            let question = CertificateQuestion::new(certificate).of_robot("planar", "cart");
            assert!(client.verify_motion(question).await.expect("answered").holds(), "{y}");
        }
    }
    let most = vec![vec![0.0, 1.0, 0.0]; 16];
    let found = clients.queries.check_motions(ask("planar", &most)).await.expect("answered").into_inner();
    assert_eq!(found.verdicts[..], [Verdict::Free as u8]);
    let more = vec![vec![0.0, 1.0, 0.0]; 17];
    let many = clients.queries.check_motions(ask("planar", &more)).await;
    refused_with(many, Code::InvalidArgument, "point_counts[0]");
    yard(&client, "floating").await;
    let turned = vec![vec![0.0, 0.0, 2.0, 0.0, 0.0, 0.6, 0.8]; 3];
    refused_with(clients.queries.check_motions(ask("floating", &turned)).await, Code::InvalidArgument, "kind");
}

/// Objects that make too many pairs of convex pieces with a robot, its seven pieces with those of
/// what it holds, and each object 256.
const MANY: usize = (1 << 22) / (7 * 256) + 1;

#[tokio::test(flavor = "multi_thread")]
async fn more_pairs_than_are_kept_in_memory_are_refused_until_they_may_touch() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let part = |index: i32| {
        let center = Vector3::new(0.2 * f64::from(index % 16), 0.2 * f64::from(index / 16), 0.0);
        Body::ball("part", center, 0.05).expect("a ball")
    };
    let grid = Compound::new("grid", (0..256).map(part).collect()).expect("a compound");
    let grid: BodyId = clients.put_file(grid.to_json()).await.parse().expect("an id");
    let place = |index: usize| Placement {
        name: format!("grid {index}").into(),
        body: grid,
        pose: Some(Pose::identity().with_translation(Vector3::new(10.0, 0.0, 1.0 + index as f64))),
        group: "grids".into(),
        padding_m: None,
        attachment: None,
    };
    let update = Update { upserts: (0..MANY).map(place).collect(), ..Update::default() };
    client.update_scene("cell", &update).await.expect("placed");
    let request = CheckMotionsRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joints: vec!["lift".into()],
        joint_values: packed(&[0.0, -0.5]),
        ..CheckMotionsRequest::default()
    };
    let status = clients.queries.check_motions(request.clone()).await.expect_err("too many");
    assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, "robot"), "{}", status.message());
    assert!(status.message().contains("allow pairs that cannot touch"), "{}", status.message());
    let grids = || Subject::Group("grids".into());
    let allow = vec![(Subject::Group("one".into()), grids()), (Subject::Object("held".into()), grids())];
    client.update_scene("cell", &Update { allow, ..Update::default() }).await.expect("allowed");
    let found = clients.queries.check_motions(request).await.expect("answered").into_inner();
    assert_eq!(found.verdicts[..], [Verdict::Free as u8]);
}
