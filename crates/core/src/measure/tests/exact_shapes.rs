//! Boxes, cylinders and balls by their closed forms, against the general search, which shares
//! nothing with them but the bodies' polynomials.

use super::edges::cut;
use super::{assert_normals_of_active, random_pose, zoo};
use crate::body::Body;
use crate::measure::solver::stages::{Stage, except, only};
use crate::measure::*;
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::OnceLock;
use sublevel_testkit::Seeded;

/// A box or a cylinder with sizes over two decades, in every other case turned within its frame:
/// one of 200, as making bodies takes longer than measuring them.
fn shape(random: &mut Seeded) -> Body {
    static SHAPES: [OnceLock<Body>; 200] = [const { OnceLock::new() }; 200];
    let index = random.next() % 200;
    SHAPES[index as usize].get_or_init(|| new_shape(&mut Seeded(60_000 + index))).clone()
}

fn new_shape(random: &mut Seeded) -> Body {
    let mut size = || 10_f64.powf(random.signed() - 0.5);
    let (x, y, z) = (size(), size(), size());
    let body = if random.next().is_multiple_of(2) {
        Body::cuboid("box", Vector3::new(x, y, z)).unwrap()
    } else {
        Body::cylinder("can", x, z).unwrap()
    };
    if random.next().is_multiple_of(2) {
        return body;
    }
    let rotation = UnitQuaternion::from_scaled_axis(random.unit() * 2.0);
    body.moved(&rotation, &(random.unit() * 0.7)).unwrap()
}

/// A pose of the second body at about this gap, if the first stands at `pose_a`: along a random
/// direction from wherever the bodies just touch.
fn at_gap(a: &Body, pose_a: &Pose, b: &Body, gap: f64, random: &mut Seeded) -> Pose {
    let turned = random_pose(random, 0.0);
    let far = 2.0 * (a.circumscribed().radius + b.circumscribed().radius) + b.circumscribed().center.norm();
    let start = pose_a.transform_point(&a.circumscribed().center) + random.unit() * far;
    let mut pose = turned.with_translation(start - turned.transform_direction(&b.circumscribed().center));
    for _ in 0..6 {
        let found = except(&[Stage::ClosedForm], || {
            distance(a, pose_a, b, &pose, &Options::default(), &mut WarmStart::default())
        });
        let Some(n) = found.normal else { break };
        pose = pose.with_translation(pose.translation() + n * (found.value() - gap));
    }
    pose
}

/// How many of `count` pairs the closed forms alone solve, each of them correctly.
fn share(what: &str, count: u64, pair: impl Fn(&mut Seeded) -> (Body, Body)) -> f64 {
    let gaps = [-0.1, -1e-3, -1e-6, 1e-9, 1e-6, 1e-3, 1e-2, 0.1, 1.0];
    let mut solved = 0;
    for seed in 0..count {
        let mut random = Seeded(71_000 + seed);
        let (a, b) = pair(&mut random);
        let size = a.circumscribed().radius.min(b.circumscribed().radius);
        let pose_a = random_pose(&mut random, 1.0);
        let pose_b = at_gap(&a, &pose_a, &b, gaps[(seed % 9) as usize] * size, &mut random);
        for (first, second) in [((&a, &pose_a), (&b, &pose_b)), ((&b, &pose_b), (&a, &pose_a))] {
            let ask = |warm: &mut WarmStart| distance(first.0, first.1, second.0, second.1, &Options::default(), warm);
            let truth = except(&[Stage::ClosedForm], || ask(&mut WarmStart::default()));
            let mut warm = WarmStart::default();
            for round in 0..2 {
                let found = only(&[Stage::ClosedForm], || ask(&mut warm));
                let label = format!("{what}, seed {seed}, round {round}: {found:?} against {truth:?}");
                assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}");
                if round == 0 {
                    solved += u32::from(found.status == Status::Converged);
                }
                let near = 1e-6 * size;
                if found.status == Status::Converged && truth.status == Status::Converged && truth.lower > near {
                    let (n, m) = (found.normal.expect("apart"), truth.normal.expect("apart"));
                    assert!((n - m).norm() < 1e-5, "{label}");
                    let along = (found.witness_a - found.witness_b).dot(&n);
                    assert!((along - found.upper).abs() < 1e-9 * (size + found.upper), "{label}");
                    assert_normals_of_active(1e-5, first, (&found.witness_a, &-n), &found.active_a, &label);
                    assert_normals_of_active(1e-5, second, (&found.witness_b, &n), &found.active_b, &label);
                }
            }
        }
    }
    let share = 50.0 * f64::from(solved) / count as f64;
    println!("{what}: {share:.1} % solved alone");
    share
}

#[test]
fn smooth_bodies_against_shapes() {
    let smooth: Vec<Body> = (0..6).flat_map(|seed| zoo(&mut Seeded(seed))).filter(Body::is_smooth).collect();
    let share = share("smooth against shapes", 900, |random| {
        (smooth[random.next() as usize % smooth.len()].clone(), shape(random))
    });
    assert!(share > 90.0, "{share}");
}

/// Needles and plates of aspects from 10 to 100, whose nearest point crosses a whole side while the
/// normal hardly turns: pairs of 200 of them and 200 shapes.
#[test]
fn thin_bodies_against_shapes() {
    let new_thin = |random: &mut Seeded| {
        let thick = 10_f64.powf(-1.5 + 0.5 * random.signed());
        let long = 2_f64.powf(random.signed());
        let half = if random.next().is_multiple_of(2) {
            [long, long, long * thick]
        } else {
            [long * thick, long * thick, long]
        };
        let degree = [2, 4, 6, 8][random.next() as usize % 4];
        Body::superellipsoid("thin", random.unit() * 0.3, half.into(), degree).unwrap()
    };
    let thin: Vec<Body> = (0..200).map(|index| new_thin(&mut Seeded(62_000 + index))).collect();
    let share =
        share("thin bodies against shapes", 900, |random| (thin[random.index(thin.len())].clone(), shape(random)));
    assert!(share > 85.0, "{share}");
}

/// Faces, edges and corners of both against each other: of bodies of degree 4 to 8 that up to six
/// slabs cut, and of boxes and cylinders.
#[test]
fn cut_bodies_against_shapes() {
    let share = share("cut bodies against shapes", 450, |random| (cut(random), shape(random)));
    // A third of them overlaps, and a ninth is too near for a normal in doubles: both are left to
    // the general search.
    assert!(share > 50.0, "{share}");
}

/// Capsules, balls, segments and points beside the same bodies, by Newton's method alone and by the
/// general search: along a way of four steps, each with the hint of the one before.
#[test]
fn cut_bodies_against_capsules() {
    let (mut solved, mut apart) = (0, 0);
    for seed in 0..300 {
        let mut random = Seeded(76_000 + seed);
        let body = cut(&mut random);
        let size = body.circumscribed().radius;
        let of = |index: u64, length: f64| if index == 0 { 0.0 } else { size * length };
        let (radius, half) = (of(seed % 2, 0.3), of(seed / 2 % 2, 3_f64.powf(random.signed())));
        let capsule = Capsule::new(radius, half).unwrap();
        let (pose, turned) = (random_pose(&mut random, 1.0), random_pose(&mut random, 0.0));
        let middle = pose.transform_point(&body.circumscribed().center);
        let far = (size + capsule.reach_m()) * (0.6 + 0.8 * random.positive());
        let (mut place, step) = (middle + random.unit() * far, random.unit() * (0.01 * size));
        let (mut alone, mut general) = (WarmStart::default(), WarmStart::default());
        for round in 0..4 {
            let at = turned.with_translation(place);
            let ask =
                |warm: &mut WarmStart| distance_to_capsule(&body, &pose, &capsule, &at, &Options::default(), warm);
            let truth = except(&[Stage::ClosedForm], || ask(&mut general));
            let found = only(&[Stage::ClosedForm], || ask(&mut alone));
            let label = format!("seed {seed}, round {round}: {found:?} against {truth:?}");
            assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}");
            place += step;
            if truth.lower < -0.999 * radius {
                continue;
            }
            apart += 1;
            if found.status == Status::Converged {
                solved += 1;
                let (n, m) = (found.normal.expect("apart"), truth.normal.expect("apart"));
                let near = truth.lower + radius < 1e-6 * size;
                assert!(near || (n - m).norm() < 1e-5, "{label}");
            }
        }
    }
    println!("{solved} of {apart}");
    assert!(f64::from(solved) > 0.98 * f64::from(apart), "{solved} of {apart}");
}

#[test]
fn shapes_against_shapes() {
    let share = share("shapes against shapes", 900, |random| (shape(random), shape(random)));
    assert!(share > 90.0, "{share}");
}

#[test]
fn balls_against_balls_and_shapes() {
    let new_ball = |random: &mut Seeded| {
        let ball = Body::ball("ball", random.unit() * 0.7, 10_f64.powf(random.signed() - 0.5)).unwrap();
        // Turned, rounding leaves it axes of its own.
        let rotation = UnitQuaternion::from_scaled_axis(random.unit() * 2.0);
        if random.next().is_multiple_of(2) { ball } else { ball.moved(&rotation, &(random.unit() * 0.7)).unwrap() }
    };
    let balls: Vec<Body> = (0..200).map(|index| new_ball(&mut Seeded(64_000 + index))).collect();
    let ball = |random: &mut Seeded| balls[random.index(balls.len())].clone();
    let share = share("balls against balls and shapes", 900, |random| {
        let other = if random.next().is_multiple_of(2) { ball(random) } else { shape(random) };
        (ball(random), other)
    });
    assert!(share > 90.0, "{share}");
}

/// The formula for two balls near and far from each other and from the origin, against exact
/// differences of their centres: ten placements of each pair.
#[test]
fn two_balls_have_a_formula() {
    let new_pair = |index: u64| {
        let mut random = Seeded(65_000 + index);
        let scale = 10_f64.powf(4.0 * random.signed());
        let radii = [0, 1].map(|_| scale * 10_f64.powf(random.signed()));
        let offsets = [0, 1].map(|_| random.unit() * scale);
        (scale, radii, offsets, [0, 1].map(|k| Body::ball("ball", offsets[k], radii[k]).unwrap()))
    };
    let pairs: Vec<_> = (0..200).map(new_pair).collect();
    for seed in 0..2000 {
        let mut random = Seeded(74_000 + seed);
        let (scale, radii, offsets, [a, b]) = &pairs[(seed % 200) as usize];
        // Centres on a grid of powers of two, whose difference and its length are exact.
        let grid = scale.log2().round().exp2();
        let origin = Vector3::from_fn(|_, _| (random.signed() * 1e6).round() * grid);
        let way = Vector3::new(3.0, 4.0, 12.0) * grid * 2_f64.powi((random.next() % 8) as i32 - 2);
        let [pose_a, pose_b] = [origin + way, origin].map(|t| Pose::identity().with_translation(t));
        // The centres are off the origins of the frames, by what cancels out but for rounding.
        let [pose_a, pose_b] = [(pose_a, &offsets[0]), (pose_b, &offsets[1])].map(|(pose, offset)| {
            let turned = random_pose(&mut random, 0.0);
            turned.with_translation(pose.translation() - turned.transform_direction(offset))
        });
        let truth = (13.0 / 12.0 * way.z - radii[0] - radii[1]).max(0.0);
        let found = distance(a, &pose_a, b, &pose_b, &Options::default(), &mut WarmStart::default());
        let label = format!("seed {seed}: {found:?} against {truth}");
        assert_eq!(found.status, Status::Converged, "{label}");
        // So much the translations were rounded by.
        let moved = 4.0 * f64::EPSILON * (origin.amax() + way.norm() + scale);
        assert!(found.lower <= truth + moved && truth - moved <= found.upper, "{label}");
        assert!(found.upper - found.lower <= 1e-9 * radii[0].min(radii[1]), "{label}");
        if truth > 1e-6 * scale {
            assert_eq!(found.iterations, 0, "{label}");
            let n = found.normal.expect("apart");
            assert!((n - way.normalize()).norm() < 1e-12 + moved / way.norm(), "{label}");
            assert!((found.witness_a - (origin + way - n * radii[0])).norm() < 1e-9 * scale + moved, "{label}");
            assert!((found.witness_b - (origin + n * radii[1])).norm() < 1e-9 * scale + moved, "{label}");
        }
    }
}

/// Boxes side by side: on faces, edges and corners, in contact, parallel and tilted by next to
/// nothing.
#[test]
fn boxes_side_by_side() {
    let (a, b) = (
        Body::cuboid("a", Vector3::new(1.0, 0.8, 0.6)).unwrap(),
        Body::cuboid("b", Vector3::new(0.5, 0.4, 0.3)).unwrap(),
    );
    for seed in 0..600 {
        let mut random = Seeded(seed);
        // Apart, and touching on a face, an edge and a corner.
        let touching = (seed % 6).saturating_sub(2) as usize;
        let gaps = [[0.3, 0.0, 0.0], [0.0, 0.3, 0.4], [0.2, 0.3, 0.6]].get(seed as usize % 6).unwrap_or(&[0.0; 3]);
        let sums = [1.5, 1.2, 0.9];
        let place = Vector3::from_fn(|i, _| if gaps[i] > 0.0 || i < touching { sums[i] + gaps[i] } else { 0.1 });
        let tilt = [0.0, 1e-16, 1e-12, 1e-9, 1e-6][(seed % 5) as usize];
        let turn = UnitQuaternion::from_scaled_axis(random.unit() * tilt);
        let pose = Pose::from_quaternion(place, turn.coords.into()).unwrap();
        let found = distance(&a, &Pose::identity(), &b, &pose, &Options::default(), &mut WarmStart::default());
        let truth = Vector3::from(*gaps).norm();
        let slack = 2.0 * tilt + 1e-12;
        let label = format!("seed {seed}, tilt {tilt:e}: {found:?} against {truth}");
        assert!(found.lower <= truth + slack && found.upper >= truth - slack, "{label}");
        assert!(found.upper - found.lower <= 1e-9, "{label}");
        let decided = overlap(&a, &Pose::identity(), &b, &pose, &Options::default(), &mut WarmStart::default());
        match decided {
            Decision::Yes => assert!(truth == 0.0, "{label}"),
            Decision::No => assert!(truth > 0.0 || tilt > 0.0, "{label}"),
            Decision::Undecided { .. } => assert!(touching > 0, "{label}"),
        }
    }
}

/// Shapes that overlap are nearer than any threshold, by their closed forms alone.
#[test]
fn thresholds_of_overlapping_shapes_are_decided() {
    let shapes = [
        Body::cuboid("box", Vector3::new(0.5, 0.3, 0.4)).unwrap(),
        Body::cylinder("can", 0.4, 0.3).unwrap(),
        Body::ball("ball", Vector3::zeros(), 0.3).unwrap(),
    ];
    for seed in 0..200 {
        let mut random = Seeded(74_000 + seed);
        let (a, b) = (&shapes[random.next() as usize % 3], &shapes[random.next() as usize % 3]);
        let (pose_a, pose_b) = (random_pose(&mut random, 0.2), random_pose(&mut random, 0.2));
        let decided = only(&[Stage::ClosedForm], || {
            nearer_than(a, &pose_a, b, &pose_b, 0.1, &Options::default(), &mut WarmStart::default())
        });
        assert_eq!(decided, Ok(Decision::Yes), "seed {seed} {}-{}", a.name(), b.name());
    }
}

/// Decisions near contact are right, and are those of the distance.
#[test]
fn contacts_of_shapes_are_decided() {
    let smooth: Vec<Body> = zoo(&mut Seeded(3)).into_iter().filter(Body::is_smooth).collect();
    let mut open = 0;
    for seed in 0..1200 {
        let mut random = Seeded(73_000 + seed);
        let b = shape(&mut random);
        let a = if seed % 3 == 0 { shape(&mut random) } else { smooth[random.next() as usize % smooth.len()].clone() };
        let size = a.circumscribed().radius.min(b.circumscribed().radius);
        let pose_a = random_pose(&mut random, 1.0);
        let gap = size * 10_f64.powf(-5.0 + 4.0 * random.signed());
        let pose_b = at_gap(&a, &pose_a, &b, gap, &mut random);
        let touch = pose_b.translation() - pose_a.translation();
        let pose_b = if seed % 2 == 0 {
            pose_b
        } else {
            pose_b.with_translation(pose_b.translation() - touch * (2.0 * gap / touch.norm()))
        };
        let truth = except(&[Stage::ClosedForm, Stage::Planes], || {
            distance(&a, &pose_a, &b, &pose_b, &Options::default(), &mut WarmStart::default())
        });
        match overlap(&a, &pose_a, &b, &pose_b, &Options::default(), &mut WarmStart::default()) {
            Decision::Yes => assert!(truth.lower == 0.0, "seed {seed}: {truth:?}"),
            Decision::No => assert!(truth.upper > 0.0, "seed {seed}: {truth:?}"),
            Decision::Undecided { .. } => open += 1,
        }
    }
    assert!(open == 0, "{open} open");
}

/// Level distances over boxes and cylinders from well inside to far away, against the general
/// search: brackets, gradients and multipliers.
#[test]
fn smooth_bodies_over_shapes_are_settled_alone() {
    let smooth: Vec<Body> = (0..6).flat_map(|seed| zoo(&mut Seeded(seed))).filter(Body::is_smooth).collect();
    let gaps = [-0.1, -1e-3, 1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3];
    let (mut solved, count) = (0, 960);
    for seed in 0..count {
        let mut random = Seeded(76_000 + seed);
        let (a, b) = (smooth[random.next() as usize % smooth.len()].clone(), shape(&mut random));
        let size = a.circumscribed().radius.min(b.circumscribed().radius);
        let pose_a = random_pose(&mut random, 1.0);
        let pose_b = at_gap(&a, &pose_a, &b, gaps[(seed % 8) as usize] * size, &mut random);
        let ask =
            |pose_b: &Pose, warm: &mut WarmStart| level_distance(&a, &pose_a, &b, pose_b, &Options::default(), warm);
        let moved = pose_b.with_translation(pose_b.translation() + random.unit() * (1e-3 * size));
        let mut warm = WarmStart::default();
        for (round, pose) in [&pose_b, &moved].into_iter().enumerate() {
            let truth = except(&[Stage::ClosedForm], || ask(pose, &mut WarmStart::default()));
            let found = only(&[Stage::ClosedForm], || ask(pose, &mut warm));
            let label = format!("seed {seed}, round {round}, {}-{}: {found:?} against {truth:?}", a.name(), b.name());
            assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}");
            if found.status != Status::Converged {
                warm = WarmStart::default();
                continue;
            }
            solved += 1;
            if truth.status != Status::Converged || truth.saturated {
                continue;
            }
            let own = pose.rotation().inverse_transform_vector(&(found.witness - pose.translation()));
            assert!(b.value(&own) <= 1.0 + 1e-11, "{label}");
            // Where the level is flat, near its minimum, both are off by a part of what is flat.
            let (one, other) = (found.gradient_a, truth.gradient_a);
            let slope = other.linear.norm().max(1e-2 / a.circumscribed().radius);
            assert!((one.linear - other.linear).norm() < 1e-5 * slope, "{label}");
            assert!((found.gradient_b.linear - truth.gradient_b.linear).norm() < 1e-5 * slope, "{label}");
            let steep = 1e-5 * (truth.multiplier + slope * b.circumscribed().radius);
            assert!((found.multiplier - truth.multiplier).abs() < steep, "{label}");
            for (pose, one, other) in [(&pose_a, one, other), (pose, found.gradient_b, truth.gradient_b)] {
                let arm = (found.witness - pose.translation()).norm() + a.circumscribed().radius;
                assert!((one.angular - other.angular).norm() < 1e-5 * slope * arm, "{label}");
            }
        }
    }
    let share = 50.0 * f64::from(solved) / count as f64;
    println!("smooth bodies over shapes: {share:.1} % solved alone");
    assert!(share > 94.0, "{share}");
}

/// As they stand on a table: turned about the vertical alone, centres at about one height, so that
/// curvatures there are exactly 0.
#[test]
fn bricks_and_cans_on_a_table_are_settled_alone() {
    let new_pair = |seed: u64| {
        let mut random = Seeded(77_000 + seed);
        let mut size = || 0.2 * 4_f64.powf(random.signed());
        let half = Vector3::new(size(), size(), size());
        let a = match seed % 4 {
            0 => Body::ellipsoid("a", Vector3::zeros(), half).unwrap(),
            degree => Body::superellipsoid("a", Vector3::zeros(), half, 2 + 2 * degree as u8).unwrap(),
        };
        let half = Vector3::new(size(), size(), size());
        let b = if (seed / 4).is_multiple_of(2) {
            Body::cuboid("box", half).unwrap()
        } else {
            Body::cylinder("can", half.x, half.z).unwrap()
        };
        (a, b)
    };
    // An odd multiple of 8: each of the pairs is put to both heights.
    let pairs: Vec<(Body, Body)> = (0..168).map(new_pair).collect();
    let (mut solved, count) = (0, 480);
    for seed in 0..count {
        let mut random = Seeded(78_000 + seed);
        let (a, b) = &pairs[(seed % 168) as usize];
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 3.0 * random.signed());
        let far = (a.circumscribed().radius + b.circumscribed().radius) * 2_f64.powf(random.signed());
        let height = if seed / 8 % 2 == 0 { 0.0 } else { 0.05 };
        let direction = 3.0 * random.signed();
        let place = Vector3::new(far * direction.cos(), far * direction.sin(), height);
        let pose_b = Pose::from_quaternion(place, yaw.coords.into()).unwrap();
        let ask = || {
            let warm = &mut WarmStart::default();
            level_distance(a, &Pose::identity(), b, &pose_b, &Options::default(), warm)
        };
        let (truth, found) = (except(&[Stage::ClosedForm], ask), only(&[Stage::ClosedForm], ask));
        let label = format!("seed {seed}: {found:?} against {truth:?}");
        assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}");
        solved += u32::from(found.status == Status::Converged);
    }
    let share = 100.0 * f64::from(solved) / count as f64;
    println!("bricks and cans on a table: {share:.1} % solved alone");
    assert!(share > 95.0, "{share}");
}

/// Thousands of sizes apart, where rounding is about as wide as the accuracy: the status says
/// whether the bracket is as narrow as asked for.
#[test]
fn shapes_far_apart_say_whether_they_are_narrow() {
    let (mut narrow, mut wide) = (0, 0);
    for seed in 0..4000 {
        let mut random = Seeded(63_000 + seed);
        let (a, b) = (shape(&mut random), shape(&mut random));
        let small = a.circumscribed().radius.min(b.circumscribed().radius);
        let far = small * 10_f64.powf(4.0 + 1.5 * random.signed());
        let (pose_a, pose_b) = (random_pose(&mut random, small), random_pose(&mut random, far));
        let options = Options::default();
        let found = distance(&a, &pose_a, &b, &pose_b, &options, &mut WarmStart::default());
        let is_narrow = found.upper - found.lower <= options.accuracy() * small;
        assert_eq!(found.status == Status::Converged, is_narrow, "seed {seed}: {found:?}");
        *(if is_narrow { &mut narrow } else { &mut wide }) += 1;
    }
    println!("{narrow} narrow, {wide} wide");
    assert!(narrow > 1000, "{narrow}");
}
