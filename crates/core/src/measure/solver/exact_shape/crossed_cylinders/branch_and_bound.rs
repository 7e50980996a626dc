//! That two cylinders overlap nowhere by less than along the best candidate: by branch and bound
//! over spherical triangles that no circle across an axis passes through.
//!
//! f is symmetric but for t: of a direction, its opposite and their mirror images, the one that
//! points up and along the horizontal part of t overlaps least. No others are looked at.

use super::candidates::{Candidates, Place};
use super::pair::CrossedCylinders;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Most triangles that are looked at; half of all pairs take fewer than 40.
///
/// Fewer, more pairs whose overlap is nearly the same along an arc are left to the general search;
/// more, what comes to nothing takes longer than that.
const MOST_TRIANGLES: u32 = 2048;

/// Most triangles that wait: each halving leaves one. Where there were more, the pair is left to the
/// general search.
const MOST_WAITING: usize = 64;

/// Unit vectors along the edges of a cone of directions.
type Triangle = [Vector3<f64>; 3];

/// Triangles that are not yet looked at.
struct Waiting {
    all: [Triangle; MOST_WAITING],
    count: usize,
}

impl Waiting {
    fn push(&mut self, triangle: Triangle) -> Option<()> {
        *self.all.get_mut(self.count)? = triangle;
        self.count += 1;
        Some(())
    }

    fn pop(&mut self) -> Option<Triangle> {
        self.count = self.count.checked_sub(1)?;
        Some(self.all[self.count])
    }
}

impl CrossedCylinders {
    /// A lower bound of the overlap along all directions, metres: that of the best candidate but
    /// for rounding; none where that is not proven, and once a direction is known along which the
    /// cylinders are apart. Candidates that are found on the way are added.
    pub(super) fn branch_and_bound(&self, candidates: &mut Candidates) -> Option<f64> {
        let mut waiting = self.all_directions()?;
        let (mut lower, mut least) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..MOST_TRIANGLES {
            let known = candidates.best().direction.overlap.min(least);
            if known + self.error < 0.0 {
                return None;
            }
            let limit = known - self.error;
            let Some(triangle) = waiting.pop() else { return Some(lower) };
            if self.is_symmetric_to_less(&triangle) {
                continue;
            }
            let [a, b, c] = triangle;
            let direction = self.along((a + b + c).normalize());
            let along = |m: &Vector3<f64>| triangle.iter().map(|n| n.dot(m)).fold(f64::INFINITY, f64::min);
            // Components along arcs are concave where they are positive: least at corners.
            let component = along(&direction.point);
            let bound = if component >= limit.max(0.0) {
                component
            } else {
                let cosine = along(&direction.n) - gamma(16);
                self.bound(&direction, [cosine, ((1.0 - cosine) * (1.0 + cosine)).sqrt()])
            };
            if bound >= limit {
                lower = lower.min(bound);
                continue;
            }
            if direction.overlap < limit {
                least = direction.overlap;
                if direction.overlap + self.error < 0.0 {
                    // Whatever kind of place it is, they are apart.
                    candidates.push(self, direction, Place::Rims);
                } else if let Some(rims) = self.newton(direction) {
                    candidates.push(self, rims, Place::Rims);
                }
            }
            if let Some(bound) = candidates.bound_within_cap(self, &triangle) {
                lower = lower.min(bound);
                continue;
            }
            let [first, last] = halves(triangle, &direction.gradient);
            waiting.push(last)?;
            waiting.push(first)?;
        }
        None
    }

    /// The upper hemisphere, cut by the circles across the axes and the plane of both.
    fn all_directions(&self) -> Option<Waiting> {
        let mut waiting = Waiting { all: [[Vector3::zeros(); 3]; MOST_WAITING], count: 0 };
        let [first, second] = self.axes;
        let [across_first, across_second] = [Vector3::y(), Vector3::new(-second.y, second.x, 0.0)];
        let ring = [first, second, across_first, across_second, -first];
        for ends in ring.windows(2) {
            waiting.push([Vector3::z(), ends[0], ends[1]])?;
            waiting.push([Vector3::z(), -ends[0], -ends[1]])?;
        }
        Some(waiting)
    }

    /// Whether what is symmetric to them overlaps by less, of all directions in a triangle.
    fn is_symmetric_to_less(&self, triangle: &Triangle) -> bool {
        let level = triangle.map(|n| n.x * self.between.x + n.y * self.between.y);
        level.iter().all(|t| *t <= 0.0) && level.iter().any(|t| *t < 0.0)
    }
}

/// Both halves of a triangle across its longest side; the one that f falls towards first.
fn halves([a, b, c]: Triangle, gradient: &Vector3<f64>) -> [Triangle; 2] {
    let (ab, bc, ca) = (a.dot(&b), b.dot(&c), c.dot(&a));
    let (a, b, c) = if ab <= bc.min(ca) {
        (a, b, c)
    } else if bc <= ca {
        (b, c, a)
    } else {
        (c, a, b)
    };
    let (first, last) = if gradient.dot(&a) < gradient.dot(&b) { (a, b) } else { (b, a) };
    let middle = (a + b).normalize();
    [[first, middle, c], [middle, last, c]]
}
