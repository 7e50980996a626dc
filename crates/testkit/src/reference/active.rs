//! Which constraints may be active, read off the values and gradients at a trial point.

use super::big::{Vector, double, doubles};
use super::solid::Solid;
use nalgebra::{DMatrix, DVector, Vector3};

/// A trial set of active constraints with first multipliers.
#[derive(Clone, Debug)]
pub struct Trial {
    pub index: Vec<usize>,
    pub multiplier: Vec<f64>,
}

/// How close to the level values may stand for equality: at first, and where that leads nowhere.
/// The witness on a needle's face may be far from the edge that it belongs to, as measured by the
/// thickness, where the edge counts for little.
pub const CLOSE: [f64; 2] = [0.05, f64::INFINITY];

/// Most constraints looked at.
const MOST: usize = 5;

/// Constraints of the body whose value at v is that close to `level` or above it, largest first,
/// with their gradients.
pub fn near(body: &Solid<'_>, v: &Vector, level: f64, close: f64) -> Vec<(usize, Vector3<f64>)> {
    let mut all: Vec<_> = (0..body.len()).map(|i| (i, double(&body.value(i, v)))).collect();
    all.sort_by(|p, q| q.1.total_cmp(&p.1));
    let least = (level - close * level.abs().max(1.0)).min(all[0].1);
    all.truncate(MOST);
    all.retain(|(_, value)| *value >= least);
    all.into_iter().map(|(i, _)| (i, doubles(&body.jet(i, v).gradient))).collect()
}

/// All subsets of 1 to 3 constraints.
pub fn subsets(near: &[(usize, Vector3<f64>)]) -> Vec<Vec<(usize, Vector3<f64>)>> {
    let chosen = |bits: u32| (0..near.len()).filter(|i| bits >> i & 1 == 1).map(|i| near[i]).collect();
    (1..1_u32 << near.len()).filter(|bits| bits.count_ones() <= 3).map(chosen).collect()
}

/// Least-squares multipliers of `columns · m = target`, negative ones cut off, with the residual
/// they leave.
pub fn fit(columns: &[DVector<f64>], target: &DVector<f64>) -> (Vec<f64>, f64) {
    let m = DMatrix::from_columns(columns);
    let solution = m.clone().svd(true, true).solve(target, 1e-12).expect("both factors are asked for");
    let multiplier = solution.map(|value| value.max(0.0));
    let residual = (m * &multiplier - target).norm();
    (multiplier.iter().copied().collect(), residual)
}

/// Trial sets for `Σ λ ∇g = target`, the best fit first and small sets before large ones.
pub fn for_direction(body: &Solid<'_>, v: &Vector, target: &Vector3<f64>, close: f64) -> Vec<Trial> {
    let target = DVector::from_column_slice(target.as_slice());
    let mut trials: Vec<_> = subsets(&near(body, v, 1.0, close))
        .into_iter()
        .map(|set| {
            let columns: Vec<_> = set.iter().map(|(_, g)| DVector::from_column_slice(g.as_slice())).collect();
            let (multiplier, residual) = fit(&columns, &target);
            (residual + 1e-3 * set.len() as f64, Trial { index: set.iter().map(|(i, _)| *i).collect(), multiplier })
        })
        .collect();
    trials.sort_by(|p, q| p.0.total_cmp(&q.0));
    trials.into_iter().map(|(_, trial)| trial).collect()
}
