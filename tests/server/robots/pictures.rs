//! `sublevel scene place` and `sublevel scene show --svg`.

use std::path::Path;

use super::{at, cell, served};
use crate::harness::run;

/// Runs `sublevel scene`; standard output, or standard error where it fails.
fn scene(url: &str, args: &[&str]) -> Result<String, String> {
    let done = run(&[&["scene"], args, &["--server", url]].concat());
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    if done.status.success() { Ok(text(done.stdout)) } else { Err(text(done.stderr)) }
}

fn svg(file: &Path) -> String {
    std::fs::read_to_string(file).expect("a picture")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_placed_and_drawn_in_some_states() {
    let dir = tempfile::tempdir().expect("a directory");
    let (server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let url = server.url();
    let id = robot.id.to_string();
    let placed = ["place", "cell", "three", "--robot", &id, "--base", "-3,0,0", "--joints", "0.5,0.1"];
    assert!(scene(&url, &placed).expect("placed").starts_with("revision "));
    let robots = client.scene("cell").await.expect("a scene").robots;
    assert_eq!((robots["three"].base, &robots["three"].joints.values[..]), (at(-3.0, 0.0, 0.0), &[0.5, 0.1][..]));

    // As it stands: everything in one colour.
    let file = dir.path().join("cell.svg");
    let name = file.to_str().expect("text");
    let table = scene(&url, &["show", "cell", "--svg", name]).expect("drawn");
    assert!(table.contains("three/hand"), "{table}");
    let standing = svg(&file);
    // Of each of the three robots four links, one of which is a capsule: a cylinder and two balls.
    let pieces = 3 + 3;
    // Three views of these, of the ball and of the one that is held.
    let count = 3 * (3 * pieces + 2);
    assert_eq!((standing.matches("<path opacity").count(), standing.matches("<circle").count()), (count, 0));

    // In two states: what moves is drawn twice, and where it is nearest is marked.
    let before = client.scene("cell").await.expect("a scene");
    let states = ["show", "cell", "--svg", name, "--state", "one=0.4,0", "--state", "one=-1.2,0.1"];
    scene(&url, &states).expect("drawn");
    let drawn = svg(&file);
    assert_eq!(drawn.matches("<path opacity").count(), 3 * (2 * pieces + 1), "what stands");
    assert_eq!(drawn.matches("fill-opacity=\"0.12\"").count(), 2 * 3 * (pieces + 1), "links and what the hand holds");
    assert_eq!(drawn.matches("<circle").count(), 2 * 3 * 2, "two states, three views, two ends");
    let ask = sublevel::client::ClearanceQuestion::of_robot("one", [], 9.0).with_joint_values(&[0.4, 0.0]);
    let near = client.clearance("cell", ask).await.expect("answered").states.remove(0).near;
    let of_one = |name: &str| name.starts_with("one/") || name == "held";
    let others = near.iter().filter(|near| !near.pair.iter().all(|name| of_one(name)));
    let least = others.map(|near| near.upper_m).fold(f64::INFINITY, f64::min);
    assert!(drawn.contains(&format!(", {least:.3} m</text>")), "{least} is not in the legend");
    // The scene is as it was, and no fork is left.
    let after = client.scene("cell").await.expect("a scene");
    assert_eq!((after.revision, after.objects), (before.revision, before.objects));
    assert_eq!(client.list_scenes().await.expect("a list").len(), 1);

    for (args, word) in [
        (&["show", "cell", "--svg", name, "--state", "four=0,0"][..], "four"),
        (&["show", "cell", "--svg", name, "--state", "one=0"], "joint"),
        (&["show", "cell", "--svg", name, "--state", "one=0,x"], "not a number"),
        (&["show", "cell", "--svg", name, "--state", "one"], "NAME=V,V"),
        (&["show", "cell", "--state", "one=0,0"], "--svg"),
        (&["show", "nowhere", "--svg", name], "nowhere"),
        (&["place", "cell", "four", "--robot", &"0".repeat(64)], "robot"),
        (&["place", "cell", "four", "--robot", &id, "--joints", "1"], "joint"),
    ] {
        let refused = scene(&url, args).expect_err(word);
        assert!(refused.contains(word), "{args:?}: {refused}");
    }
    let five: Vec<&str> = ["show", "cell", "--svg", name].into_iter().chain(["--state", "one=0,0"].repeat(5)).collect();
    assert!(scene(&url, &five).expect_err("five").contains("takes 4"));
    assert_eq!(client.list_scenes().await.expect("a list").len(), 1, "no fork is left of what failed");
}
