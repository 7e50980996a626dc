//! Grouping the obstacles of real planning scenes into fewer bodies.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::{BasicSet, Body, Obstacle};
use sublevel_fit::{EncloseOptions, group};
use sublevel_testkit::data;

fn number(value: &Value, index: usize) -> f64 {
    value[index].as_f64().expect("the scenes hold numbers")
}

/// A box (full sides) or cylinder (height and radius, axis z) where it stands.
fn obstacle(value: &Value) -> Body {
    let (name, sizes) = (value["id"].as_str().expect("obstacles have names"), &value["dims"]);
    let body = if value["type"] == "box" {
        Body::cuboid(name, Vector3::from_fn(|i, _| 0.5 * number(sizes, i)))
    } else {
        Body::cylinder(name, number(sizes, 1), 0.5 * number(sizes, 0))
    };
    let turn = &value["quat"];
    let turn = Quaternion::new(number(turn, 3), number(turn, 0), number(turn, 1), number(turn, 2));
    let place = Vector3::from_fn(|i, _| number(&value["pos"], i));
    body.and_then(|body| body.moved(&UnitQuaternion::from_quaternion(turn), &place)).expect("obstacles are bodies")
}

/// Bodies before and after, and the total volumes.
fn grouped(problem: usize, degree: usize, max_growth: f64) -> (usize, usize, f64) {
    let path = data("panda/panda_problems.json");
    let text = std::fs::read_to_string(path).expect("the scenes are readable");
    let scenes: Value = serde_json::from_str(&text).expect("the scenes are JSON");
    let scene = &scenes["problems"][problem];
    let bodies: Vec<Body> =
        scene["obstacles"].as_array().expect("scenes have obstacles").iter().map(obstacle).collect();
    let start = Instant::now();
    let options = EncloseOptions::new(degree);
    let obstacles: Vec<Obstacle> = bodies.iter().cloned().map(Into::into).collect();
    let groups =
        group(&obstacles, max_growth, &options, &mut |_| ControlFlow::Continue(())).expect("the scene is grouped");
    let seconds = start.elapsed().as_secs_f64();
    let mut members: Vec<usize> = groups.iter().flat_map(|group| group.members.iter().copied()).collect();
    members.sort_unstable();
    assert!(members.into_iter().eq(0..bodies.len()), "every obstacle is in one group");
    let (mut before, mut after) = (0.0, 0.0);
    for group in &groups {
        let volume: f64 = group.members.iter().map(|&i| bodies[i].volume().volume_m3).sum();
        before += volume;
        after += group.cover.body().volume().volume_m3;
        let Some(enclosure) = group.cover.enclosure() else { continue };
        // From the stored numbers alone.
        let again = Body::from_json(&enclosure.body.to_json()).expect("the stored body is proven");
        for (set, &i) in again.sets().iter().zip(&group.members) {
            let proof = set.containment.prove(&BasicSet::from(&again), &BasicSet::from(&bodies[i]));
            proof.unwrap_or_else(|error| panic!("{}: {error}", bodies[i].name()));
            assert!(bodies[i].boundary().iter().all(|x| again.value(x) <= 1.0));
        }
    }
    println!(
        "{} {}, degree {degree}, growth {max_growth}: {} bodies of {before:.4} m³ in {} of {after:.4} m³ ({:+.0} %), {seconds:.1} s",
        scene["set"],
        problem,
        bodies.len(),
        groups.len(),
        100.0 * (after / before - 1.0)
    );
    (bodies.len(), groups.len(), after / before - 1.0)
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn a_shelf_of_cans_becomes_fewer_bodies() {
    for (degree, growth) in [(4, 0.2), (4, 1.0)] {
        let (before, after, added) = grouped(100, degree, growth);
        assert!(after < before && added <= growth + 1e-9);
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn a_table_with_objects_becomes_fewer_bodies() {
    for (degree, growth) in [(4, 0.2), (4, 1.0)] {
        let (before, after, added) = grouped(500, degree, growth);
        assert!(after < before && added <= growth + 1e-9);
    }
}
