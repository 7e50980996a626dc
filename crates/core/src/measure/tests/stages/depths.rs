//! Stages of penetration depths and signed distances.

use super::{Case, Found, at_least, catalogue, solved};
use crate::measure::solver::stages::{Stage, except, only};
use crate::measure::*;
use sublevel_testkit::Seeded;

/// The second pose of a case after a step that leaves the bodies as deep, or nearly so.
fn moved(case: &Case) -> Pose {
    let step = Seeded(case.seed).unit() * (0.001 * case.size());
    case.poses[1].with_translation(case.poses[1].translation() + step)
}

fn depth(case: &Case, pose: &Pose, warm: &mut WarmStart) -> Penetration {
    penetration(case.a, &case.poses[0], case.b, pose, &Options::default(), warm)
}

/// From the poses alone, with these stages, beside all searches.
fn cold(case: &Case, stages: &[Stage]) -> Found {
    let pose = &case.poses[1];
    let found = only(stages, || depth(case, pose, &mut WarmStart::default()));
    let all = except(&[Stage::ClosedForm], || depth(case, pose, &mut WarmStart::default()));
    (found.status, [found.lower, found.upper], [all.lower, all.upper])
}

/// From the hint of all searches at the pose before: closed forms have other ones.
fn warm(case: &Case, stages: &[Stage]) -> Found {
    let (mut warm, next) = (WarmStart::default(), moved(case));
    except(&[Stage::ClosedForm], || depth(case, &case.poses[1], &mut warm));
    let found = only(stages, || depth(case, &next, &mut warm));
    let all = except(&[Stage::ClosedForm], || depth(case, &next, &mut WarmStart::default()));
    (found.status, [found.lower, found.upper], [all.lower, all.upper])
}

/// Where no stage finds a support point, that of the table is taken: of one pair of 87 all of them
/// are accurate enough.
#[test]
fn next_to_nothing_is_deep_by_no_stage() {
    let alone = solved("nothing", Case::overlaps, |case| cold(case, &[]));
    assert!(alone < 2.0, "{alone} % solved without a stage");
}

/// What support points are found by.
const SUPPORTS: [Stage; 3] = [Stage::SupportLanes, Stage::ProjectionSteps, Stage::ProjectionInterior];

/// How accurate upper bounds are. The proof alone makes brackets as narrow as asked for, so that
/// these show what the searches are good for: the share in percent of the bounds that exceed the
/// one of all stages by at most 1e-8 of the bodies.
fn sharp(domain: impl Fn(&Case) -> bool, solve: impl Fn(&Case) -> Found) -> f64 {
    let (mut cases, mut done) = (0, 0);
    for case in catalogue().iter().filter(|case| domain(case)) {
        let (_, [lower, upper], [least, best]) = solve(case);
        assert!(lower <= best && least <= upper, "seed {}: [{lower}, {upper}] for [{least}, {best}]", case.seed);
        cases += 1;
        done += u32::from(upper <= best + 1e-8 * case.size());
    }
    assert!(cases >= 30, "{cases} cases");
    100.0 * f64::from(done) / f64::from(cases)
}

#[test]
fn searches_end_at_the_best_direction_alone() {
    let smooth = |case: &Case| case.is_smooth() && case.overlaps();
    let edged = |case: &Case| !case.is_smooth() && case.overlaps();
    let with = |stages: &[Stage]| [stages, &SUPPORTS].concat();
    // What the proof finds by itself.
    let none = [sharp(smooth, |case| cold(case, &SUPPORTS)), sharp(edged, |case| cold(case, &SUPPORTS))];
    assert!(none[0] <= 5.0 && none[1] <= 20.0, "{none:?} % without a search");
    at_least("best follow", 97.0, sharp(smooth, |case| warm(case, &with(&[Stage::Follow]))));
    at_least("best seek", 97.0, sharp(smooth, |case| cold(case, &with(&[Stage::Seek]))));
    let sampled = [Stage::Seek, Stage::DirectionSampling];
    at_least("best sampled seek", 97.0, sharp(smooth, |case| cold(case, &with(&sampled))));
    at_least("best Newton", 64.0, sharp(edged, |case| cold(case, &with(&[Stage::Newton]))));
    at_least("best Newton warm", 64.0, sharp(edged, |case| warm(case, &with(&[Stage::Newton]))));
    at_least("best compass", 37.0, sharp(edged, |case| cold(case, &with(&[Stage::CompassSearch]))));
    let both = [Stage::Newton, Stage::CompassSearch];
    at_least("best Newton and compass", 90.0, sharp(edged, |case| cold(case, &with(&both))));
}

/// The proof ends where a support point is not found, so that each way to find them has to find
/// all.
#[test]
fn support_points_are_found_alone() {
    for (what, stage, percent) in [
        ("lanes", Stage::SupportLanes, [37.0, 15.0]),
        ("steps", Stage::ProjectionSteps, [99.0, 82.0]),
        ("interior", Stage::ProjectionInterior, [99.0, 95.0]),
    ] {
        let stages = [Stage::Seek, Stage::Newton, Stage::CompassSearch, stage];
        let smooth = |case: &Case| case.is_smooth() && case.overlaps();
        let edged = |case: &Case| !case.is_smooth() && case.overlaps();
        at_least(&format!("{what}, smooth"), percent[0], solved(what, smooth, |case| cold(case, &stages)));
        at_least(&format!("{what}, edged"), percent[1], solved(what, edged, |case| cold(case, &stages)));
    }
}

#[test]
fn signed_distances_are_followed_alone() {
    let smooth = |case: &Case| case.is_smooth();
    let follow = |case: &Case| {
        let (options, next, mut warm) = (Options::default(), moved(case), WarmStart::default());
        let to =
            |pose: &Pose, warm: &mut WarmStart| signed_distance(case.a, &case.poses[0], case.b, pose, &options, warm);
        to(&case.poses[1], &mut warm);
        let found = only(&[Stage::Follow], || to(&next, &mut warm));
        let all = to(&next, &mut WarmStart::default());
        (found.status, [found.lower, found.upper], [all.lower, all.upper])
    };
    at_least("signed follow", 75.0, solved("signed follow", smooth, follow));
}
