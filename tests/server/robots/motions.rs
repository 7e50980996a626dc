//! Motions and their certificates, over the wire.

use sublevel::client::{CertificateQuestion, MotionsQuestion};
use sublevel::scene::query::StateVerdict;
use sublevel::scene::{Attach, Update};
use sublevel::service::proto::{CheckMotionsRequest, MovingObjects, Verdict, VerifyMotionRequest};

use super::questions::packed;
use super::{at, cell, served};
use crate::harness::field;

fn refused<T: std::fmt::Debug>(answer: Result<T, tonic::Status>, at: &str) {
    let status = answer.expect_err("refused");
    assert_eq!((status.code(), field(&status).as_str()), (tonic::Code::InvalidArgument, at), "{}", status.message());
    assert!(status.message().len() > 20, "{}", status.message());
}

/// A change that makes a request unusable.
type Change<'a> = &'a dyn Fn(&mut CheckMotionsRequest);

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

#[tokio::test(flavor = "multi_thread")]
async fn whole_motions_are_proven_or_their_first_contact_is_bracketed() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // The arm turns to the right through a ball, to the left through nothing, and beyond its limit.
    let put = Update { poses: vec![("post".into(), at(1.3, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &put).await.expect("moved");
    let ask = || {
        let question = MotionsQuestion::of_robot("one", ["lift"]);
        let question = question.with_path([&[0.0][..], &[QUARTER]]).with_path([&[0.0][..], &[-1.0], &[-QUARTER]]);
        question.with_path([&[0.0][..], &[2.5]])
    };
    let mut first = ask();
    first.request_mut().first_contact = true;
    let found = client.check_motions("cell", first).await.expect("answered");
    let verdicts: Vec<_> = found.motions.iter().map(|motion| motion.verdict).collect();
    assert_eq!(verdicts, [StateVerdict::Contact, StateVerdict::Free, StateVerdict::Invalid]);
    let (pair, s) = found.motions[0].contact.clone().expect("a contact");
    assert!(pair.contains(&"post".to_owned()), "{pair:?}");
    let alpha = found.motions[0].alpha;
    assert!(alpha > 0.8 && alpha <= s && s - alpha < 1e-3, "{alpha} {s}");
    assert!(found.motions[1].alpha == 1.0 && found.motions[1].clearance_lower_m >= 0.0 && found.complete);
    // States along the path agree on both sides of the bracket.
    let states = sublevel::client::StatesQuestion::of_robot("one", ["lift"]);
    let states = states.with_joint_values(&[QUARTER * (alpha - 1e-6), QUARTER * (s + 1e-6)]);
    let states = client.check_states("cell", states).await.expect("answered");
    assert_eq!(states.verdicts, [StateVerdict::Free, StateVerdict::Contact]);
    let mut stopping = ask();
    stopping.request_mut().stop_at_first = true;
    let found = client.check_motions("cell", stopping).await.expect("answered");
    assert!(found.motions[1..].iter().all(|motion| motion.verdict != StateVerdict::Contact));
    // A certificate holds by itself and against the scene, until that changes.
    let free = MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[-QUARTER]]).with_certificates();
    let found = client.check_motions("cell", free).await.expect("answered");
    let certificate = found.motions[0].certificate.clone().expect("a certificate");
    let alone = client.verify_motion(CertificateQuestion::new(certificate.clone())).await.expect("answered");
    assert!(alone.holds() && alone.revision.is_none(), "{alone:?}");
    let of_scene = || CertificateQuestion::new(certificate.clone()).of_robot("cell", "one");
    let verified = client.verify_motion(of_scene()).await.expect("answered");
    assert_eq!((verified.revision, &verified.proof), (Some(found.revision), &alone.proof));
    let proven = verified.proof.expect("it holds");
    assert!(proven.clearance_lower_m > 0.0 && proven.configurations > 0, "{proven:?}");
    let wider = client.verify_motion(of_scene().with_margin(0.01)).await.expect("answered");
    assert!(wider.proof.expect_err("another margin").contains("margin"));
    let moved = Update { poses: vec![("post".into(), at(-1.3, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &moved).await.expect("moved");
    let refused = client.verify_motion(of_scene()).await.expect("answered");
    assert!(!refused.holds() && refused.revision > Some(found.revision), "{refused:?}");
    assert!(refused.proof.expect_err("it does not hold").contains("obstacles"));
}

#[tokio::test(flavor = "multi_thread")]
async fn obstacles_may_move_meanwhile() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let poses = |x: f64| packed(&[x, 0.0, 1.3, 0.0, 0.0, 0.0, 1.0]);
    let moving = MovingObjects { names: vec!["post".into()], start_poses: poses(2.0), end_poses: poses(-1.0) };
    let request = CheckMotionsRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joints: vec!["lift".into()],
        joint_values: packed(&[0.0, 0.0]),
        first_contact: true,
        moving: Some(moving.clone()),
        ..Default::default()
    };
    let found = clients.queries.check_motions(request.clone()).await.expect("answered").into_inner();
    assert_eq!(&found.verdicts[..], [Verdict::Contact as u8]);
    assert!(found.objects.contains(&"post".to_owned()));
    // The typed client asks the same; a certificate is about what moves, too.
    let ask = |x: [f64; 2], z: f64| {
        let path = MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[0.0]]);
        path.with_moving([("post", x.map(|x| at(x, 0.0, z)))])
    };
    let mut first = ask([2.0, -1.0], 1.3);
    first.request_mut().first_contact = true;
    let typed = client.check_motions("cell", first).await.expect("answered");
    assert_eq!(typed.verdicts(), [StateVerdict::Contact]);
    assert_eq!(typed.motions[0].alpha.to_le_bytes()[..], found.alpha[..]);
    let free = client.check_motions("cell", ask([2.0, 1.5], 1.3).with_certificates()).await.expect("answered");
    let certificate = free.motions[0].certificate.clone().expect("a certificate");
    let still = CertificateQuestion::new(certificate).of_robot("cell", "one");
    let with_post = still.clone().with_moving([("post", [at(2.0, 0.0, 1.3), at(1.5, 0.0, 1.3)])]);
    assert!(client.verify_motion(with_post).await.expect("answered").holds());
    let still = client.verify_motion(still).await.expect("answered").proof;
    assert!(still.expect_err("nothing moves").contains("obstacles"));
    // High above, it carries what hangs where it was before.
    let thing = client.create_ball("thing", 0.05).await.expect("a ball");
    client.put_objects("cell", [("load", &thing, at(0.0, 0.0, 9.0))]).await.expect("placed");
    let hangs = Attach { name: "load".into(), to: "post".into(), pose: Some(at(0.0, 0.0, -3.7)), touch: vec![] };
    client.update_scene("cell", &Update { attach: vec![hangs], ..Update::default() }).await.expect("held");
    let poses = |x: f64| packed(&[x, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0]);
    let above = MovingObjects { start_poses: poses(2.0), end_poses: poses(-1.0), ..moving.clone() };
    let carries = CheckMotionsRequest { moving: Some(above), ..request.clone() };
    let found = clients.queries.check_motions(carries).await.expect("answered").into_inner();
    assert_eq!(&found.verdicts[..], [Verdict::Contact as u8]);
    assert!(found.objects.contains(&"load".to_owned()), "{:?}", found.objects);
    let held = MovingObjects { names: vec!["held".into()], ..moving };
    let status = clients.queries.check_motions(CheckMotionsRequest { moving: Some(held), ..request }).await;
    refused(status, "moving.names");
}

#[tokio::test(flavor = "multi_thread")]
async fn motions_that_cannot_be_checked_are_refused_by_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let good = CheckMotionsRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joint_values: packed(&[0.0, 0.0, 0.5, 0.1]),
        ..Default::default()
    };
    let index = |values: &[u32]| -> bytes::Bytes {
        values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>().into()
    };
    clients.queries.check_motions(good.clone()).await.expect("answered");
    let cases: [(&str, Change); 12] = [
        ("robot", &|request| request.robot.clear()),
        ("margin_m", &|request| request.margin_m = f64::NAN),
        ("joint_values", &|request| request.joint_values = packed(&[0.0, 0.0, 0.5])),
        ("joint_values", &|request| request.joint_values = Default::default()),
        ("point_counts", &|request| request.point_counts = b"123".as_slice().into()),
        ("point_counts[0]", &|request| {
            request.point_counts = index(&[1]);
            request.joint_values = packed(&[0.0, 0.0]);
        }),
        ("joints[0]", &|request| request.joints = vec!["elbow".into()]),
        ("resolution_m", &|request| request.resolution_m = Some(0.0)),
        ("clearance_accuracy_m", &|request| request.clearance_accuracy_m = Some(f64::INFINITY)),
        ("max_configurations", &|request| request.max_configurations = Some(0)),
        ("kind", &|request| request.kind = 7),
        ("moving.start_poses", &|request| {
            request.moving = Some(MovingObjects { names: vec!["post".into()], ..Default::default() });
        }),
    ];
    for (field, change) in cases {
        let mut request = good.clone();
        change(&mut request);
        refused(clients.queries.check_motions(request).await, field);
    }
    let text = VerifyMotionRequest { certificate: "{}".into(), ..Default::default() };
    refused(clients.queries.verify_motion(text).await, "certificate");
}
