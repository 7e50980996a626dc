//! What each stage of a search is there for, counted by the files of the bench: no bracket is wrong
//! without it. The table of docs/numerics.md is made by `sublevel-bench ablation`.

use std::ops::ControlFlow;
use sublevel_testkit::random::draws as few_or_many;

/// What the files of the bench take from this crate.
mod library {
    pub(super) use crate::body::Body;
    pub(super) use crate::measure::solver::stages::{Stage, asked, except};
    pub(super) use crate::measure::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use std::collections::BTreeMap;
    use std::sync::Mutex;

    pub(super) fn pose(translation: Vector3<f64>, rotation: &UnitQuaternion<f64>) -> Pose {
        Pose::from_quaternion(translation, rotation.coords.into()).unwrap()
    }

    pub(super) fn shifted(from: &Pose, by: Vector3<f64>) -> Pose {
        pose(from.translation() + by, from.rotation())
    }

    pub(super) fn turned(from: &Pose, by: Vector3<f64>) -> Pose {
        pose(*from.translation(), &(UnitQuaternion::from_scaled_axis(by) * from.rotation()))
    }

    /// The body of that file, read once.
    pub(super) fn own(json: &str) -> &'static Body {
        static BODIES: Mutex<BTreeMap<String, &'static Body>> = Mutex::new(BTreeMap::new());
        let mut bodies = BODIES.lock().unwrap();
        bodies.entry(json.to_owned()).or_insert_with(|| Box::leak(Box::new(Body::from_json(json).unwrap())))
    }
}

#[path = "../../../../bench/src/ablation/counted/mod.rs"]
mod counted;

use counted::{Others, Table, bodies, draws, families, rescues};

fn print(what: &str, table: &Table) {
    let Table { queries, unsure, iterations, worst, seconds, .. } = table;
    println!("{what}: {queries} queries, {unsure} unsure, {iterations} iterations, worst {worst}, {seconds:.1} s");
    for stage in &library::Stage::ALL {
        let row = table.row(*stage);
        println!(
            "{stage:?}: {} asked, {} rescued, {} wrong, iterations {:?}, worst {:?}, time {:.3}; {:?}",
            row.asked,
            row.rescued,
            row.wrong,
            row.iterations,
            row.worst,
            table.ratio(*stage),
            row.first
        );
    }
}

#[test]
fn no_bracket_is_wrong_without_a_stage() {
    let count = few_or_many(2_000);
    let bodies = bodies();
    let (mut distances, mut others, mut of_families, mut of_rescues) = Default::default();
    let mut go_on = |_: u64| ControlFlow::Continue(());
    let _ = draws(&mut distances, &bodies, Others::No, (1, count), &mut go_on);
    let _ = draws(&mut others, &bodies, Others::Yes, (1, count / 2), &mut go_on);
    families(&mut of_families, if count > 100_000 { 700 } else { 10 });
    rescues(&mut of_rescues);
    let all = [("draws", distances), ("other questions", others), ("families", of_families), ("rescues", of_rescues)];
    for (what, table) in &all {
        print(what, table);
    }
    for (what, table) in &all {
        for (stage, row) in &table.rows {
            assert_eq!(row.wrong, 0, "{what}, without {stage:?}: {:?}", row.first);
        }
    }
}
