//! Answers of scenes against all pairs, measured one by one without tree, cache or threads.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::body::{Body, Compound, Shape};
use sublevel_core::measure::{
    HalfSpace, Options, Pose, Ray, RayCast, WarmStart, cast_ray, distance_to_half_space, signed_distance,
};
use sublevel_scene::query::{
    AnswerStatus, Ask, Clearance, Measure, RayAnswer, Rays, Selection, StateVerdict, States, Within, closest_pair,
    combined,
};
use sublevel_scene::{Crew, Geometry, Ladder, Scene, Slot, Stop, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::at;

use crate::worlds::{crowd, floor, lookup, placement};

/// Bracket of the signed distance of two objects, metres; none of two half-spaces.
pub(crate) fn signed(scene: &Scene, [a, b]: [Slot; 2]) -> Option<[f64; 2]> {
    let side = |slot: Slot| Some((&scene.object(slot)?.geometry, *scene.pose(slot)?));
    let ((a, pose_a), (b, pose_b)) = (side(a)?, side(b)?);
    let (options, mut warm) = (Options::default(), WarmStart::default());
    match (a, b) {
        (Geometry::HalfSpace(_), Geometry::HalfSpace(_)) => None,
        (Geometry::HalfSpace(plane), solid) => half_space(solid, &pose_b, plane.half_space(), &pose_a),
        (solid, Geometry::HalfSpace(plane)) => half_space(solid, &pose_a, plane.half_space(), &pose_b),
        (a, b) => {
            let (a, b) = (&**a.rungs().last()?, &**b.rungs().last()?);
            let found = signed_distance(a, &pose_a, b, &pose_b, &options, &mut warm);
            Some([found.lower, found.upper])
        }
    }
}

fn half_space(solid: &Geometry, pose: &Pose, plane: &HalfSpace, at: &Pose) -> Option<[f64; 2]> {
    let normal = at.transform_direction(plane.normal());
    let offset = plane.offset() + normal.dot(at.translation());
    let placed = HalfSpace::new(normal, offset).expect("a half-space");
    let (options, mut warm) = (Options::default(), WarmStart::default());
    let found = distance_to_half_space(&**solid.rungs().last()?, pose, &placed, &options, &mut warm);
    Some([found.lower - 1e-13, found.upper + 1e-13])
}

/// All pairs that count, the smaller name first.
fn pairs(scene: &Scene, counts: impl Fn(Slot) -> bool) -> Vec<[Slot; 2]> {
    let slots: Vec<Slot> = scene.objects().map(|(slot, _, _)| slot).collect();
    let mut pairs = Vec::new();
    for (i, &a) in slots.iter().enumerate() {
        for &b in &slots[i + 1..] {
            if (counts(a) || counts(b)) && !scene.is_allowed(a, b) {
                pairs.push([a, b]);
            }
        }
    }
    pairs
}

fn selections(scene: &Scene, seed: u64) -> Vec<(Selection, HashSet<Slot>)> {
    let all: HashSet<Slot> = scene.objects().map(|(slot, _, _)| slot).collect();
    let mut random = Seeded(seed);
    let some: HashSet<Slot> = all.iter().copied().filter(|_| random.index(5) == 0).collect();
    let floor: HashSet<Slot> = scene.slot("floor").into_iter().collect();
    let of = |slots: &HashSet<Slot>| Selection::of(scene, slots.iter().copied(), &HashSet::new());
    vec![(Selection::all(), all), (of(&some), some), (of(&floor), floor)]
}

#[test]
fn everything_within_a_margin_is_found_and_nothing_else() {
    let crew = Crew::new(2).expect("threads");
    let ask = Ask::new(vec![Measure::Distance, Measure::Signed]).expect("measures");
    let mut tally = [0; 2];
    for seed in 0..12 {
        let scene = crowd(seed, 40 + 30 * (seed as usize % 3), 2.5);
        for (selection, selected) in selections(&scene, seed) {
            for margin in [0.0, 0.05, 0.7] {
                let question = Within::new(scene.clone(), ask.clone(), selection.clone(), margin);
                let parts = crew.ask(Arc::new(question), Arc::default()).expect("answered");
                let (found, complete) = combined(&scene, parts);
                assert!(complete);
                let found: BTreeMap<[Slot; 2], _> = found.into_iter().map(|f| (f.pair, f.answers)).collect();
                for pair in pairs(&scene, |slot| selected.contains(&slot)) {
                    let Some([lower, upper]) = signed(&scene, pair) else { continue };
                    let threshold = margin + scene.padding_m(pair[0], pair[1]);
                    let label = || format!("seed {seed} margin {margin} {pair:?} [{lower}, {upper}] {threshold}");
                    match found.get(&pair) {
                        Some(answers) => {
                            tally[0] += 1;
                            assert!(lower <= threshold, "{}", label());
                            let (distance, signed) = (&answers[0], &answers[1]);
                            assert!(signed.lower <= upper && lower <= signed.upper, "{} {signed:?}", label());
                            assert!(distance.lower <= upper.max(0.0), "{} {distance:?}", label());
                            assert!(distance.upper >= lower, "{} {distance:?}", label());
                        }
                        None => {
                            tally[1] += 1;
                            assert!(upper >= threshold, "{}", label());
                        }
                    }
                }
                let counted: HashSet<[Slot; 2]> = pairs(&scene, |s| selected.contains(&s)).into_iter().collect();
                assert!(found.keys().all(|pair| counted.contains(pair)), "a pair that does not count");
            }
        }
    }
    assert!(tally.iter().all(|&count| count > 1000), "{tally:?}");
}

#[test]
fn the_closest_pair_is_the_closest_pair() {
    let (crew, stop) = (Crew::new(2).expect("threads"), Arc::<Stop>::default());
    let ask = Ask::new(vec![Measure::Signed]).expect("measures");
    for seed in 0..40 {
        let size = if seed % 2 == 0 { 3.0 } else { 40.0 };
        let scene = crowd(100 + seed, 4 + seed as usize, size);
        for (selection, selected) in selections(&scene, seed) {
            let clearance = |pair: [Slot; 2]| {
                signed(&scene, pair).map(|[lower, upper]| [lower, upper].map(|d| d - scene.padding_m(pair[0], pair[1])))
            };
            let all = pairs(&scene, |slot| selected.contains(&slot));
            let least = all.iter().filter_map(|&pair| Some(clearance(pair)?[1])).fold(f64::INFINITY, f64::min);
            let (found, complete) =
                closest_pair(&crew, &stop, (&scene, &ask), &selection, f64::INFINITY).expect("answered");
            assert!(complete);
            match found {
                None => assert_eq!(least, f64::INFINITY, "seed {seed}"),
                Some(found) => {
                    let [lower, _] = clearance(found.pair).expect("a distance");
                    assert!(lower <= least + 1e-9, "seed {seed}: {:?} has {lower}, the least is {least}", found.pair);
                }
            }
            let (none, _) = closest_pair(&crew, &stop, (&scene, &ask), &selection, 1e-300).expect("answered");
            assert!(none.is_none() || least <= 1e-9, "seed {seed}");
        }
    }
}

#[test]
fn states_are_free_exactly_if_no_pair_is_near() {
    let crew = Crew::new(2).expect("threads");
    let (mut verdicts, mut apart_rows) = ([0; 2], 0);
    for seed in 0..10 {
        // Few and many objects that stand still: without the tree and with it.
        let scene = crowd(200 + seed, if seed % 2 == 0 { 25 } else { 90 }, 3.0);
        let mut random = Seeded(seed);
        let slots: Vec<Slot> = ["o1", "o5", "o9"].iter().filter_map(|name| scene.slot(name)).collect();
        let states = 40;
        let poses: Vec<Pose> = (0..states * slots.len()).map(|_| random.pose(3.0)).collect();
        let packed: Vec<f64> = poses.iter().flat_map(numbers).collect();
        let margin = 0.03;
        let question = States::new(scene.clone(), &slots, packed.clone(), margin, false).expect("states");
        let answers = crew.ask(Arc::new(question), Arc::default()).expect("answered").concat();
        let worst = States::new(scene.clone(), &slots, packed.clone(), margin, false).expect("states");
        let worst = worst.with_worst_pair(Some(1e-6)).expect("an accuracy");
        let worst = crew.ask(Arc::new(worst), Arc::default()).expect("answered").concat();
        let clear = Clearance::new(scene.clone(), &slots, packed, margin, false).expect("states");
        let clear = crew.ask(Arc::new(clear), Arc::default()).expect("answered").concat();
        for state in 0..states {
            let moved: Vec<(Slot, Pose)> =
                slots.iter().copied().zip(poses[state * slots.len()..].iter().copied()).collect();
            let posed = scene.posed(&moved).expect("poses");
            let near = |[a, b]: [Slot; 2]| {
                let [lower, upper] = signed(&posed, [a, b])?;
                let threshold = margin + posed.padding_m(a, b);
                (lower <= threshold).then_some(([a, b], upper < threshold))
            };
            let near: Vec<_> = pairs(&posed, |slot| slots.contains(&slot)).into_iter().filter_map(near).collect();
            let label = format!("seed {seed} state {state}: {near:?} {:?}", answers[state]);
            match answers[state].verdict {
                StateVerdict::Free => {
                    verdicts[0] += 1;
                    assert!(near.iter().all(|(_, proven)| !proven), "{label}");
                }
                StateVerdict::Contact => {
                    verdicts[1] += 1;
                    let [a, b] = answers[state].pair.expect("the pair that decided");
                    assert!(near.iter().any(|(pair, _)| *pair == [a, b] || *pair == [b, a]), "{label}");
                }
                StateVerdict::Undecided => assert!(near.iter().all(|(_, proven)| !proven), "{label}"),
                other => panic!("{label} {other:?}"),
            }
            let decided = [StateVerdict::Free, StateVerdict::Contact];
            if decided.contains(&answers[state].verdict) && decided.contains(&worst[state].verdict) {
                assert_eq!(answers[state].verdict, worst[state].verdict, "{label} {:?}", worst[state]);
            }
            let rows: HashSet<[Slot; 2]> = clear[state].rows.iter().map(|row| row.pair).collect();
            assert!(clear[state].checked);
            for ([a, b], proven) in &near {
                assert!(!proven || rows.contains(&[*a, *b]) || rows.contains(&[*b, *a]), "{label}");
            }
            for row in &clear[state].rows {
                let [lower, upper] = signed(&posed, row.pair).expect("a distance");
                let answer = &row.answer;
                assert!(answer.lower <= upper && lower <= answer.upper, "{label} {row:?}");
                assert!(near.iter().any(|(pair, _)| *pair == row.pair || [pair[1], pair[0]] == row.pair), "{label}");
                if let (true, Some([on_a, on_b]), Some(normal)) = (answer.lower > 0.0, answer.witnesses, answer.normal)
                {
                    let apart = on_a - on_b - answer.upper * normal;
                    assert!(apart.norm() <= 1e-6, "{label} {row:?}");
                    let [of_a, of_b] = answer.gradients.expect("apart").map(|twist| twist.linear);
                    assert!((of_a - normal).norm() < 1e-12 && (of_b + normal).norm() < 1e-12, "{label} {row:?}");
                    apart_rows += 1;
                }
            }
        }
    }
    assert!(verdicts.iter().all(|&count| count > 30) && apart_rows > 30, "{verdicts:?} {apart_rows}");
}

fn numbers(pose: &Pose) -> [f64; 7] {
    let (t, q) = (pose.translation(), pose.rotation().coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

#[test]
fn rays_hit_what_is_first() {
    let crew = Crew::new(2).expect("threads");
    let mut hits = 0;
    for seed in 0..10 {
        let scene = crowd(300 + seed, 60, 4.0);
        let mut random = Seeded(seed);
        let rays: Vec<(Vector3<f64>, Vector3<f64>)> =
            (0..60).map(|_| (6.0 * random.unit(), random.unit() * random.between(0.1, 3.0))).collect();
        let question = Rays::new(scene.clone(), Selection::all(), &rays, (20.0, 0.0)).expect("rays");
        let answers = crew.ask(Arc::new(question), Arc::default()).expect("answered").concat();
        for (ray, answer) in rays.iter().zip(&answers) {
            let cast = Ray::new(ray.0, ray.1.normalize(), 20.0).expect("a ray");
            let mut first = (f64::INFINITY, None);
            for (slot, object, pose) in scene.objects() {
                let upper = match &object.geometry {
                    Geometry::HalfSpace(plane) => {
                        let (n, offset) = (plane.half_space().normal(), plane.half_space().offset());
                        let height = n.dot(&ray.0) - offset;
                        let at = if height <= 0.0 { 0.0 } else { height / -n.dot(&ray.1.normalize()) };
                        if (0.0..=20.0).contains(&at) { at } else { f64::INFINITY }
                    }
                    geometry => {
                        match cast_ray(&**geometry.rungs().last().expect("a rung"), pose, &cast, &Options::default()) {
                            RayCast::Hit(hit) => hit.upper,
                            RayCast::Miss | RayCast::Undecided { .. } => f64::INFINITY,
                        }
                    }
                };
                if upper < first.0 {
                    first = (upper, Some(slot));
                }
            }
            match first.1 {
                None => assert!(answer.hit.is_none(), "seed {seed} {answer:?}"),
                Some(_) => {
                    hits += 1;
                    assert!(
                        answer.lower_m <= first.0 + 1e-9 && answer.upper_m >= first.0 - 1e-9,
                        "seed {seed} {first:?} {answer:?}"
                    );
                }
            }
        }
    }
    assert!(hits > 200, "{hits}");
}

/// One half-space at a pose, and rays of a length.
fn cast_at_floor(pose: &Pose, rays: &[(Vector3<f64>, Vector3<f64>)], length_m: f64) -> Vec<RayAnswer> {
    let bodies = [floor()];
    let update = Update { upserts: vec![placement("floor", &bodies[0], *pose)], ..Update::default() };
    let scene = Scene::new("hall", 0).expect("a scene").updated(&update, lookup(&bodies)).expect("placed");
    let question = Rays::new(scene, Selection::all(), rays, (length_m, 0.0)).expect("rays");
    Crew::new(1).expect("a thread").ask(Arc::new(question), Arc::default()).expect("answered").concat()
}

/// The oracle looks from the floor's own frame, where its plane is exact.
#[test]
fn rays_without_end_hit_turned_floors_within_their_brackets() {
    let (mut random, mut hits) = (Seeded(77), 0);
    for step in 0..2000 {
        let pose = random.pose(3.0);
        let (origin, direction) = (10.0 * random.unit(), random.unit());
        let answer = cast_at_floor(&pose, &[(origin, direction)], f64::INFINITY)[0];
        let inside = pose.rotation().inverse();
        let (from, along) = (inside * (origin - pose.translation()), inside * direction);
        let (height, sinking) = (from.z + 2.0, -along.z);
        if height <= 0.0 {
            assert!(answer.hit.is_some() && answer.upper_m == 0.0, "seed 77, {step}: {answer:?}");
        } else if sinking > 1e-6 {
            let at = height / sinking;
            let slack = 1e-14 * (at + 20.0) * (1.0 + 1.0 / sinking);
            let bracket = answer.lower_m - slack..=answer.upper_m + slack;
            assert!(bracket.contains(&at), "seed 77, {step}: {at} {answer:?}");
            assert_eq!(answer.status, AnswerStatus::Converged, "seed 77, {step}: {answer:?}");
            hits += 1;
        } else if sinking < -1e-6 {
            assert!(answer.hit.is_none(), "seed 77, {step}: {answer:?}");
        }
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn rays_along_a_floor_are_decided_where_its_normal_is_known() {
    let level = [(Vector3::new(0.0, 0.0, 1.0), Vector3::new(0.6, 0.8, 0.0))];
    let moved = Pose::from_quaternion(Vector3::new(0.3, 0.1, 0.7), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
    assert!(cast_at_floor(&moved, &level, f64::INFINITY)[0].hit.is_none());
    // Turned about its own normal: level but for rounding, which shows after 1e14 m.
    let turned = Pose::from_quaternion(Vector3::new(0.3, 0.1, 0.7), [0.0, 0.0, 0.6, 0.8]).expect("a pose");
    assert!(cast_at_floor(&turned, &level, 1e6)[0].hit.is_none());
    let open = cast_at_floor(&turned, &level, f64::INFINITY)[0];
    assert_eq!((open.status, open.upper_m, open.point), (AnswerStatus::BracketWide, f64::INFINITY, None));
    assert!(open.lower_m > 1e13, "{open:?}");
}

#[test]
fn answers_do_not_depend_on_what_was_asked_before_nor_on_threads() {
    let ask = |cold| {
        let mut ask = Ask::new(vec![Measure::Distance]).expect("a measure");
        ask.cold = cold;
        ask
    };
    for seed in 0..6 {
        let scene = crowd(400 + seed, 50, 2.0);
        let run = |threads: usize, cold: bool| {
            let crew = Crew::new(threads).expect("threads");
            let question = Within::new(scene.clone(), ask(cold), Selection::all(), 0.5);
            let (found, _) = combined(&scene, crew.ask(Arc::new(question), Arc::default()).expect("answered"));
            let bits = |found: &sublevel_scene::query::Found| {
                let answer = &found.answers[0];
                (found.pair, answer.lower.to_bits(), answer.upper.to_bits())
            };
            found.iter().map(bits).collect::<Vec<_>>()
        };
        let first = run(1, true);
        run(2, false);
        assert_eq!(first, run(2, true), "seed {seed}: cold answers are the same, bit for bit");
        let warm = run(2, false);
        assert_eq!(first.len(), warm.len());
        for (cold, warm) in first.iter().zip(&warm) {
            let [cold_lower, cold_upper] = [cold.1, cold.2].map(f64::from_bits);
            let [warm_lower, warm_upper] = [warm.1, warm.2].map(f64::from_bits);
            assert!(cold_lower <= warm_upper && warm_lower <= cold_upper, "seed {seed} {cold:?} {warm:?}");
        }
    }
}

#[test]
fn a_stopped_question_ends_with_what_balls_say() {
    let scene = crowd(500, 60, 3.0);
    let (crew, stop) = (Crew::new(2).expect("threads"), Arc::<Stop>::default());
    stop.set();
    let slots: Vec<Slot> = scene.objects().map(|(slot, _, _)| slot).collect();
    let operands = slots.iter().map(|&slot| sublevel_scene::query::Operand::Object(slot)).collect();
    let pairs: Vec<[u32; 2]> = (1..slots.len() as u32).map(|i| [0, i]).collect();
    let ask = Ask::new(vec![Measure::Distance, Measure::Signed]).expect("measures");
    let question = sublevel_scene::query::Pairs::new(scene.clone(), ask, operands, pairs.clone()).expect("pairs");
    let answers = crew.ask(Arc::new(question), stop).expect("answered").concat();
    for (index, &[a, b]) in pairs.iter().enumerate() {
        let pair = [slots[a as usize], slots[b as usize]];
        let answer = &answers[2 * index + 1];
        if let Some([lower, upper]) = signed(&scene, pair).filter(|_| !scene.is_allowed(pair[0], pair[1])) {
            assert!(answer.lower <= upper && lower <= answer.upper, "{answer:?}");
            assert_eq!(answer.status, sublevel_scene::query::AnswerStatus::Deadline);
        }
    }
}

/// A coarser rung need not contain a finer one: it may be apart where that touches, and the finest
/// decides.
#[test]
fn the_finest_rung_of_a_ladder_decides() {
    let points = [Vector3::new(0.05, 0.05, 0.05), Vector3::new(-0.05, 0.0, 0.0)];
    let rung = |half: Vector3<f64>| {
        let body = Body::ellipsoid("rung", Vector3::zeros(), half).expect("an ellipsoid");
        Arc::new(Shape::Body(Box::new(body.with_points(&points).expect("contained"))))
    };
    let rungs = vec![rung(Vector3::new(0.5, 0.2, 0.2)), rung(Vector3::new(0.2, 0.3, 0.2))];
    let ladder = Geometry::Ladder(Arc::new(Ladder::new("ladder", rungs).expect("a ladder")));
    let ball: Geometry = Body::ball("ball", Vector3::zeros(), 0.1).expect("a ball").into();
    let part = Body::ball("part", Vector3::new(0.0, 9.0, 0.0), 0.1).expect("a ball");
    let first = Body::ball("first", Vector3::zeros(), 0.1).expect("a ball");
    let two: Geometry = Compound::new("two", vec![first, part]).expect("a compound").into();
    for other in [ball, two] {
        // 0.05 m into the finest rung along y and as far from the coarser one; and along x.
        for (x, y, expected) in [(0.0, 0.35, StateVerdict::Contact), (0.35, 0.0, StateVerdict::Free)] {
            let upserts =
                vec![placement("ladder", &ladder, at(0.0, 0.0, 0.0)), placement("other", &other, at(x, y, 0.0))];
            let update = Update { upserts, ..Update::default() };
            let scene = Scene::new("two", 0).expect("a name");
            let scene = scene.updated(&update, lookup(&[ladder.clone(), other.clone()])).expect("placed");
            let (slot, pose) = (scene.slot("other").expect("there"), at(x, y, 0.0));
            let row = pose.translation().iter().chain(pose.rotation().coords.iter()).copied().collect();
            let question = States::new(scene, &[slot], row, 0.0, false).expect("a state");
            let answers = Crew::new(1).expect("threads").ask(Arc::new(question), Arc::default()).expect("answered");
            assert_eq!(answers.concat()[0].verdict, expected, "{x} {y}");
        }
    }
}
