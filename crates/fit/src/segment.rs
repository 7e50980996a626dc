//! Objects cut into more regions than parts are asked for, which are then merged (`merge`): so the
//! search looks beyond cuts that gain nothing by themselves, such as the first ones of a tube or an
//! open box.
//!
//! It begins with the components of the mesh; those whose joint hull adds nothing, such as a cavity
//! and its shell, are one region. As long as some cut reduces the volume of the hulls, the one that
//! gains most is made. Where none does, the region that fills least of its hull is cut all the
//! same: by the plane after which the next two cuts promise most, or where that is none, by a ledge
//! or across the middle. The style *by ledges* cuts where sharp reflex edges are before it looks
//! for anything else.

use super::FitError;
use super::hull::principal_axes;
use super::merge::{Hull, Merger, merge, total};
use super::reflex::{Ledge, ledges};
use super::split::{FINALISTS, LEAST_SHARE, Scan, samples};
use nalgebra::Vector3;
use sublevel_core::body::{Caps, Cut, Division, Piece};

/// Volume that counts as none, relative to the hull of the object; dimensionless: the noise of
/// rough hulls, whose points are moved by 1e-7, and a little more.
///
/// A smaller value makes cuts that gain noise; a larger one misses small parts. Pinned by
/// `convex_objects_are_one_part_whatever_is_asked`.
pub(super) const NEGLIGIBLE_VOLUME: f64 = 1e-6;

/// Gain, relative to the hull of the object, below which a cut is made only if nothing better is
/// left; dimensionless.
///
/// Ten times the noise of rough hulls. A larger value turns to the region that wastes most too
/// early; a smaller one follows noise. It steers the search, and no test fixes it: its effect shows
/// in the comparison of convex parts (`crates/bench`).
const WORTHWHILE_GAIN: f64 = 1e-5;

/// Excess of a region's hull over its volume, relative to the hull of the object, below which the
/// region is left alone; dimensionless.
///
/// A larger value leaves parts uncut that a user would see; a smaller one spends the regions on
/// facets of curved surfaces. It steers the search, and no test fixes it: its effect shows in the
/// comparison of convex parts (`crates/bench`).
const CONVEX_EXCESS: f64 = 1e-3;

/// Gain of the best cut, as a part of what a region wastes, and waste, as a part of the object,
/// that together start a search for cuts that gain more together; dimensionless.
///
/// A larger value looks ahead nearly always, which takes long; a smaller one stops at regions that
/// need two cuts. It steers the search, and no test fixes it: its effect shows in the comparison of
/// convex parts (`crates/bench`).
const LOOK_AHEAD_SHARE: f64 = 0.05;

/// Most cuts in a row that gain nothing, of a closed region and of an open one, whose own volume is
/// not known.
const BLIND_CLOSED: usize = 4;
const BLIND_OPEN: usize = 2;

/// Cuts of a side that are measured when looking ahead.
const GLANCES: usize = 3;

/// How many cuts are counted when looking ahead: the one, and one of either side; their joint gain
/// is divided by it.
const AHEAD: f64 = 3.0;

/// Part of the length of all sharp reflex edges that must lie in one plane for an object of ledges;
/// dimensionless.
///
/// Scans have small ledges everywhere. A larger value misses furniture; a smaller one takes scans
/// for it. It steers the search, and no test fixes it: its effect shows in the comparison of convex
/// parts (`crates/bench`).
const LEDGE_SHARE: f64 = 0.1;

/// Most ledges that are measured.
const LEDGES: usize = 8;

/// Where cuts are looked for first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// Where they gain most.
    ByGain,
    /// Where there are sharp reflex edges.
    ByLedges,
}

/// A piece of the mesh, and how it was cut.
struct Node {
    piece: Piece,
    cut: Option<(Vector3<f64>, f64, [usize; 2])>,
}

/// Uncut pieces that stay together.
struct Region {
    pieces: Vec<usize>,
    hull: Hull,
    /// Volume inside, if all pieces are closed.
    own: Option<f64>,
    /// How many cuts in a row have gained nothing up to here.
    blind: usize,
    plan: Option<Plan>,
}

/// What is known of a region's best cut.
enum Plan {
    /// There is none worth making.
    Nothing,
    Cut {
        normal: Vector3<f64>,
        height: f64,
        gain: f64,
        /// What it and the next cuts gain, each.
        merit: f64,
    },
}

/// A plane, the two sides that it leaves of a region, and what it gains.
struct Halves {
    normal: Vector3<f64>,
    height: f64,
    gain: f64,
    sides: [Side; 2],
}

/// One side of a plane.
struct Side {
    pieces: Vec<Piece>,
    hull: Hull,
}

/// An object in regions.
pub(super) struct Segmentation {
    style: Style,
    nodes: Vec<Node>,
    roots: usize,
    /// Nodes in the order in which they were cut.
    order: Vec<usize>,
    regions: Vec<Region>,
    /// Volume of the hull of the whole.
    whole: f64,
}

type Step<'a> = &'a mut dyn FnMut(usize) -> Result<(), FitError>;

impl Segmentation {
    /// The components of a mesh whose hull has this volume.
    pub(super) fn new(mesh: &Piece, whole: f64, style: Style, step: Step<'_>) -> Result<Self, FitError> {
        let nodes: Vec<Node> = mesh.components().into_iter().map(|piece| Node { piece, cut: None }).collect();
        let hulls: Vec<Hull> = nodes.iter().map(|node| Hull::of(corners(&[&node.piece]))).collect();
        let mut groups: Vec<Vec<usize>> = (0..nodes.len()).map(|piece| vec![piece]).collect();
        for Merger { pair, .. } in merge(hulls, NEGLIGIBLE_VOLUME * whole, step)? {
            let joint = pair.map(|part| std::mem::take(&mut groups[part])).concat();
            groups.push(joint);
        }
        groups.retain(|group| !group.is_empty());
        groups.sort();
        let mut made = Self { style, roots: nodes.len(), nodes, order: Vec::new(), regions: Vec::new(), whole };
        for pieces in groups {
            let hull = Hull::of(corners(&made.pieces(&pieces)));
            let region = made.region(pieces, hull, 0);
            made.regions.push(region);
        }
        Ok(made)
    }

    /// How many regions there are.
    pub(super) fn len(&self) -> usize {
        self.regions.len()
    }

    /// Whether there are long reflex edges to cut at.
    pub(super) fn has_ledges(&self) -> bool {
        let first = |region: &Region| ledges(&self.pieces(&region.pieces)).first().map_or(0.0, |ledge| ledge.share);
        self.regions.iter().any(|region| first(region) > LEDGE_SHARE)
    }

    fn pieces(&self, nodes: &[usize]) -> Vec<&Piece> {
        nodes.iter().map(|&node| &self.nodes[node].piece).collect()
    }

    fn region(&self, pieces: Vec<usize>, hull: Hull, blind: usize) -> Region {
        let all = self.pieces(&pieces);
        let closed = all.iter().all(|piece| piece.is_closed());
        let own = closed.then(|| all.iter().map(|piece| piece.signed_volume()).sum::<f64>().abs());
        Region { pieces, hull, own, blind, plan: None }
    }

    /// Makes one more cut; returns whether there was one worth it. No more than `most` regions,
    /// those that waste most, are looked at.
    pub(super) fn divide(&mut self, most: usize, step: Step<'_>) -> Result<bool, FitError> {
        let mut wasteful: Vec<usize> = (0..self.regions.len()).collect();
        wasteful.sort_by(|&a, &b| self.regions[b].waste().total_cmp(&self.regions[a].waste()).then(a.cmp(&b)));
        for index in wasteful.into_iter().take(most) {
            if self.regions[index].plan.is_none() {
                step(self.regions.len())?;
                self.regions[index].plan = Some(self.plan(&self.regions[index], step)?);
            }
        }
        // By what is gained; where nothing is, by what is wasted.
        let rank = |region: &Region| match region.plan {
            Some(Plan::Cut { merit, .. }) if self.style == Style::ByGain && merit > WORTHWHILE_GAIN * self.whole => {
                Some((1, merit))
            }
            Some(Plan::Cut { .. }) => Some((0, region.waste())),
            _ => None,
        };
        let ranked = self.regions.iter().enumerate().filter_map(|(index, region)| Some((rank(region)?, index)));
        let best = ranked.max_by(|(a, i), (b, j)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(j.cmp(i)));
        let Some((_, index)) = best else { return Ok(false) };
        let Some(Plan::Cut { normal, height, gain, .. }) = self.regions[index].plan else { return Ok(false) };
        self.cut(index, normal, height, gain);
        Ok(true)
    }

    /// Cuts a region.
    fn cut(&mut self, index: usize, normal: Vector3<f64>, height: f64, gain: f64) {
        let mut sides = [Vec::new(), Vec::new()];
        for node in std::mem::take(&mut self.regions[index].pieces) {
            match self.nodes[node].piece.side(&normal, height) {
                Some(above) => sides[above].push(node),
                None => {
                    let children = self.nodes[node].piece.cut_with(&normal, height, Caps::Sections).map(|piece| {
                        self.nodes.push(Node { piece, cut: None });
                        self.nodes.len() - 1
                    });
                    self.nodes[node].cut = Some((normal, height, children));
                    // What was cut is not needed any more.
                    self.nodes[node].piece = Piece::default();
                    self.order.push(node);
                    sides.iter_mut().zip(children).for_each(|(side, child)| side.push(child));
                }
            }
        }
        let blind = if gain > WORTHWHILE_GAIN * self.whole { 0 } else { self.regions[index].blind + 1 };
        let [below, above] = sides.map(|pieces| {
            let hull = Hull::of(corners(&self.pieces(&pieces)));
            self.region(pieces, hull, blind)
        });
        self.regions[index] = below;
        self.regions.push(above);
    }

    /// The best cut of a region.
    fn plan(&self, region: &Region, step: Step<'_>) -> Result<Plan, FitError> {
        let Some(whole) = region.hull.volume else { return Ok(Plan::Nothing) };
        if region.waste() < CONVEX_EXCESS * self.whole {
            return Ok(Plan::Nothing);
        }
        let pieces = self.pieces(&region.pieces);
        let mut ledges = ledges(&pieces);
        ledges.truncate(LEDGES);
        let halves = |normal: Vector3<f64>, height: f64| halves(&pieces, whole, normal, height);
        let worth = WORTHWHILE_GAIN * self.whole;
        if self.style == Style::ByLedges && !ledges.is_empty() {
            let merit = |ledge: &Ledge, gain: f64| ledge.share + gain.max(0.0) / region.waste().max(worth);
            let measured = ledges
                .iter()
                .filter_map(|ledge| Some((ledge, halves(ledge.normal, ledge.height)?)))
                .map(|(ledge, Halves { normal, height, gain, .. })| (merit(ledge, gain), normal, height, gain));
            let best = measured.max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, normal, height, gain)) = best {
                return Ok(Plan::Cut { normal, height, gain, merit: gain });
            }
        }
        let samples = samples(&pieces);
        let mut promises = Scan::FULL.promises(&samples, whole);
        promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        promises.truncate(FINALISTS);
        let planes = promises.iter().map(|promise| (promise.normal, promise.height));
        let planes = planes.chain(ledges.iter().map(|ledge| (ledge.normal, ledge.height)));
        let measured = planes.filter_map(|(normal, height)| halves(normal, height));
        let next = measured.max_by(|a, b| a.gain.total_cmp(&b.gain)).filter(|next| next.gain > worth);
        let next = next.map(|Halves { normal, height, gain, .. }| Plan::Cut { normal, height, gain, merit: gain });
        let gain = if let Some(Plan::Cut { gain, .. }) = next { gain } else { 0.0 };
        if gain > LOOK_AHEAD_SHARE * region.waste()
            || (next.is_some() && region.waste() < LOOK_AHEAD_SHARE * self.whole)
        {
            return Ok(next.unwrap_or(Plan::Nothing));
        }
        let most = if region.own.is_some() { BLIND_CLOSED } else { BLIND_OPEN };
        if region.blind >= most {
            return Ok(next.unwrap_or(Plan::Nothing));
        }
        let ahead = self.look_ahead(&samples, &ledges, &halves, step)?;
        Ok(match (next, ahead) {
            (Some(next), Plan::Cut { merit, .. }) if merit <= gain => next,
            (Some(next), Plan::Nothing) => next,
            (_, ahead) => ahead,
        })
    }

    /// Where no cut gains: the plane after which the next cut of either side promises most.
    fn look_ahead(
        &self,
        samples: &[Vector3<f64>],
        ledges: &[Ledge],
        halves: &dyn Fn(Vector3<f64>, f64) -> Option<Halves>,
        step: Step<'_>,
    ) -> Result<Plan, FitError> {
        let (_, axes, _) = principal_axes(samples);
        let normals = axes.column_iter().map(Into::into).chain((0..3).map(|i| Vector3::ith(i, 1.0)));
        let middles = normals.map(|normal: Vector3<f64>| {
            let along = samples.iter().map(|x| normal.dot(x));
            let (low, high) = along.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
            (normal, low + (high - low) / 2.0, high - low)
        });
        let middles: Vec<_> = middles.collect();
        let planes = middles.iter().map(|&(normal, height, _)| (normal, height));
        let mut best: Option<(f64, Halves)> = None;
        for (normal, height) in planes.chain(ledges.iter().map(|ledge| (ledge.normal, ledge.height))) {
            step(self.regions.len())?;
            let Some(halves) = halves(normal, height) else { continue };
            let ahead: f64 = halves.sides.iter().map(glance).sum();
            let gain = halves.gain + ahead;
            if best.as_ref().is_none_or(|(most, _)| gain > *most) {
                best = Some((gain, halves));
            }
        }
        let best = best.filter(|(gain, _)| *gain > WORTHWHILE_GAIN * self.whole);
        let ledge = || ledges.iter().find_map(|ledge| halves(ledge.normal, ledge.height));
        let across = || {
            let longest = middles.iter().max_by(|a, b| a.2.total_cmp(&b.2));
            longest.and_then(|&(normal, height, _)| halves(normal, height))
        };
        let chosen = best.or_else(|| Some((0.0, ledge().or_else(across)?)));
        let plan = |(all, Halves { normal, height, gain, .. })| Plan::Cut { normal, height, gain, merit: all / AHEAD };
        Ok(chosen.map_or(Plan::Nothing, plan))
    }

    /// Partitions of the object into parts, each a set of regions: see [`Nested`].
    pub(super) fn nested(&self, step: Step<'_>) -> Result<Nested, FitError> {
        let hulls: Vec<Hull> = self.regions.iter().map(|region| region.hull.clone()).collect();
        let all = total(&hulls);
        Ok(Nested { total: all, mergers: merge(hulls, f64::INFINITY, step)? })
    }

    /// The division of the mesh into this many parts.
    pub(super) fn division(&self, nested: &Nested, parts: usize) -> Division {
        if parts == 1 {
            return Division::default();
        }
        let mut held = vec![usize::MAX; self.nodes.len()];
        for (part, regions) in nested.parts(self.regions.len(), parts).into_iter().enumerate() {
            for node in regions.into_iter().flat_map(|region| &self.regions[region].pieces) {
                held[*node] = part;
            }
        }
        // Cuts are left out where both sides are held by one part; children have higher numbers
        // than what they are of.
        for node in (0..self.nodes.len()).rev() {
            if let Some((_, _, [below, above])) = self.nodes[node].cut
                && held[below] == held[above]
            {
                held[node] = held[below];
            }
        }
        let mut numbers = vec![usize::MAX; self.nodes.len()];
        let mut pieces: Vec<usize> = (0..self.roots).collect();
        pieces.iter().for_each(|&root| numbers[root] = root);
        let mut cuts = Vec::new();
        for &node in &self.order {
            if let (Some((normal, height, [below, above])), usize::MAX) = (self.nodes[node].cut, held[node]) {
                cuts.push(Cut { part: numbers[node], normal: normal.into(), height_m: height });
                numbers[below] = numbers[node];
                numbers[above] = pieces.len();
                pieces[numbers[node]] = below;
                pieces.push(above);
            }
        }
        // Parts are numbered in the order of their first pieces.
        let mut known = Vec::new();
        let mut number = |piece: usize| {
            known.iter().position(|&part| part == held[piece]).unwrap_or_else(|| {
                known.push(held[piece]);
                known.len() - 1
            })
        };
        let parts: Vec<usize> = pieces.into_iter().map(&mut number).collect();
        let same = parts.iter().enumerate().all(|(piece, &part)| piece == part);
        Division { separated: true, cuts, parts: if same { Vec::new() } else { parts } }
    }
}

impl Region {
    /// What its hull has and it does not: all of an open one.
    fn waste(&self) -> f64 {
        self.hull.volume.unwrap_or(0.0) - self.own.unwrap_or(0.0)
    }
}

/// A sequence of partitions of regions into parts, each in the next coarser one.
pub(super) struct Nested {
    /// Total volume of the hulls of all regions.
    total: f64,
    mergers: Vec<Merger>,
}

impl Nested {
    /// Total volumes of the hulls of 1, 2, 3 ... parts, up to all regions.
    pub(super) fn totals(&self) -> Vec<f64> {
        let mut totals: Vec<f64> = [self.total].into_iter().chain(self.mergers.iter().map(|m| m.total)).collect();
        totals.reverse();
        totals
    }

    /// The regions of each of this many parts.
    fn parts(&self, regions: usize, parts: usize) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = (0..regions).map(|region| vec![region]).collect();
        for Merger { pair, .. } in self.mergers.iter().take(regions.saturating_sub(parts)) {
            let joint = pair.map(|part| std::mem::take(&mut groups[part])).concat();
            groups.push(joint);
        }
        groups.retain(|group| !group.is_empty());
        groups
    }
}

fn corners(pieces: &[&Piece]) -> Vec<Vector3<f64>> {
    pieces.iter().flat_map(|piece| piece.spots()).map(|spot| spot.x).collect()
}

/// What a plane makes of pieces whose hull has this volume; none if a side is nothing or too thin.
fn halves(pieces: &[&Piece], whole: f64, normal: Vector3<f64>, height: f64) -> Option<Halves> {
    let mut sides = [Vec::new(), Vec::new()];
    for &piece in pieces {
        match piece.side(&normal, height) {
            Some(above) => sides[above].push(piece.clone()),
            // Caps have no spots of their own.
            None => {
                let cut = piece.cut_with(&normal, height, Caps::Missing);
                sides.iter_mut().zip(cut).for_each(|(side, half)| side.push(half));
            }
        }
    }
    let sides = sides.map(|pieces| Side { hull: Hull::of(corners(&pieces.iter().collect::<Vec<_>>())), pieces });
    let volumes = [sides[0].hull.volume?, sides[1].hull.volume?];
    let thin = volumes.iter().any(|&volume| volume < LEAST_SHARE * whole);
    (!thin).then_some(Halves { normal, height, gain: whole - volumes[0] - volumes[1], sides })
}

/// What a good cut of a side gains: the best of those that promise most at a glance.
fn glance(side: &Side) -> f64 {
    let Some(volume) = side.hull.volume else { return 0.0 };
    let pieces: Vec<&Piece> = side.pieces.iter().collect();
    let mut promises = Scan::GLANCE.promises(&samples(&pieces), volume);
    promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    promises.truncate(GLANCES);
    let measured = promises.iter().filter_map(|promise| halves(&pieces, volume, promise.normal, promise.height));
    measured.map(|halves| halves.gain).fold(0.0, f64::max)
}
