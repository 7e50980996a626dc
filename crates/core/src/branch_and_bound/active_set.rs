//! Newton's method with active constraints: the least value of the largest of some functions f of
//! points of one or two sets,
//!
//! ```text
//! minimise t   subject to   f_i(x) <= t,   g_j(x) <= 1
//! ```
//!
//! where the g are the polynomials of the sets. With the active i and j, Newton's method solves
//! `Σ λ_i ∇f_i + Σ μ_j ∇g_j = 0`, `Σ λ_i = 1`, `f_i = t`, `g_j = 1`. A step ends where it meets
//! another constraint, which becomes active; at a solution the one whose multiplier is most
//! negative leaves (a primal active-set method; Nocedal and Wright, Numerical Optimization, 2006,
//! chapter 16). It finds a local minimiser at best; what it finds is proven elsewhere.

use super::placed_set::PlacedSet;
use crate::polynomial::Jet;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Newton steps at most, changes of what is active included.
///
/// A larger value spends time on searches that lead nowhere, a smaller one ends those of corners
/// early. It changes upper bounds, never their truth. Exercised by
/// `points_on_edges_and_corners_are_exact`.
const MAX_STEPS: usize = 60;

/// Longest step of Newton's method, relative to the radius of the smaller set; dimensionless.
///
/// The quadratic model is good near by only: a larger value lets steps leave the part of the set
/// where they began, a smaller one takes more steps. It changes upper bounds, never their truth:
/// every point found is proven in its set. Exercised by
/// `convex_bodies_have_the_distances_of_the_solver`, which counts boxes.
const LARGEST_STEP: f64 = 0.3;

/// Length of a step at which Newton's method has converged, relative to the longest step;
/// dimensionless.
///
/// Steps round at 1e-16 of the coordinates. A larger value leaves upper bounds wider, a smaller one
/// spends [`MAX_STEPS`] on rounding. It changes time only; no test pins it.
const CONVERGED: f64 = 1e-14;

/// Excess of a constraint at which it is violated, relative to its bound; dimensionless.
///
/// What is violated less, rounding of Newton's method may be; the point is pulled into its set
/// afterwards. Exercised by `points_on_edges_and_corners_are_exact`.
const VIOLATED: f64 = 1e-9;

/// Newton steps after which a constraint with a negative multiplier leaves before they converge:
/// some equations have no solution.
///
/// A larger value spends steps on these, a smaller one lets constraints leave that come back.
/// Exercised by `lowest_points_between_polynomials_are_exact`.
const PATIENCE: usize = 3;

/// Halvings of a step that meets a constraint: it ends within a four-thousandth of its length.
const HALVINGS: usize = 12;

/// What is added to the diagonal of the Hessian, relative to its trace; dimensionless.
///
/// Points of two flat faces move along both at no cost, which leaves the equations singular. A
/// larger value slows Newton's method down, a smaller one is lost in rounding. Exercised by
/// `points_on_edges_and_corners_are_exact`.
const REGULARISATION: f64 = 1e-10;

/// Coordinates of two points, and the largest number of active functions and polynomials: as many
/// as there are coordinates and t.
const COORDINATES: usize = 6;
const MAX_ACTIVE: usize = COORDINATES + 1;
/// Row of t, and of the first multiplier.
const T: usize = COORDINATES;
const FIRST: usize = T + 1;
const UNKNOWNS: usize = FIRST + MAX_ACTIVE;

/// Value, gradient and Hessian of a function of one or two points of the common frame, metres; of
/// one point the last three coordinates are 0.
#[derive(Clone, Debug)]
pub(super) struct Derivatives {
    pub(super) value: f64,
    pub(super) gradient: SVector<f64, COORDINATES>,
    pub(super) hessian: SMatrix<f64, COORDINATES, COORDINATES>,
}

impl Derivatives {
    /// Of a function of the point of one side.
    pub(super) fn of_point(side: usize, value: f64, gradient: &Vector3<f64>, hessian: &Matrix3<f64>) -> Self {
        let mut derivatives = Self { value, gradient: SVector::zeros(), hessian: SMatrix::zeros() };
        derivatives.gradient.fixed_rows_mut::<3>(3 * side).copy_from(gradient);
        derivatives.hessian.fixed_view_mut::<3, 3>(3 * side, 3 * side).copy_from(hessian);
        derivatives
    }

    /// Of a polynomial in the normalized coordinates of a set, whose linear map is given.
    pub(super) fn of_polynomial(side: usize, jet: &Jet, linear: &Matrix3<f64>) -> Self {
        Self::of_point(side, jet.value, &linear.tr_mul(&jet.gradient), &linear.tr_mul(&(jet.hessian * linear)))
    }

    /// `½ |x - y|²`, square metres.
    pub(super) fn half_squared_distance(x: &Vector3<f64>, y: &Vector3<f64>) -> Self {
        let (gap, identity) = (x - y, Matrix3::identity());
        let mut derivatives = Self::of_point(0, 0.5 * gap.norm_squared(), &gap, &identity);
        derivatives.gradient.fixed_rows_mut::<3>(3).copy_from(&-gap);
        derivatives.hessian.fixed_view_mut::<3, 3>(3, 3).copy_from(&identity);
        derivatives.hessian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-identity);
        derivatives.hessian.fixed_view_mut::<3, 3>(3, 0).copy_from(&-identity);
        derivatives
    }
}

/// What is minimised: the largest of some functions of points of `SETS` sets.
pub(super) trait Objective<const SETS: usize> {
    /// Number of functions, at least one.
    fn count(&self) -> usize;
    /// One of them, up to rounding.
    fn function(&self, index: usize, points: &[Vector3<f64>; SETS]) -> Derivatives;
    /// Whether the least value may be where no constraint is active.
    fn may_be_inside(&self) -> bool;
}

/// A function, or a polynomial of a set.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Constraint {
    Function(usize),
    Polynomial { side: usize, index: usize },
}

impl Constraint {
    /// Whether both are functions, or of the same set.
    fn is_of_kind(self, other: Self) -> bool {
        match (self, other) {
            (Self::Function(_), Self::Function(_)) => true,
            (Self::Polynomial { side: a, .. }, Self::Polynomial { side: b, .. }) => a == b,
            _ => false,
        }
    }
}

/// Sets, ready to be searched.
pub(super) struct ActiveSet<'a, const SETS: usize> {
    sets: [&'a PlacedSet<'a>; SETS],
    /// From the common frame to normalized coordinates.
    linear: [Matrix3<f64>; SETS],
    /// Metres.
    longest_step: f64,
}

/// Where a search is.
#[derive(Clone, Debug)]
struct State<const SETS: usize> {
    points: [Vector3<f64>; SETS],
    t: f64,
    /// What is active, with its multiplier.
    active: Vec<(Constraint, f64)>,
}

impl<const SETS: usize> State<SETS> {
    /// A part of a step.
    fn after(&self, step: &SVector<f64, UNKNOWNS>, share: f64) -> Self {
        let points = std::array::from_fn(|side| self.points[side] + step.fixed_rows::<3>(3 * side) * share);
        let multipliers = self.active.iter().zip(FIRST..).map(|(&(one, value), row)| (one, value + step[row] * share));
        Self { points, t: self.t + step[T] * share, active: multipliers.collect() }
    }

    /// Constraints of the kind of this one that are active.
    fn of_kind(&self, kind: Constraint) -> usize {
        self.active.iter().filter(|(one, _)| one.is_of_kind(kind)).count()
    }
}

impl<'a, const SETS: usize> ActiveSet<'a, SETS> {
    pub(super) fn new(sets: [&'a PlacedSet<'a>; SETS]) -> Self {
        let radius = sets.iter().map(|set| set.radius_m()).fold(f64::INFINITY, f64::min);
        Self { sets, linear: sets.map(PlacedSet::linear), longest_step: LARGEST_STEP * radius }
    }

    /// The linear part of the map of a set from the common frame to its normalized coordinates.
    pub(super) fn linear(&self, side: usize) -> &Matrix3<f64> {
        &self.linear[side]
    }

    /// The longest step, metres.
    pub(super) fn longest_step_m(&self) -> f64 {
        self.longest_step
    }

    /// About a local minimiser near the start, up to rounding; none where the first equations have
    /// no solution. The search begins on the boundary of each set, or with no constraint.
    pub(super) fn minimiser(
        &self,
        objective: &impl Objective<SETS>,
        start: [Vector3<f64>; SETS],
        on_boundary: bool,
    ) -> Option<[Vector3<f64>; SETS]> {
        let mut state = self.begin(objective, start, on_boundary);
        let mut since_change = 0;
        for count in 0..MAX_STEPS {
            let Some(step) = self.step(objective, &state) else { return (count > 0).then_some(state.points) };
            let length = step.fixed_rows::<COORDINATES>(0).amax();
            let share = (self.longest_step / length.max(f64::MIN_POSITIVE)).min(1.0);
            let met;
            (state, met) = self.advance(objective, &state, &step, share);
            since_change += 1;
            let has_converged = met.is_none() && length <= CONVERGED * self.longest_step;
            if let Some(constraint) = met {
                let is_of_set = matches!(constraint, Constraint::Polynomial { .. });
                if state.active.len() > 3 * SETS || is_of_set && state.of_kind(constraint) >= 3 {
                    break;
                }
                state.active.push((constraint, 0.0));
                since_change = 0;
            } else if (has_converged || since_change > PATIENCE) && self.leave(objective, &mut state) {
                since_change = 0;
            } else if has_converged {
                break;
            }
        }
        Some(state.points)
    }

    /// The largest function, and where the search begins on the boundary the largest polynomial of
    /// each set; with multipliers of the size of those at a minimiser, and positive.
    fn begin(&self, objective: &impl Objective<SETS>, points: [Vector3<f64>; SETS], on_boundary: bool) -> State<SETS> {
        let functions = (0..objective.count()).map(|index| (index, objective.function(index, &points)));
        let largest = functions.max_by(|a, b| a.1.value.total_cmp(&b.1.value));
        let mut state = State { points, t: 0.0, active: Vec::with_capacity(MAX_ACTIVE) };
        let Some((index, function)) = largest else { return state };
        state.t = function.value;
        state.active.push((Constraint::Function(index), 1.0));
        for side in (0..SETS).filter(|_| on_boundary) {
            let values = self.values(side, &points[side]).enumerate();
            let Some((index, _)) = values.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            let constraint = Constraint::Polynomial { side, index };
            let slope = self.derivatives(objective, constraint, &points).gradient.norm();
            let multiplier = function.gradient.fixed_rows::<3>(3 * side).norm() / slope.max(f64::MIN_POSITIVE);
            state.active.push((constraint, multiplier));
        }
        state
    }

    /// A part of a step, as far as no other constraint is violated; with the one that is next.
    fn advance(
        &self,
        objective: &impl Objective<SETS>,
        state: &State<SETS>,
        step: &SVector<f64, UNKNOWNS>,
        share: f64,
    ) -> (State<SETS>, Option<Constraint>) {
        let whole = state.after(step, share);
        let Some(mut met) = self.violated(objective, &whole) else { return (whole, None) };
        let (mut near, mut far) = (0.0, share);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (near + far);
            match self.violated(objective, &state.after(step, middle)) {
                Some(other) => (far, met) = (middle, other),
                None => near = middle,
            }
        }
        (state.after(step, near), Some(met))
    }

    /// What is violated most of what is not active.
    fn violated(&self, objective: &impl Objective<SETS>, state: &State<SETS>) -> Option<Constraint> {
        let polynomials = (0..SETS).flat_map(|side| {
            let values = self.values(side, &state.points[side]).enumerate();
            values.map(move |(index, value)| (Constraint::Polynomial { side, index }, value - 1.0))
        });
        // One function alone is active.
        let others = if objective.count() > 1 { 0..objective.count() } else { 0..0 };
        let functions = others.map(|index| {
            let excess = objective.function(index, &state.points).value - state.t;
            (Constraint::Function(index), excess / state.t.abs().max(1.0))
        });
        let is_active = |constraint: Constraint| state.active.iter().any(|(one, _)| *one == constraint);
        let violated = polynomials.chain(functions).filter(|(one, excess)| *excess > VIOLATED && !is_active(*one));
        violated.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(constraint, _)| constraint)
    }

    /// Takes out the one with the most negative multiplier; whether there was one. One function
    /// stays, and one polynomial of each set where the least value is on the boundary.
    fn leave(&self, objective: &impl Objective<SETS>, state: &mut State<SETS>) -> bool {
        let may_leave = |one: Constraint| {
            let may_be_empty = objective.may_be_inside() && matches!(one, Constraint::Polynomial { .. });
            may_be_empty || state.of_kind(one) > 1
        };
        let negative = state.active.iter().enumerate().filter(|(_, (one, value))| *value < 0.0 && may_leave(*one));
        let Some((least, _)) = negative.min_by(|a, b| a.1.1.total_cmp(&b.1.1)) else { return false };
        state.active.remove(least);
        true
    }

    /// Values of the polynomials of a set at a point of the common frame.
    fn values(&self, side: usize, x: &Vector3<f64>) -> impl Iterator<Item = f64> + use<'a, SETS> {
        let z = self.sets[side].normalized(x);
        self.sets[side].of.set.polynomials.iter().map(move |g| g.evaluate(&z).value)
    }

    fn derivatives(
        &self,
        objective: &impl Objective<SETS>,
        constraint: Constraint,
        points: &[Vector3<f64>; SETS],
    ) -> Derivatives {
        match constraint {
            Constraint::Function(index) => objective.function(index, points),
            Constraint::Polynomial { side, index } => {
                let set = self.sets[side];
                let jet = set.of.set.polynomials[index].evaluate(&set.normalized(&points[side]));
                Derivatives::of_polynomial(side, &jet, &self.linear[side])
            }
        }
    }

    /// A step of Newton's method on the equations of what is active.
    fn step(&self, objective: &impl Objective<SETS>, state: &State<SETS>) -> Option<SVector<f64, UNKNOWNS>> {
        // What is not there, the second point and further multipliers, stays.
        let mut matrix = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        let mut right = SVector::<f64, UNKNOWNS>::zeros();
        let used = |row: usize| row < 3 * SETS || (T..FIRST + state.active.len()).contains(&row);
        (0..UNKNOWNS).filter(|row| !used(*row)).for_each(|row| matrix[(row, row)] = 1.0);
        right[T] = 1.0;
        for (&(constraint, multiplier), row) in state.active.iter().zip(FIRST..) {
            let Derivatives { value, gradient, hessian } = self.derivatives(objective, constraint, &state.points);
            let mut block = matrix.fixed_view_mut::<COORDINATES, COORDINATES>(0, 0);
            // A constraint that is about to leave has a negative multiplier: with its curvature
            // steps alternate between two points.
            block += hessian * multiplier.max(0.0);
            matrix.fixed_view_mut::<COORDINATES, 1>(0, row).copy_from(&gradient);
            matrix.fixed_view_mut::<1, COORDINATES>(row, 0).copy_from(&gradient.transpose());
            let mut slope = right.fixed_rows_mut::<COORDINATES>(0);
            slope -= gradient * multiplier;
            right[row] = match constraint {
                Constraint::Function(_) => {
                    (matrix[(T, row)], matrix[(row, T)]) = (1.0, -1.0);
                    right[T] -= multiplier;
                    state.t - value
                }
                Constraint::Polynomial { .. } => 1.0 - value,
            };
        }
        let curvature = (0..3 * SETS).map(|row| matrix[(row, row)].abs()).sum::<f64>();
        (0..3 * SETS).for_each(|row| matrix[(row, row)] += REGULARISATION * curvature);
        let step = matrix.lu().solve(&right)?;
        step.iter().all(|value| value.is_finite()).then_some(step)
    }
}
