//! What a lower bound of the reference rests on, for others to prove again.

use super::active::Trial;
use super::big::{Big, Vector, big, scaled};

/// Trial points and multipliers of both bodies; metres and world directions, points relative to the
/// translation of the first body.
#[derive(Clone, Debug)]
pub struct Dual {
    pub x: Vector,
    pub y: Vector,
    /// Constraints with their multipliers, all positive.
    pub of_a: Vec<(usize, Big)>,
    pub of_b: Vec<(usize, Big)>,
}

impl Dual {
    /// From an iterate in lengths of `unit` metres. Multipliers that turn gradients into directions
    /// or into other gradients are lengths or not (`lengths`).
    pub(super) fn new(
        (x, y): (&Vector, &Vector),
        (p, l): (&Trial, &[Big]),
        (q, m): (&Trial, &[Big]),
        unit: f64,
        lengths: bool,
    ) -> Self {
        let unit = big(unit);
        let factor = if lengths { unit.clone() } else { big(1.0) };
        let of = |trial: &Trial, multipliers: &[Big]| {
            let pairs = trial.index.iter().copied().zip(multipliers.iter().map(|m| m * &factor));
            pairs.filter(|(_, m)| *m > Big::ZERO).collect()
        };
        Self { x: scaled(x, &unit), y: scaled(y, &unit), of_a: of(p, l), of_b: of(q, m) }
    }
}
