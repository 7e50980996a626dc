//! A certificate for a polynomial from elsewhere: a definite Gram matrix of its Hessian form, if
//! there is one.
//!
//! Of all Gram matrices H of the form f, `A(H) = f`, the one with the largest smallest eigenvalue
//! is the easiest to prove (`margin_program`). A functional on the form with a definite moment
//! matrix bounds that eigenvalue from above, and where the bound is negative there is no
//! certificate.
//!
//! A square that only one product of the basis gives and that is missing in f rules that element of
//! the basis out, as those of sparse forms: of `z^4` only `y z` is left.

use super::localizing::LocalizingMatrix;
use super::margin_program::{Margin, largest_margin};
use super::structure::{Pattern, Structure};
use super::unsolved::ProgramError;
use nalgebra::{DVector, Vector3};
use sublevel_core::body::sphere_rule;
use sublevel_core::polynomial::{CertificateError, Exponents, HessianGram, HessianMonomial, Polynomial};

/// Bound of the smallest eigenvalue, relative to the largest coefficient, below which a polynomial
/// is called barely sos-convex, and above whose negative it is not called anything else;
/// dimensionless.
///
/// The residual of a proof in double precision is about 1e-15 of the coefficients. It decides only
/// what an error says, and no test fixes it.
const LEAST_PROVABLE_EIGENVALUE: f64 = 1e-14;

/// Why a polynomial has no certificate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoCertificate {
    /// A term bends the polynomial downwards somewhere, and no square of the Hessian form makes up
    /// for it.
    #[error("the polynomial is not convex: nothing in it outweighs its term with exponents {0:?} in all directions")]
    NoSquare(Exponents),
    /// It is not sos-convex.
    #[error(
        "the polynomial is not sos-convex: every Gram matrix of its Hessian form has an eigenvalue of {bound:.1e} or less, relative \
         to the largest coefficient; fit a body to points of the set instead"
    )]
    NotSosConvex {
        /// Upper bound of the smallest eigenvalue of any Gram matrix, relative to the form's
        /// largest coefficient.
        bound: f64,
    },
    /// Its Gram matrices are all but singular.
    #[error(
        "the polynomial is at best barely sos-convex: no Gram matrix of its Hessian form has all eigenvalues above {bound:.1e}, \
         relative to the largest coefficient, which rounding does not leave provable; add a small multiple of |z|^2"
    )]
    Singular {
        /// Upper bound of the smallest eigenvalue of any Gram matrix, relative to the form's
        /// largest coefficient.
        bound: f64,
    },
    /// The search failed.
    #[error(
        "clarabel did not solve the program of a certificate of degree {degree}: {why}; fit a body to points of the set instead"
    )]
    Unsolved {
        /// Degree of the polynomial.
        degree: usize,
        /// What happened.
        why: ProgramError,
    },
    /// What was found is not proven.
    #[error(transparent)]
    Unproven(#[from] CertificateError),
}

/// The Gram matrix of the polynomial's Hessian form whose smallest eigenvalue is the largest,
/// proven.
///
/// # Errors
/// [`NoCertificate`], by how much it failed.
pub fn certificate(polynomial: &Polynomial) -> Result<HessianGram, NoCertificate> {
    let structure = Structure::new(polynomial.degree());
    let form = form(&structure, polynomial);
    let largest = form.amax();
    let rows = basis(&structure.hessian, &form).map_err(|key| NoCertificate::NoSquare(monomial(&structure, key)))?;
    let (pattern, keys) = structure.hessian.restricted(&rows);
    let form = DVector::from_iterator(keys.len(), keys.iter().map(|&key| form[key] / largest));
    let basis: Vec<_> = rows.iter().map(|&row| structure.hessian_basis[row]).collect();
    let inside = start(&pattern, &basis);
    let cones = [LocalizingMatrix::of(pattern)];
    let Margin { bound, mut grams } = largest_margin(&form, &cones, &inside)
        .map_err(|why| NoCertificate::Unsolved { degree: polynomial.degree(), why })?;
    if bound < -LEAST_PROVABLE_EIGENVALUE {
        return Err(NoCertificate::NotSosConvex { bound });
    }
    let gram = HessianGram::nearest(polynomial, basis, grams.remove(0) * largest)?;
    match gram.prove(polynomial) {
        Err(_) if bound < LEAST_PROVABLE_EIGENVALUE => Err(NoCertificate::Singular { bound }),
        proven => Ok(proven.map(|_| gram)?),
    }
}

/// Coefficients of the Hessian form.
fn form(structure: &Structure, polynomial: &Polynomial) -> DVector<f64> {
    let mut coefficients = DVector::zeros(structure.monomials.len());
    for (coefficient, monomial) in coefficients.iter_mut().zip(&structure.monomials) {
        let term = polynomial.terms().iter().find(|(exponents, _)| exponents == monomial);
        *coefficient = term.map_or(0.0, |term| term.1);
    }
    let of_form = structure.derivative.iter().map(|&(monomial, factor)| coefficients[monomial] * factor);
    DVector::from_iterator(structure.derivative.len(), of_form)
}

/// The monomial of p that a monomial of its Hessian form comes from.
fn monomial(structure: &Structure, key: usize) -> Exponents {
    structure.monomials[structure.derivative[key].0]
}

/// The elements of the basis that a Gram matrix may have entries for.
///
/// # Errors
/// The monomial of the form that they do not give.
fn basis(pattern: &Pattern, form: &DVector<f64>) -> Result<Vec<usize>, usize> {
    let mut rows: Vec<usize> = (0..pattern.size).collect();
    loop {
        let mut products = vec![0; pattern.keys];
        for (i, &row) in rows.iter().enumerate() {
            rows[..=i].iter().for_each(|&column| products[pattern.key(row, column)] += 1);
        }
        if let Some(key) = (0..pattern.keys).find(|&key| form[key] != 0.0 && products[key] == 0) {
            return Err(key);
        }
        let before = rows.len();
        rows.retain(|&row| products[pattern.key(row, row)] > 1 || form[pattern.key(row, row)] != 0.0);
        if rows.len() == before {
            return Ok(rows);
        }
    }
}

/// A functional with a definite moment matrix: y along the axes, z spread over the unit ball.
fn start(pattern: &Pattern, basis: &[HessianMonomial]) -> DVector<f64> {
    let mut moments = DVector::zeros(pattern.keys);
    let spread: Vec<(Vector3<f64>, f64)> =
        [0.3, 0.6, 1.0].iter().flat_map(|r| sphere_rule(8).map(move |(u, weight)| (u * *r, weight))).collect();
    for (i, a) in basis.iter().enumerate() {
        for (j, b) in basis.iter().enumerate().filter(|(_, b)| b.direction == a.direction) {
            let power = |z: &Vector3<f64>, k: usize| z[k].powi(i32::from(a.exponents[k] + b.exponents[k]));
            let moment = spread.iter().map(|(z, weight)| weight * power(z, 0) * power(z, 1) * power(z, 2));
            moments[pattern.key(i, j)] = moment.sum::<f64>();
        }
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::{NoCertificate, certificate};
    use nalgebra::Vector3;
    use sublevel_core::body::Body;
    use sublevel_core::polynomial::Polynomial;

    fn polynomial(terms: &[(sublevel_core::polynomial::Exponents, f64)]) -> Polynomial {
        Polynomial::new(terms.to_vec()).unwrap()
    }

    #[test]
    fn sparse_and_full_forms_get_proven_certificates() {
        for degree in [2, 4, 6, 8] {
            let body = Body::superellipsoid("s", Vector3::zeros(), Vector3::repeat(1.0), degree).unwrap();
            let gram = certificate(&body.constraints()[0].polynomial).unwrap();
            assert!(gram.prove(&body.constraints()[0].polynomial).is_ok());
            assert_eq!(gram.basis().len(), 3, "degree {degree}");
        }
        // (x^2 + y^2 + z^2)^2 + x y z / 2 + |v|^2 / 4, all products in play.
        let full = polynomial(&[
            ([4, 0, 0], 1.0),
            ([0, 4, 0], 1.0),
            ([0, 0, 4], 1.0),
            ([2, 2, 0], 2.0),
            ([2, 0, 2], 2.0),
            ([0, 2, 2], 2.0),
            ([1, 1, 1], 0.5),
            ([2, 0, 0], 0.25),
            ([0, 2, 0], 0.25),
            ([0, 0, 2], 0.25),
        ]);
        assert_eq!(certificate(&full).unwrap().basis().len(), 12);
    }

    #[test]
    fn what_is_not_convex_is_refuted_with_a_bound() {
        // A double well, a saddle, and x^4 + y^4 + z^4 - 12 x²y²/5, whose Hessian is indefinite at
        // x = y.
        let wells = [([4, 0, 0], 1.0), ([2, 0, 0], -2.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)];
        let saddle = [([2, 0, 0], 1.0), ([1, 1, 0], 3.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)];
        let crossed = [([4, 0, 0], 1.0), ([0, 4, 0], 1.0), ([0, 0, 4], 1.0), ([2, 2, 0], -2.4)];
        for terms in [&wells[..], &saddle, &crossed] {
            match certificate(&polynomial(terms)) {
                Err(NoCertificate::NotSosConvex { bound }) => assert!(bound <= 0.0),
                other => panic!("{terms:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn a_term_without_squares_is_named() {
        let twisted = polynomial(&[([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([3, 1, 0], 1.0)]);
        assert_eq!(certificate(&twisted), Err(NoCertificate::NoSquare([3, 1, 0])));
    }

    #[test]
    fn the_edge_of_convexity_is_found_from_both_sides() {
        // x² + y² + z² + 2 c xy is convex up to c = 1, its only Gram matrix has the eigenvalues 2
        // (1 ± c) and 2.
        let leaning =
            |c: f64| polynomial(&[([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([1, 1, 0], 2.0 * c)]);
        for room in [1e-1, 1e-4, 1e-8, 1e-12] {
            let least = certificate(&leaning(1.0 - room)).unwrap().matrix().symmetric_eigenvalues().min();
            assert!((least / (2.0 * room) - 1.0).abs() < 1e-3, "{room}: {least}");
            match certificate(&leaning(1.0 + room)) {
                Err(NoCertificate::NotSosConvex { bound }) => assert!(bound < 0.0 && bound >= -room, "{room}: {bound}"),
                // So near the edge rounding may hide which side it is on, but never makes a proof.
                Err(_) if room < 1e-10 => {}
                other => panic!("{room}: {other:?}"),
            }
        }
        assert!(matches!(certificate(&leaning(1.0)), Err(NoCertificate::Singular { .. } | NoCertificate::Unproven(_))));
    }
}
