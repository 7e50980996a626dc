//! Which pairs of links count, and paddings.

use std::sync::Arc;

use sublevel_scene::query::{JointValues, StateVerdict, States};
use sublevel_scene::{Crew, Scene, Subject, Update};
use sublevel_testkit::random::at;

use super::{applied, cell, set, slot, values};

fn allowed(scene: &Scene, a: &str, b: &str) -> bool {
    let of = |name: &str| slot(scene, &format!("arm/{name}"));
    assert_eq!(scene.is_allowed(of(a), of(b)), scene.is_allowed(of(b), of(a)));
    scene.is_allowed(of(a), of(b))
}

/// The verdict of the scene's own joint values, with the pair.
pub(super) fn verdict(scene: &Scene, margin_m: f64) -> (StateVerdict, Option<[String; 2]>) {
    let configuration = scene.robot("arm").expect("there").configuration().to_vec();
    let question = States::of_joints(
        scene.clone(),
        JointValues { robot: "arm", joints: &[], values: configuration },
        margin_m,
        false,
    )
    .expect("states");
    let crew = Crew::new(1).expect("threads");
    let answer = crew.ask(Arc::new(question), Arc::default()).expect("answered").concat().remove(0);
    let name = |slot| scene.object(slot).expect("there").name.to_string();
    (answer.verdict, answer.pair.map(|pair| pair.map(name)))
}

#[test]
fn neighbours_and_disabled_pairs_may_touch_and_no_others() {
    let scene = cell(&[("base", "wrist"), ("upper", "finger")]);
    let links = ["base", "upper", "fore", "wrist", "finger"];
    // The elbow between upper and fore is a frame.
    let may = [
        ("base", "upper"),
        ("upper", "fore"),
        ("fore", "wrist"),
        ("wrist", "finger"),
        ("base", "wrist"),
        ("upper", "finger"),
    ];
    for (index, a) in links.iter().enumerate() {
        for b in &links[index + 1..] {
            assert_eq!(allowed(&scene, a, b), may.contains(&(*a, *b)), "{a} {b}");
        }
    }
    assert_eq!(scene.rules().allowed().len(), 0, "these are derived");
    assert!(scene.is_allowed(slot(&scene, "tool"), slot(&scene, "arm/wrist")), "its holder");
    assert!(scene.is_allowed(slot(&scene, "tool"), slot(&scene, "arm/finger")), "a touch link");
    assert!(!scene.is_allowed(slot(&scene, "tool"), slot(&scene, "arm/fore")));
}

#[test]
fn self_collision_is_on_unless_it_is_allowed() {
    let scene = cell(&[]);
    assert_eq!(verdict(&scene, 0.0).0, StateVerdict::Free);
    // Folded back onto the upper arm.
    let folded = applied(&scene, &set("arm", values(&["bend"], &[3.0])));
    let (found, pair) = verdict(&folded, 0.0);
    assert_eq!(found, StateVerdict::Contact);
    assert!(pair.expect("a pair").iter().all(|name| name.starts_with("arm/") || name == "tool"));
    let group = || Subject::Group("arm".into());
    let allow = Update { allow: vec![(group(), group())], ..Update::default() };
    let (found, pair) = verdict(&applied(&folded, &allow), 0.0);
    assert_eq!(found, StateVerdict::Contact, "what is held is no link");
    assert!(pair.expect("a pair").contains(&"tool".to_owned()));
    let allow =
        Update { allow: vec![(group(), group()), (group(), Subject::Object("tool".into()))], ..Update::default() };
    assert_eq!(verdict(&applied(&folded, &allow), 0.0).0, StateVerdict::Free);
}

#[test]
fn paddings_of_the_group_of_links_and_of_a_link_count() {
    // The ball is 0.5 m above the upper end of the tool, at z = 1.35 + 0.05.
    let up = Update { poses: vec![("ball".into(), at(1.0, 0.0, 2.0))], ..Update::default() };
    let scene = applied(&cell(&[]), &up);
    assert_eq!(verdict(&scene, 0.499).0, StateVerdict::Contact, "links are near one another");
    let group = || Subject::Group("arm".into());
    let far =
        Update { allow: vec![(group(), group()), (group(), Subject::Object("tool".into()))], ..Update::default() };
    let scene = applied(&scene, &far);
    assert_eq!(verdict(&scene, 0.499).0, StateVerdict::Free);
    assert_eq!(verdict(&scene, 0.501).0, StateVerdict::Contact);
    // The finger ends at z = 1.16: 0.74 m below the ball.
    let padded = Update { group_paddings: vec![("arm".into(), Some(0.7))], ..Update::default() };
    let padded = applied(&scene, &padded);
    assert_eq!(verdict(&padded, 0.03).0, StateVerdict::Free);
    assert_eq!(verdict(&padded, 0.05).0, StateVerdict::Contact);
    let link = Update { object_paddings: vec![("arm/finger".into(), Some(0.0))], ..Update::default() };
    let link = applied(&padded, &link);
    assert_eq!(verdict(&link, 0.05).0, StateVerdict::Free, "its own padding replaces that of the group");
}
