//! Families about derivatives: 20, 21.

use crate::bodies::{Placed, b, e, q, zoo};
use crate::random::{Seeded, draws, pose, shifted, turned};
use crate::reference;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::{Body, Compound};
use sublevel::measure::{
    Distance, GrowthDistance, Options, Pose, Twist, WarmStart, distance, growth_distance, level_distance, penetration,
    signed_distance,
};

/// Largest error of a gradient, relative to its norm, angular parts divided by the circumradius of the body that turns.
const ERROR: f64 = 1e-6;

/// Signed gaps of the draws, relative to the smaller body: far, near, grazing, touching, overlapping.
const GAPS: [f64; 14] = [300.0, 10.0, 1.0, 0.1, 1e-2, 1e-4, 1e-6, 1e-8, 0.0, -1e-8, -1e-6, -1e-4, -1e-2, -0.1];

/// Error of a gradient as [`ERROR`] is.
fn deviation(found: &[Twist; 2], truth: &[f64; 12], (a, b): (&Body, &Body)) -> f64 {
    let sizes = [1.0, a.circumscribed().radius, 1.0, b.circumscribed().radius];
    let parts = [found[0].linear, found[0].angular, found[1].linear, found[1].angular];
    let sum = |value: &dyn Fn(usize) -> f64| (0..12).map(|k| (value(k) / sizes[k / 3]).powi(2)).sum::<f64>();
    (sum(&|k| parts[k / 3][k % 3] - truth[k]) / sum(&|k| truth[k])).sqrt()
}

/// The gradients of many answers.
#[derive(Default)]
struct Tally {
    count: u32,
    wrong: u32,
    worst: f64,
    /// Some of those that are wrong, and the worst.
    some: Vec<String>,
    of_worst: String,
}

impl Tally {
    fn add(&mut self, error: f64, label: impl FnOnce() -> String) {
        self.count += 1;
        if !(error <= ERROR) {
            self.wrong += 1;
            let label = format!("{error:.1e}: {}", label());
            if self.some.len() < 8 {
                self.some.push(label.split(": ").take(2).collect::<Vec<_>>().join(" "));
            }
            if !(error <= self.worst) {
                (self.worst, self.of_worst) = (error, label);
            }
        }
    }

    fn verdict(&self, least: u32) {
        let Self { count, wrong, some, of_worst, .. } = self;
        assert!(*count >= least, "only {count} gradients were there to compare");
        assert!(
            *wrong == 0,
            "{wrong} of {count} gradients are off by more than {ERROR:e}: {some:#?}; the worst {of_worst}"
        );
    }
}

/// A random pair at one of the [`GAPS`], and a pose of the second body a short step before.
struct Draw<'a> {
    a: &'a Body,
    b: &'a Body,
    pose_a: Pose,
    pose_b: Pose,
    before: Pose,
    gap: f64,
    label: String,
}

impl<'a> Draw<'a> {
    fn new(zoo: &'a [Body], seed: u64) -> Self {
        let mut random = Seeded(seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let (radius_a, radius_b) = (a.circumscribed().radius, b.circumscribed().radius);
        let (pose_a, far) = (random.pose(0.3), random.pose(2.5 * (radius_a + radius_b)));
        let first = distance(a, &pose_a, b, &far, &tight(), &mut WarmStart::default());
        let n = first.normal.expect("apart");
        let gap = GAPS[(seed % GAPS.len() as u64) as usize];
        // Along the normal both witnesses stay what they are: the gap is what it is meant to be.
        let pose_b = shifted(&far, n * (first.upper - gap * radius_a.min(radius_b)));
        let step = 10_f64.powi(-((seed / 14 % 4) as i32));
        let before = turned(&shifted(&pose_b, random.unit() * 0.1 * step * radius_b), random.unit() * 0.1 * step);
        let label = format!("seed {seed} {}-{} gap {gap:e}", a.name(), b.name());
        Self { a, b, pose_a, pose_b, before, gap, label }
    }

    fn bodies(&self) -> (&'a Body, &'a Body) {
        (self.a, self.b)
    }

    /// A cold answer, and one that continues from the pose before.
    fn answers<T>(&self, solve: impl Fn(Placed<'_>, Placed<'_>, &mut WarmStart) -> T) -> [(&'static str, T); 2] {
        let at = |pose_b: &Pose, warm: &mut WarmStart| solve((self.a, &self.pose_a), (self.b, pose_b), warm);
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
    for seed in 200_000..200_000 + draws(420) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for (kind, answer) in draw.answers(|a, b, warm| distance(a.0, a.1, b.0, b.1, &options, warm)) {
            let Some(found) = answer.gradients(&draw.pose_a, &draw.pose_b) else {
                assert!(draw.gap < 1e-7, "{} {kind}: {answer:?} has no gradients", draw.label);
                continue;
            };
            let truth = reference::distance(draw.a, &draw.pose_a, draw.b, &draw.pose_b, &answer);
            tally.add(deviation(&found, &truth.gradient, draw.bodies()), || {
                format!("{} {kind}: {answer:?}", draw.label)
            });
        }
    }
    tally.verdict(300);
}

/// The same for level distances, in both orders and wherever the multiplier is not zero.
#[test]
fn family_20_level_gradients() {
    let zoo = zoo();
    let mut tally = Tally::default();
    for seed in 201_000..201_000 + draws(280) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for swapped in [false, true] {
            let answers = draw.answers(|a, b, warm| {
                let ((a, pose_a), (b, pose_b)) = if swapped { (b, a) } else { (a, b) };
                (level_distance(a, pose_a, b, pose_b, &options, warm), (a.clone(), *pose_a), (b.clone(), *pose_b))
            });
            for (kind, (answer, (a, pose_a), (b, pose_b))) in answers {
                let label = || format!("{} swapped {swapped} {kind}: {answer:?}", draw.label);
                if answer.saturated {
                    continue;
                }
                let truth = reference::level_distance(&a, &pose_a, &b, &pose_b, &answer);
                let found = [answer.gradient_a, answer.gradient_b];
                tally.add(deviation(&found, &truth.gradient, (&a, &b)), label);
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
    for seed in 202_000..202_000 + draws(500) {
        let draw = Draw::new(&zoo, seed);
        let options = Options::default();
        for (kind, answer) in draw.answers(|a, b, warm| growth_distance(a.0, a.1, b.0, b.1, &options, warm)) {
            let label = || format!("{} {kind}: {answer:?}", draw.label);
            let truth = growth_truth(&draw, &answer).unwrap_or_else(|| panic!("{}: no reference", label()));
            let found = answer.gradients.unwrap_or_else(|| panic!("{}: no gradients", label()));
            tally.add(deviation(&found, &truth.gradient, draw.bodies()), label);
        }
    }
    tally.verdict(300);
}

fn growth_truth(draw: &Draw<'_>, answer: &GrowthDistance) -> Option<reference::growth::Truth> {
    let (center_a, center_b) = (draw.a.growth_ball().center, draw.b.growth_ball().center);
    let start = reference::growth::Start { witness: answer.witness, value: answer.upper, normal: answer.normal? };
    reference::growth::growth_distance((draw.a, &draw.pose_a, &center_a), (draw.b, &draw.pose_b, &center_b), &start)
}

/// The same for signed distances on both sides of contact and at it, away from ties.
#[test]
fn family_20_signed_gradients() {
    let zoo = zoo();
    let (mut tally, mut tied) = (Tally::default(), 0);
    for seed in 203_000..203_000 + draws(280) {
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
            let truth = reference::signed::signed_distance(draw.a, &draw.pose_a, draw.b, &draw.pose_b, &answer)
                .unwrap_or_else(|| panic!("{}: no reference", label()));
            let found = answer.gradients.unwrap_or_else(|| panic!("{}: no gradients", label()));
            tally.add(deviation(&found, &truth.gradient, draw.bodies()), label);
        }
    }
    assert!(tied < tally.count / 2, "{tied} of {} are tied", tally.count);
    tally.verdict(300);
}

/// Whether an answer flags a tie, and its normal.
type Flagged = (bool, Vector3<f64>);

/// Ties and switching gradients: symmetric poses: two ways out of a box, across a plate, along mirror planes. The flag is set
/// where they are equally short, and wherever the normal jumps.
#[test]
fn family_21_ties_and_switching_gradients() {
    let balls = [e(0.2, 0.2, 0.2), q(4, 0.3, 0.2, 0.25), b(0.3, 0.2, 0.25), q(8, 0.2, 0.3, 0.2)];
    let hosts = [b(1.0, 1.0, 1.0), b(1.0, 0.5, 2.0), q(8, 1.0, 1.0, 1.0), e(1.0, 1.0, 1.5), q(4, 1.0, 0.5, 1.0)];
    let mut jumps = 0;
    for seed in 0..draws(60) {
        let mut random = Seeded(210_000 + seed);
        let (a, host) = (&balls[random.index(balls.len())], &hosts[random.index(hosts.len())]);
        // Both turned alike; half of the time by nothing, so that ties are exact.
        let turn = if seed % 2 == 0 { UnitQuaternion::identity() } else { random.rotation() };
        let still = pose(Vector3::zeros(), &turn);
        let depth_accuracy = [1e-3, 1e-5][(seed / 2 % 2) as usize];
        let options = Options::default().with_depth_accuracy(depth_accuracy).expect("in range");
        let solve = |x: Vector3<f64>, warm: &mut WarmStart, label: &str| -> Flagged {
            let moved = pose(turn * x, &turn);
            let answer = signed_distance(a, &moved, host, &still, &options, warm);
            let deep = penetration(a, &moved, host, &still, &options, &mut WarmStart::default());
            let label = format!("{label}: {answer:?} {deep:?}");
            assert!(answer.upper < 0.0, "{label}");
            // The same bracketed depth, and untied the same way out.
            assert!(deep.lower <= -answer.lower && -answer.upper <= deep.upper, "{label}");
            let (n, m) = (answer.normal.expect("a way out"), deep.direction.expect("a way out"));
            assert!(answer.tied || deep.tied || (n - m).norm() < 1e-3, "{label}");
            (answer.tied || deep.tied, n)
        };
        // At the common centre every way out has its mirror image.
        let (tied, _) = solve(Vector3::zeros(), &mut WarmStart::default(), &format!("seed {seed} concentric"));
        assert!(tied, "seed {seed} {}-{}: concentric and not flagged", a.name(), host.name());
        // Mirror planes of the pair between two of its ways out: through the centre, and across a diagonal of cubes.
        let from = Vector3::from_fn(|_, _| 0.3 * random.signed());
        let mirrored = Vector3::new(-from.x, from.y, from.z);
        let label = format!("seed {seed} {}-{} from {from:?}", a.name(), host.name());
        jumps += jumps_are_flagged(&from, &mirrored, |x, warm| solve(x, warm, &label));
        let axis = random.index(3);
        let other = Vector3::from_fn(|i, _| if i == axis { 0.35 } else { 0.05 * random.signed() });
        jumps += jumps_are_flagged(&from, &other, |x, warm| solve(x, warm, &label));
    }
    assert!(jumps >= 20, "only {jumps} jumps were met");
}

/// Follows a line from one point to another in small steps, and narrows down each jump of the normal until a flag is met;
/// returns the number of jumps.
fn jumps_are_flagged(
    from: &Vector3<f64>,
    to: &Vector3<f64>,
    solve: impl Fn(Vector3<f64>, &mut WarmStart) -> Flagged,
) -> u32 {
    let at = |t: f64| from + (to - from) * t;
    let mut warm = WarmStart::default();
    let mut last = (0.0, solve(at(0.0), &mut warm));
    let mut jumps = 0;
    for k in 1..=20 {
        let t = f64::from(k) / 20.0;
        let found = solve(at(t), &mut warm);
        let (mut low, mut high) = (last, (t, found));
        let jumped = |p: &Flagged, q: &Flagged| !p.0 && !q.0 && (p.1 - q.1).norm() > 0.3;
        if jumped(&low.1, &high.1) {
            jumps += 1;
            while jumped(&low.1, &high.1) {
                let middle = 0.5 * (low.0 + high.0);
                assert!(high.0 - low.0 > 1e-12, "the normal jumps at {} without a flag: {low:?} {high:?}", at(middle));
                let found = (middle, solve(at(middle), &mut WarmStart::default()));
                *(if jumped(&low.1, &found.1) { &mut high } else { &mut low }) = found;
            }
        }
        last = (t, found);
    }
    jumps
}

/// Minimum over pairs: the gradient of a distance of compounds is that of its closest parts wherever those are closest by more
/// than the accuracy, and the value goes on where they change.
#[test]
fn family_21_minimum_over_pairs() {
    let mut changes = 0;
    for seed in 0..draws(60) {
        let mut random = Seeded(211_000 + seed);
        let part = |random: &mut Seeded, side: f64| {
            let body = if random.index(2) == 0 { e(0.5, 0.3, 0.4) } else { q(4, 0.4, 0.5, 0.3) };
            body.moved(&random.rotation(), &Vector3::new(side, 0.0, 0.0)).expect("finite")
        };
        let parts = vec![part(&mut random, -1.0), part(&mut random, 1.0)];
        let both = Compound::new("both", parts.clone()).expect("two parts");
        let other = q(6, 0.6, 0.5, 0.4);
        let (frame, turn) = (random.pose(0.1), random.rotation());
        let options = Options::default();
        let least = parts.iter().map(|part| part.circumscribed().radius).fold(f64::INFINITY, f64::min);
        let least = least.min(other.circumscribed().radius);
        let mut warm = WarmStart::default();
        let mut last: Option<(Distance, usize, Vector3<f64>)> = None;
        for k in -40..=40 {
            // Finer and finer towards the middle, where the closest parts change.
            let x = f64::from(i32::signum(k)) * 10_f64.powf((f64::from(k.abs()) - 40.0) * 0.25);
            let place = frame.transform_point(&Vector3::new(x, 2.0, 0.3));
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
