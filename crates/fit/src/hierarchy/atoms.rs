//! Points of a measure from its moments.
//!
//! With `M_{d-1} = Q Λ Qᵀ` the moment matrix of degree d - 1, of rank r, and `W = Q Λ^{-1/2}`, the
//! matrices `A_k = Wᵀ y(z_k b bᵀ) W`, b the monomials up to degree d - 1, are those of
//! multiplication by z_k: symmetric, and diagonal in one basis q, in which `z_k = qᵀ A_k q` are the
//! coordinates of the points (Klep, Povh and Volčič, SIAM J. Optim. 28, 2018).
//!
//! An interior-point method ends at moments of the largest rank, so that all minimisers are common
//! zeros of the polynomials in the kernel of `M_d` (Henrion and Lasserre, LNCIS 312, 2005), and
//! with them of their products with coordinates. Where what these leave of the polynomials of
//! degree d has the dimension r that it has for degree d - 1, there are at most r zeros (Curto and
//! Fialkow; Mourrain, AAECC 13, 1999): all minimisers, if r are found. Elsewhere the points are
//! guesses.

use nalgebra::{DMatrix, Vector3};
use sublevel_core::polynomial::{Exponents, monomials, position};

/// Eigenvalues of a moment matrix below this share of the largest count as zero: what is zero comes
/// out below 1e-4, and two points 1/10 of the coordinates apart give 2.5e-3.
const RANK: f64 = 3e-4;

/// Singular values of parts of orthonormal matrices below this count as zero.
const PART: f64 = 1e-2;

/// Factors of the coordinates whose weighted sum differs from point to point.
const MIXED: [f64; 3] = [0.537_667_1, 0.733_885_0, 0.415_846_9];

/// Points of a measure.
#[derive(Clone, Debug)]
pub(super) struct Atoms {
    /// The points, in the coordinates of the moments.
    pub(super) points: Vec<Vector3<f64>>,
    /// Whether there are no more minimisers than points.
    pub(super) is_flat: bool,
    /// Whether the other point is an affine function of this one on the measure: the rank of the
    /// moments of degree 1 of both is that of this point alone.
    pub(super) determines_other: bool,
}

fn product(a: Exponents, b: Exponents) -> Exponents {
    std::array::from_fn(|k| a[k] + b[k])
}

/// The points of a measure, from its moments up to degree `2 degree`.
pub(super) fn atoms(degree: usize, moment: impl Fn(Exponents) -> f64) -> Atoms {
    let matrix = |degree: usize, factor: Exponents| {
        let basis = monomials(degree);
        DMatrix::from_fn(basis.len(), basis.len(), |i, j| moment(product(product(basis[i], basis[j]), factor)))
    };
    let none = Atoms { points: Vec::new(), is_flat: false, determines_other: false };
    let Some(lower) = degree.checked_sub(1) else { return none };
    let (small, whole) = (matrix(lower, [0; 3]), matrix(degree, [0; 3]));
    if !whole.iter().all(|value| value.is_finite()) {
        return none;
    }
    let eigen = small.symmetric_eigen();
    let kept = above(eigen.eigenvalues.as_slice());
    if kept.is_empty() {
        return none;
    }
    let whitened = DMatrix::from_fn(eigen.eigenvectors.nrows(), kept.len(), |i, k| {
        eigen.eigenvectors[(i, kept[k])] / eigen.eigenvalues[kept[k]].sqrt()
    });
    let multiplied: [DMatrix<f64>; 3] = std::array::from_fn(|k| {
        let unit = std::array::from_fn(|i| u8::from(i == k));
        whitened.transpose() * matrix(lower, unit) * &whitened
    });
    let mixed = (0..3).fold(DMatrix::zeros(kept.len(), kept.len()), |sum, k| sum + &multiplied[k] * MIXED[k]);
    let vectors = mixed.symmetric_eigen().eigenvectors;
    let points = vectors.column_iter().map(|q| Vector3::from_fn(|k, _| q.dot(&(&multiplied[k] * q))));
    let points = points.collect();
    Atoms { points, is_flat: zeros(degree, whole) == Some(kept.len()), determines_other: false }
}

/// How many common zeros the polynomials in the kernel of a moment matrix have at most, if what
/// they leave of the polynomials of its degree says so.
fn zeros(degree: usize, moments: DMatrix<f64>) -> Option<usize> {
    let basis = monomials(degree);
    let lower = monomials(degree - 1).len();
    let eigen = moments.symmetric_eigen();
    let mut rest = eigen.eigenvectors.select_columns(&above(eigen.eigenvalues.as_slice()));
    while rest.ncols() > 0 {
        // Polynomials of a degree less in the kernel, times each coordinate.
        let part = rest.rows(0, lower).into_owned();
        let kernel = null_space(&part.transpose());
        let mut products = DMatrix::zeros(basis.len(), 3 * kernel.ncols());
        for (column, polynomial) in kernel.column_iter().enumerate() {
            for (row, &exponents) in basis[..lower].iter().enumerate() {
                for axis in 0..3 {
                    let higher = product(exponents, std::array::from_fn(|i| u8::from(i == axis)));
                    products[(position(higher), 3 * column + axis)] = polynomial[row];
                }
            }
        }
        let kept = null_space(&(products.transpose() * &rest));
        if kept.ncols() == rest.ncols() {
            return (lower - kernel.ncols() == rest.ncols()).then_some(rest.ncols());
        }
        rest *= kept;
    }
    None
}

/// An orthonormal basis of the vectors that a matrix maps to about zero.
fn null_space(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = (matrix.transpose() * matrix).symmetric_eigen();
    let small: Vec<usize> = (0..matrix.ncols()).filter(|&i| eigen.eigenvalues[i] < PART * PART).collect();
    eigen.eigenvectors.select_columns(&small)
}

/// Rank of a matrix of moments.
pub(super) fn rank(matrix: DMatrix<f64>) -> usize {
    above(matrix.symmetric_eigenvalues().as_slice()).len()
}

/// Which eigenvalues do not count as zero.
fn above(eigenvalues: &[f64]) -> Vec<usize> {
    let most = eigenvalues.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    (0..eigenvalues.len()).filter(|&i| eigenvalues[i] > RANK * most).collect()
}

#[cfg(test)]
mod tests {
    use super::atoms;
    use nalgebra::Vector3;
    use sublevel_core::polynomial::Exponents;
    use sublevel_testkit::Seeded;

    fn power(z: &Vector3<f64>, e: Exponents) -> f64 {
        (0..3).map(|k| z[k].powi(i32::from(e[k]))).product()
    }

    /// Up to four points in general position are found from moments of degree 4, with noise as of a
    /// solver; more than four are not called all.
    #[test]
    fn points_come_back_from_their_moments() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let count = 1 + (seed % 6) as usize;
            let points: Vec<_> = (0..count).map(|_| Vector3::from_fn(|_, _| random.signed())).collect();
            let weights: Vec<_> = points.iter().map(|_| 0.5 + random.positive()).collect();
            let total: f64 = weights.iter().sum();
            let noise: Vec<f64> = (0..125).map(|_| 1e-9 * random.signed()).collect();
            let found = atoms(2, |e| {
                let sum: f64 = points.iter().zip(&weights).map(|(z, weight)| weight / total * power(z, e)).sum();
                sum + noise[usize::from(e[0]) * 25 + usize::from(e[1]) * 5 + usize::from(e[2])]
            });
            println!("seed {seed}: {points:?} {found:?}");
            if count > 4 {
                assert!(!found.is_flat, "seed {seed}");
                continue;
            }
            // Points that nearly lie in a plane with others give a smaller rank, and say so.
            if found.is_flat {
                assert_eq!(found.points.len(), count, "seed {seed}");
                for point in &points {
                    let nearest = found.points.iter().map(|z| (z - point).norm()).fold(f64::INFINITY, f64::min);
                    assert!(nearest < 1e-4, "seed {seed}: {nearest}");
                }
            }
            assert!(count > 2 || found.is_flat, "seed {seed}");
        }
    }

    /// A circle has no finite number of points.
    #[test]
    fn a_circle_is_not_flat() {
        let on_circle = |e: Exponents| {
            let angles = (0..64).map(|k| std::f64::consts::TAU * f64::from(k) / 64.0);
            angles.map(|t| power(&Vector3::new(t.cos(), t.sin(), 0.2), e)).sum::<f64>() / 64.0
        };
        assert!((1..=3).all(|degree| !atoms(degree, on_circle).is_flat));
        // What no measure has.
        for value in [f64::NAN, 0.0, -1.0] {
            let nowhere = atoms(2, |_| value);
            assert!(nowhere.points.is_empty() && !nowhere.is_flat);
        }
        // Kernels that leave nothing: z1 is zero, and its square is not.
        let torn = atoms(2, |e| if e == [0; 3] { 1.0 } else { f64::from(u8::from(e == [4, 0, 0])) });
        assert!(torn.points.len() == 1, "{torn:?}");
        assert!(!atoms(0, |_| 1.0).is_flat);
    }
}
