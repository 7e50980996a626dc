//! What an answer to a pair must be, by 200 bits.

use super::pair::Pair;
use super::shape::Shape;
use super::solved::{Reference, Solved};
use nalgebra::Vector3;
use sublevel_core::measure::{MAX_ITERATIONS, Pose, Status, Twist, WarmStart};

/// What is wrong with an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Flaw {
    /// The bracket misses the truth, or the value or gradient is farther from it than allowed: by
    /// this, relative to the size of the pair or to the norm of the gradient.
    Off(f64),
    /// It claims to be what it is not.
    Status(String),
}

/// Rounding of a polynomial's value on the surface.
const LEVEL: f64 = 1e-12;

/// Width of the bracket whose witnesses 200 bits start from, relative to the size of the pair.
const TIGHT: f64 = 1e-12;

/// Width of the reference's own bracket, relative to the width that is narrow enough, up to which
/// it decides.
const SHARP: f64 = 1e-2;

/// The floor that `Options::with_accuracy` states, relative to the larger shape and the distance of
/// both.
const FLOOR: f64 = 1e-12;

/// What rounding leaves of the height over a plane, relative to the coordinates.
const PLANE: f64 = 256.0 * f64::EPSILON;

/// Largest error of a gradient, relative to its norm, angular parts divided by the size of the
/// shape that turns.
const GRADIENT: f64 = 1e-6;

impl Pair {
    /// What 200 bits say, from a tight answer of ours.
    pub fn truth(&self) -> Reference {
        // Under faces that tilt by less than the accuracy only a tighter one ends at the corner
        // where the reference is sharp.
        let tight = Self { accuracy: TIGHT.min(1e-2 * self.accuracy), limit: None, ..self.clone() };
        self.reference(&tight.solve(&tight.options(), &mut WarmStart::default()))
    }

    /// How much the coordinates are rounded by, metres.
    pub fn rounding(&self) -> f64 {
        let (a, b) = (self.pose_a.translation(), self.pose_b.translation());
        16.0 * f64::EPSILON * ((a - b).norm() + self.sum()) + 4.0 * f64::EPSILON * a.norm().max(b.norm())
    }

    /// Width below which a bracket need not get, metres.
    fn widest(&self) -> f64 {
        let (a, b) = (self.pose_a.translation(), self.pose_b.translation());
        let stated = FLOOR * (self.a.reach_m().max(self.b.reach_m()) + (a - b).norm());
        // A half-space is known by its height over the origin of the world.
        let is_plane = matches!((&self.a, &self.b), (Shape::HalfSpace, _) | (_, Shape::HalfSpace));
        let height = if is_plane { PLANE * a.norm().max(b.norm()) } else { 0.0 };
        self.floor.max(stated).max(height)
    }

    /// What is wrong with an answer: its bracket, its status, its witnesses, its error.
    pub fn flaw(&self, found: &Solved, truth: &Reference) -> Option<Flaw> {
        let Solved { status, lower, upper, iterations, .. } = *found;
        let wrong = |what: String| Some(Flaw::Status(what));
        let (size, rounding) = (self.size(), self.rounding());
        if !(lower <= upper && upper.is_finite()) {
            return wrong(format!("the bracket is [{lower:e}, {upper:e}]"));
        }
        let numbers = found.witness_a.iter().chain(&found.witness_b).chain(found.normal.iter().flatten());
        if !numbers.into_iter().all(|number| number.is_finite()) {
            return wrong("a number is none".into());
        }
        let (width, wanted) = (upper - lower, self.accuracy * size);
        if status == Status::Converged && !(width <= wanted * (1.0 + 1e-12)) {
            return wrong(format!("converged with a bracket of {width:e} m"));
        }
        if iterations > self.limit.unwrap_or(MAX_ITERATIONS) {
            return wrong(format!("{iterations} iterations"));
        }
        let is_open = truth.lower.is_none();
        if !(is_open || truth.width() <= SHARP * wanted.max(self.widest()) || truth.all_inside(found)) {
            return wrong(format!("not confirmed: {:e} m, within {:e} m", truth.value(), truth.width()));
        }
        if let Some(exact) = self.exact.filter(|exact| (truth.value().max(0.0) - exact).abs() > rounding) {
            return wrong(format!("200 bits say {:e} m, the closed form {exact:e} m", truth.value()));
        }
        if !truth.inside(found) {
            let off = (lower - truth.value()).max(truth.value() - upper);
            return Some(Flaw::Off(off.max(f64::MIN_POSITIVE) / size));
        }
        // How deep an axis is in a body is not measured, and one as near to it as the accuracy may
        // be in it.
        let of_axis = truth.value() + self.radius();
        let may_meet = lower == f64::NEG_INFINITY && of_axis <= wanted.max(self.widest());
        let is_wide = if may_meet { upper - truth.value() > wanted.max(self.widest()) } else { width > self.widest() };
        if status == Status::BracketWide && self.limit.is_none() && !is_open && is_wide {
            return wrong(format!("the bracket is still wide, [{lower:e}, {upper:e}] m, {:e} m", truth.value()));
        }
        // In contact one point stands for both: as near to each as the bracket is wide.
        let allowed = if found.normal.is_none() { rounding + upper.max(0.0) } else { rounding };
        let beyond = outside(&self.a, &self.pose_a, &found.witness_a, allowed).max(outside(
            &self.b,
            &self.pose_b,
            &found.witness_b,
            allowed,
        ));
        if !(beyond <= 0.0) {
            return wrong(format!("a witness is outside of its shape, by {beyond:e}"));
        }
        // Of signed distances the witnesses lie along the normal, whose error turns radii; where
        // axes meet, nothing is said of where.
        let apart = found.witness_a - found.witness_b;
        let is_signed = |shape: &Shape| matches!(shape, Shape::Capsule(_) | Shape::HalfSpace);
        let by_normal = found.normal.filter(|_| is_signed(&self.a) || is_signed(&self.b));
        let along = by_normal.map_or(apart.norm(), |n| n.dot(&apart));
        let is_known = self.limit.is_none() && !is_open && found.normal.is_some();
        if is_known && !(along <= upper + rounding && along >= lower - rounding) {
            return wrong(format!("the witnesses are {along:e} m apart, [{lower:e}, {upper:e}] m"));
        }
        // An answer without a lower end claims no value.
        let is_claimed = !is_open && lower > f64::NEG_INFINITY;
        let error = if is_claimed { (found.value - truth.value()).abs() - rounding } else { 0.0 };
        self.bound.filter(|bound| error > *bound).map(|_| Flaw::Off(error / size))
    }

    /// What is wrong with the gradients of an answer; in contact a distance has none, nor has the
    /// depth of an axis.
    pub fn slope_flaw(&self, found: &Solved, truth: &Reference) -> Option<Flaw> {
        let (Some(gradients), Some(_)) = (found.gradients, truth.normal) else {
            // At distances below the accuracy nothing is promised. A signed distance goes on
            // through contact, as long as the axis is outside.
            let is_signed = matches!((&self.a, &self.b), (Shape::Capsule(_), _) | (_, Shape::Capsule(_)));
            let is_apart = found.lower > 0.0 || is_signed && truth.normal.is_some();
            let is_due = is_apart && truth.value() + self.radius() > self.accuracy * self.size();
            return is_due.then(|| Flaw::Status(format!("no gradient at {:e} m", found.upper)));
        };
        let size = |shape: &Shape| if shape.reach_m() > 0.0 { shape.reach_m() } else { self.size() };
        let sizes = [1.0, size(&self.a), 1.0, size(&self.b)];
        let [Twist { linear: v_a, angular: w_a }, Twist { linear: v_b, angular: w_b }] = gradients;
        let parts = [v_a, w_a, v_b, w_b];
        let sum = |value: &dyn Fn(usize) -> f64| (0..12).map(|k| (value(k) / sizes[k / 3]).powi(2)).sum::<f64>();
        let error = (sum(&|k| parts[k / 3][k % 3] - truth.gradient[k]) / sum(&|k| truth.gradient[k])).sqrt();
        // Not `>`: a NaN is off.
        (!(error <= GRADIENT + self.turn_of_rounding(truth))).then_some(Flaw::Off(error))
    }

    /// What rounded coordinates may turn the normal by, radians: they move the nearest points. At
    /// distances below the accuracy nothing is promised of it.
    pub fn turn_of_rounding(&self, truth: &Reference) -> f64 {
        let apart = truth.value() + self.radius();
        if apart > self.accuracy * self.size() { 2.0 * self.rounding() / apart } else { f64::INFINITY }
    }

    /// Radii of the capsules, metres: how far the axes are apart more than the shapes.
    fn radius(&self) -> f64 {
        let of = |shape: &Shape| if let Shape::Capsule(capsule) = shape { capsule.radius_m() } else { 0.0 };
        of(&self.a) + of(&self.b)
    }
}

/// How far a point is outside of a shape, beyond what coordinates rounded by `floor` metres
/// explain: metres, of bodies levels of their polynomials.
fn outside(shape: &Shape, at: &Pose, x: &Vector3<f64>, floor: f64) -> f64 {
    let x = at.rotation().inverse_transform_vector(&(x - at.translation()));
    match shape {
        Shape::Body(body) => {
            let samples = body.constraints().iter().map(|constraint| body.placement().sample(constraint, &x));
            let levels = samples.map(|sample| sample.value() - 1.0 - sample.gradient().norm() * floor - LEVEL);
            levels.fold(f64::NEG_INFINITY, f64::max)
        }
        Shape::Capsule(capsule) => {
            let half = capsule.half_height_m();
            (x - Vector3::z() * x.z.clamp(-half, half)).norm() - capsule.radius_m() - floor
        }
        Shape::Point => x.norm() - floor,
        Shape::HalfSpace => x.z - floor,
    }
}
