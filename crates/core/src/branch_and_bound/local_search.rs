//! Near points of two sets, by Newton's method.

use super::placed_set::{Membership, PlacedSet};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Newton steps at most.
const MAX_STEPS: usize = 40;

/// Longest step of Newton's method, relative to the radius of the smaller set; dimensionless.
///
/// The quadratic model is good near by only: a larger value lets steps leave the part of the set
/// where they began, a smaller one takes more steps. It changes upper bounds, never their truth:
/// every point found is proven in its set. Exercised by
/// `convex_bodies_have_the_distances_of_the_solver`, which counts boxes.
const LARGEST_STEP: f64 = 0.3;

/// Distance of two points that are tried as one common point, relative to the longest step;
/// dimensionless.
///
/// Whether the point lies in both sets is proven afterwards. A larger value tries points in vain, a
/// smaller one misses contacts that rounding blurs. Exercised by
/// `common_points_are_found_where_bodies_overlap`.
const COINCIDENT: f64 = 1e-6;

/// Steps that look for a common point from there: the last are as long as a tenth of a level.
const MAX_PUSHES: usize = 44;

/// Length of a step at which Newton's method has converged, relative to the longest step;
/// dimensionless.
///
/// Steps round at 1e-16 of the coordinates. A larger value leaves upper bounds wider, a smaller one
/// spends [`MAX_STEPS`] on rounding. It changes time only; no test pins it.
const CONVERGED: f64 = 1e-14;

/// Near points of two sets, proven to lie in them, and their distances, metres, the nearest first;
/// one point, at distance 0, if one was found that is in both. Newton's method begins at each of
/// the starts.
pub fn nearest_points(
    sets: [&PlacedSet<'_>; 2],
    starts: impl IntoIterator<Item = [Vector3<f64>; 2]>,
) -> Vec<NearPoints> {
    let Some(search) = PairSearch::new(sets) else { return Vec::new() };
    let mut found = Vec::new();
    for start in starts {
        found.extend(search.from(start).into_iter().flatten());
        if found.last().is_some_and(|near: &NearPoints| near.0 == 0.0) {
            break;
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if found.first().is_some_and(|nearest| nearest.0 == 0.0) {
        found.truncate(1);
    }
    found
}

/// Two points that are proven to lie in two sets, and their distance, metres.
pub type NearPoints = (f64, [Vector3<f64>; 2]);

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

    /// Near points at the start, and where Newton's method leads from there; the latter are left
    /// out if the former are one point in both sets.
    pub(super) fn from(&self, start: [Vector3<f64>; 2]) -> [Option<NearPoints>; 2] {
        let here = self.pulled(start);
        if here.is_some_and(|near| near.0 == 0.0) {
            return [here, None];
        }
        [here, self.refined(start).and_then(|points| self.pulled(points))]
    }

    /// Points pulled into the sets.
    fn pulled(&self, points: [Vector3<f64>; 2]) -> Option<NearPoints> {
        let (x, y) = (self.members[0].pulled(points[0])?, self.members[1].pulled(points[1])?);
        // One point in both is no distance apart.
        let common = [x, y].into_iter().find(|z| self.members.iter().all(|set| set.contains(z)));
        let common = common.or_else(|| self.common(&x, &y));
        Some(common.map_or((distance_up(&x, &y), [x, y]), |z| (0.0, [z, z])))
    }

    /// A point in both sets near two that are as good as one: Newton's method ends where both
    /// boundaries meet.
    fn common(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> Option<Vector3<f64>> {
        if (x - y).norm() > COINCIDENT * self.largest_step {
            return None;
        }
        let mut z = (x + y) * 0.5;
        let mut extra = 1e-14;
        for _ in 0..MAX_PUSHES {
            if self.members.iter().all(|set| set.contains(&z)) {
                return Some(z);
            }
            // Against the gradient of the polynomial that is largest there, a little deeper each
            // time.
            let jets = [0, 1].map(|side| {
                let (g, at) = self.sets[side].largest_at(&z);
                let jet = g.evaluate(&at);
                (jet.value, self.linear[side].tr_mul(&jet.gradient))
            });
            let (value, gradient) = if jets[0].0 >= jets[1].0 { jets[0] } else { jets[1] };
            z -= gradient * (((value - 1.0).max(0.0) + extra) / gradient.norm_squared().max(f64::MIN_POSITIVE));
            extra *= 2.0;
        }
        None
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
