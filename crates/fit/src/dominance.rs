//! Gram matrices of Hessian forms as sums of small blocks, and the linear systems that such sums
//! lead to.
//!
//! A scaled diagonally dominant matrix is a sum of semidefinite blocks `[[u + v, w], [w, u - v]]`
//! on two rows each, (u, v, w) in a Lorentz cone; a diagonally dominant one has only those with v =
//! 0, and a nonnegative diagonal. A block adds to three coefficients of the form: the squares of
//! its two rows and their product. So two products that are no squares never meet in one block, and
//! A Θ Aᵀ, with A the map from blocks to coefficients and Θ block diagonal, is a diagonal matrix
//! but for a border as wide as there are squares: 30 of 210 at degree 6.

use super::Cone;
use super::factor::{regularised_factor, solve_lower};
use super::structure::{Structure, isotropic_form};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// One block.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// Its two rows; twice the same for an entry of the diagonal.
    rows: [usize; 2],
    /// Where the coefficients that it adds to are in the order of [`Dominance`]: of both squares
    /// and of the product.
    places: [usize; 3],
    /// What (u, v, w) adds to each.
    map: Matrix3<f64>,
}

/// A: from blocks to coefficients of the Hessian form, those of squares first.
#[derive(Clone, Debug)]
pub(super) struct Dominance {
    blocks: Vec<Block>,
    /// Rows of the Gram matrix.
    size: usize,
    /// How many coefficients belong to squares.
    squares: usize,
    /// D in this order: each coefficient is a number times one coefficient of p.
    derivative: Vec<(usize, f64)>,
    monomials: usize,
    /// A functional on the form that is strictly positive on every block: means over a cube, y
    /// isotropic.
    pub(super) positive: DVector<f64>,
}

impl Dominance {
    /// The blocks of scaled diagonal dominance, or of diagonal dominance.
    pub(super) fn new(structure: &Structure, cone: Cone) -> Self {
        let (pattern, size) = (&structure.hessian, structure.hessian.size);
        let mut order: Vec<usize> = (0..size).map(|i| pattern.key(i, i)).collect();
        let squares = order.len();
        order.extend((0..pattern.keys).filter(|key| !order[..squares].contains(key)).collect::<Vec<_>>());
        let mut place = vec![0; pattern.keys];
        for (index, &key) in order.iter().enumerate() {
            place[key] = index;
        }
        let tilt = if cone == Cone::Sdsos { 1.0 } else { 0.0 };
        let pair = Matrix3::new(1.0, tilt, 0.0, 1.0, -tilt, 0.0, 0.0, 0.0, 2.0);
        let single = Matrix3::from_diagonal(&Vector3::x());
        let block = |i: usize, j: usize, map| Block { rows: [i, j], places: [i, j, place[pattern.key(i, j)]], map };
        let mut blocks: Vec<Block> =
            (0..size).flat_map(|j| (0..j).map(move |i| (i, j))).map(|(i, j)| block(i, j, pair)).collect();
        if cone == Cone::Dsos {
            blocks.extend((0..size).map(|i| block(i, i, single)));
        }
        let derivative = order.iter().map(|&key| structure.derivative[key]).collect();
        let means = isotropic_form(structure, &cube_moments(structure));
        let positive = DVector::from_iterator(order.len(), order.iter().map(|&key| means[key]));
        Self { blocks, size, squares, derivative, monomials: structure.monomials.len(), positive }
    }

    /// D c: the coefficients of the Hessian form of p.
    pub(super) fn form(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        let values = self.derivative.iter().map(|&(monomial, factor)| factor * coefficients[monomial]);
        DVector::from_iterator(self.derivative.len(), values)
    }

    /// D* s.
    pub(super) fn pull_back(&self, form: &DVector<f64>) -> DVector<f64> {
        let mut moments = DVector::zeros(self.monomials);
        for (&(monomial, factor), value) in self.derivative.iter().zip(form.iter()) {
            moments[monomial] += factor * value;
        }
        moments
    }

    /// The coefficients of `I`.
    pub(super) fn trace(&self) -> DVector<f64> {
        DVector::from_fn(self.derivative.len(), |i, _| if i < self.squares { 1.0 } else { 0.0 })
    }

    /// A x: the coefficients that blocks add up to.
    pub(super) fn collapse(&self, blocks: &[Vector3<f64>]) -> DVector<f64> {
        let mut values = DVector::zeros(self.derivative.len());
        for (block, x) in self.blocks.iter().zip(blocks) {
            let added = block.map * x;
            for k in 0..3 {
                values[block.places[k]] += added[k];
            }
        }
        values
    }

    /// A* s: what a functional on the form is on each block.
    pub(super) fn spread(&self, form: &DVector<f64>) -> Vec<Vector3<f64>> {
        let of_block = |block: &Block| block.map.tr_mul(&Vector3::from_fn(|k, _| form[block.places[k]]));
        self.blocks.iter().map(of_block).collect()
    }

    /// The Gram matrix that blocks add up to.
    pub(super) fn gram(&self, blocks: &[Vector3<f64>]) -> DMatrix<f64> {
        let mut gram = DMatrix::zeros(self.size, self.size);
        for (block, x) in self.blocks.iter().zip(blocks) {
            let ([i, j], added) = (block.rows, block.map * x);
            gram[(i, i)] += added[0];
            gram[(j, j)] += added[1];
            gram[(i, j)] += 0.5 * added[2];
            gram[(j, i)] += 0.5 * added[2];
        }
        gram
    }

    /// A Θ A*, factorized; Θ has one definite block for each of A.
    pub(super) fn normal(&self, weights: impl Iterator<Item = Matrix3<f64>>) -> Option<Bordered<'_>> {
        let (squares, others) = (self.squares, self.derivative.len() - self.squares);
        let mut corner = DMatrix::zeros(squares, squares);
        let mut border = DMatrix::zeros(squares, others);
        let mut diagonal = DVector::zeros(others);
        for (block, weight) in self.blocks.iter().zip(weights) {
            let added = block.map * weight * block.map.transpose();
            for (k, &row) in block.places.iter().enumerate() {
                for (l, &column) in block.places.iter().enumerate() {
                    match (row < squares, column < squares) {
                        (true, true) => corner[(row, column)] += added[(k, l)],
                        (true, false) => border[(row, column - squares)] += added[(k, l)],
                        (false, true) => {}
                        (false, false) => diagonal[row - squares] += added[(k, l)],
                    }
                }
            }
        }
        if !(diagonal.min() > 0.0) {
            return None;
        }
        let mut scaled = border.clone();
        for (mut column, entry) in scaled.column_iter_mut().zip(diagonal.iter()) {
            column /= *entry;
        }
        let factor = regularised_factor(&(corner - &scaled * border.transpose()))?;
        Some(Bordered { dominance: self, factor, scaled, diagonal })
    }
}

/// `[[C, B], [Bᵀ, Δ]]` with Δ diagonal.
pub(super) struct Bordered<'a> {
    dominance: &'a Dominance,
    /// Lower Cholesky factor of the Schur complement `C - B Δ⁻¹ Bᵀ`.
    factor: DMatrix<f64>,
    /// `B Δ⁻¹`.
    scaled: DMatrix<f64>,
    diagonal: DVector<f64>,
}

impl Bordered<'_> {
    /// Its inverse times a vector.
    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let squares = self.factor.nrows();
        let others = right.rows_range(squares..);
        let mut first = right.rows_range(..squares) - &self.scaled * others;
        self.factor.solve_lower_triangular_mut(&mut first);
        self.factor.tr_solve_lower_triangular_mut(&mut first);
        let last = others.component_div(&self.diagonal) - self.scaled.tr_mul(&first);
        DVector::from_iterator(right.len(), first.iter().chain(last.iter()).copied())
    }

    /// `D* (…)⁻¹ D`: monomials x monomials.
    pub(super) fn curvature(&self) -> Option<DMatrix<f64>> {
        let Dominance { derivative, monomials, squares, .. } = self.dominance;
        let (of_squares, of_others) = derivative.split_at(*squares);
        let mut rows = DMatrix::zeros(*squares, *monomials);
        for (row, &(monomial, factor)) in of_squares.iter().enumerate() {
            rows[(row, monomial)] += factor;
        }
        for (column, &(monomial, factor)) in self.scaled.column_iter().zip(of_others) {
            rows.column_mut(monomial).axpy(-factor, &column, 1.0);
        }
        let rows = solve_lower(&self.factor, rows)?;
        let mut curvature = rows.transpose() * &rows;
        for (&(monomial, factor), entry) in of_others.iter().zip(self.diagonal.iter()) {
            curvature[(monomial, monomial)] += factor * factor / entry;
        }
        Some(curvature)
    }
}

/// Means of the monomials over the cube inscribed in the unit ball.
fn cube_moments(structure: &Structure) -> DVector<f64> {
    let of_axis = |n: u8| if n % 2 == 1 { 0.0 } else { 3_f64.powf(-0.5 * f64::from(n)) / f64::from(n + 1) };
    let of_monomial = structure.monomials.iter().map(|e| e.iter().map(|&n| of_axis(n)).product());
    DVector::from_iterator(structure.monomials.len(), of_monomial)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    /// Against the same matrices multiplied out.
    #[test]
    fn bordered_systems_are_solved() {
        let mut random = Seeded(11);
        for degree in [2, 4, 6, 8] {
            let structure = Structure::new(degree);
            for cone in [Cone::Sdsos, Cone::Dsos] {
                let dominance = Dominance::new(&structure, cone);
                let weights: Vec<Matrix3<f64>> = (0..dominance.blocks.len())
                    .map(|_| {
                        let root = Matrix3::from_fn(|_, _| random.signed());
                        root * root.transpose() + Matrix3::identity() * 0.1
                    })
                    .collect();
                let keys = structure.hessian.keys;
                let mut matrix = DMatrix::zeros(keys, keys);
                for key in 0..keys {
                    let unit = DVector::from_fn(keys, |i, _| f64::from(u8::from(i == key)));
                    let weighted: Vec<_> = dominance.spread(&unit).iter().zip(&weights).map(|(z, w)| w * z).collect();
                    matrix.set_column(key, &dominance.collapse(&weighted));
                }
                let normal = dominance.normal(weights.into_iter()).unwrap();
                let right = DVector::from_fn(keys, |_, _| random.signed());
                let error = &matrix * normal.solve(&right) - &right;
                assert!(error.amax() < 1e-10, "{cone}, degree {degree}: {}", error.amax());
                let count = structure.monomials.len();
                let derivative = DMatrix::from_fn(keys, count, |_, _| 0.0);
                let derivative = derivative.map_with_location(|i, j, _: f64| {
                    let (monomial, factor) = dominance.derivative[i];
                    if monomial == j { factor } else { 0.0 }
                });
                let expected = derivative.transpose() * matrix.try_inverse().unwrap() * &derivative;
                let error = normal.curvature().unwrap() - &expected;
                assert!(error.amax() < 1e-9 * expected.amax(), "{cone}, degree {degree}: {}", error.amax());
            }
        }
    }

    /// Blocks, the matrix that they make and the form of that matrix agree, and A* is the adjoint
    /// of A.
    #[test]
    fn blocks_make_gram_matrices() {
        let mut random = Seeded(12);
        for degree in [2, 4, 6, 8] {
            let structure = Structure::new(degree);
            for cone in [Cone::Sdsos, Cone::Dsos] {
                let dominance = Dominance::new(&structure, cone);
                let tilted = f64::from(u8::from(cone == Cone::Sdsos));
                let blocks: Vec<_> = (0..dominance.blocks.len())
                    .map(|_| {
                        let (v, w) = (tilted * random.signed(), random.signed());
                        Vector3::new(v.hypot(w) + 1e-3, v, w)
                    })
                    .collect();
                let gram = dominance.gram(&blocks);
                assert!(gram.clone().symmetric_eigenvalues().min() > 0.0);
                let form = dominance.collapse(&blocks);
                // A functional on the form has the same value in both orders.
                let means = isotropic_form(&structure, &cube_moments(&structure));
                let value = means.dot(&structure.hessian.collapse(&gram));
                assert!((dominance.positive.dot(&form) - value).abs() < 1e-10 * form.amax());
                assert!(dominance.spread(&dominance.positive).iter().all(|z| z.x > z.y.hypot(z.z)));
                if cone == Cone::Dsos {
                    for (i, row) in gram.row_iter().enumerate() {
                        assert!(2.0 * row[i] >= row.iter().map(|entry| entry.abs()).sum::<f64>());
                    }
                }
                let functional = DVector::from_fn(form.len(), |_, _| random.signed());
                let pairs = dominance.spread(&functional);
                let paired = pairs.iter().zip(&blocks).map(|(z, x)| z.dot(x)).sum::<f64>();
                assert!((paired - functional.dot(&form)).abs() < 1e-10 * form.amax());
            }
        }
    }
}
