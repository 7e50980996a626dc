//! The same object at several levels of detail, from the smallest ball around it to degree 8.

use super::object::Object;
use super::parts::{CompoundSearch, Source};
use super::rungs::{Costs, DEGREES, Rungs, degree_options};
use super::{CompoundFit, FitError, FitOptions, Mesh, Progress, Rung};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::time::Instant;

/// The lowest rung: the smallest ball around the points, metres.
///
/// # Errors
/// As [`fit`](super::fit()), of bad input.
pub fn ball(name: &str, points: &[Vector3<f64>]) -> Result<Rung, FitError> {
    let options = FitOptions::default();
    options.check(name)?;
    Object::new(name, points, &options.input)?.ball()
}

/// The rungs of an object: the smallest ball, the smallest ellipsoid, and bodies of degree 4, 6, 8
/// up to that of the options, each but the ball refined and cut by slabs as they say.
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
    for options in degree_options(options) {
        rungs.push(object.cut(object.fit(&options, progress)?, options.slabs, 0.0, progress)?.into());
    }
    Ok(rungs)
}

/// The representation of an object that is the cheapest to query of those whose gap is at most
/// `max_gap_m`, metres.
///
/// A ladder is climbed up to the degree of the options. If no rung is near enough they are cut by
/// slabs, and the one that gets there with the fewest terms is taken: slabs make edges, which cost
/// a query more than a degree does.
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
    check(name, max_gap_m, options)?;
    let start = Instant::now();
    let object = Object::new(name, points, &options.input)?;
    let timed = |rung: Rung| Rung { seconds: start.elapsed().as_secs_f64(), ..rung };
    let mut rungs = Rungs::new(&object, max_gap_m, options);
    if let Some(rung) = rungs.climb(0..=DEGREES.len(), progress)? {
        return Ok(timed(rung));
    }
    rungs.slabbed(progress).map(timed)
}

/// What a gap is kept with.
#[derive(Clone, Debug)]
pub enum Representation {
    /// One body.
    Body(Box<Rung>),
    /// Several.
    Compound(Box<CompoundFit>),
}

impl From<Rung> for Representation {
    fn from(rung: Rung) -> Self {
        Self::Body(Box::new(rung))
    }
}

impl From<CompoundFit> for Representation {
    fn from(fit: CompoundFit) -> Self {
        Self::Compound(Box::new(fit))
    }
}

/// As [`coarsest_within`], of a mesh with triangles: a compound of convex pieces is taken where
/// that is cheaper than what else is near enough.
///
/// What a query costs is taken for the sum over the parts of what one of a part alone does: 0.15,
/// 0.2, 0.25, 0.45 µs at degree 2, 4, 6, 8 (measured, warm; the ratios matter), and 3 µs for a body
/// with slabs. So the order is: ball, ellipsoid, degree 4, degree 6; compounds cheaper than degree
/// 8, which are two parts of degree 2 or 4; degree 8; compounds cheaper than slabs, up to 19 parts;
/// slabs. Each part has the lowest degree that keeps the gap, 6 at most: what needs 8 is cut
/// further, at little more cost and in less time. Parts far from the other solid cost a query less
/// than that.
///
/// # Errors
/// As [`coarsest_within`] and [`fit_parts`](super::fit_parts).
pub fn cheapest_within(
    name: &str,
    mesh: &Mesh,
    max_gap_m: f64,
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Representation, FitError> {
    check(name, max_gap_m, options)?;
    let start = Instant::now();
    let object = Object::new(name, &mesh.points, &options.input)?;
    let timed = |rung: Rung| Rung { seconds: start.elapsed().as_secs_f64(), ..rung }.into();
    let mut rungs = Rungs::new(&object, max_gap_m, options);
    if let Some(rung) = rungs.climb(0..=3, progress)? {
        return Ok(timed(rung));
    }
    let mut compounds = CompoundSearch::new(Source { name, mesh, options }, max_gap_m, start)?;
    if let Some(found) = compounds.cheaper_than(Costs::of_rung(4), progress)? {
        return Ok(found.into());
    }
    if let Some(rung) = rungs.climb(4..=4, progress)? {
        return Ok(timed(rung));
    }
    if let Some(found) = compounds.cheaper_than(Costs::SLABBED, progress)? {
        return Ok(found.into());
    }
    rungs.slabbed(progress).map(timed)
}

fn check(name: &str, max_gap_m: f64, options: &FitOptions) -> Result<(), FitError> {
    options.check(name)?;
    if max_gap_m > 0.0 { Ok(()) } else { Err(FitError::MaxGap(max_gap_m)) }
}

#[cfg(test)]
mod tests {
    use super::{Rung, coarsest_within, ladder};
    use crate::{FitError, FitOptions, MAX_SLABS, Progress, fit};
    use nalgebra::Vector3;
    use std::ops::ControlFlow;
    use sublevel_testkit::Seeded;

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
