//! What the counting takes from the library.

pub(super) use sublevel_core::body::Body;
pub(super) use sublevel_core::measure::stages::{Stage, asked, except};
pub(super) use sublevel_core::measure::{
    Capsule, Decision, Distance, HalfSpace, ImpactOptions, ImpactStatus, Motion, Options, Pose, Ray, RayCast, Status,
    Sweep, WarmStart, cast_ball, cast_ray, distance, distance_batch, distance_to_capsule, distance_to_half_space,
    distance_to_point, growth_distance, level_distance, overlap, penetration, signed_distance, time_of_impact,
};
pub(super) use sublevel_testkit::random::{pose, shifted, turned};

use std::collections::BTreeMap;
use std::sync::Mutex;

/// The body of that file, read once.
pub(super) fn own(json: &str) -> &'static Body {
    static BODIES: Mutex<BTreeMap<String, &'static Body>> = Mutex::new(BTreeMap::new());
    let mut bodies = BODIES.lock().expect("no thread panicked");
    bodies.entry(json.to_owned()).or_insert_with(|| Box::leak(Box::new(Body::from_json(json).expect("a body file"))))
}
