//! Laws of polynomials, checked against exact rational arithmetic.

use super::*;
use dashu_ratio::RBig;
use nalgebra::{DMatrix, Vector3};
use sublevel_testkit::Seeded;

fn random_polynomial(random: &mut Seeded, degree: usize) -> Polynomial {
    let mut terms: Vec<_> = monomials(degree)
        .into_iter()
        .map(|e| (e, random.signed() * 10_f64.powi((random.next() % 5) as i32 - 2)))
        .collect();
    terms[count_of(degree) - 1].1 = 1.0;
    Polynomial::new(terms).unwrap()
}

fn count_of(degree: usize) -> usize {
    monomials(degree).len()
}

fn exact(x: f64) -> RBig {
    RBig::try_from(x).unwrap()
}

fn power(x: &RBig, exponent: u8) -> RBig {
    (0..exponent).fold(RBig::ONE, |product, _| product * x)
}

/// Exact value and gradient by the definition.
fn exact_jet(p: &Polynomial, z: [f64; 3]) -> (RBig, [RBig; 3]) {
    let z = z.map(exact);
    let mut value = RBig::ZERO;
    let mut gradient = [RBig::ZERO, RBig::ZERO, RBig::ZERO];
    for (e, c) in p.terms() {
        let powers: [RBig; 3] = std::array::from_fn(|i| power(&z[i], e[i]));
        value += exact(*c) * &powers[0] * &powers[1] * &powers[2];
        for i in 0..3 {
            if e[i] > 0 {
                let others: RBig = (0..3).filter(|&j| j != i).fold(RBig::ONE, |q, j| q * &powers[j]);
                gradient[i] += exact(*c) * RBig::from(e[i]) * power(&z[i], e[i] - 1) * others;
            }
        }
    }
    (value, gradient)
}

fn within(computed: f64, truth: &RBig, bound: f64) -> bool {
    let error = exact(computed) - truth;
    error <= exact(bound) && error >= exact(-bound)
}

#[test]
fn error_bounds_hold_against_exact_arithmetic() {
    for seed in 0..400 {
        let mut random = Seeded(seed);
        let degree = [2, 4, 6, 8][(seed % 4) as usize];
        let p = random_polynomial(&mut random, degree);
        // Near the origin, near the unit sphere, and far away, where cancellation differs.
        let scale = [1e-3, 1.0, 1.0, 30.0][(seed / 4 % 4) as usize];
        let z = Vector3::from_fn(|_, _| random.signed() * scale);
        let jet = p.evaluate(&z);
        let (value, gradient) = exact_jet(&p, [z.x, z.y, z.z]);
        let none = Vector3::zeros();
        let bound = p.value_error(&z, &jet.gradient, &none);
        assert!(within(jet.value, &value, bound), "seed {seed}: value {} bound {bound:e}", jet.value);
        let bound = p.gradient_error(&z, &none);
        for i in 0..3 {
            assert!(within(jet.gradient[i], &gradient[i], bound), "seed {seed}: gradient {i} bound {bound:e}");
        }
        // The bound is useful, not only true.
        let size: f64 = p.terms().iter().map(|(_, c)| c.abs()).sum::<f64>() * scale.max(1.0).powi(degree as i32);
        assert!(p.value_error(&z, &jet.gradient, &none) < 1e-13 * size, "seed {seed}");

        // A displaced point stays within the widened bound.
        let dz = Vector3::from_fn(|_, _| random.signed().abs() * 1e-9);
        let moved = [z.x + dz.x, z.y - dz.y, z.z + dz.z];
        let dz = Vector3::new((moved[0] - z.x).abs(), (moved[1] - z.y).abs(), (moved[2] - z.z).abs());
        let (value, gradient) = exact_jet(&p, moved);
        assert!(
            within(jet.value, &value, p.value_error(&z, &jet.gradient, &(dz * (1.0 + 1e-12)))),
            "seed {seed}: displaced value"
        );
        for i in 0..3 {
            assert!(within(jet.gradient[i], &gradient[i], p.gradient_error(&z, &(dz * (1.0 + 1e-12)))), "seed {seed}");
        }
    }
}

#[test]
fn hessian_is_the_derivative_of_the_gradient() {
    for seed in 0..100 {
        let mut random = Seeded(1000 + seed);
        let p = random_polynomial(&mut random, [2, 4, 6, 8][(seed % 4) as usize]);
        let z = Vector3::from_fn(|_, _| random.signed());
        let h = 1e-5;
        let hessian = p.evaluate(&z).hessian;
        for i in 0..3 {
            let step = Vector3::from_fn(|j, _| if i == j { h } else { 0.0 });
            let difference = (p.evaluate(&(z + step)).gradient - p.evaluate(&(z - step)).gradient) / (2.0 * h);
            let error = (difference - hessian.column(i)).norm();
            assert!(error < 1e-5 * (1.0 + hessian.norm()), "seed {seed}: {error:e}");
        }
        assert_eq!(hessian, hessian.transpose());
    }
}

#[test]
fn constant_shift_leaves_the_hessian_bits() {
    let mut random = Seeded(7);
    let p = random_polynomial(&mut random, 6);
    let q = p.with_constant_shifted(-0.125);
    let z = Vector3::new(0.3, -0.4, 0.5);
    assert_eq!(p.evaluate(&z).hessian, q.evaluate(&z).hessian);
    assert!((p.evaluate(&z).value - 0.125 - q.evaluate(&z).value).abs() < 1e-14);
}

#[test]
fn bad_terms_are_refused() {
    let square = |i: usize| std::array::from_fn(|j| if i == j { 2 } else { 0 });
    assert_eq!(Polynomial::new(vec![]).unwrap_err(), PolynomialError::Degree(0));
    assert_eq!(Polynomial::new(vec![([1, 1, 1], 1.0)]).unwrap_err(), PolynomialError::Degree(3));
    assert_eq!(Polynomial::new(vec![([10, 0, 0], 1.0)]).unwrap_err(), PolynomialError::Degree(10));
    assert_eq!(Polynomial::new(vec![([255, 255, 255], 1.0)]).unwrap_err(), PolynomialError::Degree(765));
    assert_eq!(
        Polynomial::new(vec![(square(0), 1.0), (square(0), 2.0)]).unwrap_err(),
        PolynomialError::Duplicate([2, 0, 0])
    );
    assert!(matches!(Polynomial::new(vec![(square(0), f64::NAN)]), Err(PolynomialError::NotFinite { index: 0, .. })));
}

/// Σ (q_r · z̃)^2k is sos-convex; its Hessian form has a Gram matrix Σ w wᵀ, definite with enough
/// terms.
fn sum_of_powers(random: &mut Seeded, degree: usize, count: usize) -> (Polynomial, DMatrix<f64>) {
    let half = degree / 2;
    let basis = HessianGram::full_basis(degree);
    let mut coefficients: std::collections::BTreeMap<Exponents, f64> = Default::default();
    let mut matrix = DMatrix::zeros(basis.len(), basis.len());
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let multinomial = |n: usize, e: Exponents| {
        let rest = n - degree_of(e);
        factorial(n) / (factorial(rest) * e.iter().map(|&k| factorial(usize::from(k))).product::<f64>())
    };
    for _ in 0..count {
        let q: [f64; 4] = std::array::from_fn(|_| random.signed());
        let value = |n: usize, e: Exponents| {
            multinomial(n, e)
                * q[0].powi((n - degree_of(e)) as i32)
                * (0..3).map(|i| q[i + 1].powi(i32::from(e[i]))).product::<f64>()
        };
        for e in monomials(degree) {
            *coefficients.entry(e).or_default() += value(degree, e);
        }
        let scale = ((degree * (degree - 1)) as f64).sqrt();
        let w: Vec<f64> =
            basis.iter().map(|b| scale * q[1 + usize::from(b.direction)] * value(half - 1, b.exponents)).collect();
        matrix += DMatrix::from_fn(w.len(), w.len(), |i, j| w[i] * w[j]);
    }
    // The powers span only part of the basis; |z|^2j, j = 1..d, with the diagonal matrix of 2j
    // |z|^2(j-1) |y|² and the rank-one squares of (z·y) covers the rest.
    for j in 1..=half {
        let multinomial_of =
            |e: Exponents| factorial(degree_of(e)) / e.iter().map(|&k| factorial(usize::from(k))).product::<f64>();
        for e in monomials(j).into_iter().filter(|&e| degree_of(e) == j) {
            *coefficients.entry(e.map(|k| 2 * k)).or_default() += multinomial_of(e);
        }
        for (i, b) in basis.iter().enumerate().filter(|(_, b)| degree_of(b.exponents) == j - 1) {
            matrix[(i, i)] += 2.0 * j as f64 * multinomial_of(b.exponents);
        }
        // 4 j (j - 1) |z|^2(j-2) (z·y)²: one square per monomial of |z|^2(j-2).
        for e in monomials(j).into_iter().filter(|&e| j >= 2 && degree_of(e) == j - 2) {
            let w: Vec<f64> = basis
                .iter()
                .map(|b| {
                    f64::from(b.exponents == std::array::from_fn(|k| e[k] + u8::from(k == usize::from(b.direction))))
                })
                .collect();
            let factor = 4.0 * (j * (j - 1)) as f64 * multinomial_of(e);
            matrix += DMatrix::from_fn(w.len(), w.len(), |r, s| factor * w[r] * w[s]);
        }
    }
    (Polynomial::new(coefficients.into_iter().collect()).unwrap(), matrix)
}

#[test]
fn certificates_prove_and_perturbed_ones_fail() {
    for (seed, degree) in [(1, 2), (2, 4), (3, 6), (4, 8)] {
        let mut random = Seeded(seed);
        let (p, matrix) = sum_of_powers(&mut random, degree, 400);
        let basis = HessianGram::full_basis(degree);
        let gram = HessianGram::nearest(&p, basis.clone(), matrix.clone()).unwrap();
        let margin = gram.prove(&p).unwrap_or_else(|e| panic!("degree {degree}: {e}"));
        assert!(margin.residual < 1e-12 * matrix.norm(), "degree {degree}: {margin:?}");

        // A gross change of one entry breaks the match by more than the eigenvalue covers.
        let mut broken = matrix.clone();
        let shift = 2.0 * matrix.symmetric_eigenvalues().min() * (basis.len() as f64).sqrt() + 1.0;
        broken[(0, 0)] += shift;
        let broken = HessianGram::new(basis.clone(), (&broken + broken.transpose()) * 0.5).unwrap();
        assert!(matches!(broken.prove(&p), Err(CertificateError::NotDefinite { .. })), "degree {degree}");

        // So does a non-convex polynomial, whatever the matrix is fitted to.
        let mut terms = p.terms().to_vec();
        let largest = terms.iter().map(|t| t.1.abs()).fold(0.0, f64::max);
        let mut pure = [0; 3];
        pure[2] = degree as u8;
        terms.iter_mut().find(|t| t.0 == pure).unwrap().1 = -largest;
        let concave = Polynomial::new(terms).unwrap();
        let gram = HessianGram::nearest(&concave, basis, matrix).unwrap();
        assert!(gram.prove(&concave).is_err(), "degree {degree}");
    }
}

#[test]
fn small_bases_suffice_where_they_should() {
    let slab = Polynomial::new(vec![([2, 0, 0], 1.0)]).unwrap();
    let element = |direction, exponents| HessianMonomial { direction, exponents };
    let gram = HessianGram::new(vec![element(0, [0, 0, 0])], DMatrix::from_element(1, 1, 2.0)).unwrap();
    assert!(gram.prove(&slab).is_ok());
    let wall = Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0)]).unwrap();
    assert!(matches!(gram.prove(&wall), Err(CertificateError::BasisTooSmall(_))));
    // z1^4 + z2^4 + z3^4: diagonal on y_i z_i.
    let quartic =
        Polynomial::new((0..3).map(|i| (std::array::from_fn(|j| if i == j { 4 } else { 0 }), 1.0)).collect()).unwrap();
    let basis = (0..3).map(|i| element(i as u8, std::array::from_fn(|j| u8::from(i == j)))).collect();
    assert!(HessianGram::new(basis, DMatrix::identity(3, 3) * 12.0).unwrap().prove(&quartic).is_ok());
}

#[test]
fn malformed_certificates_are_named() {
    let element = HessianMonomial { direction: 0, exponents: [0, 0, 0] };
    let cases = [
        HessianGram::new(vec![], DMatrix::zeros(0, 0)),
        HessianGram::new(vec![element, element], DMatrix::identity(2, 2)),
        HessianGram::new(vec![HessianMonomial { direction: 3, ..element }], DMatrix::identity(1, 1)),
        HessianGram::new(vec![element], DMatrix::identity(2, 2)),
        HessianGram::new(vec![element], DMatrix::from_element(1, 1, f64::NAN)),
    ];
    for case in cases {
        assert!(matches!(case, Err(CertificateError::Malformed(_))));
    }
}
