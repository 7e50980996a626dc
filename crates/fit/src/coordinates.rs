//! The coordinates in which traces, and what relaxes convexity, are measured.

use super::basis::Affine;
use nalgebra::Vector3;
use sublevel_core::body::Normalization;

/// Coordinates that an objective, or a relaxation of convexity, depends on; log dets depend on
/// none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// The unit frame: the points have their mean at the origin and largest norm 1, so that units
    /// and place do not matter.
    #[default]
    Unit,
    /// Those of the points, metres: what the paper's tables are made in.
    Raw,
}

impl Coordinates {
    /// The map to them from the whitened frame; none if that is singular.
    pub(super) fn map(self, points: &[Vector3<f64>], whitened: &Normalization) -> Option<Affine> {
        let inverse = whitened.linear.try_inverse()?;
        Some(match self {
            Self::Unit => {
                let count = points.len() as f64;
                // About the center, which is near: far-off coordinates would round the mean away.
                let offset = points.iter().map(|p| (p - whitened.center) / count).sum::<Vector3<f64>>();
                let reach = points.iter().map(|p| (p - whitened.center - offset).norm()).fold(0.0, f64::max);
                Affine { linear: inverse / reach, offset: -offset / reach }
            }
            Self::Raw => Affine { linear: inverse, offset: whitened.center },
        })
    }
}
