//! Stages of casts, projections and supports.

use super::{Case, at_least, catalogue};
use crate::body::Body;
use crate::measure::solver::stages::{Stage, only};
use crate::measure::*;
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

/// A ray from outside towards a point of the body that is not near the surface.
fn ray(case: &Case) -> Ray {
    let (body, mut random) = (case.a, Seeded(92_000 + case.seed));
    let size = body.circumscribed().radius;
    let origin = body.circumscribed().center + random.unit() * (size * (2.0 + random.signed()));
    let target = body.interior_point() + random.unit() * (0.5 * body.in_radius());
    Ray::new(origin, target - origin, f64::INFINITY).unwrap()
}

/// Casts with these stages: the share in percent that is as narrow as asked for, and the mean and
/// the largest number of iterations of those.
fn cast(stages: &[Stage], cast: impl Fn(&Case, &Ray) -> RayCast) -> (f64, f64, u32) {
    let (mut done, mut cases, mut sum, mut most) = (0, 0, 0, 0);
    for case in catalogue() {
        let ray = ray(case);
        let all = *cast(case, &ray).hit().unwrap_or_else(|| panic!("seed {}", case.seed));
        let found = only(stages, || cast(case, &ray));
        cases += 1;
        match found {
            RayCast::Hit(hit) => {
                assert!(hit.lower <= all.upper && all.lower <= hit.upper, "seed {}: {hit:?} {all:?}", case.seed);
                if hit.status == Status::Converged {
                    done += 1;
                    sum += hit.iterations;
                    most = most.max(hit.iterations);
                }
            }
            RayCast::Undecided { lower, upper } => {
                assert!(lower <= all.upper && all.lower <= upper, "seed {}: {found:?} {all:?}", case.seed);
            }
            RayCast::Miss => panic!("seed {}: {all:?} missed", case.seed),
        }
    }
    (100.0 * f64::from(done) / f64::from(cases), f64::from(sum) / f64::from(done.max(1)), most)
}

#[test]
fn rays_enter_by_each_stage_alone() {
    let by = |stages: &[Stage]| cast(stages, |case, ray| cast_ray(case.a, &Pose::identity(), ray, &Options::default()));
    assert!(by(&[]).0 == 0.0, "entered by no stage");
    for (stage, mean) in [(Stage::Interpolation, 1.2), (Stage::Curvature, 3.0), (Stage::Halving, 34.0)] {
        let (share, iterations, most) = by(&[stage]);
        println!("ray by {stage:?}: {share:.1} %, {iterations:.2} iterations, at most {most}");
        assert!(share >= 99.0 && iterations <= mean, "{stage:?}: {share} %, {iterations} iterations");
    }
}

#[test]
fn balls_touch_by_each_stage_alone() {
    let by = |stages: &[Stage]| {
        let stages = [stages, &[Stage::ProjectionSteps, Stage::ProjectionInterior]].concat();
        cast(&stages, |case, ray| {
            let sweep = Sweep::new(*ray, 0.3 * case.a.circumscribed().radius).unwrap();
            cast_ball(case.a, &Pose::identity(), &sweep, &Options::default())
        })
    };
    assert!(by(&[]).0 <= 5.0, "touched by no stage");
    for (stage, mean) in [(Stage::Curvature, 9.0), (Stage::Halving, 50.0)] {
        let (share, iterations, most) = by(&[stage]);
        println!("ball by {stage:?}: {share:.1} %, {iterations:.2} iterations, at most {most}");
        assert!(share >= 99.0 && iterations <= mean, "{stage:?}: {share} %, {iterations} iterations");
    }
}

/// A point about the body, as often within its circumscribed ball as not.
fn point(case: &Case) -> Vector3<f64> {
    let mut random = Seeded(93_000 + case.seed);
    let ball = case.a.circumscribed();
    ball.center + random.unit() * (ball.radius * 3_f64.powf(random.signed()))
}

fn projected(domain: impl Fn(&Body) -> bool, stages: &[Stage]) -> f64 {
    let (mut done, mut cases) = (0, 0);
    for case in catalogue().iter().filter(|case| domain(case.a)) {
        let point = point(case);
        let to = || {
            let (options, mut warm) = (Options::default(), WarmStart::default());
            distance_to_point(case.a, &Pose::identity(), &point, &options, &mut warm).unwrap()
        };
        let (found, all) = (only(stages, to), to());
        if all.inside {
            continue;
        }
        assert!(found.lower <= all.upper && all.lower <= found.upper, "seed {}: {found:?} {all:?}", case.seed);
        cases += 1;
        done += u32::from(found.status == Status::Converged);
    }
    100.0 * f64::from(done) / f64::from(cases)
}

fn supported(domain: impl Fn(&Body) -> bool, stages: &[Stage]) -> f64 {
    let (mut done, mut cases) = (0, 0);
    for case in catalogue().iter().filter(|case| domain(case.a)) {
        let half_space = HalfSpace::new(Seeded(94_000 + case.seed).unit(), 0.0).unwrap();
        let to = || {
            let (options, mut warm) = (Options::default(), WarmStart::default());
            distance_to_half_space(case.a, &case.poses[0], &half_space, &options, &mut warm)
        };
        let (found, all) = (only(stages, to), to());
        assert!(found.lower <= all.upper && all.lower <= found.upper, "seed {}: {found:?} {all:?}", case.seed);
        cases += 1;
        done += u32::from(found.status == Status::Converged);
    }
    100.0 * f64::from(done) / f64::from(cases)
}

#[test]
fn points_are_projected_by_each_stage_alone() {
    let (smooth, edged) = (|body: &Body| body.is_smooth(), |body: &Body| !body.is_smooth());
    for (what, stages, percent) in [
        ("no stage", &[][..], [0.0, 0.0]),
        ("steps", &[Stage::ProjectionSteps], [99.0, 99.0]),
        ("interior points", &[Stage::ProjectionInterior], [99.0, 99.0]),
    ] {
        assert!(!stages.is_empty() || projected(|_| true, stages) + supported(|_| true, stages) == 0.0);
        at_least(&format!("projection by {what}, smooth"), percent[0], projected(smooth, stages));
        at_least(&format!("projection by {what}, edged"), percent[1], projected(edged, stages));
        at_least(&format!("support by {what}, smooth"), percent[0], supported(smooth, stages));
        at_least(&format!("support by {what}, edged"), percent[1], supported(edged, stages));
    }
}
