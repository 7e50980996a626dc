//! How far points reach along a direction.

use nalgebra::Vector3;

/// Points looked at side by side, so that none waits for the comparison of the one before it.
const LANES: usize = 8;

/// The largest `n·x` of finite points; negative infinity of none.
pub(super) fn height(points: &[Vector3<f64>], n: &Vector3<f64>) -> f64 {
    let mut lanes = [f64::NEG_INFINITY; LANES];
    for chunk in points.chunks(LANES) {
        for (lane, point) in lanes.iter_mut().zip(chunk) {
            let height = n.dot(point);
            *lane = if height > *lane { height } else { *lane };
        }
    }
    lanes.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The first of the finite points that reach farthest along n; none of none.
pub(super) fn farthest<'a>(points: &'a [Vector3<f64>], n: &Vector3<f64>) -> Option<&'a Vector3<f64>> {
    let height = height(points, n);
    points.iter().find(|point| n.dot(point) >= height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn lanes_find_what_a_plain_search_finds() {
        let mut random = Seeded(21);
        for count in 1..60 {
            // Few different coordinates: many points are equally far.
            let points: Vec<_> = (0..count).map(|_| Vector3::from_fn(|_, _| (2.0 * random.signed()).round())).collect();
            let n = Vector3::from_fn(|_, _| random.signed());
            let plain = points.iter().map(|p| n.dot(p)).fold(f64::NEG_INFINITY, f64::max);
            assert_eq!(height(&points, &n), plain);
            let first = points.iter().find(|p| n.dot(p) == plain).unwrap();
            assert!(std::ptr::eq(farthest(&points, &n).unwrap(), first));
        }
        assert_eq!((height(&[], &Vector3::x()), farthest(&[], &Vector3::x())), (f64::NEG_INFINITY, None));
    }
}
