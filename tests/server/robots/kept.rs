//! What of robots survives restarts and kills.

use sublevel::scene::Update;
use sublevel::service::proto::{
    DeleteSceneRequest, GetRobotRequest, GetSceneResponse, WatchSceneRequest, WatchSceneResponse,
};
use sublevel::store::RobotSource;
use tonic::Code;

use super::{ODD, ODD_SRDF, SRDF, URDF, at, cell, joints, served, source};
use crate::harness::Running;

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_loaded_once_and_described() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    assert!(robot.created && robot.name == "crane");
    let hand = clients.put(&crate::harness::ball(0.1)).await;
    let again = client.load_robot(&source(&hand)).await.expect("the same");
    assert!(!again.created && again.id == robot.id);
    let links: Vec<_> = robot.links.iter().map(|link| (link.name.as_str(), link.gap_m)).collect();
    let exact = Some(0.0);
    assert_eq!(links[..3], [("post", exact), ("arm", exact), ("flange", None)]);
    assert_eq!(robot.links[2].body, None, "a frame");
    assert_eq!(robot.links[3].body.map(|id| id.to_string()), Some(hand.clone()));
    assert_eq!(robot.links[4].parent.as_deref(), Some("hand"));
    let names: Vec<_> = robot.joints.iter().map(|joint| &*joint.name).collect();
    assert_eq!(names, ["lift", "slide"], "fixed and mimic joints have no values");
    assert_eq!(robot.joints[0].limits.map(|limits| (limits.lower, limits.upper)), Some((-2.0, 2.0)));
    assert_eq!(robot.groups[0].name, "all");
    let found = clients.robots.get_robot(GetRobotRequest { id: robot.id.to_string() }).await.expect("there");
    assert_eq!((found.get_ref().urdf.as_str(), found.get_ref().srdf.as_str()), (URDF, SRDF));
    // Bodies made of primitives are bodies like others.
    let arm = robot.links[1].body.expect("a body");
    assert!(client.body(&arm).await.is_ok());
    let refused = client.delete_body(&arm).await.expect_err("in use").to_string();
    assert!(refused.contains("a link of robot"), "{refused}");
    assert_eq!(client.list_robots().await.expect("listed").len(), 1);
    client.delete_robot(&robot.id).await.expect("deleted");
    client.delete_body(&arm).await.expect("free now");
    assert_eq!(client.robot(&robot.id).await.expect_err("gone").code(), Some(Code::NotFound));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_odd_in_an_srdf_is_said_whenever_the_robot_is_asked_for() {
    let dir = tempfile::tempdir().expect("a directory");
    let (server, client, mut clients, robot) = served(dir.path()).await;
    assert_eq!(robot.warnings, [""; 0]);
    let hand = robot.links[3].body.expect("a body").to_string();
    let odd = client.load_robot(&RobotSource { srdf: ODD_SRDF.into(), ..source(&hand) }).await.expect("loaded");
    assert_eq!(odd.warnings, ODD);
    let request = GetRobotRequest { id: odd.id.to_string() };
    let found = clients.robots.get_robot(request).await.expect("there").into_inner();
    assert_eq!(found.robot.expect("a robot").warnings, ODD);
    assert_eq!(found.srdf, ODD_SRDF);
    server.kill();
    let server = Running::start(dir.path());
    let client = server.client().await;
    assert_eq!(client.robot(&odd.id).await.expect("there").warnings, ODD);
    assert_eq!(client.robot(&robot.id).await.expect("there").warnings, [""; 0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_and_their_joints_survive_a_kill_and_a_backup() {
    let dir = tempfile::tempdir().expect("a directory");
    let (server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    client.set_joints("cell", "one", joints(&["lift"], &[0.7])).await.expect("set");
    let padding = Update {
        object_paddings: vec![("two/arm".into(), Some(0.01))],
        bases: vec![("two".into(), at(3.0, 0.5, 0.0))],
        ..Update::default()
    };
    client.update_scene("cell", &padding).await.expect("set");
    let last = client.set_joints("cell", "two", joints(&["slide", "lift"], &[0.1, -0.2])).await.expect("set");
    let before = clients.scene("cell").await;
    let mut file = Vec::new();
    client.backup(&mut file).await.expect("a backup");
    server.kill();

    let same = |found: &GetSceneResponse| {
        assert_eq!(found.scene.as_ref().map(|scene| scene.revision), Some(last));
        assert_eq!((&found.robots, &found.objects), (&before.robots, &before.objects));
    };
    let server = Running::start(dir.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    same(&clients.scene("cell").await);
    let refused = client.delete_robot(&robot.id).await.expect_err("in use");
    assert_eq!(refused.code(), Some(Code::FailedPrecondition));
    // It goes on from there.
    client.set_joints("cell", "one", joints(&["lift"], &[0.8])).await.expect("set");
    drop(server);

    let restored = tempfile::tempdir().expect("a directory");
    std::fs::write(restored.path().join("catalogue.redb"), file).expect("written");
    let server = Running::start(restored.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    same(&clients.scene("cell").await);
    clients.scenes.delete_scene(DeleteSceneRequest { name: "cell".into() }).await.expect("deleted");
    client.delete_robot(&robot.id).await.expect("deleted");
    drop(server);
    let server = Running::start(restored.path());
    assert_eq!(server.client().await.list_robots().await.expect("listed").len(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stored_scene_keeps_its_robot_from_being_deleted_and_forks_do() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    client.create_scene("empty").await.expect("made");
    client.fork_scene("empty", "fork").await.expect("a fork");
    client.place_robot("fork", &super::placement(&robot, "one", 0.0)).await.expect("placed");
    let refused = client.delete_robot(&robot.id).await.expect_err("in use").to_string();
    assert!(refused.contains("\"one\" of scene \"fork\""), "{refused}");
    clients.scenes.delete_scene(DeleteSceneRequest { name: "fork".into() }).await.expect("deleted");
    client.delete_robot(&robot.id).await.expect("deleted");
    let refused = client.place_robot("empty", &super::placement(&robot, "one", 0.0)).await.expect_err("gone");
    assert_eq!(refused.code(), Some(Code::NotFound));
}

#[tokio::test(flavor = "multi_thread")]
async fn watchers_get_robots_and_the_poses_of_their_links() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let request = WatchSceneRequest { scene: "cell".into(), ..Default::default() };
    let mut stream = clients.scenes.watch_scene(request).await.expect("a stream").into_inner();
    let first: WatchSceneResponse = stream.message().await.expect("a message").expect("whole");
    assert!(first.reset && first.complete);
    assert_eq!(first.robots.iter().map(|robot| robot.name.as_str()).collect::<Vec<_>>(), ["one", "two"]);
    let of = |robot: &str| first.objects.iter().filter(|o| o.object.as_ref().is_some_and(|o| o.robot == robot)).count();
    assert_eq!([of("one"), of("two")], [4, 4]);
    client.set_joints("cell", "one", joints(&["lift"], &[0.5])).await.expect("set");
    let moved = stream.message().await.expect("a message").expect("a change");
    assert!(!moved.reset && moved.complete);
    assert_eq!(moved.robots.len(), 1);
    // The arm, the hand, the finger and what the hand holds.
    assert_eq!(moved.moved.len(), 4 * 4);
    let refused = client.delete_robot(&robot.id).await.expect_err("in use");
    assert_eq!(refused.reason().as_deref(), Some("ROBOT_IN_USE"));
}
