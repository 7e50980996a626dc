//! Planes between two convex pieces, without a solver.
//!
//! Along a unit vector n, which points from B to A, the pieces are apart by at least
//! `n·(a - b) - h_A(-n) - h_B(n)`, a and b points of theirs and h their support heights above
//! these. Where that is negative the signed distance is not less either.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use sublevel_core::measure::Pose;

use super::geometry::Piece;

/// Bound of the error of a product of a rotated direction with a point of a body, and of the
/// rotation itself, relative to the lengths.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// What proves how far a body reaches along a direction, see
/// [`Body::tangent_height`](sublevel_core::body::Body::tangent_height).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tangent {
    /// A support point, body frame, metres.
    pub(crate) point: [f64; 3],
    /// Positions of constraints and their multipliers, metres.
    pub(crate) multipliers: Vec<(usize, f64)>,
}

/// How far a piece reaches along a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Height<'a> {
    /// As far as its ball.
    Ball,
    /// As its table or its closed form says.
    Table,
    /// As a point of its frame and multipliers of its constraints prove, both metres.
    Tangent(&'a Tangent),
}

/// Largest `n·x` over the points of a piece where it stands, metres, rounded upwards; n a unit
/// vector of the world frame.
pub(crate) fn top(piece: &Piece<'_>, pose: &Pose, n: &Vector3<f64>, height: Height<'_>) -> f64 {
    if let Piece::HalfSpace(half_space, error_m) = piece {
        let off = (n - half_space.normal()).norm();
        return if off <= 4.0 * f64::EPSILON {
            half_space.offset() + error_m + ROUNDING * half_space.offset().abs()
        } else {
            f64::INFINITY
        };
    }
    let (center, radius) = piece.ball();
    let own = || pose.rotation().inverse_transform_vector(n);
    let (from, height) = match (piece, height) {
        (Piece::Body(body), Height::Table) => (*body.interior_point(), body.height(&own())),
        (Piece::Body(body), Height::Tangent(tangent)) => {
            let multipliers = tangent.multipliers.iter().copied();
            (*body.interior_point(), body.tangent_height(&own(), &tangent.point.into(), multipliers))
        }
        (Piece::Capsule(capsule), Height::Table | Height::Tangent(_)) => {
            (center, capsule.radius_m() + capsule.half_height_m() * own().z.abs())
        }
        _ => (center, radius),
    };
    let at = pose.transform_point(&from);
    let size = pose.translation().norm() + from.norm() + 2.0 * radius;
    n.dot(&at) + height + ROUNDING * size
}

/// Lower bound of the signed distance of A from B, metres, by planes across the unit vector n,
/// which points from B to A; world frame.
pub(crate) fn gap(
    (a, pose_a, height_a): (&Piece<'_>, &Pose, Height<'_>),
    (b, pose_b, height_b): (&Piece<'_>, &Pose, Height<'_>),
    n: &Vector3<f64>,
) -> f64 {
    let (low, high) = (-top(a, pose_a, &-n, height_a), top(b, pose_b, n, height_b));
    // n is of length 1 within rounding, which the difference of two heights feels.
    low - high - ROUNDING * (low.abs() + high.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_core::body::Body;
    use sublevel_core::measure::{
        ActiveConstraints, Capsule, HalfSpace, Options, WarmStart, distance, distance_to_capsule,
        distance_to_half_space,
    };
    use sublevel_testkit::Seeded;

    #[test]
    fn planes_bound_distances_from_below() {
        let half = Vector3::new(0.3, 0.5, 0.2);
        let bodies = [
            Body::cuboid("box", half).expect("a box"),
            Body::cylinder("cylinder", 0.3, 0.5).expect("a cylinder"),
            Body::superellipsoid("q6", Vector3::new(0.1, 0.2, 0.3), half, 6).expect("a body"),
        ];
        let capsule = Capsule::new(0.2, 0.4).expect("a capsule");
        let (options, mut close) = (Options::default(), 0);
        for seed in 0..600 {
            let mut seeded = Seeded(seed);
            let (a, b) = (&bodies[seeded.index(3)], &bodies[seeded.index(3)]);
            let (at_a, at_b) = (seeded.pose(0.1), seeded.pose(2.0));
            let n = seeded.unit();
            let found = distance(a, &at_a, b, &at_b, &options, &mut WarmStart::default());
            let (a, b, c) = (Piece::Body(a), Piece::Body(b), Piece::Capsule(&capsule));
            for height in [Height::Ball, Height::Table] {
                let bound = gap((&a, &at_a, height), (&b, &at_b, height), &n);
                assert!(bound <= found.upper, "seed {seed}: {bound} > {}", found.upper);
            }
            if let Some(normal) = found.normal.filter(|_| found.lower > 0.0) {
                let tangent = |x: &Vector3<f64>, pose: &Pose, active: &ActiveConstraints| Tangent {
                    point: (pose.rotation().inverse() * (x - pose.translation())).into(),
                    multipliers: active.iter().collect(),
                };
                let of_a = tangent(&found.witness_a, &at_a, &found.active_a);
                let of_b = tangent(&found.witness_b, &at_b, &found.active_b);
                // A witness is as exact as the root of the bracket's width.
                let tangents = [Height::Tangent(&of_a), Height::Tangent(&of_b)];
                let bound = gap((&a, &at_a, tangents[0]), (&b, &at_b, tangents[1]), &normal);
                assert!(bound <= found.upper && bound > found.lower - 1e-5, "seed {seed}: {bound} {}", found.lower);
                close += 1;
            }
            let Piece::Body(body) = a else { continue };
            let found = distance_to_capsule(body, &at_a, &capsule, &at_b, &options, &mut WarmStart::default());
            let n = found.normal.unwrap_or(n);
            let bound = gap((&a, &at_a, Height::Table), (&c, &at_b, Height::Table), &n);
            assert!(bound <= found.upper, "seed {seed}: {bound} > {}", found.upper);
            let half_space = HalfSpace::new(n, seeded.signed()).expect("a half-space");
            let n = *half_space.normal();
            let found = distance_to_half_space(body, &at_a, &half_space, &options, &mut WarmStart::default());
            let plane = Piece::HalfSpace(&half_space, 0.0);
            let bound = gap((&a, &at_a, Height::Table), (&plane, &Pose::identity(), Height::Table), &n);
            assert!(bound <= found.upper && bound > found.lower - 0.05, "seed {seed}: {bound} {}", found.lower);
            assert_eq!(gap((&a, &at_a, Height::Table), (&plane, &at_b, Height::Table), &-n), f64::NEG_INFINITY);
        }
        assert!(close > 300, "{close}");
    }
}
