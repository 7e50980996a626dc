//! How far a body reaches beyond the convex hull of the points it contains.
//!
//! The gap is the one-sided Hausdorff distance, the largest distance of a point of the body from
//! the hull. It is bounded by a search over cells of rays from the interior point, which is 0 here
//! (branch and bound). A cell is the cone of three rays d_1, d_2, d_3. The constraints are convex,
//! so what is in the body lies under their tangent planes where the rays meet their surfaces,
//!
//! ```text
//! g(c) + ∇g(c)·(x - c) <= 1,   that is   a_k·x <= 1
//! ```
//!
//! after division by the (positive) rest. In the cone, at `x = r Σ w_i d_i` with `w_i >= 0` and `Σ
//! w_i = 1`, these say `1 / r >= max_k Σ w_i a_k·d_i`: the largest of some functions that are
//! linear in w. Where one of them is the largest is a polygon, and the cell's part of the body lies
//! in the hull of 0 and the points that the corners of these polygons stand for. The distance from
//! the hull is convex, so the largest at those points and at 0 is a bound. Across a smooth surface
//! it is off by the square of the cell's size; along edges, where constraints meet, it is exact.

use super::support::{farthest, height};
use nalgebra::Vector3;
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::PI;
use sublevel_core::body::{Body, Constraint, Sphere, boundary_radius, sphere_rule};
use sublevel_core::optimize::{Corner, gjk};

/// How much larger than the distance found the bound may be, as a part of it; dimensionless.
///
/// A user compares gaps with millimetres. A larger value makes ladders choose finer rungs than
/// needed; a smaller one takes more cells. Pinned by
/// `the_bound_holds_in_all_directions_and_is_close`.
const GAP_ACCURACY: f64 = 0.02;

/// Gap, relative to the size of the body, that is not resolved any further; dimensionless.
///
/// Cells near edges of a polytope shrink linearly: the search would take thousands of times as many
/// for each digit. A larger value leaves bounds of bodies that are close at that; a smaller one
/// uses up [`MAX_CELLS`]. Pinned by `the_coarsest_body_within_a_gap_is_on_the_lowest_rung_that_is`.
pub(super) const RESOLVED_GAP: f64 = 1e-5;

/// Most cells looked at; the bound is valid after fewer, too.
const MAX_CELLS: usize = 30_000;

/// Rings of the rule for the mean.
const MEAN_RINGS: usize = 24;

/// Distance at which a ray may meet the surface of one constraint, relative to that at which it
/// leaves the body; dimensionless.
///
/// Tangent planes there bound the body best, but rounding grows with the distance. A larger value
/// loosens the bound by rounding; a smaller one takes planes at points that are not on the surface.
/// The bound is proven for any value, and no test fixes it.
const MAX_CONSTRAINT_REACH: f64 = 100.0;

/// What rounding may add to a height or a distance, relative to the size of the body;
/// dimensionless.
///
/// Fewer than a thousand roundings of 1e-16 each lead to one of them. A smaller value would make
/// the bound unproven; a larger one lets gaps of close bodies be nothing but this allowance. Pinned
/// by `a_box_does_not_reach_beyond_its_corners`.
const GAP_ROUNDING: f64 = 1e-12;

/// How far a body reaches beyond a convex hull inside it, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Proven upper bound of the distance of any point of the body from the hull.
    pub most_m: f64,
    /// Largest distance found, of a point of the body as far as its computation allows; at most 2 %
    /// less than the bound, unless both are next to nothing or the body is so intricate that the
    /// search was cut short.
    pub found_m: f64,
    /// Unit vector from the hull to that point, body frame.
    pub direction: Vector3<f64>,
    /// Mean over all directions of how much farther the body reaches along them than the hull; by
    /// quadrature, which overlooks the narrow cones of directions in which flat corners stand out.
    pub mean_m: f64,
}

/// The gap between a body and the convex hull of points inside it, of which there is one at least,
/// metres of the body frame. Gaps below a 1e-5th of the body are not resolved: their bound is about
/// that.
pub fn gap(body: &Body, points: &[Vector3<f64>]) -> Gap {
    GapSearch::new(body, points).run()
}

/// A ray, everything seen from the interior point, metres.
struct Ray {
    /// Along the ray, of any length.
    d: Vector3<f64>,
    /// Normals a of tangent planes `a·x <= 1` near where it leaves the body.
    planes: Vec<Vector3<f64>>,
    /// Bound of the distance of where it leaves the body.
    most: f64,
}

/// A cone of three rays whose part of the body is at most so far from the hull.
struct Cell {
    rays: [usize; 3],
    most: f64,
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.most.total_cmp(&other.most)
    }
}

struct GapSearch<'a> {
    body: &'a Body,
    /// Points seen from the interior point.
    points: Vec<Vector3<f64>>,
    /// Bound of the distance of any point of the body from the interior point.
    size: f64,
    /// Bound of the distance of the interior point from the hull, in which it need not lie.
    center: f64,
    rays: Vec<Ray>,
    /// Rays between two others.
    middles: HashMap<(usize, usize), usize>,
    found: f64,
    direction: Vector3<f64>,
}

impl<'a> GapSearch<'a> {
    fn new(body: &'a Body, points: &[Vector3<f64>]) -> Self {
        let points: Vec<_> = points.iter().map(|x| x - body.interior_point()).collect();
        let ball = body.circumscribed();
        let size = (body.interior_point() - ball.center).norm() + ball.radius;
        let (rays, middles) = (Vec::new(), HashMap::new());
        let mut search = Self { body, points, size, center: 0.0, rays, middles, found: 0.0, direction: Vector3::x() };
        search.center = search.distance(&Vector3::zeros());
        search
    }

    fn run(mut self) -> Gap {
        // Normalized directions: no cell is much longer than wide, however long the body is.
        let sphere = Sphere::subdivided(1);
        for u in sphere.vertices() {
            self.cast(self.body.inverse() * u);
        }
        let mut cells = BinaryHeap::new();
        for &rays in sphere.triangles() {
            cells.push(Cell { rays, most: self.most(rays) });
        }
        let mut most = f64::INFINITY;
        while let Some(cell) = cells.pop() {
            most = cell.most;
            if most <= (self.found * (1.0 + GAP_ACCURACY)).max(RESOLVED_GAP * self.size) || cells.len() >= MAX_CELLS {
                break;
            }
            let [a, b, c] = cell.rays;
            let (ab, bc, ca) = (self.middle(a, b), self.middle(b, c), self.middle(c, a));
            for rays in [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]] {
                // No part of a cell reaches farther than the cell.
                cells.push(Cell { rays, most: self.most(rays).min(most) });
            }
        }
        // All lies in one ball.
        let most = most.min(2.0 * self.body.circumscribed().radius);
        Gap { most_m: most, found_m: self.found, direction: self.direction, mean_m: self.mean() }
    }

    fn middle(&mut self, a: usize, b: usize) -> usize {
        let key = (a.min(b), a.max(b));
        if let Some(&known) = self.middles.get(&key) {
            return known;
        }
        let u = |ray: usize| self.body.normalization().linear * self.rays[ray].d;
        let middle = self.cast(self.body.inverse() * (u(a) + u(b)).normalize());
        self.middles.insert(key, middle);
        middle
    }

    /// Looks where a ray leaves the body.
    fn cast(&mut self, d: Vector3<f64>) -> usize {
        let (body, interior) = (self.body, self.body.interior_point());
        let normalization = body.normalization();
        let (start, u) =
            (normalization.linear * (interior - normalization.center), (normalization.linear * d).normalize());
        let exit = body.boundary_along(&u) - interior;
        let planes: Vec<_> = body
            .constraints()
            .iter()
            .map(|constraint| {
                // Where the ray crosses that constraint's own surface, be it farther out than the
                // body's, unless rounding would be too large there.
                let own = body.inverse() * u * boundary_radius(&constraint.polynomial, &start, &u);
                self.plane(constraint, if own.norm() <= MAX_CONSTRAINT_REACH * exit.norm() { &own } else { &exit })
            })
            // Without one of them the others still hold the body.
            .filter(|a| a.iter().all(|entry| entry.is_finite()))
            .collect();
        let reach = planes.iter().map(|a| a.dot(&d)).fold(0.0, f64::max);
        let most = self.distance(&(d / reach));
        self.find(&exit);
        self.rays.push(Ray { d, planes, most });
        self.rays.len() - 1
    }

    /// The normal a of a half-space `a·y <= 1` that contains the body, by the constraint's tangent
    /// plane at x.
    fn plane(&self, constraint: &Constraint, x: &Vector3<f64>) -> Vector3<f64> {
        let (placement, interior) = (self.body.placement(), self.body.interior_point());
        let place = x + interior;
        let sample = placement.sample(constraint, &place);
        let gradient = sample.gradient();
        let slack = sample.nearby_value_error()
            + (gradient.norm() + sample.gradient_error()) * placement.displacement(&place)
            + sample.gradient_error() * (self.size + x.norm())
            + GAP_ROUNDING * (1.0 + sample.value().abs() + gradient.norm() * (place.norm() + interior.norm()));
        gradient / (gradient.dot(x) + 1.0 - sample.value() + slack)
    }

    /// Bound of the distance of the body within a cone of rays.
    fn most(&self, rays: [usize; 3]) -> f64 {
        let rays = rays.map(|ray| &self.rays[ray]);
        let mut most = rays.iter().map(|ray| ray.most).fold(self.center, f64::max);
        // Of each plane the inverse of how far along each ray it is.
        let mut planes: Vec<[f64; 3]> = Vec::new();
        for a in rays.iter().flat_map(|ray| &ray.planes) {
            let plane = rays.map(|ray| a.dot(&ray.d));
            let behind = |p: &[f64; 3], q: &[f64; 3]| (0..3).all(|i| p[i] <= q[i]);
            if !planes.iter().any(|known| behind(&plane, known)) {
                planes.retain(|known| !behind(known, &plane));
                planes.push(plane);
            }
        }
        for plane in &planes {
            let mut polygon = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            for other in planes.iter().filter(|other| *other != plane) {
                clip(&mut polygon, &[plane[0] - other[0], plane[1] - other[1], plane[2] - other[2]]);
            }
            for w in polygon.iter().filter(|w| w.iter().all(|share| *share < 1.0)) {
                let along = rays[0].d * w[0] + rays[1].d * w[1] + rays[2].d * w[2];
                let reach = plane[0] * w[0] + plane[1] * w[1] + plane[2] * w[2];
                let rounded = plane[0].abs() * w[0] + plane[1].abs() * w[1] + plane[2].abs() * w[2];
                let reach = reach - GAP_ROUNDING * rounded;
                // Planes that leave the cell open somewhere bound nothing there.
                if !(reach > 0.0) {
                    return f64::INFINITY;
                }
                most = most.max(self.distance(&(along / reach)));
            }
        }
        most
    }

    /// Bound of the distance of x from the hull.
    fn distance(&self, x: &Vector3<f64>) -> f64 {
        let distance = (x - nearest(&self.points, x)).norm() + GAP_ROUNDING * self.size;
        // A plane that bounds nothing.
        if x.norm() < f64::INFINITY { distance } else { f64::INFINITY }
    }

    /// Takes a point of the body if it is the farthest so far, by the plane that parts it from the
    /// hull.
    fn find(&mut self, x: &Vector3<f64>) {
        let Some(n) = (x - nearest(&self.points, x)).try_normalize(0.0) else { return };
        let distance = n.dot(x) - height(&self.points, &n);
        if distance > self.found {
            (self.found, self.direction) = (distance, n);
        }
    }

    fn mean(&self) -> f64 {
        let gap = |n: &Vector3<f64>| self.body.support(n).height_m - height(&self.points, n);
        sphere_rule(MEAN_RINGS).map(|(n, weight)| gap(&n) * weight).sum::<f64>() / (4.0 * PI)
    }
}

/// A point of the hull of points, about the one nearest to x.
pub(super) fn nearest(points: &[Vector3<f64>], x: &Vector3<f64>) -> Vector3<f64> {
    let support = |n: &Vector3<f64>| {
        let point = farthest(points, &-n).copied().unwrap_or_default();
        Corner { x: point, y: *x, difference: point - x }
    };
    let found = gjk(0.0, &-x, support);
    if found.common.is_some() { *x } else { found.x }
}

/// The part of a polygon where a linear function is not negative, and corners that rounding may
/// have made negative: too many only widen a bound. Corners are by their weights on a triangle, the
/// function by its values at the triangle's corners (Sutherland and Hodgman, Reentrant polygon
/// clipping, Comm. ACM 17, 1974).
fn clip(polygon: &mut Vec<[f64; 3]>, function: &[f64; 3]) {
    let value = |w: &[f64; 3]| function[0] * w[0] + function[1] * w[1] + function[2] * w[2];
    let rounding = 16.0 * f64::EPSILON * function.iter().map(|value| value.abs()).sum::<f64>();
    let corners = std::mem::take(polygon);
    for (i, p) in corners.iter().enumerate() {
        let q = &corners[(i + 1) % corners.len()];
        let (at_p, at_q) = (value(p), value(q));
        if at_p >= -rounding {
            polygon.push(*p);
        }
        if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
            let share = at_p / (at_p - at_q);
            polygon.push(std::array::from_fn(|k| p[k] + (q[k] - p[k]) * share));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::gap;
    use crate::slab::cut;
    use nalgebra::Vector3;
    use sublevel_core::body::{Body, Sphere};
    use sublevel_testkit::Seeded;

    fn cube(half: f64) -> Vec<Vector3<f64>> {
        (0..8_u8).map(|i| Vector3::from_fn(|axis, _| if i >> axis & 1 == 1 { half } else { -half })).collect()
    }

    #[test]
    fn a_ball_around_a_cube_reaches_farthest_over_its_faces() {
        // The mean of the cube's support function |n_x| + |n_y| + |n_z| over all directions is 3/2.
        let radius = 3.0_f64.sqrt() * (1.0 + 1e-12);
        for size in [1e-6, 1.0, 1e6] {
            let found = gap(&Body::ball("ball", Vector3::zeros(), radius * size).unwrap(), &cube(size));
            let (truth, mean) = ((radius - 1.0) * size, (radius - 1.5) * size);
            assert!(truth <= found.most_m && found.most_m <= 1.03 * truth, "{found:?} {truth}");
            assert!((found.mean_m / mean - 1.0).abs() < 1e-2, "{found:?} {mean}");
        }
    }

    #[test]
    fn a_box_does_not_reach_beyond_its_corners() {
        let found = gap(&Body::cuboid("box", Vector3::repeat(1.0 + 1e-9)).unwrap(), &cube(1.0));
        assert!(1e-9 <= found.most_m && found.most_m < 1e-4, "{found:?}");
    }

    #[test]
    fn the_interior_point_may_lie_outside_the_hull() {
        // A ball about 0, and its points with x >= 1/2 only: the farthest is (-1, 0, 0).
        let points: Vec<_> = Sphere::subdivided(3).vertices().iter().copied().filter(|u| u.x >= 0.5).collect();
        let nearest = points.iter().map(|u| u.x).fold(f64::MAX, f64::min);
        let found = gap(&Body::ball("ball", Vector3::zeros(), 1.0).unwrap(), &points);
        assert!(1.0 + nearest <= found.most_m && found.most_m <= 1.03 * (1.0 + nearest), "{found:?}");
    }

    #[test]
    fn slabs_leave_a_polytope_no_gap() {
        // An ellipsoid around an octahedron cut by the slabs of its four pairs of faces: nothing is
        // left but the octahedron.
        let points: Vec<_> = (0..6)
            .map(|i| Vector3::ith(i % 3, if i < 3 { 1.0 } else { -1.0 }).component_mul(&Vector3::new(1.0, 0.5, 0.3)))
            .collect();
        let mut body = Body::ellipsoid("e", Vector3::zeros(), Vector3::new(1.0, 0.5, 0.3) * (1.0 + 1e-9)).unwrap();
        let mut found = gap(&body, &points);
        for slabs in 0..8 {
            // Some cuts are across edges of the octahedron, which stand out as well.
            assert!(found.found_m <= found.most_m && found.most_m <= 1.03 * found.found_m, "{slabs}: {found:?}");
            body = cut(&body, &points, 0.0, &found.direction).unwrap();
            found = gap(&body, &points);
            if found.most_m < 1e-4 {
                break;
            }
        }
        assert!(found.most_m < 1e-4 && found.mean_m < 1e-5, "{found:?}");
    }

    #[test]
    fn the_bound_holds_in_all_directions_and_is_close() {
        for seed in 0..30 {
            let mut random = Seeded(seed);
            let half = Vector3::from_fn(|_, _| 10.0_f64.powf(random.signed()));
            let center = Vector3::from_fn(|_, _| 10.0 * random.signed());
            let body = Body::ellipsoid("e", center, half).unwrap();
            let points: Vec<_> = (0..20)
                .map(|_| {
                    let u = Vector3::from_fn(|_, _| random.signed()).normalize();
                    center + half.component_mul(&u) * random.signed().abs().sqrt()
                })
                .collect();
            let found = gap(&body, &points);
            let mut most = 0.0_f64;
            for _ in 0..200_000 {
                // Directions as even over the ellipsoid as over the sphere.
                let n = Vector3::from_fn(|_, _| random.signed()).component_div(&half).normalize();
                let hull = points.iter().map(|x| n.dot(&(x - center))).fold(f64::MIN, f64::max);
                most = most.max(half.component_mul(&n).norm() - hull);
            }
            assert!(most <= found.most_m, "seed {seed}: {found:?} {most}");
            assert!(found.most_m <= 1.05 * most, "seed {seed}: {found:?} {most}");
            let along = half.component_mul(&found.direction).norm()
                - points.iter().map(|x| found.direction.dot(&(x - center))).fold(f64::MIN, f64::max);
            assert!(along >= 0.9 * found.most_m, "seed {seed}: {found:?} {along}");
        }
    }
}
