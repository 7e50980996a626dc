//! Convex decomposition: the partition of a mesh whose hulls have the least volume, for every
//! number of parts at once.
//!
//! Several searches compete. One cuts by gain alone (`split`); others cut into more regions than
//! are asked for, by gain and by ledges (`segment`), and merge them again (`merge`). Each number of
//! parts takes the partition of the least total volume.

use super::part_points::part_points;
use super::progress::Watch;
use super::segment::{NEGLIGIBLE_VOLUME, Nested, Segmentation, Style};
use super::split::Partition;
use super::{FitError, MAX_PIECES, Mesh, Progress, Shortfall};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use sublevel_core::body::{Division, Piece};

/// Regions beyond the parts asked for: as many again, but at most this many, and a few more.
const MOST_MORE: usize = 12;
const FEW_MORE: usize = 2;

/// How partitions are searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartSearch {
    /// One cut after the other, each the one that gains most, as long as one gains: what the others
    /// compete with.
    Greedy,
    /// All searches, and for each number of parts the best of what they find.
    Best,
}

/// The points of at most `parts` parts of a mesh, whose convex hulls have the least volume that was
/// found: each part with all corners of its pieces. The hulls cover the mesh, and what it encloses
/// if it is closed, up to rounding.
///
/// # Errors
/// [`FitError::Parts`], [`FitError::Mesh`] or [`FitError::Cancelled`].
pub fn convex_parts(
    mesh: &Mesh,
    parts: usize,
    search: PartSearch,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Vec<Vec<Vector3<f64>>>, FitError> {
    if !(1..=MAX_PIECES).contains(&parts) {
        return Err(FitError::Parts(parts));
    }
    let whole = Piece::of_mesh(&mesh.points, &mesh.triangles)?;
    let found = Decomposition::new(&whole, parts, search, progress)?;
    let count = found.fewest(parts);
    Ok(part_points(&whole, &found.division(count), count)?.into_iter().map(|part| part.points).collect())
}

/// Partitions of a mesh.
pub(super) struct Decomposition {
    greedy: Partition,
    segmentations: Vec<(Segmentation, Nested)>,
    /// For 1, 2, 3 ... parts the least total volume of the hulls, and the search that found it.
    best: Vec<(f64, Source)>,
    /// Components of the mesh, those whose joint hull adds nothing taken for one.
    groups: usize,
    /// Volume of the mesh, if it is closed.
    own: Option<f64>,
}

/// Where a partition is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Greedy,
    Segmentation(usize),
}

impl Decomposition {
    /// Partitions of up to `most` parts.
    ///
    /// # Errors
    /// [`FitError::Cancelled`].
    pub(super) fn new(
        mesh: &Piece,
        most: usize,
        search: PartSearch,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Self, FitError> {
        let mut watch = Watch::new(progress);
        let mut step = |pieces: usize| {
            watch.round(pieces, 0.0);
            watch.iteration(0.0)
        };
        let own = mesh.is_closed().then(|| mesh.signed_volume().abs());
        let greedy = Partition::new(mesh.clone());
        let whole = greedy.totals[0];
        let mut found = Self { best: vec![(whole, Source::Greedy)], greedy, segmentations: Vec::new(), groups: 1, own };
        if most == 1 || !(whole > 0.0) {
            return Ok(found);
        }
        while found.greedy.totals.len() < most {
            step(found.greedy.totals.len())?;
            if !found.greedy.divide() {
                break;
            }
        }
        found.enter(&found.greedy.totals.clone(), most, Source::Greedy);
        if search == PartSearch::Greedy {
            return Ok(found);
        }
        for style in [Style::ByGain, Style::ByLedges] {
            let mut segmentation = Segmentation::new(mesh, whole, style, &mut step)?;
            if style == Style::ByLedges && !segmentation.has_ledges() {
                continue;
            }
            found.groups = segmentation.len();
            let regions = segmentation.len() + most + most.min(MOST_MORE) + FEW_MORE;
            while segmentation.len() < regions && segmentation.divide(regions - segmentation.len(), &mut step)? {}
            let nested = segmentation.nested(&mut step)?;
            found.enter(&nested.totals(), most, Source::Segmentation(found.segmentations.len()));
            found.segmentations.push((segmentation, nested));
        }
        Ok(found)
    }

    /// Lets the totals of a search compete.
    fn enter(&mut self, totals: &[f64], most: usize, source: Source) {
        for (index, &total) in totals.iter().enumerate().take(most) {
            match self.best.get_mut(index) {
                // What is as good within the noise is not worth a change, but to one that keeps
                // components apart.
                Some(best) if total < best.0 * (1.0 - NEGLIGIBLE_VOLUME) => *best = (total, source),
                Some(best) if best.1 == Source::Greedy && total <= best.0 * (1.0 + NEGLIGIBLE_VOLUME) => {
                    *best = (total, source);
                }
                Some(_) => {}
                None => self.best.push((total, source)),
            }
        }
    }

    /// Most parts of which there is a partition.
    pub(super) fn most(&self) -> usize {
        self.best.len()
    }

    /// The number of parts, at most so many, whose hulls have the least volume, as long as each
    /// part more gains something. What is not connected is kept in parts of its own where that is
    /// as good.
    pub(super) fn fewest(&self, parts: usize) -> usize {
        let worth = NEGLIGIBLE_VOLUME * self.best[0].0;
        let cost = |index: usize| self.best[index].0 + worth * index as f64;
        let known = parts.min(self.best.len());
        let least = (0..known).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(0);
        let apart = self.groups.min(known).max(1) - 1;
        1 + if apart > least && self.best[apart].0 <= self.best[least].0 + worth { apart } else { least }
    }

    /// Total volume of the hulls of this many parts.
    pub(super) fn total(&self, parts: usize) -> f64 {
        self.best[parts - 1].0
    }

    /// How the mesh is divided among this many parts.
    pub(super) fn division(&self, parts: usize) -> Division {
        match self.best[parts - 1].1 {
            Source::Greedy => Division::by_cuts(self.greedy.cuts[..parts - 1].to_vec()),
            Source::Segmentation(index) => {
                let (segmentation, nested) = &self.segmentations[index];
                segmentation.division(nested, parts)
            }
        }
    }

    /// Why no more parts came out, if more were asked for.
    pub(super) fn shortfall(&self, parts: usize, asked: usize) -> Option<Shortfall> {
        (parts < asked).then(|| Shortfall::new(parts, self.total(parts), self.own))
    }
}

#[cfg(test)]
mod tests {
    use super::{Decomposition, PartSearch, convex_parts};
    use crate::{FitError, Mesh, Progress, Shortfall};
    use nalgebra::Vector3;
    use std::ops::ControlFlow;
    use sublevel_core::body::Piece;

    fn unwatched(_: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Boxes, each from one corner to the other.
    fn boxes(corners: &[[[f64; 3]; 2]]) -> Mesh {
        let mut mesh = Mesh { points: vec![], triangles: vec![] };
        for &[low, high] in corners {
            let before = mesh.points.len();
            mesh.points.extend(
                (0..8_u8).map(|i| Vector3::from_fn(|axis, _| if i >> axis & 1 == 1 { high[axis] } else { low[axis] })),
            );
            let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
            let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
            mesh.triangles.extend(triangles.map(|triangle: [usize; 3]| triangle.map(|corner| corner + before)));
        }
        mesh
    }

    fn found(mesh: &Mesh, most: usize) -> Decomposition {
        let whole = Piece::of_mesh(&mesh.points, &mesh.triangles).unwrap();
        Decomposition::new(&whole, most, PartSearch::Best, &mut unwatched).unwrap()
    }

    #[test]
    fn components_are_parts_and_the_nearest_are_merged() {
        // Two pairs of cubes; each pair is nearly one box.
        let places = [0.0, 1.1, 5.0, 6.2];
        let mesh = boxes(&places.map(|x| [[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]]));
        for (parts, total) in [(1, 7.2), (2, 2.1 + 2.2), (3, 2.1 + 2.0), (4, 4.0), (9, 4.0)] {
            let found = found(&mesh, parts);
            let made = found.fewest(parts);
            assert!(made == parts.min(4) && (found.total(made) - total).abs() < 1e-5, "{parts}: {made}");
            assert_eq!(found.shortfall(made, parts).is_some(), parts > 4);
        }
        let found = found(&mesh, 2);
        let division = found.division(2);
        assert!(division.separated && division.cuts.is_empty());
        assert_eq!(division.parts, [0, 0, 1, 1]);
    }

    #[test]
    fn cuts_that_only_divided_a_part_are_left_out() {
        let mesh = boxes(&[[[0.0; 3], [3.0, 1.0, 1.0]], [[0.0, 1.0, 0.0], [1.0, 3.0, 1.0]], [[9.0; 3], [10.0; 3]]]);
        for parts in 2..5 {
            let found = found(&mesh, parts);
            let made = found.fewest(parts);
            let division = found.division(made);
            let whole = Piece::of_mesh(&mesh.points, &mesh.triangles).unwrap();
            assert_eq!(division.pieces(whole, made).unwrap().len(), made);
            assert!(division.cuts.len() < 2, "{division:?}");
        }
    }

    #[test]
    fn many_small_components_take_bounded_time() {
        let grid = (0..400).map(|i| {
            let low = [f64::from(i % 20), f64::from(i / 20), f64::from(i % 7)];
            [low, low.map(|x| x + 0.5)]
        });
        let mesh = boxes(&grid.collect::<Vec<_>>());
        for parts in [1, 2, 64] {
            let found = found(&mesh, parts);
            assert_eq!(found.fewest(parts), parts);
            assert!(found.total(parts) < found.total(1) * (1.0 + 1e-9) && found.total(parts) > 50.0);
        }
    }

    #[test]
    fn convex_objects_are_one_part_whatever_is_asked() {
        let mesh = boxes(&[[[0.0; 3], [1.0, 2.0, 3.0]]]);
        let found = found(&mesh, 8);
        assert_eq!(found.fewest(8), 1);
        assert!(matches!(found.shortfall(1, 8), Some(Shortfall::Filled { parts: 1, excess }) if excess < 1e-5));
        assert_eq!(found.shortfall(1, 1), None);
        // Two halves of a box are a box.
        let halves = boxes(&[[[0.0; 3], [1.0; 3]], [[1.0, 0.0, 0.0], [2.0, 1.0, 1.0]]]);
        assert_eq!(convex_parts(&halves, 5, PartSearch::Best, &mut unwatched).unwrap().len(), 1);
        // A cavity is filled with its shell.
        let mut hollow = boxes(&[[[0.0; 3], [3.0; 3]], [[1.0; 3], [2.0; 3]]]);
        hollow.triangles[12..].iter_mut().for_each(|triangle| triangle.swap(1, 2));
        assert!(convex_parts(&hollow, 1, PartSearch::Best, &mut unwatched).unwrap().len() == 1);
    }

    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn no_search_is_worse_than_the_greedy_one() {
        for name in ["faults/shelf.off", "meshes/wingnut.off", "meshes/mbm_mug.off", "meshes/mbm_table.off"] {
            let mesh = crate::read_mesh(&sublevel_testkit::data(name), &crate::ReadOptions::default()).unwrap().mesh;
            let found = found(&mesh, 8);
            for parts in 1..=found.most() {
                let greedy = found.greedy.totals.get(parts - 1).or(found.greedy.totals.last()).unwrap();
                let total = found.total(found.fewest(parts));
                assert!(total <= greedy + 1e-5 * found.total(1), "{name}, {parts} parts: {total} {greedy}");
                println!("{name}, {parts} parts: {total:.4e} of {greedy:.4e}");
            }
        }
    }

    #[test]
    fn the_search_can_be_stopped_and_refuses_bad_numbers() {
        let mesh = boxes(&[[[0.0; 3], [3.0, 1.0, 1.0]], [[0.0, 2.0, 0.0], [1.0, 3.0, 1.0]]]);
        for after in 0..4 {
            let mut heard = 0;
            let mut stop = |_: Progress| {
                heard += 1;
                if heard > after { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            assert_eq!(convex_parts(&mesh, 4, PartSearch::Best, &mut stop), Err(FitError::Cancelled));
        }
        assert_eq!(convex_parts(&mesh, 0, PartSearch::Best, &mut unwatched), Err(FitError::Parts(0)));
        // Without volume there is one part, which no body is fitted to.
        let flat = Mesh { triangles: vec![[0, 1, 2], [0, 2, 1], [1, 1, 1]], ..mesh };
        assert_eq!(convex_parts(&flat, 4, PartSearch::Best, &mut unwatched).unwrap().len(), 1);
    }
}
