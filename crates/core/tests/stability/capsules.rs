//! Families 1, 2, 7, 9 to 13, 18 and 19 with capsules, segments and points against boxes,
//! cylinders, balls and each other: the distance of a point has closed forms, and along an axis it
//! is convex.

use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{
    Capsule, CapsuleDistance, Decision, Options, Pose, Status, WarmStart, distance_of_capsules, distance_to_capsule,
    overlap_with_capsule,
};
use sublevel_testkit::random::{Seeded, draws, pose};

/// A shape about the origin whose distance from a point has a closed form.
#[derive(Clone, Copy, Debug)]
enum Form {
    Ball(f64),
    Cuboid([f64; 3]),
    Cylinder(f64, f64),
}

/// A form and its body.
struct Known {
    form: Form,
    body: Body,
}

impl Known {
    fn new(form: Form) -> Self {
        let body = match form {
            Form::Ball(radius) => Body::ball("ball", Vector3::zeros(), radius),
            Form::Cuboid(half) => Body::cuboid("box", half.into()),
            Form::Cylinder(radius, half) => Body::cylinder("cylinder", radius, half),
        };
        Self { form, body: body.expect("sizes are positive") }
    }

    /// One of the three with sizes about this, over one decade.
    fn about(size: f64, random: &mut Seeded) -> Self {
        let kind = random.index(3);
        let [x, y, z] = [(); 3].map(|()| size * random.between(0.3, 3.0));
        Self::new(match kind {
            0 => Form::Ball(x),
            1 => Form::Cuboid([x, y, z]),
            _ => Form::Cylinder(x, z),
        })
    }

    /// Distance of a point of its frame from the outside, 0 there.
    fn depth(&self, p: &Vector3<f64>) -> f64 {
        match self.form {
            Form::Ball(radius) => (radius - p.norm()).max(0.0),
            Form::Cuboid(half) => (0..3).map(|i| half[i] - p[i].abs()).fold(f64::INFINITY, f64::min).max(0.0),
            Form::Cylinder(radius, half) => (radius - p.x.hypot(p.y)).min(half - p.z.abs()).max(0.0),
        }
    }

    /// Distance of a point of its frame; 0 inside, of a ball minus the depth, which is known of it.
    fn distance(&self, p: &Vector3<f64>) -> f64 {
        match self.form {
            Form::Ball(radius) => p.norm() - radius,
            Form::Cuboid(half) => Vector3::from_fn(|i, _| (p[i].abs() - half[i]).max(0.0)).norm(),
            Form::Cylinder(radius, half) => (p.x.hypot(p.y) - radius).max(0.0).hypot((p.z.abs() - half).max(0.0)),
        }
    }
}

/// Signed distance of a shape about the origin from a capsule by golden sections along the axis,
/// which know nothing of derivatives; and whether the depth is known: the axis is outside, or the
/// shape is a ball.
fn truth(known: &Known, capsule: &Capsule, at: &Pose) -> (f64, bool) {
    let axis = at.transform_direction(&Vector3::z());
    let value = |t: f64| known.distance(&(at.translation() + axis * t));
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut low, mut high) = (-capsule.half_height_m(), capsule.half_height_m());
    let mut least = value(low).min(value(high));
    for _ in 0..100 {
        let (p, q) = (high - golden * (high - low), low + golden * (high - low));
        let (of_p, of_q) = (value(p), value(q));
        least = least.min(of_p).min(of_q);
        if of_p <= of_q { high = q } else { low = p }
    }
    (least - capsule.radius_m(), least > 0.0 || matches!(known.form, Form::Ball(_)))
}

/// What every answer has to be: a bracket around the truth with a true status and finite
/// numbers, from a hint or none; a decision that the truth allows.
fn judged(known: &Known, capsule: &Capsule, at: &Pose, warm: &mut WarmStart, label: &str) -> CapsuleDistance {
    let (Known { form, body }, origin, options) = (known, Pose::identity(), Options::default());
    let found = distance_to_capsule(body, &origin, capsule, at, &options, warm);
    let (truth, outside) = truth(known, capsule, at);
    let label = format!("{label}: {form:?} {capsule:?} {at:?}: {found:?} against {truth:e}");
    let size = body.circumscribed().radius + capsule.reach_m() + at.translation().norm();
    let slack = 64.0 * f64::EPSILON * size;
    assert!(found.lower <= truth + slack || !outside, "{label}");
    assert!(found.upper >= truth - slack, "{label}");
    assert!(found.upper.is_finite() && found.lower <= found.upper, "{label}");
    let small = body.circumscribed().radius.min(if capsule.reach_m() > 0.0 { capsule.reach_m() } else { f64::MAX });
    let narrow = found.upper - found.lower <= options.accuracy() * small * (1.0 + 1e-12);
    assert!(narrow || found.status == Status::BracketWide, "claims to have converged, {label}");
    for number in found.witness.iter().chain(&found.witness_of_capsule).chain(found.normal.iter().flatten()) {
        assert!(number.is_finite(), "{label}");
    }
    // A point of the axis that is well inside is a proof within reach.
    let middle = known.depth(at.translation()) > 1e-6 * size;
    match overlap_with_capsule(body, &origin, capsule, at, &options, &mut WarmStart::default()) {
        Decision::Yes => assert!(truth <= slack, "{label}"),
        Decision::No => assert!(truth >= -slack && !middle, "{label}"),
        Decision::Undecided { .. } => assert!(!middle && truth.abs() <= 2.0 * slack + 1e-9 * small, "{label}"),
    }
    found
}

/// A capsule of about this size: every fifth a segment, every fifth a ball, every fifth a point.
fn capsule(size: f64, random: &mut Seeded) -> Capsule {
    let (radius, half) = (size * random.between(0.1, 3.0), size * random.between(0.1, 3.0));
    match random.index(5) {
        0 => Capsule::new(0.0, half),
        1 => Capsule::new(radius, 0.0),
        2 => Capsule::new(0.0, 0.0),
        _ => Capsule::new(radius, half),
    }
    .expect("sizes are not negative")
}

/// Somewhere about the shape: mostly apart, sometimes in it.
fn somewhere(known: &Known, capsule: &Capsule, random: &mut Seeded) -> Pose {
    let reach = known.body.circumscribed().radius + capsule.reach_m();
    pose(random.unit() * (reach * random.between(0.2, 3.0)), &random.rotation())
}

#[test]
fn family_01_kissing_contact() {
    for seed in 0..draws(300) {
        let mut random = Seeded(510_000 + seed);
        let known = Known::about(1.0, &mut random);
        let capsule = capsule(1.0, &mut random);
        let mut at = somewhere(&known, &capsule, &mut random);
        let first = judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed}"));
        let Some(n) = first.normal else { continue };
        let mut last = f64::INFINITY;
        for gap in [1e-2, 1e-6, 1e-9, 1e-12, 1e-15, 0.0, -1e-15, -1e-12, -1e-9, -1e-6, -1e-2] {
            let label = format!("seed {seed} gap {gap:e}");
            // From the capsule to the shape: along it the capsule comes closer.
            let (now, outside) = truth(&known, &capsule, &at);
            if !outside || now + capsule.radius_m() <= 0.0 {
                break;
            }
            at = at.with_translation(at.translation() + n * (now - gap));
            let found = judged(&known, &capsule, &at, &mut WarmStart::default(), &label);
            // So near to the axis no double knows the normal.
            if gap + capsule.radius_m() > 1e-8 {
                assert!(found.value() <= last + 1e-14, "{label}: {found:?} after {last:e}");
                assert!((found.value() - gap).abs() <= 1e-12, "{label}: {found:?}");
                let normal = found.normal.expect("the axis is outside");
                assert!((normal - n).norm() < 1e-3, "{label}: {normal:?} after {n:?}");
                last = found.value();
            }
        }
    }
}

#[test]
fn family_02_limits_are_reported() {
    for seed in 0..draws(300) {
        let mut random = Seeded(520_000 + seed);
        let known = Known::about(1.0, &mut random);
        let capsule = capsule(1.0, &mut random);
        let at = somewhere(&known, &capsule, &mut random);
        let (truth, outside) = truth(&known, &capsule, &at);
        for limit in [1, 2, 3] {
            let options = Options::default().with_max_iterations(limit).expect("in range");
            let Known { form, body } = &known;
            let found =
                distance_to_capsule(body, &Pose::identity(), &capsule, &at, &options, &mut WarmStart::default());
            let label = format!("seed {seed} limit {limit}: {form:?} {capsule:?}: {found:?} against {truth:e}");
            assert!(found.upper >= truth - 1e-14 && (found.lower <= truth + 1e-14 || !outside), "{label}");
            assert!(found.iterations <= limit, "{label}");
        }
    }
}

#[test]
fn family_07_coincident_centres() {
    for seed in 0..draws(200) {
        let mut random = Seeded(570_000 + seed);
        let known = Known::about(1.0, &mut random);
        let capsule = capsule(1.0, &mut random);
        for offset in [0.0, 1e-18, 1e-12, 1e-6] {
            let at = pose(random.unit() * offset, &random.rotation());
            let found = judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed} {offset:e}"));
            assert!(found.upper <= 0.0, "seed {seed} {offset:e}: {found:?}");
        }
    }
}

#[test]
fn family_09_size_ratio() {
    // Of the last two, micrometres in metres, overlaps were left open.
    for seed in (0..draws(600)).chain([617, 1007]) {
        let mut random = Seeded(590_000 + seed);
        let ratio = 10_f64.powi(random.index(13) as i32 - 6);
        let known = Known::about(1.0, &mut random);
        let capsule = capsule(ratio, &mut random);
        let at = somewhere(&known, &capsule, &mut random);
        judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed} ratio {ratio:e}"));
    }
}

/// Where an axis is deep inside, no rounding decides, however small the capsule is.
#[test]
fn small_capsules_deep_inside_overlap() {
    let (options, mut met) = (Options::default(), 0);
    for seed in 0..draws(600) {
        let mut random = Seeded(595_000 + seed);
        let known = Known::about(1.0, &mut random);
        let capsule = capsule(10_f64.powi(-1 - random.index(9) as i32), &mut random);
        let at = pose(random.unit() * random.between(1e-3, 1.0), &random.rotation());
        if known.depth(at.translation()) < 0.1 {
            continue;
        }
        met += 1;
        let found =
            overlap_with_capsule(&known.body, &Pose::identity(), &capsule, &at, &options, &mut WarmStart::default());
        assert_eq!(found, Decision::Yes, "seed {seed}: {:?} {capsule:?} {at:?}", known.form);
    }
    assert!(met > 100, "{met}");
}

#[test]
fn family_10_far_from_the_origin() {
    for seed in 0..draws(100) {
        let mut random = Seeded(600_000 + seed);
        let known = Known::about(1.0, &mut random);
        let (body, capsule) = (&known.body, capsule(1.0, &mut random));
        let at = somewhere(&known, &capsule, &mut random);
        let near = judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed}"));
        for power in 0..=9 {
            let far = random.unit() * 10_f64.powi(power);
            let (origin, moved) = (Pose::identity().with_translation(far), at.with_translation(at.translation() + far));
            let found =
                distance_to_capsule(body, &origin, &capsule, &moved, &Options::default(), &mut WarmStart::default());
            let bound = 1e-9 + 4.0 * f64::EPSILON * 10_f64.powi(power);
            let label = format!("seed {seed} at 1e{power}: {near:?} {found:?}");
            assert!((found.upper - near.upper).abs() <= bound, "{label}");
        }
    }
}

#[test]
fn family_11_units() {
    // Five capsules beside each shape.
    for five in 0..draws(300).div_ceil(5) {
        for power in [-9, -6, -3, 3, 6, 9] {
            let unit = 10_f64.powi(power);
            let known = Known::about(unit, &mut Seeded(615_000_000 + five));
            for seed in 5 * five..5 * five + 5 {
                let mut random = Seeded(610_000 + seed);
                let capsule = capsule(unit, &mut random);
                let at = somewhere(&known, &capsule, &mut random);
                judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed} unit 1e{power}"));
            }
        }
    }
}

#[test]
fn family_12_needles_and_plates() {
    let thin = |power: usize| 10_f64.powi(-(power as i32));
    let cuboids = (0..7).map(|power| Form::Cuboid([1.0, 1.0, thin(power)]));
    let rods = (0..7).map(|power| Form::Cuboid([thin(power), thin(power), 1.0]));
    let needles = (0..7).map(|power| Form::Cylinder(thin(power), 1.0));
    let discs = (0..7).map(|power| Form::Cylinder(1.0, thin(power)));
    let known: Vec<Known> = cuboids.chain(rods).chain(needles).chain(discs).map(Known::new).collect();
    for seed in 0..draws(600) {
        let mut random = Seeded(620_000 + seed);
        let power = random.index(7);
        let thin = thin(power);
        let known = &known[7 * random.index(4) + power];
        let needle = Capsule::new(thin * random.positive(), 1.0).expect("sizes are not negative");
        let at = somewhere(known, &needle, &mut random);
        judged(known, &needle, &at, &mut WarmStart::default(), &format!("seed {seed} thin {thin:e}"));
    }
}

#[test]
fn family_13_axes_along_faces_and_edges() {
    for seed in 0..draws(400) {
        let mut random = Seeded(630_000 + seed);
        let known = Known::about(1.0, &mut random);
        let capsule = capsule(1.0, &mut random);
        let tilt = [0.0, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3][random.index(6)];
        let quarter = Vector3::ith(random.index(3), 1.0) * (random.index(4) as f64 * std::f64::consts::FRAC_PI_2);
        let turn = nalgebra::UnitQuaternion::new(random.unit() * tilt) * nalgebra::UnitQuaternion::new(quarter);
        // Beside a face, an edge or a corner.
        let side = Vector3::from_fn(|_, _| [-1.0, 0.0, 1.0][random.index(3)]);
        let reach = known.body.bounding_box().max + Vector3::repeat(capsule.reach_m() * random.between(0.5, 1.5));
        let at = pose(side.component_mul(&reach), &turn);
        judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed} tilt {tilt:e}"));
    }
}

#[test]
fn family_18_bad_warm_starts() {
    for seed in 0..draws(300) {
        let mut random = Seeded(680_000 + seed);
        let (known, other) = (Known::about(1.0, &mut random), Known::about(1.0, &mut random));
        let (capsule, another) = (capsule(1.0, &mut random), capsule(10.0, &mut random));
        let mut warm = WarmStart::default();
        let at = somewhere(&other, &another, &mut random);
        judged(&other, &another, &at, &mut warm, &format!("seed {seed}, another pair"));
        for _ in 0..3 {
            let at = somewhere(&known, &capsule, &mut random);
            let cold = judged(&known, &capsule, &at, &mut WarmStart::default(), &format!("seed {seed}, cold"));
            let hinted = judged(&known, &capsule, &at, &mut warm, &format!("seed {seed}, hinted"));
            let met = cold.lower <= hinted.upper && hinted.lower <= cold.upper;
            assert!(met, "seed {seed}: {cold:?} {hinted:?}");
        }
    }
}

/// Capsules against capsules in both orders, with parallel and crossing axes.
#[test]
fn family_19_swapped_capsules() {
    for seed in 0..draws(1000) {
        let mut random = Seeded(690_000 + seed);
        let (a, b) = (capsule(1.0, &mut random), capsule(1.0, &mut random));
        let tilt = [0.0, 1e-16, 1e-9, 1e-3, 1.0, 1.0][random.index(6)];
        let turn = nalgebra::UnitQuaternion::new(random.unit() * tilt);
        let reach = a.reach_m() + b.reach_m();
        let here = random.rotation();
        let (pose_a, pose_b) = (pose(random.unit(), &here), pose(random.unit() * reach.max(0.5), &(turn * here)));
        let one = distance_of_capsules(&a, &pose_a, &b, &pose_b, &Options::default());
        let other = distance_of_capsules(&b, &pose_b, &a, &pose_a, &Options::default());
        let label = format!("seed {seed} tilt {tilt:e}: {a:?} {b:?} {one:?} {other:?}");
        assert!(one.lower <= other.upper && other.lower <= one.upper, "{label}");
        // Points of one axis against the other, which is a point or a segment with a radius.
        let axis = pose_a.transform_direction(&Vector3::z());
        let of_b = pose_b.transform_direction(&Vector3::z());
        let from_b = |t: f64| {
            let p = pose_a.translation() + axis * t - pose_b.translation();
            (p - of_b * p.dot(&of_b).clamp(-b.half_height_m(), b.half_height_m())).norm()
        };
        let golden = 0.5 * (5_f64.sqrt() - 1.0);
        let (mut low, mut high) = (-a.half_height_m(), a.half_height_m());
        for _ in 0..100 {
            let (p, q) = (high - golden * (high - low), low + golden * (high - low));
            if from_b(p) <= from_b(q) { high = q } else { low = p }
        }
        let truth = from_b(0.5 * (low + high)) - a.radius_m() - b.radius_m();
        for found in [&one, &other] {
            assert!(found.lower <= truth + 1e-12 && truth - 1e-7 <= found.upper, "{label} against {truth:e}");
        }
    }
}
