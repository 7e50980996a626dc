//! Which products of basis monomials give which monomial: the index maps of the two Gram matrices
//! of a fit.

use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use std::collections::HashMap;
use sublevel_core::polynomial::{Exponents, HessianGram, HessianMonomial, degree_of, monomials};

/// A symmetric matrix whose entries are grouped by key: entries with one key add up to one
/// coefficient (as a Gram matrix) or are equal (as a moment matrix).
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    /// Rows of the matrix.
    pub(super) size: usize,
    /// Number of different keys.
    pub(super) keys: usize,
    key: Vec<usize>,
}

impl Pattern {
    fn new<K: std::hash::Hash + Eq, B>(basis: &[B], index: &HashMap<K, usize>, product: impl Fn(&B, &B) -> K) -> Self {
        let key = basis.iter().flat_map(|a| basis.iter().map(move |b| (a, b))).map(|(a, b)| index[&product(a, b)]);
        Self { size: basis.len(), keys: index.len(), key: key.collect() }
    }

    /// Gram matrices of polynomials on all monomials up to half their degree; keys are the
    /// monomials in their order.
    pub(super) fn of_monomials(half_degree: usize) -> Self {
        let index: HashMap<Exponents, usize> = monomials(2 * half_degree).into_iter().zip(0..).collect();
        Self::new(&monomials(half_degree), &index, |a, b| std::array::from_fn(|i| a[i] + b[i]))
    }

    /// The pattern of some of the rows and columns, and which of the keys are its keys.
    pub(super) fn restricted(&self, rows: &[usize]) -> (Self, Vec<usize>) {
        let old: Vec<usize> = rows.iter().flat_map(|&i| rows.iter().map(move |&j| self.key(i, j))).collect();
        let mut keys = old.clone();
        keys.sort_unstable();
        keys.dedup();
        let key = old.iter().map(|key| keys.partition_point(|kept| kept < key)).collect();
        (Self { size: rows.len(), keys: keys.len(), key }, keys)
    }

    /// Key of the entry in row `i` and column `j`.
    pub(super) fn key(&self, i: usize, j: usize) -> usize {
        self.key[i * self.size + j]
    }

    /// The moment matrix: entry (i, j) is the value of its key.
    pub(super) fn spread(&self, values: &DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.size, self.size, |i, j| values[self.key(i, j)])
    }

    /// The coefficients a Gram matrix gives; adjoint of [`Pattern::spread`].
    pub(super) fn collapse(&self, matrix: &DMatrix<f64>) -> DVector<f64> {
        let mut values = DVector::zeros(self.keys);
        for i in 0..self.size {
            for j in 0..self.size {
                values[self.key(i, j)] += matrix[(i, j)];
            }
        }
        values
    }

    /// The nearest matrix to the symmetric `matrix` whose coefficients are `values`.
    pub(super) fn nearest(&self, matrix: &DMatrix<f64>, values: &DVector<f64>) -> DMatrix<f64> {
        let places = self.collapse(&DMatrix::repeat(self.size, self.size, 1.0));
        matrix + self.spread(&(values - self.collapse(matrix)).component_div(&places))
    }

    /// `tr spread(values)` as a functional of the values.
    pub(super) fn trace_form(&self) -> DVector<f64> {
        let mut trace = DVector::zeros(self.keys);
        (0..self.size).for_each(|i| trace[self.key(i, i)] += 1.0);
        trace
    }

    /// The matrix of the quadratic form `m -> tr(G M G M)`, `M = spread(m)`, G symmetric: keys x
    /// keys.
    pub(super) fn congruence(&self, g: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.size;
        let mut form = DMatrix::zeros(self.keys, self.keys);
        // tr(G E_a G E_b) summed over the unit entries of both keys; a pair and its mirror image
        // share a key
        for i in 0..n {
            for j in 0..=i {
                let mirrored = if i == j { 1.0 } else { 2.0 };
                let mut column = form.column_mut(self.key(i, j));
                for k in 0..n {
                    let (g_ik, g_jk) = (mirrored * g[(k, i)], mirrored * g[(k, j)]);
                    for l in 0..k {
                        column[self.key(k, l)] += g_ik * g[(l, j)] + g_jk * g[(l, i)];
                    }
                    column[self.key(k, k)] += g_ik * g[(k, j)];
                }
            }
        }
        form
    }
}

/// The index maps for one degree.
#[derive(Clone, Debug)]
pub(super) struct Structure {
    /// Degree of p.
    pub(super) degree: usize,
    /// Monomials of p, at most `degree`.
    pub(super) monomials: Vec<Exponents>,
    /// Gram matrix P of p on the monomials of half the degree; keys are `monomials`.
    pub(super) gram: Pattern,
    /// Basis of the Gram matrix H of the Hessian form `y' ∇²p(z) y`.
    pub(super) hessian_basis: Vec<HessianMonomial>,
    /// H; keys are monomials of the Hessian form.
    pub(super) hessian: Pattern,
    /// Each monomial of the Hessian form comes from one monomial of p, times a whole number.
    pub(super) derivative: Vec<(usize, f64)>,
}

impl Structure {
    /// The maps for even `degree`.
    pub(super) fn new(degree: usize) -> Self {
        let all = monomials(degree);
        let index: HashMap<Exponents, usize> = all.iter().copied().zip(0..).collect();
        let gram = Pattern::of_monomials(degree / 2);

        let mut form_index = HashMap::new();
        let mut derivative = Vec::new();
        for i in 0..3_usize {
            for j in i..3 {
                for rest in monomials(degree - 2) {
                    let mut whole = rest;
                    whole[i] += 1;
                    whole[j] += 1;
                    let factor = if i == j {
                        f64::from(whole[i]) * f64::from(whole[i] - 1)
                    } else {
                        2.0 * f64::from(whole[i]) * f64::from(whole[j])
                    };
                    form_index.insert((i as u8, j as u8, rest), derivative.len());
                    derivative.push((index[&whole], factor));
                }
            }
        }
        let hessian_basis = HessianGram::full_basis(degree);
        let hessian = Pattern::new(&hessian_basis, &form_index, |a, b| {
            let rest: Exponents = std::array::from_fn(|i| a.exponents[i] + b.exponents[i]);
            (a.direction.min(b.direction), a.direction.max(b.direction), rest)
        });
        Self { degree, monomials: all, gram, hessian_basis, hessian, derivative }
    }

    /// The maps for even `degree` where nothing is asked of the Hessian: its form has no basis and
    /// no keys.
    pub(super) fn without_convexity(degree: usize) -> Self {
        let hessian = Pattern { size: 0, keys: 0, key: Vec::new() };
        Self { hessian_basis: Vec::new(), hessian, derivative: Vec::new(), ..Self::new(degree) }
    }

    /// Values of all monomials of p at `z`.
    pub(super) fn values(&self, z: &Vector3<f64>) -> DVector<f64> {
        let powers: [[f64; 9]; 3] = std::array::from_fn(|i| {
            let mut powers = [1.0; 9];
            for e in 1..9 {
                powers[e] = powers[e - 1] * z[i];
            }
            powers
        });
        DVector::from_iterator(
            self.monomials.len(),
            self.monomials.iter().map(|e| (0..3).map(|i| powers[i][usize::from(e[i])]).product::<f64>()),
        )
    }

    /// D: the coefficients of the Hessian form of p from those of p. Size: forms x monomials.
    pub(super) fn derivative_matrix(&self) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.hessian.keys, self.monomials.len());
        for (row, &(monomial, factor)) in self.derivative.iter().enumerate() {
            matrix[(row, monomial)] = factor;
        }
        matrix
    }

    /// The functional on coefficients of p that a functional on its Hessian form induces.
    pub(super) fn pull_back(&self, form: &DVector<f64>) -> DVector<f64> {
        let mut moments = DVector::zeros(self.monomials.len());
        for (&(monomial, factor), value) in self.derivative.iter().zip(form.iter()) {
            moments[monomial] += factor * value;
        }
        moments
    }
}

/// The functional `y_i y_j z^e -> [i = j] mean(z^e)`.
pub(super) fn isotropic_form(structure: &Structure, mean: &DVector<f64>) -> DVector<f64> {
    let size = structure.hessian.size / 3;
    let basis = &structure.hessian_basis;
    let position = |exponents: [u8; 3]| structure.monomials.iter().position(|&m| m == exponents);
    let mut form = DVector::zeros(structure.hessian.keys);
    for direction in 0..3 {
        for a in direction * size..(direction + 1) * size {
            for b in direction * size..(direction + 1) * size {
                let exponents = std::array::from_fn(|i| basis[a].exponents[i] + basis[b].exponents[i]);
                if let Some(index) = position(exponents) {
                    form[structure.hessian.key(a, b)] = mean[index];
                }
            }
        }
    }
    form
}

/// A functional on the Hessian form with a definite moment matrix, and so small that moments `rows
/// mean` less what it induces are definite, too: y isotropic and independent of z. Where relaxed
/// convexity has no points inside to go by, as of a sphere, z closer to the centre helps.
pub(super) fn interior_form(structure: &Structure, mean: &DVector<f64>, rows: f64) -> Option<DVector<f64>> {
    [1.0, 0.5, 0.25].into_iter().find_map(|shrink: f64| {
        let order = structure.monomials.iter().map(|&e| shrink.powi(degree_of(e) as i32));
        let isotropic = isotropic_form(structure, &mean.component_mul(&DVector::from_iterator(mean.len(), order)));
        let halved = (0..40).map(|halvings| &isotropic * 0.5_f64.powi(halvings));
        let is_inside = |form: &DVector<f64>| {
            Cholesky::new(structure.gram.spread(&(mean * rows - structure.pull_back(form)))).is_some()
        };
        halved.into_iter().find(is_inside).map(|form| form * 0.5)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_congruence_form_is_the_trace() {
        let structure = Structure::new(4);
        let n = structure.gram.size;
        let g = DMatrix::from_fn(n, n, |i, j| ((i * j) as f64).sin() + ((i + j) as f64).cos());
        let m = DVector::from_fn(structure.gram.keys, |i, _| (i as f64 * 0.7).sin());
        let matrix = structure.gram.spread(&m);
        let direct = (&g * &matrix * &g * &matrix).trace();
        let form = m.dot(&(structure.gram.congruence(&g) * &m));
        assert!((direct - form).abs() < 1e-9 * direct.abs().max(1.0), "{direct} {form}");
    }

    #[test]
    fn spread_and_collapse_are_adjoint() {
        let structure = Structure::new(6);
        let n = structure.hessian.size;
        let h = DMatrix::from_fn(n, n, |i, j| ((i + 2 * j) as f64).sin());
        let s = DVector::from_fn(structure.hessian.keys, |i, _| (i as f64).cos());
        let left = structure.hessian.spread(&s).dot(&h);
        let right = structure.hessian.collapse(&h).dot(&s);
        assert!((left - right).abs() < 1e-9, "{left} {right}");
    }

    #[test]
    fn sizes_are_those_of_the_paper() {
        for (degree, n, m) in [(2, 4, 3), (4, 10, 12), (6, 20, 30), (8, 35, 60)] {
            let structure = Structure::new(degree);
            assert_eq!((structure.gram.size, structure.hessian.size), (n, m));
        }
    }
}
