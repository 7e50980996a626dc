//! Outlines of where a function on a grid is at most zero (marching squares).

use std::collections::HashMap;

/// The outlines of where `values`, given row by row with `width` to a row, are at most zero, in
/// grid steps from the first value; holes run the other way round. The values of the border must be
/// positive, so that every outline closes; infinite ones are crossed halfway.
pub(super) fn contours(values: &[f64], width: usize) -> Vec<Vec<[f64; 2]>> {
    let height = values.len() / width.max(1);
    let value = |[i, j]: [usize; 2]| values[j * width + i];
    let inside = |corner: [usize; 2]| value(corner) <= 0.0;
    // Where the outline crosses a grid line, named by the two nodes beside it, the one inside
    // first.
    let mut next: HashMap<[[usize; 2]; 2], [[usize; 2]; 2]> = HashMap::new();
    for j in 0..height.saturating_sub(1) {
        for i in 0..width.saturating_sub(1) {
            let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
            for (out, into) in crossings(corners, &inside) {
                next.insert(out, into);
            }
        }
    }
    let point = |[a, b]: [[usize; 2]; 2]| {
        let (low, high) = (value(a), value(b));
        let share = if high.is_finite() { low / (low - high) } else { 0.5 };
        [0, 1].map(|k| a[k] as f64 + share * (b[k] as f64 - a[k] as f64))
    };
    let mut outlines = Vec::new();
    let mut starts: Vec<_> = next.keys().copied().collect();
    // A hash map's order is not the same twice; a picture should be.
    starts.sort_unstable();
    for start in starts {
        let mut outline = Vec::new();
        let mut at = start;
        while let Some(following) = next.remove(&at) {
            outline.push(point(at));
            at = following;
        }
        if !outline.is_empty() {
            outlines.push(outline);
        }
    }
    outlines
}

/// The pieces of outline in a cell with these corners, counter-clockwise: from the side where the
/// outline enters to the one where it leaves, with the inside to its left. Two corners across count
/// as not joined.
fn crossings(
    corners: [[usize; 2]; 4],
    inside: &impl Fn([usize; 2]) -> bool,
) -> impl Iterator<Item = ([[usize; 2]; 2], [[usize; 2]; 2])> {
    let within = corners.map(inside);
    // Walking around the cell, an outline enters where the inside begins and leaves where it ends.
    let begins = (0..4).filter(move |&k| !within[k] && within[(k + 1) % 4]);
    begins.filter_map(move |k| {
        let ends = (1..4).map(|s| (k + s) % 4).find(|&m| within[m] && !within[(m + 1) % 4])?;
        Some(([corners[ends], corners[(ends + 1) % 4]], [corners[(k + 1) % 4], corners[k]]))
    })
}

#[cfg(test)]
mod tests {
    use super::contours;

    #[test]
    fn a_plate_with_a_hole_has_two_outlines() {
        let rows = ["       ", " ##### ", " #   # ", " ##### ", "       "];
        let values: Vec<f64> = rows.concat().bytes().map(|b| if b == b'#' { -1.0 } else { 1.0 }).collect();
        let found = contours(&values, 7);
        assert_eq!(found.len(), 2);
        let area = |polygon: &Vec<[f64; 2]>| {
            let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
            sides.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
        };
        let mut areas: Vec<f64> = found.iter().map(area).collect();
        areas.sort_by(f64::total_cmp);
        // Halfway between the nodes, less a triangle of an eighth at each corner; those of the hole
        // are cut off, too.
        assert_eq!(areas, [-(3.0 - 0.5), 15.0 - 0.5]);
        assert!(contours(&[], 0).is_empty());
    }
}
