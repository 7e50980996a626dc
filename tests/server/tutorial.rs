//! The planner of the tutorial, `docs/planning.md`: what the page shows is what the example does,
//! and it plans.

mod picture;

use std::path::Path;
use std::process::{Command, Stdio};

use sublevel::client::{ClearanceQuestion, Client};
use sublevel_testkit::data;

use crate::harness::Running;
use crate::robots::CUBE;

#[allow(dead_code, unreachable_pub)]
#[path = "../../examples/robot.rs"]
mod robot;

/// An arm of seven joints that turn about z and y in turns, with the reach of a Panda: capsules,
/// and a cube for a hand, whose mesh is a file.
fn arm() -> String {
    let links = [0.2, 0.06, 0.2, 0.08, 0.25, 0.05, 0.08].iter().enumerate().map(|(index, length)| {
        format!(
            "<link name=\"link{index}\"><collision><origin xyz=\"0 0 {}\"/><geometry><capsule radius=\"0.05\" \
             length=\"{length}\"/></geometry></collision></link>",
            0.5 * length
        )
    });
    let heights = [0.2, 0.13, 0.06, 0.26, 0.08, 0.3, 0.1];
    let joints = heights.iter().enumerate().map(|(index, height)| {
        // What the Panda calls a positive angle bends its elbow and its wrist backwards.
        let axis = ["0 0 1", "0 1 0", "0 0 1", "0 -1 0", "0 0 1", "0 -1 0", "0 0 1"][index];
        let turned = if index == 5 { "0 3.14159265 0" } else { "0 0 0" };
        let parent = if index == 0 { "base".to_owned() } else { format!("link{}", index - 1) };
        format!(
            "<joint name=\"joint{index}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"link{index}\"/>\
             <origin xyz=\"0 0 {height}\" rpy=\"{turned}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    });
    format!(
        "<robot name=\"arm\"><link name=\"base\"><collision><geometry><box size=\"0.2 0.2 0.1\"/></geometry>\
         </collision></link>{}{}<link name=\"hand\"><collision><origin xyz=\"-0.05 -0.05 0\"/><geometry>\
         <mesh filename=\"hand.off\"/></geometry></collision></link><joint name=\"wrist\" type=\"fixed\">\
         <parent link=\"link6\"/><child link=\"hand\"/><origin xyz=\"0 0 0.1\"/></joint></robot>",
        links.collect::<String>(),
        joints.collect::<String>()
    )
}

/// Neighbours but one of the arm reach into each other at its short links.
const ARM_SRDF: &str = r#"<robot name="arm">
  <disable_collisions link1="base" link2="link1" reason="Never"/>
  <disable_collisions link1="link0" link2="link2" reason="Never"/>
  <disable_collisions link1="link1" link2="link3" reason="Never"/>
  <disable_collisions link1="link2" link2="link4" reason="Never"/>
  <disable_collisions link1="link3" link2="link5" reason="Never"/>
  <disable_collisions link1="link4" link2="link6" reason="Never"/>
  <disable_collisions link1="link5" link2="hand" reason="Never"/>
</robot>"#;

/// Lines without what they are indented by.
fn lines(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}

#[test]
fn the_tutorial_shows_the_example() {
    let read = |path: &str| std::fs::read_to_string(format!("{}/{path}", env!("CARGO_MANIFEST_DIR"))).expect("a text");
    let (page, example) = (read("docs/planning.md"), read("examples/robot.rs"));
    let example = lines(&example);
    let blocks: Vec<_> = page.split("```rust\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    for block in &blocks {
        let shown = lines(block);
        let is_there = example.windows(shown.len()).any(|window| window == shown);
        assert!(is_there && !shown.is_empty(), "examples/robot.rs does not hold what docs/planning.md shows:\n{block}");
    }
    assert!(blocks.len() > 2, "{} blocks", blocks.len());
    assert!(lines(blocks[0]).len() < 20, "the planner of the tutorial is no longer short");
}

/// Where a test finds the arguments of the example, a line each, when it runs as the example.
const ARGUMENTS: &str = "SUBLEVEL_TUTORIAL";

#[tokio::test(flavor = "multi_thread")]
async fn the_planner_of_the_tutorial_plans() {
    if let Ok(arguments) = std::env::var(ARGUMENTS) {
        let [url, urdf, srdf] = arguments.lines().collect::<Vec<_>>()[..] else { panic!("{arguments}") };
        return robot::run(url, urdf.as_ref(), srdf.as_ref()).await.expect("it runs");
    }
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let [urdf, srdf] = ["arm.urdf", "arm.srdf"].map(|name| dir.path().join(name));
    std::fs::write(&urdf, arm()).expect("written");
    std::fs::write(&srdf, ARM_SRDF).expect("written");
    std::fs::write(dir.path().join("hand.off"), CUBE).expect("written");
    plans(&server.url(), &urdf, &srdf).await;
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs SUBLEVEL_DATA"]
async fn the_planner_of_the_tutorial_plans_with_a_panda() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    plans(&server.url(), &data("panda/panda.urdf"), &data("panda/panda.srdf")).await;
}

/// What the example prints, in a process of its own.
fn printed(url: &str, urdf: &Path, srdf: &Path) -> String {
    let mut example = Command::new(std::env::current_exe().expect("this program"));
    example.args(["tutorial::the_planner_of_the_tutorial_plans", "--exact", "--nocapture"]);
    example.env(ARGUMENTS, format!("{url}\n{}\n{}", urdf.display(), srdf.display()));
    let done = example.stdin(Stdio::null()).output().expect("it runs");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).expect("text")
}

/// The example runs and prints the closest links, and its planner takes a path over the wall and
/// refuses the one through it.
async fn plans(url: &str, urdf: &Path, srdf: &Path) {
    let text = printed(url, urdf, srdf);
    let over = robot::plan(url, (urdf, srdf), "over", &robot::PATH).await.expect("planned");
    let through = [robot::PATH[0], robot::PATH[3]];
    let through = robot::plan(url, (urdf, srdf), "through", &through).await.expect("planned");
    assert!(over && !through, "{over} {through}");
    // For each of the four configurations the link that is nearest to the wall.
    let lines: Vec<&str> = text.lines().collect();
    let question = ClearanceQuestion::of_robot("arm", [], 2.0).with_configurations(&robot::PATH);
    let client = Client::connect(url).await.expect("the server answers");
    let near = client.clearance("over", question).await.expect("answered");
    let expected = near.states.iter().map(|state| {
        let pair = state.closest_to("wall").expect("the wall is near");
        assert!(pair.lower_m > 0.0 && pair.pair[0].starts_with("arm/") && pair.pair[1] == "wall", "{pair:?}");
        format!("{} and wall are {:.4} m apart", pair.pair[0], pair.lower_m)
    });
    let expected: Vec<_> = expected.collect();
    let apart: Vec<&str> = lines.iter().copied().filter(|line| line.ends_with(" m apart")).collect();
    assert_eq!((apart, expected.len()), (expected.iter().map(String::as_str).collect(), 4), "{text}");
    for line in ["states [Free, Free, Free, Free], edges [Free, Free, Free]", "the path is proven free"] {
        assert!(lines.contains(&line), "{line}: {text}");
    }
    let begins = ["the certificate holds, with 0.", "straight on: Contact, free up to 0.", "halfway arm/"];
    assert!(begins.iter().all(|begin| lines.iter().any(|line| line.starts_with(begin))), "{text}");
}
