//! The truth about a distance, from bounds that do not depend on the solver which is judged.
//!
//! Two points inside the bodies are at least as far apart as the bodies, and
//! the gap between the bodies' heights along a direction ([`Body::support`]) is at most the
//! distance. The arbiter takes the best of all proposals and of directions all around: an answer
//! that is too long is refuted by somebody's points, one that is too short by somebody's direction.

use super::question::Question;
use nalgebra::{Matrix3, Matrix3xX, Vector3};
use sublevel::body::{Body, fibonacci_lattice};
use sublevel::measure::Pose;
use sublevel::polynomial::Jet;
use sublevel_testkit::catalogue::Case;

/// Directions that are tried whatever is proposed.
const LATTICE: usize = 200;

/// Bounds of a distance, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truth {
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// What rounding may have done to the bounds.
    pub(super) floor: f64,
}

/// Points of both bodies in the world, metres, and a direction from the second to the first.
#[derive(Clone, Debug, Default)]
pub(super) struct Proposal {
    pub(super) points: Option<[Vector3<f64>; 2]>,
    pub(super) normal: Option<Vector3<f64>>,
    /// Constraints whose tangent planes at the points are to bound the bodies.
    pub(super) active: [Vec<usize>; 2],
}

impl Truth {
    /// How far a value is from all that may be true, metres.
    pub(super) fn error(&self, value: f64) -> f64 {
        (self.lower - self.floor - value).max(value - self.upper - self.floor).max(0.0)
    }
}

/// The best bounds for a case; a known value is taken for granted.
pub(super) fn judge(case: &Question, proposals: &[Proposal]) -> Truth {
    judge_along(case, proposals, fibonacci_lattice(LATTICE))
}

/// As [`judge`], with these directions, unit vectors, in place of some all around.
pub(super) fn judge_along(
    case: &Question,
    proposals: &[Proposal],
    directions: impl IntoIterator<Item = Vector3<f64>>,
) -> Truth {
    let Case { a, pose_a, b, pose_b, .. } = &case.0;
    let sizes = a.circumscribed().radius + b.circumscribed().radius;
    let apart = pose_a.translation() - pose_b.translation();
    let away = pose_a.translation().norm().max(pose_b.translation().norm());
    // Coordinates in the world are rounded in proportion to themselves, heights to the distance of
    // the bodies.
    let floor = 8.0 * f64::EPSILON * (apart.norm() + sizes) + 4.0 * f64::EPSILON * away;
    if let Some(exact) = case.exact {
        return Truth { lower: exact, upper: exact, floor };
    }
    let mut truth = Truth { lower: 0.0, upper: f64::INFINITY, floor };
    for proposal in proposals {
        let drawn = proposal.points.map(|[x, y]| [drawn_in(a, pose_a, &x), drawn_in(b, pose_b, &y)]);
        let apart = drawn.map(|[x, y]| pose_a.transform_point(&x) - pose_b.transform_point(&y));
        truth.upper = truth.upper.min(apart.map_or(f64::INFINITY, |apart| apart.norm()));
        for n in proposal.normal.into_iter().chain(apart).filter_map(|n| n.try_normalize(0.0)) {
            truth.lower = truth.lower.max(case.height_at(&n, proposal));
        }
    }
    for n in directions {
        truth.lower = truth.lower.max(case.height(&n));
    }
    truth
}

impl Question {
    /// The gap between the bodies' heights along a unit vector from the second to the first,
    /// metres: at most their distance.
    pub(super) fn height(&self, n: &Vector3<f64>) -> f64 {
        let Case { a, pose_a, b, pose_b, .. } = &self.0;
        n.dot(&(pose_a.translation() - pose_b.translation())) - reach(a, pose_a, &-n) - reach(b, pose_b, n)
    }

    /// The same, where tangent planes at or near proposed points may show it better.
    pub(super) fn height_at(&self, n: &Vector3<f64>, proposal: &Proposal) -> f64 {
        let Case { a, pose_a, b, pose_b, .. } = &self.0;
        let Some([x, y]) = proposal.points else { return self.height(n) };
        let (x, y) = (drawn_in(a, pose_a, &x), drawn_in(b, pose_b, &y));
        let [of_a, of_b] = &proposal.active;
        // Of each body the better bound.
        let of_a = tangent_reach(a, pose_a, &-n, &x, of_a).min(reach(a, pose_a, &-n));
        let of_b = tangent_reach(b, pose_b, n, &y, of_b).min(reach(b, pose_b, n));
        n.dot(&(pose_a.translation() - pose_b.translation())) - of_a - of_b
    }
}

/// How far a body reaches along a direction of the world from the origin of its frame, metres.
fn reach(body: &Body, pose: &Pose, n: &Vector3<f64>) -> f64 {
    let n = pose.rotation().inverse_transform_vector(n);
    body.support(&n).height_m + n.dot(body.interior_point())
}

/// As [`reach`], from tangent planes at a point of the body's frame: with any `m_i >= 0`, `r = n -
/// Σ m_i ∇g_i` and convex g_i,
///
/// ```text
/// n·y <= Σ m_i (∇g_i·x + 1 - g_i(x)) + r·c + Σ |(L⁻ᵀ r)_k| E_k
/// ```
///
/// for all y of the body, whose normalized coordinates `L (y - c)` are at most E_k.
fn tangent_reach(body: &Body, pose: &Pose, n: &Vector3<f64>, x: &Vector3<f64>, active: &[usize]) -> f64 {
    let n = pose.rotation().inverse_transform_vector(n);
    if let [constraint] = body.constraints() {
        // Of a strongly curved body the plane at the very point farthest along n.
        let (mut x, mut least) = (*x, f64::INFINITY);
        for _ in 0..POLISH {
            let jet = body.placement().jet(constraint, &x);
            // Far from the surface the sums of the bound would cancel.
            if !(0.5..2.0).contains(&jet.value) {
                break;
            }
            least = least.min(plane_reach(body, &n, &x, &[(jet.value, jet.gradient)]));
            let Some(step) = newton_step(&jet, &n) else { break };
            x += step;
        }
        return least;
    }
    let samples: Vec<_> = active
        .iter()
        .filter_map(|&i| body.constraints().get(i))
        .map(|constraint| body.placement().sample(constraint, x))
        .map(|sample| (sample.value(), sample.gradient()))
        .collect();
    plane_reach(body, &n, x, &samples)
}

/// Share of a surface's mean curvature that is added to its curvatures: of higher degree it has
/// none across a plane of symmetry.
const RIDGE: f64 = 1e-9;

/// Steps of Newton's method towards the point farthest along a direction.
const POLISH: usize = 8;

/// Newton's step for `m ∇p(x) = n`, `p(x) = 1`.
fn newton_step(jet: &Jet, n: &Vector3<f64>) -> Option<Vector3<f64>> {
    let g = jet.gradient;
    let m = n.dot(&g) / g.norm_squared();
    let curvature = jet.hessian * m;
    let inverse = (curvature + Matrix3::from_diagonal_element(RIDGE * curvature.trace())).try_inverse()?;
    let (of_n, of_g) = (inverse * (n - g * m), inverse * g);
    let rise = (g.dot(&of_n) - (1.0 - jet.value)) / g.dot(&of_g);
    let step = of_n - of_g * rise;
    step.iter().all(|value| value.is_finite()).then_some(step)
}

/// The bound of [`tangent_reach`] from values and gradients of constraints at a point.
fn plane_reach(body: &Body, n: &Vector3<f64>, x: &Vector3<f64>, samples: &[(f64, Vector3<f64>)]) -> f64 {
    if samples.is_empty() {
        return f64::INFINITY;
    }
    let gradients = Matrix3xX::from_columns(&samples.iter().map(|(_, gradient)| *gradient).collect::<Vec<_>>());
    // The best in the sense of least squares, made valid.
    let Ok(multipliers) = gradients.clone().svd(true, true).solve(n, 1e-12) else { return f64::INFINITY };
    let multipliers = multipliers.map(|m| m.max(0.0));
    let rest = n - &gradients * &multipliers;
    let planes = samples.iter().zip(multipliers.iter()).map(|((value, g), m)| m * (g.dot(x) + 1.0 - value));
    let along = body.inverse().tr_mul(&rest).abs();
    let reach = planes.sum::<f64>() + rest.dot(&body.normalization().center) + along.dot(body.z_extent());
    // What is no number bounds nothing.
    if reach.is_finite() { reach } else { f64::INFINITY }
}

/// The point in the body's frame; one outside moved to the boundary, straight towards the interior
/// point.
fn drawn_in(body: &Body, pose: &Pose, x: &Vector3<f64>) -> Vector3<f64> {
    let x = pose.rotation().inverse_transform_vector(&(x - pose.translation()));
    if body.value(&x) <= 1.0 {
        return x;
    }
    body.boundary_along(&(body.normalization().linear * (x - body.interior_point())))
}
