//! Support points: the point of a body farthest along a direction, near enough to the best and
//! proven inside.

use crate::body::MAX_CONSTRAINTS;
use crate::measure::frames::query_frame::Posed;
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::measure::solver::barrier_programs::{Support, near_boundary};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::linear_systems::{Curvature, eliminate};
use crate::measure::solver::stages::{Stage, runs};
use crate::optimize::minimise;
use crate::polynomial::Jet;
use nalgebra::{Matrix3, Vector3};
use std::ops::ControlFlow;

/// A point within whose displacement a point of the body lies, with the constraints that are active
/// at it.
#[derive(Clone, Copy, Debug)]
pub(super) struct SupportPoint {
    pub(super) x: Vector3<f64>,
    pub(super) active: ActiveSet,
}

impl SupportPoint {
    /// No point at all.
    pub(super) const NONE: Self = Self { x: Vector3::new(f64::NAN, f64::NAN, f64::NAN), active: 0 };
}

/// Most Newton steps before the interior-point method is taken.
const MAX_STEPS: u32 = 12;

/// Least cosine between n and the normal at a start that Newton's method is started from: 45
/// degrees.
///
/// Smaller, it diverges from there; larger, more points are left to the interior-point method.
/// `support_points_are_found_alone` counts how many are found.
const USEFUL: f64 = 0.7;

/// Point of the body within about `tolerance` of the farthest along the unit vector n: by Newton's
/// method from `start`, if that fails from `restart`, if that fails by the interior-point method.
/// None only if rounding leaves no point inside.
pub(super) fn support(
    body: &Posed<'_>,
    n: &Vector3<f64>,
    tolerance: f64,
    start: Option<SupportPoint>,
    restart: impl FnOnce() -> Vector3<f64>,
) -> Option<SupportPoint> {
    if let Some(found) = start.and_then(|start| newton(body, n, tolerance, &start)) {
        return Some(found);
    }
    let x = restart();
    let restart = SupportPoint { x, active: facing(body, &x, n) };
    if let Some(found) = newton(body, n, tolerance, &restart) {
        return Some(found);
    }
    // The last resort ends early on surfaces that are flat at all scales, where what was known may
    // be better.
    let last = runs(Stage::SupportInterior).then(|| interior_point(body, n, tolerance));
    let found = [last, start, Some(restart)];
    let inside =
        found.into_iter().flatten().filter_map(|point| body.move_inside(&point.x).map(|x| SupportPoint { x, ..point }));
    inside.max_by(|p, q| n.dot(&p.x).total_cmp(&n.dot(&q.x)))
}

/// Of the constraints nearly active at x the one that faces n best.
fn facing(body: &Posed<'_>, x: &Vector3<f64>, n: &Vector3<f64>) -> ActiveSet {
    let mut best = (0, f64::NEG_INFINITY);
    for i in 0..body.len() {
        let jet = body.jet(i, x);
        let cosine = jet.gradient.dot(n) / jet.gradient.norm();
        if jet.value > 0.9 && cosine > best.1 {
            best = (i, cosine);
        }
    }
    1 << best.0
}

/// [`newton`] for a body of one constraint: two solves and a few products per evaluation.
fn smooth(body: &Posed<'_>, n: &Vector3<f64>, tolerance: f64, start: &Vector3<f64>) -> Option<SupportPoint> {
    let mut x = *start;
    let mut multiplier = None;
    for _ in 0..MAX_STEPS {
        let Jet { value, gradient, hessian } = body.jet(0, &x);
        if !(0.3..2.0).contains(&value) {
            // A step along a flat surface went far: back to the level 1, exactly if g - min g is a
            // power of the distance.
            let (depth, degree) = (body.body.min_value(), body.body.degree() as f64);
            let factor = ((1.0 - depth) / (value - depth)).powf(1.0 / degree);
            if !factor.is_finite() {
                return None;
            }
            x = body.interior + (x - body.interior) * factor;
            continue;
        }
        let squared = gradient.norm_squared();
        let first = multiplier.is_none();
        // At the solution n·v = λ g·v for every v, and along this one whatever the units of the
        // axes.
        let outward = x - body.interior;
        let old = multiplier.unwrap_or(n.dot(&outward) / gradient.dot(&outward));
        if !(old > 0.0) || first && !(gradient.dot(n) > USEFUL * squared.sqrt()) {
            return None;
        }
        // λ H dx + λ' g = n and g·dx = 1 - value, with H factored once.
        let curvature = Curvature::new(&hessian)?;
        let (along, across) = (curvature.solve(n), curvature.solve(&gradient));
        let new = (gradient.dot(&along) - old * (1.0 - value)) / gradient.dot(&across);
        let dx = (along - across * new) / old;
        let length = dx.norm();
        if !(length.is_finite() && new > 0.0) {
            return None;
        }
        let bend = 0.5 * dx.dot(&(hessian * dx));
        multiplier = Some(new);
        if length > 0.5 {
            x += dx * (0.5 / length);
            continue;
        }
        // Second order: the surface bends away from the tangent by as much as the step gained along
        // it.
        x += dx - gradient * (bend / squared);
        if new * (1.0 - value).abs() + 2.0 * old.max(new) * bend < tolerance {
            let inside = body.move_inside(&x)?;
            // Where the surface is flat a step means little: it may have gone far outside.
            if n.dot(&(x - inside)) < tolerance {
                return Some(SupportPoint { x: inside, active: 1 });
            }
            x = inside;
        }
    }
    None
}

/// Newton's method on `Σ λ_i ∇g_i(x) = n, g_i(x) = 1`, ended by pulling in. None if it does not
/// arrive.
fn newton(body: &Posed<'_>, n: &Vector3<f64>, tolerance: f64, start: &SupportPoint) -> Option<SupportPoint> {
    if !runs(Stage::SupportNewton) {
        return None;
    }
    if body.len() == 1 {
        return smooth(body, n, tolerance, &start.x);
    }
    let mut x = start.x;
    let mut active = Active::from_bits(start.active, body.len()).filter(|active| active.len > 0)?;
    let blank = Jet { value: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
    let mut fitted = false;
    for _ in 0..MAX_STEPS {
        let mut jets = [blank; MAX_ACTIVE];
        for (jet, (i, _)) in jets.iter_mut().zip(active.iter()) {
            *jet = body.jet(i, &x);
        }
        let jets = &jets[..active.len];
        if !fitted {
            let normal = jets.iter().map(|jet| jet.gradient / jet.gradient.norm()).sum::<Vector3<f64>>();
            if active.len == 1 && !(normal.dot(n) > USEFUL) {
                return None;
            }
            fit(&mut active, jets, n)?;
            fitted = true;
        }
        let hessian = jets.iter().zip(active.multiplier).fold(Matrix3::zeros(), |h, (jet, m)| h + jet.hessian * m);
        let curvature = Curvature::new(&hessian)?;
        // M dx + Σ λ_i ∇g_i = n and ∇g_i·dx = 1 - g_i.
        let mut dx = curvature.solve(n);
        let mut columns = [Vector3::zeros(); MAX_ACTIVE];
        let (mut m, mut r) = ([[0.0; MAX_ACTIVE]; MAX_ACTIVE], [0.0; MAX_ACTIVE]);
        (0..MAX_ACTIVE).for_each(|i| m[i][i] = 1.0);
        for (column, jet) in columns.iter_mut().zip(jets) {
            *column = curvature.solve(&jet.gradient);
        }
        for (i, jet) in jets.iter().enumerate() {
            for (j, column) in columns[..jets.len()].iter().enumerate() {
                m[i][j] = jet.gradient.dot(column);
            }
            r[i] = jet.gradient.dot(&dx) - (1.0 - jet.value);
        }
        if jets.len() == 1 {
            r[0] /= m[0][0];
        } else {
            eliminate(&mut m, &mut r)?;
        }
        for (column, multiplier) in columns.iter().zip(r) {
            dx -= column * multiplier;
        }
        active.multiplier = r;
        let length = dx.norm();
        if !length.is_finite() {
            return None;
        }
        x += dx * (0.5 / length).min(1.0);
        if length > 0.5 {
            // Along a flat face, as far as the next one.
            if let Some(next) = active.violated(body, &x, 1.0) {
                active.push(next);
            }
            fitted = false;
            continue;
        }
        // What this step gains across the surface and along it, n·dx = Σ λ_i (1 - g_i) + dx·M dx;
        // the two may cancel. What is left is less, times the degree for pulling in.
        let across: f64 = jets.iter().zip(r).map(|(jet, m)| (m * (1.0 - jet.value)).abs()).sum();
        if across + dx.dot(&(hessian * dx)).abs() < 0.1 * tolerance {
            let changed = active.drop_negative()
                | (body.len() > active.len && active.violated(body, &x, 1.0).is_some_and(|i| active.push(i)));
            let holds = active.multiplier[..active.len].iter().all(|&m| m >= 0.0);
            if !changed && holds {
                let inside = body.move_inside(&x)?;
                // Where the surface is flat a step means little: it may have gone far outside.
                if n.dot(&(x - inside)) < tolerance {
                    return Some(SupportPoint { x: inside, active: active.bits() });
                }
                x = inside;
            }
        }
    }
    None
}

/// Least-squares multipliers of `Σ λ_i ∇g_i = n`.
fn fit(active: &mut Active, jets: &[Jet], n: &Vector3<f64>) -> Option<()> {
    let (mut m, mut r) = ([[0.0; MAX_ACTIVE]; MAX_ACTIVE], [0.0; MAX_ACTIVE]);
    for i in 0..MAX_ACTIVE {
        m[i][i] = 1.0;
        if let Some(jet) = jets.get(i) {
            jets.iter().enumerate().for_each(|(j, other)| m[i][j] = jet.gradient.dot(&other.gradient));
            r[i] = jet.gradient.dot(n);
        }
    }
    eliminate(&mut m, &mut r)?;
    active.multiplier = r;
    Some(())
}

fn interior_point(body: &Posed<'_>, n: &Vector3<f64>, tolerance: f64) -> SupportPoint {
    let mut x = near_boundary(body, &body.interior, n);
    let mut active = facing(body, &x, n);
    let first = 0.1 * body.reach(&body.interior);
    minimise(&Support { body, n: *n }, &mut x, first, |iterate| {
        let mut multipliers = [0.0; MAX_CONSTRAINTS];
        multipliers[..iterate.multipliers.len()].copy_from_slice(iterate.multipliers);
        active = Active::from_multipliers(&multipliers).bits();
        // Complementarity vanishes with the slacks, before the surface is met.
        let rows = || iterate.multipliers.iter().enumerate();
        let outside = || rows().map(|(i, m)| m * (body.jet(i, iterate.v).value - 1.0).abs()).sum::<f64>();
        let arrived = iterate.gap < 0.1 * tolerance && outside() < 0.1 * tolerance;
        if arrived { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    SupportPoint { x, active }
}
