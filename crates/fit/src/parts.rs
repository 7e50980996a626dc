//! Compounds: one body for each of the nearly convex pieces of a mesh.
//!
//! The mesh is separated into components, cut by planes, and divided among parts (`decompose`);
//! each part becomes a body as any points do, and [`Compound::with_covering`] proves that no
//! triangle, and no interior of a closed mesh, is left out. Cut points are only known up to
//! rounding, so each body is pulled around balls of that size. The gap of a part is measured to the
//! convex hull of its own pieces; the union of those hulls lies in the hull of the whole mesh.

use super::decompose::{Decomposition, PartSearch};
use super::hull::convex_hull;
use super::object::Object;
use super::part_points::{PartPoints, part_points};
use super::rungs::{Costs, Rungs};
use super::{FitError, FitOptions, MAX_PIECES, Mesh, Progress, Rung, Shortfall};
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::{Body, Compound, Division, Piece, Provenance, Solver};

/// A fitted compound.
#[derive(Clone, Debug)]
pub struct CompoundFit {
    /// The compound: its parts proven like any body, and together to cover the mesh.
    pub compound: Compound,
    /// Wall time, seconds, with all that was tried before.
    pub seconds: f64,
    /// Why there are fewer parts than were asked for, if there are.
    pub shortfall: Option<Shortfall>,
}

/// A mesh with the name and the options of the compound around it.
pub(super) struct Source<'a> {
    pub(super) name: &'a str,
    pub(super) mesh: &'a Mesh,
    pub(super) options: &'a FitOptions,
}

/// Divides a mesh among at most `parts` parts, fewer where more would not make their hulls smaller,
/// and fits a body to each. Triangles of a closed mesh are all counter-clockwise seen from outside,
/// or all clockwise.
///
/// # Errors
/// As [`fit`](super::fit()), and [`FitError::Parts`], [`FitError::Mesh`], [`FitError::NotCovered`].
pub fn fit_parts(
    name: &str,
    mesh: &Mesh,
    parts: usize,
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<CompoundFit, FitError> {
    options.check(name)?;
    if !(1..=MAX_PIECES).contains(&parts) {
        return Err(FitError::Parts(parts));
    }
    let start = Instant::now();
    let source = Source { name, mesh, options };
    let whole = source.whole()?;
    let found = Decomposition::new(&whole, parts, PartSearch::Best, progress)?;
    let count = found.fewest(parts);
    let division = found.division(count);
    let mut bodies = Vec::new();
    for (index, points) in part_points(&whole, &division, count)?.into_iter().enumerate() {
        let one = on_part(index, &points, options, |object| {
            object.cut(object.fit(options, progress)?, options.slabs, 0.0, progress)
        });
        bodies.push(one?.body);
    }
    let shortfall = found.shortfall(count, parts);
    source.assemble(bodies, division, shortfall, start)
}

impl Source<'_> {
    /// The mesh in one piece.
    fn whole(&self) -> Result<Piece, FitError> {
        Ok(Piece::of_mesh(&self.mesh.points, &self.mesh.triangles)?)
    }

    /// The proven compound of parts.
    fn assemble(
        &self,
        parts: Vec<Body>,
        division: Division,
        shortfall: Option<Shortfall>,
        start: Instant,
    ) -> Result<CompoundFit, FitError> {
        let Mesh { points, triangles } = self.mesh;
        // Of what is covered: vertices that no triangle uses are not.
        let used: Vec<_> = self.whole()?.spots().iter().map(|spot| spot.x).collect();
        let hull = convex_hull(&used)?;
        let provenance = Provenance {
            input: self.options.input.clone(),
            objective: self.options.objective.name().to_owned(),
            refined: self.options.refine,
            hull_vertices: hull.vertices.len(),
            hull_volume_m3: hull.volume,
            solver: common_solver(&parts),
        };
        let compound = Compound::new(self.name, parts)?.with_covering(points, triangles, division)?;
        let compound = compound.with_provenance(provenance);
        Ok(CompoundFit { compound, seconds: start.elapsed().as_secs_f64(), shortfall })
    }
}

/// The search for the cheapest compound within a gap, of more and more parts; what was tried of a
/// part is kept.
pub(super) struct CompoundSearch<'a> {
    source: Source<'a>,
    max_gap_m: f64,
    start: Instant,
    whole: Piece,
    tried: HashMap<Key, Tried>,
}

/// All coordinates of the content of a part: parts of equal content are fitted alike.
type Key = Vec<[u64; 3]>;

/// What was tried of a part.
#[derive(Clone, Default)]
struct Tried {
    /// The lowest rung that is near enough.
    found: Option<Rung>,
    /// How many rungs were tried.
    rungs: usize,
}

impl<'a> CompoundSearch<'a> {
    pub(super) fn new(source: Source<'a>, max_gap_m: f64, start: Instant) -> Result<Self, FitError> {
        Ok(Self { whole: source.whole()?, source, max_gap_m, start, tried: HashMap::new() })
    }

    /// The cheapest compound near enough that costs less than `budget`; none if there is none.
    pub(super) fn cheaper_than(
        &mut self,
        budget: f64,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Option<CompoundFit>, FitError> {
        // So many that each could cost the least.
        let affordable = |budget: f64| ((budget / Costs::CHEAPEST).ceil() as usize).saturating_sub(1).min(MAX_PIECES);
        let found = Decomposition::new(&self.whole, affordable(budget).max(1), PartSearch::Best, progress)?;
        let mut best = None;
        let mut most = budget;
        for parts in 2..=found.most() {
            if parts > affordable(most) {
                break;
            }
            if found.fewest(parts) < parts {
                continue;
            }
            let division = found.division(parts);
            let points = part_points(&self.whole, &division, parts)?;
            if let Some((cost, bodies)) = self.climb(&points, most, progress)? {
                best = Some((bodies, division));
                most = cost;
            }
        }
        best.map(|(bodies, division)| self.source.assemble(bodies, division, None, self.start)).transpose()
    }

    /// The lowest rungs near enough of all parts, if they cost less than `most` together, and what
    /// they cost.
    fn climb(
        &mut self,
        parts: &[PartPoints],
        most: f64,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Option<(f64, Vec<Body>)>, FitError> {
        let Self { source, max_gap_m, tried, .. } = self;
        let mut cost = 0.0;
        let mut bodies = Vec::new();
        for (index, part) in parts.iter().enumerate() {
            let rest = (parts.len() - index - 1) as f64 * Costs::CHEAPEST;
            let allowed = most - cost - rest;
            let tried =
                tried.entry(part.points.iter().map(|x| [0, 1, 2].map(|i| x[i].to_bits())).collect()).or_default();
            if tried.found.is_none() && Costs::of_part(tried.rungs) < allowed {
                on_part(index, part, source.options, |object| {
                    let mut rungs = Rungs::new(object, *max_gap_m, source.options);
                    while tried.found.is_none() && Costs::of_part(tried.rungs) < allowed {
                        tried.found = rungs.try_one(tried.rungs, progress)?;
                        tried.rungs += 1;
                    }
                    Ok(())
                })?;
            }
            match &tried.found {
                Some(rung) if Costs::of(&rung.body) < allowed => {
                    cost += Costs::of(&rung.body);
                    bodies.push(rung.body.renamed(&part_name(index))?);
                }
                _ => return Ok(None),
            }
        }
        Ok(Some((cost, bodies)))
    }
}

fn part_name(index: usize) -> String {
    format!("part {index}")
}

/// Does something with the object in a part.
fn on_part<T>(
    index: usize,
    points: &PartPoints,
    options: &FitOptions,
    work: impl FnOnce(&Object<'_>) -> Result<T, FitError>,
) -> Result<T, FitError> {
    work(&Object::new(&part_name(index), &points.points, &options.input)?.around(points.uncertainty))
}

/// What solved the programs of all parts, if that is one solver.
fn common_solver(parts: &[Body]) -> Option<Solver> {
    let of_part = |part: &Body| part.provenance().and_then(|provenance| provenance.solver);
    let first = of_part(parts.first()?)?;
    parts.iter().all(|part| of_part(part) == Some(first)).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::{CompoundFit, fit_parts};
    use crate::{FitError, FitOptions, MAX_PIECES, Mesh, Progress, Representation, cheapest_within, fit};
    use nalgebra::{Rotation3, Vector3};
    use std::ops::ControlFlow;
    use sublevel_core::body::{Compound, Covered, MeshError};
    use sublevel_testkit::Seeded;

    fn unwatched(_: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn options(degree: usize) -> FitOptions {
        FitOptions { degree, ..FitOptions::default() }
    }

    /// A closed mesh like the letter H, 2 m wide, turned so that no axis fits it. Its parts are
    /// shorter than it is, and so are their gaps.
    fn letter() -> Mesh {
        #[rustfmt::skip]
        let outline = [
            [0.0, 0.0], [0.4, 0.0], [0.4, 0.15], [1.6, 0.15], [1.6, 0.0], [2.0, 0.0],
            [2.0, 0.4], [1.6, 0.4], [1.6, 0.25], [0.4, 0.25], [0.4, 0.4], [0.0, 0.4],
        ];
        let faces = [
            [[0, 1, 2], [0, 2, 9], [0, 9, 11], [9, 10, 11], [2, 3, 8]],
            [[3, 4, 5], [3, 5, 8], [5, 6, 8], [6, 7, 8], [2, 8, 9]],
        ];
        let turn = Rotation3::from_euler_angles(0.4, -0.3, 0.9);
        let layer = |z: f64| outline.map(|[x, y]| turn * Vector3::new(x, y, z));
        let points = [layer(0.0), layer(0.3)].concat();
        let mut triangles = vec![];
        for [a, b, c] in faces.concat() {
            triangles.extend([[a, c, b], [a + 12, b + 12, c + 12]]);
        }
        for i in 0..12 {
            let next = (i + 1) % 12;
            triangles.extend([[i, next, next + 12], [i, next + 12, i + 12]]);
        }
        Mesh { points, triangles }
    }

    /// Whether a ray from a point leaves a closed mesh more often than it enters it.
    fn inside(mesh: &Mesh, from: &Vector3<f64>) -> bool {
        let ray = Vector3::new(0.3141, 0.5926, 0.5358);
        let crossings = mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|corner| mesh.points[corner] - from);
            let sides = [ray.dot(&a.cross(&b)), ray.dot(&b.cross(&c)), ray.dot(&c.cross(&a))];
            let through = sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0);
            i32::from(through && a.dot(&b.cross(&c)) * sides.iter().sum::<f64>() > 0.0)
        });
        crossings.sum::<i32>() % 2 == 1
    }

    fn covers_the_inside(mesh: &Mesh, compound: &Compound) {
        let mut random = Seeded(7);
        let mut found = 0;
        for _ in 0..60_000 {
            let x = Vector3::from_fn(|_, _| 2.0 * random.signed());
            if inside(mesh, &x) {
                assert!(compound.parts().iter().any(|part| part.value(&x) <= 1.0), "{x:?}");
                found += 1;
            }
        }
        assert!(found > 50, "{found}");
    }

    #[test]
    fn a_compound_is_smaller_than_the_hull_and_covers_all() {
        let mesh = letter();
        let single = fit("letter", &mesh.points, &options(4), &mut unwatched).unwrap();
        let CompoundFit { compound, .. } = fit_parts("letter", &mesh, 3, &options(4), &mut unwatched).unwrap();
        assert_eq!(compound.parts().len(), 3);
        let covering = compound.covering().unwrap();
        assert_eq!(covering.proven, Covered::Interior);
        let (covered, most) = compound.prove_covers(&mesh.points, &mesh.triangles, &covering.division).unwrap();
        assert!(covered == Covered::Interior && most <= 1.0 && most > 1.0 - 1e-9, "{most}");
        // The letter's own volume is 0.132, that of its hull 0.24.
        let volume = compound.volume().volume_m3;
        assert!(volume < 0.85 * single.report.volume_m3 && volume > 0.132, "{volume} {}", single.report.volume_m3);
        assert!(compound.gap_m().unwrap() < single.gap.most_m);
        covers_the_inside(&mesh, &compound);
        let again = Compound::from_json(&compound.to_json()).unwrap();
        assert_eq!(again.to_json(), compound.to_json());

        let open = Mesh { triangles: mesh.triangles[1..].to_vec(), ..mesh.clone() };
        let CompoundFit { compound, .. } = fit_parts("letter", &open, 3, &options(2), &mut unwatched).unwrap();
        assert_eq!(compound.covering().unwrap().proven, Covered::SurfaceOnly);
    }

    #[test]
    fn slabs_contain_the_rounding_of_cuts_too() {
        let mesh = letter();
        let far = Mesh { points: mesh.points.iter().map(|x| x + Vector3::repeat(1e4)).collect(), ..mesh.clone() };
        for mesh in [mesh, far] {
            let options = FitOptions { slabs: 3, ..options(2) };
            let CompoundFit { compound, .. } = fit_parts("letter", &mesh, 3, &options, &mut unwatched).unwrap();
            assert!(compound.parts().iter().any(|part| part.constraints().len() > 1));
        }
    }

    #[test]
    fn a_gap_takes_a_compound_where_that_is_cheaper() {
        let mesh = letter();
        let within = |gap: f64, degree: usize| cheapest_within("letter", &mesh, gap, &options(degree), &mut unwatched);
        let single = fit("letter", &mesh.points, &options(4), &mut unwatched).unwrap();
        // What degree 4 does alone it does cheaper than two parts.
        match within(single.gap.most_m * 1.0001, 8).unwrap() {
            Representation::Body(rung) => assert_eq!(rung.body.degree(), 4),
            Representation::Compound(fit) => panic!("{} parts", fit.compound.parts().len()),
        }
        let three = fit_parts("letter", &mesh, 3, &options(4), &mut unwatched).unwrap().compound;
        let asked = three.gap_m().unwrap() * 1.0001;
        match within(asked, 4).unwrap() {
            Representation::Compound(found) => {
                let compound = found.compound;
                assert!((2..=3).contains(&compound.parts().len()) && compound.gap_m().unwrap() <= asked);
                covers_the_inside(&mesh, &compound);
            }
            Representation::Body(rung) => panic!("degree {}, gap {:?}", rung.body.degree(), rung.gap),
        }
        // The hull of the letter is a box, which three slabs leave.
        match within(1e-4, 2).unwrap() {
            Representation::Body(rung) => assert_eq!(rung.body.constraints().len(), 4),
            Representation::Compound(fit) => panic!("{} parts", fit.compound.parts().len()),
        }
    }

    #[test]
    fn bad_input_is_refused_and_a_fit_can_be_stopped() {
        let mesh = letter();
        for parts in [0, MAX_PIECES + 1] {
            let message = fit_parts("letter", &mesh, parts, &options(2), &mut unwatched).unwrap_err();
            assert!(matches!(message, FitError::Parts(count) if count == parts));
        }
        let cloud = Mesh { triangles: vec![], ..mesh.clone() };
        let message = fit_parts("letter", &cloud, 2, &options(2), &mut unwatched).unwrap_err();
        assert_eq!(message, FitError::Mesh(MeshError::NoTriangles));
        assert!(matches!(fit_parts("letter", &mesh, 2, &options(3), &mut unwatched), Err(FitError::Degree(3))));
        let mut heard = 0;
        let mut stop = |_: Progress| {
            heard += 1;
            if heard > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        assert!(matches!(fit_parts("letter", &mesh, 3, &options(4), &mut stop), Err(FitError::Cancelled)));
    }
}
