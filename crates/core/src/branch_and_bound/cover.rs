//! Boxes that cover a set, in its normalized coordinates, divided as far as queries needed it.

use super::cut::Cut;
use super::placed_set::{BoundedSet, PlacedSetError};
use crate::body::Aabb;
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Place of a cell in its cover.
pub(super) type CellIndex = u32;

/// Not divided yet.
const UNDIVIDED: [CellIndex; 2] = [0; 2];

/// A half without points of the set.
const NOTHING: CellIndex = CellIndex::MAX;

/// Smallest half edge of a cell, relative to the largest coordinate of the cover; dimensionless.
///
/// Coordinates round at 1e-16: a smaller value divides cells without end whose halves are the same
/// up to rounding; a larger one ends brackets before they are narrow. Accuracies asked for are far
/// above it, and no test reaches it.
const SMALLEST: f64 = 1e-14;

/// A box that may contain points of the set.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub(super) center: Vector3<f64>,
    pub(super) half: Vector3<f64>,
    /// About half the diagonal of its image, metres; decides only what is divided.
    pub(super) radius_m: f64,
    cuts: Range<u32>,
    halves: [CellIndex; 2],
}

/// A tree of cells. It depends on the set, not on where that is.
#[derive(Clone, Debug)]
pub(super) struct Cover {
    cells: Vec<Cell>,
    cuts: Vec<Cut>,
    /// Metres along the image of each coordinate axis.
    lengths: Vector3<f64>,
    smallest: f64,
    /// What the first cell is around.
    bounding_box: Aabb,
}

impl Cover {
    /// Of one cell around the bounding box; none if it contains no points.
    pub(super) fn new(of: &BoundedSet<'_>) -> Result<Option<Self>, PlacedSetError> {
        let normalization = of.set.normalization;
        let inverse: Matrix3<f64> = normalization.linear.try_inverse().ok_or(PlacedSetError::Normalization)?;
        let bounds = &of.bounding_box;
        let middle = (bounds.min + bounds.max) * 0.5;
        let center = normalization.linear * (middle - normalization.center);
        let half = normalization.linear.abs() * ((bounds.max - bounds.min) * 0.5);
        // Six roundings of each of these.
        let size = normalization.linear.abs() * (bounds.max.abs() + bounds.min.abs() + normalization.center.abs());
        let half = half + size * (16.0 * f64::EPSILON);
        let lengths = Vector3::from_fn(|k, _| inverse.column(k).norm());
        let smallest = SMALLEST * (center.abs() + half).amax();
        let mut cover = Self { cells: Vec::new(), cuts: Vec::new(), lengths, smallest, bounding_box: *bounds };
        Ok(cover.add(of, center, half).map(|_| cover))
    }

    /// The cell of a place.
    pub(super) fn cell(&self, index: CellIndex) -> &Cell {
        &self.cells[index as usize]
    }

    /// Half-spaces that contain the points of the set in a cell, about its centre.
    pub(super) fn cuts(&self, cell: &Cell) -> &[Cut] {
        &self.cuts[cell.cuts.start as usize..cell.cuts.end as usize]
    }

    /// Memory that it takes, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.cells.capacity() * size_of::<Cell>() + self.cuts.capacity() * size_of::<Cut>()
    }

    /// Whether it covers a set with this bounding box.
    pub(super) fn is_of(&self, of: &BoundedSet<'_>) -> bool {
        self.bounding_box == of.bounding_box
    }

    /// Upper bounds of the magnitudes of normalized coordinates.
    pub(super) fn most(&self) -> Vector3<f64> {
        let Cell { center, half, .. } = &self.cells[0];
        (center.abs() + half) * (1.0 + 1e-14)
    }

    /// Whether a cell is large enough to be divided.
    pub(super) fn is_divisible(&self, index: CellIndex) -> bool {
        self.cell(index).half.amax() > self.smallest
    }

    /// The halves of a cell that may contain points of the set, across its longest edge in space.
    pub(super) fn halves(&mut self, of: &BoundedSet<'_>, index: CellIndex) -> impl Iterator<Item = CellIndex> + use<> {
        let cell = &self.cells[index as usize];
        if cell.halves == UNDIVIDED {
            let (center, half) = (cell.center, cell.half);
            let length = |axis: usize| half[axis] * self.lengths[axis];
            let axis = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
            let halves = [-0.5, 0.5].map(|side| {
                let (mut center, mut smaller) = (center, half);
                center[axis] += side * half[axis];
                // Centres round: halves overlap a little.
                smaller[axis] = 0.5 * half[axis] + 2.0 * f64::EPSILON * (center[axis].abs() + half[axis]);
                self.add(of, center, smaller).unwrap_or(NOTHING)
            });
            self.cells[index as usize].halves = halves;
        }
        self.cells[index as usize].halves.into_iter().filter(|half| *half != NOTHING)
    }

    /// A new cell, unless no point of the set is in it.
    fn add(&mut self, of: &BoundedSet<'_>, center: Vector3<f64>, half: Vector3<f64>) -> Option<CellIndex> {
        let start = self.cuts.len();
        for polynomial in &of.set.polynomials {
            let linear = polynomial.linear_bounds(&center, &half);
            if linear.most(&half) <= 1.0 {
                continue;
            }
            let slack = 1.0 - linear.value - linear.below;
            let cut = Cut { gradient: linear.gradient, slack: slack + 4.0 * f64::EPSILON * (1.0 + linear.value.abs()) };
            if cut.excludes(&half) {
                self.cuts.truncate(start);
                return None;
            }
            if self.cuts.len() - start < crate::body::MAX_CONSTRAINTS {
                self.cuts.push(cut);
            }
        }
        let radius_m = half.component_mul(&self.lengths).norm();
        // A query divides far fewer.
        let index = self.cells.len() as CellIndex;
        let cuts = start as u32..self.cuts.len() as u32;
        self.cells.push(Cell { center, half, radius_m, cuts, halves: UNDIVIDED });
        Some(index)
    }
}
