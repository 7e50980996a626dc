//! Growth distances against closed forms, laws and differences.

use super::*;
use crate::body::Body;
use crate::measure::overlap::{Decision, overlap};
use crate::measure::tests::{at, powers, random_pose, zoo};
use crate::measure::warm::Hint;
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

fn cold(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> GrowthDistance {
    growth_distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default())
}

#[test]
fn ball_pairs_and_other_centers() {
    for seed in 0..300 {
        let mut random = Seeded(seed);
        let scale = 10_f64.powi((seed % 5) as i32 * 4 - 8);
        let ratio = 10_f64.powf(3.0 * random.signed());
        let (ra, rb) = (scale, scale * ratio);
        let (a, b) = (Body::ball("a", Vector3::zeros(), ra).unwrap(), Body::ball("b", Vector3::zeros(), rb).unwrap());
        let truth = [1e-15_f64, 1e-9, 1e-4, 0.3, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.0, 1e3, 1e9][(seed % 10) as usize];
        let truth = truth.min(1e14 / (ra + rb));
        let pose_a = random_pose(&mut random, 0.0);
        let direction = random.unit();
        let pose_b = Pose::from_quaternion(direction * (truth * (ra + rb)), [0.5, 0.5, 0.5, 0.5]).unwrap();
        let answer = cold(&a, &pose_a, &b, &pose_b);
        let label = format!("seed {seed}, s {truth:e}, radii {ra:e} {rb:e}: {answer:?}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        let floor = 4e-16 * truth;
        assert!(answer.lower <= truth + floor && truth - floor <= answer.upper, "{label}");
        assert!(answer.upper - answer.lower <= 1e-9 * truth.max(1e-5), "{label}");
        assert!((answer.normal.unwrap() + direction).norm() < 1e-6, "{label}");
        // An off-centre ball: |s (x - c_A)| meets |Δ| where the quadratic says.
        let offset = random.unit() * 0.7 * ra;
        let a = a.with_growth_center(offset).unwrap();
        let pose_b = at(1.7 * (ra + rb), 0.0, 0.0);
        let answer = cold(&a, &Pose::identity(), &b, &pose_b);
        // Ball of radius s ra about (1 - s) offset touches the ball of radius s rb about pose_b.
        let gap = |s: f64| (pose_b.translation() - offset * (1.0 - s)).norm() - s * (ra + rb);
        assert!(
            gap(answer.lower) >= -1e-12 * (ra + rb) && gap(answer.upper) <= 1e-12 * (ra + rb),
            "seed {seed}: {answer:?}"
        );
        assert_eq!(answer.status, Status::Converged, "seed {seed}: {answer:?}");
    }
}

#[test]
fn coaxial_powers_and_boxes_have_closed_forms() {
    let powers = powers();
    let mut random = Seeded(0);
    let mut cuboid = || {
        let half = Vector3::from_fn(|_, _| 10_f64.powf(random.signed()));
        (half, Body::cuboid("box", half).unwrap())
    };
    let boxes: Vec<_> = (0..40).map(|_| cuboid()).collect();
    for seed in 0..320 {
        let mut random = Seeded(seed);
        let mut draw = |degree: u64| {
            let of = if seed % 5 == 0 { &boxes } else { &powers[degree as usize] };
            &of[random.index(of.len())]
        };
        let ((ha, a), (hb, b)) = (draw(seed % 4), draw(seed / 4 % 4));
        let axis = (seed / 16 % 3) as usize;
        let truth = [1e-9, 1e-3, 0.5, 1.0, 1.0 + 1e-9, 3.0, 1e4][(seed % 7) as usize];
        let mut shift = Vector3::zeros();
        shift[axis] = truth * (ha[axis] + hb[axis]) * if seed % 2 == 0 { 1.0 } else { -1.0 };
        let answer = cold(a, &Pose::identity(), b, &at(shift.x, shift.y, shift.z));
        let kinds = [a, b].map(|body| (body.name(), body.degree()));
        let label = format!("seed {seed}, {kinds:?}, s {truth:e}: {answer:?}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        assert!(answer.lower <= truth * (1.0 + 1e-15) && truth * (1.0 - 1e-15) <= answer.upper, "{label}");
        assert!(answer.upper - answer.lower <= 1e-9 * truth.max(1.0), "{label}");
    }
    // Boxes about their centres, anywhere: the largest of the three ratios.
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let [(ha, a), (hb, b)] = [(); 2].map(|()| &boxes[random.index(boxes.len())]);
        let shift = random.unit() * 10_f64.powf(random.signed());
        let truth = shift.abs().component_div(&(ha + hb)).max();
        let answer = cold(a, &Pose::identity(), b, &at(shift.x, shift.y, shift.z));
        let label = format!("seed {seed}, s {truth:e}: {answer:?}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        assert!(answer.lower <= truth * (1.0 + 4e-16) && truth * (1.0 - 4e-16) <= answer.upper, "{label}");
    }
}

#[test]
fn random_pairs_obey_the_laws() {
    for seed in 0..400 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (i, j) = (random.next() as usize % bodies.len(), random.next() as usize % bodies.len());
        let (a, b) = (&bodies[i], &bodies[j]);
        let reach = a.circumscribed().radius + b.circumscribed().radius;
        let far = reach * 10_f64.powf(random.signed());
        let (pose_a, pose_b) = (random_pose(&mut random, 0.3 * reach), random_pose(&mut random, far));
        let answer = cold(a, &pose_a, b, &pose_b);
        let label = format!("seed {seed} {}-{}: {answer:?}", a.name(), b.name());
        assert_eq!(answer.status, Status::Converged, "{label}");
        // The witness lies in both grown bodies.
        for (body, pose) in [(a, &pose_a), (b, &pose_b)] {
            let local = pose.rotation().inverse_transform_vector(&(answer.witness - pose.translation()));
            let center = body.growth_ball().center;
            let value = body.value(&(center + (local - center) / answer.upper));
            assert!(value <= 1.0 + 1e-9, "{label}: {value}");
        }
        // Swapped, and both moved together.
        let swapped = cold(b, &pose_b, a, &pose_a);
        assert!(swapped.lower <= answer.upper && answer.lower <= swapped.upper, "{label} swapped {swapped:?}");
        let rigid = random_pose(&mut random, 100.0 * reach);
        let moved = |pose: &Pose| {
            let rotation = rigid.rotation() * pose.rotation();
            Pose::from_quaternion(rigid.transform_point(pose.translation()), rotation.coords.into()).unwrap()
        };
        let far = cold(a, &moved(&pose_a), b, &moved(&pose_b));
        let floor = 1e-12 * answer.upper.max(reach / a.growth_ball().radius);
        assert!(far.lower <= answer.upper + floor && answer.lower <= far.upper + floor, "{label} moved {far:?}");
        // The same side of contact as the distance.
        let distance = crate::measure::tests::cold(a, &pose_a, b, &pose_b);
        if distance.lower > 0.0 {
            assert!(answer.upper > 1.0, "{label}");
        } else if distance.upper == 0.0 {
            assert!(answer.lower <= 1.0, "{label}");
        }
    }
}

#[test]
fn concentric_pairs_are_defined() {
    let mut random = Seeded(7);
    for a in zoo(&mut random) {
        let pose = random_pose(&mut random, 2.0);
        let answer = cold(&a, &pose, &a, &pose);
        assert_eq!(answer.status, Status::Converged);
        assert!(answer.lower == 0.0 && answer.upper < 1e-10, "{answer:?}");
        assert!(answer.gradients.is_none() && answer.normal.is_none(), "{answer:?}");
        assert!((answer.witness - pose.transform_point(&a.growth_ball().center)).norm() < 1e-12);
        for offset in [1e-18, 1e-15, 1e-12, 1e-9, 1e-6] {
            let moved = pose.with_translation(pose.translation() + Vector3::new(0.0, offset, 0.0));
            let near = cold(&a, &pose, &a, &moved);
            assert_eq!(near.status, Status::Converged, "{near:?}");
            assert!(near.lower <= near.upper && near.upper.is_finite(), "{near:?}");
            assert!(near.upper <= 1e-10 + 2.0 * offset / a.growth_ball().radius, "{near:?}");
            // Rounding leaves no more to find.
            assert!(near.iterations <= 30, "{near:?}");
        }
    }
}

#[test]
fn gradients_are_the_derivatives() {
    let options = Options::default().with_accuracy(1e-13).unwrap();
    let mut tested = 0;
    for seed in 0..25 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        // Smooth pairs: boxes and cylinders have edges where the gradient jumps.
        let (i, j) = ((random.next() % 5) as usize, (random.next() % 5) as usize);
        let (a, b) = (&bodies[i], &bodies[j]);
        let reach = a.circumscribed().radius + b.circumscribed().radius;
        let far = reach * 4_f64.powf(random.signed());
        let poses = [random_pose(&mut random, 0.2 * reach), random_pose(&mut random, far)];
        let value = |poses: &[Pose; 2]| {
            let s = growth_distance(a, &poses[0], b, &poses[1], &options, &mut WarmStart::default());
            0.5 * (s.lower + s.upper)
        };
        let answer = growth_distance(a, &poses[0], b, &poses[1], &options, &mut WarmStart::default());
        let gradients = answer.gradients.unwrap();
        let scale = gradients[0].linear.norm() * reach;
        for (which, gradient) in gradients.iter().enumerate() {
            for component in 0..6 {
                let axis = Vector3::from_fn(|i, _| f64::from(u8::from(i == component % 3)));
                let moved = |h: f64| {
                    let mut poses = poses;
                    poses[which] = crate::measure::tests::twisted(&poses[which], &axis, component >= 3, h);
                    value(&poses)
                };
                let central = |h: f64| (moved(h) - moved(-h)) / (2.0 * h);
                let h = if component < 3 { 2e-3 * reach } else { 2e-3 };
                // Richardson's extrapolation removes h² and h⁴.
                let [d1, d2, d3] = [central(h), central(0.5 * h), central(0.25 * h)];
                let (e1, e2) = ((4.0 * d2 - d1) / 3.0, (4.0 * d3 - d2) / 3.0);
                let difference = (16.0 * e2 - e1) / 15.0;
                let unit = if component < 3 { reach } else { 1.0 };
                let exact = if component < 3 { gradient.linear } else { gradient.angular }.dot(&axis);
                // Near-flat spots make high derivatives large; the extrapolation says.
                if (e1 - e2).abs() * unit < 1e-7 * scale {
                    tested += 1;
                    let error = (difference - exact).abs() * unit;
                    assert!(
                        error < 1e-6 * scale,
                        "seed {seed} {}-{} body {which} component {component}: {difference} against {exact}",
                        a.name(),
                        b.name()
                    );
                }
            }
        }
    }
    assert!(tested > 200, "{tested}");
}

#[test]
fn warm_starts_change_time_not_answers() {
    let mut longest = 0;
    for seed in 0..60 {
        let mut random = Seeded(9000 + seed);
        let bodies = zoo(&mut random);
        let (i, j) = (random.next() as usize % bodies.len(), random.next() as usize % bodies.len());
        let (a, b) = (&bodies[i], &bodies[j]);
        let s = a.circumscribed().radius.max(b.circumscribed().radius);
        let mut warm = WarmStart::default();
        let (start, step) = (random.unit() * s, random.unit() * 0.02 * s);
        for k in 0..40 {
            let angle = 0.01 * f64::from(k);
            let pose =
                Pose::from_quaternion(start + step * f64::from(k), [angle.sin(), 0.0, 0.0, angle.cos()]).unwrap();
            let one = cold(a, &Pose::identity(), b, &pose);
            if k % 13 == 5 {
                let stranger = &bodies[random.next() as usize % bodies.len()];
                growth_distance(stranger, &pose, a, &Pose::identity(), &Options::default(), &mut warm);
            }
            if k % 13 == 9 {
                warm.hint = Hint::Apart {
                    x_a: Vector3::repeat(f64::NAN),
                    y_b: Vector3::zeros(),
                    normal_a: Vector3::x(),
                    active_a: 1,
                    active_b: 1,
                };
            }
            let answer = growth_distance(a, &Pose::identity(), b, &pose, &Options::default(), &mut warm);
            let label = format!("seed {seed} {}-{} step {k}: {answer:?} against {one:?}", a.name(), b.name());
            assert_eq!(answer.status, Status::Converged, "{label}");
            assert!(answer.lower <= one.upper && one.lower <= answer.upper, "{label}");
            longest = longest.max(answer.iterations);
        }
    }
    assert!(longest < 80, "{longest}");
}

#[test]
fn limits_are_kept_and_admitted() {
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (a, b) = (&bodies[(seed % 9) as usize], &bodies[(seed / 9 % 9) as usize]);
        let pose = random_pose(&mut random, 1.3);
        let truth = cold(a, &Pose::identity(), b, &pose);
        for limit in 1..=3 {
            let options = Options::default().with_max_iterations(limit).unwrap();
            let answer = growth_distance(a, &Pose::identity(), b, &pose, &options, &mut WarmStart::default());
            let label = format!("seed {seed} {}-{} limit {limit}: {answer:?}", a.name(), b.name());
            assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{label}");
            assert!(answer.iterations <= limit + 1, "{label}");
            assert_eq!(
                answer.status == Status::Converged,
                answer.upper - answer.lower <= 1e-9 * answer.upper.max(1.0),
                "{label}"
            );
        }
        let stop = std::sync::atomic::AtomicBool::new(true);
        let options = Options::default().with_stop(&stop);
        let answer = growth_distance(a, &Pose::identity(), b, &pose, &options, &mut WarmStart::default());
        assert!(answer.iterations <= 1, "{answer:?}");
        let options = Options::default().with_accuracy(1e-18).unwrap();
        let answer = growth_distance(a, &Pose::identity(), b, &pose, &options, &mut WarmStart::default());
        assert_eq!(answer.status, Status::BracketWide);
        assert!(answer.upper - answer.lower <= 1e-9 * answer.upper.max(1.0), "{answer:?}");
    }
}

/// Boxes and cylinders that are grown by less than the answer are apart and by more overlap, and
/// the general search, which is asked by a center of growth that is not quite the middle, agrees.
#[test]
fn cylinders_grow_as_the_general_search_says() {
    let (mut by_planes, count) = (0, 600);
    for seed in 0..count {
        let mut random = Seeded(77_000 + seed);
        let mut size = || 10_f64.powf(0.7 * random.signed());
        let (ha, hb) = (Vector3::from_fn(|_, _| size()), Vector3::from_fn(|_, _| size()));
        let make = |half: &Vector3<f64>, is_box: bool, grown: f64| {
            let half = half * grown;
            if is_box { Body::cuboid("box", half) } else { Body::cylinder("can", half.x, half.z) }.unwrap()
        };
        let is_box = seed % 2 == 0;
        let (a, b) = (make(&ha, is_box, 1.0), make(&hb, false, 1.0));
        let far = (ha.norm() + hb.norm()) * 10_f64.powf(random.signed());
        let mut pose_b = random_pose(&mut random, 0.0);
        let mut pose_a = random_pose(&mut random, 0.0);
        match seed % 5 {
            // With parallel axes, and at right angles.
            0 => pose_a = Pose::identity().with_translation(*pose_a.translation()),
            1 => {
                pose_a = Pose::identity();
                pose_b = Pose::from_quaternion(Vector3::zeros(), [0.5_f64.sqrt(), 0.0, 0.0, 0.5_f64.sqrt()]).unwrap();
            }
            _ => {}
        }
        if seed % 10 == 0 {
            pose_b = Pose::identity();
        }
        pose_b = pose_b.with_translation(pose_a.translation() + random.unit() * far);
        let answer = cold(&a, &pose_a, &b, &pose_b);
        let label = format!("seed {seed}: {ha:?} {hb:?} {pose_a:?} {pose_b:?} {answer:?}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        let nearby = a.clone().with_growth_center(Vector3::new(1e-200, 0.0, 0.0)).unwrap();
        let general = cold(&nearby, &pose_a, &b, &pose_b);
        assert!(general.lower <= answer.upper && answer.lower <= general.upper, "{label} {general:?}");
        if general.status == Status::Converged && !(general.tied || answer.tied) {
            let apart = (general.normal.unwrap() - answer.normal.unwrap()).norm();
            assert!(apart < 1e-4, "{label} {general:?}");
        }
        by_planes += u32::from(answer.iterations != general.iterations);
        for (factor, expected) in [(1.0 - 1e-8, Decision::No), (1.0 + 1e-8, Decision::Yes)] {
            let grown = |half, is_box| make(half, is_box, answer.upper * factor);
            let options = Options::default();
            let found =
                overlap(&grown(&ha, is_box), &pose_a, &grown(&hb, false), &pose_b, &options, &mut WarmStart::default());
            assert_eq!(found, expected, "{label} grown by {factor}");
        }
    }
    assert!(u64::from(by_planes) > count / 2, "{by_planes}");
}

/// Cylinders far from the origins of their frames: what rounds there counts.
#[test]
fn cylinders_far_in_their_frames_keep_their_brackets_in_order() {
    let mut converged = 0;
    for seed in 0..600 {
        let mut random = Seeded(78_000 + seed);
        let mut size = || 0.3 * 10_f64.powf(random.positive());
        let sizes = [(); 4].map(|()| size());
        let far = 10_f64.powf(2.0 + 2.5 * random.positive());
        let [a, b] = [0, 2].map(|i| {
            let can = Body::cylinder("can", sizes[i], sizes[i + 1]).unwrap();
            can.moved(&nalgebra::UnitQuaternion::identity(), &(random.unit() * far)).unwrap()
        });
        let (mut pose_a, pose_b) = (random_pose(&mut random, far), random_pose(&mut random, 0.0));
        let apart = random.unit() * 10_f64.powf(4.0 * random.positive());
        let middle = pose_b.transform_point(&b.growth_ball().center);
        pose_a = pose_a.with_translation(middle + apart - pose_a.transform_direction(&a.growth_ball().center));
        let answer = cold(&a, &pose_a, &b, &pose_b);
        assert!(answer.lower <= answer.upper, "seed {seed}: {answer:?}");
        converged += u32::from(answer.status == Status::Converged);
    }
    assert!(converged > 100, "{converged}");
}

/// A rod along the edge of a box: their sum has a corner rounded by the rod's radius, which the ray
/// leaves where a quadratic says.
#[test]
fn thin_rods_grow_along_the_right_normal() {
    let cube = Body::cuboid("box", Vector3::repeat(1.0)).unwrap();
    let mut by_planes = 0;
    let along_y = [-(0.5_f64.sqrt()), 0.0, 0.0, 0.5_f64.sqrt()];
    for radius in [1e-1_f64, 1e-2, 1e-3, 1e-4, 1e-5] {
        let rod = Body::cylinder("rod", radius, 1.0).unwrap();
        for bent in [0.0, 1e-6, 1e-5, 1e-3, 0.1, 0.5].map(|share| share * radius) {
            let ray = Vector3::new(1.0 + bent * 0.5_f64.sqrt(), 0.0, 1.0 - bent * 0.5_f64.sqrt());
            let place = ray * 2.0 + Vector3::y() * 0.6;
            let answer = cold(&cube, &Pose::identity(), &rod, &Pose::from_quaternion(place, along_y).unwrap());
            let label = format!("radius {radius:e} bent {bent:e}: {answer:?}");
            assert_eq!(answer.status, Status::Converged, "{label}");
            // |λ ray - (1, 1)| = radius, the far root: λ = 1 + μ.
            let off = ray - Vector3::new(1.0, 0.0, 1.0);
            let (p, q, r) = (ray.norm_squared(), ray.dot(&off), off.norm_squared() - radius * radius);
            let mu = (-q + (q * q - p * r).sqrt()) / p;
            let normal = (off + ray * mu) / radius;
            // The general search has wider brackets, and its normals are off by more.
            if answer.upper - answer.lower < 1e-11 {
                assert!((answer.normal.unwrap() + normal).norm() < 3e-7, "{label} against {normal:?}");
                by_planes += 1;
            }
        }
    }
    assert!(by_planes >= 12, "{by_planes}");
}

#[test]
fn nearly_parallel_sides_show_their_edges() {
    let cuboid = |x, y, z| Body::cuboid("box", Vector3::new(x, y, z)).unwrap();
    let plate = || cuboid(1.0, 1.0, 1e-3);
    let flat = |degree| Body::superellipsoid("flat", Vector3::zeros(), Vector3::new(1.0, 1.0, 0.02), degree).unwrap();
    let can = || Body::cylinder("can", 0.5, 0.8).unwrap();
    let pairs = [
        (flat(4), plate()),
        (flat(6), plate()),
        (flat(8), plate()),
        (plate(), can()),
        (cuboid(0.6, 0.9, 0.3), plate()),
        (flat(6), can()),
        (Body::cylinder("needle", 0.01, 1.0).unwrap(), cuboid(0.6, 0.9, 0.3)),
    ];
    let mut longest = 0;
    for seed in 0..600 {
        let mut random = Seeded(seed);
        let (a, b) = &pairs[(seed % 7) as usize];
        let tilt = random.unit() * 10_f64.powf(-9.5 + 1.5 * random.signed());
        let quarter = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::z() * [0.0, 0.5][(seed / 7 % 2) as usize]);
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(tilt) * quarter;
        let mut place = Vector3::zeros();
        place[(seed / 14 % 3) as usize] = 3.0 + 2.0 * random.signed();
        let pose = Pose::from_quaternion(place, turn.coords.into()).unwrap();
        let answer = cold(a, &Pose::identity(), b, &pose);
        let label = format!("seed {seed}, tilt {:e}: {answer:?}", tilt.norm());
        assert_eq!(answer.status, Status::Converged, "{label}");
        let swapped = cold(b, &pose, a, &Pose::identity());
        assert_eq!(swapped.status, Status::Converged, "{label} swapped {swapped:?}");
        assert!(swapped.lower <= answer.upper && answer.lower <= swapped.upper, "{label} swapped {swapped:?}");
        longest = longest.max(answer.iterations).max(swapped.iterations);
    }
    // Flat bodies take the longest: Newton's method nears their flat spots at a linear rate only.
    assert!(longest <= 150, "{longest}");
}
