//! Every kind of bracket proven again in exact arithmetic, at both ends, for random pairs of all
//! kinds of bodies: sizes from 1e-3 to 1e3, gaps from far apart to deep overlap, through contact,
//! and accuracies beyond the rounding floor. There is no tolerance: an end of a bracket that is off
//! by one part in 1e30 on the wrong side fails.

use crate::exact::number::{exact, exacts};
use crate::exact::proof::Proof;
use crate::exact::{Solid, number};
use dashu_ratio::RBig;
use sublevel_core::body::Body;
use sublevel_core::measure::{
    Distance, Options, Pose, SignedDistance, WarmStart, distance, growth_distance, level_distance, penetration,
    signed_distance,
};
use sublevel_testkit::bodies::{Placed, b, c, cylinder, e, fitted, p, q};
use sublevel_testkit::random::{Seeded, draws, replayed, seeds, shifted};
use sublevel_testkit::reference;

/// Signed gaps relative to the smaller body.
const GAPS: [f64; 15] = [1e4, 10.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-9, -1e-6, -1e-3, -0.1, -0.5];

/// One of each kind and degree in several sizes.
fn pool() -> Vec<Body> {
    let mut pool = Vec::new();
    for s in [1e-3, 0.07, 1.0, 1e3] {
        pool.extend([e(s, 0.6 * s, 0.3 * s), b(0.5 * s, s, 0.2 * s), cylinder(0.4 * s, 0.9 * s)]);
        pool.extend([4, 6, 8].map(|degree| q(degree, s, 0.5 * s, 0.7 * s)));
        pool.extend([c(6, 0.4 * s, s), p(4, s), p(8, 0.8 * s)]);
    }
    pool.extend_from_slice(fitted());
    pool
}

/// A random pair at one of the [`GAPS`], and an accuracy to ask for.
struct Draw<'a> {
    a: &'a Body,
    b: &'a Body,
    pose_a: Pose,
    pose_b: Pose,
    options: Options<'static>,
    label: String,
}

impl<'a> Draw<'a> {
    fn new(pool: &'a [Body], seed: u64, gaps: &[f64]) -> Self {
        let mut random = Seeded(seed);
        let (a, b) = (&pool[random.index(pool.len())], &pool[random.index(pool.len())]);
        let (radius_a, radius_b) = (a.circumscribed().radius, b.circumscribed().radius);
        let (pose_a, far) = (random.pose(0.3), random.pose(2.5 * (radius_a + radius_b) + 0.6));
        let first = distance(a, &pose_a, b, &far, &Options::default(), &mut WarmStart::default());
        let gap = gaps[random.index(gaps.len())];
        let pose_b = shifted(&far, first.normal.expect("apart") * (first.upper - gap * radius_a.min(radius_b)));
        let accuracy = [1e-3, 1e-9, 1e-13][random.index(3)];
        let options = Options::default().with_accuracy(accuracy).expect("in range");
        let label = format!("seed {seed} {}-{} gap {gap:e} accuracy {accuracy:e}", a.name(), b.name());
        Self { a, b, pose_a, pose_b, options, label }
    }

    fn placed(&self) -> (Placed<'_>, Placed<'_>) {
        ((self.a, &self.pose_a), (self.b, &self.pose_b))
    }

    fn distance(&self, options: &Options<'_>) -> Distance {
        distance(self.a, &self.pose_a, self.b, &self.pose_b, options, &mut WarmStart::default())
    }
}

/// Where the reference starts: whatever was asked of the answer, close to the optimum.
fn tight() -> Options<'static> {
    Options::default().with_accuracy(1e-12).expect("in range")
}

/// Both bodies in exact arithmetic.
fn proof<'a>((a, pose_a): Placed<'a>, (b, pose_b): Placed<'a>) -> Proof<'a> {
    Proof { a: Solid::new(a, pose_a), b: Solid::new(b, pose_b), origin: exacts(pose_a.translation()) }
}

/// A distance is at least 0, and at most 0 where there is a common point.
#[test]
fn distances_are_proven_exactly() {
    let pool = pool();
    for seed in 300_000..300_000 + draws(1000) {
        let draw = Draw::new(&pool, seed, &GAPS);
        let answer = draw.distance(&draw.options);
        let label = format!("{}: {answer:?}", draw.label);
        let (a, b) = draw.placed();
        let (proof, truth) = (proof(a, b), reference::distance(a.0, a.1, b.0, b.1, &draw.distance(&tight())));
        if answer.lower > 0.0 {
            let dual = truth.dual.as_ref().unwrap_or_else(|| panic!("{label}: nothing was proven"));
            assert!(exact(answer.lower) <= proof.parted(&truth.normal, dual), "{label}: not so far apart");
        }
        let upper = exact(answer.upper);
        if answer.upper > 0.0 {
            let square = proof.apart(&truth.x, &truth.y).unwrap_or_else(|| panic!("{label}: no points of the bodies"));
            assert!(square <= &upper * &upper, "{label}: not so near");
        } else {
            assert!(common(&proof, a, b, &answer), "{label}: no common point");
        }
    }
}

/// Whether there is a common point: the witness, else where the polynomial of A is least over B.
fn common(proof: &Proof<'_>, a: Placed<'_>, b: Placed<'_>, answer: &Distance) -> bool {
    let witness = exacts(&answer.witness_a);
    if proof.a.contains(&witness) && proof.b.contains(&witness) {
        return true;
    }
    let level = level_distance(a.0, a.1, b.0, b.1, &tight(), &mut WarmStart::default());
    let truth = reference::level_distance(a.0, a.1, b.0, b.1, &level);
    proof.level_upper(&truth.x).is_some_and(|value| value <= RBig::ONE)
}

#[test]
fn level_distances_are_proven_exactly() {
    let pool = pool();
    for seed in 301_000..301_000 + draws(700) {
        let draw = Draw::new(&pool, seed, &GAPS);
        let (first, second) = draw.placed();
        let (a, b) = if seed % 2 == 0 { (first, second) } else { (second, first) };
        let solve = |options: &Options<'_>| level_distance(a.0, a.1, b.0, b.1, options, &mut WarmStart::default());
        let answer = solve(&draw.options);
        let label = format!("{} odd ones swapped: {answer:?}", draw.label);
        let (proof, truth) = (proof(a, b), reference::level_distance(a.0, a.1, b.0, b.1, &solve(&tight())));
        if answer.lower > f64::NEG_INFINITY {
            let lower = proof.level_lower(&truth.dual).max(proof.least_level());
            assert!(exact(answer.lower) <= lower, "{label}: not so high");
        }
        if answer.upper < f64::INFINITY {
            let level = proof.level_upper(&truth.x).unwrap_or_else(|| panic!("{label}: no point of the body"));
            assert!(level <= exact(answer.upper), "{label}: not so low");
        }
    }
}

#[test]
fn growth_distances_are_proven_exactly() {
    let pool = pool();
    for seed in 302_000..302_000 + draws(700) {
        let draw = Draw::new(&pool, seed, &GAPS);
        let (a, b) = draw.placed();
        let solve = |options: &Options<'_>| growth_distance(a.0, a.1, b.0, b.1, options, &mut WarmStart::default());
        let (answer, found) = (solve(&draw.options), solve(&tight()));
        let label = format!("{}: {answer:?}", draw.label);
        let centers = (a.0.growth_ball().center, b.0.growth_ball().center);
        let normal = found.normal.unwrap_or_else(|| panic!("{label}: no normal"));
        let start = reference::growth::Start { witness: found.witness, value: found.upper, normal };
        let truth = reference::growth::growth_distance((a.0, a.1, &centers.0), (b.0, b.1, &centers.1), &start);
        let truth = truth.unwrap_or_else(|| panic!("{label}: no reference"));
        let proof = proof(a, b);
        let centers = [proof.a.placed(&centers.0), proof.b.placed(&centers.1)];
        assert!(exact(answer.lower) <= proof.growth_lower(&centers, &truth.dual), "{label}: meet sooner");
        let s = number::near(&truth.upper) * (RBig::ONE + exact(2_f64.powi(-90)));
        assert!(s <= exact(answer.upper) && proof.grown_meet(&centers, &s, &truth.contact), "{label}: meet later");
    }
}

/// The ends of depths that one direction proves: the translation along it that takes the bodies
/// apart.
#[test]
fn depths_are_proven_exactly() {
    let pool = pool();
    let (mut proven, mut open) = (0, 0);
    for seed in seeds(303_000, 200, &[304_966, 307_161]) {
        let draw = Draw::new(&pool, seed, &GAPS[9..]);
        let (a, b) = draw.placed();
        let signed = |options: &Options<'_>| signed_distance(a.0, a.1, b.0, b.1, options, &mut WarmStart::default());
        let deep = |options: &Options<'_>| penetration(a.0, a.1, b.0, b.1, options, &mut WarmStart::default());
        // Of directions that are as short within the accuracy, each solve may find another.
        let answer = (signed(&draw.options), deep(&draw.options));
        let ways = [answer, (signed(&tight()), deep(&tight()))].into_iter().flat_map(|(first, second)| {
            let (witness_a, witness_b, normal) = (second.witness_a, second.witness_b, second.direction);
            [first, SignedDistance { witness_a, witness_b, normal, ..first }]
        });
        let proof = proof(a, b);
        let ways = ways.filter_map(|way| {
            let truth = reference::signed::signed_distance(a.0, a.1, b.0, b.1, &way)?;
            Some(proof.parted(&truth.normal, &truth.dual))
        });
        // At edges and corners the best direction need not be a stationary one, which is what the
        // reference looks for.
        let Some(shortest) = ways.max() else {
            open += 1;
            continue;
        };
        proven += 1;
        let (signed, deep) = answer;
        let label = format!("{}: {signed:?} {deep:?}", draw.label);
        assert!(exact(signed.lower) <= shortest, "{label}: deeper than that");
        assert!(exact(deep.upper) >= -shortest, "{label}: deeper than that");
    }
    assert!(replayed() || open < proven / 5, "{proven} proven, {open} open");
}
