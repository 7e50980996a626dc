//! The moment program of a level.

use super::atoms::{Atoms, atoms, rank};
use super::placed_set::PlacedSet;
use super::sign_symmetry::SignSymmetry;
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

/// `minimise max_i f_i(y)` over functionals y on polynomials of one or two points that are
/// nonnegative on squares of groups of monomials and on squares times each `1 - g`, and that no
/// sign symmetry changes.
pub(super) struct MomentRelaxation<'a> {
    objectives: Vec<Vec<(PairExponents, f64)>>,
    /// What the objectives are divided by.
    unit: f64,
    /// Powers of two near the bounds of the coordinates, by which these are divided.
    scales: [f64; 6],
    /// Those of a group are blocks of its matrix.
    matrices: Vec<Localized<'a>>,
    /// Variable of each moment of the divided coordinates; the moments of all other monomials are
    /// zero.
    moments: BTreeMap<PairExponents, usize>,
    points: Vec<SetPoint<'a>>,
}

/// A point of a set, and half the degree up to which its moments are known.
struct SetPoint<'a> {
    set: &'a PlacedSet<'a>,
    point: Point,
    half_degree: usize,
}

/// Rows of a program.
pub(super) struct Rows {
    /// Those of each matrix.
    matrices: Vec<Range<usize>>,
    /// `t >= f_i(y)`, if there are several f.
    objectives: Range<usize>,
}

fn product(a: &PairExponents, b: &PairExponents) -> PairExponents {
    std::array::from_fn(|k| a[k] + b[k])
}

/// What a monomial of coordinates that are divided by `scales` is to be multiplied by.
fn power(scales: &[f64; 6], exponents: &PairExponents) -> f64 {
    scales.iter().zip(exponents).map(|(scale, &e)| scale.powi(i32::from(e))).product()
}

/// Highest degree of the polynomials of a set.
fn highest_degree(set: &PlacedSet) -> usize {
    set.set.polynomials.iter().map(|g| g.degree()).max().unwrap_or(2)
}

impl<'a> MomentRelaxation<'a> {
    /// For `f(u, v)` of points of two sets that couples them by products of their coordinates
    /// alone.
    pub(super) fn of_two(objective: &PairPolynomial, sets: [&'a PlacedSet<'a>; 2], level: usize) -> Self {
        let objectives = std::slice::from_ref(objective);
        let symmetry = SignSymmetry::new(objectives, &[(sets[0], Point::First), (sets[1], Point::Second)]);
        Self::of_two_with(objective, sets, level, &symmetry)
    }

    /// The same in the blocks of a symmetry.
    pub(super) fn of_two_with(
        objective: &PairPolynomial,
        sets: [&'a PlacedSet<'a>; 2],
        level: usize,
        symmetry: &SignSymmetry,
    ) -> Self {
        let both = Localized { basis: pairs_up_to(1 + level), constraint: None };
        let points = [(sets[0], Point::First), (sets[1], Point::Second)];
        let points = points.map(|(set, point)| SetPoint { set, point, half_degree: highest_degree(set) / 2 + level });
        Self::new(std::slice::from_ref(objective), vec![both], points.into(), symmetry)
    }

    /// For the largest of the polynomials `f_i(u)` of the point of a set, of degrees up to
    /// `degree`.
    pub(super) fn of_one(objectives: &[PairPolynomial], degree: usize, set: &'a PlacedSet<'a>, level: usize) -> Self {
        let symmetry = SignSymmetry::new(objectives, &[(set, Point::First)]);
        Self::of_one_with(objectives, degree, set, level, &symmetry)
    }

    /// The same in the blocks of a symmetry.
    pub(super) fn of_one_with(
        objectives: &[PairPolynomial],
        degree: usize,
        set: &'a PlacedSet<'a>,
        level: usize,
        symmetry: &SignSymmetry,
    ) -> Self {
        let half_degree = degree.max(highest_degree(set)) / 2 + level;
        Self::new(objectives, Vec::new(), vec![SetPoint { set, point: Point::First, half_degree }], symmetry)
    }

    fn new(
        objectives: &[PairPolynomial],
        mut matrices: Vec<Localized<'a>>,
        points: Vec<SetPoint<'a>>,
        symmetry: &SignSymmetry,
    ) -> Self {
        for &SetPoint { set, point, half_degree } in &points {
            let basis = |degree: usize| monomials(degree).into_iter().map(|e| point.exponents(e)).collect();
            matrices.push(Localized { basis: basis(half_degree), constraint: None });
            // As many squares as the degree leaves room for.
            matrices.extend(
                set.set
                    .polynomials
                    .iter()
                    .map(|&g| Localized { basis: basis(half_degree - g.degree() / 2), constraint: Some((g, point)) }),
            );
        }
        let blocks = |Localized { basis, constraint }: Localized<'a>| {
            symmetry.blocks(basis).into_iter().map(move |basis| Localized { basis, constraint })
        };
        let matrices: Vec<_> = matrices.into_iter().flat_map(blocks).collect();
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
        let mut most = [0.0; 6];
        for SetPoint { set, point, .. } in &points {
            let first = if *point == Point::First { 0 } else { 3 };
            most[first..first + 3].copy_from_slice(&set.coordinate_bounds());
        }
        let scales = PairPolynomial::scales(&most);
        let divided = |(exponents, coefficient)| (exponents, coefficient * power(&scales, &exponents));
        let kept = |f: &PairPolynomial| f.terms().filter(|term| symmetry.keeps(&term.0)).map(divided).collect();
        let objectives: Vec<Vec<_>> = objectives.iter().map(kept).collect();
        let coefficients = objectives.iter().flatten().map(|term| term.1.abs());
        let unit = coefficients.fold(f64::MIN_POSITIVE, f64::max);
        Self { objectives, unit, scales, matrices, moments, points }
    }

    /// With objectives divided by about what their minimum is: the solver's tolerance of the gap is
    /// one of that. Not by less than a millionth of the largest coefficient.
    pub(super) fn with_expected(self, minimum: f64) -> Self {
        let unit = minimum.abs().clamp(1e-6 * self.unit, self.unit);
        Self { unit, ..self }
    }

    /// Entries of the triangles of all matrices.
    pub(super) fn rows(&self) -> usize {
        self.matrices.iter().map(|matrix| matrix.basis.len() * (matrix.basis.len() + 1) / 2).sum()
    }

    /// What the objective is divided by.
    pub(super) fn unit(&self) -> f64 {
        self.unit
    }

    /// The program, and its rows.
    pub(super) fn program(&self) -> (ConicProgram, Rows) {
        let mut program = ConicProgram::default();
        program.variables(self.moments.len());
        let objectives = if let [objective] = &self.objectives[..] {
            for (exponents, coefficient) in objective {
                program.add_cost(self.moments[exponents], coefficient / self.unit);
            }
            0..0
        } else {
            let most = program.variable(1.0);
            program.nonnegative(self.objectives.iter().map(|objective| {
                let terms = objective.iter().map(|(e, coefficient)| (self.moments[e], -coefficient / self.unit));
                Expression { terms: terms.chain([(most, 1.0)]).collect(), constant: 0.0 }
            }))
        };
        program.zero([Expression { constant: -1.0, ..Expression::of(self.moments[&[0; 6]]) }]);
        let matrices = self.matrices.iter().map(|Localized { basis, constraint }| {
            program.semidefinite(basis.len(), |i, j| {
                let square = product(&basis[i], &basis[j]);
                let mut entry = Expression::of(self.moments[&square]);
                if let Some((g, point)) = constraint {
                    for &(exponents, coefficient) in g.terms() {
                        let factor = point.exponents(exponents);
                        let moment = self.moments[&product(&square, &factor)];
                        entry.terms.push((moment, -coefficient * power(&self.scales, &factor)));
                    }
                }
                entry
            })
        });
        let matrices = matrices.collect();
        (program, Rows { matrices, objectives })
    }

    /// Nonnegative weights of sum 1 whose average of the objectives has the same minimum, up to
    /// rounding.
    pub(super) fn weights(&self, solution: &ConicSolution, rows: &Rows) -> Vec<f64> {
        if self.objectives.len() == 1 {
            return vec![1.0];
        }
        let weights = solution.multipliers(rows.objectives.clone()).map(|weight| weight.max(0.0));
        let sum = weights.sum();
        weights.iter().map(|weight| weight / sum).collect()
    }

    /// The Gram matrices that the multipliers are, for an objective or an average of several.
    pub(super) fn squares(
        &self,
        objective: &PairPolynomial,
        solution: &ConicSolution,
        rows: &Rows,
    ) -> Vec<WeightedSquares<'a>> {
        let squares = |(matrix, rows): (&Localized<'a>, &Range<usize>)| {
            let factors: Vec<f64> = matrix.basis.iter().map(|e| power(&self.scales, e)).collect();
            let multiplier = solution.matrix_multiplier(rows.clone(), matrix.basis.len());
            let gram = DMatrix::from_fn(factors.len(), factors.len(), |i, j| {
                multiplier[(i, j)] * self.unit / (factors[i] * factors[j])
            });
            WeightedSquares { basis: matrix.basis.clone(), gram, constraint: matrix.constraint }
        };
        let mut squares = self.matrices.iter().zip(&rows.matrices).map(squares).collect();
        close(objective, &mut squares);
        squares
    }

    /// The moment of a monomial of the divided coordinates.
    fn moment(&self, solution: &ConicSolution, exponents: &PairExponents) -> f64 {
        self.moments.get(exponents).map_or(0.0, |&variable| solution.variables[variable])
    }

    /// The mean of each point, in the common frame: the minimiser where it is unique and the level
    /// is exact.
    pub(super) fn first_moments(&self, solution: &ConicSolution) -> Vec<Vector3<f64>> {
        let mean = |SetPoint { set, point, .. }: &SetPoint| {
            let moment = |k: usize| {
                let unit = point.exponents(std::array::from_fn(|i| u8::from(i == k)));
                self.moment(solution, &unit) * power(&self.scales, &unit)
            };
            set.in_common_frame(&Vector3::from_fn(|k, _| moment(k)))
        };
        self.points.iter().map(mean).collect()
    }

    /// The points that each point's moments are those of, in the common frame.
    pub(super) fn atoms(&self, solution: &ConicSolution) -> Vec<Atoms> {
        let value = |exponents: &PairExponents| self.moment(solution, exponents);
        let rank_of = |basis: &[PairExponents]| {
            rank(DMatrix::from_fn(basis.len(), basis.len(), |i, j| value(&product(&basis[i], &basis[j]))))
        };
        let lines = self.points.iter().map(|of| monomials(1).into_iter().map(|e| of.point.exponents(e)).collect());
        let lines: Vec<Vec<PairExponents>> = lines.collect();
        let mut both = lines.concat();
        both.sort_unstable();
        both.dedup();
        let rank_of_both = rank_of(&both);
        let of_point = |(SetPoint { set, point, half_degree }, line): (&SetPoint, &Vec<PairExponents>)| {
            let found = atoms(*half_degree, |e| value(&point.exponents(e)));
            let scales: [f64; 3] = std::array::from_fn(|k| {
                power(&self.scales, &point.exponents(std::array::from_fn(|i| u8::from(i == k))))
            });
            let scales = Vector3::from(scales);
            Atoms {
                points: found.points.iter().map(|z| set.in_common_frame(&z.component_mul(&scales))).collect(),
                determines_other: rank_of(line) == rank_of_both,
                ..found
            }
        };
        self.points.iter().zip(&lines).map(of_point).collect()
    }
}

/// Spreads what the identity leaves over, but for its constant, over the entries of the Gram
/// matrices without constraints that give the same monomial.
fn close(objective: &PairPolynomial, squares: &mut Vec<WeightedSquares>) {
    let mut left: BTreeMap<PairExponents, (f64, usize)> = BTreeMap::new();
    for (exponents, coefficient) in objective.terms() {
        left.entry(exponents).or_default().0 += coefficient;
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
