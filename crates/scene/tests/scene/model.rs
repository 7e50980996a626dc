//! Random updates, forks, attachments and questions against a model that knows nothing of sharing.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use sublevel_core::body::BodyId;
use sublevel_core::measure::Pose;
use sublevel_scene::query::{Ask, Measure, Operand, Pairs, Selection, Within, combined};
use sublevel_scene::{Attach, Crew, Geometry, Scene, SceneError, Subject, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::draws;

use crate::brute_force::signed;
use crate::worlds::{bodies, floor, lookup, placement};

/// What a scene is, as plainly as can be.
#[derive(Clone, Debug, Default)]
struct Model {
    objects: BTreeMap<String, Thing>,
    allowed: BTreeSet<(String, String)>,
    revision: u64,
}

#[derive(Clone, Debug)]
struct Thing {
    body: BodyId,
    /// In the world, or in what holds it.
    pose: Pose,
    holder: Option<String>,
}

fn product(a: &Pose, b: &Pose) -> Pose {
    let q = (a.rotation() * b.rotation()).coords;
    Pose::from_quaternion(a.transform_point(b.translation()), (q / q.norm()).into()).expect("a pose")
}

fn inverse(a: &Pose) -> Pose {
    let q = a.rotation().inverse();
    Pose::from_quaternion(-(q * a.translation()), q.coords.into()).expect("a pose")
}

impl Model {
    fn world(&self, name: &str) -> Pose {
        let thing = &self.objects[name];
        match &thing.holder {
            Some(holder) => product(&self.world(holder), &thing.pose),
            None => thing.pose,
        }
    }

    fn holds(&self, name: &str) -> bool {
        self.objects.values().any(|thing| thing.holder.as_deref() == Some(name))
    }

    fn is_above(&self, name: &str, other: &str) -> bool {
        name == other || self.objects[other].holder.as_ref().is_some_and(|holder| self.is_above(name, holder))
    }
}

struct Worlds {
    bodies: Vec<Geometry>,
    /// Scenes and forks with their models.
    all: Vec<(Scene, Model)>,
}

fn pair(a: &str, b: &str) -> (String, String) {
    if a <= b { (a.into(), b.into()) } else { (b.into(), a.into()) }
}

/// One random update with what the model says of it; an error where it must be refused.
fn step(random: &mut Seeded, model: &Model, bodies: &[Geometry]) -> (Update, Option<Model>) {
    let (mut update, mut next) = (Update::default(), model.clone());
    let names: Vec<String> = model.objects.keys().cloned().collect();
    let name = |random: &mut Seeded| names[random.index(names.len())].clone();
    let mut fails = false;
    match random.index(if names.len() < 3 { 1 } else { 9 }) {
        0 => {
            for _ in 0..=random.index(3) {
                let (name, body, pose) =
                    (format!("n{}", random.index(14)), &bodies[random.index(bodies.len())], random.pose(2.0));
                if update.upserts.iter().any(|placement| *placement.name == *name) {
                    continue;
                }
                update.upserts.push(placement(&name, body, pose));
                next.objects.insert(name, Thing { body: *body.id(), pose, holder: None });
            }
        }
        1..=3 => {
            for _ in 0..=random.index(4) {
                let (name, pose) = (name(random), random.pose(2.0));
                if update.poses.iter().any(|(known, _)| **known == *name) {
                    continue;
                }
                update.poses.push((name.as_str().into(), pose));
            }
            // Free objects first: places in holders are taken where these will be.
            for (name, pose) in &update.poses {
                let thing = next.objects.get_mut(&**name).expect("there");
                if thing.holder.is_none() {
                    thing.pose = *pose;
                }
            }
            // A held object that is moved along with its holder would need the holder's new place.
            let held: Vec<_> =
                update.poses.iter().filter(|(name, _)| model.objects[&**name].holder.is_some()).cloned().collect();
            if held.len() > 1 {
                update.poses.retain(|(name, _)| model.objects[&**name].holder.is_none());
            } else if let [(name, pose)] = &held[..] {
                let holder = next.objects[&**name].holder.clone().expect("held");
                let place = product(&inverse(&next.world(&holder)), pose);
                next.objects.get_mut(&**name).expect("there").pose = place;
            }
            if update.poses.is_empty() {
                update.poses.push((names[0].as_str().into(), random.pose(2.0)));
                return step(random, model, bodies);
            }
        }
        4 => {
            let name = name(random);
            fails = model.holds(&name);
            next.objects.remove(&name);
            next.allowed.retain(|(a, b)| *a != name && *b != name);
            update.removals.push(name.as_str().into());
        }
        5 => {
            let (a, b) = (name(random), name(random));
            fails = a == b;
            let subject = |name: &str| Subject::Object(name.into());
            if random.index(2) == 0 {
                update.allow.push((subject(&a), subject(&b)));
                next.allowed.insert(pair(&a, &b));
            } else {
                update.forbid.push((subject(&a), subject(&b)));
                next.allowed.remove(&pair(&a, &b));
            }
        }
        6 => {
            let (held, to) = (name(random), name(random));
            fails = model.is_above(&held, &to);
            let keeps = random.index(2) == 0;
            let place = random.pose(0.5);
            if !fails {
                let pose = if keeps { product(&inverse(&model.world(&to)), &model.world(&held)) } else { place };
                let thing = next.objects.get_mut(&held).expect("there");
                (thing.holder, thing.pose) = (Some(to.clone()), pose);
            }
            update.attach.push(Attach {
                name: held.as_str().into(),
                to: to.as_str().into(),
                pose: (!keeps).then_some(place),
                touch: Vec::new(),
            });
        }
        7 => {
            let name = name(random);
            let world = model.world(&name);
            let thing = next.objects.get_mut(&name).expect("there");
            (thing.holder, thing.pose) = (None, world);
            update.detach.push(name.as_str().into());
        }
        _ => {
            update.expected_revision = Some(model.revision + random.index(2) as u64);
            fails = update.expected_revision != Some(model.revision);
            let (name, pose) = (name(random), random.pose(2.0));
            if model.objects[&name].holder.is_none() {
                next.objects.get_mut(&name).expect("there").pose = pose;
                update.poses.push((name.as_str().into(), pose));
            }
        }
    }
    if !update.is_empty() {
        next.revision += 1;
    }
    (update, (!fails).then_some(next))
}

fn agree(scene: &Scene, model: &Model, label: &str) {
    assert_eq!(scene.revision(), model.revision, "{label}");
    let names: Vec<&str> = scene.objects().map(|(_, object, _)| &*object.name).collect();
    assert_eq!(names, model.objects.keys().map(String::as_str).collect::<Vec<_>>(), "{label}");
    for (slot, object, pose) in scene.objects() {
        let thing = &model.objects[&*object.name];
        assert_eq!(*object.geometry.id(), thing.body, "{label}");
        assert_eq!(object.attachment.as_ref().map(|held| held.to.to_string()), thing.holder, "{label} {}", object.name);
        let world = model.world(&object.name);
        let error = (pose.translation() - world.translation()).norm() + pose.rotation().angle_to(world.rotation());
        assert!(error < 1e-11, "{label}: {} is {error:e} away", object.name);
        assert_eq!(scene.slot(&object.name), Some(slot), "{label}");
    }
    let allowed: BTreeSet<(String, String)> = scene
        .rules()
        .allowed()
        .map(|(a, b)| {
            let (Subject::Object(a) | Subject::Group(a), Subject::Object(b) | Subject::Group(b)) = (a, b);
            pair(a, b)
        })
        .collect();
    assert_eq!(allowed, model.allowed, "{label}");
}

/// Everything near, by the tree that was carried along, against all pairs.
fn asks(scene: &Scene, crew: &Crew, label: &str) {
    let ask = Ask::new(vec![Measure::Signed]).expect("a measure");
    let within = Within::new(scene.clone(), ask.clone(), Selection::all(), 0.1);
    let (found, complete) = combined(scene, crew.ask(Arc::new(within), Arc::default()).expect("answered"));
    assert!(complete, "{label}");
    let slots: Vec<_> = scene.objects().map(|(slot, _, _)| slot).collect();
    for (i, &a) in slots.iter().enumerate() {
        for &b in &slots[i + 1..] {
            let Some([lower, upper]) = signed(scene, [a, b]) else { continue };
            let is_found = found.iter().any(|found| found.pair == [a, b]);
            assert!(!is_found || lower <= 0.1 && !scene.is_allowed(a, b), "{label} {a} {b}");
            assert!(is_found || upper >= 0.1 || scene.is_allowed(a, b), "{label} {a} {b} [{lower}, {upper}]");
        }
    }
    // Warm answers of one pair after another.
    let operands: Vec<Operand> = slots.iter().map(|&slot| Operand::Object(slot)).collect();
    if operands.len() > 1 {
        let pairs = vec![[0, 1]];
        let pairs = Pairs::new(scene.clone(), ask, operands, pairs).expect("pairs");
        let answer = crew.ask(Arc::new(pairs), Arc::default()).expect("answered").concat()[0];
        if let Some([lower, upper]) =
            signed(scene, [slots[0], slots[1]]).filter(|_| !scene.is_allowed(slots[0], slots[1]))
        {
            assert!(answer.lower <= upper && lower <= answer.upper, "{label} {answer:?}");
        }
    }
}

#[test]
fn scenes_do_what_a_model_does() {
    let crew = Crew::new(2).expect("threads");
    let mut bodies = bodies();
    bodies.push(floor());
    let (mut refused, mut forked, mut committed) = (0, 0, 0);
    // 10^5 steps in all.
    for seed in 0..draws(20) {
        let mut random = Seeded(9000 + seed);
        let mut worlds = Worlds { bodies: bodies.clone(), all: Vec::new() };
        worlds.all.push((Scene::new("world", 1).expect("a name"), Model { revision: 1, ..Model::default() }));
        for at in 0..5000 {
            let label = format!("seed {seed} step {at}");
            let index = random.index(worlds.all.len());
            let (scene, model) = worlds.all[index].clone();
            match random.index(60) {
                0 if worlds.all.len() < 4 => {
                    forked += 1;
                    worlds.all.push((scene.fork(&format!("fork {at}")).expect("a name"), model));
                    continue;
                }
                1 if index > 0 => {
                    // What the first scene holds is what the fork holds then.
                    committed += 1;
                    let next = scene.committed_to(&worlds.all[0].0);
                    let revision = model.revision.max(worlds.all[0].1.revision) + 1;
                    worlds.all[0] = (next, Model { revision, ..model });
                    worlds.all.remove(index);
                    agree(&worlds.all[0].0, &worlds.all[0].1, &label);
                    continue;
                }
                2 => {
                    asks(&scene, &crew, &label);
                    continue;
                }
                _ => {}
            }
            let (update, expected) = step(&mut random, &model, &worlds.bodies);
            let result = scene.updated(&update, lookup(&worlds.bodies));
            match (result, expected) {
                (Ok(next), Some(expected)) => worlds.all[index] = (next, expected),
                (Err(error), None) => {
                    refused += 1;
                    assert!(!matches!(error, SceneError::NoObject { .. }), "{label}: {error}");
                }
                (result, expected) => panic!("{label}: {update:?}\n{result:?}\n{:?}", expected.is_some()),
            }
            if at % 10 == 0 {
                for (scene, model) in &worlds.all {
                    agree(scene, model, &label);
                }
            }
        }
    }
    println!("{refused} refused, {forked} forks, {committed} of them committed");
    assert!(refused > 100 && forked > 100 && committed > 20, "{refused} {forked} {committed}");
}
