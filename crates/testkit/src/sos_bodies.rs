//! Sets that need not be convex, as sums of squares with known shapes.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3, Vector3};
use sublevel_core::body::{Normalization, SosBody};
use sublevel_core::polynomial::{Exponents, Polynomial, SosGram, monomials};

/// Terms of a polynomial that is squared.
type Terms = BTreeMap<Exponents, f64>;

/// Weight of the squares of all monomials, which make the Gram matrix definite.
const DEFINITE: f64 = 1e-10;

/// The torus about the unit circle in the plane z = 0 with tube radius r: `(|v|² - 1 - r²)² + 4 z²
/// <= 4 r²`, hardly smaller.
pub fn torus(r: f64) -> SosBody {
    let norm = Terms::from([([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0; 3], -1.0 - r * r)]);
    let height = Terms::from([([0, 0, 1], 2.0)]);
    sum_of_squares("torus", &[norm, height], 4.0 * r * r)
}

/// `Σ squares <= level` for polynomials of degree 2 at most.
fn sum_of_squares(name: &str, squares: &[Terms], level: f64) -> SosBody {
    let basis = monomials(2);
    let mut matrix = DMatrix::identity(basis.len(), basis.len()) * DEFINITE;
    for square in squares {
        let column = DMatrix::from_fn(basis.len(), 1, |i, _| square.get(&basis[i]).copied().unwrap_or(0.0));
        matrix += &column * column.transpose();
    }
    matrix /= level;
    let mut terms = Terms::new();
    for (i, a) in basis.iter().enumerate() {
        for (j, b) in basis.iter().enumerate() {
            *terms.entry(std::array::from_fn(|k| a[k] + b[k])).or_default() += matrix[(i, j)];
        }
    }
    let polynomial = Polynomial::new(terms.into_iter().collect()).unwrap();
    let gram = SosGram::nearest(&polynomial, basis, (&matrix + matrix.transpose()) * 0.5).unwrap();
    let normalization = Normalization { center: Vector3::zeros(), linear: Matrix3::identity() };
    SosBody::new(name, normalization, polynomial, gram, None).unwrap()
}
