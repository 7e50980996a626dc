//! Ill-conditioned data of capsules, half-spaces and points: 25.

use super::super::Draws;
use super::super::data::{Attempt, attempt};
use super::{Kind, Pair, Shape, somewhere};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Capsule, HalfSpace, Options, Pose, WarmStart, distance_to_point};

/// What must not be accepted, and beside it what just is.
pub fn attempts() -> Vec<Attempt> {
    let any = Some("");
    let capsule = |radius, half, expected| attempt([radius, half], Capsule::new(radius, half), expected);
    let plane = |n: Vector3<f64>, offset, expected| attempt((n, offset), HalfSpace::new(n, offset), expected);
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).expect("a ball");
    let point = |x: f64, expected| {
        let at = Vector3::new(x, 0.0, 0.0);
        let found = distance_to_point(&ball, &Pose::identity(), &at, &Options::default(), &mut WarmStart::default());
        attempt(at, found, expected)
    };
    let z = Vector3::z();
    // One size alone: where the inscribed ball is lost in rounding there is no body.
    let cuboid = |x, y, z, expected| attempt([x, y, z], Body::cuboid("box", Vector3::new(x, y, z)), expected);
    let cylinder = |radius, half, expected| attempt([radius, half], Body::cylinder("can", radius, half), expected);
    let ellipsoid =
        |x, y, z, expected| attempt([x, y, z], Body::ellipsoid("E", Vector3::zeros(), Vector3::new(x, y, z)), expected);
    vec![
        cuboid(1e9, 1.0, 1.0, Some("Thin")),
        cuboid(1.0, 1.0, 1e9, Some("Thin")),
        cuboid(1e9, 1e9, 1e9, None),
        cuboid(1e-9, 1e-9, 1e-9, None),
        cylinder(1e-9, 1.0, Some("Thin")),
        cylinder(1.0, 1e9, Some("Thin")),
        ellipsoid(1e9, 1.0, 1.0, Some("Thin")),
        ellipsoid(1e-9, 1e9, 1.0, Some("Unbounded")),
        ellipsoid(1e9, 1e9, 1e9, None),
        capsule(f64::NAN, 1.0, any),
        capsule(1.0, f64::NAN, any),
        capsule(-1e-300, 1.0, any),
        capsule(1.0, -1.0, any),
        capsule(f64::INFINITY, 1.0, any),
        capsule(1.0, 1.1e15, any),
        capsule(0.0, 0.0, None),
        capsule(1e-300, 1e15, None),
        plane(z * f64::NAN, 0.0, Some("NotFinite")),
        plane(z, f64::INFINITY, Some("NotFinite")),
        plane(z, 1.1e15, Some("NotFinite")),
        plane(Vector3::zeros(), 0.0, Some("NotUnit")),
        plane(z * (1.0 + 1e-5), 0.0, Some("NotUnit")),
        plane(z * (1.0 + 1e-7), 1e15, None),
        point(f64::NAN, any),
        point(f64::INFINITY, any),
        point(1.1e15, any),
        point(1e15, None),
    ]
}

/// Kinds of [`extreme`].
pub const EXTREMES: u64 = 22;

/// A shape of sizes from 1e-12 to 1e12 m, or of both, and an ordinary one near it.
pub fn extreme(index: u64, random: &mut dyn Draws) -> Pair {
    let of = Shape::of_sizes;
    let (first, second) = match index % EXTREMES {
        0 => (of(Kind::Capsule, [1e-8, 0.0, 1e-8]), Kind::Cuboid),
        1 => (of(Kind::Capsule, [1e-12, 0.0, 1.0]), Kind::Cylinder),
        2 => (of(Kind::Capsule, [1e-9, 0.0, 1e9]), Kind::Cuboid),
        3 => (of(Kind::Capsule, [1e8, 0.0, 1e-8]), Kind::Ellipsoid),
        4 => (of(Kind::Segment, [0.0, 0.0, 1e12]), Kind::Smooth),
        5 => (of(Kind::Segment, [0.0, 0.0, 1e-12]), Kind::Cylinder),
        6 => (of(Kind::Cuboid, [1e4, 1.0, 1e-2]), Kind::Capsule),
        7 => (of(Kind::Cylinder, [1e-4, 0.0, 1e2]), Kind::Capsule),
        8 => (of(Kind::Cuboid, [1e-2, 1.0, 1e4]), Kind::HalfSpace),
        // One size alone, of each shape.
        10 => (of(Kind::Ball, [1e9, 0.0, 0.0]), Kind::Cut),
        11 => (of(Kind::Ball, [1e-9, 0.0, 0.0]), Kind::Cut),
        12 => (of(Kind::Cuboid, [1.0, 1e-9, 1.0]), Kind::Smooth),
        13 => (of(Kind::Cuboid, [1.0, 1.0, 1e-9]), Kind::Cuboid),
        14 => (of(Kind::Cylinder, [1e9, 0.0, 1.0]), Kind::Smooth),
        15 => (of(Kind::Cylinder, [1.0, 0.0, 1e-9]), Kind::Cylinder),
        16 => (of(Kind::Capsule, [1e9, 0.0, 1.0]), Kind::Cut),
        17 => (of(Kind::Capsule, [1.0, 0.0, 1e9]), Kind::Cuboid),
        18 => (of(Kind::Capsule, [1e-9, 0.0, 1.0]), Kind::Smooth),
        19 => (of(Kind::Segment, [0.0, 0.0, 1e9]), Kind::Cut),
        20 => (of(Kind::Segment, [0.0, 0.0, 1e-9]), Kind::Cuboid),
        21 => (of(Kind::Cut, [1e-9, 1.0, 1.0]), Kind::HalfSpace),
        _ => (of(Kind::Cylinder, [1e2, 0.0, 1e-4]), Kind::Point),
    };
    let second = of(second, [0.3, 0.5, 0.7]);
    let reach = 2.0 * random.positive() + 1.5 * first.reach_m();
    let pair = somewhere([first, second], 0.1, reach, random, "extreme");
    // Below the rounding floor of the larger shape a bracket may stay wide, and says so.
    let floor = 1e-12 * (pair.a.reach_m().max(pair.b.reach_m()) + reach);
    let floor = if floor > pair.accuracy * pair.size() { floor } else { 0.0 };
    Pair { floor, ..pair }
}
