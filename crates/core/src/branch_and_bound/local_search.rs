//! Near points of two sets, by Newton's method.

use super::placed_set::{Membership, PlacedSet};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Newton steps at most.
const MAX_STEPS: usize = 40;

/// Steps that pull a point into its set.
const MAX_PULLS: usize = 60;

/// Largest step, relative to the radius of the smaller set: the model is good near by only.
const LARGEST_STEP: f64 = 0.3;

/// Length of a step at which the method has converged, relative to the largest.
const CONVERGED: f64 = 1e-14;

/// The least distance of two points that were found and are proven to lie in the sets, metres, and
/// the points: 0 and one point twice if it is in both. Newton's method begins at each of the starts.
pub fn nearest_points(
    sets: [&PlacedSet<'_>; 2],
    starts: impl IntoIterator<Item = [Vector3<f64>; 2]>,
) -> Option<(f64, [Vector3<f64>; 2])> {
    let search = PairSearch::new(sets)?;
    let mut best = None;
    for start in starts {
        if search.improve(start, &mut best) {
            break;
        }
    }
    best
}

/// Two sets, ready to be searched.
pub(super) struct PairSearch<'a> {
    sets: [&'a PlacedSet<'a>; 2],
    members: [Membership<'a>; 2],
    /// From the common frame to normalized coordinates.
    linear: [Matrix3<f64>; 2],
    largest_step: f64,
}

impl<'a> PairSearch<'a> {
    pub(super) fn new(sets: [&'a PlacedSet<'a>; 2]) -> Option<Self> {
        let members = [sets[0].membership()?, sets[1].membership()?];
        let largest_step = LARGEST_STEP * sets[0].radius_m().min(sets[1].radius_m());
        Some(Self { sets, members, linear: sets.map(PlacedSet::linear), largest_step })
    }

    /// Replaces the best pair of points by a nearer one, if it finds one; whether a point is in both
    /// sets.
    pub(super) fn improve(&self, start: [Vector3<f64>; 2], best: &mut Option<(f64, [Vector3<f64>; 2])>) -> bool {
        self.keep(start, best) || self.refined(start).is_some_and(|points| self.keep(points, best))
    }

    fn keep(&self, points: [Vector3<f64>; 2], best: &mut Option<(f64, [Vector3<f64>; 2])>) -> bool {
        let pulled = |side: usize| pulled(self.sets[side], &self.members[side], &self.linear[side], points[side]);
        let (Some(x), Some(y)) = (pulled(0), pulled(1)) else { return false };
        // One point in both is no distance apart.
        let common = [x, y].into_iter().find(|z| self.members.iter().all(|set| set.contains(z)));
        let found = common.map_or((distance_up(&x, &y), [x, y]), |z| (0.0, [z, z]));
        if best.is_none_or(|(least, _)| found.0 < least) {
            *best = Some(found);
        }
        common.is_some()
    }

    /// Newton's method on `x - y + λ∇g(x) = 0, y - x + μ∇h(y) = 0, g(x) = h(y) = 1`.
    fn refined(&self, start: [Vector3<f64>; 2]) -> Option<[Vector3<f64>; 2]> {
        let [mut x, mut y] = start;
        let polynomials = [self.sets[0].largest_at(&x).0, self.sets[1].largest_at(&y).0];
        let at = |side: usize, x: &Vector3<f64>| {
            let jet = polynomials[side].evaluate(&self.sets[side].normalized(x));
            let map = &self.linear[side];
            (jet.value, map.tr_mul(&jet.gradient), map.tr_mul(&(jet.hessian * map)))
        };
        let gap = x - y;
        let [mut lambda, mut mu] =
            [(0, x), (1, y)].map(|(side, x)| gap.norm() / at(side, &x).1.norm().max(f64::MIN_POSITIVE));
        for _ in 0..MAX_STEPS {
            let ((g, dg, hg), (h, dh, hh)) = (at(0, &x), at(1, &y));
            let mut matrix = SMatrix::<f64, 8, 8>::zeros();
            let identity = Matrix3::identity();
            matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&(identity + hg * lambda));
            matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&-identity);
            matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&-identity);
            matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&(identity + hh * mu));
            matrix.fixed_view_mut::<3, 1>(0, 6).copy_from(&dg);
            matrix.fixed_view_mut::<1, 3>(6, 0).copy_from(&dg.transpose());
            matrix.fixed_view_mut::<3, 1>(3, 7).copy_from(&dh);
            matrix.fixed_view_mut::<1, 3>(7, 3).copy_from(&dh.transpose());
            let mut right = SVector::<f64, 8>::zeros();
            right.fixed_rows_mut::<3>(0).copy_from(&-(x - y + dg * lambda));
            right.fixed_rows_mut::<3>(3).copy_from(&-(y - x + dh * mu));
            right[6] = 1.0 - g;
            right[7] = 1.0 - h;
            let step = matrix.lu().solve(&right)?;
            if !step.iter().all(|value| value.is_finite()) {
                return None;
            }
            let length = step.fixed_rows::<6>(0).amax();
            let share = (self.largest_step / length.max(f64::MIN_POSITIVE)).min(1.0);
            x += step.fixed_rows::<3>(0) * share;
            y += step.fixed_rows::<3>(3) * share;
            lambda += step[6] * share;
            mu += step[7] * share;
            if length <= CONVERGED * self.largest_step {
                break;
            }
        }
        Some([x, y])
    }
}

/// Rounded up.
pub(super) fn distance_up(x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
    ((x - y).norm() * (1.0 + 8.0 * f64::EPSILON)).next_up()
}

/// The point moved against the gradient until it is proven inside; none if it does not get there.
pub(super) fn pulled(
    set: &PlacedSet<'_>,
    member: &Membership<'_>,
    linear: &Matrix3<f64>,
    mut x: Vector3<f64>,
) -> Option<Vector3<f64>> {
    let mut extra = 1e-14;
    for _ in 0..MAX_PULLS {
        if member.contains(&x) {
            return Some(x);
        }
        let (g, z) = set.largest_at(&x);
        let jet = g.evaluate(&z);
        let gradient = linear.tr_mul(&jet.gradient);
        let excess = (jet.value - 1.0).max(0.0) + extra;
        extra *= 4.0;
        x -= gradient * (excess / gradient.norm_squared().max(f64::MIN_POSITIVE));
    }
    None
}

/// A local minimiser of `objective` over a set: Newton's method on `∇f + λ∇g = 0, g = 1` for the
/// largest polynomial g, or on `∇f = 0` where that leads inside. The objective is given as gradient
/// and Hessian at points of the common frame.
pub(super) fn refined_on(
    set: &PlacedSet<'_>,
    linear: &Matrix3<f64>,
    start: Vector3<f64>,
    on_boundary: bool,
    objective: impl Fn(&Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>),
) -> Option<Vector3<f64>> {
    let mut x = start;
    let polynomial = set.largest_at(&x).0;
    let largest_step = LARGEST_STEP * set.radius_m();
    let mut lambda: Option<f64> = None;
    for _ in 0..MAX_STEPS {
        let (df, hf) = objective(&x);
        let step = if on_boundary {
            let jet = polynomial.evaluate(&set.normalized(&x));
            let (dg, hg) = (linear.tr_mul(&jet.gradient), linear.tr_mul(&(jet.hessian * linear)));
            let multiplier = *lambda.get_or_insert(df.norm() / dg.norm().max(f64::MIN_POSITIVE));
            let mut matrix = SMatrix::<f64, 4, 4>::zeros();
            matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&(hf + hg * multiplier));
            matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&dg);
            matrix.fixed_view_mut::<1, 3>(3, 0).copy_from(&dg.transpose());
            let mut right = SVector::<f64, 4>::zeros();
            right.fixed_rows_mut::<3>(0).copy_from(&-(df + dg * multiplier));
            right[3] = 1.0 - jet.value;
            matrix.lu().solve(&right)?
        } else {
            let step = hf.lu().solve(&-df)?;
            SVector::from([step.x, step.y, step.z, 0.0])
        };
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        let length = step.fixed_rows::<3>(0).amax();
        let share = (largest_step / length.max(f64::MIN_POSITIVE)).min(1.0);
        x += step.fixed_rows::<3>(0) * share;
        lambda = lambda.map(|lambda| lambda + step[3] * share);
        if length <= CONVERGED * largest_step {
            break;
        }
    }
    Some(x)
}
