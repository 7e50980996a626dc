//! Convex sets with closed forms: the projection of a point, the curvature of their offset
//! surfaces, the support function.
//!
//! Outside of the set the distance of a point x has the unit gradient `n = (x - P x) / D`, P the
//! projection, and the Hessian `T K Tᵀ`, T tangents across n: K is the curvature of the surface at
//! distance D around the set. It is 0 over a face, 1/D across an edge and 0 along it, and 1/D every
//! way around a corner. Points are in the frame of the set, metres.

use crate::measure::frames::vector::{M3, V3, dot};
use crate::measure::solver::tangent_newton::Symmetric2;
use crate::polynomial::Simd;

/// Coordinate relative to a half-size, dimensionless, from which a point counts as on the boundary:
/// projections leave it off by 1e-16.
///
/// Lower, points inside count as on a face and take its normal; nearer to 1, rounding takes points
/// off their face. Exercised by `shapes_against_shapes`.
pub(super) const ON: f64 = 1.0 - 1e-12;

/// Where a point is as seen from a set.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Offset {
    /// Distance; 0 inside, where the rest means nothing.
    pub(in crate::measure) distance: f64,
    /// Tangents and outward unit normal, by rows.
    pub(in crate::measure) frame: M3<f64>,
    /// Curvature K of the offset surface along the tangents, 1/m: 00, 01, 11.
    pub(in crate::measure) curvature: Symmetric2<f64>,
    /// Which face, edge or corner is nearest; each set has its own numbers.
    pub(in crate::measure) feature: u8,
}

/// A convex set that contains the origin.
pub(in crate::measure) trait Projectable: Copy {
    /// Nearest point of the set.
    fn project<S: Simd>(&self, simd: S, x: V3<f64>) -> V3<f64>;

    /// Where a point is as seen from the set.
    fn offset<S: Simd>(&self, simd: S, x: V3<f64>) -> Offset;

    /// Support function: the largest `n·y` over the set.
    fn height<S: Simd>(&self, simd: S, n: V3<f64>) -> f64;

    /// How far a plane across a unit vector n keeps the set apart from what reaches no more than
    /// `deficit` farther along -n than the point x, but for rounding; metres.
    #[inline(always)]
    fn separation<S: Simd>(&self, simd: S, n: V3<f64>, (x, deficit): (V3<f64>, f64)) -> f64 {
        dot::<S, f64>(n, x) - deficit - self.height(simd, n)
    }

    /// The part of a vector that the normals of a feature span, of length 1. Planes across it touch
    /// all of the feature, so that what is off across it costs nothing.
    fn in_normal_cone<S: Simd>(&self, simd: S, feature: u8, n: V3<f64>) -> V3<f64>;

    /// On which face, edge or corner a point of the set lies; numbered as by
    /// [`Projectable::offset`], 0 inside.
    fn feature_at<S: Simd>(&self, simd: S, y: V3<f64>) -> u8;

    /// How much of a unit vector pulls a point of the set along it, and not off it: 0 for an
    /// outward normal there.
    fn slide<S: Simd>(&self, simd: S, y: V3<f64>, pull: V3<f64>) -> f64;

    /// The unit vector along which a feature is a straight line, if it is one, in the set or in
    /// every plane that touches it.
    fn line<S: Simd>(&self, simd: S, feature: u8) -> Option<V3<f64>>;

    /// Its smallest half-size, metres; 0 of a segment.
    fn thinnest(&self) -> f64;

    /// The set with all sizes smaller by a length, metres.
    fn shrunk(&self, by: f64) -> Self;

    /// The normals of the faces that a point lies beyond, and how many they are.
    fn faces_towards<S: Simd>(&self, simd: S, x: V3<f64>) -> ([V3<f64>; 3], usize);

    /// About the point of the set where a convex function is least that has this gradient and
    /// Hessian (xx, xy, xz, yy, yz, zz) at the point y of the set.
    fn least<S: Simd>(&self, simd: S, y: V3<f64>, gradient: V3<f64>, hessian: &[f64; 6]) -> V3<f64>;

    /// Radius of the ball about the origin that contains the set.
    fn reach(&self) -> f64;
}
