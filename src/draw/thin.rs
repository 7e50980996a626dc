//! Curves with fewer vertices that look the same (Douglas and Peucker, 1973).

/// The vertices of an open curve that are needed for it to stay within `tolerance` of what it was;
/// the ends are kept.
pub(super) fn thinned(curve: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let Some(last) = curve.len().checked_sub(1) else { return Vec::new() };
    let mut kept = vec![false; curve.len()];
    (kept[0], kept[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        if let Some(far) = farthest(curve, from, to, tolerance) {
            kept[far] = true;
            open.extend([(from, far), (far, to)]);
        }
    }
    curve.iter().zip(kept).filter_map(|(vertex, kept)| kept.then_some(*vertex)).collect()
}

/// The same of a closed curve, whose last vertex is joined to its first.
pub(super) fn thinned_loop(curve: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    // Cut where both halves are long: at the first vertex and at the one farthest from it.
    let Some(&start) = curve.first() else { return Vec::new() };
    let away = |vertex: &[f64; 2]| (vertex[0] - start[0]).hypot(vertex[1] - start[1]);
    let far = (0..curve.len()).max_by(|&a, &b| away(&curve[a]).total_cmp(&away(&curve[b]))).unwrap_or(0);
    let mut around = curve.to_vec();
    around.push(start);
    let mut all = thinned(&around[..=far], tolerance);
    all.pop();
    all.extend(thinned(&around[far..], tolerance));
    all.pop();
    all
}

/// The vertex between two others that lies farthest from the segment between them, if that is more
/// than the tolerance.
fn farthest(curve: &[[f64; 2]], from: usize, to: usize, tolerance: f64) -> Option<usize> {
    let off = |k: usize| from_segment(curve[k], curve[from], curve[to]);
    let far = (from + 1..to).max_by(|&a, &b| off(a).total_cmp(&off(b)))?;
    (off(far) > tolerance).then_some(far)
}

/// Distance of a point from a segment.
fn from_segment(point: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let to = [point[0] - a[0], point[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let part = if square > 0.0 { ((to[0] * along[0] + to[1] * along[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (to[0] - part * along[0]).hypot(to[1] - part * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// The largest distance of a vertex of the one from the segments of the other.
    fn deviation(curve: &[[f64; 2]], thin: &[[f64; 2]]) -> f64 {
        let off =
            |p: &[f64; 2]| thin.windows(2).map(|ends| from_segment(*p, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
        curve.iter().map(off).fold(0.0, f64::max)
    }

    #[test]
    fn a_curve_keeps_its_ends_and_its_shape() {
        let wave: Vec<[f64; 2]> = (0..=1000).map(f64::from).map(|x| [x, 100.0 * (x / 80.0).sin()]).collect();
        let thin = thinned(&wave, 0.3);
        assert!(thin.len() < 120, "{} vertices", thin.len());
        assert_eq!((thin[0], thin[thin.len() - 1]), (wave[0], wave[1000]));
        assert!(deviation(&wave, &thin) <= 0.3);
        assert!(thinned(&wave, 3.0).len() < thin.len());
    }

    #[test]
    fn corners_stay_and_what_is_straight_goes() {
        let path = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 5.0], [2.0, 9.0]];
        assert_eq!(thinned(&path, 0.1), [[0.0, 0.0], [2.0, 0.0], [2.0, 9.0]]);
        // There and back: the turning point is off the segment, not off its line.
        let spike = [[0.0, 0.0], [7.0, 0.0], [1.0, 0.0]];
        assert_eq!(thinned(&spike, 0.1), spike);
        assert!(thinned(&[], 0.1).is_empty());
        assert_eq!(thinned(&[[1.0, 2.0]], 0.1), [[1.0, 2.0]]);
    }

    #[test]
    fn a_loop_stays_a_loop() {
        let circle: Vec<[f64; 2]> =
            (0..2000).map(|i| TAU * f64::from(i) / 2000.0).map(|t| [100.0 * t.cos(), 100.0 * t.sin()]).collect();
        let mut thin = thinned_loop(&circle, 0.25);
        assert!((20..80).contains(&thin.len()), "{} vertices", thin.len());
        thin.push(thin[0]);
        assert!(deviation(&circle, &thin) <= 0.25);
        let square = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]];
        assert_eq!(thinned_loop(&square, 0.1), [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert!(thinned_loop(&[], 0.1).is_empty());
    }
}
