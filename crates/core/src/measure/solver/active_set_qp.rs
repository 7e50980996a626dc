//! Steps of Newton's method that find the active constraints on their way: quadratic programs in
//! four variables, three of a point and one of a value, whose constraints are the linearizations of
//! those of two bodies.
//!
//! ```text
//! min  c·v + vᵀ H v / 2   subject to   g_i·v <= r_i   for the constraints of A and of B
//! ```
//!
//! From a guess of what is active the equations of its optimality are solved, and what then pulls
//! the wrong way is dropped. After that all pull the right way: what is violated is taken, and of
//! the others those go whose multipliers vanish as that of the new one rises, until none is
//! violated (Goldfarb and Idnani, A numerically stable dual method for solving strictly convex
//! quadratic programs, 1983).

use crate::body::MAX_CONSTRAINTS;
use crate::measure::frames::query_frame::Posed;
use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::measure::solver::equality_program;
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::linear_systems::solve;
use crate::measure::solver::tangent_newton::LONGEST_STEP;
use crate::polynomial::Jet;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Variables of a program.
const VARIABLES: usize = 4;

/// Most changes of a guess of what is active, one constraint each.
pub(in crate::measure) const MAX_CHANGES: usize = 10;

/// Violation of a constraint of a program, relative to its scale and to its right side,
/// dimensionless, that counts as none.
///
/// Right sides round at 1e-16. A larger value returns points outside, a smaller one exchanges
/// constraints for rounding without end. Exercised by `solutions_are_optimal`.
const PROGRAM_VIOLATION: f64 = 1e-12;

/// Sine of the angle between a gradient and a combination of others, dimensionless, up to which it
/// is taken for their combination where the equations do not decide.
///
/// A larger value drops constraints of blunt edges, a smaller one keeps systems that are singular
/// to rounding. Exercised by `solutions_are_optimal`, whose gradients differ by 1 to 1e-15.
const APART: f64 = 1e-4;

/// How much of a stiffness, what the Hessian is of such values over such lengths, is added to it
/// until a step is short enough for it to mean something where the step leads (Levenberg and
/// Marquardt).
pub(in crate::measure) const DAMPINGS: [f64; 6] = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Most of the curvature along a gradient, as a share of it, dimensionless, that is taken off so
/// that the root of a power is stepped to.
///
/// At 1 the rest is singular; lower, steps towards the minimum of a power of degree d are a (d -
/// 1)-th part of the way. Exercised by `flats_of_different_orders_take_few_iterations`.
pub(in crate::measure) const MOST_BENT: f64 = 0.9;

/// Least damping, relative to the first; dimensionless. Rounding tilts faces by about as much.
///
/// A larger value makes steps along nearly parallel faces too short to find an edge; a smaller one
/// lets rounding choose their direction. Exercised by `nearly_parallel_sides_show_their_edges`.
pub(in crate::measure) const LEAST_DAMPING: f64 = 1e-9;

/// Weight of a step's length relative to the distance from such a centre, if it leads there;
/// dimensionless. The root of values that rise from a centre with a power is about a square, whose
/// minimum one step finds.
///
/// Larger, steps to the centre are cut; smaller, steps across it are not. Exercised by
/// `stages_of_level_distances_solve_alone`.
pub(in crate::measure) const TO_CENTER: f64 = 0.5;

/// Distance from such a centre, relative to its body, dimensionless, below which lengths are
/// measured relative to this distance instead.
///
/// Smaller, steps near the centre are cut to nothing; larger, steps past it are not cut. Exercised
/// by `stages_of_level_distances_solve_alone`.
pub(in crate::measure) const CENTER: f64 = 0.02;

/// All constraints of one body at one point.
pub(in crate::measure) struct Jets {
    jets: [Jet; MAX_CONSTRAINTS],
    len: usize,
}

impl Jets {
    pub(in crate::measure) fn new(body: &Posed<'_>, v: &Vector3<f64>) -> Self {
        let blank = Jet { value: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
        let mut jets = [blank; MAX_CONSTRAINTS];
        jets.iter_mut().take(body.len()).enumerate().for_each(|(i, jet)| *jet = body.jet(i, v));
        Self { jets, len: body.len() }
    }

    /// A constraint.
    pub(in crate::measure) fn jet(&self, i: usize) -> &Jet {
        &self.jets[i]
    }

    /// The active gradients; beyond those zeros.
    pub(in crate::measure) fn gradients(&self, active: &Active) -> [Vector3<f64>; MAX_ACTIVE] {
        let mut gradients = [Vector3::zeros(); MAX_ACTIVE];
        active.iter().zip(&mut gradients).for_each(|((i, _), gradient)| *gradient = self.jets[i].gradient);
        gradients
    }

    /// Sum of the active gradients, weighted by their multipliers.
    pub(in crate::measure) fn gradient(&self, active: &Active) -> Vector3<f64> {
        active.iter().map(|(i, multiplier)| self.jets[i].gradient * multiplier).sum()
    }

    /// Sum of the active Hessians, weighted by their multipliers. What pulls the wrong way is about
    /// to be dropped and bends nothing.
    pub(in crate::measure) fn hessian(&self, active: &Active) -> Matrix3<f64> {
        active.iter().map(|(i, multiplier)| self.jets[i].hessian * multiplier.max(0.0)).sum()
    }

    /// Linear constraints, each made of a jet.
    pub(in crate::measure) fn rows(&self, scale: f64, row: impl Fn(&Jet) -> (Vector4<f64>, f64)) -> Rows {
        let mut rows = Rows { rows: [(Vector4::zeros(), 0.0); MAX_CONSTRAINTS], len: self.len, scale };
        self.jets.iter().zip(&mut rows.rows).take(self.len).for_each(|(jet, of_jet)| *of_jet = row(jet));
        rows
    }
}

/// Linear constraints `g·v <= r` of one body.
pub(in crate::measure) struct Rows {
    rows: [(Vector4<f64>, f64); MAX_CONSTRAINTS],
    len: usize,
    /// What violations are measured by.
    scale: f64,
}

impl Rows {
    /// The constraint that v violates most, of those that may count.
    fn violated(&self, v: &Vector4<f64>, counts: impl Fn(usize) -> bool) -> Option<usize> {
        (0..self.len)
            .filter(|&i| counts(i))
            .map(|i| (i, self.rows[i].0.dot(v) - self.rows[i].1))
            .filter(|(i, excess)| *excess > PROGRAM_VIOLATION * self.scale.max(self.rows[*i].1.abs()))
            .max_by(|p, q| p.1.total_cmp(&q.1))
            .map(|(i, _)| i)
    }
}

/// A quadratic program.
pub(in crate::measure) struct Quadratic {
    pub(in crate::measure) hessian: Matrix4<f64>,
    pub(in crate::measure) cost: Vector4<f64>,
    pub(in crate::measure) a: Rows,
    pub(in crate::measure) b: Rows,
    /// Whether the program has a solution without any constraint of B.
    pub(in crate::measure) free_of_b: bool,
}

/// A solution, with what is active there.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Solution {
    pub(in crate::measure) v: Vector4<f64>,
    pub(in crate::measure) a: Active,
    pub(in crate::measure) b: Active,
}

/// Active constraints of both bodies with their multipliers, one more than determine a point. Those
/// of B are numbered on from A's.
#[derive(Clone, Copy, Default)]
struct Working {
    index: [usize; VARIABLES + 1],
    multiplier: [f64; VARIABLES + 1],
    len: usize,
}

impl Working {
    fn push(&mut self, index: usize) {
        (self.index[self.len], self.multiplier[self.len]) = (index, 0.0);
        self.len += 1;
    }

    fn remove(&mut self, k: usize) {
        self.index.copy_within(k + 1..self.len, k);
        self.multiplier.copy_within(k + 1..self.len, k);
        self.len -= 1;
    }

    fn index(&self) -> &[usize] {
        &self.index[..self.len]
    }
}

impl Quadratic {
    /// The solution from a guess of what is active on; of damped programs the first whose step is
    /// short enough, if there is one, damped less where that leaves the step far from long.
    pub(in crate::measure) fn step(
        mut self,
        a: Active,
        b: Active,
        length: impl Fn(&Vector3<f64>) -> f64,
        stiffness: &Matrix4<f64>,
    ) -> Option<Solution> {
        let length = |found: &Option<Solution>| found.as_ref().map_or(f64::INFINITY, |step| length(&step.v.xyz()));
        let mut found = self.solve(a, b);
        if length(&found) <= LONGEST_STEP {
            return found;
        }
        let hessian = self.hessian;
        for (i, damping) in DAMPINGS.into_iter().enumerate() {
            self.hessian = hessian + stiffness * damping;
            found = self.solve(a, b).or(found);
            let least = length(&found);
            if least <= LONGEST_STEP {
                if i == 0 && least < 0.5 * LONGEST_STEP {
                    // Along what does not bend a step is as long as the damping is little: of faces
                    // nearly parallel only such a step finds the edges.
                    self.hessian = hessian + stiffness * (damping * (2.0 * least / LONGEST_STEP).max(LEAST_DAMPING));
                    let longer = self.solve(a, b);
                    return if length(&longer) <= LONGEST_STEP { longer } else { found };
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
        let mut active = Working::default();
        a.iter().for_each(|(i, _)| active.push(i));
        b.iter().for_each(|(i, _)| active.push(self.a.len + i));
        let mut v = self.equations(&mut active)?;
        for _ in 0..MAX_CHANGES {
            let pulling = (0..active.len).filter(|&k| active.multiplier[k] < 0.0 && self.may_lose(&active, k));
            if let Some(k) = pulling.min_by(|&i, &j| active.multiplier[i].total_cmp(&active.multiplier[j])) {
                active.remove(k);
                v = self.equations(&mut active)?;
                continue;
            }
            let of_a = || self.a.violated(&v, |i| !active.index().contains(&i));
            let of_b = || Some(self.a.len + self.b.violated(&v, |i| !active.index().contains(&(self.a.len + i)))?);
            let take = |new| self.take(new, active);
            match of_a().and_then(take).or_else(|| of_b().and_then(take)) {
                Some(next) => (active, v) = next,
                None => break,
            }
        }
        Some(self.solution(v, &active))
    }

    /// What is active with one more constraint, and the point: until that is satisfied its
    /// multiplier rises, those of the others change with it, and the first of them to vanish goes.
    /// None if none of them does that has to, or there are too many of the body.
    fn take(&self, new: usize, mut active: Working) -> Option<(Working, Vector4<f64>)> {
        active.push(new);
        loop {
            let mut then = active;
            let solved = if active.len > VARIABLES { None } else { self.equations(&mut then) };
            // Of a gradient that is a sum of the others' the multiplier rises without bound.
            if solved.is_none() {
                then = self.exchanged(active)?;
            }
            let others = (0..active.len - 1).filter(|&k| self.may_lose(&active, k));
            let vanishing = others.filter_map(|k| {
                let (now, then) = (active.multiplier[k], then.multiplier[k]);
                let vanishes = then < if solved.is_some() { 0.0 } else { now };
                vanishes.then(|| (k, if now > 0.0 { now / (now - then) } else { 0.0 }))
            });
            let Some((first, share)) = vanishing.min_by(|p, q| p.1.total_cmp(&q.1)) else {
                return solved.filter(|_| self.of_one_body(&then, new) <= MAX_ACTIVE).map(|v| (then, v));
            };
            let both = active.multiplier.iter_mut().zip(then.multiplier);
            both.for_each(|(now, then)| *now += share * (then - *now));
            active.remove(first);
        }
    }

    /// The multipliers as the last one rises by 1, whose gradient is a sum of the others'; none if
    /// it is not.
    fn exchanged(&self, mut active: Working) -> Option<Working> {
        let last = active.len - 1;
        let gradients: [Vector4<f64>; VARIABLES + 1] =
            std::array::from_fn(|k| if k <= last { self.row(active.index[k]).0 } else { Vector4::zeros() });
        let (shares, rest) = least_squares(&gradients[..last], &gradients[last]);
        (0..last).for_each(|k| active.multiplier[k] -= shares[k]);
        active.multiplier[last] += 1.0;
        (rest.norm() <= APART * gradients[last].norm()).then_some(active)
    }

    /// Whether the program has a solution without this one of the active constraints.
    fn may_lose(&self, active: &Working, k: usize) -> bool {
        let of_b = active.index[k] >= self.a.len;
        of_b && self.free_of_b || self.of_one_body(active, active.index[k]) > 1
    }

    /// How many of the active constraints are of the body of one.
    fn of_one_body(&self, active: &Working, one: usize) -> usize {
        active.index().iter().filter(|&&i| (i < self.a.len) == (one < self.a.len)).count()
    }

    /// A constraint by its number.
    fn row(&self, i: usize) -> &(Vector4<f64>, f64) {
        if i < self.a.len { &self.a.rows[i] } else { &self.b.rows[i - self.a.len] }
    }

    /// A point with what is active there.
    fn solution(&self, v: Vector4<f64>, active: &Working) -> Solution {
        let (mut a, mut b) = (Active::default(), Active::default());
        for (&i, &multiplier) in active.index().iter().zip(&active.multiplier) {
            let (set, i) = if i < self.a.len { (&mut a, i) } else { (&mut b, i - self.a.len) };
            if set.push(i) {
                set.multiplier[set.len - 1] = multiplier;
            }
        }
        Solution { v, a, b }
    }

    /// Solves the equations of optimality with the active constraints, which get their multipliers.
    fn equations(&self, active: &mut Working) -> Option<Vector4<f64>> {
        let rows = active.index().iter().map(|&index| *self.row(index));
        let (v, multipliers) = equality_program::minimize(&self.hessian, &self.cost, rows, solve)?;
        active.multiplier[..active.len].copy_from_slice(&multipliers[..active.len]);
        Some(v)
    }
}

/// The shares of independent vectors in the sum of them that comes nearest to another, and what
/// that leaves (the modified method of Gram and Schmidt; Golub and Van Loan, Matrix computations,
/// 2013, section 5.2.8).
fn least_squares(vectors: &[Vector4<f64>], of: &Vector4<f64>) -> ([f64; VARIABLES], Vector4<f64>) {
    let (mut directions, mut upper) = ([Vector4::zeros(); VARIABLES], Matrix4::zeros());
    let (mut shares, mut rest) = ([0.0; VARIABLES], *of);
    for (k, vector) in vectors.iter().enumerate() {
        let mut left = *vector;
        for i in 0..k {
            upper[(i, k)] = directions[i].dot(&left);
            left -= directions[i] * upper[(i, k)];
        }
        upper[(k, k)] = left.norm();
        directions[k] = left / upper[(k, k)];
        shares[k] = directions[k].dot(&rest);
        rest -= directions[k] * shares[k];
    }
    for k in (0..vectors.len()).rev() {
        let known: f64 = (k + 1..vectors.len()).map(|j| upper[(k, j)] * shares[j]).sum();
        shares[k] = (shares[k] - known) / upper[(k, k)];
    }
    (shares, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    /// Planes around a point, `-t` as well as they: for every seed some that are the same as others
    /// but for rounding.
    fn random_rows(random: &mut Seeded, slope: f64, others: &[(Vector4<f64>, f64)]) -> Rows {
        let mut rows = Rows { rows: [(Vector4::zeros(), 0.0); MAX_CONSTRAINTS], len: 4, scale: 1.0 };
        for k in 0..4 {
            let g = Vector3::from_fn(|_, _| random.signed());
            rows.rows[k] = (g.push(slope), 0.1 + random.signed().abs());
            let (same, hair) = (random.next() % 8, 10_f64.powi(-((random.next() % 16) as i32)));
            let twin = if same < 4 { rows.rows[..k].get(same as usize) } else { others.get(same as usize - 4) };
            if let Some((twin, room)) = twin.copied() {
                let tilted = twin.xyz() + g * hair;
                rows.rows[k] = (tilted.push(slope), room + random.signed() * hair);
            }
        }
        rows
    }

    #[test]
    fn solutions_are_optimal() {
        let (mut solved, mut crowded) = (0, 0);
        for seed in 0..20_000 {
            let mut random = Seeded(seed);
            let root = Matrix3::from_fn(|_, _| random.signed());
            let curvature = root * root.transpose() + Matrix3::identity() * 0.1;
            let mut hessian = Matrix4::zeros();
            hessian.fixed_view_mut::<3, 3>(0, 0).copy_from(&curvature);
            // The least t that no constraint of A exceeds, within those of B.
            let a = random_rows(&mut random, -1.0, &[]);
            let b = random_rows(&mut random, 0.0, &a.rows[..4]);
            let program = Quadratic { hessian, cost: Vector4::w(), a, b, free_of_b: true };
            let (mut a, mut b) = (Active::default(), Active::default());
            a.push((random.next() % 4) as usize);
            b.push((random.next() % 4) as usize);
            let Some(found) = program.solve(a, b) else { continue };
            let all = |rows: &Rows| rows.rows[..4].iter().map(|(g, r)| g.dot(&found.v) - r).fold(f64::MIN, f64::max);
            let pulling = found.a.iter().chain(found.b.iter()).any(|(_, multiplier)| multiplier < 0.0);
            if all(&program.a).max(all(&program.b)) > 1e-9 || pulling {
                crowded += u32::from(found.a.len.max(found.b.len) == MAX_ACTIVE);
                continue;
            }
            solved += 1;
            // Feasible, no multiplier negative, and gradients in balance: optimal, the program
            // being convex.
            let of = |rows: &Rows, active: &Active| {
                active.iter().map(|(i, multiplier)| rows.rows[i].0 * multiplier).sum::<Vector4<f64>>()
            };
            let balance =
                program.hessian * found.v + program.cost + of(&program.a, &found.a) + of(&program.b, &found.b);
            let largest = found.a.iter().chain(found.b.iter()).map(|(_, multiplier)| multiplier).fold(1.0, f64::max);
            assert!(balance.norm() < 1e-12 * largest, "seed {seed}: {balance}");
        }
        // The others had more active constraints of one body than the method keeps.
        assert!(solved > 18_000 && solved + crowded > 19_990, "{solved} solved, {crowded} crowded");
    }
}
