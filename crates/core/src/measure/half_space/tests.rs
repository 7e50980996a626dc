//! Signed distances of half-spaces against closed forms, differences and the minimum over parts.

use super::*;
use crate::body::{Body, Compound};
use crate::measure::capsule::Capsule;
use crate::measure::half_space::SignedThresholdError;
use crate::measure::overlap::Decision;
use crate::measure::solver::stages::{Stage, except};
use crate::measure::status::Status;
use crate::measure::tests::edges::slab;
use crate::measure::tests::{random_pose, zoo};
use dashu_ratio::RBig;
use nalgebra::Vector3;
use std::cmp::Ordering;
use sublevel_testkit::Seeded;

#[test]
fn supports_have_closed_forms() {
    // A body and its support along a direction of its own frame.
    type Case = (Body, fn(&Vector3<f64>, &Vector3<f64>) -> f64);
    fn dual(half: &Vector3<f64>, n: &Vector3<f64>, k: f64) -> f64 {
        let q = k / (k - 1.0);
        half.component_mul(n).map(|c| c.abs().powf(q)).sum().powf(1.0 / q)
    }
    let half = Vector3::new(0.4, 1.0, 2.5);
    let power = |k| Body::superellipsoid("q", Vector3::zeros(), half, k).unwrap();
    let cases: [Case; 6] = [
        (power(2), |h, n| dual(h, n, 2.0)),
        (power(4), |h, n| dual(h, n, 4.0)),
        (power(6), |h, n| dual(h, n, 6.0)),
        (power(8), |h, n| dual(h, n, 8.0)),
        (Body::cuboid("b", half).unwrap(), |h, n| h.dot(&n.abs())),
        (Body::cylinder("c", half.x, half.y).unwrap(), |h, n| h.x * n.x.hypot(n.y) + h.y * n.z.abs()),
    ];
    let (mut most, mut smooth, mut edged) = (0, 0, 0);
    for seed in 0..3000 {
        let mut random = Seeded(seed);
        let (body, support) = &cases[(seed % 6) as usize];
        let pose = random_pose(&mut random, 3.0);
        // General directions, and nearly or exactly along an axis or a face.
        let mut n = random.unit();
        if seed % 5 > 1 {
            let small = [0.0, 1e-12, 1e-6, 1e-3][(random.next() % 4) as usize];
            n = (Vector3::from_fn(|i, _| f64::from(u8::from(i as u64 == seed % 3))) + n * small).normalize();
        }
        let offset = 3.0 * random.signed();
        let half_space = HalfSpace::new(pose.transform_direction(&n), offset).unwrap();
        let truth = half_space.normal().dot(pose.translation()) - support(&half, &-n) - offset;
        let mut warm = WarmStart::default();
        let ask = |warm: &mut WarmStart| distance_to_half_space(body, &pose, &half_space, &Options::default(), warm);
        // Closed forms are left out once, so that the search has to find what they say.
        for closed in [false, false, true] {
            let found = if closed { ask(&mut warm) } else { except(&[Stage::ClosedForm], || ask(&mut warm)) };
            let label = format!("seed {seed} {n:?}: {found:?} against {truth}");
            assert_eq!(found.status, Status::Converged, "{label}");
            assert!(found.lower <= truth + 1e-14 && truth - 1e-14 <= found.upper, "{label}");
            let height = half_space.normal().dot(&found.witness) - offset;
            assert!((height - found.upper).abs() < 1e-12, "{label}");
            most = most.max(found.iterations);
            *(if body.is_smooth() { &mut smooth } else { &mut edged }) += found.iterations;
        }
    }
    // 19 034 evaluations, and of bodies with edges 5 473, of all constraints each.
    println!("{smooth} and {edged} evaluations, most {most}");
    assert!(smooth < 20_000 && smooth + edged < 25_000 && most <= 40, "{smooth} {edged}, most {most}");
}

#[test]
fn gradients_are_differences_apart_and_deep() {
    let body = Body::ellipsoid("egg", Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 1.0, 2.0)).unwrap();
    let options = Options::default().with_accuracy(1e-13).unwrap();
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let pose = random_pose(&mut random, 2.0);
        let half_space = HalfSpace::new(random.unit(), 2.0 * random.signed()).unwrap();
        let at = |pose: &Pose| distance_to_half_space(&body, pose, &half_space, &options, &mut WarmStart::default());
        let gradient = at(&pose).pose_gradient(&pose, &half_space);
        for axis in 0..3 {
            let e = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
            let turned = |t: f64| {
                let turn = nalgebra::UnitQuaternion::from_scaled_axis(e * t) * pose.rotation();
                Pose::from_quaternion(pose.translation() + e * t * 0.5, turn.coords.into()).unwrap()
            };
            let slope = (at(&turned(1e-4)).value() - at(&turned(-1e-4)).value()) / 2e-4;
            let expected = gradient.angular[axis] + 0.5 * gradient.linear[axis];
            assert!((slope - expected).abs() < 1e-5, "seed {seed}: {slope} against {expected}");
        }
    }
}

#[test]
fn the_lowest_part_counts_and_half_spaces_are_checked() {
    let at = |x: f64, z: f64| Body::ball("part", Vector3::new(x, 0.0, z), 1.0).unwrap();
    let steps = Compound::new("steps", vec![at(0.0, 0.0), at(2.0, 0.5), at(4.0, 1.0)]).unwrap();
    let mut warm = WarmStart::default();
    for k in 0..60 {
        let (sine, cosine) = (0.1 * f64::from(k)).sin_cos();
        let half_space = HalfSpace::new(Vector3::new(sine, 0.0, cosine), -3.0).unwrap();
        let truth = [(0.0, 0.0), (2.0, 0.5), (4.0, 1.0)].map(|(x, z)| sine * x + cosine * z - 1.0 + 3.0);
        let truth = truth.into_iter().fold(f64::MAX, f64::min);
        let found = distance_to_half_space(&steps, &Pose::identity(), &half_space, &Options::default(), &mut warm);
        assert!((found.value() - truth).abs() < 1e-8 && found.lower <= truth, "{found:?} against {truth}");
    }
    assert!(matches!(HalfSpace::new(Vector3::z() * 1.001, 0.0), Err(HalfSpaceError::NotUnit(_))));
    assert_eq!(HalfSpace::new(Vector3::z() * f64::NAN, 0.0), Err(HalfSpaceError::NotFinite("normal")));
    assert_eq!(HalfSpace::new(Vector3::z(), f64::NAN), Err(HalfSpaceError::NotFinite("offset")));
}

#[test]
fn decisions_agree_with_the_distance() {
    let (mut open, mut decided) = (0, 0);
    for seed in 0..60 {
        let mut random = Seeded(seed);
        for body in zoo(&mut random) {
            let size = body.circumscribed().radius;
            let pose = random_pose(&mut random, 3.0 * size);
            let normal = random.unit();
            let offset = normal.dot(pose.translation()) + 2.0 * size * random.signed();
            let half_space = HalfSpace::new(normal, offset).unwrap();
            let options = Options::default();
            let mut warm = WarmStart::default();
            let found = distance_to_half_space(&body, &pose, &half_space, &options, &mut warm);
            for by in [0.0, 1e-12, -1e-12, 1e-6, -1e-6, 0.1, -0.1, 1.0, -1.0] {
                let threshold = found.value() + by * size;
                let label = format!("seed {seed} {}: {found:?} and {threshold}", body.name());
                for mut warm in [WarmStart::default(), warm] {
                    match nearer_to_half_space_than(&body, &pose, &half_space, threshold, &options, &mut warm).unwrap()
                    {
                        Decision::Yes => assert!(found.lower < threshold, "{label}"),
                        Decision::No => assert!(found.upper >= threshold, "{label}"),
                        Decision::Undecided { lower, upper } => {
                            assert!(lower <= threshold && threshold <= upper, "{label}: [{lower}, {upper}]");
                            assert!(upper - lower <= 1.001e-9 * size && by.abs() < 1e-8, "{label}: [{lower}, {upper}]");
                            open += 1;
                        }
                    }
                    decided += 1;
                }
            }
            let touches = overlap_with_half_space(&body, &pose, &half_space, &options, &mut WarmStart::default());
            let truth = if found.value() <= 0.0 { Decision::Yes } else { Decision::No };
            assert_eq!(touches, truth, "seed {seed} {}: {found:?}", body.name());
        }
    }
    assert!(10 * open < 4 * decided, "{open} of {decided} open: only thresholds within the bracket may be");
    let body = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let floor = HalfSpace::new(Vector3::z(), 0.0).unwrap();
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let asked = nearer_to_half_space_than(
            &body,
            &Pose::identity(),
            &floor,
            wrong,
            &Options::default(),
            &mut WarmStart::default(),
        );
        assert!(matches!(asked, Err(SignedThresholdError(_))), "{wrong}: {asked:?}");
    }
}

/// Hints of bodies of more constraints, of none of their own and of nonsense change no answer.
#[test]
fn hints_of_other_bodies_do_no_harm() {
    let cut = |slabs: usize| {
        let mut random = Seeded(400 + slabs as u64);
        let round = Body::superellipsoid("cut", Vector3::zeros(), Vector3::new(1.0, 0.8, 0.6), 6).unwrap();
        let cuts = (0..slabs).map(|_| slab(&(random.unit() / 0.7), 0.2 * random.signed()));
        let constraints = round.constraints().iter().cloned().chain(cuts).collect();
        Body::new("cut", *round.normalization(), constraints).unwrap()
    };
    // The last has as many constraints as a body may have.
    let bodies = [cut(1), cut(4), cut(15)];
    let options = Options::default();
    for seed in 0..200 {
        let mut random = Seeded(410 + seed);
        let half_space = HalfSpace::new(random.unit(), random.signed()).unwrap();
        let pose = random_pose(&mut random, 1.0);
        for first in &bodies {
            for second in &bodies {
                let mut warm = WarmStart::default();
                distance_to_half_space(first, &pose, &half_space, &options, &mut warm);
                let found = distance_to_half_space(second, &pose, &half_space, &options, &mut warm);
                let cold = distance_to_half_space(second, &pose, &half_space, &options, &mut WarmStart::default());
                assert!(found.lower <= cold.upper && cold.lower <= found.upper, "seed {seed}: {found:?} {cold:?}");
                assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?}");
            }
        }
    }
}

#[test]
fn decisions_about_several_parts_are_those_of_the_lowest() {
    let at = |x: f64, z: f64| Body::superellipsoid("part", Vector3::new(x, 0.0, z), Vector3::repeat(1.0), 4).unwrap();
    let steps = Compound::new("steps", vec![at(0.0, 0.0), at(2.0, 0.5), at(4.0, 1.0)]).unwrap();
    let options = Options::default();
    for k in 0..60 {
        let (sine, cosine) = (0.1 * f64::from(k)).sin_cos();
        let half_space = HalfSpace::new(Vector3::new(sine, 0.0, cosine), -1.5).unwrap();
        let mut warm = WarmStart::default();
        let found = distance_to_half_space(&steps, &Pose::identity(), &half_space, &options, &mut warm);
        for by in [-1.0, -1e-6, 1e-6, 1.0] {
            let asked = nearer_to_half_space_than(
                &steps,
                &Pose::identity(),
                &half_space,
                found.value() + by,
                &options,
                &mut warm,
            );
            assert_eq!(asked.unwrap(), if by > 0.0 { Decision::Yes } else { Decision::No }, "{k} {by}: {found:?}");
        }
    }
}

#[test]
fn capsules_are_as_low_as_their_lower_end() {
    for seed in 0..500 {
        let mut random = Seeded(seed);
        let size = 10_f64.powf(3.0 * random.signed());
        let sizes = [0.0, 0.3, 1.0].map(|share| share * size);
        let capsule = Capsule::new(sizes[random.next() as usize % 3], sizes[random.next() as usize % 3]).unwrap();
        let pose = random_pose(&mut random, 5.0 * size);
        let half_space = HalfSpace::new(random.unit(), 3.0 * size * random.signed()).unwrap();
        let found = distance_of_capsule_to_half_space(&capsule, &pose, &half_space, &Options::default());
        // The least over both ends of the axis, the only corners of the segment.
        let ends = [1.0, -1.0].map(|side| {
            let end = pose.transform_point(&(Vector3::z() * (side * capsule.half_height_m())));
            half_space.normal().dot(&end) - half_space.offset()
        });
        let truth = ends[0].min(ends[1]) - capsule.radius_m();
        let rounding = 1e-14 * size;
        assert!(found.lower <= truth + rounding && truth - rounding <= found.upper, "seed {seed}: {found:?} {truth}");
        assert_eq!(found.status, Status::Converged, "seed {seed}: {found:?}");
        let height = half_space.normal().dot(&found.witness) - half_space.offset();
        assert!((height - truth).abs() <= 1e-13 * size, "seed {seed}: {height} {truth}");
    }
    let lying = Capsule::new(0.1, 0.5).unwrap();
    let floor = HalfSpace::new(Vector3::x(), 0.0).unwrap();
    assert!(distance_of_capsule_to_half_space(&lying, &Pose::identity(), &floor, &Options::default()).tied);
}

/// Decisions near contact, and near other thresholds, against rational numbers: about 1 m and 1e6 m
/// from the origin of the world.
#[test]
fn decisions_of_capsules_are_those_of_exact_heights() {
    let (mut sides, mut open) = ([0; 2], 0);
    for seed in 0..400 {
        let mut random = Seeded(95_000 + seed);
        // How far it is from the origin, and the least gap that has to be decided, metres: rounding
        // hides less than 1e-13 m near the origin and less than 1e-7 m far from it.
        let (far, decided) = if seed % 2 == 0 { (1.0, 1e-12) } else { (1e6, 1e-6) };
        let [radius, half] = [(); 2].map(|()| [0.0, 0.3, 1.0][random.index(3)] * random.between(0.5, 1.0));
        let capsule = Capsule::new(radius, half).unwrap();
        let place = random_pose(&mut random, far);
        let pose = if seed % 4 < 2 { Pose::identity().with_translation(*place.translation()) } else { place };
        // Standing, lying along the plane up to rounding, and any.
        let normal = match seed % 5 {
            0 => pose.transform_direction(&Vector3::z()),
            1 => -pose.transform_direction(&Vector3::z()),
            2 => pose.transform_direction(&Vector3::x()),
            _ => random.unit(),
        };
        let through_origin = HalfSpace::new(normal, 0.0).unwrap();
        let contact = (exact_height_of_axis(&capsule, &pose, &through_origin) - exact(radius)).to_f64().value();
        for gap in [0.0, 1e-16, -1e-16, 1e-12, -1e-12, 1e-6, -1e-6] {
            for threshold in [None, Some(0.0), Some(0.25), Some(-0.25)] {
                let half_space = HalfSpace::new(normal, contact - threshold.unwrap_or(0.0) - gap).unwrap();
                let found = match threshold {
                    None => overlap_of_capsule_with_half_space(&capsule, &pose, &half_space),
                    Some(t) => capsule_nearer_to_half_space_than(&capsule, &pose, &half_space, t).unwrap(),
                };
                // How much higher than a level the axis is.
                let above = |level: f64| exact_height_of_axis(&capsule, &pose, &half_space) - exact(level);
                let at = threshold.unwrap_or(0.0);
                let truth = match against_radius(&above(at), &capsule, &half_space) {
                    Ordering::Less => true,
                    Ordering::Equal => threshold.is_none(),
                    Ordering::Greater => false,
                };
                let label = format!("seed {seed}, gap {gap:e}, threshold {threshold:?}: {found:?}, {truth}");
                match found {
                    Decision::Yes => assert!(truth, "{label}"),
                    Decision::No => assert!(!truth, "{label}"),
                    Decision::Undecided { lower, upper } => {
                        assert!(lower <= at && at <= upper, "{label}");
                        let [low, high] = [lower, upper].map(|end| against_radius(&above(end), &capsule, &half_space));
                        assert!(low != Ordering::Less && high != Ordering::Greater, "{label}");
                        let size = pose.translation().norm() + capsule.reach_m() + half_space.offset().abs();
                        assert!(upper - lower <= 64.0 * f64::EPSILON * size, "{label}");
                        open += 1;
                    }
                }
                if gap.abs() >= decided {
                    assert_eq!(found, if gap < 0.0 { Decision::Yes } else { Decision::No }, "{label}");
                } else {
                    sides[usize::from(truth)] += 1;
                }
            }
        }
    }
    // Rounding puts contacts on either side, and what it hides is left open.
    assert!(sides[0] > 500 && sides[1] > 500 && open > 1000, "{sides:?}, {open} open");
    let (limb, floor) = (Capsule::new(0.1, 0.3).unwrap(), HalfSpace::new(Vector3::z(), 0.0).unwrap());
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let asked = capsule_nearer_to_half_space_than(&limb, &Pose::identity(), &floor, wrong);
        assert!(matches!(asked, Err(SignedThresholdError(_))), "{wrong}: {asked:?}");
    }
}

fn exact(x: f64) -> RBig {
    RBig::try_from(x).unwrap()
}

/// The least `n·x - offset` over both ends of a capsule's axis, metres, without rounding: with the
/// quaternion of the pose normalised exactly.
fn exact_height_of_axis(capsule: &Capsule, pose: &Pose, half_space: &HalfSpace) -> RBig {
    let [i, j, k, w] = [0, 1, 2, 3].map(|index| exact(pose.rotation().coords[index]));
    let (two, square) = (exact(2.0), &i * &i + &j * &j + &k * &k + &w * &w);
    // The third column of the rotation, times the square of the quaternion's length.
    let axis = [&two * (&i * &k + &w * &j), &two * (&j * &k - &w * &i), &w * &w + &k * &k - &i * &i - &j * &j];
    let dot = |v: &[RBig; 3]| (0..3).fold(RBig::ZERO, |sum, index| sum + exact(half_space.normal()[index]) * &v[index]);
    let half = exact(capsule.half_height_m()) * dot(&axis) / square;
    let center = dot(&[0, 1, 2].map(|index| exact(pose.translation()[index]))) - exact(half_space.offset());
    let [down, up] = [&center - &half, &center + &half];
    down.min(up)
}

/// How a height of the axis compares with the radius, times the length of the stored normal.
fn against_radius(height: &RBig, capsule: &Capsule, half_space: &HalfSpace) -> Ordering {
    if *height < RBig::ZERO {
        return Ordering::Less;
    }
    let square = half_space.normal().iter().fold(RBig::ZERO, |sum, &n| sum + exact(n) * exact(n));
    (height * height).cmp(&(square * exact(capsule.radius_m()) * exact(capsule.radius_m())))
}
