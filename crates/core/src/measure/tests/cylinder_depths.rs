//! Overlaps of boxes and cylinders, and of parallel cylinders, by their closed forms: against the
//! least of the plain support functions over many directions, which knows of no faces, and against
//! the general search.

use super::{at, random_pose, twisted};
use crate::body::Body;
use crate::measure::solver::stages::{Stage, except, only};
use crate::measure::*;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::f64::consts::PI;
use sublevel_testkit::Seeded;

/// A box and a cylinder in the world frame.
struct Plain {
    half: Vector3<f64>,
    /// The box's axes, by columns.
    axes: Matrix3<f64>,
    radius: f64,
    half_height: f64,
    axis: Vector3<f64>,
    /// From the box's centre to the cylinder's, metres.
    between: Vector3<f64>,
}

/// The axes of a shape in the world frame, by columns, and its centre.
fn frame(body: &Body, pose: &Pose) -> (Matrix3<f64>, Vector3<f64>) {
    let form = body.closed_form().unwrap();
    let axes = form.axes().copied().unwrap_or_else(Matrix3::identity);
    (pose.rotation().to_rotation_matrix() * axes, pose.transform_point(form.center()))
}

impl Plain {
    fn new((cuboid, pose_box): (&Shape, &Pose), (cylinder, pose_cylinder): (&Shape, &Pose)) -> Self {
        let ((axes, from), (of_cylinder, to)) = (frame(&cuboid.body, pose_box), frame(&cylinder.body, pose_cylinder));
        Self {
            half: cuboid.half,
            axes,
            radius: cylinder.half.x,
            half_height: cylinder.half.z,
            axis: of_cylinder.column(2).into(),
            between: to - from,
        }
    }

    fn size(&self) -> f64 {
        self.half.norm() + self.radius.hypot(self.half_height) + self.between.norm()
    }

    /// What both cover along a unit vector from the centres.
    fn width(&self, n: &Vector3<f64>) -> f64 {
        let across = (n - self.axis * self.axis.dot(n)).norm();
        self.axes.tr_mul(n).abs().dot(&self.half) + self.radius * across + self.half_height * self.axis.dot(n).abs()
    }

    /// By how much they overlap along a unit vector from the box to the cylinder.
    fn overlap(&self, n: &Vector3<f64>) -> f64 {
        self.width(n) - n.dot(&self.between)
    }

    /// The least overlap near a direction, and where: a search along one tangent for the best that
    /// a search along the other finds, so that creases in any direction are followed.
    fn least_near(&self, n: &Vector3<f64>, reach: f64) -> (f64, Vector3<f64>) {
        let first = n.cross(&Vector3::ith(n.iamin(), 1.0)).normalize();
        let second = n.cross(&first);
        let towards = |s: f64, t: f64| (n + first * s + second * t).normalize();
        let inner = |s: f64| golden(|t| self.overlap(&towards(s, t)), reach);
        let (_, s) = golden(|s| inner(s).0, reach);
        let (value, t) = inner(s);
        (value, towards(s, t))
    }

    /// The least overlap over all directions, from above.
    fn least(&self) -> (f64, Vector3<f64>) {
        let spiral = (0..3000).map(|index| {
            let (height, turn) = (1.0 - (2.0 * f64::from(index) + 1.0) / 3000.0, 2.399963 * f64::from(index));
            let across = (1.0 - height * height).sqrt();
            Vector3::new(across * turn.cos(), across * turn.sin(), height)
        });
        // Slim bodies have their creases within less than is between these.
        let lines = [0, 1, 2].map(|i| self.axes.column(i).into_owned());
        let circles = lines.into_iter().chain([self.axis]).flat_map(|line| {
            let first = line.cross(&Vector3::ith(line.iamin(), 1.0)).normalize();
            let second = line.cross(&first);
            (0..720).map(move |index| {
                let (sin, cos) = (PI * f64::from(index) / 360.0).sin_cos();
                (first * cos + second * sin).normalize()
            })
        });
        let mut tried: Vec<_> = spiral.chain(circles).map(|n| (self.overlap(&n), n)).collect();
        tried.sort_by(|p, q| p.0.total_cmp(&q.0));
        let mut best = tried[0];
        let mut seen: Vec<Vector3<f64>> = Vec::new();
        for (_, n) in tried {
            if seen.len() == 3 {
                break;
            }
            if seen.iter().all(|other| other.dot(&n) < 0.97) {
                seen.push(n);
                let mut found = self.least_near(&n, 0.05);
                for reach in [1e-2, 1e-3, 1e-5] {
                    let next = self.least_near(&found.1, reach);
                    found = if next.0 < found.0 { next } else { found };
                }
                best = if found.0 < best.0 { found } else { best };
            }
        }
        best
    }
}

/// The least of a function with one minimum between -reach and reach, and where.
fn golden(f: impl Fn(f64) -> f64, reach: f64) -> (f64, f64) {
    let share = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut low, mut high) = (-reach, reach);
    let at = |x: f64| (f(x), x);
    let (mut left, mut right) = (at(high - share * (high - low)), at(low + share * (high - low)));
    while high - low > 1e-9 * reach {
        if left.0 < right.0 {
            (high, right) = (right.1, left);
            left = at(high - share * (high - low));
        } else {
            (low, left) = (left.1, right);
            right = at(low + share * (high - low));
        }
    }
    if left.0 < right.0 { left } else { right }
}

/// A body with its half-sizes, of a cylinder radius, radius and half height.
struct Shape {
    body: Body,
    half: Vector3<f64>,
}

/// A box, or a cylinder; every fourth with a side longer by a thousand and every fourth shorter,
/// every other one turned and moved in its frame.
fn sized(seed: u64, is_box: bool) -> Shape {
    let mut random = Seeded(87_000 + seed);
    let mut half = Vector3::from_fn(|_, _| 4_f64.powf(random.signed()));
    let side = if is_box { random.index(3) } else { 2 };
    half[side] *= [1e3, 1e-3, 1.0, 1.0][(seed % 4) as usize];
    let body = if is_box {
        Body::cuboid("box", half)
    } else {
        half.y = half.x;
        Body::cylinder("can", half.x, half.z)
    };
    let body = body.unwrap();
    let body =
        if (seed / 4).is_multiple_of(2) { body } else { body.moved(&random.rotation(), &random.unit()).unwrap() };
    Shape { body, half }
}

/// The pose of a cylinder with its axis along a unit vector and its centre at a point.
fn along(cylinder: &Body, axis: &Vector3<f64>, center: &Vector3<f64>) -> Pose {
    let (own, _) = frame(cylinder, &Pose::identity());
    let from: Vector3<f64> = own.column(2).into();
    let turn = UnitQuaternion::rotation_between(&from, axis)
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(own.column(0) * PI));
    let pose = Pose::from_quaternion(Vector3::zeros(), turn.coords.into()).unwrap();
    pose.with_translation(center - frame(cylinder, &pose).1)
}

/// The axis of the cylinder of a seed beside the axes of its box: along one, across one, within an
/// angle from 1e-16 to 1e-3 of one, and any.
fn axis(seed: u64, axes: &Matrix3<f64>, random: &mut Seeded) -> Vector3<f64> {
    let k = random.index(3);
    let column = |i: usize| axes.column(i % 3).into_owned();
    match seed % 5 {
        0 => column(k),
        1 => {
            let (sin, cos) = (PI * random.signed()).sin_cos();
            column(k) * cos + column(k + 1) * sin
        }
        2 => (column(k) + random.unit() * 10_f64.powi(-3 - random.index(14) as i32)).normalize(),
        _ => random.unit(),
    }
}

#[test]
fn overlaps_of_boxes_and_cylinders_are_the_least_of_all_directions() {
    let shapes: Vec<_> = (0..16).map(|seed| (sized(seed, true), sized(seed + 100, false))).collect();
    let (mut deep, mut alone, mut arcs, mut corners) = (0, 0, 0, 0);
    for seed in 0..900 {
        let mut random = Seeded(88_000 + seed);
        let (cuboid, cylinder) = (&shapes[random.index(16)].0, &shapes[random.index(16)].1);
        let far = [0.0, 1.0, 1e3][random.index(3)];
        let pose_box = random_pose(&mut random, far);
        let (axes, center) = frame(&cuboid.body, &pose_box);
        // Of every ninth a corner of the box reaches through the wall, in its frame.
        let corner = (seed % 9 == 8).then(|| {
            let sign = Vector3::from_fn(|_, _| if random.next().is_multiple_of(2) { 1.0 } else { -1.0 });
            (sign, sign.component_mul(&Vector3::from_fn(|_, _| 0.3 + random.positive())).normalize())
        });
        let axis = match corner {
            Some((_, n)) => (axes * n).cross(&random.unit()).normalize(),
            None => axis(seed, &axes, &mut random),
        };
        let placed = |between: Vector3<f64>| {
            let pose = along(&cylinder.body, &axis, &(center + between));
            (Plain::new((cuboid, &pose_box), (cylinder, &pose)), pose)
        };
        // From the middle to beyond the surface of the difference.
        let (centered, _) = placed(Vector3::zeros());
        let way = random.unit();
        let leaves = (0..500).map(|_| random.unit()).filter(|n| n.dot(&way) > 1e-3);
        let most = leaves.map(|n| centered.width(&n) / n.dot(&way)).fold(f64::INFINITY, f64::min);
        let share = match random.index(8) {
            0 => 0.0,
            1..4 => random.positive().powf(0.3),
            _ => 0.85 + 0.15 * random.positive(),
        };
        let mut between = match corner {
            Some((sign, n)) => axes * (sign.component_mul(&cuboid.half) + n * (0.95 * cylinder.half.x)),
            None => way * (most * share),
        };
        let gap = [None, None, None, Some(1e-12), Some(-1e-12), Some(1e-9)][(seed / 5 % 6) as usize];
        if let Some(gap) = gap {
            let (plain, _) = placed(between);
            let (value, n) = plain.least();
            between += n * (value - gap * plain.size());
        }
        let (plain, pose) = placed(between);
        let (value, _) = plain.least();
        let of_box = (&cuboid.body, &pose_box);
        let of_cylinder = (&cylinder.body, &pose);
        let ((a, pose_a), (b, pose_b)) = if seed % 2 == 0 { (of_box, of_cylinder) } else { (of_cylinder, of_box) };
        let ask = |warm: &mut WarmStart| signed_distance(a, pose_a, b, pose_b, &Options::default(), warm);
        let mut warm = WarmStart::default();
        let found = only(&[Stage::ClosedForm], || ask(&mut warm));
        let again = only(&[Stage::ClosedForm], || ask(&mut warm));
        let depth = |warm: &mut WarmStart| penetration(a, pose_a, b, pose_b, &Options::default(), warm);
        let deepest = only(&[Stage::ClosedForm], || depth(&mut WarmStart::default()));
        let general = except(&[Stage::ClosedForm], || ask(&mut WarmStart::default()));
        let label = format!("seed {seed}, least {value:e}: {found:?} against {general:?}");
        // Places of the plain formula round, too.
        let rounding = 1e-14 * (plain.size() + pose_a.translation().norm() + pose_b.translation().norm());
        for answer in [&found, &again, &general] {
            assert!(-value <= answer.upper + rounding, "{label}: {answer:?}");
        }
        for answer in [&found, &again] {
            assert!(answer.lower <= general.upper && general.lower <= answer.upper, "{label}: {answer:?}");
        }
        assert!(deepest.lower <= value.max(0.0) + rounding, "{label}: {deepest:?}");
        if gap.is_some() || value <= 1e-6 * plain.size() {
            continue;
        }
        deep += 1;
        // Nothing but the closed form is as narrow as that.
        let narrow = 1e-12 * plain.size() + 100.0 * rounding;
        if !(found.status == Status::Converged && found.upper - found.lower <= narrow) {
            continue;
        }
        alone += 1;
        assert!((deepest.upper + found.lower).abs() <= narrow, "{label}: {deepest:?}");
        let n = found.normal.unwrap();
        let out = if seed % 2 == 0 { -n } else { n };
        assert!((plain.overlap(&out) + found.lower).abs() <= narrow, "{label}: {}", plain.overlap(&out));
        let apart = found.witness_a - found.witness_b;
        assert!((apart - n * found.value()).norm() <= 1e-6 * plain.size(), "{label}: {apart:?}");
        for (body, pose, x) in [(a, pose_a, found.witness_a), (b, pose_b, found.witness_b)] {
            let off = 1e-10 + 10.0 * rounding / body.in_radius();
            let at_surface = body.value(&pose.inverse_transform_point(&x));
            assert!((at_surface - 1.0).abs() <= off, "{label}: {} {at_surface}", body.name());
        }
        let own = axes.tr_mul(&out).abs();
        let straight = own.iter().filter(|part| **part < 1e-9).count();
        let along_axis = out.dot(&axis).abs();
        corners += u32::from(along_axis < 1e-9 && own.min() > 1e-3);
        arcs += u32::from(straight == 1 && (1e-3..1.0 - 1e-6).contains(&along_axis));
    }
    println!("boxes and cylinders: {alone} of {deep} alone, {arcs} on arcs, {corners} at corners");
    assert!(deep > 120 && arcs > 5 && corners > 20, "{deep} {arcs} {corners}");
    assert!(alone * 100 >= deep * 75, "{alone} of {deep}");
}

/// Beside differences of the least of the plain formula near the normal.
#[test]
fn overlaps_of_boxes_and_cylinders_have_gradients() {
    let mut compared = 0;
    for seed in 0..60 {
        let mut random = Seeded(89_000 + seed);
        let mut half = || Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
        let (of_box, mut of_cylinder) = (half(), half());
        of_cylinder.y = of_cylinder.x;
        let cuboid = Shape { body: Body::cuboid("box", of_box).unwrap(), half: of_box };
        let body = Body::cylinder("can", of_cylinder.x, of_cylinder.z).unwrap();
        let cylinder = Shape { body, half: of_cylinder };
        let pose_box = random_pose(&mut random, 0.3);
        let (axes, center) = frame(&cuboid.body, &pose_box);
        let axis = axis(seed, &axes, &mut random);
        let far = (of_box.norm() + of_cylinder.norm()) * (0.2 + 0.4 * random.positive());
        let poses = [pose_box, along(&cylinder.body, &axis, &(center + random.unit() * far))];
        let plain = |poses: &[Pose; 2]| Plain::new((&cuboid, &poses[0]), (&cylinder, &poses[1]));
        let found = only(&[Stage::ClosedForm], || {
            let warm = &mut WarmStart::default();
            signed_distance(&cuboid.body, &poses[0], &cylinder.body, &poses[1], &Options::default(), warm)
        });
        let narrow = found.upper - found.lower <= 1e-11;
        let (Some(normal), Some(gradients)) = (found.normal, found.gradients) else { continue };
        if found.upper >= 0.0 || found.tied || !narrow {
            continue;
        }
        for (which, gradient) in gradients.iter().enumerate() {
            for component in 0..6 {
                let way = Vector3::ith(component % 3, 1.0);
                let value = |h: f64| {
                    let mut poses = poses;
                    poses[which] = twisted(&poses[which], &way, component >= 3, h);
                    -plain(&poses).least_near(&-normal, 5e-3).0
                };
                let h = 1e-4;
                let [p, m, q, n] = [h, -h, 0.5 * h, -0.5 * h].map(value);
                let (d1, d2) = ((p - m) / (2.0 * h), (q - n) / h);
                // Where faces meet there is none.
                let middle = value(0.0);
                let kink = ((p + m - 2.0 * middle) / h).abs().max(((q + n - 2.0 * middle) / (0.5 * h)).abs());
                if kink > 2e-3 || (d1 - d2).abs() > 1e-6 {
                    continue;
                }
                let exact = if component < 3 { gradient.linear } else { gradient.angular }.dot(&way);
                let difference = (4.0 * d2 - d1) / 3.0;
                compared += 1;
                let label = format!("seed {seed} body {which} component {component}: {found:?}");
                assert!((difference - exact).abs() < 2e-6 * plain(&poses).size(), "{label}: {difference} and {exact}");
            }
        }
    }
    println!("gradients of boxes and cylinders compared: {compared}");
    assert!(compared > 150, "{compared}");
}

/// Positions with a known depth, and whether every direction of some is as short.
#[test]
fn ties_of_boxes_and_cylinders_are_flagged() {
    let cube = Body::cuboid("cube", Vector3::repeat(1.0)).unwrap();
    let can = Body::cylinder("can", 0.5, 3.0).unwrap();
    let coin = Body::cylinder("coin", 3.0, 0.1).unwrap();
    let corner = 0.5 - 0.2 * 2_f64.sqrt();
    for (can, pose, depth, tied) in [
        (&can, at(0.0, 0.0, 0.0), 1.5, true),
        (&can, at(0.3, 0.0, 0.0), 1.2, false),
        (&can, at(0.3, -0.3, 0.2), 1.2, true),
        (&can, at(1.0, 1.0, 0.0), 0.5, true),
        (&can, at(1.2, -1.2, 0.3), corner, false),
        (&can, at(0.2, 0.1, -3.5), 0.5, false),
        (&coin, at(0.0, 0.0, 0.0), 1.1, true),
        (&coin, at(0.5, 0.2, 0.3), 0.8, false),
    ] {
        let back = pose.with_translation(-pose.translation());
        for (a, b, pose) in [(&cube, can, pose), (can, &cube, back)] {
            let found = only(&[Stage::ClosedForm], || {
                signed_distance(a, &Pose::identity(), b, &pose, &Options::default(), &mut WarmStart::default())
            });
            let label = format!("{}-{} {pose:?}: {found:?}", a.name(), b.name());
            assert!((found.value() + depth).abs() < 1e-12 && found.status == Status::Converged, "{label}");
            assert_eq!(found.tied, tied, "{label}");
        }
    }
}

#[test]
fn parallel_cylinders_overlap_as_one_does() {
    let shapes: Vec<_> = (0..8).map(|seed| sized(seed + 200, false)).collect();
    let (mut deep, mut alone) = (0, 0);
    for seed in 0..300 {
        let mut random = Seeded(90_000 + seed);
        let (first, second) = (&shapes[random.index(8)], &shapes[random.index(8)]);
        let pose_a = random_pose(&mut random, 1.0);
        let (axes, center) = frame(&first.body, &pose_a);
        let along_axis: Vector3<f64> = axes.column(2).into();
        let tilt = [0.0, 1e-16, 1e-13][random.index(3)];
        let sign = if random.index(2) == 0 { 1.0 } else { -1.0 };
        let axis = (along_axis * sign + random.unit() * tilt).normalize();
        let (radius, height) = (first.half.x + second.half.x, first.half.z + second.half.z);
        // On each other's axis, beside it, and past the ends.
        let out = if seed % 4 == 0 { 0.0 } else { radius * 1.1 * random.positive() };
        let rise = height * 1.1 * random.signed();
        let beside = axes.column(0) * out;
        let pose_b = along(&second.body, &axis, &(center + beside + along_axis * rise));
        let truth = (radius - out).min(height - rise.abs());
        let ask = || {
            let warm = &mut WarmStart::default();
            signed_distance(&first.body, &pose_a, &second.body, &pose_b, &Options::default(), warm)
        };
        let (found, general) = (only(&[Stage::ClosedForm], ask), except(&[Stage::ClosedForm], ask));
        let label = format!("seed {seed}, depth {truth:e}, beside by {out:e}: {found:?} against {general:?}");
        assert!(found.lower <= general.upper && general.lower <= found.upper, "{label}");
        let size = radius + height;
        // The depth changes by less than the tilt times the sizes.
        let off = (1e-14 + 2.0 * tilt) * size + 1e-14;
        if !(truth > 1e-6 * size) {
            continue;
        }
        assert!(found.lower <= -truth + off && -truth - off <= found.upper, "{label}");
        deep += 1;
        let is_narrow = found.upper - found.lower <= 1e-11 * (size + 1.0);
        if found.status == Status::Converged && is_narrow {
            alone += 1;
            assert!((found.value() + truth).abs() <= 1e-11 * (size + 1.0), "{label}");
            assert!(found.tied || out > 0.0 || truth < radius, "{label}");
        }
    }
    println!("parallel cylinders: {alone} of {deep} alone");
    assert!(deep > 150 && alone * 100 >= deep * 60, "{alone} of {deep}");
}
