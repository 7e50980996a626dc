//! How a cost grows with a size: measured points, and the exponent of the power of the size that
//! they follow.

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Nanoseconds,
    Bytes,
}

/// A cost against a size.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) name: String,
    pub(super) unit: Unit,
    /// Sizes and costs, by size.
    pub(super) points: Vec<(f64, f64)>,
}

/// What costs are measured against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axis {
    /// For names of files and the table.
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// Name of the size.
    pub(super) size: &'static str,
}

const fn axis(key: &'static str, title: &'static str, size: &'static str) -> Axis {
    Axis { key, title, size }
}

pub(super) const DEGREE: Axis = axis("degree", "A distance query against the degree", "degree of both bodies");
pub(super) const BODY: Axis = axis("body", "A body against its degree", "degree of the body");
pub(super) const CONSTRAINTS: Axis =
    axis("constraints", "A distance query against the number of constraints", "constraints of one body");
pub(super) const PARTS: Axis = axis("parts", "A distance query against the parts of a compound", "parts of one solid");
pub(super) const BATCH: Axis = axis("batch", "A batch of distances against its poses", "poses of a batch");
pub(super) const MESSAGE: Axis = axis("message", "A message to the server against its pairs", "pairs of a message");
pub(super) const FIT_DEGREE: Axis = axis("fit-degree", "A fit against the degree", "degree");
pub(super) const FIT_POINTS: Axis = axis("fit-points", "A fit against the number of points", "points");

/// All of them.
pub(super) const AXES: [Axis; 8] = [DEGREE, BODY, CONSTRAINTS, PARTS, BATCH, MESSAGE, FIT_DEGREE, FIT_POINTS];

/// Costs against one size.
#[derive(Clone, Debug)]
pub(super) struct Growth {
    pub(super) axis: Axis,
    /// What was measured, for people.
    pub(super) what: String,
    pub(super) lines: Vec<Line>,
}

impl Line {
    pub(super) fn new(name: &str, unit: Unit) -> Self {
        Self { name: name.into(), unit, points: Vec::new() }
    }

    /// The exponent over the upper half of the sizes.
    pub(super) fn exponent(&self) -> Option<f64> {
        exponent(&self.points)
    }
}

/// Slope of the line through the logarithms with the least squares of deviations, over the points
/// whose size is at least the geometric mean of the least and the largest; none of fewer than two
/// sizes.
pub(super) fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let positive = || points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
    let least = positive().map(|(x, _)| *x).fold(f64::INFINITY, f64::min);
    let most = positive().map(|(x, _)| *x).fold(0.0, f64::max);
    // Rounding must not leave out a size that is the mean itself.
    let from = (least * most).sqrt() * (1.0 - 1e-12);
    let logs: Vec<(f64, f64)> = positive().filter(|(x, _)| *x >= from).map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (square, product) =
        logs.iter().fold((0.0, 0.0), |(s, p), at| (s + (at.0 - x).powi(2), p + (at.0 - x) * (at.1 - y)));
    (square > 0.0).then(|| product / square)
}

#[cfg(test)]
mod tests {
    use super::exponent;

    #[test]
    fn powers_are_found() {
        for power in [-1.0, 0.0, 0.5, 1.0, 3.0] {
            let points: Vec<(f64, f64)> = (0..7).map(|i| 2_f64.powi(i)).map(|x| (x, 5.0 * x.powf(power))).collect();
            assert!((exponent(&points).unwrap() - power).abs() < 1e-12);
        }
    }

    #[test]
    fn only_the_upper_half_counts() {
        // A floor of 100 below a square.
        let points: Vec<(f64, f64)> = (0..9).map(|i| 10_f64.powi(i)).map(|x| (x, (x * x).max(100.0))).collect();
        assert!((exponent(&points).unwrap() - 2.0).abs() < 1e-12);
        let degrees = [(2.0, 99.0), (4.0, 4.0), (6.0, 6.0), (8.0, 8.0)];
        assert!((exponent(&degrees).unwrap() - 1.0).abs() < 1e-12, "4 is the mean of 2 and 8");
    }

    #[test]
    fn noise_is_evened_out() {
        let points: Vec<(f64, f64)> =
            (0..40).map(|i| (1.2_f64.powi(i), 1.2_f64.powi(2 * i) * if i % 2 == 0 { 1.1 } else { 0.9 })).collect();
        assert!((exponent(&points).unwrap() - 2.0).abs() < 0.05);
    }

    #[test]
    fn one_size_has_no_exponent() {
        assert_eq!(exponent(&[]), None);
        assert_eq!(exponent(&[(4.0, 2.0)]), None);
        assert_eq!(exponent(&[(4.0, 2.0), (4.0, 3.0), (f64::NAN, 1.0)]), None);
    }
}
