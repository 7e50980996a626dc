//! The union of many triangles as its outline: thousands of triangles of a mesh cover what a few
//! hundred vertices describe.

use super::contour::contours;

/// Cells of the raster to a pixel.
const FINE: f64 = 3.0;
/// The raster has at most this number of cells across: a drawing is never so wide.
const MOST: usize = 4000;

/// The outlines of the area that convex polygons cover together, in the same coordinates (pixels),
/// to within half a cell of a raster; holes run the other way round.
pub(super) fn covered(polygons: &[Vec<[f64; 2]>]) -> Vec<Vec<[f64; 2]>> {
    let corners = || polygons.iter().flatten().filter(|p| p.iter().all(|c| c.is_finite()));
    let low = [0, 1].map(|k| corners().map(|p| p[k]).fold(f64::INFINITY, f64::min));
    let high = [0, 1].map(|k| corners().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max));
    // Written so that an empty range, whose ends are infinite, is left.
    if !(low[0] <= high[0] && low[1] <= high[1]) {
        return Vec::new();
    }
    // An empty cell all around closes every outline.
    let [width, height] = [0, 1].map(|k| ((high[k] - low[k]) * FINE).ceil() as usize + 4);
    if width.max(height) > MOST {
        return polygons.to_vec();
    }
    let cell = |p: &[f64; 2]| [0, 1].map(|k| (p[k] - low[k]) * FINE + 1.5);
    let mut values = vec![1.0; width * height];
    for polygon in polygons {
        fill(&polygon.iter().map(cell).collect::<Vec<_>>(), &mut values, width);
    }
    let back = |p: [f64; 2]| [0, 1].map(|k| (p[k] - 1.5) / FINE + low[k]);
    contours(&values, width).into_iter().map(|outline| outline.into_iter().map(back).collect()).collect()
}

/// Marks the nodes of the raster that a convex polygon contains, row by row.
fn fill(polygon: &[[f64; 2]], values: &mut [f64], width: usize) {
    let rows = polygon.iter().map(|p| p[1]);
    let (first, last) = (rows.clone().fold(f64::INFINITY, f64::min), rows.fold(0.0, f64::max));
    if !(first <= last) {
        return;
    }
    for row in first.ceil() as usize..=last.floor() as usize {
        let at = row as f64;
        let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let crossing = |(a, b): (&[f64; 2], &[f64; 2])| {
            let between = (a[1].min(b[1])..=a[1].max(b[1])).contains(&at);
            (between && a[1] != b[1]).then(|| a[0] + (at - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        };
        let (left, right) =
            sides.filter_map(crossing).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, r), x| (l.min(x), r.max(x)));
        if left <= right {
            for column in left.ceil() as usize..=right.floor() as usize {
                values[row * width + column] = -1.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
        sides.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
    }

    /// Two triangles of a rectangle.
    fn plate([x, y]: [f64; 2], [w, h]: [f64; 2]) -> [Vec<[f64; 2]>; 2] {
        let corners = [[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
        [vec![corners[0], corners[1], corners[2]], vec![corners[0], corners[2], corners[3]]]
    }

    #[test]
    fn triangles_become_one_outline() {
        let grid = (0..10).flat_map(|i| (0..10).map(move |j| [f64::from(i) * 8.0, f64::from(j) * 5.0]));
        let triangles: Vec<_> = grid.flat_map(|corner| plate(corner, [8.0, 5.0])).collect();
        let [outline] = &covered(&triangles)[..] else { panic!("one area without holes") };
        assert!((area(outline).abs() / 4000.0 - 1.0).abs() < 0.02, "{}", area(outline));
        for [x, y] in outline {
            let inwards = x.min(80.0 - x).min(*y).min(50.0 - y);
            assert!(inwards.abs() <= 0.5, "off the edge by {inwards} pixels");
        }
    }

    #[test]
    fn a_frame_keeps_its_hole_and_parts_stay_apart() {
        let bars = [([0.0, 0.0], [60.0, 6.0]), ([0.0, 54.0], [60.0, 6.0])];
        let posts = [([0.0, 0.0], [6.0, 60.0]), ([54.0, 0.0], [6.0, 60.0])];
        let far = [([100.0, 10.0], [20.0, 20.0])];
        let triangles: Vec<_> = bars.into_iter().chain(posts).chain(far).flat_map(|(c, s)| plate(c, s)).collect();
        let mut areas: Vec<f64> = covered(&triangles).iter().map(|outline| area(outline)).collect();
        areas.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        for (found, known) in areas.iter().zip([400.0, -48.0 * 48.0, 3600.0]) {
            assert!((found.abs() / f64::abs(known) - 1.0).abs() < 0.04, "{areas:?}");
        }
        assert!(areas.len() == 3 && areas[1] * areas[2] < 0.0, "the hole runs the other way round: {areas:?}");
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert!(covered(&[]).is_empty());
        assert!(covered(&[vec![[f64::NAN, 0.0]]]).is_empty());
        assert!(covered(&[vec![[1.0, 1.0]]]).iter().flatten().flatten().all(|c| c.is_finite()));
    }
}
