//! About where a ray from inside leaves the difference of two outlines: the refinement of portals
//! (Snethen, Complex collision made simple, Game Programming Gems 7, 2008). Nothing is proven by
//! it; it shows Newton's method where to begin.

use crate::optimize::Corner;
use nalgebra::Vector3;

/// Most support points asked for to find a portal, and as many to refine it.
const MAX_STEPS: usize = 12;

/// How much farther a support point must lie than the plane of the portal, relative to that plane's
/// height; dimensionless.
///
/// The portal gives a first guess: a larger value ends at worse guesses, a smaller one refines
/// beyond what Newton's method needs. Exercised by `rays_leave_ellipsoids_where_they_do`.
const WORTH: f64 = 1e-3;

/// Where the ray passes through the last portal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) x: Vector3<f64>,
    pub(super) y: Vector3<f64>,
    /// Normal of the portal, outward; of any length.
    pub(super) n: Vector3<f64>,
    /// The point farthest along it.
    pub(super) corner: Corner,
}

/// Where the ray from 0 along u leaves a convex set around 0 that is known by its points farthest
/// along directions.
pub(super) fn crossing(u: &Vector3<f64>, support: impl Fn(&Vector3<f64>) -> Corner) -> Crossing {
    let mut a = support(u);
    let mut n = a.difference.cross(u);
    if !(n.norm_squared() > 1e-12 * a.difference.norm_squared() * u.norm_squared()) {
        return Crossing { x: a.x, y: a.y, n: *u, corner: a };
    }
    let mut b = support(&n);
    n = a.difference.cross(&b.difference);
    if n.dot(u) < 0.0 {
        (a, b, n) = (b, a, -n);
    }
    // The cone of a, b and c must contain u; a and b have it on the side where c lies.
    let mut c = support(&n);
    for _ in 0..MAX_STEPS {
        if b.difference.cross(&c.difference).dot(u) < 0.0 {
            a = c;
        } else if c.difference.cross(&a.difference).dot(u) < 0.0 {
            b = c;
        } else {
            break;
        }
        c = support(&a.difference.cross(&b.difference));
    }
    let outward = |a: &Corner, b: &Corner, c: &Corner| {
        let n = (b.difference - a.difference).cross(&(c.difference - a.difference));
        if n.dot(u) < 0.0 { -n } else { n }
    };
    n = outward(&a, &b, &c);
    let mut last = support(&n);
    for _ in 0..MAX_STEPS {
        if !((last.difference - a.difference).dot(&n) > WORTH * a.difference.dot(&n)) {
            break;
        }
        // Of the three portals with the new corner the one that the ray passes through.
        let side = last.difference.cross(u);
        let (of_a, of_b, of_c) = (side.dot(&a.difference), side.dot(&b.difference), side.dot(&c.difference));
        if of_a <= 0.0 && of_b >= 0.0 {
            c = last;
        } else if of_b <= 0.0 && of_c >= 0.0 {
            a = last;
        } else {
            b = last;
        }
        n = outward(&a, &b, &c);
        last = support(&n);
    }
    let weights = [
        b.difference.cross(&c.difference).dot(u),
        c.difference.cross(&a.difference).dot(u),
        a.difference.cross(&b.difference).dot(u),
    ]
    .map(|weight| weight.max(0.0));
    let total = weights[0] + weights[1] + weights[2];
    if !(total > 0.0) {
        return Crossing { x: last.x, y: last.y, n, corner: last };
    }
    let [of_a, of_b, of_c] = weights.map(|weight| weight / total);
    Crossing { x: a.x * of_a + b.x * of_b + c.x * of_c, y: a.y * of_a + b.y * of_b + c.y * of_c, n, corner: last }
}

#[cfg(test)]
mod tests {
    use super::crossing;
    use crate::optimize::Corner;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// The box with these half extents about a centre, B a point.
    fn cuboid(half: Vector3<f64>, center: Vector3<f64>) -> impl Fn(&Vector3<f64>) -> Corner {
        move |n| {
            let x = center + Vector3::from_fn(|i, _| half[i] * n[i].signum());
            Corner { x, y: Vector3::zeros(), difference: x }
        }
    }

    #[test]
    fn rays_leave_boxes_where_they_do() {
        for seed in 0..1_000 {
            let mut random = Seeded(seed);
            let half = Vector3::from_fn(|_, _| 10.0_f64.powf(2.0 * random.signed()));
            let center = Vector3::from_fn(|i, _| 0.9 * half[i] * random.signed());
            let u = random.unit();
            let found = crossing(&u, cuboid(half, center));
            let reach = (0..3).map(|i| (half[i] + center[i] * u[i].signum()) / u[i].abs()).fold(f64::MAX, f64::min);
            let truth = u * reach;
            assert!((found.x - truth).norm() <= 1e-3 * (reach + half.norm()), "seed {seed}: {found:?} {truth}");
            // The normal of the side, but where the ray leaves near an edge.
            let side = (0..3).min_by(|&i, &j| {
                let along = |i: usize| (half[i] + center[i] * u[i].signum()) / u[i].abs();
                along(i).total_cmp(&along(j))
            });
            let near_edge = (0..3).filter(|&i| (truth[i] - center[i]).abs() > half[i] * (1.0 - 1e-2)).count() > 1;
            let n = found.n.normalize();
            assert!(near_edge || n[side.unwrap()].abs() > 1.0 - 1e-2, "seed {seed}: {found:?}");
        }
    }

    #[test]
    fn rays_leave_ellipsoids_where_they_do() {
        for seed in 0..1_000 {
            let mut random = Seeded(seed);
            let radii = Vector3::from_fn(|_, _| 10.0_f64.powf(random.signed()));
            let support = |n: &Vector3<f64>| {
                let scaled = radii.component_mul(n);
                let x = radii.component_mul(&scaled) / scaled.norm();
                Corner { x, y: -x, difference: x * 2.0 }
            };
            let u = random.unit();
            let found = crossing(&u, support);
            let truth = u / u.component_div(&radii).norm();
            assert!((found.x - truth).norm() <= 0.05 * radii.max(), "seed {seed}: {found:?} {truth}");
            assert!((found.x + found.y).norm() < 1e-12);
        }
    }

    #[test]
    fn a_ray_through_the_first_corner_is_its_own_portal() {
        let found = crossing(&Vector3::x(), |n| {
            let x = n.normalize();
            Corner { x, y: Vector3::zeros(), difference: x }
        });
        assert!((found.x - Vector3::x()).norm() < 1e-12 && found.n == Vector3::x());
    }
}
