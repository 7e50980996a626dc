//! Leaving out what stands out: noise and outliers of scans.

use super::FitError;
use super::gap::nearest;
use super::hull::convex_hull;
use super::object::Object;
use super::progress::{Progress, Watch};
use super::unsolved::ProgramError;
use nalgebra::{Matrix3, Vector3};
use std::ops::ControlFlow;

/// Degree of the bodies by which points stand out.
const TRIM_DEGREE: usize = 4;

/// How often points are left out, about as many each time: those that an outlier hid stand out once
/// it is gone.
const TRIM_ROUNDS: usize = 5;

/// Value of the polynomial above which a point touches the body; dimensionless, 1 on the surface.
///
/// Active points of a fit lie within 1e-6 of the surface. Closer to 1, active points would be
/// ordered by rounding; smaller, points of the crowd count as touching. Pinned by
/// `as_few_strays_as_corners_of_a_simplex_go_before_the_crowd`.
const TOUCHES: f64 = 1.0 - 1e-3;

/// Most of the points that may be left out; a fraction.
///
/// What is more than half is no outlier. Pinned by `fractions_are_checked_and_it_can_be_stopped`.
const MAX_TRIM_FRACTION: f64 = 0.5;

/// What is left of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Trimmed {
    /// The points that stay, in their order.
    pub kept: Vec<Vector3<f64>>,
    /// The points left out, in their order.
    pub left_out: Vec<Vector3<f64>>,
    /// Largest distance of a point left out from the convex hull of those that stay, metres.
    pub farthest_m: f64,
}

/// Leaves out that fraction of the points, rounded down: again and again the outermost as the
/// smallest body of degree 4 around those that are left orders them, the ones with the largest
/// values of its polynomial. Of those that touch it, the ones that stand apart from all others go
/// first. It follows the points through affine maps.
///
/// # Errors
/// [`FitError::Trim`] for a fraction outside [0, 0.5], and as [`fit`](super::fit()).
pub fn trim(
    points: &[Vector3<f64>],
    fraction: f64,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Trimmed, FitError> {
    if !(0.0..=MAX_TRIM_FRACTION).contains(&fraction) {
        return Err(FitError::Trim(fraction));
    }
    let mut watch = Watch::new(progress);
    let mut left = (fraction * points.len() as f64).floor() as usize;
    let mut stays = vec![true; points.len()];
    for round in 0..TRIM_ROUNDS {
        let share = left.div_ceil(TRIM_ROUNDS - round);
        if share == 0 {
            break;
        }
        let (indices, kept): (Vec<_>, Vec<_>) =
            points.iter().enumerate().filter(|(i, _)| stays[*i]).map(|(i, x)| (i, *x)).unzip();
        let object = Object::new("trim", &kept, "")?;
        let levels = object.levels(TRIM_DEGREE, &mut watch)?;
        let leverages = leverages(&kept.iter().map(|x| object.whiten(x)).collect::<Vec<_>>())?;
        // Few points touch on all sides of a cluster as on all sides of a body: their levels are
        // the same but for rounding.
        let outward = |i: usize| if levels[i] > TOUCHES { (true, leverages[i]) } else { (false, levels[i]) };
        let compare = |a: (bool, f64), b: (bool, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        let mut order: Vec<usize> = (0..kept.len()).collect();
        order.select_nth_unstable_by(share - 1, |&i, &j| compare(outward(j), outward(i)));
        order[..share].iter().for_each(|&k| stays[indices[k]] = false);
        left -= share;
    }
    let part = |stay: bool| points.iter().zip(&stays).filter(move |(_, s)| **s == stay).map(|(x, _)| *x).collect();
    let (kept, left_out): (Vec<_>, Vec<_>) = (part(true), part(false));
    let mut farthest_m = 0.0_f64;
    if !left_out.is_empty() {
        let hull: Vec<_> = convex_hull(&kept)?.vertices.iter().map(|&i| kept[i]).collect();
        // Relative to a point near by, which keeps rounding small.
        let from = hull[0];
        let hull: Vec<_> = hull.iter().map(|x| x - from).collect();
        farthest_m = left_out.iter().map(|x| (x - from - nearest(&hull, &(x - from))).norm()).fold(0.0, f64::max);
    }
    Ok(Trimmed { kept, left_out, farthest_m })
}

/// Squared distance of every point from the mean of all, in the metric of their covariance
/// (Mahalanobis): what stands apart from a crowd has much, the crowd little, wherever it lies.
fn leverages(points: &[Vector3<f64>]) -> Result<Vec<f64>, ProgramError> {
    let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let scatter: Matrix3<f64> = points.iter().map(|x| (x - mean) * (x - mean).transpose()).sum();
    let factor = scatter.cholesky().ok_or(ProgramError::Singular)?;
    Ok(points.iter().map(|x| (x - mean).dot(&factor.solve(&(x - mean)))).collect())
}

#[cfg(test)]
mod tests {
    use super::trim;
    use crate::{FitError, Progress};
    use nalgebra::{Matrix3, Vector3};
    use std::ops::ControlFlow;
    use sublevel_testkit::Seeded;

    fn unwatched(_: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// A noisy box surface, metres, then stray points 0.5 to 1 m outside.
    fn scan(strays: usize) -> Vec<Vector3<f64>> {
        let mut random = Seeded(9);
        let mut points: Vec<_> = (0..2_000)
            .map(|_| {
                let mut x = Vector3::from_fn(|_, _| random.signed());
                let side = (random.next() % 3) as usize;
                x[side] = x[side].signum() + 0.005 * random.signed();
                x.component_mul(&Vector3::new(0.5, 0.3, 0.2))
            })
            .collect();
        for _ in 0..strays {
            let u = Vector3::from_fn(|_, _| random.signed()).normalize();
            points.push(u * (1.2 + 0.5 * random.signed().abs()));
        }
        points
    }

    #[test]
    fn strays_are_the_first_to_go() {
        let points = scan(20);
        // A few more than there are strays: each round takes about as many, and the first round
        // cannot find all.
        let found = trim(&points, 60.0 / points.len() as f64, &mut unwatched).unwrap();
        assert_eq!((found.left_out.len(), found.kept.len()), (60, points.len() - 60));
        assert!(found.kept.iter().all(|x| x.norm() < 0.7), "a stray stays");
        assert!(found.farthest_m > 0.5 && found.farthest_m < 1.7, "{}", found.farthest_m);
    }

    #[test]
    fn as_few_strays_as_corners_of_a_simplex_go_before_the_crowd() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let mut points: Vec<_> = (0..30).map(|_| Vector3::from_fn(|_, _| random.signed())).collect();
            let strays = 1 + (seed % 5) as usize;
            for _ in 0..strays {
                let u = Vector3::from_fn(|_, _| random.signed()).normalize();
                points.push(u * 10_f64.powf(1.0 + 4.0 * random.signed().abs()));
            }
            let found = trim(&points, (strays as f64 + 0.5) / points.len() as f64, &mut unwatched).unwrap();
            assert_eq!(found.left_out, points[30..], "seed {seed}");
        }
    }

    #[test]
    fn it_follows_affine_maps_and_nothing_is_left_out_of_nothing() {
        let points = scan(20);
        let map = Matrix3::new(3.0, 0.4, -0.2, 0.0, 0.05, 0.3, 0.1, -0.6, 20.0);
        let moved: Vec<_> = points.iter().map(|x| map * x + Vector3::new(5.0, -7.0, 1.0)).collect();
        let [one, other] = [&points, &moved].map(|points| trim(points, 0.05, &mut unwatched).unwrap());
        let apart =
            one.kept.iter().filter(|x| !other.kept.contains(&(map * *x + Vector3::new(5.0, -7.0, 1.0)))).count();
        assert!(apart <= 4, "{apart} points differ");
        let none = trim(&points, 0.0, &mut unwatched).unwrap();
        assert!(none.kept == points && none.left_out.is_empty() && none.farthest_m == 0.0);
    }

    #[test]
    fn fractions_are_checked_and_it_can_be_stopped() {
        for bad in [-0.1, 0.51, f64::NAN] {
            assert!(matches!(trim(&scan(0), bad, &mut unwatched), Err(FitError::Trim(_))));
        }
        assert!(matches!(trim(&scan(1), 0.01, &mut |_| ControlFlow::Break(())), Err(FitError::Cancelled)));
    }
}
