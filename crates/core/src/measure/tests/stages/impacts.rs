//! Stages of times of impact.

use super::{Case, catalogue};
use crate::measure::solver::stages::{Stage, only};
use crate::measure::*;
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

/// What the distances and the supports of a search are found by.
const QUERIES: [Stage; 6] =
    [Stage::Follow, Stage::Seek, Stage::Newton, Stage::SupportTables, Stage::InteriorDistance, Stage::ProjectionSteps];

/// Who turns, and where the second body goes.
#[derive(Clone, Copy, Debug)]
enum Scene {
    FirstTurns,
    SecondTurns,
    /// Both turn, and the second leaves.
    Leaving,
}

fn motions(case: &Case, scene: Scene) -> [Motion; 2] {
    let mut random = Seeded(95_000 + case.seed);
    let spin = random.unit() * 2.0;
    let [start_a, start_b] = case.poses;
    let reach = case.a.circumscribed().radius + case.b.circumscribed().radius;
    let towards = start_a.translation() + random.unit() * (0.3 * reach) - start_b.translation();
    let (spins, velocity) = match scene {
        Scene::FirstTurns => ([spin, Vector3::zeros()], towards),
        Scene::SecondTurns => ([Vector3::zeros(), spin], towards),
        Scene::Leaving => ([spin * 0.1; 2], -towards * 10.0),
    };
    [
        Motion::new(start_a, Vector3::zeros(), spins[0], *start_a.translation()).unwrap(),
        Motion::new(start_b, velocity, spins[1], *start_b.translation()).unwrap(),
    ]
}

/// The share in percent of searches that end with an answer, the same as that of all stages, and
/// the mean number of queries.
fn answered(scene: Scene, domain: impl Fn(&Case) -> bool, stages: &[Stage]) -> (f64, f64) {
    let (mut answers, mut queries, mut cases) = (0, 0, 0);
    for case in catalogue().iter().filter(|case| domain(case)) {
        let [motion_a, motion_b] = motions(case, scene);
        let find = || time_of_impact(case.a, &motion_a, case.b, &motion_b, &ImpactOptions::new(1.5).unwrap());
        let all = find();
        let found = only(&[stages, &QUERIES].concat(), find);
        let label = format!("seed {}: {found:?} {all:?}", case.seed);
        assert_ne!(all.status, ImpactStatus::Stopped, "{label}");
        if found.status == ImpactStatus::Stopped {
            assert!(found.time <= all.time, "{label}");
        } else {
            assert_eq!(found.status, all.status, "{label}");
            assert!((found.time - all.time).abs() <= 1e-4, "{label}");
            answers += 1;
        }
        cases += 1;
        queries += found.queries;
    }
    assert!(cases >= 50, "{cases} cases");
    (100.0 * f64::from(answers) / f64::from(cases), f64::from(queries) / f64::from(cases))
}

#[test]
fn planes_prove_alone() {
    for (scene, stages, percent, most) in [
        (Scene::FirstTurns, &[][..], 0.0, 1.0),
        (Scene::FirstTurns, &[Stage::PlaneOfA], 99.0, 32.0),
        (Scene::FirstTurns, &[Stage::PlaneOfB], 99.0, 20.0),
        (Scene::SecondTurns, &[Stage::PlaneOfA], 99.0, 22.0),
        (Scene::SecondTurns, &[Stage::PlaneOfB], 99.0, 25.0),
        // Where one plane does not get far, the other does.
        (Scene::FirstTurns, &[Stage::PlaneOfA, Stage::PlaneOfB], 99.0, 17.0),
        (Scene::SecondTurns, &[Stage::PlaneOfA, Stage::PlaneOfB], 99.0, 15.0),
    ] {
        let (share, queries) = answered(scene, Case::is_apart, stages);
        println!("{scene:?} by {stages:?}: {share:.1} %, {queries:.1} queries");
        assert!(share >= percent && queries <= most, "{scene:?} by {stages:?}: {share} %, {queries} queries");
    }
}

#[test]
fn moving_balls_prove_alone() {
    let far = |case: &Case| {
        let apart = case.poses[1].translation() - case.poses[0].translation();
        apart.norm() > 1.2 * (case.a.circumscribed().radius + case.b.circumscribed().radius)
    };
    let (share, queries) = answered(Scene::Leaving, far, &[Stage::MovingBalls]);
    println!("leaving by balls: {share:.1} %, {queries:.1} queries");
    assert!(share >= 99.0 && queries <= 0.5, "{share} %, {queries} queries");
}
