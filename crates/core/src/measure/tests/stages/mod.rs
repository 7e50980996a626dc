//! Each stage of a search, alone, on a catalogue of pairs: a stage that is broken fails here, while
//! in use the next one would take its place.
//!
//! What a stage alone has to solve is what it is there for: smooth bodies for continuation, bodies
//! with edges for active sets, overlaps for the deepest points. The shares required are a little
//! below those reached, which each failure prints.

mod batches;
mod casts;
mod depths;
mod impacts;

use super::{Zoo, random_pose, zoo};
use crate::body::Body;
use crate::measure::solver::stages::{Stage, except, only};
use crate::measure::*;
use nalgebra::Vector3;
use std::sync::OnceLock;
use sublevel_testkit::Seeded;

/// One pair of the catalogue, apart or overlapping, with the answers of all stages together.
struct Case {
    seed: u64,
    a: &'static Body,
    b: &'static Body,
    poses: [Pose; 2],
    /// The second pose a little later: 1 % of the smaller body's size away.
    next: Pose,
    distance: Distance,
    next_distance: Distance,
}

impl Case {
    fn new(seed: u64) -> Self {
        static ZOOS: OnceLock<Vec<Zoo>> = OnceLock::new();
        let zoos = ZOOS.get_or_init(|| (0..6).map(|seed| zoo(&mut Seeded(90_000 + seed))).collect());
        let mut random = Seeded(91_000 + seed);
        let bodies = &zoos[seed as usize % zoos.len()];
        let i = random.next() as usize % bodies.len();
        let j = (i + 1 + random.next() as usize % (bodies.len() - 1)) % bodies.len();
        let (a, b) = (&bodies[i], &bodies[j]);
        let reach = a.circumscribed().radius + b.circumscribed().radius;
        let far = reach * 2_f64.powf(1.5 * random.signed());
        let poses = [random_pose(&mut random, 0.0), random_pose(&mut random, far)];
        let step = random.unit() * (0.01 * a.circumscribed().radius.min(b.circumscribed().radius));
        let next = poses[1].with_translation(poses[1].translation() + step);
        let to = |pose: &Pose| distance(a, &poses[0], b, pose, &Options::default(), &mut WarmStart::default());
        let (distance, next_distance) = (to(&poses[1]), to(&next));
        Self { seed, a, b, poses, next, distance, next_distance }
    }

    fn is_smooth(&self) -> bool {
        self.a.is_smooth() && self.b.is_smooth()
    }

    fn is_apart(&self) -> bool {
        self.distance.lower > 1e-3 * self.size() && self.next_distance.lower > 0.0
    }

    fn overlaps(&self) -> bool {
        self.distance.upper == 0.0
    }

    /// Radius of the smaller body, metres.
    fn size(&self) -> f64 {
        self.a.circumscribed().radius.min(self.b.circumscribed().radius)
    }
}

fn catalogue() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| (0..400).map(Case::new).collect())
}

/// How a solve ended, its bracket, and that of all stages.
type Found = (Status, [f64; 2], [f64; 2]);

/// How many percent of the cases that `domain` takes `solve` solves: a converged bracket that meets
/// the one of all stages. A bracket that does not meet it fails at once.
fn solved(what: &str, domain: impl Fn(&Case) -> bool, solve: impl Fn(&Case) -> Found) -> f64 {
    let (mut cases, mut done) = (0, 0);
    for case in catalogue().iter().filter(|case| domain(case)) {
        let (status, [lower, upper], [least, most]) = solve(case);
        let label = format!("{what}, seed {}: {}-{}", case.seed, case.a.name(), case.b.name());
        assert!(lower <= most && least <= upper, "{label}: [{lower}, {upper}] for [{least}, {most}]");
        cases += 1;
        done += u32::from(status == Status::Converged);
    }
    assert!(cases >= 30, "{what}: only {cases} cases");
    100.0 * f64::from(done) / f64::from(cases)
}

#[track_caller]
fn at_least(what: &str, percent: f64, solved: f64) {
    println!("{what}: {solved:.1} % solved alone");
    assert!(solved >= percent, "{what}: {solved:.1} % solved alone, {percent} expected");
}

fn cold_distance(case: &Case, stages: &[Stage]) -> Found {
    let [pose_a, pose_b] = &case.poses;
    let mut warm = WarmStart::default();
    let found = only(stages, || distance(case.a, pose_a, case.b, pose_b, &Options::default(), &mut warm));
    (found.status, [found.lower, found.upper], [case.distance.lower, case.distance.upper])
}

/// From the hint of all stages at the pose before, but for closed forms and Newton's method with
/// active sets, whose hints are their own.
fn warm_distance(case: &Case, stages: &[Stage]) -> Found {
    let (pose_a, options, mut warm) = (&case.poses[0], Options::default(), WarmStart::default());
    let general = [Stage::ClosedForm, Stage::Edges];
    except(&general, || distance(case.a, pose_a, case.b, &case.poses[1], &options, &mut warm));
    let found = only(stages, || distance(case.a, pose_a, case.b, &case.next, &options, &mut warm));
    (found.status, [found.lower, found.upper], [case.next_distance.lower, case.next_distance.upper])
}

#[test]
fn nothing_is_solved_by_no_stage() {
    let alone = solved("nothing", Case::is_apart, |case| cold_distance(case, &[]));
    assert!(alone == 0.0, "{alone} % solved without a stage");
}

#[test]
fn continuation_follows_alone() {
    let domain = |case: &Case| case.is_smooth() && case.is_apart();
    at_least("follow", 97.0, solved("follow", domain, |case| warm_distance(case, &[Stage::Follow])));
}

#[test]
fn continuation_seeks_alone() {
    let domain = |case: &Case| case.is_smooth() && case.is_apart();
    at_least("seek", 65.0, solved("seek", domain, |case| cold_distance(case, &[Stage::Seek])));
}

#[test]
fn active_sets_follow_alone() {
    let domain = |case: &Case| !case.is_smooth() && case.is_apart();
    at_least("Newton", 77.0, solved("Newton", domain, |case| warm_distance(case, &[Stage::Newton])));
}

/// Boxes and cylinders as bodies of several constraints.
#[test]
fn edges_solve_alone() {
    let domain = |case: &Case| !case.is_smooth() && case.is_apart();
    at_least("edges", 70.0, solved("edges", domain, |case| cold_distance(case, &[Stage::Edges])));
}

#[test]
fn support_tables_start_newton() {
    let stages = [Stage::SupportTables, Stage::Newton];
    let domain = |case: &Case| !case.is_smooth() && case.is_apart();
    at_least("GJK and Newton", 95.0, solved("GJK and Newton", domain, |case| cold_distance(case, &stages)));
}

#[test]
fn support_tables_start_quadratic_programs() {
    let stages = [Stage::SupportTables, Stage::Ray];
    let domain = |case: &Case| !case.is_smooth() && case.is_apart();
    at_least("GJK and rays", 24.0, solved("GJK and rays", domain, |case| cold_distance(case, &stages)));
}

#[test]
fn interior_points_find_distances_alone() {
    let stages = [Stage::InteriorDistance];
    at_least("interior", 97.0, solved("interior", Case::is_apart, |case| cold_distance(case, &stages)));
}

/// Overlaps by a thousandth of the smaller body, where the tables of support points have no point
/// in common.
#[test]
fn deepest_points_decide_overlaps_alone() {
    let share = |domain: &dyn Fn(&Case) -> bool, stages: &[Stage]| {
        let (mut cases, mut done) = (0, 0);
        for case in catalogue().iter().filter(|case| case.is_apart() && domain(case)) {
            let Some(n) = case.distance.normal else { continue };
            let into = n * (case.distance.upper + 1e-3 * case.size());
            let pose = case.poses[1].with_translation(case.poses[1].translation() + into);
            let to = || distance(case.a, &case.poses[0], case.b, &pose, &Options::default(), &mut WarmStart::default());
            let (found, all) = (only(stages, to), to());
            assert!(all.upper == 0.0 && found.lower == 0.0, "seed {}: {found:?} {all:?}", case.seed);
            cases += 1;
            done += u32::from(found.upper == 0.0);
        }
        assert!(cases >= 30, "{cases} cases");
        100.0 * f64::from(done) / f64::from(cases)
    };
    let (smooth, edged) = (|case: &Case| case.is_smooth(), |case: &Case| !case.is_smooth());
    let tables = [share(&smooth, &[Stage::SupportTables]), share(&edged, &[Stage::SupportTables])];
    println!("tables alone: {tables:?} %");
    let stages = [Stage::SupportTables, Stage::Deepest];
    at_least("deepest, smooth", 97.0, share(&smooth, &stages));
    at_least("deepest, edged", 97.0, share(&edged, &stages));
    at_least("deepest by interior points, smooth", 97.0, share(&smooth, &[Stage::InteriorLevel]));
    at_least("deepest by interior points, edged", 97.0, share(&edged, &[Stage::InteriorLevel]));
}

/// Double-double arithmetic solves what doubles leave wide: an accuracy that no bracket of theirs
/// has.
#[test]
fn refinement_goes_on_alone() {
    let options = Options::default().with_accuracy(1e-15).unwrap();
    let with = |stages: &[Stage], case: &Case| {
        let [pose_a, pose_b] = &case.poses;
        only(stages, || distance(case.a, pose_a, case.b, pose_b, &options, &mut WarmStart::default()))
    };
    let (mut cases, mut narrower) = (0, 0);
    for case in catalogue().iter().filter(|case| case.is_apart()).take(100) {
        let doubles = with(&[Stage::SupportTables, Stage::Newton], case);
        let refined = with(&[Stage::SupportTables, Stage::Newton, Stage::Refinement], case);
        if doubles.upper - doubles.lower < 1e-9 * case.size() && doubles.status != Status::Converged {
            cases += 1;
            narrower += u32::from(refined.upper - refined.lower < 0.5 * (doubles.upper - doubles.lower));
        }
    }
    println!("refinement: {narrower} of {cases} narrower");
    assert!(cases >= 20 && 10 * narrower >= 9 * cases, "{narrower} of {cases}");
}

#[test]
fn stages_of_level_distances_solve_alone() {
    let truth = |case: &Case, pose: &Pose| {
        level_distance(case.a, &case.poses[0], case.b, pose, &Options::default(), &mut WarmStart::default())
    };
    let cold = |case: &Case, stages: &[Stage]| {
        let [pose_a, pose_b] = &case.poses;
        let mut warm = WarmStart::default();
        let found = only(stages, || level_distance(case.a, pose_a, case.b, pose_b, &Options::default(), &mut warm));
        let all = truth(case, pose_b);
        (found.status, [found.lower, found.upper], [all.lower, all.upper])
    };
    let warm = |case: &Case, stages: &[Stage]| {
        let (pose_a, options, mut warm) = (&case.poses[0], Options::default(), WarmStart::default());
        level_distance(case.a, pose_a, case.b, &case.poses[1], &options, &mut warm);
        let found = only(stages, || level_distance(case.a, pose_a, case.b, &case.next, &options, &mut warm));
        let all = truth(case, &case.next);
        (found.status, [found.lower, found.upper], [all.lower, all.upper])
    };
    let smooth = |case: &Case| case.is_smooth() && case.is_apart();
    let edged = |case: &Case| !case.is_smooth() && case.is_apart();
    at_least("level follow", 95.0, solved("level follow", smooth, |case| warm(case, &[Stage::Follow])));
    at_least("level seek", 95.0, solved("level seek", smooth, |case| cold(case, &[Stage::Seek])));
    // Of bodies with edges, too, many minimisers lie on smooth parts, where continuation follows.
    at_least("level Newton", 55.0, solved("level Newton", edged, |case| warm(case, &[Stage::Newton])));
    let stages = [Stage::Follow, Stage::Newton];
    at_least("level follow, edged", 95.0, solved("level follow, edged", edged, |case| warm(case, &stages)));
    let stages = [Stage::SupportTables, Stage::Newton];
    at_least("level GJK", 95.0, solved("level GJK", edged, |case| cold(case, &stages)));
    let stages = [Stage::InteriorLevel];
    at_least("level interior", 95.0, solved("level interior", Case::is_apart, |case| cold(case, &stages)));
}

#[test]
fn stages_of_growth_distances_solve_alone() {
    let truth = |case: &Case, pose: &Pose| {
        growth_distance(case.a, &case.poses[0], case.b, pose, &Options::default(), &mut WarmStart::default())
    };
    let cold = |case: &Case, stages: &[Stage]| {
        let [pose_a, pose_b] = &case.poses;
        let mut warm = WarmStart::default();
        let found = only(stages, || growth_distance(case.a, pose_a, case.b, pose_b, &Options::default(), &mut warm));
        let all = truth(case, pose_b);
        (found.status, [found.lower, found.upper], [all.lower, all.upper])
    };
    let warm = |case: &Case, stages: &[Stage]| {
        let (pose_a, options, mut warm) = (&case.poses[0], Options::default(), WarmStart::default());
        // Closed forms leave other hints.
        let general = [Stage::ClosedForm];
        except(&general, || growth_distance(case.a, pose_a, case.b, &case.poses[1], &options, &mut warm));
        let found = only(stages, || growth_distance(case.a, pose_a, case.b, &case.next, &options, &mut warm));
        let all = truth(case, &case.next);
        (found.status, [found.lower, found.upper], [all.lower, all.upper])
    };
    let smooth = |case: &Case| case.is_smooth() && case.is_apart();
    let edged = |case: &Case| !case.is_smooth();
    at_least("growth follow", 60.0, solved("growth follow", smooth, |case| warm(case, &[Stage::Follow])));
    at_least("growth seek", 60.0, solved("growth seek", smooth, |case| cold(case, &[Stage::Seek])));
    at_least("growth ray", 95.0, solved("growth ray", edged, |case| warm(case, &[Stage::Ray])));
    let stages = [Stage::SupportTables, Stage::Ray];
    at_least("growth portal", 95.0, solved("growth portal", edged, |case| cold(case, &stages)));
    let stages = [Stage::InteriorDistance];
    at_least("growth interior", 95.0, solved("growth interior", |_| true, |case| cold(case, &stages)));
}

/// Level distances below 1: the minimum of A's polynomial, which it takes in B.
#[test]
fn saturation_is_proven_alone() {
    let solve = |case: &Case| {
        let (b, pose_b, mut random) = (case.b, &case.poses[1], Seeded(97_000 + case.seed));
        let half = Vector3::from_fn(|_, _| 0.3 * b.in_radius() * 3_f64.powf(random.signed()));
        let a = Body::superellipsoid("small", Vector3::zeros(), half, [2, 4, 8][case.seed as usize % 3]).unwrap();
        let place = pose_b.transform_point(&(b.interior_point() + random.unit() * (0.9 * b.in_radius())));
        let pose_a = random_pose(&mut random, 0.0).with_translation(place);
        let with = |stages: &[Stage]| {
            only(stages, || level_distance(&a, &pose_a, b, pose_b, &Options::default(), &mut WarmStart::default()))
        };
        let (found, other) = (with(&[Stage::Saturation]), with(&[Stage::InteriorLevel]));
        (found.status, [found.lower, found.upper], [other.lower, other.upper])
    };
    at_least("saturation", 95.0, solved("saturation", |_| true, solve));
}

/// Double-double arithmetic narrows level distances, too.
#[test]
fn refinement_of_levels_goes_on_alone() {
    let options = Options::default().with_accuracy(1e-15).unwrap();
    let with = |stages: &[Stage], case: &Case| {
        let [pose_a, pose_b] = &case.poses;
        only(stages, || level_distance(case.a, pose_a, case.b, pose_b, &options, &mut WarmStart::default()))
    };
    let (mut cases, mut narrower) = (0, 0);
    for case in catalogue().iter().filter(|case| case.is_apart()).take(100) {
        let doubles = with(&[Stage::SupportTables, Stage::Newton], case);
        let refined = with(&[Stage::SupportTables, Stage::Newton, Stage::Refinement], case);
        assert!(refined.lower <= doubles.upper && doubles.lower <= refined.upper, "seed {}", case.seed);
        if doubles.upper - doubles.lower < 1e-9 * doubles.upper && doubles.status != Status::Converged {
            cases += 1;
            narrower += u32::from(refined.upper - refined.lower < 0.5 * (doubles.upper - doubles.lower));
        }
    }
    println!("refinement of levels: {narrower} of {cases} narrower");
    assert!(cases >= 20 && 10 * narrower >= 9 * cases, "{narrower} of {cases}");
}

/// A narrow bracket determines the normal to the root of its width only: the last stage turns it
/// into that of the solution.
#[test]
fn alignment_turns_normals() {
    let exact = Options::default().with_accuracy(1e-13).unwrap();
    let coarse = Options::default().with_accuracy(1e-4).unwrap();
    let (mut before, mut after, mut cases) = (Vec::new(), Vec::new(), 0);
    for case in catalogue().iter().filter(|case| case.is_apart() && !case.is_smooth()) {
        let [pose_a, pose_b] = &case.poses;
        let to = |options: &Options<'_>, warm: &mut WarmStart| distance(case.a, pose_a, case.b, pose_b, options, warm);
        let mut warm = WarmStart::default();
        to(&exact, &mut warm);
        let Some(truth) = to(&exact, &mut warm).normal else { continue };
        let stages = [Stage::InteriorDistance, Stage::Newton];
        let doubles = only(&stages, || to(&coarse, &mut WarmStart::default()));
        let aligned = only(&[&stages[..], &[Stage::Alignment]].concat(), || to(&coarse, &mut WarmStart::default()));
        if let (Some(n), Some(m)) = (doubles.normal, aligned.normal) {
            cases += 1;
            before.push((n - truth).norm());
            after.push((m - truth).norm());
        }
    }
    before.sort_by(f64::total_cmp);
    after.sort_by(f64::total_cmp);
    let at = |errors: &[f64]| [errors[cases / 2], errors[cases * 9 / 10], errors[cases * 97 / 100]];
    println!("alignment: errors of {cases} normals {:?} before, {:?} after", at(&before), at(&after));
    assert!(cases >= 150 && before[cases * 9 / 10] > 1e-6 && after[cases * 9 / 10] < 1e-8);
}

/// Decisions by the bounds that come before any search.
#[test]
fn bounds_decide_alone() {
    let decide = |case: &Case, threshold: f64, stages: &[Stage]| {
        let [pose_a, pose_b] = &case.poses;
        let (options, mut warm) = (Options::default(), WarmStart::default());
        only(stages, || nearer_than(case.a, pose_a, case.b, pose_b, threshold, &options, &mut warm)).unwrap()
    };
    let share = |what: &str, percent: f64, domain: &dyn Fn(&Case) -> bool, decided: &dyn Fn(&Case) -> bool| {
        let cases: Vec<&Case> = catalogue().iter().filter(|case| domain(case)).collect();
        let met = cases.iter().filter(|case| decided(case)).count();
        assert!(cases.len() >= 30, "{what}: only {} cases", cases.len());
        at_least(what, percent, 100.0 * met as f64 / cases.len() as f64);
    };
    let apart = |case: &Case| case.is_apart();
    // No: half the distance is less than the distance.
    let far =
        |stages: &'static [Stage]| move |case: &Case| decide(case, 0.5 * case.distance.lower, stages) == Decision::No;
    assert!(!catalogue().iter().filter(|case| case.is_apart()).any(|case| far(&[])(case)), "decided by no bound");
    share("balls", 45.0, &apart, &far(&[Stage::Balls]));
    share("planes", 62.0, &apart, &far(&[Stage::Planes]));
    // Yes: balls inside the bodies meet.
    let meet = |case: &Case| decide(case, 1e-3 * case.size(), &[Stage::Balls]) == Decision::Yes;
    share("balls inside", 12.0, &Case::overlaps, &meet);
}
