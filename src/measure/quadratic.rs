//! Steps of Newton's method that find the active constraints on their way: quadratic programs in four variables, three of a point
//! and one of a value, whose constraints are the linearizations of those of two bodies.
//!
//! ```text
//! min  c·v + vᵀ H v / 2   subject to   g_i·v <= r_i   for the constraints of A and of B
//! ```
//!
//! From a guess of what is active the equations of its optimality are solved; what then pulls the wrong way is dropped, what is
//! violated is added, where four are active already in place of the one that the dual simplex method gives up, until none is
//! left (a primal-dual active-set method; Nocedal and Wright, Numerical optimization, 2006,
//! chapter 16 and 18).

use super::active::MAX_ACTIVE;
use super::linear::{Augmented, MAX_UNKNOWNS, solve};
use super::newton::Active;
use super::pair::Posed;
use crate::body::MAX_CONSTRAINTS;
use crate::polynomial::Jet;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Variables of a program.
const VARIABLES: usize = 4;

/// Most changes of the guess.
const MAX_CHANGES: usize = 8;

/// Violation of a constraint, relative to its scale, that counts as none.
const VIOLATED: f64 = 1e-10;

/// How much of a stiffness, what the Hessian is of such values over such lengths, is added to it until a step is short enough for it
/// to mean something where the step leads (Levenberg and Marquardt).
pub(super) const DAMPINGS: [f64; 6] = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Most of the curvature along a gradient that is not that of the root of what rises with a power.
pub(super) const MOST_BENT: f64 = 0.9;

/// Longest step, relative to the bodies and to the distance from a centre that values rise from, that a linearization may mean
/// anything for.
pub(super) const LONGEST: f64 = 0.5;

/// Length of a step, in the same measure, that is well within that.
pub(super) const SHORT: f64 = 0.5 * LONGEST;

/// Least damping, relative to the first: rounding tilts faces by about as much.
pub(super) const LEAST: f64 = 1e-9;

/// How long a step is relative to the distance from such a centre, if it leads there: the root of values that rise from a centre with a
/// power is about a square, whose least one step finds.
pub(super) const TO_CENTER: f64 = 0.5;

/// Distance from such a centre, relative to its body, that counts as none.
pub(super) const CENTER: f64 = 0.02;

/// All constraints of one body at one point.
pub(super) struct Jets {
    jets: [Jet; MAX_CONSTRAINTS],
    len: usize,
}

impl Jets {
    pub(super) fn new(body: &Posed<'_>, v: &Vector3<f64>) -> Self {
        let blank = Jet { value: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
        let mut jets = [blank; MAX_CONSTRAINTS];
        jets.iter_mut().take(body.len()).enumerate().for_each(|(i, jet)| *jet = body.jet(i, v));
        Self { jets, len: body.len() }
    }

    /// A constraint.
    pub(super) fn jet(&self, i: usize) -> &Jet {
        &self.jets[i]
    }

    /// The active gradients; beyond those zeros.
    pub(super) fn gradients(&self, active: &Active) -> [Vector3<f64>; MAX_ACTIVE] {
        let mut gradients = [Vector3::zeros(); MAX_ACTIVE];
        active.iter().zip(&mut gradients).for_each(|((i, _), gradient)| *gradient = self.jets[i].gradient);
        gradients
    }

    /// Sum of the active gradients, weighted by their multipliers.
    pub(super) fn gradient(&self, active: &Active) -> Vector3<f64> {
        active.iter().map(|(i, multiplier)| self.jets[i].gradient * multiplier).sum()
    }

    /// Sum of the active Hessians, weighted by their multipliers. What pulls the wrong way is about to be dropped and bends nothing.
    pub(super) fn hessian(&self, active: &Active) -> Matrix3<f64> {
        active.iter().map(|(i, multiplier)| self.jets[i].hessian * multiplier.max(0.0)).sum()
    }

    /// Linear constraints, each made of a jet.
    pub(super) fn rows(&self, scale: f64, row: impl Fn(&Jet) -> (Vector4<f64>, f64)) -> Rows {
        let mut rows = Rows { rows: [(Vector4::zeros(), 0.0); MAX_CONSTRAINTS], len: self.len, scale };
        self.jets.iter().zip(&mut rows.rows).take(self.len).for_each(|(jet, of_jet)| *of_jet = row(jet));
        rows
    }
}

/// Linear constraints `g·v <= r` of one body.
pub(super) struct Rows {
    rows: [(Vector4<f64>, f64); MAX_CONSTRAINTS],
    len: usize,
    /// What violations are measured by.
    scale: f64,
}

impl Rows {
    /// The constraint that is not active and that v violates most.
    fn violated(&self, active: &Active, v: &Vector4<f64>) -> Option<usize> {
        (0..self.len)
            .filter(|i| !active.index[..active.len].contains(i))
            .map(|i| (i, self.rows[i].0.dot(v) - self.rows[i].1))
            .filter(|(_, excess)| *excess > VIOLATED * self.scale)
            .max_by(|p, q| p.1.total_cmp(&q.1))
            .map(|(i, _)| i)
    }
}

/// A quadratic program.
pub(super) struct Quadratic {
    pub(super) hessian: Matrix4<f64>,
    pub(super) cost: Vector4<f64>,
    pub(super) a: Rows,
    pub(super) b: Rows,
    /// Whether the program has a solution without any constraint of B.
    pub(super) free_of_b: bool,
}

/// A solution, with what is active there.
#[derive(Clone, Copy)]
pub(super) struct Solution {
    pub(super) v: Vector4<f64>,
    pub(super) a: Active,
    pub(super) b: Active,
}

impl Quadratic {
    /// The solution from a guess of what is active on; of damped programs the first whose step is short enough, if there is
    /// one, damped less where that leaves the step far from long.
    pub(super) fn step(
        mut self,
        a: Active,
        b: Active,
        length: impl Fn(&Vector3<f64>) -> f64,
        stiffness: &Matrix4<f64>,
    ) -> Option<Solution> {
        let length = |found: &Option<Solution>| found.as_ref().map_or(f64::INFINITY, |step| length(&step.v.xyz()));
        let mut found = self.solve(a, b);
        if length(&found) <= LONGEST {
            return found;
        }
        let hessian = self.hessian;
        for (i, damping) in DAMPINGS.into_iter().enumerate() {
            self.hessian = hessian + stiffness * damping;
            found = self.solve(a, b).or(found);
            let least = length(&found);
            if least <= LONGEST {
                if i == 0 && least < SHORT {
                    // Along what does not bend a step is as long as the damping is little: of faces tilted by next to nothing
                    // only such a step shows the edges.
                    self.hessian = hessian + stiffness * (damping * (least / SHORT).max(LEAST));
                    let longer = self.solve(a, b);
                    return if length(&longer) <= LONGEST { longer } else { found };
                }
                break;
            }
        }
        found
    }

    /// The solution; none if the equations of a guess have none.
    fn solve(&self, mut a: Active, mut b: Active) -> Option<Solution> {
        // More than as many as there are variables are dependent; the lowest of a guess come last.
        while a.len + b.len > VARIABLES {
            if a.len > b.len { a.len -= 1 } else { b.len -= 1 }
        }
        for changes in 0..=MAX_CHANGES {
            let v = self.equations(&mut a, &mut b)?;
            let changed = changes < MAX_CHANGES
                && (a.drop_negative()
                    || (if self.free_of_b { b.drop_pulling() } else { b.drop_negative() })
                    || self.take_violated(&mut a, &mut b, &v));
            if !changed {
                return Some(Solution { v, a, b });
            }
        }
        None
    }

    /// Takes the constraint of A that v violates most, or else that of B; whether there is one and room for it.
    fn take_violated(&self, a: &mut Active, b: &mut Active, v: &Vector4<f64>) -> bool {
        if let Some(i) = self.a.violated(a, v)
            && let Some((mut of_a, of_b)) = self.with_room(*a, *b, &self.a.rows[i].0)
            && of_a.push(i)
        {
            (*a, *b) = (of_a, of_b);
            return true;
        }
        if let Some(i) = self.b.violated(b, v)
            && let Some((of_a, mut of_b)) = self.with_room(*a, *b, &self.b.rows[i].0)
            && of_b.push(i)
        {
            (*a, *b) = (of_a, of_b);
            return true;
        }
        false
    }

    /// The active constraints without one, where they determine the point: that whose multiplier is the first to vanish as the one of
    /// the new gradient rises (the dual simplex method).
    fn with_room(&self, mut a: Active, mut b: Active, new: &Vector4<f64>) -> Option<(Active, Active)> {
        if a.len + b.len < VARIABLES {
            return Some((a, b));
        }
        // The new gradient as a sum of the active ones.
        let mut m = [[0.0; VARIABLES + 1]; VARIABLES];
        let rows = a.iter().map(|(i, _)| &self.a.rows[i]).chain(b.iter().map(|(i, _)| &self.b.rows[i]));
        for (k, (gradient, _)) in rows.enumerate() {
            (0..VARIABLES).for_each(|i| m[i][k] = gradient[i]);
        }
        (0..VARIABLES).for_each(|i| m[i][VARIABLES] = new[i]);
        let shares = solve(&mut m, VARIABLES)?;
        let multipliers = a.multiplier[..a.len].iter().chain(&b.multiplier[..b.len]);
        let vanishing = multipliers.zip(shares).enumerate().filter(|(_, (_, share))| *share > 0.0);
        let ratios = vanishing.map(|(k, (multiplier, share))| (k, multiplier / share));
        let (first, _) = ratios.min_by(|p, q| p.1.total_cmp(&q.1))?;
        if first < a.len {
            a.remove(first);
        } else {
            b.remove(first - a.len);
        }
        Some((a, b))
    }

    /// Solves the equations of optimality with the active constraints, which get their multipliers.
    fn equations(&self, a: &mut Active, b: &mut Active) -> Option<Vector4<f64>> {
        let mut m: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
        let size = 4 + a.len + b.len;
        for i in 0..4 {
            (0..4).for_each(|j| m[i][j] = self.hessian[(i, j)]);
            m[i][size] = -self.cost[i];
        }
        let rows = a.iter().map(|(i, _)| &self.a.rows[i]).chain(b.iter().map(|(i, _)| &self.b.rows[i]));
        for (k, (gradient, room)) in rows.enumerate() {
            for i in 0..4 {
                m[i][4 + k] = gradient[i];
                m[4 + k][i] = gradient[i];
            }
            m[4 + k][size] = *room;
        }
        let solution = solve(&mut m, size)?;
        a.multiplier[..a.len].copy_from_slice(&solution[4..4 + a.len]);
        b.multiplier[..b.len].copy_from_slice(&solution[4 + a.len..size]);
        Some(Vector4::from_row_slice(&solution[..4]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polynomial::tests::Seeded;

    /// Random programs with a bounded solution: `-t` under planes around a point, as many of A as of B.
    fn random_rows(random: &mut Seeded, slope: f64) -> Rows {
        let mut rows = Rows { rows: [(Vector4::zeros(), 0.0); MAX_CONSTRAINTS], len: 4, scale: 1.0 };
        for row in &mut rows.rows[..4] {
            let g = Vector3::from_fn(|_, _| random.signed());
            *row = (g.push(slope), 0.1 + random.signed().abs());
        }
        rows
    }

    #[test]
    fn solutions_are_optimal() {
        let mut solved = 0;
        for seed in 0..2_000 {
            let mut random = Seeded(seed);
            let root = Matrix3::from_fn(|_, _| random.signed());
            let curvature = root * root.transpose() + Matrix3::identity() * 0.1;
            let mut hessian = Matrix4::zeros();
            hessian.fixed_view_mut::<3, 3>(0, 0).copy_from(&curvature);
            // The least t that no constraint of A exceeds, within those of B.
            let program = Quadratic {
                hessian,
                cost: Vector4::w(),
                a: random_rows(&mut random, -1.0),
                b: random_rows(&mut random, 0.0),
                free_of_b: true,
            };
            let (mut a, mut b) = (Active::default(), Active::default());
            a.push((random.next() % 4) as usize);
            b.push((random.next() % 4) as usize);
            let Some(found) = program.solve(a, b) else { continue };
            let all = |rows: &Rows| rows.rows[..4].iter().map(|(g, r)| g.dot(&found.v) - r).fold(f64::MIN, f64::max);
            let pulling = found.a.iter().chain(found.b.iter()).any(|(_, multiplier)| multiplier < 0.0);
            if all(&program.a).max(all(&program.b)) > 1e-9 || pulling {
                // Gone round in circles until the last change.
                continue;
            }
            solved += 1;
            // Feasible, no multiplier negative, and gradients in balance: optimal, the program being convex.
            let of = |rows: &Rows, active: &Active| {
                active.iter().map(|(i, multiplier)| rows.rows[i].0 * multiplier).sum::<Vector4<f64>>()
            };
            let balance =
                program.hessian * found.v + program.cost + of(&program.a, &found.a) + of(&program.b, &found.b);
            assert!(balance.norm() < 1e-9, "seed {seed}: {balance}");
        }
        // The others went round in circles, or had more active constraints than the method keeps.
        assert!(solved > 1_700, "{solved}");
    }
}
