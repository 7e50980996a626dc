//! Families about deep overlap: 16, 27.

use crate::judge::{judged_level, large, small};
use nalgebra::Vector3;
use sublevel_core::measure::{
    Options, Pose, SignedDistance, Status, WarmStart, growth_distance, level_distance, signed_distance,
};
use sublevel_testkit::bodies::{Placed, support, zoo};
use sublevel_testkit::catalogue::depth::{Saturation, Slide, saturation, slide};
use sublevel_testkit::random::{Seeded, draws, few_or};
use sublevel_testkit::reference;

/// How far the first body has to move along n until a plane across n parts the bodies: the support
/// functions in closed form.
fn depth_along((a, pose_a): Placed<'_>, (b, pose_b): Placed<'_>, n: &Vector3<f64>) -> f64 {
    let own = |pose: &Pose, n: &Vector3<f64>| pose.rotation().inverse_transform_vector(n);
    n.dot(&(pose_b.translation() - pose_a.translation())) + support(a, &-own(pose_a, n)) + support(b, &own(pose_b, n))
}

/// The least depth that a search without derivatives finds from many directions: an upper bound of
/// the truth, and next to it but for bodies with edges.
fn shortest(a: Placed<'_>, b: Placed<'_>) -> (f64, Vector3<f64>) {
    const COUNT: usize = 1500;
    let depth = |n: &Vector3<f64>| depth_along(a, b, n);
    let spiral = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / COUNT as f64;
        let (sin, cos) = (k as f64 * 2.399_963_229_728_653).sin_cos();
        Vector3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
    };
    let mut starts: Vec<_> = (0..COUNT).map(|k| (depth(&spiral(k)), spiral(k))).collect();
    starts.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut least = starts[0];
    for (mut best, mut n) in starts.iter().copied().take(5) {
        let mut step = 0.05;
        while step > 1e-10 {
            let u = n.cross(&Vector3::ith(n.iamin(), 1.0)).normalize();
            let w = n.cross(&u);
            let around = (0..8).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4);
            let tried = around.map(|angle| (n + (u * angle.cos() + w * angle.sin()) * step).normalize());
            let (value, m) =
                tried.map(|m| (depth(&m), m)).min_by(|p, q| p.0.total_cmp(&q.0)).expect("eight directions");
            if value < best {
                (best, n) = (value, m);
            } else {
                step *= 0.5;
            }
        }
        if best < least.0 {
            least = (best, n);
        }
    }
    least
}

/// A signed distance whose status is what its bracket says.
fn signed(a: Placed<'_>, b: Placed<'_>, options: &Options<'_>, warm: &mut WarmStart, label: &str) -> SignedDistance {
    let answer = signed_distance(a.0, a.1, b.0, b.1, options, warm);
    assert!(answer.lower <= answer.upper, "{label}: {answer:?}");
    let depth = if answer.upper < 0.0 { -answer.lower } else { 0.0 };
    let tolerance = (options.accuracy() * small(a.0, b.0)).max(options.depth_accuracy() * depth);
    let narrow = answer.upper - answer.lower <= tolerance * (1.0 + 1e-12);
    assert!(narrow == (answer.status == Status::Converged), "{label}: dishonest {answer:?}");
    assert_eq!(answer.at_contact, answer.lower <= 0.0 && answer.upper >= 0.0, "{label}: {answer:?}");
    answer
}

/// Compares a signed distance of overlapping bodies with the closed supports: no direction is
/// better than its upper bound, and its own direction is as good as its lower one. Untied, it is no
/// worse than any other by more than its accuracy.
fn hold(a: Placed<'_>, b: Placed<'_>, answer: &SignedDistance, label: &str) {
    let floor = 1e-13 * large(a.0, b.0);
    let (least, along) = shortest(a, b);
    let label = format!("{label}: {answer:?} against {:e} along {along:?}", -least);
    assert!(answer.upper >= -least - floor, "{label}: the bracket misses the truth");
    let n = answer.normal.unwrap_or_else(|| panic!("{label}: no normal"));
    assert!(answer.lower <= -depth_along(a, b, &n) + floor, "{label}: its normal does not attain the lower bound");
    if !answer.tied && answer.status == Status::Converged {
        assert!(answer.value() >= -least - 1e-9 * small(a.0, b.0) - floor, "{label}: untied, and not the shortest");
    }
}

/// Deep penetration: slide from touching to concentric: continuous, monotone, conditioning
/// reported.
///
/// About their centres the bodies are their own mirror images: then the signed distance along a
/// slide is convex and even.
#[test]
fn family_16_deep_penetration() {
    for seed in 0..few_or(3, 28) {
        // Every fourth pair is turned alike: faces and axes are parallel all the way.
        let slide = slide(seed % 4 == 0, &mut Seeded(160_000 + seed));
        let Slide { a, pose_a, b, .. } = &slide;
        let (size, least) = (large(a, b), small(a, b));
        // From where they touch: how far they have to part along the slide.
        let reach = touching(|offset| shortest((a, pose_a), (b, &slide.place(offset))).0);
        let options = Options::default();
        let mut warm = WarmStart::default();
        let mut last: Option<(f64, SignedDistance)> = None;
        let mut previous: Option<(f64, SignedDistance)> = None;
        for offset in Slide::shares().into_iter().map(|share| share * reach) {
            let pose_b = slide.place(offset);
            let (p, q) = ((a, pose_a), (b, &pose_b));
            let label = format!("seed {seed} {}-{} offset {:e} of {reach}", a.name(), b.name(), offset / reach);
            let answer = signed(p, q, &options, &mut warm, &label);
            let cold = signed(p, q, &options, &mut WarmStart::default(), &format!("{label} cold"));
            assert!(cold.lower <= answer.upper && answer.lower <= cold.upper, "{label}: {answer:?} cold {cold:?}");
            for answer in [&answer, &cold] {
                if answer.upper < 0.0 {
                    hold(p, q, answer, &label);
                }
                // Mirrored, the translation out is as long on the other side.
                if offset < 1e-6 * reach {
                    assert!(answer.tied, "{label}: {answer:?} is not flagged as tied");
                }
            }
            for limit in 1..=2 {
                let limited = Options::default().with_max_iterations(limit).expect("in range");
                let rough = signed(p, q, &limited, &mut WarmStart::default(), &format!("{label} limit {limit}"));
                assert!(rough.lower <= cold.upper && cold.lower <= rough.upper, "{label}: {rough:?} cold {cold:?}");
            }
            if let Some((before, earlier)) = &last {
                let label = format!("{label}: {answer:?} after {earlier:?}");
                let (moved, floor) = (before - offset, 1e-13 * size);
                // It changes by at most what was moved, and on the way in only falls.
                assert!(answer.lower <= earlier.upper + floor, "{label}: rises");
                assert!(answer.upper >= earlier.lower - moved - floor, "{label}: jumps");
                if !answer.tied && !earlier.tied {
                    let slack = 2e-9 * least + floor;
                    assert!(answer.value() <= earlier.value() + slack, "{label}: the value rises");
                    assert!(answer.value() >= earlier.value() - moved - slack, "{label}: the value jumps");
                }
                if let Some((first, far)) = &previous {
                    let share = moved / (first - offset);
                    let chord = far.upper * share + answer.upper * (1.0 - share);
                    assert!(earlier.lower <= chord + floor, "{label}: not convex");
                }
            }
            previous = last.replace((offset, answer));
        }
        let (_, deepest) = last.expect("at least one offset");
        assert_eq!(deepest.status, Status::Converged, "seed {seed}: {deepest:?}");
    }
}

/// The offset at which a depth that falls with it is 0.
fn touching(depth: impl Fn(f64) -> f64) -> f64 {
    let (mut inside, mut outside) = (0.0, 1.0);
    while depth(outside) > 0.0 {
        outside *= 2.0;
    }
    for _ in 0..50 {
        let middle = 0.5 * (inside + outside);
        *(if depth(middle) > 0.0 { &mut inside } else { &mut outside }) = middle;
    }
    inside
}

/// Level distance reported as depth: the seed inside the other body: saturation flagged, growth
/// distance still informative.
///
/// Along a ray from the common centre the growth distance is the gauge of one set: exactly
/// proportional to the offset.
#[test]
fn family_27_level_distance_as_depth() {
    let zoo = zoo();
    let (mut flagged, mut free) = (0, 0);
    for seed in 0..draws(50) {
        let pair = saturation(&zoo, &mut Seeded(270_000 + seed));
        let Saturation { a, pose_a, b, meet, .. } = &pair;
        let options = Options::default();
        let (mut warm, mut level_warm) = (WarmStart::default(), WarmStart::default());
        // Bounds of the growth distance per offset, and the last answer.
        let (mut low, mut high, mut last) = (0.0_f64, f64::INFINITY, f64::INFINITY);
        for share in Saturation::SHARES {
            let pose_b = pair.place(share);
            let apart = pair.centres(&pose_b);
            let known = 1e-14 * (pair.sum() + meet.norm());
            let label = format!("seed {seed} {}-{} offset {share:e}", a.name(), b.name());
            let growth = growth_distance(a, pose_a, b, &pose_b, &options, &mut warm);
            let label = format!("{label}: {growth:?}");
            assert_eq!(growth.status, Status::Converged, "{label}");
            assert!(growth.upper - growth.lower <= 1e-9 * growth.upper.max(1.0), "{label}");
            assert!(growth.value() < last * (1.0 - 1e-9), "{label} after {last}");
            last = growth.value();
            let gap = apart.norm();
            low = low.max(growth.lower / (gap + known));
            high = high.min(growth.upper / (gap - known));
            assert!(low <= high * (1.0 + 1e-12), "{label}: between {low} and {high} per metre");
            // Of degree 1, it is its own slope along the offset.
            let slope = growth.gradients.unwrap_or_else(|| panic!("{label}"))[1].linear;
            assert!(
                (slope.dot(&apart) - growth.value()).abs() <= 1e-6 * growth.value() + slope.norm() * known,
                "{label}"
            );
            if share <= 0.3 {
                let center = (a.growth_ball().center, b.growth_ball().center);
                let start = reference::growth::Start {
                    witness: growth.witness,
                    value: growth.upper,
                    normal: growth.normal.expect("centres apart"),
                };
                let truth = reference::growth::growth_distance((a, pose_a, &center.0), (b, &pose_b, &center.1), &start);
                let truth = truth.unwrap_or_else(|| panic!("{label}: no reference"));
                assert!(growth.lower <= truth.value() && truth.value() <= growth.upper, "{label}: {truth:?}");
            }

            let level = level_distance(a, pose_a, b, &pose_b, &options, &mut level_warm);
            let (cold, truth) = judged_level((a, pose_a), (b, &pose_b), &options, &label);
            let seed_in_b = pair.seed_level(&pose_b);
            for level in [level, cold] {
                assert!(truth.inside(&level), "{label}: {level:?}");
                if seed_in_b < 1.0 - 1e-6 {
                    flagged += 1;
                    assert!(level.saturated, "{label}: {level:?} is not flagged, the seed is at {seed_in_b}");
                    let none = Vector3::zeros();
                    assert!(level.gradient_a.linear == none && level.gradient_b.angular == none, "{label}: {level:?}");
                    assert!(level.multiplier == 0.0 && level.value() < 1.0, "{label}: {level:?}");
                } else if truth.value() > a.min_value() + 1e-6 {
                    free += 1;
                    assert!(!level.saturated && level.multiplier > 0.0, "{label}: {level:?} is flagged");
                }
            }
        }
    }
    assert!(flagged > 200 && free > 80, "{flagged} flagged, {free} free");
}
