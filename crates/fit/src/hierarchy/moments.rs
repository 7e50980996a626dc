//! The moment program of a level.

use super::placed_set::PlacedSet;
use crate::conic_program::{ConicProgram, ConicSolution, Expression};
use nalgebra::{DMatrix, Vector3};
use std::collections::BTreeMap;
use std::ops::Range;
use sublevel_core::polynomial::{
    PairExponents, PairPolynomial, Point, Polynomial, WeightedSquares, degree_of, monomials,
};

/// A matrix of moments that stays semidefinite: on products of a basis, alone or times `1 - g`.
struct Localized<'a> {
    basis: Vec<PairExponents>,
    constraint: Option<(&'a Polynomial, Point)>,
}

/// `minimise f(y)` over functionals y on polynomials of two points that are nonnegative on squares
/// of three groups of monomials and on squares times each `1 - g`.
pub(super) struct MomentRelaxation<'a> {
    objective: Vec<(PairExponents, f64)>,
    /// Largest coefficient of the objective, by which it is divided.
    unit: f64,
    matrices: Vec<Localized<'a>>,
    /// Variable of each moment.
    moments: BTreeMap<PairExponents, usize>,
    sets: [&'a PlacedSet<'a>; 2],
}

fn product(a: &PairExponents, b: &PairExponents) -> PairExponents {
    std::array::from_fn(|k| a[k] + b[k])
}

impl<'a> MomentRelaxation<'a> {
    pub(super) fn new(objective: &PairPolynomial, sets: [&'a PlacedSet<'a>; 2], level: usize) -> Self {
        let points = [Point::First, Point::Second];
        let both = pairs_up_to(1 + level);
        let mut matrices = vec![Localized { basis: both, constraint: None }];
        for (set, point) in sets.iter().zip(points) {
            let highest = set.set.polynomials.iter().map(|g| g.degree()).max().unwrap_or(2);
            let of_point = |degree: usize| monomials(degree).into_iter().map(|e| point.exponents(e)).collect();
            matrices.push(Localized { basis: of_point(highest / 2 + level), constraint: None });
            // As many squares as the highest degree leaves room for.
            matrices.extend(set.set.polynomials.iter().map(|&g| Localized {
                basis: of_point((highest - g.degree()) / 2 + level),
                constraint: Some((g, point)),
            }));
        }
        let mut moments = BTreeMap::new();
        let pure = matrices.iter().filter(|matrix| matrix.constraint.is_none());
        for Localized { basis, .. } in pure {
            for a in basis {
                for b in basis {
                    let next = moments.len();
                    moments.entry(product(a, b)).or_insert(next);
                }
            }
        }
        let objective: Vec<_> = objective.terms().collect();
        let unit = objective.iter().map(|term| term.1.abs()).fold(f64::MIN_POSITIVE, f64::max);
        Self { objective, unit, matrices, moments, sets }
    }

    /// Entries of the triangles of all matrices.
    pub(super) fn rows(&self) -> usize {
        self.matrices.iter().map(|matrix| matrix.basis.len() * (matrix.basis.len() + 1) / 2).sum()
    }

    /// What the objective is divided by.
    pub(super) fn unit(&self) -> f64 {
        self.unit
    }

    /// The program, and the rows of its matrices.
    pub(super) fn program(&self) -> (ConicProgram, Vec<Range<usize>>) {
        let mut program = ConicProgram::default();
        program.variables(self.moments.len());
        for (exponents, coefficient) in &self.objective {
            program.add_cost(self.moments[exponents], coefficient / self.unit);
        }
        program.zero([Expression { constant: -1.0, ..Expression::of(self.moments[&[0; 6]]) }]);
        let parts = self.matrices.iter().map(|Localized { basis, constraint }| {
            program.semidefinite(basis.len(), |i, j| {
                let square = product(&basis[i], &basis[j]);
                let mut entry = Expression::of(self.moments[&square]);
                if let Some((g, point)) = constraint {
                    for &(exponents, coefficient) in g.terms() {
                        let moment = self.moments[&product(&square, &point.exponents(exponents))];
                        entry.terms.push((moment, -coefficient));
                    }
                }
                entry
            })
        });
        let parts = parts.collect();
        (program, parts)
    }

    /// The Gram matrices that the multipliers are.
    pub(super) fn squares(&self, solution: &ConicSolution, parts: &[Range<usize>]) -> Vec<WeightedSquares<'a>> {
        let squares = |(matrix, rows): (&Localized<'a>, &Range<usize>)| {
            let gram: DMatrix<f64> = solution.matrix_multiplier(rows.clone(), matrix.basis.len()) * self.unit;
            WeightedSquares { basis: matrix.basis.clone(), gram, constraint: matrix.constraint }
        };
        let mut squares = self.matrices.iter().zip(parts).map(squares).collect();
        self.close(&mut squares);
        squares
    }

    /// Spreads what the identity leaves over, but for its constant, over the entries of the Gram
    /// matrices without constraints that give the same monomial.
    fn close(&self, squares: &mut Vec<WeightedSquares<'a>>) {
        let mut left: BTreeMap<PairExponents, (f64, usize)> = BTreeMap::new();
        for (exponents, coefficient) in &self.objective {
            left.entry(*exponents).or_default().0 += coefficient;
        }
        for WeightedSquares { basis, gram, constraint } in squares.iter() {
            for (i, a) in basis.iter().enumerate() {
                for (j, b) in basis.iter().enumerate() {
                    let square = product(a, b);
                    let (rest, places) = left.entry(square).or_default();
                    *rest -= gram[(i, j)];
                    *places += usize::from(constraint.is_none());
                    let Some((g, point)) = constraint else { continue };
                    for &(exponents, coefficient) in g.terms() {
                        let product = product(&square, &point.exponents(exponents));
                        left.entry(product).or_default().0 += gram[(i, j)] * coefficient;
                    }
                }
            }
        }
        left.insert([0; 6], (0.0, 1));
        for WeightedSquares { basis, gram, .. } in squares.iter_mut().filter(|square| square.constraint.is_none()) {
            for (i, a) in basis.iter().enumerate() {
                for (j, b) in basis.iter().enumerate() {
                    let (rest, places) = left[&product(a, b)];
                    gram[(i, j)] += rest / places.max(1) as f64;
                }
            }
        }
    }

    /// The means of both points, in the common frame: the nearest points where these are unique and
    /// the level is exact.
    pub(super) fn first_moments(&self, solution: &ConicSolution) -> [Vector3<f64>; 2] {
        std::array::from_fn(|side| {
            let z = Vector3::from_fn(|k, _| {
                let unit = std::array::from_fn(|i| u8::from(i == 3 * side + k));
                solution.variables[self.moments[&unit]]
            });
            let normalization = self.sets[side].set.normalization;
            let inverse = normalization.linear.try_inverse().unwrap_or_default();
            self.sets[side].pose.transform_point(&(inverse * z + normalization.center).into()).coords
        })
    }
}

/// All monomials of both points up to a degree.
fn pairs_up_to(degree: usize) -> Vec<PairExponents> {
    let of_first = monomials(degree);
    let pairs = of_first.iter().flat_map(|&a| {
        monomials(degree - degree_of(a))
            .into_iter()
            .map(move |b| product(&Point::First.exponents(a), &Point::Second.exponents(b)))
    });
    pairs.collect()
}
