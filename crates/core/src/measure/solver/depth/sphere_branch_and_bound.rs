//! A covering of the sphere of directions by triangles, each with a proven lower bound of a support
//! function on it.
//!
//! The support function of a convex body K is `h(n) = max n·w` over K: every point w known to lie
//! in K bounds it from below by `n·w`. On a cone of directions spanned by vectors v_j the bound is
//! least at one of them: for unit `n = Σ a_j v_j`, a_j >= 0, and `v_j·w >= r |v_j|` with r >= 0,
//!
//! ```text
//! n·w = Σ a_j v_j·w >= r Σ a_j |v_j| >= r |n| = r.
//! ```
//!
//! The w are arbitrary, and so is where a cone is cut: better choices only give better bounds. A
//! triangle with corners n_i whose support points w_i are known is cut into three parts, one for
//! each w_i, that meet where two or three of the bounds are equal; for a smooth body what they lose
//! decreases with the square of the triangle's size.
//!
//! A triangle is split at the edge over which the support point turns most, where the bounds of its
//! ends are equal. So triangles become narrow across the great circles where a flat face or a long
//! edge makes the support point jump, and stay long along them.

use crate::measure::solver::support_point::SupportPoint;
use nalgebra::{Matrix3, Vector3};

/// A direction with the support points of A along -n and of B along n.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Direction {
    pub(super) n: Vector3<f64>,
    pub(super) a: SupportPoint,
    pub(super) b: SupportPoint,
    /// The ends of the edge whose middle this is.
    pub(super) parents: [u16; 2],
}

impl Direction {
    /// The known point `y - x` of B - A.
    pub(super) fn w(&self) -> Vector3<f64> {
        self.b.x - self.a.x
    }

    /// What it shows of the depth along n.
    pub(super) fn depth(&self) -> f64 {
        self.n.dot(&self.w())
    }
}

/// A triangle of directions that is not proven to be good enough.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cell {
    pub(super) corners: [u16; 3],
    /// At most about this is the bound.
    pub(super) guess: f64,
}

/// At most N directions and 2 N triangles, those with the lowest bounds first, on the stack.
pub(super) struct Covering<const N: usize> {
    directions: [Direction; N],
    len: usize,
    /// How many directions were dropped.
    dropped: usize,
    /// A heap in two halves.
    cells: [[Cell; N]; 2],
    open: usize,
    /// Middles of edges by a hash of their ends; 0 for none.
    middles: [[u16; N]; 2],
}

impl<const N: usize> Covering<N> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        let (blank, cell) = (Direction::default(), Cell::default());
        Self { directions: [blank; N], len: 0, dropped: 0, cells: [[cell; N]; 2], open: 0, middles: [[0; N]; 2] }
    }

    pub(super) fn directions(&self) -> &[Direction] {
        &self.directions[..self.len]
    }

    /// How many directions were added.
    pub(super) fn added(&self) -> usize {
        self.len + self.dropped
    }

    /// Drops the directions that are no corner of an open triangle, but for the first one and
    /// `kept`.
    pub(super) fn compact(&mut self, kept: [Option<usize>; 2]) {
        // Where a direction is from now on; 0 for nowhere, where it is not the first.
        let mut place = [0; N];
        for corner in (0..self.open).flat_map(|i| self.cell(i).corners) {
            place[usize::from(corner)] = u16::MAX;
        }
        let len = self.len;
        let stays = |i: usize, place: u16| i == 0 || place != 0 || kept.contains(&Some(i));
        (self.len, self.middles) = (0, [[0; N]; 2]);
        for i in 0..len {
            if !stays(i, place[i]) {
                continue;
            }
            place[i] = self.len as u16;
            // The ends of an edge come before its middle. What has lost one is the middle of none.
            let mut direction = self.directions[i];
            let is_lost = |end: u16| end != 0 && place[usize::from(end)] == 0;
            let is_middle = direction.parents != [0; 2] && !direction.parents.into_iter().any(is_lost);
            direction.parents = if is_middle { direction.parents.map(|end| place[usize::from(end)]) } else { [0; 2] };
            if is_middle {
                self.add_middle(direction);
            } else {
                self.add(direction);
            }
        }
        self.dropped += len - self.len;
        for i in 0..self.open {
            let cell = self.cell(i);
            self.set(i, Cell { corners: cell.corners.map(|corner| place[usize::from(corner)]), ..cell });
        }
    }

    /// Whether `splits` of the open triangles, or all if there are fewer, can be split.
    pub(super) fn has_room(&self, splits: usize) -> bool {
        let splits = splits.min(self.open);
        self.len + splits <= N && self.open + splits <= 2 * N
    }

    /// The corners of a triangle in an order that has the edge to be split first, and the direction
    /// to split it at: where the bounds of its ends are equal, but not too near either.
    pub(super) fn widest_edge(&self, [i, j, k]: [u16; 3]) -> ([u16; 3], Vector3<f64>) {
        let corners = [i, j, k].map(|i| &self.directions[usize::from(i)]);
        let (n, w) = (corners.map(|corner| corner.n), corners.map(Direction::w));
        let turn = |p: usize, q: usize| (w[p] - w[q]).dot(&(n[p] - n[q]));
        let edges = [([i, j, k], (0, 1)), ([j, k, i], (1, 2)), ([k, i, j], (2, 0))];
        let widest = edges.into_iter().max_by(|e, f| turn(e.1.0, e.1.1).total_cmp(&turn(f.1.0, f.1.1)));
        let (order, (p, q)) = widest.unwrap_or(edges[0]);
        let (alpha, beta) = ((w[q] - w[p]).dot(&n[q]), (w[p] - w[q]).dot(&n[p]));
        let share = if alpha >= 0.0 && beta >= 0.0 && alpha + beta > 0.0 { alpha / (alpha + beta) } else { 0.5 };
        let share = share.clamp(0.1, 0.9);
        (order, (n[p] * share + n[q] * (1.0 - share)).normalize())
    }

    /// For each corner a point of B - A: of those of A and of B known at the corners, which go
    /// together in any way, the farthest as seen from a little inside the triangle. At a corner
    /// where the support point jumps that is the one on this side.
    fn mixed(corners: [&Direction; 3]) -> [Vector3<f64>; 3] {
        let middle = (corners[0].n + corners[1].n + corners[2].n) * 0.01;
        corners.map(|own| {
            let inside = own.n + middle;
            let (mut a, mut b) = (own.a.x, own.b.x);
            for other in corners {
                if inside.dot(&(other.a.x - a)) < 0.0 {
                    a = other.a.x;
                }
                if inside.dot(&(other.b.x - b)) > 0.0 {
                    b = other.b.x;
                }
            }
            b - a
        })
    }

    pub(super) fn add(&mut self, direction: Direction) -> u16 {
        self.directions[self.len] = direction;
        self.len += 1;
        (self.len - 1) as u16
    }

    /// The middle of the edge between two directions, if it was added before.
    pub(super) fn middle(&self, i: u16, j: u16) -> Option<u16> {
        let found = self.middle_slot(i, j);
        let index = self.middles[found % 2][found / 2];
        (index != 0).then_some(index)
    }

    /// Adds the middle of an edge.
    pub(super) fn add_middle(&mut self, direction: Direction) -> u16 {
        let [i, j] = direction.parents;
        let slot = self.middle_slot(i, j);
        let index = self.add(direction);
        self.middles[slot % 2][slot / 2] = index;
        index
    }

    /// Where the middle of an edge is noted, or would be: the table is never more than half full.
    fn middle_slot(&self, i: u16, j: u16) -> usize {
        let ends = [i.min(j), i.max(j)];
        let mut slot = (usize::from(ends[0]) * 0x9E37 + usize::from(ends[1]) * 0x85EB) % (2 * N);
        loop {
            let index = self.middles[slot % 2][slot / 2];
            if index == 0 || self.directions[usize::from(index)].parents == ends {
                return slot;
            }
            slot = (slot + 1) % (2 * N);
        }
    }

    /// Lower bound of the support function on the triangle, but for rounding and the errors of the
    /// points, if it is found to be at least `enough`; else about what was found.
    pub(super) fn bound(&self, corners: [u16; 3], enough: f64) -> Result<f64, f64> {
        let corners = corners.map(|i| &self.directions[usize::from(i)]);
        let n = corners.map(|corner| corner.n);
        let own = corners.map(Direction::w);
        lower_bound(n, own, enough).or_else(|guess| {
            let mixed = Self::mixed(corners);
            if mixed == own { Err(guess) } else { lower_bound(n, mixed, enough).map_err(|other| guess.max(other)) }
        })
    }

    /// The open triangles.
    pub(super) fn cells(&self) -> impl Iterator<Item = Cell> {
        (0..self.open).map(|i| self.cell(i))
    }

    /// Whether no triangle is open.
    pub(super) fn is_closed(&self) -> bool {
        self.open == 0
    }

    /// Takes out all open triangles that are good enough now.
    pub(super) fn close(&mut self, mut good: impl FnMut(&Self, &Cell) -> bool) {
        let mut kept = 0;
        for i in 0..self.open {
            let cell = self.cell(i);
            if !good(self, &cell) {
                self.set(kept, cell);
                kept += 1;
            }
        }
        // Each is sifted up among those before it.
        self.open = 0;
        for i in 0..kept {
            self.push(self.cell(i));
        }
    }

    fn cell(&self, i: usize) -> Cell {
        self.cells[i % 2][i / 2]
    }

    fn set(&mut self, i: usize, cell: Cell) {
        self.cells[i % 2][i / 2] = cell;
    }

    pub(super) fn push(&mut self, cell: Cell) {
        let mut at = self.open;
        self.open += 1;
        while at > 0 && cell.guess < self.cell((at - 1) / 2).guess {
            self.set(at, self.cell((at - 1) / 2));
            at = (at - 1) / 2;
        }
        self.set(at, cell);
    }

    /// Takes out the last triangle of the heap, which mostly was opened late.
    pub(super) fn pop_late(&mut self) -> Option<Cell> {
        self.open = self.open.checked_sub(1)?;
        Some(self.cell(self.open))
    }

    /// Takes out the triangle with the lowest bound.
    pub(super) fn pop(&mut self) -> Option<Cell> {
        if self.open == 0 {
            return None;
        }
        let top = self.cell(0);
        self.open -= 1;
        let last = self.cell(self.open);
        let mut at = 0;
        loop {
            let mut child = 2 * at + 1;
            if child >= self.open {
                break;
            }
            if child + 1 < self.open && self.cell(child + 1).guess < self.cell(child).guess {
                child += 1;
            }
            if last.guess <= self.cell(child).guess {
                break;
            }
            self.set(at, self.cell(child));
            at = child;
        }
        self.set(at, last);
        Some(top)
    }
}

/// `min over unit n in the cone of the n_i of max_i n·w_i`, from below, if that is found to be at
/// least `enough`; else what it is at most, or about that.
fn lower_bound(n: [Vector3<f64>; 3], w: [Vector3<f64>; 3], enough: f64) -> Result<f64, f64> {
    // A negative r proves nothing.
    let enough = enough.max(f64::MIN_POSITIVE);
    // Row i: the bound by w_i at each corner.
    let g = Matrix3::from_fn(|i, j| w[i].dot(&n[j]));
    let mut lowest = g[(0, 0)].min(g[(1, 1)]).min(g[(2, 2)]);
    // Where on an edge the bounds of its two ends are equal.
    let mut edges = [(0.0, 0.0); 3];
    for (edge, (i, j)) in edges.iter_mut().zip(EDGES) {
        let (alpha, beta) = (g[(j, j)] - g[(i, j)], g[(i, i)] - g[(j, i)]);
        let (alpha, beta) = if alpha >= 0.0 && beta >= 0.0 && alpha + beta > 0.0 { (alpha, beta) } else { (1.0, 1.0) };
        let value = (alpha * g[(i, i)] + beta * g[(i, j)]).min(alpha * g[(j, i)] + beta * g[(j, j)]);
        lowest = lowest.min(value / (n[i] * alpha + n[j] * beta).norm());
        // Not `<`: a NaN bounds nothing.
        if !(lowest >= enough) {
            return Err(lowest);
        }
        *edge = (alpha, beta);
    }
    // Where all three are equal, or a point of the triangle near there: the first that will do.
    let meets = |a: Vector3<f64>| (g * a).min() / (n[0] * a[0] + n[1] * a[1] + n[2] * a[2]).norm();
    let row = |i: usize| g.row(i).transpose();
    let normal = (row(0) - row(1)).cross(&(row(0) - row(2)));
    let mut meeting = f64::NEG_INFINITY;
    let of_edge = |edge: usize| {
        let (mut a, (i, j)) = (Vector3::zeros(), EDGES[edge]);
        (a[i], a[j]) = edges[edge];
        a
    };
    for offer in 0..6 {
        let a = match offer {
            0 => normal.map(|a| a.max(0.0)),
            1 => normal.map(|a| (-a).max(0.0)),
            2 => Vector3::repeat(1.0),
            edge => of_edge(edge - 3),
        };
        // Not a number where there is no such point.
        meeting = meeting.max(meets(a));
        if meeting >= enough {
            break;
        }
    }
    if meeting >= enough { Ok(lowest.min(meeting)) } else { Err(lowest.min(meeting)) }
}

/// The edges of a triangle.
const EDGES: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn bounds_hold_on_the_whole_triangle_and_are_all_but_exact() {
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let axis = random.unit();
            let size = 10_f64.powf(-1.0 + random.signed());
            let n: [Vector3<f64>; 3] = std::array::from_fn(|_| (axis + random.unit() * size).normalize());
            // Support points of an ellipsoid, moved off its centre, or any points at all.
            let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
            let center = random.unit() * 0.2;
            let w: [Vector3<f64>; 3] = std::array::from_fn(|i| {
                let scaled = n[i].component_mul(&half);
                let support = center + scaled.component_mul(&half) / scaled.norm();
                if seed % 3 == 0 { random.unit() + axis } else { support }
            });
            let mut least = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (p, q) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let v = (n[0] * p + n[1] * q + n[2] * (1.0 - p - q)).normalize();
                    least = least.min(w.iter().map(|w| v.dot(w)).fold(f64::MIN, f64::max));
                }
            }
            // The bound is valid for every accuracy.
            for factor in [1e-9, 0.5, 0.9, 0.999, 1.0, 1.0 + 1e-12, 1.1] {
                let enough = factor * least.max(1e-3);
                if let Ok(bound) = lower_bound(n, w, enough) {
                    assert!(bound >= enough && bound <= least + 1e-14, "seed {seed}: {bound} above {least}");
                }
            }
            let close = least - 8.0 * size * size;
            if seed % 3 != 0 && size < 0.3 && close > 0.0 {
                assert!(lower_bound(n, w, close).is_ok(), "seed {seed}: {close} not found below {least}, size {size}");
            }
        }
    }

    #[test]
    fn compaction_keeps_open_triangles_and_the_middles_of_their_edges() {
        let mut random = Seeded(7);
        let mut covering = Covering::<64>::new();
        let mut direction = |parents: [u16; 2]| Direction { n: random.unit(), parents, ..Direction::default() };
        for _ in 0..6 {
            covering.add(direction([0; 2]));
        }
        // Of the middles of edges 1-2 and 3-4 the first one has a middle of its own, with corner 1.
        let middles = [[1, 2], [3, 4]].map(|ends| covering.add_middle(direction(ends)));
        let inner = covering.add_middle(direction([1, middles[0]]));
        covering.push(Cell { corners: [1, middles[0], inner], guess: 2.0 });
        covering.push(Cell { corners: [1, 5, inner], guess: 1.0 });
        let before = *covering.directions().first_chunk::<9>().unwrap();
        // Dropped: 2, 3 and the middle of 3-4. Kept beside all corners: the first one, and 4.
        covering.compact([Some(4), None]);
        let after: Vec<_> = covering.directions().iter().map(|direction| direction.n).collect();
        assert_eq!(after, [0, 1, 4, 5, 6, 8].map(|i: usize| before[i].n));
        assert_eq!(covering.added(), 9);
        let corners: Vec<_> = covering.cells().map(|cell| (cell.corners, cell.guess)).collect();
        assert_eq!(corners, [([1, 3, 5], 1.0), ([1, 4, 5], 2.0)]);
        // The edge 1-2 is gone, and its middle is the middle of none.
        assert_eq!(covering.middle(1, 4), Some(5));
        assert_eq!(covering.directions()[4].parents, [0; 2]);
        assert_eq!((covering.middle(2, 3), covering.middle(1, 3)), (None, None));
    }

    #[test]
    fn cells_come_out_lowest_first_and_middles_are_found_again() {
        let mut covering = Covering::<64>::new();
        let mut random = Seeded(3);
        for _ in 0..4 {
            covering.add(Direction::default());
        }
        for i in 0..100 {
            covering.push(Cell { corners: [i, 0, 0], guess: random.signed() });
        }
        let mut last = f64::MIN;
        for _ in 0..100 {
            assert!(!covering.is_closed());
            let cell = covering.pop().unwrap();
            assert!(cell.guess >= last);
            last = cell.guess;
        }
        assert!(covering.pop().is_none() && covering.is_closed());
        for i in 0..4 {
            for j in i + 1..4 {
                assert_eq!(covering.middle(j, i), None);
                let index = covering.add_middle(Direction { parents: [i, j], ..Direction::default() });
                assert_eq!((covering.middle(i, j), covering.middle(j, i)), (Some(index), Some(index)));
            }
        }
    }
}
