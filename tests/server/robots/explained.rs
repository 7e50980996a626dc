//! Why states are in contact, and which pairs of links can touch, over the wire.

use std::future::pending;

use sublevel::client::SubmitError;
use sublevel::robot::motion::PairClass;
use sublevel::service::proto::{ExplainRequest, Verdict};
use sublevel::store::DeriveRequest;

use super::questions::packed;
use super::{at, cell, served};

#[tokio::test(flavor = "multi_thread")]
async fn contacts_are_explained_and_freed() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // What the hand holds meets the ball when the arm points along x.
    let update = sublevel::scene::Update { poses: vec![("post".into(), at(1.28, 0.0, 0.3))], ..Default::default() };
    client.update_scene("cell", &update).await.expect("moved");
    let quarter = std::f64::consts::FRAC_PI_2;
    let found = client.explain("cell", "one", [], &[quarter, 0.0], 0.0).await.expect("answered");
    assert_eq!(found.verdict(), Verdict::Contact);
    let pair = found.pairs.iter().find(|pair| [&pair.a, &pair.b].contains(&&"post".to_owned())).expect("the ball");
    assert!(pair.in_contact && pair.upper_m < 0.0 && pair.normal.is_some(), "{pair:?}");
    assert!(pair.separation_m.expect("a length") >= -pair.upper_m);
    assert_eq!(pair.joint_gradient.len(), 16);
    let freed: Vec<f64> = found.freed_joint_values.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    assert_eq!(freed.len(), 2);
    let after = client.explain("cell", "one", [], &freed, 0.0).await.expect("answered");
    assert_eq!((after.verdict(), after.pairs.len()), (Verdict::Free, 0));
    // The joints of the scene, and the same as a state of objects.
    assert_eq!(client.explain("cell", "one", [], &[], 0.0).await.expect("answered").verdict(), Verdict::Free);
    let pose = [1.28, 0.0, 0.35, 0.0, 0.0, 0.0, 1.0];
    let request = ExplainRequest {
        scene: "cell".into(),
        objects: vec!["held".into()],
        poses: packed(&pose),
        ..ExplainRequest::default()
    };
    let found = client.explain_state(request.clone()).await.expect("answered");
    assert_eq!((found.verdict(), found.freed_joint_values.is_empty()), (Verdict::Contact, true));
    // What is no single state.
    for (request, field) in [
        (ExplainRequest { poses: packed(&[pose, pose].concat()), ..request.clone() }, "poses"),
        (ExplainRequest { margin_m: f64::NAN, ..request.clone() }, "margin_m"),
        (ExplainRequest { robot: "one".into(), ..request.clone() }, "robot"),
        (ExplainRequest { scene: "cell".into(), robot: "nobody".into(), ..Default::default() }, "robot"),
        (
            ExplainRequest {
                scene: "cell".into(),
                robot: "one".into(),
                joints: vec!["lift".into()],
                joint_values: packed(&[0.0, 0.1]),
                ..Default::default()
            },
            "joint_values",
        ),
    ] {
        let error = client.explain_state(request).await.expect_err("refused").to_string();
        assert!(error.contains(field), "{field}: {error}");
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
    // One that would take minutes is cancelled at once.
    let long = DeriveRequest { max_boxes: 10_000_000, resolution_m: 1e-12, margin_m: near.margin_m - 0.5, ..asked };
    let begun = std::time::Instant::now();
    let cancelled = client.derive_allowed_pairs(&long, |_| {}, std::future::ready(())).await;
    let took = begun.elapsed();
    assert!(matches!(cancelled, Err(SubmitError::Cancelled)) || took.as_secs() < 5, "{cancelled:?} {took:?}");
}
