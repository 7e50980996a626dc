//! Random scenes of everything a scene can contain.

use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;
use sublevel_core::body::{Body, BodyId, Compound, Shape};
use sublevel_core::measure::HalfSpace;
use sublevel_scene::{Geometry, Ladder, NamedHalfSpace, Placement, Scene, Subject, Update};
use sublevel_testkit::Seeded;

/// Bodies of every convex kind, some tenths of a metre in size.
pub(crate) fn bodies() -> Vec<Geometry> {
    static BODIES: OnceLock<Vec<Geometry>> = OnceLock::new();
    BODIES.get_or_init(new_bodies).clone()
}

fn new_bodies() -> Vec<Geometry> {
    let ball = Body::ball("ball", Vector3::zeros(), 0.2).expect("a ball");
    let egg = Body::ellipsoid("egg", Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.3, 0.2, 0.1)).expect("an egg");
    let cuboid = Body::cuboid("box", Vector3::new(0.1, 0.2, 0.15)).expect("a box").with_gap(0.0);
    let turned = Body::ball("part", Vector3::new(0.4, 0.0, 0.0), 0.15).expect("a ball");
    let compound = Compound::new("two", vec![egg.clone(), turned]).expect("a compound");
    let points = [Vector3::new(0.05, 0.0, 0.1), Vector3::new(-0.1, 0.05, 0.0)];
    let rung = |body: Body| Arc::new(Shape::Body(Box::new(body.with_points(&points).expect("contained"))));
    let coarse = Body::ball("coarse", Vector3::zeros(), 0.3).expect("a ball");
    let fine = Body::ellipsoid("fine", Vector3::zeros(), Vector3::new(0.25, 0.15, 0.2)).expect("an egg");
    let ladder = Ladder::new("ladder", vec![rung(coarse), rung(fine)]).expect("a ladder");
    vec![ball.into(), egg.into(), cuboid.into(), compound.into(), Geometry::Ladder(Arc::new(ladder))]
}

/// A floor with its plane 2 m below the origin.
pub(crate) fn floor() -> Geometry {
    let half_space = HalfSpace::new(Vector3::z(), -2.0).expect("a half-space");
    Geometry::HalfSpace(Arc::new(NamedHalfSpace::new("floor", half_space).expect("a name")))
}

pub(crate) fn lookup(bodies: &[Geometry]) -> impl Fn(&BodyId) -> Option<Geometry> {
    move |id| bodies.iter().find(|body| body.id() == id).cloned()
}

pub(crate) fn placement(name: &str, body: &Geometry, pose: sublevel_core::measure::Pose) -> Placement {
    let (name, body) = (name.into(), *body.id());
    Placement { name, body, pose: Some(pose), group: "".into(), padding_m: None, attachment: None }
}

/// So many objects in a cube, a floor, groups, allowed pairs and paddings.
pub(crate) fn crowd(seed: u64, count: usize, size: f64) -> Scene {
    let (mut random, mut bodies) = (Seeded(seed), bodies());
    bodies.push(floor());
    let mut update = Update::default();
    for index in 0..count {
        let body = &bodies[random.index(5)];
        let mut placed = placement(&format!("o{index}"), body, random.pose(size));
        placed.group = ["", "left", "right"][random.index(3)].into();
        placed.padding_m = (random.index(4) == 0).then(|| 0.1 * random.signed());
        update.upserts.push(placed);
    }
    update.upserts.push(placement("floor", &bodies[5], sublevel_testkit::random::at(0.0, 0.0, 0.0)));
    let object = |index: usize| Subject::Object(format!("o{index}").into());
    for _ in 0..count / 4 {
        let (a, b) = (random.index(count), random.index(count));
        if a != b {
            update.allow.push((object(a), object(b)));
        }
    }
    update.allow.push((Subject::Group("left".into()), Subject::Group("right".into())));
    update.group_paddings.push(("left".into(), Some(0.05)));
    update.pair_paddings.push(((object(0), object(1)), Some(0.3)));
    Scene::new("crowd", 0).expect("a name").updated(&update, lookup(&bodies)).expect("an update")
}
