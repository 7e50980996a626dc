//! The same object at several levels of detail, from the smallest ball around it to degree 8.

use super::object::Object;
use super::{Fit, FitError, FitOptions, FitReport, Gap, Progress};
use crate::body::{Body, MAX_CONSTRAINTS};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::time::Instant;

/// Most slabs a body may be cut by.
pub const MAX_SLABS: usize = MAX_CONSTRAINTS - 1;

/// Terms of a slab's quadratic.
const SLAB_TERMS: usize = 10;

/// Degrees of the rungs above the ball.
const DEGREES: [usize; 4] = [2, 4, 6, 8];

/// One representation of an object, which it contains.
#[derive(Clone, Debug)]
pub struct Rung {
    /// The body, proven.
    pub body: Body,
    /// How far it reaches beyond the convex hull of the points.
    pub gap: Gap,
    /// Wall time, seconds, with all that was tried before.
    pub seconds: f64,
    /// What the fit took and reached; none for the ball.
    pub report: Option<FitReport>,
}

impl From<Fit> for Rung {
    fn from(fit: Fit) -> Self {
        Self { body: fit.body, gap: fit.gap, seconds: fit.report.seconds, report: Some(fit.report) }
    }
}

/// The lowest rung: the smallest ball around the points, metres.
///
/// # Errors
/// As [`fit`](super::fit()), of bad input.
pub fn ball(name: &str, points: &[Vector3<f64>]) -> Result<Rung, FitError> {
    let options = FitOptions::default();
    options.check(name)?;
    Object::new(name, points, &options.input)?.ball()
}

/// The rungs of an object: the smallest ball, the smallest ellipsoid, and bodies of degree 4, 6, 8 up to that of the options, each
/// but the ball refined and cut by slabs as they say.
///
/// # Errors
/// As [`fit`](super::fit()).
pub fn ladder(
    name: &str,
    points: &[Vector3<f64>],
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Vec<Rung>, FitError> {
    options.check(name)?;
    let object = Object::new(name, points, &options.input)?;
    let mut rungs = vec![object.ball()?];
    for options in climb(options) {
        rungs.push(object.cut(object.fit(&options, progress)?, options.slabs, 0.0, progress)?.into());
    }
    Ok(rungs)
}

/// The representation of an object that is the cheapest to query of those whose gap is at most `max_gap_m`, metres.
///
/// A ladder is climbed up to the degree of the options. If no rung is near enough they are cut by slabs, and the one that gets there
/// with the fewest terms is taken: slabs make edges, which cost a query more than a degree does.
///
/// # Errors
/// As [`fit`](super::fit()), and [`FitError::Gap`] with the closest that was reached.
pub fn coarsest_within(
    name: &str,
    points: &[Vector3<f64>],
    max_gap_m: f64,
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Rung, FitError> {
    options.check(name)?;
    if !(max_gap_m > 0.0) {
        return Err(FitError::MaxGap(max_gap_m));
    }
    let start = Instant::now();
    let object = Object::new(name, points, &options.input)?;
    let timed = |rung: Rung| Rung { seconds: start.elapsed().as_secs_f64(), ..rung };
    let ball = object.ball()?;
    if ball.gap.most_m <= max_gap_m {
        return Ok(timed(ball));
    }
    // What fails is told if nothing else does.
    let mut closest = FitError::Gap { asked_m: max_gap_m, reached_m: f64::INFINITY, degree: 0, slabs: 0 };
    let mut fits = Vec::new();
    for options in climb(options) {
        match object.fit(&options, progress) {
            Ok(fit) if fit.gap.most_m <= max_gap_m => return Ok(timed(fit.into())),
            Ok(fit) => fits.push(fit),
            Err(FitError::Cancelled) => return Err(FitError::Cancelled),
            Err(error) => closest = error,
        }
    }
    let mut cheapest: Option<Fit> = None;
    for fit in fits {
        let room = cheapest.as_ref().map_or(usize::MAX, |known| terms(&known.body).saturating_sub(terms(&fit.body)));
        let slabs = MAX_SLABS.min(room.saturating_sub(1) / SLAB_TERMS);
        match object.cut(fit, slabs, max_gap_m, progress) {
            Ok(fit) if fit.gap.most_m <= max_gap_m => cheapest = Some(fit),
            Ok(Fit { body, gap, .. }) => {
                if let FitError::Gap { reached_m, degree, slabs, .. } = &mut closest
                    && gap.most_m < *reached_m
                {
                    (*reached_m, *degree, *slabs) = (gap.most_m, body.degree(), body.constraints().len() - 1);
                }
            }
            Err(FitError::Cancelled) => return Err(FitError::Cancelled),
            Err(error) => closest = error,
        }
    }
    cheapest.map(|fit| timed(fit.into())).ok_or(closest)
}

/// Terms of all constraints, which queries evaluate.
fn terms(body: &Body) -> usize {
    body.constraints().iter().map(|constraint| constraint.polynomial.terms().len()).sum()
}

/// The options of the rungs above the ball.
fn climb(options: &FitOptions) -> impl Iterator<Item = FitOptions> {
    DEGREES
        .into_iter()
        .filter(|&degree| degree <= options.degree)
        .map(|degree| FitOptions { degree, ..options.clone() })
}

#[cfg(test)]
mod tests {
    use super::{MAX_SLABS, Rung, coarsest_within, ladder};
    use crate::fit::{FitError, FitOptions, Progress, fit};
    use crate::polynomial::tests::Seeded;
    use nalgebra::Vector3;
    use std::ops::ControlFlow;

    fn unwatched(_: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// A brick with rounded ends, turned, metres.
    fn brick() -> Vec<Vector3<f64>> {
        let mut random = Seeded(3);
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 1.1);
        (0..400)
            .map(|_| {
                let u = Vector3::from_fn(|_, _| random.signed());
                let along = 0.3 * u.x.signum() + 0.05 * u.normalize().x;
                turn * Vector3::new(along, 0.1 * u.y.clamp(-0.8, 0.8), 0.06 * u.z.clamp(-0.8, 0.8))
            })
            .collect()
    }

    #[test]
    fn every_rung_holds_the_points_and_is_closer_than_the_one_below() {
        let points = brick();
        let rungs =
            ladder("brick", &points, &FitOptions { degree: 6, ..FitOptions::default() }, &mut unwatched).unwrap();
        let degrees: Vec<_> = rungs.iter().map(|rung| (rung.report.is_some(), rung.body.degree())).collect();
        assert_eq!(degrees, [(false, 2), (true, 2), (true, 4), (true, 6)]);
        for pair in rungs.windows(2) {
            let [below, above] = pair else { unreachable!() };
            assert!(above.gap.mean_m < below.gap.mean_m && above.gap.most_m < below.gap.most_m, "{:?}", above.gap);
        }
        for Rung { body, gap, .. } in &rungs {
            body.prove_contains(&points).unwrap();
            assert_eq!(body.gap_m(), Some(gap.most_m));
            assert!(gap.found_m <= gap.most_m && gap.most_m <= 1.03 * gap.found_m, "{gap:?}");
        }
    }

    #[test]
    fn the_coarsest_body_within_a_gap_is_on_the_lowest_rung_that_is() {
        let points = brick();
        let options = FitOptions { degree: 4, ..FitOptions::default() };
        let rungs = ladder("brick", &points, &options, &mut unwatched).unwrap();
        let within = |gap_m: f64| coarsest_within("brick", &points, gap_m, &options, &mut unwatched);
        for rung in &rungs {
            let found = within(rung.gap.most_m * 1.0001).unwrap();
            assert_eq!(found.body.id(), rung.body.id());
        }
        // Closer than degree 4 gets: slabs.
        let asked = 0.4 * rungs[2].gap.most_m;
        let found = within(asked).unwrap();
        assert!(found.gap.most_m <= asked && found.body.constraints().len() > 1, "{:?}", found.gap);
        found.body.prove_contains(&points).unwrap();
        match within(1e-6) {
            Err(FitError::Gap { reached_m, slabs, .. }) => assert!(reached_m > 1e-6 && slabs == MAX_SLABS),
            other => panic!("{:?}", other.map(|rung| rung.gap)),
        }
        for bad in [0.0, -1.0, f64::NAN] {
            assert!(matches!(within(bad), Err(FitError::MaxGap(_))));
        }
    }

    #[test]
    fn slabs_bring_a_body_closer_each_time() {
        let points = brick();
        let mut last = f64::INFINITY;
        for slabs in 0..5 {
            let options = FitOptions { degree: 4, slabs, ..FitOptions::default() };
            let found = fit("brick", &points, &options, &mut unwatched).unwrap();
            assert_eq!(found.body.constraints().len(), 1 + slabs);
            assert!(found.gap.most_m < last && found.report.volume_m3 > found.report.hull_volume_m3, "{:?}", found.gap);
            last = found.gap.most_m;
            let mut random = Seeded(slabs as u64);
            for _ in 0..5_000 {
                let n = Vector3::from_fn(|_, _| random.signed()).normalize();
                let hull = points.iter().map(|x| n.dot(x)).fold(f64::MIN, f64::max);
                let beyond = n.dot(&found.body.support(&n).point) - hull;
                assert!(beyond <= found.gap.most_m, "slabs {slabs}: {beyond} along {n:?}, {:?}", found.gap);
            }
        }
    }
}
