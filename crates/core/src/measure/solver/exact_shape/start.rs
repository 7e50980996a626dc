//! Where a cold start begins: about where a body is nearest to a set with a closed form.
//!
//! For a unit vector n let x be the point of the body farthest along -n, U the derivative of -x by
//! n, P x the nearest point of the set and `D = n·(x - P x)`. To second order the body's surface is
//! a paraboloid about x whose curvature is the inverse of U. Its point nearest to a point y of the
//! set is `y + D M (x - y)`, and half the square of that distance, to the same order, `D / 2` times
//!
//! ```text
//! (x - y)ᵀ M (x - y),    M = (U + D I)⁻¹.
//! ```
//!
//! For other points of the set than P x it is about that, with the same D. So the next n is along
//! `M (x - y)` for the point y of the set where this is least, however many faces and edges of the
//! set lie on the way: on the ellipsoid that stands for the body first, then on its support table.
//!
//! Of a thin body x crosses the whole side while n turns by no more than the thickness, so that
//! such turns overshoot: [`super::thin_ellipsoid`] looks for the point of the ellipsoid and not for
//! its normal.

use super::projectable::Projectable;
use super::thin_ellipsoid::ThinEllipsoid;
use crate::body::Body;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, normalized, rows, scaled,
    subtract, times_transposed, turned_symmetric,
};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::{Simd, dispatch};

/// Most turns of the normal, or of a thin body steps of the point, on the ellipsoid.
pub(super) const ELLIPSOID_TURNS: usize = 6;

/// Most looks at the support table.
pub(super) const TABLE_LOOKS: usize = 3;

/// Square of a turn of the normal, radians squared, or of such a step in normalized coordinates,
/// that is left to Newton's method on the body itself.
///
/// Larger, it starts too far away; smaller, support tables are read once more than needed. It
/// changes time only; no test pins it.
pub(super) const SMALL_TURN: f64 = 1e-2;

/// Least D relative to the distance of x, dimensionless.
///
/// Larger, turns are shorter than they have to be; smaller, n may turn away from the body. It
/// changes time only; no test pins it.
const STEEPEST: f64 = 0.1;

/// A point of the body and the direction against which it is about the farthest one; from the
/// set's normal n at the body's centre on.
#[inline(always)]
pub(in crate::measure) fn start<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    body: &Body,
    relative: &Relative<f64>,
    n: V3<f64>,
) -> (V3<f64>, V3<f64>) {
    let n = on_the_ellipsoid(simd, set, body, relative, n);
    on_the_table(simd, set, body, relative, n)
}

/// The inward normal of the ellipsoid that stands for the body about where it is nearest to the
/// set, from the set's normal n at the body's centre on.
#[inline(always)]
pub(super) fn on_the_ellipsoid<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    body: &Body,
    relative: &Relative<f64>,
    mut n: V3<f64>,
) -> V3<f64> {
    if body.outline().is_thin() {
        return dispatch(ThinEllipsoid { set, body, relative, n, steps: ELLIPSOID_TURNS, small: SMALL_TURN });
    }
    let shape: M3<f64> = rows(simd, body.outline().shape());
    let turned = times_transposed::<S, f64>(&relative.rotation, &shape);
    let shape = times_transposed::<S, f64>(&turned, &relative.rotation);
    let (mut best, mut nearest) = (n, f64::INFINITY);
    for turns in 0..=ELLIPSOID_TURNS {
        let u = apply::<S, f64>(&shape, n);
        let inverse = 1.0 / dot::<S, f64>(n, u).sqrt();
        let x = add_scaled::<S, f64>(relative.origin, -inverse, u);
        let seen = set.offset(simd, x);
        let off = subtract::<S, f64>(seen.frame[2], n);
        if !(seen.distance > 0.0) || dot::<S, f64>(off, off) < SMALL_TURN {
            best = n;
            break;
        }
        if !(seen.distance < nearest) {
            n = normalized(simd, add::<S, f64>(n, best));
            continue;
        }
        (best, nearest) = (n, seen.distance);
        if turns == ELLIPSOID_TURNS {
            break;
        }
        let square = inverse * inverse;
        let entry = |i: usize, j: usize| (shape[i][j] - u[i] * u[j] * square) * inverse;
        let bend = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        n = turn(simd, set, n, (x, seen.distance), bend);
    }
    best
}

/// Of a few points of the body's support table that nearest to the set, and the direction against
/// which it is about the farthest one, from such a direction on. Where the plane across the first
/// direction separates its point from the set, that across the last one does so, too.
#[inline(always)]
pub(super) fn on_the_table<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    body: &Body,
    relative: &Relative<f64>,
    mut n: V3<f64>,
) -> (V3<f64>, V3<f64>) {
    let (mut best, mut nearest) = (None, f64::INFINITY);
    for look in 1.. {
        let (x, bend) = farthest(simd, body, relative, n);
        let seen = set.offset(simd, x);
        let is_apart = set.separation(simd, n, (x, 0.0)) > 0.0;
        if let Some(start) = best
            && !(is_apart && seen.distance < nearest)
        {
            return start;
        }
        let off = subtract::<S, f64>(seen.frame[2], n);
        if look == TABLE_LOOKS || !is_apart || dot::<S, f64>(off, off) < SMALL_TURN {
            return (x, n);
        }
        (best, nearest) = (Some((x, n)), seen.distance);
        n = turn(simd, set, n, (x, seen.distance), turned_symmetric::<S, f64>(&relative.rotation, &bend));
    }
    unreachable!("the last look returns")
}

/// About the point of the body farthest along -n, and its derivative by that direction in the
/// body's frame.
#[inline(always)]
fn farthest<S: Simd>(simd: S, body: &Body, relative: &Relative<f64>, n: V3<f64>) -> (V3<f64>, [f64; 6]) {
    let own = scaled::<S, f64>(apply_transposed::<S, f64>(&relative.rotation, n), -1.0);
    let cell = body.outline().cell::<S, f64>(simd, own);
    let point = apply::<S, f64>(&relative.rotation, cell.farthest(simd, own));
    (add::<S, f64>(relative.origin, point), cell.turn)
}

/// The next normal, from the point x of the body farthest along -n on, at a distance above 0 from
/// the set, and the derivative U of -x by n: xx, xy, xz, yy, yz, zz.
#[inline(always)]
fn turn<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    n: V3<f64>,
    (x, distance): (V3<f64>, f64),
    mut bend: [f64; 6],
) -> V3<f64> {
    let y = set.project(simd, x);
    let depth = dot::<S, f64>(n, subtract::<S, f64>(x, y)).max(STEEPEST * distance);
    for diagonal in [0, 3, 5] {
        bend[diagonal] += depth;
    }
    // Any multiple of M will do.
    let (metric, _) = cofactors(simd, bend);
    let gradient = apply_symmetric::<S, f64>(&metric, subtract::<S, f64>(y, x));
    let y = set.least(simd, y, gradient, &metric);
    normalized(simd, apply_symmetric::<S, f64>(&metric, subtract::<S, f64>(x, y)))
}

#[cfg(test)]
mod tests {
    use super::{SMALL_TURN, farthest, on_the_ellipsoid, on_the_table, turn};
    use crate::body::Body;
    use crate::measure::Pose;
    use crate::measure::solver::exact_shape::{Cuboid, Projectable};
    use crate::measure::solver::tangent_newton::Relative;
    use crate::polynomial::Scalar;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    const HALF_EXTENTS: [f64; 3] = [0.4, 0.3, 0.2];

    /// For a ball about c that is nearest to a corner y of the box, the next normal is along `c - y`
    /// from every n whose point x is nearest to the same corner.
    #[test]
    fn one_turn_of_a_ball_beyond_a_corner_is_exact() {
        let set = Cuboid { half_extents: HALF_EXTENTS };
        let mut count = 0;
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let corner = Vector3::from(HALF_EXTENTS.map(|h| h.copysign(random.signed())));
            let radius = 10_f64.powf(random.signed());
            let mut direction = || Vector3::from([(); 3].map(|()| random.signed())).normalize();
            let (to, n) = (direction(), direction());
            let to = to.component_mul(&corner).map(f64::abs).component_mul(&corner.map(f64::signum)).normalize();
            let center = corner + to * (2.0 * radius);
            let x = center - radius * n;
            let seen = set.offset(Scalar, x.into());
            let depth = n.dot(&(x - corner));
            // Beyond no other corner, and no depth that is cut.
            if set.project(Scalar, x.into()) != <[f64; 3]>::from(corner) || depth < 0.2 * seen.distance {
                continue;
            }
            count += 1;
            let bend = |i: usize, j: usize| radius * (f64::from(u8::from(i == j)) - n[i] * n[j]);
            let bend = [bend(0, 0), bend(0, 1), bend(0, 2), bend(1, 1), bend(1, 2), bend(2, 2)];
            let turned = Vector3::from(turn(Scalar, &set, n.into(), (x.into(), seen.distance), bend));
            assert!((turned - to).norm() < 1e-9, "seed {seed}: {turned} {to}");
        }
        assert!(count > 200, "{count}");
    }

    /// A body of this degree, thin for a quarter of the seeds, somewhere about the box; the box's
    /// normal at its centre.
    fn placed(seed: u64, degree: u8) -> (Body, Relative<f64>, [f64; 3]) {
        let set = Cuboid { half_extents: HALF_EXTENTS };
        let mut random = Seeded(seed);
        let thinnest = if seed.is_multiple_of(4) { -3.0 } else { -0.7 };
        let radii = Vector3::from([(); 3].map(|()| 10_f64.powf(thinnest * random.positive())));
        let body = Body::superellipsoid("body", Vector3::zeros(), radii, degree).unwrap();
        let mut vector = |size: f64| Vector3::from([(); 3].map(|()| size * random.signed()));
        let (rotation, at) = (nalgebra::UnitQuaternion::from_scaled_axis(vector(3.0)), vector(1.5));
        let pose = Pose::from_quaternion(at, rotation.coords.into()).unwrap();
        let cuboid = Body::cuboid("box", HALF_EXTENTS.into()).unwrap();
        let relative = Relative::new(Scalar, &cuboid, &Pose::identity(), &body, &pose);
        (body, relative, set.offset(Scalar, at.into()).frame[2])
    }

    /// Thin ones also, beside every feature of the box: the last normal is that of the box, but for
    /// a turn so small that no other follows.
    #[test]
    fn ellipsoids_are_turned_until_the_normals_agree() {
        let set = Cuboid { half_extents: HALF_EXTENTS };
        let (mut close, mut count, mut features) = (0, 0, [0; 8]);
        for seed in 0..300 {
            let (body, relative, n) = placed(seed, 2);
            if !n[0].is_finite() {
                continue;
            }
            let n = Vector3::from(on_the_ellipsoid(Scalar, &set, &body, &relative, n));
            let rotation = Matrix3::from(relative.rotation).transpose();
            let across = rotation * body.outline().shape() * rotation.transpose() * n;
            let seen = set.offset(Scalar, (Vector3::from(relative.origin) - across / n.dot(&across).sqrt()).into());
            if !(seen.distance > 0.0) {
                continue;
            }
            count += 1;
            features[usize::from(seen.feature)] += 1;
            close += u32::from((Vector3::from(seen.frame[2]) - n).norm_squared() < SMALL_TURN);
        }
        println!("{close} of {count} close, features {features:?}");
        assert!(features[1..].iter().all(|count| *count >= 3), "{features:?}");
        assert!(20 * close > 19 * count, "{close} of {count}");
    }

    /// No look at the table is worse than the first.
    #[test]
    fn starts_on_the_table_stay_apart_and_come_nearer() {
        let set = Cuboid { half_extents: HALF_EXTENTS };
        let (mut count, mut nearer) = (0, 0);
        for seed in 0..100 {
            let (body, relative, n) = placed(seed, 6);
            let (x, _) = farthest(Scalar, &body, &relative, n);
            if !(set.separation(Scalar, n, (x, 0.0)) > 0.0) {
                continue;
            }
            count += 1;
            let first = set.offset(Scalar, x).distance;
            let (x, n) = on_the_table(Scalar, &set, &body, &relative, n);
            let last = set.offset(Scalar, x).distance;
            assert!(set.separation(Scalar, n, (x, 0.0)) > 0.0, "seed {seed}");
            assert!(last <= first, "seed {seed}: {last} {first}");
            nearer += u32::from(last < first);
        }
        println!("{nearer} of {count} nearer");
        assert!(count > 50 && 4 * nearer > count, "{nearer} of {count}");
    }
}
