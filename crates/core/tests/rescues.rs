//! The queries that commits name as rescued: their brackets are true by 200 bits and as narrow as
//! asked for, or where that is not reached yet their status says so.

use sublevel_core::body::Body;
use sublevel_core::measure::{Options, Pose, Status, WarmStart, distance, growth_distance, level_distance};
use sublevel_testkit::catalogue::rescues::{Ask, Place, Rescue, all};
use sublevel_testkit::reference::{self, growth};

/// Status, bracket, iterations, and whether 200 bits say that the truth is in the bracket.
type Found = (Status, [f64; 2], u32, bool);

fn solve(rescue: &Rescue, [a, b]: [Place; 2], warm: &mut WarmStart) -> Found {
    let [pose_a, pose_b] = [a, b].map(|(t, q)| Pose::from_quaternion(t.into(), q).unwrap());
    let (a, b, options) = (&rescue.a, &rescue.b, Options::default());
    match rescue.ask {
        Ask::Distance => {
            let found = distance(a, &pose_a, b, &pose_b, &options, warm);
            let truth = reference::distance(a, &pose_a, b, &pose_b, &found);
            (found.status, [found.lower, found.upper], found.iterations, truth.inside(&found))
        }
        Ask::Level => {
            let found = level_distance(a, &pose_a, b, &pose_b, &options, warm);
            let truth = reference::level_distance(a, &pose_a, b, &pose_b, &found);
            (found.status, [found.lower, found.upper], found.iterations, truth.inside(&found))
        }
        Ask::Growth => {
            let found = growth_distance(a, &pose_a, b, &pose_b, &options, warm);
            let normal = found.normal.expect("centres apart");
            let start = growth::Start { witness: found.witness, value: found.upper, normal };
            let center = |body: &Body| body.growth_ball().center;
            let truth = growth::growth_distance((a, &pose_a, &center(a)), (b, &pose_b, &center(b)), &start);
            let inside = truth.is_some_and(|truth| truth.inside(&found));
            (found.status, [found.lower, found.upper], found.iterations, inside)
        }
    }
}

/// Width of the bracket that is narrow enough.
fn tolerance(rescue: &Rescue, upper: f64) -> f64 {
    let small = rescue.a.circumscribed().radius.min(rescue.b.circumscribed().radius);
    let scale = if rescue.ask == Ask::Distance { small } else { upper.max(1.0) };
    Options::default().accuracy() * scale * (1.0 + 1e-12)
}

#[test]
fn rescued_queries_are_true_and_narrow() {
    let mut failed = Vec::new();
    for rescue in all() {
        let mut warm = WarmStart::default();
        if let Some(before) = rescue.before {
            solve(&rescue, before, &mut warm);
        }
        let (status, [lower, upper], iterations, inside) = solve(&rescue, rescue.at, &mut warm);
        println!("{}: {status:?} [{lower:e}, {upper:e}] after {iterations}", rescue.what);
        let narrow = upper - lower <= tolerance(&rescue, upper);
        let honest = narrow == (status == Status::Converged);
        let enough = upper - lower <= rescue.widest.unwrap_or(tolerance(&rescue, upper));
        if !(inside && honest && enough) {
            failed.push(format!("{}: {status:?} [{lower:e}, {upper:e}], true: {inside}", rescue.what));
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
