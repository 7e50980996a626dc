//! The bases of the two Gram matrices in another affine frame.

use super::objective::Matrix;
use super::structure::Structure;
use nalgebra::{DMatrix, Matrix3, Vector3};
use sublevel_core::polynomial::{Exponents, monomials};

/// An affine map `u = linear z + offset` from the whitened frame (z) to another (u).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine {
    pub(super) linear: Matrix3<f64>,
    pub(super) offset: Vector3<f64>,
}

/// T with `b(u) = T b(z)` for the basis b of the matrix: a Gram matrix Q in the other frame is
/// `TᵀQT` in the whitened one, and a moment matrix M of the whitened frame is `TMTᵀ` in the other.
/// Size: basis x basis.
pub(super) fn change(structure: &Structure, matrix: Matrix, map: &Affine) -> DMatrix<f64> {
    match matrix {
        Matrix::Polynomial => of_monomials(structure.degree / 2, map),
        Matrix::Hessian => {
            // y, the direction of differentiation, moves with the linear part
            let plain = of_monomials(structure.degree / 2 - 1, map);
            let order = monomials(structure.degree / 2 - 1);
            let basis = &structure.hessian_basis;
            let index = |e: Exponents| order.iter().position(|&m| m == e).unwrap_or_default();
            DMatrix::from_fn(basis.len(), basis.len(), |i, j| {
                let (row, column) = (&basis[i], &basis[j]);
                map.linear[(usize::from(row.direction), usize::from(column.direction))]
                    * plain[(index(row.exponents), index(column.exponents))]
            })
        }
    }
}

/// Coefficients of the monomials of u, one row each, as polynomials of z.
pub(super) fn of_monomials(degree: usize, map: &Affine) -> DMatrix<f64> {
    let order = monomials(degree);
    let position = |e: Exponents| order.iter().position(|&m| m == e);
    let mut change = DMatrix::zeros(order.len(), order.len());
    for (row, &exponents) in order.iter().enumerate() {
        let Some(axis) = (0..3).find(|&i| exponents[i] > 0) else {
            change[(row, row)] = 1.0;
            continue;
        };
        // One factor u_axis times a monomial of one degree less, whose row is there already.
        let mut lower = exponents;
        lower[axis] -= 1;
        let Some(previous) = position(lower) else { continue };
        for (column, &known) in order.iter().enumerate() {
            let coefficient = change[(previous, column)];
            if coefficient == 0.0 {
                continue;
            }
            change[(row, column)] += coefficient * map.offset[axis];
            for k in 0..3 {
                let mut higher = known;
                higher[k] += 1;
                if let Some(target) = position(higher) {
                    change[(row, target)] += coefficient * map.linear[(axis, k)];
                }
            }
        }
    }
    change
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn bases_are_those_of_the_mapped_point() {
        let map = Affine {
            linear: Matrix3::new(2.0, 0.3, -0.1, 0.0, 0.5, -0.2, 0.1, 0.7, 4.0),
            offset: Vector3::new(0.3, -1.0, 0.2),
        };
        let (z, y) = (Vector3::new(0.4, -0.7, 0.9), Vector3::new(-1.0, 0.2, 0.6));
        let (u, v) = (map.linear * z + map.offset, map.linear * y);
        for degree in [2, 4, 6, 8] {
            let structure = Structure::new(degree);
            let power = |x: &Vector3<f64>, e: &Exponents| (0..3).map(|i| x[i].powi(e[i].into())).product::<f64>();
            let monomials = monomials(degree / 2);
            let plain = |x| DVector::from_iterator(monomials.len(), monomials.iter().map(|e| power(x, e)));
            let basis = &structure.hessian_basis;
            let form = |x, y: &Vector3<f64>| {
                let values = basis.iter().map(|b| y[usize::from(b.direction)] * power(x, &b.exponents));
                DVector::from_iterator(basis.len(), values)
            };
            let error = plain(&u) - change(&structure, Matrix::Polynomial, &map) * plain(&z);
            assert!(error.amax() < 1e-11, "degree {degree}: {}", error.amax());
            let error = form(&u, &v) - change(&structure, Matrix::Hessian, &map) * form(&z, &y);
            assert!(error.amax() < 1e-11, "degree {degree}: {}", error.amax());
        }
    }
}
