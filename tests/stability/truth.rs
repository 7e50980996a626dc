//! The reference itself, against closed forms.

use crate::bodies::{b, e, p, q, zoo};
use crate::judge::{all, judged};
use crate::random::{Seeded, at};
use sublevel::measure::{Options, Pose};

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
                let moved = |pose: &Pose, first: usize| crate::random::twisted(pose, k, first, step);
                judged((a, &moved(&pose_a, 0)), (b, &moved(&pose_b, 6)), &options, "moved").1.value()
            };
            let difference = (value(h) - value(-h)) / (2.0 * h);
            assert!((difference - truth.gradient[k]).abs() < 1e-8, "{seed} {k}: {difference} {}", truth.gradient[k]);
        }
    }
}
