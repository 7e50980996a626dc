//! Batches of poses, against single queries.

mod balls;
mod capsules;
mod shapes;

use nalgebra::{Vector3, Vector4};
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;
use sublevel_testkit::Seeded;

/// A pose within a cube about the origin of this half side, metres.
fn pose(random: &mut Seeded, far: f64) -> Pose {
    let q = Vector4::from_fn(|_, _| random.signed()).normalize();
    Pose::from_quaternion(Vector3::from_fn(|_, _| far * random.signed()), q.into()).unwrap()
}

/// A body of one constraint off the origin of its frame.
fn smooth(random: &mut Seeded, degree: u8) -> Body {
    let center = Vector3::from_fn(|_, _| random.signed());
    let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
    if degree == 2 {
        Body::ellipsoid("egg", center, half).unwrap()
    } else {
        Body::superellipsoid("q", center, half, degree).unwrap()
    }
}
