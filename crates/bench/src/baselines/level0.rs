//! The distance as level 0 of the hierarchy has it, one semidefinite program per query, in moments.
//!
//! ```text
//! min t   subject to   |E x - E y| <= t,   E g_i <= 1,   E h_j <= 1,
//!                      M(z_A), M(z_B) positive semidefinite
//! ```
//!
//! over the moments of both bodies' normalized coordinates z up to the degree, M the matrix of the
//! moments of all products of two monomials of half of it. It is the dual of the program of sums of
//! squares with one Gram matrix per body, and exact for the same sets; it has fewer variables by
//! far. Where the constraints are sos-convex, the first moments are the witnesses.

use nalgebra::Vector3;
use serde::Serialize;
use std::collections::BTreeMap;
use sublevel::body::Body;
use sublevel::measure::Pose;
use sublevel::polynomial::{Exponents, monomials};

/// `min c·v` subject to `b - A v` in a product of cones.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ConicProgram {
    /// c.
    cost: Vec<f64>,
    /// A: row, column, value.
    entries: Vec<(usize, usize, f64)>,
    /// b.
    sides: Vec<f64>,
    /// Nonnegative rows come first: so many; then a second-order cone of so many; then the upper
    /// triangles by columns of semidefinite matrices of these sizes, off the diagonal times √2.
    nonnegative: usize,
    second_order: usize,
    semidefinite: Vec<usize>,
}

/// Variable of each monomial but 1, whose moment is 1.
type Moments = BTreeMap<Exponents, usize>;

impl ConicProgram {
    /// The distance of two posed bodies, its optimum in units of `size_m`.
    pub(crate) fn distance(bodies: [(&Body, &Pose); 2], size_m: f64) -> Self {
        let mut program = Self {
            cost: vec![1.0],
            entries: Vec::new(),
            sides: Vec::new(),
            nonnegative: 0,
            second_order: 4,
            semidefinite: Vec::new(),
        };
        let moments = bodies.map(|(body, _)| program.moments(body.degree()));
        for ((body, _), moments) in bodies.iter().zip(&moments) {
            for constraint in body.constraints() {
                program.row(constraint.polynomial.terms().iter().copied(), moments, -1.0, 1.0);
                program.nonnegative += 1;
            }
        }
        program.distance_cone(bodies, &moments, size_m);
        for ((body, _), moments) in bodies.iter().zip(&moments) {
            let basis = monomials(body.degree() / 2);
            for (j, right) in basis.iter().enumerate() {
                for (i, left) in basis[..=j].iter().enumerate() {
                    let weight = if i == j { 1.0 } else { std::f64::consts::SQRT_2 };
                    let product = std::array::from_fn(|k| left[k] + right[k]);
                    program.row([(product, weight)].into_iter(), moments, 1.0, 0.0);
                }
            }
            program.semidefinite.push(basis.len());
        }
        program
    }

    fn moments(&mut self, degree: usize) -> Moments {
        let all = monomials(degree).into_iter().filter(|e| *e != [0; 3]);
        let first = self.cost.len();
        let moments: Moments = all.zip(first..).collect();
        self.cost.resize(first + moments.len(), 0.0);
        moments
    }

    /// A row that holds `side + sign E p` for the polynomial with these terms.
    fn row(&mut self, terms: impl Iterator<Item = (Exponents, f64)>, moments: &Moments, sign: f64, mut side: f64) {
        let row = self.sides.len();
        for (e, c) in terms {
            match moments.get(&e) {
                Some(&column) => self.entries.push((row, column, -sign * c)),
                None => side += sign * c,
            }
        }
        self.sides.push(side);
    }

    /// `(t, E x - E y)`, in units of the size.
    fn distance_cone(&mut self, bodies: [(&Body, &Pose); 2], moments: &[Moments; 2], size_m: f64) {
        let first = self.sides.len();
        self.entries.push((first, 0, -1.0));
        self.sides.push(0.0);
        let mut apart = Vector3::zeros();
        for (((body, pose), moments), sign) in bodies.iter().zip(moments).zip([1.0, -1.0]) {
            let rotation = pose.rotation().to_rotation_matrix().into_inner();
            let map = rotation * body.inverse() * (sign / size_m);
            apart += (rotation * body.normalization().center + pose.translation()) * (sign / size_m);
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                let linear: Exponents = std::array::from_fn(|k| u8::from(k == j));
                if let Some(&column) = moments.get(&linear) {
                    self.entries.push((first + 1 + i, column, -map[(i, j)]));
                }
            }
        }
        self.sides.extend(apart.iter());
    }
}

#[cfg(test)]
#[path = "../../examples/clarabel/solve.rs"]
mod solve;

#[cfg(test)]
mod tests {
    use super::super::tests::{axes_apart, balls_apart};
    use super::{ConicProgram, solve};
    use nalgebra::Vector3;
    use sublevel::body::Body;
    use sublevel::measure::{Options, Pose, WarmStart, distance};

    fn solved(a: &Body, b: &Body, pose: &Pose) -> f64 {
        let program = ConicProgram::distance([(a, &Pose::identity()), (b, pose)], 2.0);
        let text = serde_json::to_string(&program).unwrap();
        2.0 * solve::solve(&serde_json::from_str(&text).unwrap(), 1e-9).value
    }

    #[test]
    fn the_optimum_is_the_distance() {
        for (a, b, pose, distance) in [balls_apart(), axes_apart()] {
            let found = solved(&a, &b, &pose);
            assert!((found - distance).abs() < 1e-6, "{found} for {distance}");
        }
    }

    #[test]
    fn several_constraints_and_higher_degrees_are_stated_too() {
        let a = Body::cylinder("post", 0.2, 1.0).unwrap();
        let b = Body::superellipsoid("block", Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.5, 0.4, 0.3), 4).unwrap();
        let pose = Pose::from_quaternion(Vector3::new(1.5, 0.4, 0.6), [0.0, 0.48, 0.36, 0.8]).unwrap();
        let known = distance(&a, &Pose::identity(), &b, &pose, &Options::default(), &mut WarmStart::default());
        let found = solved(&a, &b, &pose);
        assert!((found - known.value()).abs() < 1e-6, "{found} for {}", known.value());
    }
}
