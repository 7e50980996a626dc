//! Words beside points, put where they cover neither points nor each other, as far as there is such
//! a place.

/// A rectangle, pixels, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

impl Area {
    /// The square of this half-width about a point.
    pub(super) fn around((x, y): (f64, f64), half: f64) -> Self {
        Self { left: x - half, top: y - half, right: x + half, bottom: y + half }
    }

    /// Area in common, square pixels.
    fn overlap(&self, other: &Self) -> f64 {
        let wide = self.right.min(other.right) - self.left.max(other.left);
        let tall = self.bottom.min(other.bottom) - self.top.max(other.top);
        wide.max(0.0) * tall.max(0.0)
    }

    fn size(&self) -> f64 {
        (self.right - self.left) * (self.bottom - self.top)
    }
}

/// Height of a line, and the width of a letter as a guess: the reader's font is not known here.
/// Pixels.
pub(super) const TALL: f64 = 14.0;
const WIDE: f64 = 6.8;

/// Between two texts on a line, pixels.
const GAP: f64 = 4.0;

/// What a pixel away from the point counts, against square pixels of overlap.
const FAR: f64 = 1.5;

/// For each point with its text the upper left corner of the text. `taken` are areas that texts
/// keep out of, `frame` is what they stay in, `away` how far from the point they begin, pixels.
pub(super) fn place(points: &[((f64, f64), &str)], taken: &[Area], frame: &Area, away: f64) -> Vec<(f64, f64)> {
    let mut taken = taken.to_vec();
    let mut placed = Vec::new();
    for &((x, y), text) in points {
        let wide = WIDE * text.chars().count() as f64 + GAP;
        let mut best: Option<(f64, Area)> = None;
        for ring in 0..4 {
            let gap = away + 7.0 * f64::from(ring);
            let (left, middle, right) = (x - gap - wide, x - wide / 2.0, x + gap);
            let (above, level, below) = (y - gap - TALL, y - TALL / 2.0, y + gap);
            let up = y - TALL;
            let places = [
                (right, up),
                (left, up),
                (right, y),
                (left, y),
                (middle, above),
                (middle, below),
                (right, level),
                (left, level),
                (right, above),
                (left, above),
                (right, below),
                (left, below),
            ];
            for (order, (left, top)) in places.into_iter().enumerate() {
                let area = Area { left, top, right: left + wide, bottom: top + TALL };
                let covered: f64 = taken.iter().map(|other| area.overlap(other)).sum();
                let outside = area.size() - area.overlap(frame);
                let cost = covered + 4.0 * outside + FAR * (gap - away) + 0.1 * order as f64;
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, area));
                }
            }
        }
        // There are places to choose from.
        let Some((_, area)) = best else { continue };
        taken.push(area);
        placed.push((area.left, area.top));
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_do_not_cover_each_other() {
        let frame = Area { left: 0.0, top: 0.0, right: 300.0, bottom: 300.0 };
        let points: Vec<((f64, f64), &str)> =
            (0..8).map(|i| ((150.0 + 6.0 * f64::from(i % 3), 150.0 + 8.0 * f64::from(i / 3)), "label")).collect();
        let markers: Vec<Area> = points.iter().map(|(at, _)| Area::around(*at, 5.0)).collect();
        let placed = place(&points, &markers, &frame, 6.0);
        let area = |(left, top): (f64, f64)| Area { left, top, right: left + 5.0 * WIDE, bottom: top + TALL };
        for (i, one) in placed.iter().enumerate() {
            let covered: f64 = placed[..i].iter().map(|other| area(*one).overlap(&area(*other))).sum();
            assert!(covered < 0.1 * area(*one).size(), "{covered}");
        }
    }

    #[test]
    fn labels_stay_in_the_frame() {
        let frame = Area { left: 0.0, top: 0.0, right: 100.0, bottom: 100.0 };
        let [(left, _)] = place(&[((98.0, 50.0), "label")], &[], &frame, 6.0)[..] else { panic!("one label") };
        assert!(left + 5.0 * WIDE <= 100.0, "{left}");
    }
}
