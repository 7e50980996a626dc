//! Directions of normalized coordinates on the faces of a cube: the one grid that the tables of a
//! body's support points and heights are kept by.

use crate::polynomial::{Number, Simd};
use nalgebra::Vector3;

/// Cells along each edge of a face. Heights of a ball between their corners are then at most 0.3 %
/// too large: `heights_are_bounds_and_close` pins that.
pub(super) const CELLS: usize = 16;

/// Corners along each edge of a face.
pub(super) const CORNERS: usize = CELLS + 1;

/// The corners face by face and row by row, each with its largest component 1.
pub(super) fn corners() -> impl Iterator<Item = Vector3<f64>> {
    (0..6 * CORNERS * CORNERS).map(|index| {
        let (face, place) = (index / (CORNERS * CORNERS), index % (CORNERS * CORNERS));
        on_face(face, 2 * (place / CORNERS), 2 * (place % CORNERS))
    })
}

/// The middle of a cell of a face, with its largest component 1.
pub(super) fn middle(face: usize, i: usize, j: usize) -> Vector3<f64> {
    on_face(face, 2 * i + 1, 2 * j + 1)
}

/// The point of a face at these multiples of half a cell.
fn on_face(face: usize, i: usize, j: usize) -> Vector3<f64> {
    let across = |halves: usize| halves as f64 / CELLS as f64 - 1.0;
    let mut point = Vector3::zeros();
    point[face / 2] = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    point[(face / 2 + 1) % 3] = across(i);
    point[(face / 2 + 2) % 3] = across(j);
    point
}

/// Which corner of a face that is, of all.
pub(super) fn corner(face: usize, i: usize, j: usize) -> usize {
    (face * CORNERS + i) * CORNERS + j
}

/// The number of the cell of a direction of any length, face by face and row by row.
#[inline(always)]
pub(super) fn cell<S: Simd, N: Number<S>>(simd: S, [x, y, z]: [N; 3]) -> N {
    let splat = |value: f64| N::splat(simd, value);
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    let (on_x, on_y) = (N::and(simd, ay.le(ax), az.le(ax)), az.le(ay));
    let along = x.select(on_x, y.select(on_y, z));
    let first = y.select(on_x, z.select(on_y, x));
    let second = z.select(on_x, x.select(on_y, y));
    let axis = splat(0.0).select(on_x, splat(2.0).select(on_y, splat(4.0)));
    let face = axis + splat(0.0).select(splat(0.0).le(along), splat(1.0));
    let half = splat(0.5 * CELLS as f64);
    let scale = half / along.abs();
    let (i, j) = (row(simd, first, scale), row(simd, second, scale));
    let cells = splat(CELLS as f64);
    face.mul_add(cells, i).mul_add(cells, j)
}

/// Which cell along one edge of a face.
#[inline(always)]
fn row<S: Simd, N: Number<S>>(simd: S, across: N, scale: N) -> N {
    // Adding so much leaves no room for fractions; which side ties go to is of no matter.
    let whole = N::splat(simd, 1.5 / N::EPSILON);
    let rounded = (across.mul_add(scale, N::splat(simd, 0.5 * CELLS as f64 - 0.5)) + whole) - whole;
    rounded.max(N::splat(simd, 0.0)).min(N::splat(simd, CELLS as f64 - 1.0))
}

/// Values at all corners, interpolated linearly on the two triangles of the cell of a direction, in
/// proportion to its length: what is sublinear in the direction is nowhere larger.
#[inline(always)]
pub(super) fn interpolated(values: &[f64], e: &Vector3<f64>) -> f64 {
    let [x, y, z] = [e.x.abs(), e.y.abs(), e.z.abs()];
    let axis = if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    };
    let [along, first, second] = match axis {
        0 => [e.x, e.y, e.z],
        1 => [e.y, e.z, e.x],
        _ => [e.z, e.x, e.y],
    };
    let half = 0.5 * CELLS as f64;
    let scale = half / along.abs();
    // Not `clamp`: what is not a number has to end somewhere.
    let place = |across: f64| (across * scale + half).max(0.0).min(CELLS as f64);
    let (u, v) = (place(first), place(second));
    let (i, j) = ((u as usize).min(CELLS - 1), (v as usize).min(CELLS - 1));
    let (u, v) = (u - i as f64, v - j as f64);
    let row = corner(2 * axis + usize::from(along < 0.0), i, j);
    let [near, far] = [values[row], values[row + CORNERS + 1]];
    let value = if u > v {
        let middle = values[row + CORNERS];
        near + u * (middle - near) + v * (far - middle)
    } else {
        let middle = values[row + 1];
        near + v * (middle - near) + u * (far - middle)
    };
    value * along.abs()
}
