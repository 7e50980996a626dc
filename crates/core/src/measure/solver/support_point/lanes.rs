//! Support points of smooth surfaces, from an outline: mostly by one or two evaluations.
//!
//! The point z of a body farthest along e (both in normalized coordinates, `e·z = n·x`) has `λ
//! ∇g(z) = e`, `g(z) = 1`. Newton's step for the two,
//!
//! ```text
//! λ' = (g·H⁻¹e - λ (1 - g(z))) / (g·H⁻¹g),   dz = (H⁻¹e - λ' H⁻¹g) / λ
//! ```
//!
//! leaves an error of the order of its square, and what that costs along e is of the square again.
//! Taylor's formula proves how far the end of the last step is from the best, and a point of the
//! body beside it.

use crate::body::Body;
use crate::measure::frames::vector::{
    V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, rows, scaled,
};
use crate::measure::solver::tangent_newton::{LONGEST_STEP, Side, TAYLOR_ROUNDING};
use crate::polynomial::{Lanes, MAX_LANES, Number, NumberJet, Simd, Vector, WithSimd};
use nalgebra::Vector3;

/// A point of a body that is farthest along a unit vector.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Sought {
    /// The unit vector, body frame.
    pub(in crate::measure) n: Vector3<f64>,
    /// Largest support deficit of the point, metres.
    pub(in crate::measure) tolerance: f64,
}

/// Points within whose displacement (the rounding of their normalized coordinates) points of the
/// body are proven to lie, each with the active constraint; from the centre of the normalization
/// on, body frame, metres. None where Newton's method does not arrive.
pub(in crate::measure) type Found = [Option<(Vector3<f64>, usize)>; MAX_LANES];

/// At most [`MAX_LANES`] points of a body, as vectorized work: a lane each where the body has one
/// constraint. None depends on the others.
pub(in crate::measure) struct Farthest<'a> {
    pub(in crate::measure) body: &'a Body,
    pub(in crate::measure) sought: &'a [Sought],
}

/// One point of a body of one constraint that is farthest along a unit vector, as vectorized work.
pub(super) struct FarthestOne<'a> {
    pub(super) body: &'a Body,
    /// The unit vector, body frame.
    pub(super) n: Vector3<f64>,
    /// Where to begin, from the centre of the normalization on; the table of the body where there
    /// is none.
    pub(super) from: Option<Vector3<f64>>,
    /// Largest support deficit of the point, metres.
    pub(super) tolerance: f64,
    /// Largest angle between n and the normal at the point, radians.
    pub(super) angle: f64,
    /// Most evaluations; no more than [`MAX_ROUNDS`] are made.
    pub(super) limit: u32,
}

/// A point within whose displacement one of the body is proven to lie.
pub(super) struct FoundOne {
    /// From the centre of the normalization on, body frame, metres.
    pub(super) x: Vector3<f64>,
    /// Proven bound of how much farther along n the body reaches than x, metres.
    pub(super) deficit: f64,
}

impl WithSimd for FarthestOne<'_> {
    /// The point, or how far the search came, from the centre of the normalization on, if it may go
    /// on from there; and after how many evaluations.
    type Output = (Result<FoundOne, Option<Vector3<f64>>>, u32);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { body, n, from, tolerance, angle, limit } = self;
        let n: V3<f64> = n.into();
        let start = from.map_or_else(|| body.outline().cell(simd, n).farthest(simd, n), V3::<f64>::from);
        let limit = limit.min(MAX_ROUNDS);
        let (x, deficit, rounds) = farthest(simd, (body, 0), start, n, [tolerance, angle], limit);
        // Flat surfaces take more steps than that; what ends earlier has diverged.
        let is_open = rounds == limit && deficit == f64::INFINITY && x.iter().all(|v| v.is_finite());
        let end = is_open.then(|| Vector3::from(x));
        (if deficit <= tolerance { Ok(FoundOne { x: x.into(), deficit }) } else { Err(end) }, rounds)
    }
}

/// Most evaluations.
const MAX_ROUNDS: u32 = 6;

impl WithSimd for Farthest<'_> {
    type Output = Found;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Found {
        let Self { body, sought } = self;
        let mut found = [None; MAX_LANES];
        if body.is_smooth() {
            for (sought, found) in sought.chunks(Lanes::<S>::COUNT).zip(found.chunks_mut(Lanes::<S>::COUNT)) {
                in_lanes(simd, body, sought, found);
            }
        } else {
            for (sought, found) in sought.iter().zip(&mut found) {
                let n: V3<f64> = sought.n.into();
                let cell = body.outline().cell(simd, n);
                let active = body.outline().active(cell.place);
                let asked = [sought.tolerance, f64::INFINITY];
                let (x, deficit, _) = farthest(simd, (body, active), cell.farthest(simd, n), n, asked, MAX_ROUNDS);
                let holds = deficit <= sought.tolerance && Side::at_home(simd, body, active).others_hold(simd, x);
                *found = holds.then(|| (x.into(), active));
            }
        }
        found
    }
}

/// As many points as there are lanes, of a body of one constraint.
#[inline(always)]
fn in_lanes<S: Simd>(simd: S, body: &Body, sought: &[Sought], found: &mut [Option<(Vector3<f64>, usize)>]) {
    let mut columns = [[0.0; MAX_LANES]; 4];
    for lane in 0..Lanes::<S>::COUNT {
        // Lanes to spare seek the last point once more.
        let Sought { n, tolerance } = &sought[lane.min(sought.len() - 1)];
        for (column, entry) in columns.iter_mut().zip([n.x, n.y, n.z, *tolerance]) {
            column[lane] = entry;
        }
    }
    let mut loaded = [Lanes::<S>::splat(simd, 0.0); 4];
    for (loaded, column) in loaded.iter_mut().zip(&columns) {
        *loaded = Lanes::load(simd, column);
    }
    let [x, y, z, tolerance] = loaded;
    let n = [x, y, z];
    let start = body.outline().cell(simd, n).farthest(simd, n);
    let asked = [tolerance, Lanes::<S>::splat(simd, f64::INFINITY)];
    let (x, deficit, _) = farthest(simd, (body, 0), start, n, asked, MAX_ROUNDS);
    for (number, column) in [x[0], x[1], x[2], deficit].into_iter().zip(&mut columns) {
        number.store(column);
    }
    for (lane, found) in found.iter_mut().enumerate().take(sought.len()) {
        let [x, y, z, deficit] = [columns[0][lane], columns[1][lane], columns[2][lane], columns[3][lane]];
        *found = deficit.is_finite().then(|| (Vector3::new(x, y, z), 0));
    }
}

/// The point farthest along unit vectors n, from a start, as far as one constraint goes, with a
/// bound of its support deficit, infinite where it is not proven to be within the tolerance and the
/// angle asked for: then it is the last one; and the number of evaluations, at most the limit.
#[inline(always)]
fn farthest<S: Simd, N: Number<S>>(
    simd: S,
    (body, active): (&Body, usize),
    start: V3<N>,
    n: V3<N>,
    [tolerance, angle]: [N; 2],
    limit: u32,
) -> (V3<N>, N, u32) {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    let side = Side::at_home(simd, body, active);
    let inverse = rows(simd, body.inverse());
    let e = apply_transposed(&inverse, n);
    let mut x = start;
    let axes = side.localize(simd, &[[one, zero, zero], [zero, one, zero], [zero, zero, one]]);
    let (mut best, mut deficit, mut open) = (x, N::splat(simd, f64::INFINITY), one);
    let mut rounds = 0;
    while rounds < limit {
        rounds += 1;
        let (jet, inside) = side.jet(simd, x);
        let (dz, useful) = step(simd, &jet, e);
        let dx = apply(&inverse, dz);
        let next = side.extrapolate(simd, &jet, &axes, dx);
        let (inward, near) = side.inward(simd, &next);
        let multiplier = one / dot(n, next.plane.gradient);
        let off = add_scaled(n, -multiplier, next.plane.gradient);
        let aligned = dot(off, off).le(angle * angle);
        let short = side.support_deficit(simd, &next, n, e);
        let short = N::splat(simd, TAYLOR_ROUNDING).mul_add(short.abs() + multiplier, short - dot(n, inward));
        let enough = N::and(simd, short.le(tolerance), aligned);
        let useful = N::and(simd, inside, useful);
        let found = N::and(simd, N::and(simd, useful, one.le(open)), N::and(simd, near, enough));
        x = add(x, dx);
        for i in 0..3 {
            best[i] = (x[i] + inward[i]).select(found, best[i]);
        }
        deficit = short.select(found, deficit);
        open = zero.select(found, open.select(useful, zero));
        if N::all(simd, open.le(zero)) {
            break;
        }
    }
    let missing = N::splat(simd, f64::MAX).le(deficit);
    for i in 0..3 {
        best[i] = x[i].select(missing, best[i]);
    }
    (best, deficit, rounds)
}

/// Newton's step from a point near the surface, and whether its normal has to do with e.
#[inline(always)]
fn step<S: Simd, N: Number<S>>(simd: S, jet: &NumberJet<N>, e: V3<N>) -> (V3<N>, N::Mask) {
    let (one, positive) = (N::splat(simd, 1.0), N::splat(simd, f64::MIN_POSITIVE));
    let g = jet.gradient;
    let (square, along) = (dot(g, g), dot(g, e));
    let (cofactors, determinant) = cofactors(simd, jet.hessian);
    let (of_e, of_g) = (apply_symmetric(&cofactors, e), apply_symmetric(&cofactors, g));
    let multiplier = along / square;
    let missing = determinant * (one - jet.value);
    let next = (dot(g, of_e) - multiplier * missing) / dot(g, of_g);
    let dz = scaled(add_scaled(of_e, -next, of_g), one / (multiplier * determinant));
    let bend = N::splat(simd, 0.5) * dot(dz, apply_symmetric(&jet.hessian, dz));
    // The surface bends away from the tangent plane by as much.
    let dz = add_scaled(dz, -bend / square, g);
    // In normalized coordinates a body has size about 1.
    let short = dot(dz, dz).le(N::splat(simd, LONGEST_STEP * LONGEST_STEP));
    (dz, N::and(simd, short, N::and(simd, positive.le(along), positive.le(next))))
}

#[cfg(test)]
mod tests {
    use super::{Farthest, Sought};
    use crate::body::Body;
    use crate::polynomial::dispatch;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn points_are_as_far_as_they_can_be_whatever_their_neighbours() {
        let half = Vector3::new(0.9, 0.4, 0.6);
        let mut missing = 0;
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let degree = [2_u8, 4, 6, 8][seed as usize % 4];
            let body = if degree == 2 {
                Body::ellipsoid("egg", Vector3::zeros(), half)
            } else {
                Body::superellipsoid("q", Vector3::zeros(), half, degree)
            };
            let body = body.unwrap();
            let tolerance = 10_f64.powi(-3 - (seed % 6) as i32);
            let sought: Vec<Sought> = (0..8).map(|_| Sought { n: random.unit(), tolerance }).collect();
            let found = dispatch(Farthest { body: &body, sought: &sought });
            for (k, (one, Sought { n, .. })) in found.iter().zip(&sought).enumerate() {
                assert_eq!(dispatch(Farthest { body: &body, sought: &sought[k..=k] })[0], *one, "seed {seed}, {k}");
                // Hölder's inequality: with 1/p + 1/q = 1 the largest n·x is the q-norm of n scaled
                // by the half-axes.
                let q = f64::from(degree) / f64::from(degree - 1);
                let most = n.component_mul(&half).map(|v| v.abs().powf(q)).sum().powf(1.0 / q);
                let Some((x, _)) = one else {
                    missing += 1;
                    continue;
                };
                assert!(body.value(x) <= 1.0 + 1e-12, "seed {seed}, {k}");
                assert!((most - tolerance..=most + 1e-12).contains(&n.dot(x)), "seed {seed}, {k}");
            }
        }
        assert!(missing < 400, "{missing} of 1 600");
    }
}
