//! Families about derivatives: 20, 21.

use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::{Body, Compound};
use sublevel_core::measure::{
    Distance, GrowthDistance, Options, Pose, Twist, WarmStart, WithinMargin, distance, growth_distance, level_distance,
    penetration, signed_distance, within_margin,
};
use sublevel_testkit::bodies::{Placed, e, zoo};
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::catalogue::derivatives::{GAPS, apart};
use sublevel_testkit::catalogue::ties::{Flagged, Parts, any_parts, follow, ways_out};
use sublevel_testkit::random::{Seeded, draws, pose, replayed, seeds, shifted, turned, twisted};
use sublevel_testkit::reference;
use sublevel_testkit::reference::big::{Big, double};

/// Largest error of a gradient, relative to its norm, angular parts divided by the circumradius of
/// the body that turns.
const ERROR: f64 = 1e-6;

/// Error of a gradient as [`ERROR`] is.
fn deviation(found: &[Twist; 2], truth: &[f64; 12], (a, b): (&Body, &Body)) -> f64 {
    let sizes = [1.0, a.circumscribed().radius, 1.0, b.circumscribed().radius];
    let parts = [found[0].linear, found[0].angular, found[1].linear, found[1].angular];
    let sum = |value: &dyn Fn(usize) -> f64| (0..12).map(|k| (value(k) / sizes[k / 3]).powi(2)).sum::<f64>();
    (sum(&|k| parts[k / 3][k % 3] - truth[k]) / sum(&|k| truth[k])).sqrt()
}

/// Steps to look around a kink by, and how far from it a pose may be that brackets do not
/// distinguish from it; relative to the smaller body.
const AROUND: f64 = 1e-7;
const ROUNDED: f64 = 1e-11;

/// Widest bracket of values to look around by.
const SHARP: f64 = 1e-25;

/// Whether a gradient at a kink, where edges touch, is one of those between that of one side and
/// that of the other: along no twist does the value grow by less than it says. Values of 200 bits
/// by poses.
fn is_subgradient(draw: &Draw, found: &[Twist; 2], value: impl Fn(&Pose, &Pose) -> Big) -> bool {
    let edged = draw.a.constraints().len() > 1 || draw.b.constraints().len() > 1;
    if draw.gap != 0.0 || !edged {
        return false;
    }
    let parts = [found[0].linear, found[0].angular, found[1].linear, found[1].angular];
    let sizes = [1.0, draw.a.circumscribed().radius, 1.0, draw.b.circumscribed().radius];
    let size = (0..12).map(|k| (parts[k / 3][k % 3] / sizes[k / 3]).powi(2)).sum::<f64>().sqrt();
    let small = sizes[1].min(sizes[3]);
    let here = value(&draw.pose_a, &draw.pose_b);
    (0..24).all(|k| {
        let (k, sign) = (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 });
        let step = sign * AROUND * small / sizes[k / 3];
        let there = value(&twisted(&draw.pose_a, k, 0, step), &twisted(&draw.pose_b, k, 6, step));
        let grown = double(&(there - &here));
        grown - parts[k / 3][k % 3] * step >= -size * small * (ERROR * AROUND + ROUNDED)
    })
}

/// The gradients of many answers.
#[derive(Default)]
struct Tally {
    count: u32,
    /// Those at a kink that are some of many.
    kinks: u32,
    wrong: u32,
    worst: f64,
    /// Some of those that are wrong, and the worst.
    some: Vec<String>,
    of_worst: String,
}

impl Tally {
    fn add(&mut self, error: f64, label: impl FnOnce() -> String, at_kink: impl FnOnce() -> bool) {
        self.count += 1;
        if error <= ERROR {
            return;
        }
        if at_kink() {
            self.kinks += 1;
        } else {
            self.wrong += 1;
            let label = format!("{error:.1e}: {}", label());
            if self.some.len() < 99 {
                self.some.push(label.split(": ").take(2).collect::<Vec<_>>().join(" "));
            }
            if !(error <= self.worst) {
                (self.worst, self.of_worst) = (error, label);
            }
        }
    }

    fn verdict(&self, least: u32) {
        let Self { count, kinks, wrong, some, of_worst, .. } = self;
        assert!(
            *wrong == 0,
            "{wrong} of {count} gradients are off by more than {ERROR:e}: {some:#?}; the worst {of_worst}"
        );
        // Some are among those that have failed before.
        assert!(*kinks <= 12 + count / 1000 || replayed(), "{kinks} of {count} are at kinks");
        assert!(*count >= least || replayed(), "only {count} gradients were there to compare");
    }
}

/// A random pair at one of the [`GAPS`], and a pose of the second body a short step before.
struct Draw {
    a: Body,
    b: Body,
    pose_a: Pose,
    pose_b: Pose,
    before: Pose,
    gap: f64,
    label: String,
}

impl Draw {
    fn new(zoo: &[Body], seed: u64) -> Self {
        let mut random = Seeded(seed);
        let Case { a, pose_a, b, pose_b: far, .. } = apart(zoo, &mut random);
        let (radius_a, radius_b) = (a.circumscribed().radius, b.circumscribed().radius);
        let first = distance(&a, &pose_a, &b, &far, &tight(), &mut WarmStart::default());
        let n = first.normal.expect("apart");
        let gap = GAPS[(seed % GAPS.len() as u64) as usize];
        // Along the normal both witnesses stay what they are: the gap is what it is meant to be.
        let pose_b = shifted(&far, n * (first.upper - gap * radius_a.min(radius_b)));
        let step = 10_f64.powi(-((seed / 14 % 4) as i32));
        let before = turned(&shifted(&pose_b, random.unit() * 0.1 * step * radius_b), random.unit() * 0.1 * step);
        let label = format!("seed {seed} {}-{} gap {gap:e}", a.name(), b.name());
        Self { a, b, pose_a, pose_b, before, gap, label }
    }

    fn bodies(&self) -> (&Body, &Body) {
        (&self.a, &self.b)
    }

    /// A cold answer, and one that continues from the pose before.
    fn answers<T>(&self, solve: impl Fn(Placed<'_>, Placed<'_>, &mut WarmStart) -> T) -> [(&'static str, T); 2] {
        let at = |pose_b: &Pose, warm: &mut WarmStart| solve((&self.a, &self.pose_a), (&self.b, pose_b), warm);
        let mut warm = WarmStart::default();
        at(&self.before, &mut warm);
        [("cold", at(&self.pose_b, &mut WarmStart::default())), ("warm", at(&self.pose_b, &mut warm))]
    }
}

fn tight() -> Options<'static> {
    Options::default().with_accuracy(1e-12).expect("in range")
}

/// Gradient is not the derivative of the value: the distance, from far to grazing.
#[test]
fn family_20_distance_gradients() {
    let zoo = zoo();
    let mut tally = Tally::default();
    for seed in seeds(200_000, 420, &[200_719, 201_547, 204_239, 210_637, 213_360, 216_230]) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for (kind, answer) in draw.answers(|a, b, warm| distance(a.0, a.1, b.0, b.1, &options, warm)) {
            let Some(found) = answer.gradients(&draw.pose_a, &draw.pose_b) else {
                assert!(draw.gap < 1e-7, "{} {kind}: {answer:?} has no gradients", draw.label);
                continue;
            };
            let truth = reference::distance(&draw.a, &draw.pose_a, &draw.b, &draw.pose_b, &answer);
            let label = || format!("{} {kind}: {answer:?}", draw.label);
            tally.add(deviation(&found, &truth.gradient, draw.bodies()), label, || false);
        }
    }
    tally.verdict(300);
}

/// The same where the answer is that of one of several parts, whose bracket was narrowed while
/// another one's was known, and where it was asked for within a margin: bodies with edges, whose
/// brackets do not determine the normal.
#[test]
fn family_20_gradients_of_parts_and_within_margins() {
    let zoo = zoo();
    let mut tally = Tally::default();
    for seed in seeds(204_000, 840, &[204_239, 210_637]) {
        let draw = Draw::new(&zoo, seed);
        let edged = draw.a.constraints().len() > 1 || draw.b.constraints().len() > 1;
        if !edged || draw.gap < 1e-8 {
            continue;
        }
        let options = Options::default();
        let alone = distance(&draw.a, &draw.pose_a, &draw.b, &draw.pose_b, &tight(), &mut WarmStart::default());
        let behind = draw.pose_a.rotation().inverse_transform_vector(&alone.normal.expect("apart"));
        // Behind the body, but by the look of its ball nearer: it is asked about first.
        let (ball, across) = (draw.a.circumscribed(), behind.cross(&Vector3::ith(behind.iamin(), 1.0)));
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &across).unwrap_or_default();
        let needle = e(0.01 * ball.radius, 0.01 * ball.radius, 5.0 * ball.radius);
        let needle = needle.moved(&turn, &(ball.center + behind * (3.0 * ball.radius))).expect("finite");
        let both = Compound::new("both", vec![needle, draw.a.clone()]).expect("two parts");
        let mut warm = WarmStart::default();
        let of_part = distance(&both, &draw.pose_a, &draw.b, &draw.pose_b, &options, &mut warm);
        let mut warm = WarmStart::default();
        let margin = 2.0 * alone.upper;
        let within = within_margin(&draw.a, &draw.pose_a, &draw.b, &draw.pose_b, margin, &options, &mut warm);
        let WithinMargin::Within(within) = within.expect("a margin") else { panic!("{}: beyond", draw.label) };
        for (kind, answer) in [("part", of_part), ("within", within)] {
            let label = || format!("{} {kind}: {answer:?}", draw.label);
            let Some(found) = answer.gradients(&draw.pose_a, &draw.pose_b) else {
                assert!(draw.gap < 1e-7, "{} has no gradients", label());
                continue;
            };
            assert!(kind == "within" || answer.parts == [1, 0], "{}", label());
            let truth = reference::distance(&draw.a, &draw.pose_a, &draw.b, &draw.pose_b, &answer);
            tally.add(deviation(&found, &truth.gradient, draw.bodies()), label, || false);
        }
    }
    tally.verdict(150);
}

fn ordered<'a>(swapped: bool, a: Placed<'a>, b: Placed<'a>) -> (Placed<'a>, Placed<'a>) {
    if swapped { (b, a) } else { (a, b) }
}

/// The same for level distances, in both orders and wherever the multiplier is not zero.
#[test]
fn family_20_level_gradients() {
    let zoo = zoo();
    let mut tally = Tally::default();
    for seed in seeds(201_000, 280, &[202_994, 206_564, 208_146, 208_398, 210_358, 213_864]) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for swapped in [false, true] {
            let answers = draw.answers(|a, b, warm| {
                let (a, b) = ordered(swapped, a, b);
                level_distance(a.0, a.1, b.0, b.1, &options, warm)
            });
            for (kind, answer) in answers {
                let (a, b) = ordered(swapped, (&draw.a, &draw.pose_a), (&draw.b, &draw.pose_b));
                let label = || format!("{} swapped {swapped} {kind}: {answer:?}", draw.label);
                if answer.saturated {
                    continue;
                }
                let truth = reference::level_distance(a.0, a.1, b.0, b.1, &answer);
                let found = [answer.gradient_a, answer.gradient_b];
                let value = |pose_a: &Pose, pose_b: &Pose| {
                    let (a, b) = ordered(swapped, (&draw.a, pose_a), (&draw.b, pose_b));
                    let answer = level_distance(a.0, a.1, b.0, b.1, &options, &mut WarmStart::default());
                    let truth = reference::level_distance(a.0, a.1, b.0, b.1, &answer);
                    assert!(truth.width() <= SHARP, "{}: {truth:?}", label());
                    truth.upper
                };
                let of_draw = if swapped { [found[1], found[0]] } else { found };
                let error = deviation(&found, &truth.gradient, (a.0, b.0));
                tally.add(error, label, || is_subgradient(&draw, &of_draw, value));
            }
        }
    }
    tally.verdict(300);
}

/// The same for growth distances, apart and in overlap.
#[test]
fn family_20_growth_gradients() {
    let zoo = zoo();
    let mut tally = Tally::default();
    for seed in seeds(202_000, 500, &[206_801, 207_992, 208_146, 210_358, 226_520]) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for (kind, answer) in draw.answers(|a, b, warm| growth_distance(a.0, a.1, b.0, b.1, &options, warm)) {
            let label = || format!("{} {kind}: {answer:?}", draw.label);
            let truth = growth_truth((&draw.a, &draw.pose_a), (&draw.b, &draw.pose_b), &answer)
                .unwrap_or_else(|| panic!("{}: no reference", label()));
            let found = answer.gradients.unwrap_or_else(|| panic!("{}: no gradients", label()));
            let value = |pose_a: &Pose, pose_b: &Pose| {
                let answer = growth_distance(&draw.a, pose_a, &draw.b, pose_b, &options, &mut WarmStart::default());
                let truth = growth_truth((&draw.a, pose_a), (&draw.b, pose_b), &answer).expect("a reference");
                assert!(truth.width() <= SHARP, "{}: {truth:?}", label());
                truth.upper
            };
            let error = deviation(&found, &truth.gradient, draw.bodies());
            tally.add(error, label, || is_subgradient(&draw, &found, value));
        }
    }
    tally.verdict(300);
}

fn growth_truth(a: Placed<'_>, b: Placed<'_>, answer: &GrowthDistance) -> Option<reference::growth::Truth> {
    let (center_a, center_b) = (a.0.growth_ball().center, b.0.growth_ball().center);
    let start = reference::growth::Start { witness: answer.witness, value: answer.upper, normal: answer.normal? };
    reference::growth::growth_distance((a.0, a.1, &center_a), (b.0, b.1, &center_b), &start)
}

/// The same for signed distances on both sides of contact and at it, away from ties.
#[test]
fn family_20_signed_gradients() {
    let zoo = zoo();
    let (mut tally, mut tied) = (Tally::default(), 0);
    for seed in seeds(203_000, 280, &[203_695, 205_502, 206_148, 206_283, 206_801, 210_637, 220_104]) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for (kind, answer) in draw.answers(|a, b, warm| signed_distance(a.0, a.1, b.0, b.1, &options, warm)) {
            let label = || format!("{} {kind}: {answer:?}", draw.label);
            // Where edges touch, the derivative on one side is not the one on the other.
            let edged = draw.a.constraints().len() > 1 || draw.b.constraints().len() > 1;
            if answer.tied || answer.at_contact && edged {
                tied += 1;
                continue;
            }
            let truth = reference::signed::signed_distance(&draw.a, &draw.pose_a, &draw.b, &draw.pose_b, &answer)
                .unwrap_or_else(|| panic!("{}: no reference", label()));
            let found = answer.gradients.unwrap_or_else(|| panic!("{}: no gradients", label()));
            tally.add(deviation(&found, &truth.gradient, draw.bodies()), label, || false);
        }
    }
    assert!(tied < tally.count / 2, "{tied} of {} are tied", tally.count);
    tally.verdict(300);
}

/// Ties and switching gradients: symmetric poses: two ways out of a box, across a plate, along
/// mirror planes. The flag is set where they are equally short, and wherever the normal jumps.
#[test]
fn family_21_ties_and_switching_gradients() {
    let mut jumps = 0;
    for seed in 0..draws(60) {
        let mut random = Seeded(210_000 + seed);
        // Half of the time turned by nothing, so that ties are exact.
        let turn = if seed % 2 == 0 { UnitQuaternion::identity() } else { random.rotation() };
        let case = ways_out(&turn, &mut random);
        let (a, host, still) = (&case.inner, &case.host, case.still());
        let options = Options::default().with_depth_accuracy(case.depth_accuracy).expect("in range");
        let solve = |x: Vector3<f64>, warm: &mut WarmStart, label: &str| -> Flagged {
            let moved = case.place(&x);
            let answer = signed_distance(a, &moved, host, &still, &options, warm);
            let deep = penetration(a, &moved, host, &still, &options, &mut WarmStart::default());
            let label = format!("{label}: {answer:?} {deep:?}");
            assert!(answer.upper < 0.0, "{label}");
            // The same bracketed depth, and untied the same translation out.
            assert!(deep.lower <= -answer.lower && -answer.upper <= deep.upper, "{label}");
            let (n, m) = (answer.normal.expect("a way out"), deep.direction.expect("a way out"));
            assert!(answer.tied || deep.tied || (n - m).norm() < 1e-3, "{label}");
            (answer.tied || deep.tied, n)
        };
        // At the common centre every translation out has its mirror image.
        let (tied, _) = solve(Vector3::zeros(), &mut WarmStart::default(), &format!("seed {seed} concentric"));
        assert!(tied, "seed {seed} {}-{}: concentric and not flagged", a.name(), host.name());
        // Mirror planes of the pair between two of its ways out: through the centre, and across a
        // diagonal of cubes.
        for [from, to] in &case.lines {
            let label = format!("seed {seed} {}-{} from {from:?}", a.name(), host.name());
            let line = follow(false, |t, warm| solve(from + (to - from) * t, warm, &label));
            assert!(line.unflagged.is_none(), "{label}: the normal jumps without a flag: {line:?}");
            jumps += line.count;
        }
    }
    assert!(jumps >= 20, "only {jumps} jumps were met");
}

/// Minimum over pairs: the gradient of a distance of compounds is that of its closest parts
/// wherever those are closest by more than the accuracy, and the value goes on where they change.
#[test]
fn family_21_minimum_over_pairs() {
    let mut changes = 0;
    for seed in 0..draws(60) {
        let mut random = Seeded(211_000 + seed);
        let Parts { parts, both, third: other } = any_parts(&mut random);
        let (frame, turn) = (random.pose(0.1), random.rotation());
        let options = Options::default();
        let least = parts.iter().map(|part| part.circumscribed().radius).fold(f64::INFINITY, f64::min);
        let least = least.min(other.circumscribed().radius);
        let mut warm = WarmStart::default();
        let mut last: Option<(Distance, usize, Vector3<f64>)> = None;
        for k in -40..=40 {
            // Finer and finer towards the middle, where the closest parts change.
            let x = f64::from(i32::signum(k)) * 10_f64.powf((f64::from(k.abs()) - 40.0) * 0.25);
            let place = frame.transform_point(&Parts::passing(x));
            let pose_b = pose(place, &turn);
            let found = distance(&both, &frame, &other, &pose_b, &options, &mut warm);
            let each: Vec<_> = parts
                .iter()
                .map(|part| distance(part, &frame, &other, &pose_b, &options, &mut WarmStart::default()))
                .collect();
            let closest = usize::from(each[1].upper < each[0].upper);
            let label = format!("seed {seed} x {x:e}: {found:?} {each:?}");
            let slack = 1e-9 * least;
            assert!((found.value() - each[closest].value()).abs() <= slack, "{label}");
            if (each[0].value() - each[1].value()).abs() > 2.0 * slack {
                let truth = reference::distance(&parts[closest], &frame, &other, &pose_b, &each[closest]);
                let gradients = found.gradients(&frame, &pose_b).expect("apart");
                let error = deviation(&gradients, &truth.gradient, (&parts[closest], &other));
                assert!(error <= ERROR, "{label}: off by {error:e}");
            }
            if let Some((before, part, from)) = last {
                let moved = (place - from).norm() + slack;
                assert!((found.value() - before.value()).abs() <= moved, "{label} after {before:?}");
                changes += u32::from(part != closest);
            }
            last = Some((found, closest, place));
        }
    }
    assert!(changes > 20, "the closest parts changed {changes} times");
}
