//! How far a set reaches, proven without convexity: a first box from the Gram matrix, closer ones
//! by dividing it.

use super::error::SosBodyError;
use crate::body::{Aabb, Ball, Placement};
use crate::polynomial::{Polynomial, SosGram};
use nalgebra::{Matrix3, Vector3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Boxes looked at for the bound along one direction, where the highest point is one, and for that
/// of the distance, which all points of a circle may share.
const BOXES: usize = 3000;
const BOXES_ALL_AROUND: usize = 12_000;

/// Difference of a bound from what is attained at which the search for it ends, relative to the
/// size of the box known before; dimensionless.
///
/// A larger value leaves bounding boxes visibly too large; a smaller one takes more boxes than
/// [`BOXES`] allows without making queries faster. Pinned by `volumes_agree_with_closed_forms`.
const BOX_ACCURACY: f64 = 1e-3;

/// Proven extent of a set in its own frame, metres.
pub(super) struct Extent {
    pub(super) bounding_box: Aabb,
    pub(super) circumscribed: Ball,
}

impl Extent {
    /// Proves the set bounded and computes its bounding box and a circumscribed ball.
    pub(super) fn prove(
        polynomial: &Polynomial,
        gram: &SosGram,
        placement: &Placement,
        inverse: &Matrix3<f64>,
    ) -> Result<Self, SosBodyError> {
        let first = first_box(polynomial, gram)?;
        let size = (inverse.abs() * first).norm();
        let rounding = 1e-14 * (size + placement.origin().norm());
        // n·(x - o) = m·z for the points x of the box, with a bound of the error of m.
        let functional = |n: &Vector3<f64>| {
            let (m, error) = placement.functional(n);
            (m, error.dot(&first) + rounding)
        };
        let origin = placement.origin();
        let bounds = |close: f64| {
            let reach = |n: &Vector3<f64>| {
                let (m, error) = functional(n);
                highest(polynomial, &first, |z, half| m.dot(z) + m.abs().dot(half) + error, close, BOXES)
            };
            Aabb {
                min: Vector3::from_fn(|i, _| (origin[i] - reach(&-unit(i))).next_down()),
                max: Vector3::from_fn(|i, _| (origin[i] + reach(&unit(i))).next_up()),
            }
        };
        // The first box can be hundreds of times too large.
        let rough = bounds(BOX_ACCURACY * size);
        let bounding_box = bounds(BOX_ACCURACY * (rough.max - rough.min).norm());
        let center = (bounding_box.min + bounding_box.max) * 0.5;
        let half_diagonal = (bounding_box.max - bounding_box.min).norm() * 0.5;
        let (offset, spread) = (origin - center, inverse.abs());
        let error = Vector3::from_fn(|i, _| functional(&unit(i)).1).norm();
        let distance =
            |z: &Vector3<f64>, half: &Vector3<f64>| (inverse * z + offset).norm() + (spread * half).norm() + error;
        let radius = highest(polynomial, &first, distance, BOX_ACCURACY * half_diagonal, BOXES_ALL_AROUND)
            .min(half_diagonal)
            * (1.0 + 1e-14)
            + rounding;
        Ok(Self { bounding_box, circumscribed: Ball { center, radius } })
    }
}

fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)))
}

/// Half the edges of a box about 0 that contains the set: `1 >= p >= ρ z_i^2j` for every power of
/// z_i in the basis.
fn first_box(polynomial: &Polynomial, gram: &SosGram) -> Result<Vector3<f64>, SosBodyError> {
    let mut half = Vector3::repeat(f64::INFINITY);
    for (axis, half) in half.iter_mut().enumerate() {
        for power in 1..=4_u8 {
            let mut exponents = [0; 3];
            exponents[axis] = power;
            let floor = gram.floor(polynomial, exponents);
            if floor > 0.0 {
                *half = half.min((1.0 / floor).powf(0.5 / f64::from(power)) * (1.0 + 1e-12));
            }
        }
        if !half.is_finite() {
            return Err(SosBodyError::Unbounded { axis });
        }
    }
    Ok(half)
}

/// A box of the normalized frame with a bound of the height of its points.
struct BoundedBox {
    center: Vector3<f64>,
    half: Vector3<f64>,
    height: f64,
}

impl PartialEq for BoundedBox {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for BoundedBox {}

impl PartialOrd for BoundedBox {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for BoundedBox {
    fn cmp(&self, other: &Self) -> Ordering {
        self.height.total_cmp(&other.height)
    }
}

/// Upper bound of `height` over the points of the box `|z_i| <= first_i` with p <= 1: the highest
/// boxes are divided until one that may contain points of the set is hardly higher than a point
/// that is in it. An empty set has the bound minus infinity.
fn highest(
    polynomial: &Polynomial,
    first: &Vector3<f64>,
    height: impl Fn(&Vector3<f64>, &Vector3<f64>) -> f64,
    close: f64,
    boxes: usize,
) -> f64 {
    let cell = |center: Vector3<f64>, half: Vector3<f64>| BoundedBox { center, half, height: height(&center, &half) };
    let mut heap = BinaryHeap::from([cell(Vector3::zeros(), *first)]);
    let mut attained = f64::NEG_INFINITY;
    for _ in 0..boxes {
        let Some(top) = heap.peek() else { break };
        if top.height - attained <= close {
            break;
        }
        let Some(BoundedBox { center, half, .. }) = heap.pop() else { break };
        let linear = polynomial.linear_bounds(&center, &half);
        if linear.least(&half) > 1.0 {
            continue;
        }
        if linear.value <= 1.0 {
            attained = attained.max(height(&center, &Vector3::zeros()));
        }
        let axis = (0..3).max_by(|&a, &b| half[a].total_cmp(&half[b])).unwrap_or(0);
        for side in [-0.5, 0.5] {
            let (mut center, mut smaller) = (center, half);
            center[axis] += side * half[axis];
            // Centres round: halves overlap a little.
            smaller[axis] = 0.5 * half[axis] + 2.0 * f64::EPSILON * (center[axis].abs() + half[axis]);
            heap.push(cell(center, smaller));
        }
    }
    heap.peek().map_or(f64::NEG_INFINITY, |top| top.height)
}
