//! Families about sizes and units: 9, 10, 11, 12.

use crate::judge::{all, all_of, judged_level, judged_of, large, plain, small};
use sublevel_core::measure::{Options, Status, WarmStart, level_distance};
use sublevel_testkit::bodies::{Placed, fitted};
use sublevel_testkit::catalogue::scale::{
    DOUBLINGS, NEEDLE_SETTINGS, NEEDLES, PARTNERS, UNIT_PAIRS, beside_small, far_from_the_origin, needles, ratio,
    scales, small_and_thin, units,
};
use sublevel_testkit::random::Seeded;

/// Size ratio: ratio 1e1..1e6; error <= 1e-9 s_small + 64 eps s_large (circumradii).
#[test]
fn family_09_size_ratio() {
    for index in 0..240 {
        for case in ratio(index, &mut Seeded(90_000 + index)) {
            let (a, b) = case.placed();
            let label = format!("index {index} {}", case.what);
            // At ratios above 1e5 the default accuracy lies below the rounding floor: the error
            // counts, not the status.
            let (answer, truth) = judged_of(&case, &label);
            judged_level(a, b, &Options::default(), &label);
            judged_level(b, a, &Options::default(), &label);
            let error = (answer.value() - truth.value()).abs();
            let bound = 1e-9 * small(a.0, b.0) + 64.0 * f64::EPSILON * large(a.0, b.0);
            assert!(error <= bound, "{label}: {answer:?}: error {error:e} above {bound:e}");
        }
    }
}

/// Far from the origin: both translated by 1..1e9 m: invariant up to c·eps·|T|.
#[test]
fn family_10_far_from_the_origin() {
    for seed in 100_000..100_100 {
        for power in 0..=9 {
            let [near, far] = far_from_the_origin(power, &mut Seeded(seed));
            let label = format!("seed {seed} {}", far.what);
            let (one, _) = judged_of(&near, &label);
            // The poses round; about them as they are, the bracket is exact.
            let (other, _) = judged_of(&far, &label);
            assert_eq!(other.status, Status::Converged, "{label}: {other:?}");
            let bound = 1e-9 * small(&far.a, &far.b) + 4.0 * f64::EPSILON * 10_f64.powi(power);
            let change = (other.value() - one.value()).abs();
            assert!(change <= bound, "{label}: {one:?} {other:?}: {change:e} above {bound:e}");
        }
    }
}

/// Units: everything scaled by 1e-9..1e9: d/s and iterations unchanged.
#[test]
fn family_11_units() {
    for s in scales() {
        // The query frame is scaled by powers of two, so that scales of other factors round
        // differently: the count of iterations is compared where nothing rounds.
        let exact = DOUBLINGS.iter().any(|k| s == 2_f64.powi(*k));
        for pair in 0..UNIT_PAIRS {
            for seed in 0..12 {
                let [as_it_is, scaled] = units(pair, s, &mut Seeded(110_000 + 100 * pair as u64 + seed));
                let label = format!("pair {pair} seed {seed} {}", scaled.what);
                let (a, b) = as_it_is.placed();
                let one = plain(a, b, &Options::default(), &label);
                let (answer, _) = judged_of(&scaled, &label);
                let label = format!("{label}: {one:?} {answer:?}");
                assert_eq!(answer.status, Status::Converged, "{label}");
                assert!((answer.value() / s - one.value()).abs() <= 1e-9 * small(a.0, b.0), "{label}");
                assert!(answer.iterations == one.iterations || !exact, "{label}");
                let level = |a: Placed<'_>, b: Placed<'_>| {
                    level_distance(a.0, a.1, b.0, b.1, &Options::default(), &mut WarmStart::default())
                };
                let one = level(a, b);
                let (a, b) = scaled.placed();
                let other = level(a, b);
                let label = format!("{label}: {one:?} {other:?}");
                assert!((other.value() - one.value()).abs() <= 1e-9 * one.value().abs().max(1.0), "{label}");
                assert!(other.iterations == one.iterations || !exact, "{label}");
            }
        }
    }
}

/// Needles and plates: aspect 1e2..1e5, slab 1e-3, needle against slab.
#[test]
fn family_12_needles_and_plates() {
    for k in 2..=5 {
        let aspect = 10_f64.powi(k);
        for pair in (0..NEEDLES).flat_map(|i| (0..PARTNERS).map(move |j| (i, j))) {
            for setting in 0..NEEDLE_SETTINGS {
                let seed = 120_000 + 1000 * k as usize + 100 * pair.0 + 10 * pair.1 + setting;
                let cases = needles(aspect, pair, setting, &mut Seeded(seed as u64));
                let label = |what: &str| format!("seed {seed} {what}");
                if let [far, _] = &cases[..] {
                    let (first, _) = judged_of(far, &label(&far.what));
                    assert_eq!(first.status, Status::Converged, "{}: {first:?}", label(&far.what));
                }
                let near = cases.last().expect("at least one");
                all_of(near, &label(&near.what));
            }
        }
    }
}

/// The fitted bodies take part in 9 to 12 with a small partner.
#[test]
fn fitted_bodies_against_small_and_thin() {
    for (i, body) in fitted().iter().enumerate() {
        for (j, other) in small_and_thin().iter().enumerate() {
            for seed in 0..6 {
                let case = beside_small(body, other, &mut Seeded((130_000 + 100 * i + 10 * j + seed) as u64));
                let (a, b) = case.placed();
                let label = format!("seed {seed}");
                all(a, b, &label);
                let _ = judged_level(a, b, &Options::default(), &label);
            }
        }
    }
}
