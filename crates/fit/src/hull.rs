//! Convex hull of the input points: only its vertices constrain a convex polynomial.

use super::facets::facets;
use super::facing::Facing;
use super::outermost::outermost;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::collections::HashMap;

/// Thickness below which points count as flat, relative to their longest extent; dimensionless.
///
/// The whitening stretches the thin direction by the inverse, so smaller values would cost digits
/// of every later proof; a larger one refuses thin objects: a sheet of paper on a desk is 1e-4.
/// Pinned by `flat_points_are_refused_with_their_thickness` and
/// `a_thin_sheet_above_the_threshold_is_accepted`.
pub const FLATNESS: f64 = 1e-6;

/// Thickness below which points count as flat, relative to their largest coordinate; dimensionless:
/// ten thousand roundings, so that the shape keeps four digits.
///
/// A smaller value fits bodies to rounding errors; a larger one refuses objects that are only far
/// from the origin. Pinned by `scales_and_offsets_change_only_the_units` and
/// `points_far_away_are_refused_by_name`.
const COORDINATE_ROUNDINGS: f64 = 1e4 * f64::EPSILON;

/// Distance by which a point may lie outside of the computed hull before the hull is computed
/// again, relative to its size; dimensionless.
///
/// The hull code's own tolerances are near 1e-10. A larger value accepts hulls that lost a vertex;
/// a smaller one refuses hulls of points on flat facets. Pinned by
/// `of_a_grid_with_many_coplanar_points`.
const HULL_TOLERANCE: f64 = 1e-9;

/// Why points have no usable convex hull.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HullError {
    /// Coplanar, collinear or coincident points.
    #[error(
        "the points are flat: {shape}, {thickness_m:.3e} m thick and {extent_m:.3e} m long \
         (at least {FLATNESS:.0e} of the length is needed); give them a thickness (--min-thickness, such as 1mm)"
    )]
    Flat {
        /// "coincident", "collinear" or "coplanar".
        shape: &'static str,
        /// Extent in the thinnest principal direction, metres.
        thickness_m: f64,
        /// Extent in the longest principal direction, metres.
        extent_m: f64,
    },
    /// Points so far from the origin that their coordinates round away their shape.
    #[error(
        "the points are {extent_m:.3e} m long but {distance_m:.3e} m from the origin, where coordinates keep too few digits; \
         move the origin to the object"
    )]
    TooFar {
        /// Longest extent, metres.
        extent_m: f64,
        /// Largest coordinate, metres.
        distance_m: f64,
    },
    /// The hull code failed, also after a perturbation.
    #[error("the convex hull of the points could not be computed ({0}); remove near-duplicate points")]
    Failed(String),
}

/// Convex hull of points.
#[derive(Clone, Debug)]
pub struct Hull {
    /// Indices of its vertices among the points, ascending.
    pub vertices: Vec<usize>,
    /// Volume, cubed units of the points.
    pub volume: f64,
    /// The conditioning: `frame.linear (x - frame.center)` has principal extents 1.
    pub frame: Frame,
}

/// An affine frame `u = linear (x - center)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Origin of the frame.
    pub center: Vector3<f64>,
    /// Linear part.
    pub linear: Matrix3<f64>,
}

impl Frame {
    /// Coordinates of `x` in this frame.
    pub fn apply(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.linear * (x - self.center)
    }
}

/// The convex hull of finite points, computed in their principal frame (hulls are affine
/// invariant).
///
/// # Errors
/// [`HullError::Flat`] for points without volume, with their measured thickness.
pub fn convex_hull(points: &[Vector3<f64>]) -> Result<Hull, HullError> {
    let frame = principal_frame(points)?;
    // + 0.0 makes the two zeros one key
    let conditioned: Vec<Vector3<f64>> = points.iter().map(|point| frame.apply(point).add_scalar(0.0)).collect();
    let mut seen = HashMap::new();
    let mut unique = Vec::new();
    // What is left out lies in the hull of the others.
    for index in outermost(&conditioned) {
        let u = conditioned[index];
        seen.entry([u.x.to_bits(), u.y.to_bits(), u.z.to_bits()]).or_insert_with(|| {
            unique.push((index, u));
            index
        });
    }
    let mut failure = String::new();
    // Flat facets with many points can confuse the hull code; a tiny perturbation brings them into
    // general position.
    for perturbation in [0.0, 1e-11, 1e-9, 1e-7] {
        let moved: Vec<Vector3<f64>> = unique.iter().map(|(index, u)| u + jitter(*index) * perturbation).collect();
        match facets(&moved) {
            Ok((vertices, facets)) => {
                let volume = volume(&moved, &facets);
                let outside = excess(&moved, &facets);
                if volume > 0.0 && outside <= HULL_TOLERANCE {
                    let mut vertices: Vec<usize> = vertices.into_iter().map(|v| unique[v].0).collect();
                    vertices.sort_unstable();
                    return Ok(Hull { vertices, volume: volume / frame.linear.determinant().abs(), frame });
                }
                failure = format!("volume {volume:.1e}, points outside by {outside:.1e} of its size");
            }
            Err(error) => failure = error,
        }
    }
    Err(HullError::Failed(failure))
}

/// About the vertices and the volume of the convex hull, in half the time and less: nothing is
/// checked, and points are moved a little, as those of flat facets can confuse the hull code. None
/// for points without volume.
pub(super) fn rough_hull(points: &[Vector3<f64>]) -> Option<(Vec<Vector3<f64>>, f64)> {
    let frame = principal_frame(points).ok()?;
    let moved: Vec<_> = points.iter().enumerate().map(|(index, x)| frame.apply(x) + jitter(index) * 1e-7).collect();
    let (vertices, facets) = facets(&moved).ok()?;
    let volume = volume(&moved, &facets) / frame.linear.determinant().abs();
    Some((vertices.into_iter().map(|vertex| points[vertex]).collect(), volume))
}

/// The volume of [`rough_hull`].
pub(super) fn rough_volume(points: &[Vector3<f64>]) -> Option<f64> {
    rough_hull(points).map(|(_, volume)| volume)
}

/// The frame in which the points have principal extents 1.
fn principal_frame(points: &[Vector3<f64>]) -> Result<Frame, HullError> {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for point in points {
        (low, high) = (low.inf(point), high.sup(point));
    }
    let size = (high - low).max();
    let largest = low.amax().max(high.amax());
    if size > 0.0 && size <= COORDINATE_ROUNDINGS * largest {
        return Err(HullError::TooFar { extent_m: size, distance_m: largest });
    }
    if points.is_empty() || !(size > 0.0) {
        return Err(HullError::Flat { shape: "coincident", thickness_m: 0.0, extent_m: size.max(0.0) });
    }
    let (mean, axes, extents) = principal_axes(points);
    let mut sorted = [extents.x, extents.y, extents.z];
    sorted.sort_by(f64::total_cmp);
    let needed = FLATNESS * sorted[2];
    if sorted[0] > needed && sorted[0] <= COORDINATE_ROUNDINGS * largest {
        return Err(HullError::TooFar { extent_m: sorted[2], distance_m: largest });
    }
    if sorted[0] <= needed {
        let shape = if sorted[1] <= needed { "collinear" } else { "coplanar" };
        return Err(HullError::Flat { shape, thickness_m: sorted[0], extent_m: sorted[2] });
    }
    let linear = Matrix3::from_diagonal(&extents.map(|e| 1.0 / e)) * axes.transpose();
    Ok(Frame { center: mean, linear })
}

/// The mean of finite points, their principal axes as columns, and how far they extend along each.
pub(super) fn principal_axes(points: &[Vector3<f64>]) -> (Vector3<f64>, Matrix3<f64>, Vector3<f64>) {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for point in points {
        (low, high) = (low.inf(point), high.sup(point));
    }
    let size = (high - low).max();
    let middle = low * 0.5 + high * 0.5;
    let count = points.len() as f64;
    let mean = middle + points.iter().map(|p| (p - middle) / count).sum::<Vector3<f64>>();
    if !(size > 0.0) {
        return (mean, Matrix3::identity(), Vector3::zeros());
    }
    // Unit size first: squares of tiny or huge coordinates stay in range.
    let covariance: Matrix3<f64> = points.iter().map(|p| (p - mean) / size).map(|d| d * d.transpose() / count).sum();
    let axes = SymmetricEigen::new(covariance).eigenvectors;
    let extents = Vector3::from_fn(|i, _| {
        let axis = axes.column(i);
        let along = points.iter().map(|p| axis.dot(&(p - mean)));
        let (low, high) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), along| (low.min(along), high.max(along)));
        high - low
    });
    (mean, axes, extents)
}

/// Volume of a closed surface around the origin of an arbitrary frame.
fn volume(points: &[Vector3<f64>], facets: &[[usize; 3]]) -> f64 {
    facets.iter().map(|&[a, b, c]| points[a].dot(&points[b].cross(&points[c]))).sum::<f64>() / 6.0
}

/// How far the farthest point lies outside the plane of a facet that it faces; the points have
/// extents near 1. Infinite if the facets enclose nothing.
fn excess(points: &[Vector3<f64>], facets: &[[usize; 3]]) -> f64 {
    // Slivers have no usable direction.
    let planes = facets.iter().filter_map(|&[a, b, c]| {
        let normal = (points[b] - points[a]).cross(&(points[c] - points[a])).try_normalize(1e-9)?;
        Some((normal, normal.dot(&points[a])))
    });
    let corners = facets.iter().flatten().map(|&corner| points[corner]);
    let center = corners.sum::<Vector3<f64>>() / (3 * facets.len()).max(1) as f64;
    let Some(facing) = Facing::new(center, planes) else { return f64::INFINITY };
    points.iter().map(|x| facing.beyond(x)).fold(0.0, f64::max)
}

/// A fixed pseudo-random vector in the unit cube for each index.
fn jitter(index: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let mut x = (index as u64 * 3 + axis as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(extents: [f64; 3], center: Vector3<f64>) -> Vec<Vector3<f64>> {
        (0..8_usize)
            .map(|i| center + Vector3::from_fn(|axis, _| extents[axis] * (((i >> axis) & 1) as f64 - 0.5)))
            .collect()
    }

    #[test]
    fn of_a_cuboid_with_inner_points_and_duplicates() {
        let mut points = cuboid([1.0, 2.0, 0.5], Vector3::new(10.0, -4.0, 1.0));
        points.extend(cuboid([0.5, 0.5, 0.25], Vector3::new(10.0, -4.0, 1.0)));
        points.extend(points.clone());
        let hull = convex_hull(&points).unwrap();
        assert_eq!(hull.vertices, (0..8).collect::<Vec<_>>());
        assert!((hull.volume - 1.0).abs() < 1e-12, "{}", hull.volume);
    }

    #[test]
    fn of_a_grid_with_many_coplanar_points() {
        let range = 0..12;
        let points: Vec<_> = range
            .clone()
            .flat_map(|i| range.clone().flat_map(move |j| (0..12).map(move |k| (i, j, k))))
            .map(|(i, j, k)| Vector3::new(f64::from(i) * 0.1, f64::from(j) * 0.1, f64::from(k) * 0.3))
            .collect();
        let hull = convex_hull(&points).unwrap();
        assert!((hull.volume / (1.1 * 1.1 * 3.3) - 1.0).abs() < 1e-6, "{}", hull.volume);
    }

    #[test]
    fn scales_and_offsets_change_only_the_units() {
        for (scale, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-3, 10.0)] {
            let points: Vec<_> =
                (0..200).map(|i| jitter(i).normalize() * scale + Vector3::new(offset, -offset, 0.5 * offset)).collect();
            let hull = convex_hull(&points).unwrap();
            assert!(hull.vertices.len() > 190, "{} vertices at scale {scale}", hull.vertices.len());
            let relative = hull.volume / scale.powi(3);
            assert!((3.5..4.19).contains(&relative), "{relative}");
        }
    }

    #[test]
    fn flat_points_are_refused_with_their_thickness() {
        let disc: Vec<_> = (0..50).map(|i| Vector3::new((i as f64).sin(), (i as f64).cos(), 0.0)).collect();
        let tilted: Vec<_> = disc.iter().map(|p| Vector3::new(p.x, p.y, p.x * 0.3 - p.y + 1e-9 * p.x * p.y)).collect();
        let line: Vec<_> = (0..9).map(|i| Vector3::new(1.0, 2.0, 3.0) * f64::from(i)).collect();
        let same = vec![Vector3::new(1.0, 2.0, 3.0); 12];
        for (points, expected) in [(disc, "coplanar"), (tilted, "coplanar"), (line, "collinear"), (same, "coincident")]
        {
            match convex_hull(&points) {
                Err(HullError::Flat { shape, thickness_m, .. }) => {
                    assert_eq!(shape, expected);
                    assert!(thickness_m < 1e-6);
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn points_far_away_are_refused_by_name() {
        let far = |distance: f64| convex_hull(&cuboid([1.0; 3], Vector3::new(distance, 0.0, 0.0)));
        assert!(far(1e10).is_ok());
        assert!(matches!(far(1e13), Err(HullError::TooFar { .. })));
    }

    #[test]
    fn a_thin_sheet_above_the_threshold_is_accepted() {
        let hull = convex_hull(&cuboid([1.0, 1.0, 1e-5], Vector3::zeros())).unwrap();
        assert!((hull.volume / 1e-5 - 1.0).abs() < 1e-9);
    }
}
