//! Where the cells of a set are.

use super::cover::{Cell, Cover};
use super::cut::support;
use super::placed_set::{PlacedSet, PlacedSetError};
use crate::polynomial::gamma;
use nalgebra::{Matrix3, Vector3};

/// The map from normalized coordinates to the common frame, `x = linear z + offset` in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placing {
    pub(super) linear: Matrix3<f64>,
    pub(super) offset: Vector3<f64>,
    /// Bound of the error of n·x for unit vectors n, metres, its rounding included.
    pub(super) slack_m: f64,
}

impl Placing {
    pub(super) fn new(set: &PlacedSet<'_>, cover: &Cover) -> Result<Self, PlacedSetError> {
        let most = cover.most();
        let (linear, offset, error) = set.frame()?.rounded(&most);
        let size = offset.norm() + (linear.abs() * most).norm();
        let slack_m = (error + gamma(64) * size) * (1.0 + 1e-13);
        if slack_m.is_finite() { Ok(Self { linear, offset, slack_m }) } else { Err(PlacedSetError::Normalization) }
    }

    /// Where the centre of a cell is, metres.
    pub(super) fn center(&self, cell: &Cell) -> Vector3<f64> {
        self.linear * cell.center + self.offset
    }

    /// Lower bound of `n·x` over the points of the set in a cell, but for [`Placing::slack_m`], for
    /// a vector n of length 1, up to rounding.
    pub(super) fn least_along(&self, n: &Vector3<f64>, cover: &Cover, cell: &Cell) -> f64 {
        let m = self.linear.tr_mul(n);
        n.dot(&self.offset) + m.dot(&cell.center) - support(&cell.half, cover.cuts(cell), &-m)
    }
}
