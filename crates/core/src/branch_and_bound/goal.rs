//! What is minimised over one set.

use super::active_set::{Derivatives, Objective};
use super::cover::{Cell, Cover};
use super::cut::support;
use super::local_search::{Level, distance_up};
use super::placed_set::{Membership, PlacedSet, PlacedSetError};
use super::placing::Placing;
use crate::polynomial::Polynomial;
use nalgebra::{Matrix3, Vector3};

/// A function of the points of a set.
pub(super) enum Goal<'a> {
    /// The largest polynomial of another set.
    Level {
        /// The polynomials in the normalized coordinates of the first set, with what they are off
        /// by.
        composed: Vec<(Polynomial, f64)>,
        level: Level<'a>,
        values: Box<Membership<'a>>,
    },
    /// `normal·x - offset`, metres, for a vector of length 1 up to rounding.
    Height { normal: Vector3<f64>, offset: f64 },
    /// `|x - point|`, metres.
    From(Vector3<f64>),
}

impl<'a> Goal<'a> {
    /// The level of the points of `set` in `other`.
    pub(super) fn level(set: &PlacedSet<'_>, cover: &Cover, other: &'a PlacedSet<'a>) -> Result<Self, PlacedSetError> {
        other.frame()?;
        let map = set.frame_to(other)?;
        let most = cover.most();
        let composed = other.of.set.polynomials.iter().map(|g| map.compose(g, &most));
        let composed: Vec<_> = composed.collect::<Result<_, _>>().map_err(|_| PlacedSetError::Normalization)?;
        let values = Box::new(other.membership().ok_or(PlacedSetError::Normalization)?);
        Ok(Self::Level { composed, level: Level::of(other), values })
    }

    /// Lower bound over the points of the set in a cell.
    pub(super) fn floor(&self, placing: &Placing, cover: &Cover, cell: &Cell) -> f64 {
        match self {
            Self::Level { composed, .. } => {
                let floors = composed.iter().map(|(q, error)| {
                    let linear = q.linear_bounds(&cell.center, &cell.half);
                    let reach = support(&cell.half, cover.cuts(cell), &-linear.gradient);
                    let size = linear.value.abs() + linear.below.abs() + reach.abs() + error;
                    linear.value + linear.below - reach - error - 8.0 * f64::EPSILON * size
                });
                floors.fold(f64::NEG_INFINITY, f64::max)
            }
            Self::Height { normal, offset } => {
                let least = placing.least_along(normal, cover, cell);
                least - offset - placing.slack_m - 4.0 * f64::EPSILON * (least.abs() + offset.abs())
            }
            Self::From(point) => {
                let Some(n) = (placing.center(cell) - point).try_normalize(0.0) else { return 0.0 };
                let least = placing.least_along(&n, cover, cell) - n.dot(point);
                let rounding = placing.slack_m + 8.0 * f64::EPSILON * point.norm();
                ((least - rounding) * (1.0 - 4.0 * f64::EPSILON)).max(0.0)
            }
        }
    }

    /// Upper bound of the value at a point of the common frame.
    pub(super) fn value_up(&self, x: &Vector3<f64>) -> f64 {
        match self {
            Self::Level { values, .. } => values.largest_value(x),
            Self::Height { normal, offset } => normal.dot(x) - offset + 8.0 * f64::EPSILON * (x.norm() + offset.abs()),
            Self::From(point) => distance_up(x, point),
        }
    }

    /// What widths are relative to where the value is small.
    pub(super) fn scale(&self) -> f64 {
        match self {
            Self::Level { .. } => 1.0,
            Self::Height { .. } | Self::From(_) => 0.0,
        }
    }
}

impl Objective<1> for Goal<'_> {
    fn count(&self) -> usize {
        match self {
            Self::Level { level, .. } => level.count(),
            Self::Height { .. } | Self::From(_) => 1,
        }
    }

    /// A polynomial of the other set, the height, or half the squared distance.
    fn function(&self, index: usize, points: &[Vector3<f64>; 1]) -> Derivatives {
        let [x] = points;
        match self {
            Self::Level { level, .. } => level.function(index, points),
            Self::Height { normal, offset } => {
                Derivatives::of_point(0, normal.dot(x) - offset, normal, &Matrix3::zeros())
            }
            Self::From(point) => {
                let gap = x - point;
                Derivatives::of_point(0, 0.5 * gap.norm_squared(), &gap, &Matrix3::identity())
            }
        }
    }

    fn may_be_inside(&self) -> bool {
        matches!(self, Self::Level { .. })
    }
}
