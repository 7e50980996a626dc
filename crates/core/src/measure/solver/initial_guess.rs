//! Where to begin when nothing is known but the poses.
//!
//! The distance of two convex sets is the largest value over unit vectors n of `-h_A(-n) - h_B(n)`,
//! h the support functions: `n·w` where w is the difference of the points that are farthest along
//! `-n` and along `n`. Ellipsoids stand for the bodies. Theirs are `h(n) = √(nᵀ Σ n)`, and Newton's
//! method for `w = D n` turns n by
//!
//! ```text
//! (D I + K_A + K_B) dn = w - (n·w) n,    K = (Σ - Σ n nᵀ Σ / h²) / h
//! ```
//!
//! with K the derivative of the farthest point, so that such turns find about where the ellipsoids
//! face each other. There the support tables of the bodies have about where these are farthest
//! themselves and how that changes, for another such turn.

use crate::body::Body;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, normalized, rows, scaled,
    subtract, times_transposed, turned_symmetric,
};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::{Number, Simd};

/// Least distance that the normal is turned for, relative to the widths of the ellipsoids;
/// dimensionless. Turns are in proportion to width over distance.
///
/// Smaller, near contact they are too large; larger, normals stay that are off. It changes time
/// only: `continuation_seeks_alone` counts what is solved.
const LEAST_DISTANCE: f64 = 1e-3;

/// Largest turn of the normal, as the largest component of its tangent; dimensionless, 17 degrees.
///
/// Larger, turns leave where ellipsoids stand for the bodies; smaller, starts stay farther off. It
/// changes time only: `continuation_seeks_alone` counts what is solved.
const LARGEST_TURN: f64 = 0.3;

/// The unit vector from B to A across the gap of the ellipsoids that stand for them, in A's frame.
#[inline(always)]
pub(in crate::measure) fn facing<S: Simd, N: Number<S>>(simd: S, a: &Body, b: &Body, relative: &Relative<N>) -> V3<N> {
    let one = N::splat(simd, 1.0);
    let shape_a = rows(simd, a.outline().shape());
    let shape_b = rows(simd, b.outline().shape());
    let shape_b = times_transposed(&times_transposed(&relative.rotation, &shape_b), &relative.rotation);
    let size = a.trust().reach + b.trust().reach;
    // Where both centres coincide any direction will do.
    let first = N::splat(simd, N::TINY) - relative.origin[0];
    let mut n = normalized(simd, [first, -relative.origin[1], -relative.origin[2]]);
    // Two turns; `continuation_seeks_alone` counts what is solved from there.
    for _ in 0..2 {
        let (u, v) = (apply(&shape_a, n), apply(&shape_b, n));
        let (wide_a, wide_b) = (dot(n, u).sqrt(), dot(n, v).sqrt());
        let [of_a, of_b] = N::reciprocals(simd, [wide_a, wide_b]);
        let mut w = [one; 3];
        for i in 0..3 {
            w[i] = -(relative.origin[i] + of_b.mul_add(v[i], of_a * u[i]));
        }
        let distance = dot(n, w);
        let least = distance.max((wide_a + wide_b) * N::splat(simd, LEAST_DISTANCE));
        let (scaled_a, scaled_b) = (scaled(u, of_a * of_a * of_a), scaled(v, of_b * of_b * of_b));
        let mut matrix = [least; 6];
        for (entry, (i, j)) in matrix.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
            let straight = of_a.mul_add(shape_a[i][j], of_b * shape_b[i][j]);
            let bent = scaled_a[i].mul_add(u[j], scaled_b[i] * v[j]);
            *entry = if i == j { least + straight - bent } else { straight - bent };
        }
        let mut residual = w;
        for i in 0..3 {
            residual[i] = w[i] - distance * n[i];
        }
        n = turned(simd, n, matrix, residual, size);
    }
    n
}

/// A point on the line between those where two bodies are deepest in each other that is likely to
/// lie in both: halfway, but no farther from either than its inscribed ball is large, as a small
/// body in a large one asks for.
#[inline(always)]
pub(in crate::measure) fn middle<S: Simd, N: Number<S>>(simd: S, a: &Body, b: &Body, x: V3<N>, y: V3<N>) -> V3<N> {
    let between = subtract(x, y);
    let inverse = N::splat(simd, 1.0) / dot(between, between).sqrt();
    let radius = |body: &Body| N::splat(simd, body.in_radius()) * inverse;
    let least = N::splat(simd, 1.0) - radius(a);
    let share = N::splat(simd, 0.5).max(least).min(radius(b).max(least));
    add_scaled(y, share, between)
}

/// Of the ellipsoid that stands for the difference `A - B` the inward normal where the ray from 0
/// leaves it, in A's frame.
///
/// About the direction of the ray the ellipsoid with `(h_A + h_B) (Σ_A / h_A + Σ_B / h_B)` for its
/// Σ is a tight bound of the sum of both ellipsoids (Kurzhanski and Vályi, Ellipsoidal calculus,
/// 1997).
#[inline(always)]
pub(in crate::measure) fn facing_along<S: Simd>(
    simd: S,
    a: &Body,
    b: &Body,
    relative: &Relative<f64>,
    ray: V3<f64>,
) -> V3<f64> {
    let shape_a: M3<f64> = rows(simd, a.outline().shape());
    let shape_b = rows(simd, b.outline().shape());
    let turned = times_transposed::<S, f64>(&relative.rotation, &shape_b);
    let shape_b = times_transposed::<S, f64>(&turned, &relative.rotation);
    let width = |shape: &M3<f64>| dot::<S, f64>(ray, apply::<S, f64>(shape, ray)).sqrt();
    let (wide_a, wide_b) = (width(&shape_a), width(&shape_b));
    let (of_a, of_b) = (1.0 / wide_a, 1.0 / wide_b);
    let entry = |i: usize, j: usize| of_a * shape_a[i][j] + of_b * shape_b[i][j];
    let sum = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    let (inverse, determinant) = cofactors(simd, sum);
    // Times what makes it the inverse of Σ.
    let scale = determinant * (wide_a + wide_b);
    let center = scaled::<S, f64>(relative.origin, -1.0);
    let of_ray = apply_symmetric::<S, f64>(&inverse, ray);
    let of_center = apply_symmetric::<S, f64>(&inverse, center);
    let (along, across) = (dot::<S, f64>(ray, of_ray), dot::<S, f64>(ray, of_center));
    let inside = scale - dot::<S, f64>(center, of_center);
    // 0 may lie outside of the ellipsoid, which is none of the body's.
    let reach = (across + (across * across + along * inside.max(0.0)).sqrt()) / along;
    subtract::<S, f64>(of_center, scaled::<S, f64>(of_ray, reach))
}

/// About where two bodies are nearest or deepest in each other.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Start<N> {
    /// Point of A, from the centre of its normalization on, in A's frame, metres.
    pub(in crate::measure) x: V3<N>,
    /// Point of B, the same way.
    pub(in crate::measure) y: V3<N>,
    /// Unit vector from B to A, in A's frame.
    pub(in crate::measure) n: V3<N>,
}

/// Where the outlines have `x - y` along n, or along a ray if one is given; from a unit vector n
/// on, in A's frame. Also where A's outline keeps the cell of `-n` and B's that of n.
#[inline(always)]
pub(in crate::measure) fn meeting<S: Simd, N: Number<S>>(
    simd: S,
    a: &Body,
    b: &Body,
    relative: &Relative<N>,
    n: V3<N>,
    ray: Option<V3<N>>,
) -> (Start<N>, [N; 2]) {
    let size = a.trust().reach + b.trust().reach;
    let least = N::splat(simd, LEAST_DISTANCE * size);
    let own = apply_transposed(&relative.rotation, n);
    let (cell_a, cell_b) = (a.outline().cell(simd, scaled(n, -N::splat(simd, 1.0))), b.outline().cell(simd, own));
    // Points for n, and how they turn with it.
    let (turn_a, turn_b) = (cell_a.turn, turned_symmetric(&relative.rotation, &cell_b.turn));
    let of_a = cell_a.point;
    let of_b = add(relative.origin, apply(&relative.rotation, cell_b.point));
    let x = subtract(of_a, apply_symmetric(&turn_a, n));
    let y = add(of_b, apply_symmetric(&turn_b, n));
    let w = subtract(x, y);
    let along = ray.unwrap_or(n);
    let distance = dot(n, w) / dot(n, along);
    let stiff = if ray.is_some() { least } else { distance.max(least) };
    let mut matrix = [stiff; 6];
    for i in 0..6 {
        let bent = turn_a[i] + turn_b[i];
        matrix[i] = if matches!(i, 0 | 3 | 5) { stiff + bent } else { bent };
    }
    let n = turned(simd, n, matrix, add_scaled(w, -distance, along), size);
    // Of the same cells: where a side is flat a small turn leads far, to another cell for which it
    // was not meant.
    let x = subtract(of_a, apply_symmetric(&turn_a, n));
    let y = add(of_b, apply_symmetric(&turn_b, n));
    (Start { x, y, n }, [cell_a.place, cell_b.place])
}

/// The direction of `n + M⁻¹ r`, by cofactors of the symmetric matrix M with the entries xx, xy,
/// xz, yy, yz, zz; the turn is limited. M and r are lengths of about `size`, metres.
#[inline(always)]
fn turned<S: Simd, N: Number<S>>(simd: S, n: V3<N>, matrix: [N; 6], r: V3<N>, size: f64) -> V3<N> {
    let (cofactors, determinant) = cofactors(simd, matrix);
    // Single precision has no sixth powers of the smallest and largest sizes, of which the norm
    // would be the root.
    let unit = N::splat(simd, inverse_cube(size));
    let turn = scaled(apply_symmetric(&cofactors, r), unit);
    let longest = turn[0].abs().max(turn[1].abs()).max(turn[2].abs());
    let weight = (determinant * unit).max(longest * N::splat(simd, 1.0 / LARGEST_TURN));
    normalized(simd, add_scaled(turn, weight, n))
}

/// About `1 / length³`, as a power of two: multiplied by it nothing is rounded.
#[inline(always)]
fn inverse_cube(length: f64) -> f64 {
    let bias = i64::from(f64::MAX_EXP - 1);
    let exponent = ((length.to_bits() >> 52) as i64 - bias).clamp(-300, 300);
    f64::from_bits(((bias - 3 * exponent) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::{facing, inverse_cube};
    use crate::body::Body;
    use crate::measure::Pose;
    use crate::measure::solver::tangent_newton::Relative;
    use crate::polynomial::Scalar;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    fn pose(random: &mut Seeded, far: f64) -> Pose {
        let q = nalgebra::Vector4::from_fn(|_, _| random.signed()).normalize();
        let t = Vector3::from_fn(|_, _| random.signed()).normalize() * far;
        Pose::from_quaternion(t, q.into()).unwrap()
    }

    #[test]
    fn balls_face_each_other_along_their_centres() {
        let (a, b) = (
            Body::ball("a", Vector3::new(0.5, 0.0, 0.0), 1.0).unwrap(),
            Body::ball("b", Vector3::zeros(), 2.0).unwrap(),
        );
        for seed in 0..100 {
            let mut random = Seeded(seed);
            let (pose_a, pose_b) = (pose(&mut random, 1.0), pose(&mut random, 6.0));
            let relative = Relative::<f64>::new(Scalar, &a, &pose_a, &b, &pose_b);
            let n = Vector3::from(facing::<_, f64>(Scalar, &a, &b, &relative));
            let centres = pose_a.transform_point(&Vector3::new(0.5, 0.0, 0.0)) - pose_b.translation();
            assert!((pose_a.transform_direction(&n) - centres.normalize()).norm() < 1e-12, "seed {seed}");
        }
    }

    #[test]
    fn ellipsoids_nearly_face_each_other() {
        // Where the stand-ins have the shape of the bodies the normals at the farthest points
        // oppose each other.
        let a = Body::ellipsoid("a", Vector3::zeros(), Vector3::new(1.0, 0.6, 0.4)).unwrap();
        let b = Body::ellipsoid("b", Vector3::zeros(), Vector3::new(0.5, 0.9, 0.7)).unwrap();
        let mut worst = 0.0_f64;
        for seed in 0..500 {
            let mut random = Seeded(seed);
            let (pose_a, pose_b) = (Pose::identity(), pose(&mut random, 3.0));
            let relative = Relative::<f64>::new(Scalar, &a, &pose_a, &b, &pose_b);
            let n = Vector3::from(facing::<_, f64>(Scalar, &a, &b, &relative));
            let farthest = |body: &Body, n: Vector3<f64>| {
                let x = body.outline().shape() * n;
                x / n.dot(&x).sqrt()
            };
            let x = farthest(&a, -n);
            let y = pose_b.transform_point(&farthest(&b, pose_b.rotation().inverse() * n));
            worst = worst.max((x - y).normalize().cross(&n).norm());
        }
        assert!(worst < 0.1, "{worst}");
    }

    #[test]
    fn inverse_cubes_are_powers_of_two_of_about_the_size() {
        for exponent in -120..=120 {
            let length = 1.7 * 2_f64.powi(exponent);
            assert_eq!(inverse_cube(length), 2_f64.powi(-3 * exponent));
        }
        for length in [f64::MIN_POSITIVE, 1e-200, 1e200, f64::MAX] {
            assert!(inverse_cube(length).is_normal());
        }
    }
}
