//! The reference itself, against closed forms.

use crate::judge::{all, judged};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Options, Pose, WarmStart, distance};
use sublevel_testkit::bodies::{b, e, p, q, zoo};
use sublevel_testkit::random::{Seeded, at, pose};
use sublevel_testkit::reference;

#[test]
fn coaxial_powers_have_closed_forms() {
    for (degree, other) in [(2, 2), (4, 2), (6, 4), (8, 8)] {
        let (a, b) = (q(degree, 1.0, 0.5, 2.0), q(other, 0.5, 1.0, 0.25));
        for gap in [0.0, 1e-12, f64::EPSILON, 0.5, 8.0] {
            let pose = at(1.5 + gap, 0.0, 0.0);
            let (_, truth) = all((&a, &Pose::identity()), (&b, &pose), "closed form");
            let exact = pose.translation().x - 1.5;
            assert!((truth.value() - exact).abs() <= 1e-30, "{} against {exact}", truth.value());
            if exact > 0.0 {
                assert!((truth.normal().x + 1.0).abs() < 1e-15, "{}", truth.normal());
                assert!((truth.gradient[0] + 1.0).abs() < 1e-15 && (truth.gradient[6] - 1.0).abs() < 1e-15);
            }
        }
    }
}

#[test]
fn random_pairs_are_resolved() {
    let zoo = zoo();
    let mut widest = 0.0_f64;
    for seed in 0..150 {
        let mut random = Seeded(seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let far = 2.5 * random.positive() * (a.circumscribed().radius + b.circumscribed().radius);
        let (pose_a, pose_b) = (random.pose(1.0), random.pose(far));
        let (_, truth) = all((a, &pose_a), (b, &pose_b), &format!("seed {seed}"));
        widest = widest.max(truth.width());
    }
    println!("widest {widest:e}");
}

/// The gradient against central differences of the truth itself.
#[test]
fn gradients_are_derivatives() {
    let pairs = [(e(1.0, 0.7, 0.4), q(6, 0.5, 0.6, 0.7)), (p(4, 0.8), e(0.3, 0.2, 0.5)), (b(0.5, 0.4, 0.3), p(8, 0.6))];
    for (seed, (a, b)) in pairs.iter().enumerate() {
        let mut random = Seeded(seed as u64);
        let (pose_a, pose_b) = (random.pose(0.1), random.pose(3.0));
        let options = Options::default();
        let (_, truth) = judged((a, &pose_a), (b, &pose_b), &options, "centre");
        for k in 0..12 {
            let h = 1e-5;
            let value = |step: f64| {
                let moved = |pose: &Pose, first: usize| sublevel_testkit::random::twisted(pose, k, first, step);
                judged((a, &moved(&pose_a, 0)), (b, &moved(&pose_b, 6)), &options, "moved").1.value()
            };
            let difference = (value(h) - value(-h)) / (2.0 * h);
            assert!((difference - truth.gradient[k]).abs() < 1e-8, "{seed} {k}: {difference} {}", truth.gradient[k]);
        }
    }
}

/// From starts that are off by 1e-3: closed forms of balls and of coaxial powers, any pair
/// consistent with the distance, and gradients against differences.
#[test]
fn growth_distances_have_closed_forms() {
    use sublevel_testkit::reference::growth::Start;
    let growth = |a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, start: &Start| {
        let centre = |body: &Body| *body.interior_point();
        reference::growth::growth_distance((a, pose_a, &centre(a)), (b, pose_b, &centre(b)), start)
            .expect("centres apart")
    };
    for (degree, offset) in [(2, 2.5), (4, 0.3), (8, 1.5), (6, 9.0)] {
        let (a, b) = (q(degree, 1.0, 0.5, 2.0), q(degree, 0.5, 1.0, 0.25));
        let exact = offset / 1.5;
        let start =
            Start { witness: Vector3::new(exact * 1.001, 1e-3, -1e-3), value: exact * 0.999, normal: -Vector3::x() };
        let truth = growth(&a, &Pose::identity(), &b, &at(offset, 0.0, 0.0), &start);
        assert!((truth.value() - exact).abs() < 1e-15 && truth.width() < 1e-30, "{degree}: {truth:?} {exact}");
    }
    let (a, b) = (p(4, 0.8), e(0.3, 0.2, 0.5));
    for seed in 0..3 {
        let mut random = Seeded(900 + seed);
        let (pose_a, pose_b) = (random.pose(0.1), random.pose(3.0));
        // Grown to touching, the normal of the distance is near enough to start from.
        let (answer, _) = judged((&a, &pose_a), (&b, &pose_b), &Options::default(), "apart");
        let sizes = (a.circumscribed().radius, b.circumscribed().radius);
        let between = pose_b.translation() - pose_a.translation();
        let start = Start {
            witness: pose_a.translation() + between * (sizes.0 / (sizes.0 + sizes.1)),
            value: between.norm() / (between.norm() - answer.value()),
            normal: answer.normal.unwrap(),
        };
        let truth = growth(&a, &pose_a, &b, &pose_b, &start);
        assert!(truth.width() < 1e-30, "{seed}: {truth:?}");
        for k in 0..12 {
            let h = 1e-5;
            let value = |step: f64| {
                let moved = |pose: &Pose, first: usize| sublevel_testkit::random::twisted(pose, k, first, step);
                growth(&a, &moved(&pose_a, 0), &b, &moved(&pose_b, 6), &start).value()
            };
            let difference = (value(h) - value(-h)) / (2.0 * h);
            assert!((difference - truth.gradient[k]).abs() < 1e-8, "{seed} {k}: {difference} {}", truth.gradient[k]);
        }
    }
}

/// Witnesses far away are rounded by more than overlaps are deep that are proven all the same.
#[test]
fn shallow_overlaps_are_found_from_rounded_witnesses() {
    let bodies = [b(1.0, 1.0, 1e-3), b(0.02, 0.03, 0.01), p(6, 0.02), p(6, 0.7), e(0.8, 0.5, 1.1)];
    let options = Options::default();
    let mut shallow = 0;
    for seed in 0..2000 {
        let mut random = Seeded(seed);
        let (a, b) = (&bodies[random.index(2)], &bodies[random.index(5)]);
        let size = a.circumscribed().radius + b.circumscribed().radius;
        let (place, turn) = (random.unit() * 1e8, random.rotation());
        let (pose_a, aside) = (pose(place, &turn), random.unit() * 1.5 * size);
        let turn = random.rotation();
        let apart = pose(place + aside, &turn);
        let answer = distance(a, &pose_a, b, &apart, &options, &mut WarmStart::default());
        let Some(normal) = answer.normal else { continue };
        let deep = 10_f64.powf(-7.0 + random.signed());
        let pose_b = pose(place + aside + normal * (answer.upper + deep), &turn);
        let answer = distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        if answer.upper == 0.0 {
            shallow += 1;
            let truth = reference::distance(a, &pose_a, b, &pose_b, &answer);
            let label = format!("seed {seed}: {}-{} {answer:?}", a.name(), b.name());
            assert!(truth.value() == 0.0, "{label}: {:e}", truth.value());
        }
    }
    assert!(shallow > 1900, "{shallow} overlaps");
}
