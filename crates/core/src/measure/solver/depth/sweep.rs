//! The proof of a penetration depth: bounds over all directions of translations that take bodies
//! apart.
//!
//! For a unit vector n let `f(n) = h_A(-n) + h_B(n)`, h the support functions: how far A has to
//! move along n (or B along -n) until a plane across n parts them. f is the support function of the
//! difference `B - A`, which contains 0 if and only if the bodies meet, and the depth is the least
//! of f over all n: any n bounds it from above, but a bound from below has to cover the sphere
//! ([`sphere_branch_and_bound`]). Triangles of directions are split, those of the lowest bound
//! first, until none is left below the best depth known by more than the accuracy asked for. Near a
//! minimum that f leaves quadratically as many triangles are split at each size; where many
//! directions are equally good, as for concentric balls, all of them are.

use super::direction_sampling::Scout;
use super::local_search::{Best, ELSEWHERE, tolerance};
use super::sphere_branch_and_bound::{Cell, Covering, Direction};
use crate::measure::bounds::duality_bounds::DUALITY_ROUNDING;
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::options::Options;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::support_point::{Farthest, Sought, SupportPoint, support_of_a, support_of_b};
use crate::polynomial::{MAX_LANES, dispatch};
use nalgebra::Vector3;

/// What is known of all directions.
pub(in crate::measure) struct Proof {
    /// Lower bound of the depth, query units.
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) tied: bool,
    pub(in crate::measure) directions: u32,
}

/// Bounds the depth from below, improving the best direction on the way.
pub(in crate::measure) fn prove(best: &mut Best<'_>) -> Proof {
    if runs(Stage::DirectionSampling) {
        let (n, depth) = dispatch(Scout { pair: best.pair });
        if !(best.depth <= depth) {
            best.seek(Some(&n));
        }
    }
    // With a table of directions that costs little to lay out and serves nearly all pairs, then
    // with one for ties.
    match sweep::<FEW>(best) {
        (proof, true) if !best.options.exhausted(best.iterations) => {
            let (more, _) = sweep::<MANY>(best);
            Proof { lower: more.lower.max(proof.lower), directions: more.directions + proof.directions, ..more }
        }
        (proof, _) => proof,
    }
}

/// Directions in the smaller table and in the larger one, which drops those that it no longer needs
/// when it is full.
///
/// More, a proof lays out more memory; fewer, the larger table is needed more often, and ties of
/// directions that were dropped are missed.
const FEW: usize = 128;
const MANY: usize = 2048;

/// How many times triangles are split, as many as there are lanes, in one iteration.
const GROUPS: usize = 8;

/// Iterations that the larger table has to have room for: with less, triangles are closed one by
/// one.
///
/// More, triangles of low bounds are split later; fewer, closing one triangle may fill the table.
const RESERVE: usize = 4;

/// Sweeps the sphere of directions until the bracket is narrow; also says whether the table was
/// full first.
#[inline(never)]
fn sweep<const N: usize>(best: &mut Best<'_>) -> (Proof, bool) {
    let mut sweep = Sweep {
        pair: best.pair,
        options: best.options,
        covering: Covering::<N>::new(),
        floor: f64::INFINITY,
        error: 0.0,
        size: 0.0,
    };
    let full = sweep.run(best).is_none();
    let lower = sweep.lowest(best).min(sweep.floor);
    if best.depth > 0.0 && !best.settled {
        best.settle();
    }
    let lower = if sweep.covering.added() < 6 || best.depth <= 0.0 { 0.0 } else { lower.max(0.0) };
    let proof = Proof {
        lower: lower.min(best.depth.max(0.0)),
        tied: sweep.tied(best),
        directions: sweep.covering.added() as u32,
    };
    (proof, full)
}

/// A direction whose support points are wanted.
#[derive(Clone, Copy)]
struct Wanted {
    /// Unit vector, query frame.
    n: Vector3<f64>,
    /// The directions it lies between, in their order; none if it lies anywhere.
    between: Option<[u16; 2]>,
}

struct Sweep<'a, const N: usize> {
    pair: &'a Pair<'a>,
    options: &'a Options<'a>,
    covering: Covering<N>,
    /// Lowest bound of the triangles that were left as they are.
    floor: f64,
    /// Largest error of a known point of B - A.
    error: f64,
    /// Bound of |w| over B - A: how fast f can change.
    size: f64,
}

/// Where to look for the support point along n between two others.
fn between_points(body: &Posed<'_>, p: &SupportPoint, q: &SupportPoint, n: &Vector3<f64>) -> SupportPoint {
    let farther = if n.dot(&p.x) > n.dot(&q.x) { *p } else { *q };
    // Between near points of one smooth surface it has the right normal, and is inside by little.
    let smooth = body.len() == 1 && (p.x - q.x).norm() < 0.4;
    if smooth { SupportPoint { x: (p.x + q.x) * 0.5, ..*p } } else { farther }
}

impl<const N: usize> Sweep<'_, N> {
    /// None if the table is full before the bracket is narrow.
    fn run(&mut self, best: &mut Best<'_>) -> Option<()> {
        let origin = Vector3::zeros();
        self.size = self.pair.a.reach(&origin) + self.pair.b.reach(&origin);
        // The octahedron: a box's own axes are among its corners.
        let mut axes = [Wanted { n: origin, between: None }; 6];
        for (k, axis) in axes.iter_mut().enumerate() {
            axis.n[k % 3] = if k < 3 { 1.0 } else { -1.0 };
        }
        for direction in self.directions(&axes, best)?.into_iter().flatten() {
            self.covering.add(direction);
        }
        self.improve(0, best);
        for k in 0..8 {
            let sign = |axis: u16| if k >> axis & 1 == 0 { axis } else { axis + 3 };
            self.open([sign(0), sign(1), sign(2)], best);
        }
        loop {
            if N == MANY && !self.covering.has_room(GROUPS * MAX_LANES) {
                self.covering.compact(self.shallowest(best));
            }
            // Those of the lowest bounds would all stay open at once.
            let is_short = N == MANY && !self.covering.has_room(RESERVE * GROUPS * MAX_LANES);
            let before = self.covering.directions().len();
            for _ in 0..GROUPS {
                if best.depth <= 0.0 || self.covering.is_closed() {
                    return Some(());
                }
                if !self.covering.has_room(MAX_LANES) {
                    return None;
                }
                if !self.split(best, is_short) {
                    return Some(());
                }
            }
            best.iterations += 1;
            let depth = best.depth;
            self.improve(before, best);
            if best.depth < depth {
                self.close(best);
            }
            if self.options.exhausted(best.iterations) {
                return Some(());
            }
        }
    }

    /// The lowest bound of the triangles that are left to split: until now these were only found
    /// not to be good enough.
    fn lowest(&self, best: &Best<'_>) -> f64 {
        let target = self.target(best);
        let error = self.error + 4.0 * DUALITY_ROUNDING * self.size;
        let bound = |cell: Cell| {
            let shares = (0..10).map(|k| 1.0 - 1e-3 * f64::from(1 << k));
            let mut bounds = shares.filter_map(|share| self.covering.bound(cell.corners, share * target + error).ok());
            bounds.next().map_or(0.0, |bound| bound - error)
        };
        self.covering.cells().map(bound).fold(f64::INFINITY, f64::min)
    }

    /// Triangles at or above this bound are good enough.
    fn target(&self, best: &Best<'_>) -> f64 {
        best.depth - tolerance(self.pair, self.options, best.depth)
    }

    /// Support points along each n and against it; none if one of them cannot be found.
    fn directions(&mut self, wanted: &[Wanted], best: &Best<'_>) -> Option<[Option<Direction>; MAX_LANES]> {
        let pair = self.pair;
        let mut sought = [[Sought::default(); MAX_LANES]; 2];
        let mut tolerated = [0.0; MAX_LANES];
        for (k, want) in wanted.iter().enumerate() {
            tolerated[k] = self.tolerated(want, best);
            let tolerance = tolerated[k] * pair.unit();
            sought[0][k] = Sought { n: -want.n, tolerance };
            sought[1][k] = Sought { n: pair.direction_to_b(&want.n), tolerance };
        }
        let (mut of_a, mut of_b) = ([None; MAX_LANES], [None; MAX_LANES]);
        if runs(Stage::SupportLanes) {
            of_a = dispatch(Farthest { body: pair.a.body, sought: &sought[0][..wanted.len()] });
            of_b = dispatch(Farthest { body: pair.b.body, sought: &sought[1][..wanted.len()] });
        }
        let mut found = [None; MAX_LANES];
        for (k, want) in wanted.iter().enumerate() {
            found[k] = Some(self.direction(want, tolerated[k], [of_a[k], of_b[k]])?);
        }
        Some(found)
    }

    /// Largest support deficit along n, query units: far above the best depth a rough bound
    /// will do.
    fn tolerated(&self, Wanted { n, between }: &Wanted, best: &Best<'_>) -> f64 {
        let known = if best.depth.is_finite() { best.depth.abs() } else { self.size };
        let depth = |end: u16| n.dot(&self.covering.directions()[usize::from(end)].w());
        let surplus = between.map_or(0.0, |ends| ends.into_iter().map(depth).fold(0.0, f64::max) - known);
        (0.1 * tolerance(self.pair, self.options, known)).max(0.02 * surplus)
    }

    /// The direction with its support points, which are sought in another way where they were not
    /// found.
    fn direction(
        &mut self,
        &Wanted { n, between }: &Wanted,
        tolerance: f64,
        [of_a, of_b]: [Option<(Vector3<f64>, usize)>; 2],
    ) -> Option<Direction> {
        let pair = self.pair;
        let ends = between.map(|ends| ends.map(|i| self.covering.directions()[usize::from(i)]));
        let (a, b) = (&pair.a, &pair.b);
        let to_a = |x: &Vector3<f64>| pair.a_to_query(&(x + a.body.normalization().center));
        let to_b = |y: &Vector3<f64>| pair.b_to_query(&(y + b.body.normalization().center));
        let a = match of_a {
            Some((x, active)) => SupportPoint { x: to_a(&x), active: 1 << active },
            None => {
                let start = ends.map(|[p, q]| between_points(a, &p.a, &q.a, &-n));
                support_of_a(pair, &-n, tolerance, start)?
            }
        };
        let b = match of_b {
            Some((y, active)) => SupportPoint { x: to_b(&y), active: 1 << active },
            None => {
                let start = ends.map(|[p, q]| between_points(b, &p.b, &q.b, &n));
                support_of_b(pair, &n, tolerance, start)?
            }
        };
        self.error = self.error.max(pair.a.displacement(&a.x) + pair.b.displacement(&b.x));
        Some(Direction { n, a, b, parents: between.unwrap_or_default() })
    }

    /// Tries the best of the directions from `first` on, if it promises to be better than the best
    /// known.
    fn improve(&mut self, first: usize, best: &mut Best<'_>) {
        let directions = &self.covering.directions()[first..];
        let Some(least) = directions.iter().min_by(|p, q| p.depth().total_cmp(&q.depth())) else { return };
        let promising = best.depth - 0.5 * best.tolerance();
        if !(least.depth() < promising) && best.depth.is_finite() {
            return;
        }
        let smooth = self.pair.smooth();
        if !(smooth && best.seek(Some(&least.n)) && best.depth <= least.depth()) {
            best.offer(&least.a, &least.b, &least.n);
        }
    }

    /// Bounds a triangle, and keeps it for later if that is not enough.
    fn open(&mut self, corners: [u16; 3], best: &Best<'_>) {
        // Middles are rounded, so neighbours of different size leave slivers open; f changes by
        // little over one. The sums of the bound itself round too.
        let (target, error) = (self.target(best), self.error + 4.0 * DUALITY_ROUNDING * self.size);
        match self.covering.bound(corners, target + error) {
            Ok(bound) => self.floor = self.floor.min(bound - error),
            Err(guess) => self.covering.push(Cell { corners, guess }),
        }
    }

    /// Drops the triangles that are good enough for a better depth.
    fn close(&mut self, best: &Best<'_>) {
        let (target, error) = (self.target(best), self.error + 4.0 * DUALITY_ROUNDING * self.size);
        let floor = &mut self.floor;
        self.covering.close(|covering, cell| match covering.bound(cell.corners, target + error) {
            Ok(bound) => {
                *floor = floor.min(bound - error);
                true
            }
            Err(_) => false,
        });
    }

    /// Splits the lowest triangles, or those opened late, as many as their support points are found
    /// together, the same on every machine; false if that cannot be done, all staying as it is.
    fn split(&mut self, best: &Best<'_>, are_late: bool) -> bool {
        // Each with the middle of its widest edge if that is known, else where it is wanted.
        let (mut cells, mut count) = ([None; MAX_LANES], 0);
        let (mut wanted, mut missing) = ([Wanted { n: Vector3::zeros(), between: None }; MAX_LANES], 0);
        while count < MAX_LANES
            && let Some(cell) = if are_late { self.covering.pop_late() } else { self.covering.pop() }
        {
            let ([i, j, k], n) = self.covering.widest_edge(cell.corners);
            let between = Some([i.min(j), i.max(j)]);
            let shared = wanted[..missing].iter().position(|other| other.between == between);
            let middle = match (self.covering.middle(i, j), shared) {
                (Some(known), _) => Ok(known),
                (None, Some(shared)) => Err(shared),
                (None, None) => {
                    wanted[missing] = Wanted { n, between };
                    missing += 1;
                    Err(missing - 1)
                }
            };
            cells[count] = Some((cell, [i, j, k], middle));
            count += 1;
        }
        let found = if missing > 0 { self.directions(&wanted[..missing], best) } else { Some([None; MAX_LANES]) };
        let Some(found) = found else {
            cells.into_iter().flatten().for_each(|(cell, ..)| self.covering.push(cell));
            return false;
        };
        let added = found.map(|direction| direction.map_or(0, |direction| self.covering.add_middle(direction)));
        for (_, [i, j, k], middle) in cells.into_iter().flatten() {
            let middle = middle.unwrap_or_else(|wanted| added[wanted]);
            self.open([i, middle, k], best);
            self.open([middle, j, k], best);
        }
        true
    }

    /// Along which direction the bodies are least deep: of all, and of those far from the best.
    fn shallowest(&self, best: &Best<'_>) -> [Option<usize>; 2] {
        let directions = self.covering.directions();
        let least = |far: &dyn Fn(&Direction) -> bool| {
            let others = (0..directions.len()).filter(|&i| far(&directions[i]));
            others.min_by(|&i, &j| directions[i].depth().total_cmp(&directions[j].depth()))
        };
        let is_far = |direction: &Direction| best.n.is_some_and(|n| direction.n.dot(&n) < ELSEWHERE);
        [least(&|_| true), least(&is_far)]
    }

    /// Whether a direction far from the best is about as good, or one near it may be better.
    fn tied(&mut self, best: &Best<'_>) -> bool {
        let Some(n) = best.n.filter(|_| best.depth > 0.0) else { return false };
        if !best.settled {
            return true;
        }
        let close = best.depth + 2.0 * best.tolerance();
        let elsewhere = |n_other: &Vector3<f64>| n_other.dot(&n) < ELSEWHERE;
        // Symmetric bodies have the mirror image of the best, which may lie between all directions
        // known.
        let opposite = self.directions(&[Wanted { n: -n, between: None }], best).and_then(|[opposite, ..]| opposite);
        let others = self.covering.directions().iter().filter(|direction| elsewhere(&direction.n));
        let Some(least) = others.chain(&opposite).min_by(|p, q| p.depth().total_cmp(&q.depth())) else { return false };
        if least.depth() <= close {
            return true;
        }
        if least.depth() > WORTH_A_LOOK * best.depth {
            return false;
        }
        // From there descent may lead to another minimum.
        let mut other = best.again();
        if !other.seek(Some(&least.n)) {
            other.offer(&least.a, &least.b, &least.n);
        }
        other.depth <= close && other.n.is_some_and(|n| elsewhere(&n))
    }
}

/// Depth of a direction elsewhere, relative to the best, up to which a search from it may find one
/// as good; dimensionless.
///
/// A larger value searches in vain, a smaller one misses ties. Exercised by
/// `ties_are_flagged_and_limits_admitted`.
const WORTH_A_LOOK: f64 = 1.1;
