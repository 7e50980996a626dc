//! Motions and their certificates, over the wire.

use sublevel::client::{BodySource, CertificateQuestion, CheckedMotion, Client, MotionsQuestion, StoredRobot};
use sublevel::scene::query::StateVerdict;
use sublevel::scene::{Attach, Subject, Update};
use sublevel::service::proto::{
    CheckMotionsRequest, CheckStatesRequest, MovingObjects, PathKind, Verdict, VerifyMotionRequest,
};
use sublevel::store::RobotSource;
use tonic::Code;

use super::questions::packed;
use super::{SRDF, URDF, at, cell, placement, served};
use crate::harness::{Running, field};

fn refused<T: std::fmt::Debug>(answer: Result<T, tonic::Status>, at: &str) {
    refused_with(answer, Code::InvalidArgument, at);
}

pub(super) fn refused_with<T: std::fmt::Debug>(
    answer: Result<T, tonic::Status>,
    code: Code,
    at: &str,
) -> tonic::Status {
    let status = answer.expect_err(at);
    assert_eq!((status.code(), field(&status).as_str()), (code, at), "{}", status.message());
    assert!(status.message().len() > 20, "{}", status.message());
    status
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

/// What is said of a path of which nothing is known.
fn is_blank(motion: &CheckedMotion) -> bool {
    motion.alpha == 0.0
        && motion.clearance_lower_m.is_nan()
        && motion.contact.is_none()
        && motion.open.is_none()
        && motion.certificate.is_none()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_ends_at_the_first_path_that_is_not_free_or_when_its_time_is_over() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let put = Update { poses: vec![("post".into(), at(1.3, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &put).await.expect("moved");
    // Each of the last takes milliseconds: all together take many seconds on any machine.
    const MANY: usize = 3000;
    let ask = |first: &[[f64; 2]], many: usize| {
        let question = MotionsQuestion::of_robot("one", ["lift"]);
        let ways = first.iter().copied().chain(std::iter::repeat_n([0.0, -QUARTER], many));
        let mut question = ways.fold(question, |question, way| question.with_path([&way[..1], &way[1..]]));
        question.request_mut().clearance_accuracy_m = Some(1e-6);
        question
    };
    let (free, contact, invalid) = ([0.0, -1.0], [0.0, QUARTER], [0.0, 2.5]);
    let all = client.check_motions("cell", ask(&[contact, free, invalid, contact], 2)).await.expect("answered");
    let (is_free, is_contact, is_invalid) = (StateVerdict::Free, StateVerdict::Contact, StateVerdict::Invalid);
    assert_eq!(all.verdicts(), [is_contact, is_free, is_invalid, is_contact, is_free, is_free]);
    assert!(all.complete);
    for (first, expected) in [
        (&[contact][..], &[is_contact][..]),
        (&[free, contact], &[is_free, is_contact]),
        (&[free, free, invalid], &[is_free, is_free, is_invalid]),
    ] {
        let mut question = ask(first, MANY);
        question.request_mut().stop_at_first = true;
        let found = client.check_motions("cell", question).await.expect("answered");
        assert_eq!(found.motions.len(), first.len() + MANY);
        let (verdicts, count) = (found.verdicts(), first.len());
        assert_eq!(verdicts[..count], *expected, "what comes before is looked at");
        let skipped = found.motions.iter().filter(|motion| motion.verdict == StateVerdict::NotChecked);
        let skipped: Vec<_> = skipped.collect();
        assert!(skipped.len() > MANY / 2 && skipped.iter().all(|motion| is_blank(motion)), "{}", skipped.len());
        assert_eq!(verdicts.last(), Some(&StateVerdict::NotChecked));
        assert!(!found.complete && !found.are_free());
    }
    // A budget of a millisecond ends it with what is known.
    let mut question = ask(&[free], MANY);
    question.request_mut().budget_ms = Some(1);
    let found = client.check_motions("cell", question).await.expect("answered");
    assert!(!found.complete && found.verdicts().last() == Some(&StateVerdict::NotChecked));
    let all = found.motions.iter().all(|motion| match motion.verdict {
        StateVerdict::Free => motion.alpha == 1.0 && motion.clearance_lower_m > 0.0,
        StateVerdict::Undecided => motion.alpha < 1.0,
        verdict => verdict == StateVerdict::NotChecked && is_blank(motion),
    });
    assert!(all, "{:?}", found.motions);
    let none = CheckMotionsRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joint_values: packed(&[0.0, 0.0, 0.5, 0.1]),
        budget_ms: Some(0),
        ..Default::default()
    };
    refused(clients.queries.check_motions(none).await, "budget_ms");
}

#[tokio::test(flavor = "multi_thread")]
async fn paths_with_unusable_values_are_invalid_and_no_others() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let nan = f64::NAN;
    // The configuration that is wrong, counted over all paths, and what the reason says of it.
    type Case<'a> = (&'a [[f64; 2]], Option<&'a [&'a str]>);
    let paths: [Case<'_>; 7] = [
        (&[[0.0, nan], [-0.5, 0.0]], Some(&["joint_values[0]: ", "slide is NaN", "give a finite number"])),
        (&[[0.0, 0.0], [-0.5, 0.0]], None),
        (&[[0.0, 0.0], [nan, 0.0], [-0.5, 0.0]], Some(&["joint_values[5]: ", "lift is NaN"])),
        (&[[0.0, 0.0], [f64::INFINITY, 0.0]], Some(&["joint_values[8]: ", "lift is inf"])),
        (
            &[[0.0, 0.0], [-0.5, 0.0], [-2.0000001, 0.0]],
            Some(&["joint_values[11]: ", "lift is -2.0000001", "limits -2 to 2", "give a value within them"]),
        ),
        (&[[0.0, 0.0], [0.0, 0.2], [-2.0, 0.2]], None),
        (&[[0.0, 0.0], [0.0, -1e-8]], Some(&["joint_values[16]: ", "slide is -0.00000001", "limits 0 to"])),
    ];
    let question = MotionsQuestion::of_robot("one", []);
    let question =
        paths.iter().fold(question, |question, (path, _)| question.with_path(path.iter().map(|point| &point[..])));
    let found = client.check_motions("cell", question).await.expect("answered");
    for (motion, (path, why)) in found.motions.iter().zip(paths) {
        let expected = if why.is_some() { StateVerdict::Invalid } else { StateVerdict::Free };
        assert_eq!(motion.verdict, expected, "{path:?}");
        assert_eq!(is_blank(motion), why.is_some(), "{path:?}: {motion:?}");
        assert_eq!(motion.reason.is_some(), why.is_some(), "{path:?}: {motion:?}");
        let reason = motion.reason.as_deref().unwrap_or_default();
        let [starts, says @ ..] = why.unwrap_or(&[""]) else { panic!("{path:?}") };
        assert!(reason.starts_with(starts) && says.iter().all(|word| reason.contains(word)), "{path:?}: {reason}");
    }
    assert!(found.complete && found.motions.len() == paths.len());
    // Without an invalid path there are no reasons.
    let free = MotionsQuestion::of_robot("one", []).with_edges(paths[1].0);
    assert_eq!(client.check_motions("cell", free).await.expect("answered").motions[0].reason, None);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pair_that_is_open_before_the_first_contact_is_named() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // What is held moves on a circle with a radius of 1.3 m: half a radian on its way it passes a
    // ball at 0.2 mm, and at a right angle it meets another one.
    let thing = client.create_ball("thing", 0.05).await.expect("a ball");
    let beside = at(1.3 * 0.5_f64.sin(), 0.1002, 0.3 + 1.3 * 0.5_f64.cos());
    client
        .put_objects("cell", [("beside", &thing, beside), ("post", &thing, at(1.3, 0.0, 0.3))])
        .await
        .expect("placed");
    let ask = |resolution_m: f64| {
        let mut question = MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[QUARTER]]);
        let request = question.request_mut();
        (request.first_contact, request.resolution_m) = (true, Some(resolution_m));
        question
    };
    let coarse = client.check_motions("cell", ask(0.1)).await.expect("answered");
    let CheckedMotion { verdict, alpha, contact, open, .. } = coarse.motions[0].clone();
    let ((pair, s), (open_pair, open_s)) = (contact.expect("a contact"), open.expect("an open pair"));
    assert_eq!(verdict, StateVerdict::Contact);
    assert!(pair.contains(&"held".to_owned()) && pair.contains(&"post".to_owned()), "{pair:?}");
    assert!(open_pair.contains(&"held".to_owned()) && open_pair.contains(&"beside".to_owned()), "{open_pair:?}");
    assert!(alpha <= open_s && open_s < s && (open_s - 0.5 / QUARTER).abs() < 0.1, "{alpha} {open_s} {s}");
    let fine = client.check_motions("cell", ask(1e-4)).await.expect("answered");
    let CheckedMotion { alpha, contact, open, .. } = fine.motions[0].clone();
    let (pair, s) = contact.expect("a contact");
    assert!(open.is_none() && pair.contains(&"post".to_owned()) && s - alpha < 1e-3 && alpha > 0.9, "{alpha} {s}");
}

#[tokio::test(flavor = "multi_thread")]
async fn searches_that_may_not_look_closer_leave_paths_undecided() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // What is held stops 18 mm before the ball.
    let put = Update { poses: vec![("post".into(), at(1.3, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &put).await.expect("moved");
    let ask = || MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[1.48]]).with_certificates();
    let free = client.check_motions("cell", ask()).await.expect("answered");
    assert!(free.are_free() && free.complete && free.motions[0].certificate.is_some());
    let mut one = ask();
    one.request_mut().max_configurations = Some(1);
    let found = client.check_motions("cell", one).await.expect("answered");
    let motion = &found.motions[0];
    assert!(motion.verdict == StateVerdict::Undecided && motion.alpha == 0.0 && !found.complete, "{found:?}");
    assert!(motion.certificate.is_none());
    // What moves by less than 10 m is not looked at again: as far as the resolution it is decided.
    let mut coarse = ask();
    coarse.request_mut().resolution_m = Some(10.0);
    let found = client.check_motions("cell", coarse).await.expect("answered");
    let motion = &found.motions[0];
    assert!(motion.verdict == StateVerdict::Undecided && motion.alpha < 1.0 && found.complete, "{found:?}");
    let (pair, s) = motion.contact.clone().expect("the pair that is open");
    assert!(pair.iter().any(|name| name.starts_with("one/") || name == "held") && s == 0.5, "{pair:?} {s}");
    assert!(motion.certificate.is_none());
}

#[tokio::test(flavor = "multi_thread")]
async fn the_resolution_is_how_far_anything_moves_in_metres() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // What is held reaches 1.35 m from the joint and meets the ball on its way.
    let put = Update { poses: vec![("post".into(), at(1.3, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &put).await.expect("moved");
    for resolution_m in [1e-2, 1e-3, 1e-4, 1e-5] {
        let mut question = MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[QUARTER]]);
        let request = question.request_mut();
        (request.first_contact, request.resolution_m) = (true, Some(resolution_m));
        let found = client.check_motions("cell", question).await.expect("answered");
        let motion = &found.motions[0];
        let (_, s) = motion.contact.clone().expect("a contact");
        // Intervals are halved until nothing moves farther than that from their middle: they are
        // not more than twice too short. Three half intervals may lie between what is proven free
        // and the contact, some more where bounds are not sharp.
        let between_m = (s - motion.alpha) * QUARTER * 1.35;
        assert!(between_m > 0.49 * resolution_m && between_m < 5.0 * resolution_m, "{resolution_m}: {between_m}");
    }
}

/// A base that drives about, of a kind of joint with several values, and an arm on it that turns.
const CART: &str = r#"<robot name="cart">
  <link name="floor"/>
  <link name="base"><collision><geometry><sphere radius="0.2"/></geometry></collision></link>
  <link name="arm"><collision><origin xyz="0 0 0.5"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="drive" type="KIND"><parent link="floor"/><child link="base"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>"#;

/// A scene with the name of a kind of joint: the cart at the origin, and a ball at x = 1 m.
pub(super) async fn yard(client: &Client, kind: &str) -> StoredRobot {
    let source = RobotSource { urdf: CART.replace("KIND", kind), ..RobotSource::default() };
    let robot = client.load_robot(&source).await.expect("loaded");
    client.create_scene(kind).await.expect("made");
    client.place_robot(kind, &placement(&robot, "cart", 0.0)).await.expect("placed");
    let thing = client.create_ball("thing", 0.05).await.expect("a ball");
    client.put_objects(kind, [("post", &thing, at(1.0, 0.0, 0.0))]).await.expect("placed");
    robot
}

#[tokio::test(flavor = "multi_thread")]
async fn edges_of_planar_and_floating_joints_need_no_counts() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    let named = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
    // The ends of an edge through the ball, and those of one beside it.
    type Ends<'a> = [&'a [f64]; 4];
    let planar: Ends<'_> = [&[0.0; 3], &[2.0, 0.0, 0.0], &[0.0; 3], &[0.0, 1.0, 0.5]];
    let rest = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let floating: Ends<'_> = [&rest, &[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], &rest, &[0.0, 0.0, 2.0, 0.0, 0.0, 0.6, 0.8]];
    for (kind, ends) in [("planar", planar), ("floating", floating)] {
        yard(&client, kind).await;
        let ask = |names: &[&str], values: &[f64]| CheckMotionsRequest {
            scene: kind.into(),
            robot: "cart".into(),
            joints: named(names),
            joint_values: packed(values),
            cold: true,
            ..Default::default()
        };
        let lift = &[0.3][..];
        let cases: [(&[&str], Vec<f64>); 3] = [
            (&["drive"], ends.concat()),
            (&["lift", "drive"], ends.map(|drive| [lift, drive].concat()).concat()),
            (&[], ends.map(|drive| [drive, lift].concat()).concat()),
        ];
        for (names, values) in cases {
            let request = ask(names, &values);
            let counts: Vec<u8> = [2_u32; 2].into_iter().flat_map(u32::to_le_bytes).collect();
            let counted = CheckMotionsRequest { point_counts: counts.into(), ..request.clone() };
            let found = clients.queries.check_motions(request).await.expect("answered").into_inner();
            let counted = clients.queries.check_motions(counted).await.expect("answered").into_inner();
            assert_eq!(&found.verdicts[..], [Verdict::Contact as u8, Verdict::Free as u8], "{kind} {names:?}");
            assert_eq!(found, counted, "{kind} {names:?}");
        }
        let width = ends[0].len();
        for (names, count, field) in [
            (&["drive"][..], 0, "joint_values"),
            (&["drive"], width, "joint_values"),
            (&["drive"], 2 * width + 1, "joint_values"),
            (&["drive"], 3 * width, "joint_values"),
            (&["lift", "drive"], 2 * width, "joint_values"),
            (&[], 2 * width, "joint_values"),
            (&["drive", "drive"], 2 * width, "joints[1]"),
            (&["lift", "steer"], 2 * width, "joints[1]"),
        ] {
            refused(clients.queries.check_motions(ask(names, &vec![0.0; count])).await, field);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn states_of_planar_and_floating_joints_are_counted_by_their_values() {
    const MOST: usize = 1 << 16;
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    for (kind, state) in [("planar", &[0.0, 1.0, 0.5][..]), ("floating", &[0.0, 0.0, 2.0, 0.0, 0.0, 0.6, 0.8])] {
        yard(&client, kind).await;
        let ask = |joint: &str, count: usize| CheckStatesRequest {
            scene: kind.into(),
            robot: "cart".into(),
            joints: vec![joint.into()],
            joint_values: packed(&state.repeat(count)),
            ..Default::default()
        };
        let found = clients.queries.check_states(ask("drive", MOST)).await.expect("the limit itself is fine");
        let verdicts = found.into_inner().verdicts;
        assert_eq!(verdicts.len(), MOST, "{kind}");
        assert!(verdicts.iter().all(|&verdict| verdict == Verdict::Free as u8), "{kind}");
        let many = clients.queries.check_states(ask("drive", MOST + 1)).await;
        let status = refused_with(many, Code::ResourceExhausted, "joint_values");
        assert!(status.message().contains("max_states"), "{kind}: {}", status.message());
        // How many states there are is not known without the joint.
        refused(clients.queries.check_states(ask("steer", MOST)).await, "joints[0]");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn control_points_are_those_of_a_bezier_segment() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let put = Update { poses: vec![("post".into(), at(1.3, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &put).await.expect("moved");
    let ask = |peak: f64, kind: PathKind| {
        let path = [[0.0], [peak], [peak], [0.0]];
        let question = MotionsQuestion::of_robot("one", ["lift"]).with_path(path.iter().map(|point| &point[..]));
        let mut question = question.with_certificates();
        question.request_mut().kind = kind.into();
        question.request_mut().first_contact = true;
        question
    };
    // What is held and the ball are 1.3 m from the joint and touch where they are 0.1 m apart; the
    // curve rises to three quarters of its control points, the lines to all of them.
    let touch = QUARTER - 2.0 * (0.05_f64 / 1.3).asin();
    let found = client.check_motions("cell", ask(1.9, PathKind::Bezier)).await.expect("answered");
    assert!(0.75 * 1.9 < touch && found.are_free(), "{found:?}");
    let certificate = found.motions[0].certificate.clone().expect("a certificate");
    let question = CertificateQuestion::new(certificate).of_robot("cell", "one");
    assert!(client.verify_motion(question).await.expect("answered").holds());
    for (peak, kind, s) in [
        (2.0, PathKind::Bezier, 0.5 - (0.25 - touch / 6.0).sqrt()),
        (1.9, PathKind::Waypoints, touch / 1.9 / 3.0),
        (1.9, PathKind::Unspecified, touch / 1.9 / 3.0),
    ] {
        let found = client.check_motions("cell", ask(peak, kind)).await.expect("answered");
        let motion = &found.motions[0];
        let (pair, at) = motion.contact.clone().expect("a contact");
        assert!(["held", "post"].iter().all(|name| pair.contains(&(*name).to_owned())), "{pair:?}");
        assert_eq!(motion.verdict, StateVerdict::Contact);
        assert!(motion.alpha <= s && s <= at && at - motion.alpha < 1e-3, "{kind:?}: {} {s} {at}", motion.alpha);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_certificate_of_something_else_is_refused_with_what_differs() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let question = MotionsQuestion::of_robot("one", ["lift"]).with_path([&[0.0][..], &[-QUARTER]]).with_certificates();
    let found = client.check_motions("cell", question).await.expect("answered");
    let certificate = found.motions[0].certificate.clone().expect("a certificate");
    let of = |robot: &str| CertificateQuestion::new(certificate.clone()).of_robot("cell", robot);
    let holds = async || client.verify_motion(of("one")).await.expect("answered").proof.map(|_| ());
    let reason = async || holds().await.expect_err("it is of something else");
    assert_eq!(holds().await, Ok(()));
    // The other robot of the scene is the same, but elsewhere, and holds nothing.
    let other = client.verify_motion(of("two")).await.expect("answered").proof;
    assert!(other.expect_err("another place").contains("base pose"));
    let mut all = of("one");
    all.request_mut().include_allowed = true;
    let all = client.verify_motion(all).await.expect("answered").proof;
    assert!(all.expect_err("more pairs").contains("allowed pairs"));
    let base = |x: f64| Update { bases: vec![("one".into(), at(x, 0.0, 0.0))], ..Update::default() };
    let group = || Subject::Group("one".into());
    let allow = vec![(group(), Subject::Object("post".into()))];
    let padding = |padding| Update { group_paddings: vec![("one".into(), padding)], ..Update::default() };
    let changes = [
        (base(1e-9), base(0.0), "base pose"),
        (
            Update { allow: allow.clone(), ..Update::default() },
            Update { forbid: allow, ..Update::default() },
            "allowed pairs",
        ),
        (padding(Some(1e-3)), padding(None), "margin or padding"),
        (
            Update { poses: vec![("post".into(), at(3.0, 1e-9, 2.0))], ..Update::default() },
            Update { poses: vec![("post".into(), at(3.0, 0.0, 2.0))], ..Update::default() },
            "obstacles",
        ),
    ];
    for (change, back, word) in changes {
        client.update_scene("cell", &change).await.expect("changed");
        let reason = reason().await;
        assert!(reason.contains(word), "{word}: {reason}");
        client.update_scene("cell", &back).await.expect("changed back");
        assert_eq!(holds().await, Ok(()), "{word}");
    }
    // Where one of the limits is another, though the motion keeps within both; and where the hand
    // is of another body, which is smaller.
    let hand = robot.links.iter().find(|link| &*link.name == "hand").and_then(|link| link.body).expect("a body");
    let smaller = client.create_ball("hand", 0.09).await.expect("a ball");
    let source = |urdf: String, hand| RobotSource { urdf, srdf: SRDF.into(), bodies: [("hand".into(), hand)].into() };
    for (other, word) in [
        (source(URDF.replace("upper=\"2\"", "upper=\"2.1\""), hand), "another robot"),
        (source(URDF.into(), smaller), "another set of bodies"),
    ] {
        let other = client.load_robot(&other).await.expect("loaded");
        assert_ne!(other.id, robot.id, "{word}");
        client.delete_scene("cell").await.expect("deleted");
        cell(&client, &other).await;
        let reason = reason().await;
        assert!(reason.contains(word), "{word}: {reason}");
    }
    client.delete_scene("cell").await.expect("deleted");
    cell(&client, &robot).await;
    assert_eq!(holds().await, Ok(()), "the same scene made again");
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
    refused(status, "moving.names[0]");
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_that_cannot_move_are_refused_by_their_position() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let thing = client.create_ball("thing", 0.05).await.expect("a ball");
    let below = BodySource::HalfSpace { normal: nalgebra::Vector3::z(), offset: -20.0 };
    let floor = client.create_body("floor", below).await.expect("a half-space").id;
    let objects = [("other", &thing, at(6.0, 0.0, 0.0)), ("floor", &floor, at(0.0, 0.0, 0.0))];
    client.put_objects("cell", objects).await.expect("placed");
    let free = CheckMotionsRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joints: vec!["lift".into()],
        joint_values: packed(&[0.0, -0.5]),
        certificates: true,
        ..Default::default()
    };
    let found = clients.queries.check_motions(free.clone()).await.expect("answered").into_inner();
    assert_eq!(&found.verdicts[..], [Verdict::Free as u8]);
    let proof = VerifyMotionRequest {
        certificate: found.certificates[0].clone(),
        scene: "cell".into(),
        robot: "one".into(),
        ..Default::default()
    };

    let pose = |x: f64, w: f64| [x, 0.0, 5.0, 0.0, 0.0, 0.0, w];
    let (there, beyond) = (pose(6.0, 1.0), pose(1.1e15, 1.0));
    let (nan, infinite) = (pose(f64::NAN, 1.0), pose(f64::INFINITY, 1.0));
    let (no_turn, long) = (pose(6.0, f64::NAN), pose(6.0, 2.0));
    let moving = |names: &[&str], start: &[[f64; 7]], end: &[[f64; 7]]| MovingObjects {
        names: names.iter().map(|&name| name.into()).collect(),
        start_poses: packed(start.as_flattened()),
        end_poses: packed(end.as_flattened()),
    };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let two = ["post", "other"];
    let cases = [
        (moving(&["post"], &[nan], &[there]), invalid, "moving.start_poses[0]"),
        (moving(&two, &[there, infinite], &[there; 2]), invalid, "moving.start_poses[1]"),
        (moving(&two, &[there, no_turn], &[there; 2]), invalid, "moving.start_poses[1]"),
        (moving(&two, &[there, long], &[there; 2]), invalid, "moving.start_poses[1]"),
        (moving(&two, &[beyond, there], &[there; 2]), invalid, "moving.start_poses[0]"),
        (moving(&two, &[there, pose(6.0, 0.0)], &[there; 2]), invalid, "moving.start_poses[1]"),
        (moving(&two, &[there; 2], &[there, nan]), invalid, "moving.end_poses[1]"),
        (moving(&two, &[there; 2], &[long, there]), invalid, "moving.end_poses[0]"),
        (moving(&two, &[there], &[there; 2]), invalid, "moving.start_poses"),
        (moving(&two, &[there; 2], &[there; 3]), invalid, "moving.end_poses"),
        // Each may stand there, but no velocity of at most 1e15 leads from one to the other.
        (moving(&two, &[there, pose(-9e14, 1.0)], &[there, pose(9e14, 1.0)]), invalid, "moving.end_poses[1]"),
        (moving(&["post", "gone"], &[there; 2], &[there; 2]), missing, "moving.names[1]"),
        (moving(&["", "post"], &[there; 2], &[there; 2]), invalid, "moving.names[0]"),
        (moving(&["post", "other", "post"], &[there; 3], &[there; 3]), invalid, "moving.names[2]"),
        (moving(&["post", "post", "post"], &[there; 3], &[there; 3]), invalid, "moving.names[1]"),
        (moving(&["post", "held"], &[there; 2], &[there; 2]), invalid, "moving.names[1]"),
        (moving(&["one/hand"], &[there], &[there]), invalid, "moving.names[0]"),
        (moving(&["post", "two/arm"], &[there; 2], &[there; 2]), invalid, "moving.names[1]"),
        (moving(&["post", "floor"], &[there; 2], &[there; 2]), invalid, "moving.names[1]"),
    ];
    for (moving, code, at) in cases {
        let (check, verify) = (Some(moving.clone()), Some(moving));
        let check = CheckMotionsRequest { moving: check, ..free.clone() };
        refused_with(clients.queries.check_motions(check).await, code, at);
        let verify = VerifyMotionRequest { moving: verify, ..proof.clone() };
        refused_with(clients.queries.verify_motion(verify).await, code, at);
    }
    let both = || Some(moving(&two, &[there; 2], &[there; 2]));
    let check = || CheckMotionsRequest { moving: both(), ..free.clone() };
    let found = clients.queries.check_motions(check()).await.expect("answered").into_inner();
    assert_eq!(&found.verdicts[..], [Verdict::Free as u8]);
    // A half-space cannot be carried either: by what moves, or by the robot.
    let still = at(0.0, 0.0, 0.0);
    for (holder, at) in [("post", "moving.names[0]"), ("other", "moving.names[1]"), ("one/hand", "robot")] {
        let attach = Attach { name: "floor".into(), to: holder.into(), pose: Some(still), touch: vec![] };
        client.update_scene("cell", &Update { attach: vec![attach], ..Update::default() }).await.expect("held");
        refused(clients.queries.check_motions(check()).await, at);
    }
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
