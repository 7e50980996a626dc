//! Rays against closed forms and samples.

use super::*;
use crate::body::Compound;
use crate::measure::tests::{random_pose, zoo};
use nalgebra::UnitQuaternion;
use sublevel_testkit::Seeded;

fn cast(solid: &impl Solid, pose: &Pose, ray: &Ray) -> RayCast {
    cast_ray(solid, pose, ray, &Options::default())
}

/// First parameter at which the ray is in the body by the closed form of balls and boxes in
/// their own frames.
fn ball_entry(radius: f64, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<f64> {
    let (b, c) = (o.dot(d), o.norm_squared() - radius * radius);
    let discriminant = b * b - c;
    (c > 0.0 && b < 0.0 && discriminant >= 0.0).then(|| -b - discriminant.sqrt()).or((c <= 0.0).then_some(0.0))
}

fn box_entry(half: &Vector3<f64>, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<f64> {
    let (mut from, mut to) = (0.0_f64, f64::INFINITY);
    for i in 0..3 {
        let (one, other) = ((-half[i] - o[i]) / d[i], (half[i] - o[i]) / d[i]);
        from = from.max(one.min(other));
        to = to.min(one.max(other));
    }
    (from <= to).then_some(from)
}

#[test]
fn rays_that_end_before_the_surface_do_not_hit() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    for seed in 0..2000 {
        let mut random = Seeded(seed);
        let pose = random_pose(&mut random, 1.0);
        let d = if seed % 2 == 0 { Vector3::repeat(1.0).normalize() } else { random.unit() };
        let aside = d.cross(&random.unit()) * if seed % 3 == 0 { 0.0 } else { 1.1 * random.signed().abs() };
        let Some(truth) = ball_entry(1.0, &(aside - d * 3.0), &d) else { continue };
        let short = 10_f64.powi(-2 - (seed % 9) as i32);
        let origin = pose.transform_point(&(aside - d * 3.0));
        let ray = Ray::new(origin, pose.transform_direction(&d), truth - short).unwrap();
        let accuracy = [1.0, 1e-3, 1e-6, 1e-9][(seed / 9 % 4) as usize];
        let options = Options::default().with_accuracy(accuracy).unwrap();
        let found = cast_ray(&ball, &pose, &ray, &options);
        assert!(found.hit().is_none(), "seed {seed}, {short} short, accuracy {accuracy}: {found:?}");
    }
}

#[test]
fn balls_and_boxes_have_closed_forms() {
    let (mut hits, mut misses) = (0, 0);
    let bodies: Vec<_> = (0..20)
        .map(|seed| {
            let mut random = Seeded(seed);
            let scale = 10_f64.powi((seed % 5) as i32 * 3 - 6);
            let half = Vector3::from_fn(|_, _| scale * 4_f64.powf(random.signed()));
            let ball = || Body::ball("b", Vector3::zeros(), half.x);
            (scale, half, if seed % 2 == 0 { Body::cuboid("b", half) } else { ball() }.unwrap())
        })
        .collect();
    for seed in 0..4000 {
        let mut random = Seeded(seed);
        let (scale, half, body) = &bodies[(seed % 20) as usize];
        let (scale, is_box) = (*scale, seed % 2 == 0);
        let size = body.circumscribed().radius;
        let pose = random_pose(&mut random, scale * 3.0);
        let o = random.unit() * size * 6_f64.powf(1.0 + random.signed()) * 0.3;
        // Half of the rays aim at the surface's edge: grazing on purpose.
        let side = random.unit().cross(&o).normalize();
        let aim =
            if seed % 4 < 2 { random.unit() * size * 0.7 } else { side * half.x * (1.0 + 1e-3 * random.signed()) };
        let d = (aim - o).normalize();
        let length = if seed % 7 == 0 { o.norm() } else { f64::INFINITY };
        let world = |v: &Vector3<f64>| pose.transform_direction(v);
        let ray = Ray::new(world(&o) + pose.translation(), world(&d), length).unwrap();
        let truth = if is_box { box_entry(half, &o, &d) } else { ball_entry(half.x, &o, &d) };
        let truth = truth.filter(|s| *s <= length);
        let found = cast(body, &pose, &ray);
        let label = format!("seed {seed}: {found:?} against {truth:?}");
        match (found, truth) {
            (RayCast::Hit(hit), Some(truth)) => {
                hits += 1;
                // The oracle itself rounds: by a root at grazing incidence.
                let slack = 1e-12 * size + 1e-13 * o.norm();
                assert!(hit.status == Status::Converged && hit.upper - hit.lower <= 1e-9 * size, "{label}");
                assert!((hit.upper - truth).abs() <= 1e-9 * size + slack * 1e4 || seed % 4 >= 2, "{label}");
                let x = pose.rotation().inverse_transform_vector(&(hit.point - pose.translation()));
                assert!(body.value(&x) <= 1.0 + 1e-9, "{label}");
                assert_eq!(hit.normal.is_none(), truth == 0.0, "{label}");
                assert!(hit.normal.is_none_or(|n| n.dot(ray.direction()) <= 1e-6), "{label}");
            }
            (RayCast::Miss, None) => misses += 1,
            // Only where the ray grazes may the answer be open or the oracle wrong by rounding.
            (found, _) => {
                let nearest = -o.dot(&d);
                let least = (0..20_000)
                    .map(|k| body.value(&(o + d * (nearest + size * (f64::from(k) / 1e4 - 1.0)).clamp(0.0, length))))
                    .fold(f64::MAX, f64::min);
                assert!((least - 1.0).abs() < 1e-6, "{label}: {found:?}, least {least}");
            }
        }
    }
    assert!(hits > 1000 && misses > 400, "{hits} {misses}");
}

/// Everything with curvature against dense sampling of the constraint along the ray and
/// bisection.
#[test]
fn curved_bodies_agree_with_sampling() {
    let (mut hits, mut misses) = (0, 0);
    let zoos: Vec<_> = (0..8).map(|seed| zoo(&mut Seeded(seed))).collect();
    for seed in 0..4000 {
        let mut random = Seeded(77_000 + seed);
        let bodies = &zoos[(seed % 8) as usize];
        let body = &bodies[random.next() as usize % bodies.len()];
        let ball = body.circumscribed();
        let pose = random_pose(&mut random, 2.0);
        let o = ball.center + random.unit() * ball.radius * (1.0 + 3.0 * random.signed().abs());
        let aim = ball.center + random.unit() * ball.radius * 0.4;
        let d = (aim - o).normalize();
        let ray = Ray::new(pose.transform_point(&o), pose.transform_direction(&d), f64::INFINITY).unwrap();
        let found = cast(body, &pose, &ray);
        let value = |s: f64| body.value(&(o + d * s));
        // Golden-section search for the lowest point of the convex restriction, then bisection.
        let (mut a, mut b) = (0.0, 8.0 * ball.radius);
        for _ in 0..200 {
            let (p, q) = (a + 0.381_966 * (b - a), a + 0.618_034 * (b - a));
            if value(p) < value(q) { b = q } else { a = p }
        }
        let lowest = 0.5 * (a + b);
        let label = format!("seed {seed} {}: {found:?}, lowest {} at {lowest}", body.name(), value(lowest));
        if value(lowest) > 1.0 + 1e-9 {
            misses += 1;
            assert_eq!(found, RayCast::Miss, "{label}");
        } else if value(lowest) < 1.0 - 1e-9 {
            hits += 1;
            let (mut out, mut inside) = (0.0, lowest);
            if value(0.0) > 1.0 {
                for _ in 0..200 {
                    let middle = 0.5 * (out + inside);
                    if value(middle) <= 1.0 { inside = middle } else { out = middle }
                }
            } else {
                inside = 0.0;
            }
            let hit = found.hit().unwrap_or_else(|| panic!("{label}"));
            let slope = (value(inside) - value(inside - 1e-6 * ball.radius)) / (1e-6 * ball.radius);
            let slack = 1e-13 * ball.radius + 1e-12 / slope.abs().max(1e-3);
            assert!(hit.lower <= inside + slack && inside - slack <= hit.upper, "{label}: {inside}");
            assert!(hit.status == Status::Converged, "{label}");
        }
    }
    assert!(hits > 100 && misses > 100, "{hits} {misses}");
}

#[test]
fn tangency_within_rounding_is_admitted() {
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let degree = [2, 4, 6, 8][(seed % 4) as usize];
        let body = Body::superellipsoid("q", Vector3::zeros(), Vector3::repeat(1.0), degree).unwrap();
        for offset in [1e-3, 1e-9, 1e-12, 1e-15, 0.0] {
            for sign in [-1.0, 1.0] {
                let origin = Vector3::new(-3.0 - random.signed(), 1.0 + sign * offset, 0.0);
                let found = cast(&body, &Pose::identity(), &Ray::new(origin, Vector3::x(), f64::INFINITY).unwrap());
                let label = format!("degree {degree}, {}: {found:?}", sign * offset);
                match found {
                    RayCast::Miss => assert!(sign > 0.0 && offset >= 1e-12, "{label}"),
                    RayCast::Hit(hit) => {
                        assert!(sign < 0.0 && offset >= 1e-15, "{label}");
                        let truth =
                            -origin.x - (1.0 - (1.0 - offset).powi(i32::from(degree))).powf(1.0 / f64::from(degree));
                        assert!(hit.lower <= truth + 1e-6 && truth <= hit.upper + 1e-6, "{label}: {truth}");
                    }
                    RayCast::Undecided { lower, upper } => {
                        assert!(offset <= 1e-12 && lower <= -origin.x && upper >= -origin.x, "{label}");
                    }
                }
            }
        }
    }
}

#[test]
fn rays_begin_and_end() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let along = |x: f64, length: f64| {
        cast(&ball, &Pose::identity(), &Ray::new(Vector3::new(x, 0.0, 0.0), Vector3::x(), length).unwrap())
    };
    assert_eq!(along(-3.0, 1.9), RayCast::Miss);
    assert!((along(-3.0, 2.1).hit().unwrap().upper - 2.0).abs() < 1e-9);
    assert_eq!(along(3.0, f64::INFINITY), RayCast::Miss);
    for x in [0.0, -0.999_999, 0.999_999] {
        let found = along(x, 1.0);
        let hit = found.hit().unwrap();
        assert!(hit.lower == 0.0 && hit.upper == 0.0 && hit.normal.is_none(), "{hit:?}");
    }
    // Far origins cost their own rounding and no more.
    let hit = *along(-1e9, f64::INFINITY).hit().unwrap();
    assert!(hit.lower <= 1e9 - 1.0 && hit.upper >= 1e9 - 1.0 && hit.upper - hit.lower < 1e-4, "{hit:?}");
}

#[test]
fn the_first_part_counts() {
    let part = Body::superellipsoid("q", Vector3::zeros(), Vector3::new(0.5, 1.0, 1.5), 4).unwrap();
    let new_compound = |seed: u64| {
        let mut random = Seeded(seed);
        let parts = (0..4).map(|_| {
            let shift = Vector3::from_fn(|_, _| 3.0 * random.signed());
            let turn = UnitQuaternion::from_euler_angles(random.signed(), random.signed(), random.signed());
            part.moved(&turn, &shift).unwrap()
        });
        Compound::new("c", parts.collect()).unwrap()
    };
    let compounds: Vec<Compound> = (0..20).map(new_compound).collect();
    for seed in 0..100 {
        let mut random = Seeded(1000 + seed);
        let compound = &compounds[(seed % 20) as usize];
        let pose = random_pose(&mut random, 2.0);
        let origin = pose.translation() + random.unit() * 10.0;
        let ray = Ray::new(origin, pose.translation() - origin + random.unit(), f64::INFINITY).unwrap();
        let found = cast(compound, &pose, &ray);
        let first = compound.parts().iter().filter_map(|part| cast(part, &pose, &ray).hit().copied());
        let first = first.min_by(|a, b| a.upper.total_cmp(&b.upper));
        match (found, first) {
            (RayCast::Hit(hit), Some(first)) => {
                assert!((hit.upper - first.upper).abs() < 1e-8 && hit.lower <= first.upper, "seed {seed}");
            }
            (found, first) => {
                assert!(found == RayCast::Miss && first.is_none(), "seed {seed}: {found:?} {first:?}");
            }
        }
    }
}

#[test]
fn rays_are_checked() {
    let (o, d) = (Vector3::zeros(), Vector3::x());
    assert_eq!(Ray::new(o, o, 1.0), Err(RayError::NoDirection));
    for length in [0.0, -1.0, f64::NAN] {
        assert!(matches!(Ray::new(o, d, length), Err(RayError::Length(_))));
    }
    assert_eq!(Ray::new(d * f64::NAN, d, 1.0), Err(RayError::NotFinite("origin")));
    assert_eq!(Ray::new(d * 1e16, d, 1.0), Err(RayError::NotFinite("origin")));
    assert_eq!(Ray::new(o, d * f64::INFINITY, 1.0), Err(RayError::NotFinite("direction")));
    let tiny = Ray::new(o, d * 1e-300, 1.0).unwrap();
    assert!((tiny.direction().norm() - 1.0).abs() < 1e-15);
}
