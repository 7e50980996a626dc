//! Smooth bodies and boxes or cylinders against 200 bits: levels over them at all distances, and
//! needles and plates of one to a million.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{Options, Status, WarmStart, level_distance};
use sublevel_testkit::bodies::fitted;
use sublevel_testkit::random::{Seeded, draws, pose};
use sublevel_testkit::reference;

use crate::judge::{judged, judged_level};

/// A body of one constraint with sizes over one decade, of degree 2 to 8.
fn smooth(random: &mut Seeded) -> Body {
    let half = Vector3::from_fn(|_, _| random.between(0.3, 3.0));
    let made = match random.index(6) {
        0 => Body::ball("ball", Vector3::zeros(), half.x),
        1 => Body::ellipsoid("ellipsoid", Vector3::zeros(), half),
        2 => Body::superellipsoid("degree 4", Vector3::zeros(), half, 4),
        3 => Body::superellipsoid("degree 6", Vector3::zeros(), half, 6),
        4 => Body::superellipsoid("degree 8", Vector3::zeros(), half, 8),
        _ => return fitted()[random.index(fitted().len())].clone(),
    };
    made.expect("sizes are positive")
}

/// A box or a cylinder of half sizes, one direction of which may be thin.
fn shape(random: &mut Seeded, thin: f64) -> Body {
    let sizes = [(); 3].map(|()| random.between(0.3, 3.0));
    let made = match random.index(5) {
        0 => Body::cuboid("box", sizes.into()),
        1 => Body::cuboid("plate", Vector3::new(sizes[0], sizes[1], thin)),
        2 => Body::cuboid("needle", Vector3::new(thin, thin, sizes[2])),
        3 => Body::cylinder("cylinder", sizes[0] * thin, sizes[1]),
        _ => Body::cylinder("disc", sizes[0], sizes[1] * thin),
    };
    made.expect("sizes are positive")
}

/// Somewhere at a distance of the centres in sizes of both.
fn beside(a: &Body, b: &Body, far: f64, random: &mut Seeded) -> sublevel_core::measure::Pose {
    let size = a.circumscribed().radius + b.circumscribed().radius;
    let turn = UnitQuaternion::new(random.unit() * (PI * random.positive()));
    pose(random.unit() * (far * size), &turn)
}

#[test]
fn levels_over_shapes() {
    // Four placements of each pair.
    let mut made = None;
    for seed in 0..draws(500) {
        let mut random = Seeded(910_000 + seed);
        if seed % 4 == 0 {
            made = Some((smooth(&mut random), shape(&mut random, 1.0)));
        }
        let (a, b) = made.as_ref().expect("made for the first of four");
        let far = [0.1, 0.3, 0.6, 1.0, 1.5, 3.0, 30.0, 1e3][random.index(8)];
        let (pose_a, pose_b) = (beside(a, b, 1.0, &mut random), beside(a, b, far, &mut random));
        let options = Options::default().with_accuracy([1e-3, 1e-6, 1e-9][random.index(3)]).expect("an accuracy");
        let label = format!("seed {seed} at {far}");
        let (cold, _) = judged_level((a, &pose_a), (b, &pose_b), &options, &label);
        assert_eq!(cold.status, Status::Converged, "{label}: {cold:?}");
        // From the answer of a pose nearby.
        let mut warm = WarmStart::default();
        let step = random.unit() * (1e-2 * b.circumscribed().radius);
        level_distance(a, &pose_a, b, &pose_b.with_translation(pose_b.translation() + step), &options, &mut warm);
        let answer = level_distance(a, &pose_a, b, &pose_b, &options, &mut warm);
        let truth = reference::level_distance(a, &pose_a, b, &pose_b, &answer);
        assert_eq!(answer.status, Status::Converged, "{label}: {answer:?}");
        assert!(truth.inside(&answer), "{label}: {answer:?} against {:e}", truth.value());
    }
}

/// Brackets are true and say how wide they are; most are as narrow as asked for.
#[test]
fn family_12_needles_of_one_to_a_million_among_smooth_bodies() {
    let (mut converged, count) = (0, draws(300));
    for seed in 0..count {
        let mut random = Seeded(920_000 + seed);
        let thin = [1e-4, 1e-5, 1e-6][random.index(3)];
        let (a, b) = (smooth(&mut random), shape(&mut random, thin));
        let far = random.between(0.2, 2.0);
        let (pose_a, pose_b) = (beside(&a, &b, 1.0, &mut random), beside(&a, &b, far, &mut random));
        let label = format!("seed {seed} thin {thin:e}");
        let (answer, _) = judged((&a, &pose_a), (&b, &pose_b), &Options::default(), &label);
        judged_level((&a, &pose_a), (&b, &pose_b), &Options::default(), &label);
        converged += u64::from(answer.status == Status::Converged);
    }
    assert!(100 * converged >= 95 * count, "{converged} of {count} as narrow as asked for");
}
