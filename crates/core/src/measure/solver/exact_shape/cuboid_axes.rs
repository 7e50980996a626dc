//! The directions across the faces of the difference of two boxes.
//!
//! The difference `B - A` of two boxes is a polytope. Its faces are those of either box, moved, and
//! parallelograms of an edge of each: 15 axes in all, and no direction takes the boxes apart by
//! less than the best of these.
//!
//! The axis across two edges is as inaccurate as they are parallel: what rounding leaves of their
//! cross product is relative to the sine of their angle. But then their parallelogram is as slim,
//! and nowhere in it is an edge of a neighbouring face farther away than half its width.

use crate::measure::frames::vector::{M3, V3, dot};
use crate::polynomial::{Scalar, gamma};
use nalgebra::Vector3;

/// Largest angle, radians, between the normal of an answer and that of the solution; and between
/// two edges whose axis is not the answer and does not count as a face that others may be beside:
/// see [`CuboidAxes::least_overlap`].
///
/// Larger, gradients would be off by more than 1e-6, and depths by up to this times the smaller
/// edges; smaller, balls beside edges and boxes that touch are left to the general search, and axes
/// are off by more than this. Exercised by `signed_shapes_have_gradients` and
/// `nearly_parallel_edges_keep_their_bracket`.
pub(super) const ALIGNED: f64 = 1e-7;

/// Two boxes, A as seen from B.
#[derive(Clone, Copy, Debug)]
pub(super) struct CuboidAxes {
    pub(super) half_a: V3<f64>,
    pub(super) half_b: V3<f64>,
    /// From A's frame to B's, by rows.
    pub(super) rotation: M3<f64>,
    /// From B's centre to A's, in B's frame, metres.
    pub(super) between: V3<f64>,
    /// Bounds of the error of the rotation, and of places that are not turned by it, metres.
    pub(super) turned: f64,
    pub(super) displacement: f64,
}

/// A direction and what it says of two boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct CuboidAxis {
    /// In B's frame; of length 1 but across edges, where it is the sine of their angle.
    pub(super) n: Vector3<f64>,
    pub(super) length: f64,
    /// Half of what the boxes cover along the unit vector, together, metres.
    pub(super) width: f64,
    /// How far the centres are from each other along it, metres.
    pub(super) apart: f64,
    /// Half of the width of the parallelogram of two edges; metres.
    slim: f64,
}

/// By how much two shapes overlap along the axis along which they do least; negative if they are
/// apart. Metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeastOverlap {
    /// No translation shorter than this takes the shapes apart: proven.
    pub(super) lower: f64,
    /// One along the normal of this length does: proven.
    pub(super) upper: f64,
    /// Unit vector from B to A, in B's frame.
    pub(super) n: V3<f64>,
    /// The least along an axis at an angle with a cosine below the one asked for.
    pub(super) elsewhere: f64,
}

impl CuboidAxis {
    /// Whether it is across the edges that it is taken to be across.
    pub(super) fn is_accurate(&self) -> bool {
        self.length > ALIGNED
    }
}

impl CuboidAxes {
    /// Those of B, of A, and across edges of both.
    pub(super) fn all(&self) -> [CuboidAxis; 15] {
        let row = |r: usize| Vector3::ith(r, 1.0);
        let column = |c: usize| Vector3::from_fn(|i, _| self.rotation[i][c]);
        std::array::from_fn(|k| match k {
            0..3 => self.axis(row(k), f64::INFINITY),
            3..6 => self.axis(column(k - 3), f64::INFINITY),
            _ => {
                let (r, c) = (k / 3 - 2, k % 3);
                self.axis(row(r).cross(&column(c)), self.half_b[r].min(self.half_a[c]))
            }
        })
    }

    fn axis(&self, n: Vector3<f64>, thinner: f64) -> CuboidAxis {
        let own: V3<f64> = std::array::from_fn(|c| (0..3).map(|i| self.rotation[i][c] * n[i]).sum());
        let length = n.norm();
        let inverse = 1.0 / length;
        let along = |half: V3<f64>, n: V3<f64>| dot::<Scalar, f64>(half, n.map(f64::abs)) * inverse;
        CuboidAxis {
            n,
            length,
            width: along(self.half_a, own) + along(self.half_b, n.into()),
            apart: n.dot(&Vector3::from(self.between)) * inverse,
            slim: thinner * (length + self.turned),
        }
    }

    /// Bound of the error of the overlap along a direction as it is, metres; of an axis across
    /// edges, which is not where it is taken to be, divided by its length.
    pub(super) fn error(&self) -> f64 {
        let size = Vector3::from(self.half_a).norm() + Vector3::from(self.half_b).norm();
        self.displacement + (self.turned + gamma(24)) * (size + Vector3::from(self.between).norm())
    }

    /// The axis along which the boxes overlap least.
    ///
    /// Each face of the difference is at least as far out as its axis says, less its error; and one
    /// that is slim is, where it is nearest, at most half its width nearer than one beside it.
    pub(super) fn least_overlap(&self, elsewhere: f64) -> LeastOverlap {
        let (axes, error) = (self.all(), self.error());
        let overlap = |axis: &CuboidAxis| axis.width - axis.apart.abs();
        // As accurate as any: neighbours of a slim face are across edges nearly at right angles.
        let is_steep = |axis: &&CuboidAxis| axis.length > 0.5;
        let of_steep =
            axes.iter().filter(is_steep).map(|axis| overlap(axis) - error / axis.length).fold(f64::INFINITY, f64::min);
        let lower = axes.iter().filter(|axis| !is_steep(axis)).fold(of_steep, |lower, axis| {
            // A NaN is no bound: without length there is no direction.
            let of_axis = (overlap(axis) - error / axis.length).max(f64::NEG_INFINITY);
            lower.min(of_axis.max(of_steep - axis.slim * (1.0 + gamma(4))))
        });
        let mut best = &axes[0];
        for axis in axes.iter().filter(|axis| axis.is_accurate()) {
            if overlap(axis) < overlap(best) {
                best = axis;
            }
        }
        let n = best.n / (best.length * 1_f64.copysign(best.apart));
        let others = axes.iter().filter(|axis| axis.is_accurate() && axis.n.dot(&n).abs() < elsewhere * axis.length);
        let opposite = best.width + best.apart.abs();
        LeastOverlap {
            lower,
            upper: overlap(best) + error,
            n: n.into(),
            elsewhere: others.map(overlap).fold(opposite, f64::min),
        }
    }
}
