//! Proof that one polynomial is at most 1 wherever some others are: multipliers and a sum of
//! squares.
//!
//! If, as polynomials of v in R³,
//!
//! ```text
//! 1 - p(A v + a) - Σ_j τ_j(v) (1 - g_j(B v + b)) = σ(v),   σ = mᵀ Q m,  τ_j = m_jᵀ T_j m_j,
//! ```
//!
//! m and m_j being all monomials up to some degree, `T_j ⪰ 0` and `Q ⪰ 0`, then p <= 1 at the image
//! of every v at which all `g_j <= 1` at theirs; < 1 if `Q ≻ 0`. (Putinar, Indiana Univ. Math. J.
//! 42, 1993, has the converse for p < 1: with multipliers of high enough degree there is such an
//! identity, one of the g_j being a ball around the set.)
//!
//! Both affine maps, and with them the coefficients of the left side, are known to intervals only.
//! With r_β a bound of what the matrices in floating point miss of monomial β, over all maps
//! within, and n_β the number of positions of Q that produce β, `λ_min(Q) >= δ = √(Σ r_β²/n_β)`
//! makes up for it, whatever the exact maps are (Peyrl and Parrilo, Theoret. Comput. Sci. 409,
//! 2008). Nothing is assumed of the sets: neither convex nor bounded need they be.

use super::interval::Interval;
use super::monomial::{count, monomials, position};
use super::verified_cholesky::is_positive_definite_above;
use super::{Margin, Polynomial, Substitution};
use nalgebra::DMatrix;

/// Highest degree of the monomials of a Gram matrix.
const HIGHEST: usize = 6;

/// The Gram matrices of such an identity, on all monomials up to the degree that their size says
/// (1, 4, 10, 20, 35, 56, 84).
#[derive(Clone, Debug, PartialEq)]
pub struct ContainmentProof {
    multipliers: Vec<DMatrix<f64>>,
    rest: DMatrix<f64>,
}

/// Polynomials and the map from the proof's frame to theirs.
#[derive(Clone, Copy, Debug)]
pub struct Substituted<'a> {
    /// The polynomials, each of its own normalized coordinates.
    pub polynomials: &'a [&'a Polynomial],
    /// Where these come from.
    pub map: &'a Substitution,
}

/// Why a proof of containment proves nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotContaining {
    /// A matrix or their number is malformed.
    #[error("the proof is malformed: {0}")]
    Malformed(String),
    /// The frame of the proof does not reach all points.
    #[error("the frame of the proof is not proven to span the space; its axes must be linearly independent")]
    Frame,
    /// A multiplier is not proven nonnegative.
    #[error(
        "multiplier {index} is not proven a sum of squares (smallest eigenvalue about {smallest_eigenvalue:.3e}); use one \
         farther from singular"
    )]
    Multiplier {
        /// Which one, of the set's constraint with that index.
        index: usize,
        /// Smallest eigenvalue, computed without proof.
        smallest_eigenvalue: f64,
    },
    /// What the multipliers leave is not proven a sum of squares.
    #[error(
        "what the multipliers leave is not proven a sum of squares: smallest eigenvalue about {smallest_eigenvalue:.3e}, \
         residual {residual:.3e}; the polynomials or the proof were changed, or it was lost in rounding"
    )]
    NotDefinite {
        /// Bound δ of the correction.
        residual: f64,
        /// Smallest eigenvalue, computed without proof.
        smallest_eigenvalue: f64,
    },
}

impl ContainmentProof {
    /// A proof of these multipliers, one per constraint of the set, and the sum of squares that is
    /// left.
    ///
    /// # Errors
    /// [`NotContaining::Malformed`]: a matrix that is not square, symmetric, finite and of one of
    /// the sizes.
    pub fn new(multipliers: Vec<DMatrix<f64>>, rest: DMatrix<f64>) -> Result<Self, NotContaining> {
        multipliers.iter().chain([&rest]).try_for_each(check)?;
        Ok(Self { multipliers, rest })
    }

    /// The proof of the same multipliers with the matrix Q closest to `rest` that satisfies the
    /// identity up to rounding.
    ///
    /// # Errors
    /// [`NotContaining::Malformed`]: also when a product is of a higher degree than the squares.
    pub fn nearest(
        polynomial: &Polynomial,
        map: &Substitution,
        set: Substituted,
        multipliers: Vec<DMatrix<f64>>,
        rest: DMatrix<f64>,
    ) -> Result<Self, NotContaining> {
        let mut proof = Self::new(multipliers, rest)?;
        let residuals = proof.residuals(polynomial, map, set)?;
        let places = places(proof.rest.nrows());
        let order = monomials(half_degree(proof.rest.nrows()).unwrap_or_default());
        for (i, a) in order.iter().enumerate() {
            for (j, b) in order.iter().enumerate() {
                let key = position(std::array::from_fn(|k| a[k] + b[k]));
                proof.rest[(i, j)] += residuals[key].middle() / places[key];
            }
        }
        Ok(proof)
    }

    /// Gram matrices of the multipliers, one per constraint of the set.
    pub fn multipliers(&self) -> &[DMatrix<f64>] {
        &self.multipliers
    }

    /// Gram matrix Q of what they leave.
    pub fn rest(&self) -> &DMatrix<f64> {
        &self.rest
    }

    /// Proves `p(map) < 1` wherever all polynomials of the set are at most 1.
    ///
    /// # Errors
    /// What is missing for a proof, and by how much.
    pub fn prove(
        &self,
        polynomial: &Polynomial,
        map: &Substitution,
        set: Substituted,
    ) -> Result<Margin, NotContaining> {
        if !map.is_invertible() {
            return Err(NotContaining::Frame);
        }
        let smallest = |matrix: &DMatrix<f64>| matrix.symmetric_eigenvalues().min();
        for (index, multiplier) in self.multipliers.iter().enumerate() {
            if !is_positive_definite_above(multiplier, 0.0) {
                return Err(NotContaining::Multiplier { index, smallest_eigenvalue: smallest(multiplier) });
            }
        }
        let residuals = self.residuals(polynomial, map, set)?;
        // Above zero: squares of tiny residuals may underflow.
        let squares = residuals
            .iter()
            .zip(places(self.rest.nrows()))
            .fold(f64::MIN_POSITIVE, |sum, (r, places)| sum + r.magnitude() * r.magnitude() / places);
        // Fewer than 2^12 roundings in the sum and root.
        let residual = (squares.sqrt() * (1.0 + 1e-12)).next_up();
        if is_positive_definite_above(&self.rest, residual) {
            Ok(Margin { residual })
        } else {
            Err(NotContaining::NotDefinite { residual, smallest_eigenvalue: smallest(&self.rest) })
        }
    }

    /// Left side of the identity minus its right side.
    fn residuals(
        &self,
        polynomial: &Polynomial,
        map: &Substitution,
        set: Substituted,
    ) -> Result<Vec<Interval>, NotContaining> {
        let malformed = |why: String| Err(NotContaining::Malformed(why));
        if set.polynomials.len() != self.multipliers.len() {
            let (found, needed) = (self.multipliers.len(), set.polynomials.len());
            return malformed(format!("it has {found} multipliers for {needed} constraints; one is needed for each"));
        }
        let highest = 2 * half_degree(self.rest.nrows()).unwrap_or_default();
        let mut sum = collapse(&self.rest).into_iter().map(|coefficient| -coefficient).collect::<Vec<_>>();
        sum[0] = sum[0] + Interval::of(1.0);
        if polynomial.degree() > highest {
            return malformed(format!(
                "its squares are of degree {highest}, its polynomial is of {}",
                polynomial.degree()
            ));
        }
        for (sum, coefficient) in sum.iter_mut().zip(map.apply(polynomial)) {
            *sum = *sum - coefficient;
        }
        for (multiplier, constraint) in self.multipliers.iter().zip(set.polynomials) {
            let degree = 2 * half_degree(multiplier.nrows()).unwrap_or_default() + constraint.degree();
            if degree > highest {
                return malformed(format!("its squares are of degree {highest}, a product is of {degree}"));
            }
            let mut slack: Vec<_> = set.map.apply(constraint).into_iter().map(|coefficient| -coefficient).collect();
            slack[0] = slack[0] + Interval::of(1.0);
            subtract_product(&mut sum, &collapse(multiplier), &slack);
        }
        Ok(sum)
    }
}

/// Subtracts the product of two polynomials.
fn subtract_product(sum: &mut [Interval], left: &[Interval], right: &[Interval]) {
    let order = monomials(2 * HIGHEST);
    for (&a, e) in left.iter().zip(&order) {
        for (&b, f) in right.iter().zip(&order) {
            let place = position(std::array::from_fn(|k| e[k] + f[k]));
            sum[place] = sum[place] - a * b;
        }
    }
}

/// Coefficients of the polynomial of a Gram matrix.
fn collapse(gram: &DMatrix<f64>) -> Vec<Interval> {
    let half = half_degree(gram.nrows()).unwrap_or_default();
    let order = monomials(half);
    let mut sum = vec![Interval::ZERO; count(2 * half)];
    for (i, a) in order.iter().enumerate() {
        for (j, b) in order.iter().enumerate() {
            let place = position(std::array::from_fn(|k| a[k] + b[k]));
            sum[place] = sum[place] + Interval::of(gram[(i, j)]);
        }
    }
    sum
}

/// How many positions of a Gram matrix of that size produce each monomial.
fn places(size: usize) -> Vec<f64> {
    collapse(&DMatrix::repeat(size, size, 1.0)).into_iter().map(|number| number.middle().round()).collect()
}

/// Degree of the monomials of a Gram matrix of that size.
fn half_degree(size: usize) -> Option<usize> {
    (0..=HIGHEST).find(|&degree| count(degree) == size)
}

fn check(matrix: &DMatrix<f64>) -> Result<(), NotContaining> {
    let malformed = |why: String| Err(NotContaining::Malformed(why));
    let n = matrix.nrows();
    if matrix.ncols() != n || half_degree(n).is_none() {
        let (rows, columns) = matrix.shape();
        return malformed(format!(
            "a matrix is {rows}x{columns}; 1, 4, 10, 20, 35, 56 or 84 rows and columns are possible"
        ));
    }
    for i in 0..n {
        for j in 0..=i {
            if !matrix[(i, j)].is_finite() || matrix[(i, j)] != matrix[(j, i)] {
                return malformed(format!("matrix entries ({i}, {j}) and ({j}, {i}) are not finite and equal"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polynomial::Exponents;
    use dashu_ratio::RBig;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    fn identity() -> Substitution {
        Substitution::new(&Matrix3::identity(), &Vector3::zeros(), &Matrix3::identity(), &Vector3::zeros())
    }

    /// `factor |z|²`.
    fn ball(factor: f64) -> Polynomial {
        Polynomial::new((0..3).map(|i| (std::array::from_fn(|k| if k == i { 2 } else { 0 }), factor)).collect())
            .unwrap()
    }

    fn prove(proof: &ContainmentProof, p: &Polynomial, g: &[&Polynomial]) -> Result<Margin, NotContaining> {
        let map = identity();
        proof.prove(p, &map, Substituted { polynomials: g, map: &map })
    }

    #[test]
    fn a_ball_in_a_ball() {
        // 1 - |v|²/4 = ½ (1 - |v|²) + ½ + ¼ |v|²
        let rest = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![0.5, 0.25, 0.25, 0.25]));
        let half = DMatrix::from_element(1, 1, 0.5);
        let proof = ContainmentProof::new(vec![half], rest.clone()).unwrap();
        let (inner, outer) = (ball(1.0), ball(0.25));
        // All numbers are exact: what is left are the last digits of the bounds.
        let residual = prove(&proof, &outer, &[&inner]).unwrap().residual;
        assert!(residual < 1e-14, "{residual}");
        // A smaller ball outside than inside, and a larger one inside than outside.
        assert!(matches!(prove(&proof, &ball(1.01), &[&inner]), Err(NotContaining::NotDefinite { .. })));
        assert!(prove(&proof, &outer, &[&ball(0.24)]).is_err());
        // Multipliers of the wrong sign, number and degree.
        let negative = ContainmentProof::new(vec![DMatrix::from_element(1, 1, -0.5)], rest.clone()).unwrap();
        assert!(matches!(prove(&negative, &outer, &[&inner]), Err(NotContaining::Multiplier { index: 0, .. })));
        assert!(matches!(prove(&proof, &outer, &[&inner, &inner]), Err(NotContaining::Malformed(_))));
        let high = ContainmentProof::new(vec![DMatrix::identity(4, 4)], rest).unwrap();
        assert!(matches!(prove(&high, &outer, &[&inner]), Err(NotContaining::Malformed(_))));
        for bad in [DMatrix::identity(3, 3), DMatrix::from_element(1, 1, f64::NAN), DMatrix::zeros(1, 4)] {
            assert!(matches!(ContainmentProof::new(vec![], bad), Err(NotContaining::Malformed(_))));
        }
    }

    fn exact(value: f64) -> RBig {
        RBig::try_from(value).unwrap()
    }

    /// `Σ G_ij m_i m_j` by monomial.
    fn of_gram(gram: &DMatrix<f64>, degree: usize) -> Vec<RBig> {
        let order = monomials(degree / 2);
        let mut sum = vec![RBig::ZERO; count(degree)];
        for (i, a) in order.iter().enumerate() {
            for (j, b) in order.iter().enumerate() {
                sum[position(std::array::from_fn(|k| a[k] + b[k]))] += exact(gram[(i, j)]);
            }
        }
        sum
    }

    fn definite(random: &mut Seeded, size: usize) -> DMatrix<f64> {
        let root = DMatrix::from_fn(size, size, |_, _| random.signed());
        let square = &root * root.transpose() + DMatrix::identity(size, size) * 1e-6;
        (&square + square.transpose()) * 0.5
    }

    #[test]
    fn residuals_are_no_smaller_than_exact_ones_and_proofs_are_true() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let (rest, multiplier) = (definite(&mut random, 10), definite(&mut random, 4));
            let g = Polynomial::new(monomials(2).into_iter().map(|e| (e, random.signed())).collect()).unwrap();
            // p = 1 - τ (1 - g) - σ, its coefficients rounded.
            let mut p: Vec<RBig> = of_gram(&rest, 4).into_iter().map(|c| -c).collect();
            p[0] += RBig::ONE;
            let slack: Vec<(Exponents, RBig)> = g.terms().iter().map(|&(e, c)| (e, -exact(c))).collect();
            for (tau, e) in of_gram(&multiplier, 2).iter().zip(monomials(2)) {
                p[position(e)] -= tau;
                for (f, c) in &slack {
                    p[position(std::array::from_fn(|k| e[k] + f[k]))] -= tau * c;
                }
            }
            let rounded: Vec<f64> = p.iter().map(|c| c.to_f64().value()).collect();
            let terms: Vec<_> = monomials(4).into_iter().zip(rounded.iter().copied()).collect();
            let polynomial = Polynomial::new(terms).unwrap();
            let proof = ContainmentProof::new(vec![multiplier], rest).unwrap();
            let residual = prove(&proof, &polynomial, &[&g]).unwrap_or_else(|e| panic!("seed {seed}: {e}")).residual;
            let square = p.iter().zip(&rounded).zip(places(10)).fold(RBig::ZERO, |sum, ((p, &c), places)| {
                let missing = p - exact(c);
                sum + &missing * &missing / exact(places)
            });
            assert!(exact(residual) * exact(residual) >= square, "seed {seed}");
            assert!(residual < 1e-11, "seed {seed}: {residual}");
            // Lifted to touch 1 somewhere on the set, p has no proof.
            let points = (0..4000).map(|_| Vector3::from_fn(|_, _| 3.0 * random.signed()));
            let on_set = points.filter(|v| g.evaluate(v).value < 1.0 - 1e-9);
            let highest = on_set.map(|v| polynomial.evaluate(&v).value).fold(f64::MIN, f64::max);
            let lifted = polynomial.with_constant_shifted(1.0 - highest + 1e-9);
            assert!(prove(&proof, &lifted, &[&g]).is_err(), "seed {seed}");
        }
    }
}
