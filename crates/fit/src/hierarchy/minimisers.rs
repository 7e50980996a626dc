//! Which points that were found are the minimisers.

use super::atoms::Atoms;
use nalgebra::Vector3;

/// Points that agree to this share of the size of the sets are one: a search that ends where the
/// objective is within 1e-5 of its minimum may be as far off as the root of that.
const APART: f64 = 1e-2;

fn agree<const N: usize>(a: &[Vector3<f64>; N], b: &[Vector3<f64>; N], size: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).norm() <= APART * size)
}

/// Points, one of each set, whose values are at most `most`, the lowest first, without those that
/// agree with a lower one.
pub(super) fn attaining<const N: usize>(
    found: &[(f64, [Vector3<f64>; N])],
    most: f64,
    size: f64,
) -> Vec<[Vector3<f64>; N]> {
    let mut minimisers: Vec<[Vector3<f64>; N]> = Vec::new();
    for (_, points) in found.iter().filter(|found| found.0 <= most) {
        if !minimisers.iter().any(|known| agree(known, points, size)) {
            minimisers.push(*points);
        }
    }
    minimisers
}

/// Whether the minimisers are those that moments are of: one for each point of a set that
/// determines the other point, or points of both sets that are all in minimisers.
pub(super) fn are_all<const N: usize>(minimisers: &[[Vector3<f64>; N]], atoms: &[Atoms], size: f64) -> bool {
    let matches = |(side, atoms): (usize, &Atoms)| {
        let mut points: Vec<[Vector3<f64>; 1]> = Vec::new();
        for minimiser in minimisers {
            let point = [minimiser[side]];
            if !points.iter().any(|known| agree(known, &point, size)) {
                points.push(point);
            }
        }
        let found = |atom: &Vector3<f64>| points.iter().any(|point| agree(point, &[*atom], size));
        atoms.is_flat && points.len() == atoms.points.len() && atoms.points.iter().all(found)
    };
    let determines = |(side, atoms): (usize, &Atoms)| {
        atoms.determines_other && atoms.points.len() == minimisers.len() && matches((side, atoms))
    };
    let mut sides = atoms.iter().enumerate();
    !minimisers.is_empty() && (sides.clone().any(determines) || sides.all(matches))
}
