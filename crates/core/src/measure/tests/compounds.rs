//! Unions against loops over the pairs of their parts.

use super::{random_pose, twisted};
use crate::body::{Ball, Body, Compound, NodeContent, PartTree, Solid};
use crate::measure::growth::growth_bound;
use crate::measure::level::level_bound;
use crate::measure::part_pairs::SeenFrame;
use crate::measure::part_pairs::count::touched;
use crate::measure::*;
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::OnceLock;
use sublevel_testkit::Seeded;

fn heap(random: &mut Seeded, count: usize) -> Compound {
    let mut part = || {
        let half = Vector3::from_fn(|_, _| 0.5 * 2_f64.powf(random.signed()));
        let body = match random.next() % 4 {
            0 => Body::ball("part", Vector3::zeros(), half.x),
            1 => Body::ellipsoid("part", Vector3::zeros(), half),
            2 => Body::cuboid("part", half),
            _ => Body::cylinder("part", half.x, half.y),
        };
        let turn = UnitQuaternion::from_euler_angles(random.signed(), random.signed(), random.signed());
        body.unwrap().moved(&turn, &Vector3::from_fn(|_, _| 2.0 * random.signed())).unwrap()
    };
    Compound::new("heap", (0..count).map(|_| part()).collect()).unwrap()
}

#[test]
fn the_closest_parts_count() {
    let heaps: Vec<_> = (0..8).map(|seed| heap(&mut Seeded(seed), 1 + seed as usize % 5)).collect();
    for seed in 0..400 {
        let mut random = Seeded(900 + seed);
        let (a, b) = (&heaps[random.next() as usize % 8], &heaps[random.next() as usize % 8]);
        let pose_a = random_pose(&mut random, 1.0);
        let options = Options::default();
        let mut warm = WarmStart::default();
        let start = random.unit() * 6.0;
        let step = random.unit() * 0.2;
        for k in 0..5 {
            let place = pose_a.translation() + start + step * f64::from(k);
            let pose_b = Pose::from_quaternion(place, [0.5, 0.5, -0.5, 0.5]).unwrap();
            let pairs = a.parts().iter().flat_map(|p| b.parts().iter().map(move |q| (p, q)));
            let each = pairs
                .map(|(p, q)| crate::measure::distance(p, &pose_a, q, &pose_b, &options, &mut WarmStart::default()));
            let (lower, upper) = each.fold((f64::MAX, f64::MAX), |(l, u), d| (l.min(d.lower), u.min(d.upper)));
            let found = crate::measure::distance(a, &pose_a, b, &pose_b, &options, &mut warm);
            let label = format!("seed {seed} step {k}: {found:?} against {lower} {upper}");
            assert_eq!(found.status, Status::Converged, "{label}");
            assert!(found.lower <= upper && lower <= found.upper, "{label}");
            assert!(((found.witness_a - found.witness_b).norm() - found.upper).abs() < 1e-11, "{label}");
            let decided = overlap(a, &pose_a, b, &pose_b, &options, &mut warm);
            match decided {
                Decision::Yes => assert!(lower == 0.0, "{label}"),
                Decision::No => assert!(upper > 0.0, "{label}"),
                Decision::Undecided { .. } => assert!(lower == 0.0 && upper > 0.0, "{label}"),
            }
            for factor in [0.7, 1.3] {
                let nearer = nearer_than(a, &pose_a, b, &pose_b, factor * upper, &options, &mut warm);
                let expected = if factor > 1.0 && upper > 0.0 { Decision::Yes } else { Decision::No };
                assert_eq!(nearer, Ok(expected), "{label}");
            }
        }
    }
}

/// Of 64 pairs of elongated parts in each other's midst balls and planes leave few to be searched.
#[test]
fn few_pairs_of_many_parts_are_searched() {
    let (mut searched, mut queries) = (0, 0);
    let egg = Body::ellipsoid("part", Vector3::zeros(), Vector3::new(0.9, 0.25, 0.2)).unwrap();
    for seed in 0..12 {
        let mut random = Seeded(7_000 + seed);
        let mut heap = || {
            let mut part = || {
                let turn = UnitQuaternion::from_scaled_axis(random.unit() * 3.0);
                egg.moved(&turn, &Vector3::from_fn(|_, _| 1.2 * random.signed())).unwrap()
            };
            Compound::new("heap", (0..8).map(|_| part()).collect()).unwrap()
        };
        let (a, b) = (heap(), heap());
        let (away, step) = (random.unit() * (3.0 + random.signed()), random.unit() * 0.02);
        let mut warm = WarmStart::default();
        for k in 0..40 {
            let pose_b = Pose::from_quaternion(away + step * f64::from(k), [0.5, 0.5, -0.5, 0.5]).unwrap();
            let found = crate::measure::distance(&a, &Pose::identity(), &b, &pose_b, &Options::default(), &mut warm);
            assert_eq!(found.status, Status::Converged, "seed {seed} step {k}: {found:?}");
            searched += found.iterations;
            queries += 1;
        }
    }
    println!("{searched} evaluations of {queries} queries of 64 pairs");
    assert!(searched < 3 * queries, "{searched} of {queries}");
}

#[test]
fn hints_of_other_solids_do_no_harm() {
    let (large, small) = (heap(&mut Seeded(1), 5), heap(&mut Seeded(2), 2));
    let pose = Pose::from_quaternion(Vector3::new(7.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
    let mut warm = WarmStart::default();
    let options = Options::default();
    crate::measure::distance(&large, &Pose::identity(), &large, &pose, &options, &mut warm);
    let odd = crate::measure::distance(&small, &Pose::identity(), &small, &pose, &options, &mut warm);
    let cold = crate::measure::distance(&small, &Pose::identity(), &small, &pose, &options, &mut WarmStart::default());
    assert!(odd.lower <= cold.upper && cold.lower <= odd.upper, "{odd:?} {cold:?}");
}

/// Two heaps of up to six parts, the second somewhere about the first: far, near or in the midst of
/// it.
fn scene(seed: u64) -> (&'static Compound, &'static Compound, Pose, Pose) {
    static HEAPS: OnceLock<Vec<Compound>> = OnceLock::new();
    let heaps = HEAPS.get_or_init(|| (0..12).map(|k| heap(&mut Seeded(k), 1 + k as usize % 6)).collect());
    let mut random = Seeded(seed);
    let (a, b) = (&heaps[random.next() as usize % 12], &heaps[random.next() as usize % 12]);
    let far = [0.0, 0.7, 1.5, 6.0][(seed % 4) as usize];
    let pose_a = random_pose(&mut random, 3.0);
    let pose_b = random_pose(&mut random, 1.0);
    let place = pose_a.translation() + random.unit() * far;
    (a, b, pose_a, pose_b.with_translation(place))
}

/// Least lower and least upper bound of what `measure` says of all pairs of parts.
fn over_pairs(a: &Compound, b: &Compound, measure: impl Fn(&Body, &Body) -> [f64; 2]) -> [f64; 2] {
    let pairs = a.parts().iter().flat_map(|p| b.parts().iter().map(move |q| (p, q)));
    pairs.map(|(p, q)| measure(p, q)).fold([f64::INFINITY; 2], |[l, u], [lower, upper]| [l.min(lower), u.min(upper)])
}

#[test]
fn levels_and_growths_are_those_of_the_least_pair() {
    let options = Options::default();
    for seed in 0..200 {
        let (a, b, pose_a, pose_b) = scene(seed);
        let (mut warm_ab, mut warm_ba, mut warm_s) = Default::default();
        for k in 0..3 {
            let pose = pose_b.with_translation(pose_b.translation() + Vector3::new(0.1, -0.05, 0.1) * f64::from(k));
            let orders = [((a, &pose_a), (b, &pose), &mut warm_ab), ((b, &pose), (a, &pose_a), &mut warm_ba)];
            for ((of, pose_of), (on, pose_on), warm) in orders {
                let found = level_distance(of, pose_of, on, pose_on, &options, warm);
                let [lower, upper] = over_pairs(of, on, |p, q| {
                    let one = level_distance(p, pose_of, q, pose_on, &options, &mut WarmStart::default());
                    [one.lower, one.upper]
                });
                let label = format!("seed {seed}: {found:?} against {lower} {upper}");
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.lower <= upper && lower <= found.upper, "{label}");
                let far = Vector3::repeat(1e-9);
                let inside = on.parts().iter().any(|part| {
                    let y = pose_on.rotation().inverse_transform_vector(&(found.witness - pose_on.translation()));
                    part.value(&y) <= 1.0 + far.x
                });
                assert!(inside, "{label}");
            }
            let found = growth_distance(a, &pose_a, b, &pose, &options, &mut warm_s);
            let [lower, upper] = over_pairs(a, b, |p, q| {
                let one = growth_distance(p, &pose_a, q, &pose, &options, &mut WarmStart::default());
                [one.lower, one.upper]
            });
            let label = format!("seed {seed}: {found:?} against {lower} {upper}");
            assert_eq!(found.status, Status::Converged, "{label}");
            assert!(found.lower <= upper && lower <= found.upper, "{label}");
            // Above 1 exactly if apart.
            let apart = crate::measure::distance(a, &pose_a, b, &pose, &options, &mut WarmStart::default());
            assert!(apart.lower == 0.0 || found.upper >= 1.0, "{label} {apart:?}");
            assert!(apart.upper > 0.0 || found.lower <= 1.0, "{label} {apart:?}");
        }
    }
}

/// Of capsules and points the nearest part counts, too, with hints and without; and decisions
/// agree.
#[test]
fn capsules_and_points_are_as_far_as_the_nearest_part() {
    let options = Options::default();
    let mut sides = [0; 2];
    for seed in 0..300 {
        let (a, _, pose_a, pose_b) = scene(seed);
        let capsule = Capsule::new([0.2, 0.0][(seed / 4 % 2) as usize], [0.5, 0.0, 2.0][(seed % 3) as usize]).unwrap();
        let (mut warm, mut of_decisions, mut of_points) = Default::default();
        for k in 0..3 {
            let pose = pose_b.with_translation(pose_b.translation() + Vector3::new(0.1, -0.05, 0.1) * f64::from(k));
            let least = |measure: &dyn Fn(&Body) -> [f64; 2]| {
                a.parts()
                    .iter()
                    .map(measure)
                    .fold([f64::INFINITY; 2], |[l, u], [lower, upper]| [l.min(lower), u.min(upper)])
            };
            let [lower, upper] = least(&|part| {
                let found = distance_to_capsule(part, &pose_a, &capsule, &pose, &options, &mut WarmStart::default());
                [found.lower, found.upper]
            });
            let found = distance_to_capsule(a, &pose_a, &capsule, &pose, &options, &mut warm);
            let label = format!("seed {seed} step {k}: {found:?} against {lower} {upper}");
            assert!(found.lower <= upper && lower <= found.upper, "{label}");
            assert!(found.lower > 0.0 || upper < 1e-9, "{label}");
            sides[usize::from(found.lower > 0.0)] += 1;
            if found.lower > 0.0 {
                assert_eq!(found.status, Status::Converged, "{label}");
            }
            match overlap_with_capsule(a, &pose_a, &capsule, &pose, &options, &mut of_decisions) {
                Decision::Yes => assert!(lower <= 0.0, "{label}"),
                Decision::No => assert!(upper > 0.0, "{label}"),
                Decision::Undecided { .. } => assert!(lower <= 0.0 && upper > 0.0, "{label}"),
            }
            for threshold in [0.7, 1.3].map(|factor| factor * upper.max(0.1)) {
                let nearer =
                    nearer_to_capsule_than(a, &pose_a, &capsule, &pose, threshold, &options, &mut of_decisions);
                let expected = if upper < threshold { Decision::Yes } else { Decision::No };
                assert_eq!(nearer, Ok(expected), "{label} below {threshold}");
                let mut cold = WarmStart::default();
                let within = within_margin_of_capsule(a, &pose_a, &capsule, &pose, threshold, &options, &mut cold);
                match within.unwrap() {
                    WithinMargin::Beyond { lower } => assert!(lower > threshold && lower <= upper, "{label}"),
                    WithinMargin::Within(found) => {
                        assert!(
                            found.lower <= upper && lower <= found.upper && upper <= threshold,
                            "{label}: {found:?}"
                        );
                    }
                }
            }
            let point = *pose.translation();
            let [lower, upper] = least(&|part| {
                let found = distance_to_point(part, &pose_a, &point, &options, &mut WarmStart::default()).unwrap();
                [found.lower, found.upper]
            });
            let found = distance_to_point(a, &pose_a, &point, &options, &mut of_points).unwrap();
            let label = format!("seed {seed} step {k}: {found:?} against {lower} {upper}");
            assert!(found.lower <= upper && lower <= found.upper && found.status == Status::Converged, "{label}");
        }
    }
    assert!(sides.iter().all(|&count| count > 100), "{sides:?}");
}

/// All bounds of nodes hold of all parts in them.
#[test]
fn bounds_of_nodes_hold_of_their_parts() {
    let options = Options::default();
    let mut useful = [0; 2];
    for seed in 0..40 {
        let (a, b, pose_a, pose_b) = scene(seed);
        let seen = SeenFrame::new(&pose_a, &pose_b);
        let [tree_a, tree_b] = [a, b].map(|solid| solid.tree().expect("a compound has a tree"));
        let measured: Vec<Vec<_>> = a
            .parts()
            .iter()
            .map(|p| {
                b.parts()
                    .iter()
                    .map(|q| {
                        let warm = || WarmStart::default();
                        let signed = signed_distance(p, &pose_a, q, &pose_b, &options, &mut warm()).upper;
                        let level = level_distance(p, &pose_a, q, &pose_b, &options, &mut warm()).upper;
                        (signed, level, growth_distance(p, &pose_a, q, &pose_b, &options, &mut warm()).upper)
                    })
                    .collect()
            })
            .collect();
        for i in 0..tree_a.nodes().len() {
            for j in 0..tree_b.nodes().len() {
                let gap = seen.gap(&tree_a.nodes()[i].ball, &tree_b.nodes()[j].ball);
                let level = level_bound(&seen, &tree_a.centers()[i], &tree_b.nodes()[j].ball).lower;
                let growth = growth_bound(&seen, &tree_a.centers()[i], &tree_b.centers()[j]);
                for p in parts_of(tree_a, i) {
                    for q in parts_of(tree_b, j) {
                        let truth = measured[p][q];
                        let label = format!("seed {seed}, parts {p} and {q} in nodes {i} and {j}: {truth:?}");
                        assert!(
                            gap <= truth.0 && level <= truth.1 && growth <= truth.2,
                            "{label}, {gap} {level} {growth}"
                        );
                    }
                }
                let is_inner = parts_of(tree_a, i).len() > 1 && parts_of(tree_b, j).len() > 1;
                useful[0] += u32::from(is_inner && level > 1.0);
                useful[1] += u32::from(is_inner && growth > 1.0);
            }
        }
    }
    assert!(useful.iter().all(|&count| count > 20), "{useful:?}");
}

/// The parts below a node.
fn parts_of(tree: &PartTree, node: usize) -> Vec<usize> {
    match tree.nodes()[node].content {
        NodeContent::Part(part) => vec![part.into()],
        NodeContent::Nodes(nodes) => nodes.into_iter().flat_map(|node| parts_of(tree, node.into())).collect(),
    }
}

/// As many elongated parts, so small that about as much of the space is filled by any number of
/// them.
fn cloud(random: &mut Seeded, count: usize) -> Compound {
    let size = (count as f64).cbrt().recip();
    let egg = Body::ellipsoid("part", Vector3::zeros(), Vector3::new(0.9, 0.35, 0.3) * size).unwrap();
    let mut part = || {
        let turn = UnitQuaternion::from_scaled_axis(random.unit() * 3.0);
        egg.moved(&turn, &Vector3::from_fn(|_, _| random.signed())).unwrap()
    };
    Compound::new("cloud", (0..count).map(|_| part()).collect()).unwrap()
}

/// Of solids with many parts every measure but the level distance evaluates bounds of few nodes and
/// solves few pairs: both grow far less than the number of pairs. Level distances of elongated
/// parts grow with the square of what their bound grows with, and most pairs are solved; of these
/// the trees evaluate no more bounds than there are nodes on the way.
#[test]
fn few_of_many_parts_are_touched() {
    type Ask = fn(&Compound, &Compound, &Pose, &mut WarmStart);
    const OPTIONS: fn() -> Options<'static> = Options::default;
    let measures: [(&str, usize, Ask); 8] = [
        ("distance", 2, |a, b, pose, warm| {
            distance(a, &Pose::identity(), b, pose, &OPTIONS(), warm);
        }),
        ("overlap", 2, |a, b, pose, warm| {
            overlap(a, &Pose::identity(), b, pose, &OPTIONS(), warm);
        }),
        ("signed distance", 2, |a, b, pose, warm| {
            signed_distance(a, &Pose::identity(), b, pose, &OPTIONS(), warm);
        }),
        ("level distance", 2, |a, b, pose, warm| {
            level_distance(a, &Pose::identity(), b, pose, &OPTIONS(), warm);
        }),
        ("growth distance", 2, |a, b, pose, warm| {
            growth_distance(a, &Pose::identity(), b, pose, &OPTIONS(), warm);
        }),
        ("capsule", 1, |a, _, pose, warm| {
            distance_to_capsule(a, &Pose::identity(), &Capsule::new(0.1, 0.6).unwrap(), pose, &OPTIONS(), warm);
        }),
        ("overlap with a capsule", 1, |a, _, pose, warm| {
            overlap_with_capsule(a, &Pose::identity(), &Capsule::new(0.1, 0.6).unwrap(), pose, &OPTIONS(), warm);
        }),
        ("point", 1, |a, _, pose, warm| {
            distance_to_point(a, &Pose::identity(), pose.translation(), &OPTIONS(), warm).unwrap();
        }),
    ];
    for count in [8, 64, 256] {
        let mut random = Seeded(17_000 + count as u64);
        let (a, b) = (cloud(&mut random, count), cloud(&mut random, count));
        for (name, sides, ask) in measures {
            let is_level = name == "level distance";
            if is_level && count == 256 {
                continue;
            }
            let (mut cold, mut warmed) = ([0; 2], [0; 2]);
            let queries = 12_u32;
            for seed in 0..queries {
                let mut random = Seeded(18_000 + u64::from(seed));
                let away = random.unit() * (3.2 + 0.6 * random.signed());
                let pose = random_pose(&mut random, 0.0).with_translation(away);
                let mut warm = WarmStart::default();
                for total in [&mut cold, &mut warmed] {
                    let ((), touched) = touched(|| ask(&a, &b, &pose, &mut warm));
                    (0..2).for_each(|k| total[k] += touched[k]);
                }
            }
            let pairs = if sides == 2 { count * count } else { count };
            let each = |total: [u32; 2]| total.map(|total| f64::from(total) / f64::from(queries));
            let ([bounds, solved], again) = (each(cold), each(warmed));
            println!("{name}, {pairs} pairs: {bounds:.0} bounds and {solved:.1} solved, {again:.1?} with a hint");
            assert!(!is_level || bounds <= 2.0 * pairs as f64 + 32.0, "{bounds} bounds of {pairs} pairs");
            let few = if sides == 2 { 2.0 * count as f64 } else { count as f64 / 8.0 };
            if count >= 64 && !is_level {
                assert!(bounds < pairs as f64 * 0.75 && solved < few, "{name}: {bounds} bounds, {solved} solved");
            }
        }
    }
}

/// The bound of a motion holds for points of the ball, from turns of nearly nothing to half a turn
/// and at any offset, and is not far above the longest way.
#[test]
fn balls_move_no_farther_than_their_bound() {
    for seed in 0..2000 {
        let mut random = Seeded(18_500 + seed);
        let offset = 10_f64.powf(1.5 + 4.5 * random.signed());
        let (pose_a, far) = (random_pose(&mut random, 1.0), random.unit() * offset);
        let before = random_pose(&mut random, 0.0).with_translation(pose_a.translation() + far);
        let angle = 10_f64.powf(-4.25 + 4.74 * random.signed());
        let step = random.unit() * 10_f64.powf(-4.0 + 5.0 * random.signed());
        let turn = UnitQuaternion::from_scaled_axis(random.unit() * angle);
        let turned = (turn * before.rotation()).coords;
        let after =
            Pose::from_quaternion(before.translation() + step, [turned.x, turned.y, turned.z, turned.w]).unwrap();
        let ball = Ball { center: random.unit() * random.positive(), radius: random.between(0.01, 3.0) };
        let [seen, now] = [&before, &after].map(|pose| SeenFrame::new(&pose_a, pose));
        let bound = now.moved_since(&seen, &ball);
        let mut longest = 0.0_f64;
        for _ in 0..50 {
            let x = ball.center + random.unit() * ball.radius;
            longest = longest.max((after.transform_point(&x) - before.transform_point(&x)).norm());
        }
        let rounding = 4.0 * f64::EPSILON * (offset + 5.0);
        assert!(longest <= bound + rounding, "seed {seed}: {longest} {bound}");
        assert!(bound <= 3.0 * longest + 1e-12 * (offset + 5.0), "seed {seed}: {longest} {bound}");
    }
}

/// Along motions of small steps the bound of the other parts spares their search, and changes no
/// answer: neither of distances and signed distances, nor of decisions, nor where other solids take
/// the hint over.
#[test]
fn other_parts_are_left_out_along_motions() {
    let options = Options::default();
    for (step, most) in [(1e-4, 0.6), (1e-3, 0.7), (1e-2, 0.9), (0.3, 1.05)] {
        let (mut kept, mut forgotten) = ([0; 2], [0; 2]);
        for seed in 0..10 {
            let mut random = Seeded(19_000 + seed);
            let (a, b, other) = (cloud(&mut random, 16), cloud(&mut random, 12), cloud(&mut random, 12));
            let pose_a = random_pose(&mut random, 1.0);
            let start = random.unit() * (2.4 + 1.2 * random.signed());
            let (go, turn) = (random.unit() * step, random.unit() * step);
            let (mut warm, mut plain) = (WarmStart::default(), WarmStart::default());
            for k in 0..40 {
                let turned = UnitQuaternion::from_scaled_axis(turn * f64::from(k));
                let q = turned.coords;
                let place = pose_a.translation() + start + go * f64::from(k);
                let pose_b = Pose::from_quaternion(place, [q.x, q.y, q.z, q.w]).unwrap();
                let b = if k == 20 { &other } else { &b };
                let label = format!("step {step}, seed {seed}, {k}");
                plain.others = None;
                let (found, with) = touched(|| distance(&a, &pose_a, b, &pose_b, &options, &mut warm));
                let (expected, without) = touched(|| distance(&a, &pose_a, b, &pose_b, &options, &mut plain));
                assert!(
                    found.lower <= expected.upper && expected.lower <= found.upper,
                    "{label}: {found:?} {expected:?}"
                );
                for i in 0..2 {
                    kept[i] += with[i];
                    forgotten[i] += without[i];
                }
                let far = nearer_than(&a, &pose_a, b, &pose_b, 0.9 * expected.lower, &options, &mut warm);
                assert!(expected.lower == 0.0 || far == Ok(Decision::No), "{label}: {far:?}");
                let near = nearer_than(&a, &pose_a, b, &pose_b, 1.1 * expected.upper, &options, &mut warm);
                assert!(expected.upper == 0.0 || near == Ok(Decision::Yes), "{label}: {near:?}");
                if k % 10 == 0 {
                    let signed = signed_distance(&a, &pose_a, b, &pose_b, &options, &mut warm);
                    let cold = signed_distance(&a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
                    assert!(signed.lower <= cold.upper && cold.lower <= signed.upper, "{label}: {signed:?} {cold:?}");
                }
            }
        }
        let share = f64::from(kept[1]) / f64::from(forgotten[1]);
        println!("steps of {step}: {kept:?} bounds and pairs, {forgotten:?} without: {share:.2}");
        assert!(share <= most, "{share} of the pairs at steps of {step}");
    }
}

/// Length of a separating translation along n, from samples.
fn sampled_exit(
    (a, pose_a): (&Compound, &Pose),
    (b, pose_b): (&Compound, &Pose),
    n: &Vector3<f64>,
    limit: f64,
) -> Option<f64> {
    (0..).map(|k| 0.02 * f64::from(k)).take_while(|t| *t < limit).find(|t| {
        let pose = pose_a.with_translation(pose_a.translation() + n * *t);
        overlap(a, &pose, b, pose_b, &Options::default(), &mut WarmStart::default()) == Decision::No
    })
}

#[test]
fn translations_separate_and_few_are_shorter() {
    let options = Options::default();
    let (mut overlaps, mut narrow, mut missed) = (0, 0, 0);
    for seed in 0..120 {
        let (a, b, pose_a, pose_b) = scene(seed);
        let found = penetration(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        let label = format!("seed {seed}: {found:?}");
        let [least, _] = over_pairs(a, b, |p, q| {
            let one = penetration(p, &pose_a, q, &pose_b, &options, &mut WarmStart::default());
            [-one.upper, -one.lower]
        });
        let apart = crate::measure::distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        let Some(n) = found.direction else {
            assert!(found.upper == 0.0 && least >= -1e-12 && apart.upper > 0.0, "{label}");
            continue;
        };
        overlaps += 1;
        narrow += u32::from(found.status == Status::Converged);
        assert!(found.lower <= found.upper && found.upper >= -least * (1.0 - 2e-3), "{label} pairs {least}");
        let moved = pose_a.with_translation(pose_a.translation() + n * (found.upper * (1.0 + 1e-9) + 1e-9));
        assert_ne!(overlap(a, &moved, b, &pose_b, &options, &mut WarmStart::default()), Decision::Yes, "{label}");
        let mut random = Seeded(seed);
        for _ in 0..60 {
            let n = random.unit();
            let shorter = sampled_exit((a, &pose_a), (b, &pose_b), &n, found.upper);
            assert!(shorter.is_none_or(|t| t >= found.lower), "{label}: {shorter:?} along {n:?}");
            missed += u32::from(shorter.is_some_and(|t| t < 0.95 * found.upper));
        }
    }
    assert!(overlaps >= 40 && narrow >= 20 && missed < 30, "{overlaps} overlaps, {narrow} narrow, {missed} missed");
}

#[test]
fn signed_distances_continue_distances() {
    let options = Options::default();
    let mut sides = [0; 2];
    for seed in 0..60 {
        let (a, b, pose_a, pose_b) = scene(seed);
        let mut random = Seeded(seed);
        let step = random.unit() * 0.15;
        let mut warm = WarmStart::default();
        let mut before: Option<SignedDistance> = None;
        for k in 0..30 {
            let pose = pose_b.with_translation(pose_b.translation() + step * f64::from(k));
            let found = signed_distance(a, &pose_a, b, &pose, &options, &mut warm);
            let label = format!("seed {seed} step {k}: {found:?}");
            assert!(found.lower <= found.upper, "{label}");
            let apart = crate::measure::distance(a, &pose_a, b, &pose, &options, &mut WarmStart::default());
            if found.lower > 0.0 {
                sides[0] += 1;
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.lower <= apart.upper && apart.lower <= found.upper, "{label} {apart:?}");
            } else {
                sides[1] += 1;
                let depth = penetration(a, &pose_a, b, &pose, &options, &mut WarmStart::default());
                assert!(-depth.upper <= found.upper + 1e-9 && found.lower <= -depth.lower + 1e-9, "{label} {depth:?}");
                assert!(apart.lower <= 1e-8, "{label} {apart:?}");
            }
            if let Some(before) = before {
                assert!(found.lower <= before.upper + 0.15 + 1e-12, "{label} after {before:?}");
                assert!(found.upper >= before.lower - 0.15 - 1e-12, "{label} after {before:?}");
            }
            before = Some(found);
        }
    }
    assert!(sides[0] > 300 && sides[1] > 300, "{sides:?}");
}

#[test]
fn gradients_of_untied_answers_are_the_derivatives() {
    let options = Options::default();
    let (mut apart, mut inside, mut jumped) = (0, 0, 0);
    for seed in 0..80 {
        let (a, b, pose_a, pose_b) = scene(seed);
        let value = |poses: &[Pose; 2]| {
            signed_distance(a, &poses[0], b, &poses[1], &options, &mut WarmStart::default()).value()
        };
        let poses = [pose_a, pose_b];
        let found = signed_distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        if found.tied || found.at_contact {
            continue;
        }
        let gradients = found.gradients.unwrap();
        for (which, gradient) in gradients.iter().enumerate() {
            for component in 0..6 {
                let axis = Vector3::from_fn(|i, _| f64::from(u8::from(i == component % 3)));
                let moved = |h: f64| {
                    let mut poses = poses;
                    poses[which] = twisted(&poses[which], &axis, component >= 3, h);
                    value(&poses)
                };
                let h = 1e-5;
                let difference = (moved(h) - moved(-h)) / (2.0 * h);
                let exact = if component < 3 { gradient.linear } else { gradient.angular }.dot(&axis);
                let near = (difference - exact).abs() < 5e-3;
                if found.lower > 0.0 {
                    apart += 1;
                    assert!(near, "seed {seed} body {which} component {component}: {difference} {exact} {found:?}");
                } else {
                    inside += 1;
                    jumped += u32::from(!near);
                }
            }
        }
    }
    assert!(apart > 100 && inside > 300 && jumped * 20 < inside, "{apart} apart, {inside} inside, {jumped} jumped");
}

#[test]
fn parts_that_are_about_as_near_are_reported() {
    let ball = |y: f64| Body::ball("ball", Vector3::new(0.0, y, 0.0), 0.5).unwrap();
    let (two, one) = (Compound::new("two", vec![ball(0.8), ball(-0.8)]).unwrap(), ball(0.0));
    let options = Options::default();
    let here = Pose::identity();
    // Apart, and in an overlap with both.
    for (x, off) in [2.0, 0.5].into_iter().flat_map(|x| [0.0, 1e-3, -1e-3].map(|off| (x, off))) {
        let pose = Pose::from_quaternion(Vector3::new(x, off, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
        let cold = WarmStart::default;
        let message = [
            level_distance(&two, &here, &one, &pose, &options, &mut cold()).tied,
            level_distance(&one, &pose, &two, &here, &options, &mut cold()).tied,
            growth_distance(&two, &here, &one, &pose, &options, &mut cold()).tied,
        ];
        assert_eq!(message, [off == 0.0; 3], "{x} {off}");
        let near = crate::measure::distance(&two, &here, &one, &pose, &options, &mut cold());
        assert_eq!(near.tied, off == 0.0 && near.lower > 0.0, "{x} {off} {near:?}");
        let signed = signed_distance(&two, &here, &one, &pose, &options, &mut cold());
        if x > 1.0 {
            assert_eq!(signed.tied, off == 0.0, "{x} {off} {signed:?}");
            let n = Vector3::new(x, off - 0.8 * off.signum(), 0.0).normalize();
            assert!(off == 0.0 || (signed.normal.unwrap() + n).norm() < 1e-4, "{signed:?}");
        } else {
            // The ball leaves between the others or past them: both contain it, and it has but one
            // shortest way.
            assert!(signed.upper < 0.0, "{signed:?}");
        }
        let center = *pose.translation();
        let point = distance_to_point(&two, &here, &center, &options, &mut cold()).unwrap();
        assert_eq!(point.tied, off == 0.0, "{x} {off} {point:?}");
        let wall = HalfSpace::new(Vector3::x(), -2.0).unwrap();
        let turned = UnitQuaternion::from_scaled_axis(Vector3::z() * off);
        let pose = Pose::from_quaternion(Vector3::zeros(), turned.coords.into()).unwrap();
        let low = distance_to_half_space(&two, &pose, &wall, &options, &mut cold());
        assert_eq!(low.tied, off == 0.0, "{off} {low:?}");
        // Single bodies never are.
        assert!(!crate::measure::distance(&one, &here, &one, &pose, &options, &mut cold()).tied);
    }
}

#[test]
fn answers_name_the_parts_they_are_about() {
    let options = Options::default();
    let mut curved = 0;
    for seed in 0..40 {
        let (a, b, pose_a, pose_b) = scene(seed);
        let found = crate::measure::distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        let (p, q) = (&a.parts()[usize::from(found.parts[0])], &b.parts()[usize::from(found.parts[1])]);
        let one = crate::measure::distance(p, &pose_a, q, &pose_b, &options, &mut WarmStart::default());
        assert!(one.lower <= found.upper && found.lower <= one.upper, "seed {seed}: {found:?} {one:?}");
        let of_union = translation_hessian(a, &pose_a, b, &pose_b, &found);
        let of_parts = translation_hessian(p, &pose_a, q, &pose_b, &one);
        if let (Some(h), Some(k)) = (of_union, of_parts) {
            curved += 1;
            assert!((h - k).amax() <= 1e-3 * (1.0 + k.amax()), "seed {seed}: {h} {k}");
        }
    }
    assert!(curved > 5, "{curved}");
}

/// Where the closest pair of parts changes on a path, the normal jumps; there, and hardly anywhere
/// else, the flag is set.
#[test]
fn normals_jump_only_where_ties_are_reported() {
    let options = Options::default();
    let (mut changes, mut tied, mut queries) = (0, 0, 0);
    for seed in 0..40 {
        let (a, b, pose_a, pose_b) = scene(4 * seed + 3);
        let along = Seeded(seed).unit() * 8.0;
        let at = |t: f64| {
            let pose = pose_b.with_translation(pose_b.translation() + along * t);
            crate::measure::distance(a, &pose_a, b, &pose, &options, &mut WarmStart::default())
        };
        let steps: Vec<Distance> = (0..=50).map(|k| at(f64::from(k) / 50.0)).collect();
        queries += steps.len();
        tied += steps.iter().filter(|found| found.tied).count();
        for (k, pair) in steps.windows(2).enumerate() {
            if pair[0].parts == pair[1].parts || pair.iter().any(|found| found.lower < 0.01) {
                continue;
            }
            let (mut low, mut high) = (k as f64 / 50.0, (k + 1) as f64 / 50.0);
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if at(middle).parts == pair[0].parts {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            changes += 1;
            assert!(at(low).tied && at(high).tied, "seed {seed} at {low}: {:?} {:?}", at(low), at(high));
        }
    }
    assert!(changes > 20 && tied * 100 <= queries, "{changes} changes, {tied} tied of {queries}");
}

#[test]
fn translations_that_are_about_as_short_are_reported() {
    let ball = |x: f64| Body::ball("ball", Vector3::new(x, 0.0, 0.0), 0.5).unwrap();
    let (two, one) = (Compound::new("two", vec![ball(0.3), ball(-0.3)]).unwrap(), ball(0.0));
    let options = Options::default();
    for (y, message) in [(0.0, true), (0.1, false)] {
        let pose = Pose::from_quaternion(Vector3::new(0.0, y, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
        let signed = signed_distance(&two, &Pose::identity(), &one, &pose, &options, &mut WarmStart::default());
        let depth = penetration(&two, &Pose::identity(), &one, &pose, &options, &mut WarmStart::default());
        // Out sideways the balls at the ends are passed at once: (y + d)² + 0.3² = 1.
        let truth = 0.91_f64.sqrt() - y;
        assert!((depth.upper - truth).abs() < 1e-6 && (signed.lower + truth).abs() < 1e-6, "{depth:?} {signed:?}");
        assert!(depth.lower <= truth && signed.upper >= -truth, "{depth:?} {signed:?}");
        assert_eq!((depth.tied, signed.tied), (message, message), "{depth:?} {signed:?}");
        if !message {
            let [of_two, of_one] = signed.gradients.unwrap();
            assert!((of_two.linear + Vector3::y()).norm() < 1e-3 && (of_one.linear - Vector3::y()).norm() < 1e-3);
            assert!(of_two.angular.norm() < 1e-3, "{of_two:?}");
        }
    }
}
