//! Why states are in contact, and which pairs of links can touch, over the wire.

use std::future::pending;

use sublevel::client::{ExplainQuestion, ExplainedState, RobotPlacement};
use sublevel::robot::motion::PairClass;
use sublevel::scene::query::{Certainty, StateVerdict};
use sublevel::store::{DeriveRequest, DerivedLinkPair, RobotSource};

use super::{SRDF, URDF, at, cell, served};

#[tokio::test(flavor = "multi_thread")]
async fn contacts_are_explained_and_freed() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // What the hand holds meets the ball when the arm points along x.
    let update = sublevel::scene::Update { poses: vec![("post".into(), at(1.28, 0.0, 0.3))], ..Default::default() };
    client.update_scene("cell", &update).await.expect("moved");
    let quarter = std::f64::consts::FRAC_PI_2;
    let ask = |values: &[f64]| ExplainQuestion::of_robot("one", []).with_joint_values(values);
    let found = client.explain("cell", ask(&[quarter, 0.0])).await.expect("answered");
    assert_eq!(found.verdict, StateVerdict::Contact);
    let pair = found.pairs.iter().find(|pair| pair.pair.contains(&"post".to_owned())).expect("the ball");
    assert!(pair.is_contact && pair.upper_m < 0.0 && pair.normal.is_some(), "{pair:?}");
    assert_eq!(pair.certainty, Certainty::Certain, "balls are exact");
    assert!(pair.separation_m.expect("a length") >= -pair.upper_m);
    // What overlaps reaches into the other along the normal by the depth.
    let [deepest, other] = pair.witnesses_m.expect("points");
    let depth = (other - deepest).dot(&pair.normal.expect("a normal"));
    assert!(-depth >= pair.lower_m - 1e-9 && -depth <= pair.upper_m + 1e-9, "{pair:?}");
    assert_eq!(pair.joint_gradient.as_ref().map(Vec::len), Some(2));
    let freed = found.freed.expect("values");
    assert_eq!(freed.len(), 2);
    let after = client.explain("cell", ask(&freed)).await.expect("answered");
    assert_eq!((after.verdict, after.pairs.len(), after.freed), (StateVerdict::Free, 0, None));
    // The joints of the scene, and the same as a state of objects.
    let standing = client.explain("cell", ask(&[])).await.expect("answered");
    assert_eq!((standing.verdict, standing.revision), (StateVerdict::Free, after.revision));
    let pose = at(1.28, 0.0, 0.35);
    let held = || ExplainQuestion::new(["held"]);
    let found = client.explain("cell", held().with_poses(&[pose])).await.expect("answered");
    assert_eq!((found.verdict, &found.freed), (StateVerdict::Contact, &None));
    assert!(found.pairs.iter().all(|pair| pair.joint_gradient.is_none() && pair.pair[0] == "held"), "{found:?}");
    // A margin that reaches the other ball, 0.1 m away.
    let beside = held().with_poses(&[at(1.28, 0.0, 0.5)]);
    let verdict = |found: Result<ExplainedState, _>| found.expect("answered").verdict;
    assert_eq!(verdict(client.explain("cell", beside.clone()).await), StateVerdict::Free);
    assert_eq!(verdict(client.explain("cell", beside.with_margin(0.11)).await), StateVerdict::Contact);
    // What is not usable.
    let beyond = client.explain("cell", ask(&[0.0, 0.5])).await.expect("answered");
    let why = "joint_values: joint slide is 0.5, outside its limits 0 to 0.2; give a value within them";
    assert_eq!((beyond.verdict, beyond.reason.as_deref()), (StateVerdict::Invalid, Some(why)));
    assert_eq!((&found.reason, &standing.reason), (&None, &None));
    // What is no single state.
    let mut both = held().with_poses(&[pose]);
    both.request_mut().include_allowed = true;
    client.explain("cell", both).await.expect("answered");
    for (question, field) in [
        (held().with_poses(&[pose; 2]), "poses"),
        (held().with_poses(&[pose]).with_margin(f64::NAN), "margin_m"),
        (ExplainQuestion::of_robot("nobody", []), "robot"),
        (ExplainQuestion::of_robot("one", ["lift"]).with_joint_values(&[0.0, 0.1]), "joint_values"),
        (ask(&[0.0, 0.0]).with_poses(&[pose]), "robot"),
    ] {
        let error = client.explain("cell", question).await.expect_err(field);
        assert_eq!(error.field().as_deref(), Some(field), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pairs_of_links_are_derived_by_a_job() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    let asked = DeriveRequest { robot: robot.id, margin_m: 0.0, max_boxes: 5000, resolution_m: 1e-3 };
    let found = client.derive_allowed_pairs(&asked, |_| {}, pending()).await.expect("derived");
    assert_eq!(found.pairs.len(), 6, "four links with geometry");
    let pair = |a: &str, b: &str| {
        let is_pair = |pair: &&sublevel::store::DerivedLinkPair| pair.links == [a, b];
        found.pairs.iter().find(is_pair).expect("a pair").clone()
    };
    assert_eq!(pair("post", "arm").class, PairClass::Adjacent);
    let far = pair("post", "hand");
    assert_eq!((far.class, far.srdf_reason.as_deref()), (PairClass::Never, Some("Never")));
    assert!(far.upper_m.expect("a distance") > 0.0 && far.witness.is_none() && !far.contradicts_srdf());
    // Nearer than the margin the two are, and the SRDF is wrong.
    let near = DeriveRequest { margin_m: 1.0, ..asked };
    let found = client.derive_allowed_pairs(&near, |_| {}, pending()).await.expect("derived");
    let pair = found.pairs.iter().find(|pair| pair.links == ["post", "hand"]).expect("a pair");
    assert!(matches!(pair.class, PairClass::Collides | PairClass::Always), "{pair:?}");
    assert!(pair.contradicts_srdf(), "{pair:?}");
    for (bad, field) in [
        (DeriveRequest { margin_m: f64::INFINITY, ..asked }, "margin_m"),
        (DeriveRequest { max_boxes: 0, ..asked }, "max_boxes"),
        (DeriveRequest { max_boxes: u32::MAX, ..asked }, "max_boxes"),
        (DeriveRequest { resolution_m: 0.0, ..asked }, "resolution_m"),
        (DeriveRequest { resolution_m: f64::NAN, ..asked }, "resolution_m"),
        (DeriveRequest { robot: "0".repeat(64).parse().expect("an id"), ..asked }, "no robot"),
    ] {
        let error = client.derive_allowed_pairs(&bad, |_| {}, pending()).await.expect_err("refused").to_string();
        assert!(error.contains(field), "{field}: {error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_an_srdf_leaves_out_wrongly_is_found_with_a_witness() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    // The post is 1.8 m high, and the arm may swing its hand into it; of the finger and the arm the
    // SRDF says that they touch in the default state.
    let tall = URDF.replace("0.2 0.2 0.4", "0.2 0.2 1.8");
    let tall = tall.replace("lower=\"-2\" upper=\"2\"", "lower=\"-3.1\" upper=\"3.1\"");
    let default = "<disable_collisions link1=\"arm\" link2=\"finger\" reason=\"Default\"/></robot>";
    let hand = robot.links.iter().find(|link| &*link.name == "hand").and_then(|link| link.body).expect("a body");
    let bodies = [("hand".into(), hand)].into();
    let source = RobotSource { urdf: tall, srdf: SRDF.replace("</robot>", default), bodies };
    let robot = client.load_robot(&source).await.expect("loaded");
    let asked = DeriveRequest { robot: robot.id, margin_m: 0.0, max_boxes: 20_000, resolution_m: 1e-3 };
    let found = client.derive_allowed_pairs(&asked, |_| {}, pending()).await.expect("derived");
    let wrong: Vec<&DerivedLinkPair> = found.pairs.iter().filter(|pair| pair.contradicts_srdf()).collect();
    let [wrong] = &wrong[..] else { panic!("{:?}", found.pairs) };
    assert_eq!((&wrong.links, wrong.class), (&["post".to_owned(), "hand".to_owned()], PairClass::Collides));
    // How well the ball follows what the hand would be is not known.
    assert!(!wrong.is_certain && !wrong.is_proven() && wrong.srdf_reason.as_deref() == Some("Never"), "{wrong:?}");
    let right = found.pairs.iter().find(|pair| pair.srdf_reason.as_deref() == Some("Default")).expect("a pair");
    assert!(right.class == PairClass::Never && right.is_proven() && right.witness.is_none(), "{right:?}");
    // The finger can touch the post as well, which the SRDF does not leave out.
    let checked = found.pairs.iter().find(|pair| pair.links == ["post", "finger"]).expect("a pair");
    assert!(checked.class == PairClass::Collides && checked.srdf_reason.is_none(), "{checked:?}");

    // At the witness they are in contact by as much, which is said only where allowed pairs count.
    client.create_scene("tall").await.expect("made");
    client.place_robot("tall", &RobotPlacement::new("one", &robot)).await.expect("placed");
    let witness = wrong.witness.clone().expect("joint values");
    let ask = || ExplainQuestion::of_robot("one", []).with_joint_values(&witness);
    let names = ["one/post", "one/hand"].map(str::to_owned);
    let silent = client.explain("tall", ask()).await.expect("answered");
    assert!(silent.pairs.iter().all(|pair| pair.pair != names), "{silent:?}");
    let mut all = ask();
    all.request_mut().include_allowed = true;
    let found = client.explain("tall", all).await.expect("answered");
    let pair = found.pairs.iter().find(|pair| pair.pair == names).expect("the pair");
    let upper = wrong.upper_m.expect("a depth");
    assert!(pair.is_contact && pair.lower_m <= upper + 1e-9 && pair.upper_m < 0.99 * upper, "{pair:?} {upper}");
}
