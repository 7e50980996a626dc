//! Degenerate point clouds: 26. Fits of them are a certified body that contains the points, or a
//! clear error that names the reason.

use super::Draws;
use nalgebra::Vector3;

/// Kinds of clouds of [`cloud`]; the last one, of a million points, is for long runs.
pub const KINDS: u64 = 13;

/// Points of the largest clouds.
const MILLION: usize = 1_000_000;

/// What is to become of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// A body that contains it.
    Fits,
    /// Refused as flat, in this shape.
    Flat(&'static str),
    /// Refused for so few points.
    TooFew,
    /// Refused where coordinates keep too few digits of the shape.
    TooFar,
}

/// Flat, collinear, double, few, many, far, tiny and outlying points, each kind in its one setting.
pub fn cloud(kind: u64, random: &mut dyn Draws) -> (Vec<Vector3<f64>>, Fate) {
    let count = 20 + random.index(300);
    let mut points: Vec<Vector3<f64>> = (0..count).map(|_| random.unit()).collect();
    let n = random.unit();
    let mut fate = Fate::Fits;
    match kind {
        0 => {
            points.iter_mut().for_each(|x| *x -= n * n.dot(x));
            fate = Fate::Flat("coplanar");
        }
        1 => points.iter_mut().for_each(|x| *x -= n * (n.dot(x) * (1.0 - 1e-4))),
        2 => {
            points.iter_mut().for_each(|x| *x = n * n.dot(x));
            fate = Fate::Flat("collinear");
        }
        3 => {
            let few = points[..6].to_vec();
            points.iter_mut().for_each(|x| *x = few[random.index(6)]);
        }
        4 => {
            points.truncate(3);
            fate = Fate::TooFew;
        }
        5 => points.iter_mut().for_each(|x| *x += n * 1e5),
        6 => {
            points.iter_mut().for_each(|x| *x += n * 1e14);
            fate = Fate::TooFar;
        }
        7 => {
            let scale = random.between(1e-6, 1e6);
            points.iter_mut().for_each(|x| *x *= scale);
        }
        8 => points[0] *= random.between(10.0, 1e5),
        9 => points = (0..8_u8).map(|i| Vector3::from_fn(|k, _| f64::from(i >> k & 1))).collect(),
        10 => points.iter_mut().for_each(|x| *x = x.component_mul(&Vector3::new(1.0, 1e-4, 3e-4))),
        11 => {
            points.fill(n);
            fate = Fate::Flat("coincident");
        }
        // In a box anywhere: most are inside of their hull.
        _ => {
            let (turn, sizes) = (random.rotation(), Vector3::from_fn(|_, _| random.between(0.1, 2.0)));
            let mut inside = || turn * Vector3::from_fn(|_, _| random.signed()).component_mul(&sizes) + n;
            points = (0..MILLION).map(|_| inside()).collect();
        }
    }
    (points, fate)
}

/// What must come of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Must {
    /// A body: nothing is wrong with it.
    Fit,
    /// The error that it is flat or has too few points.
    Refuse,
    /// Either.
    Decide,
}

/// Kinds of clouds of [`drawn`].
pub const DRAWN_KINDS: u64 = 10;

/// A cloud of one of the kinds, each in settings from harmless to degenerate; its name, and what
/// must come of it.
pub fn drawn(kind: u64, random: &mut dyn Draws) -> (&'static str, Vec<Vector3<f64>>, Must) {
    let count = 20 + random.index(400);
    let turn = random.rotation();
    let stretch = Vector3::from_fn(|_, _| random.between(0.2, 1.0));
    let mut solid: Vec<Vector3<f64>> = (0..count).map(|_| turn * random.unit().component_mul(&stretch)).collect();
    let normal = turn * Vector3::z();
    let flat = |x: &Vector3<f64>| x - normal * normal.dot(x);
    match kind {
        0 => ("coplanar", solid.iter().map(flat).collect(), Must::Refuse),
        1 => {
            let thickness = random.between(1e-12, 1e-3);
            let points = solid.iter().map(|x| flat(x) + normal * (thickness * random.signed())).collect();
            ("nearly coplanar", points, if thickness > 1e-5 { Must::Fit } else { Must::Decide })
        }
        2 => {
            let noise = if random.index(2) == 0 { 0.0 } else { random.between(1e-12, 1e-3) };
            let points = (0..count).map(|_| normal * random.signed() + random.unit() * noise).collect();
            let must = match noise {
                0.0 => Must::Refuse,
                noise if noise > 1e-4 => Must::Fit,
                _ => Must::Decide,
            };
            ("collinear", points, must)
        }
        3 => {
            let few: Vec<_> = solid.iter().copied().take(4 + random.index(20)).collect();
            ("duplicates", (0..20 * few.len()).map(|_| few[random.index(few.len())]).collect(), Must::Decide)
        }
        4 => {
            let few = random.index(4);
            ("at most three points", solid.iter().copied().take(few).collect(), Must::Refuse)
        }
        5 => {
            let away = random.unit() * random.between(1e3, 1e16);
            let kept = away.norm() < 1e6;
            ("far off centre", solid.iter().map(|x| x + away).collect(), if kept { Must::Fit } else { Must::Decide })
        }
        6 => {
            let scale = random.between(1e-12, 1e12);
            ("tiny or huge", solid.iter().map(|x| x * scale).collect(), Must::Fit)
        }
        7 => {
            for _ in 0..1 + random.index(5) {
                let place = random.index(solid.len());
                solid[place] = random.unit() * random.between(10.0, 1e5);
            }
            ("outliers", solid, Must::Decide)
        }
        8 => {
            let shape: Vec<_> = (0..8_u8)
                .map(|i| turn * Vector3::from_fn(|k, _| if i >> k & 1 == 1 { stretch[k] } else { -stretch[k] }))
                .collect();
            ("corners of a box, perhaps with points on its faces", with_mixtures(random, shape), Must::Fit)
        }
        _ => {
            let needle = random.between(1e-5, 1e-2);
            let squeeze = Vector3::new(1.0, needle, random.between(1.0, 10.0) * needle);
            let inverse = turn.inverse();
            let points = solid.iter().map(|x| turn * (inverse * x).component_mul(&squeeze)).collect();
            ("needle", points, Must::Fit)
        }
    }
}

/// Points with mixtures of two of them.
fn with_mixtures(random: &mut dyn Draws, mut points: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
    let corners = points.len();
    for _ in 0..random.index(3) * 100 {
        let (a, b) = (points[random.index(corners)], points[random.index(corners)]);
        points.push(a + (b - a) * random.positive());
    }
    points
}

/// A million points on the surface of a rounded box, with noise.
pub fn rounded_box(random: &mut dyn Draws) -> Vec<Vector3<f64>> {
    let mut point = || {
        let u = random.unit();
        u / u.map(|v| v.abs().powi(8)).sum().powf(0.125) * (1.0 + 1e-3 * random.signed())
    };
    (0..MILLION).map(|_| point()).collect()
}
