//! The shortest vector beyond given planes.

use nalgebra::{Matrix3, Vector3};

/// The half-space `{v : normal·v >= floor}`.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Bound {
    pub(in crate::measure) normal: Vector3<f64>,
    pub(in crate::measure) floor: f64,
}

/// The shortest vector `v = Σ weight_k normal_k` of an intersection of half-spaces.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Shortest {
    pub(in crate::measure) v: Vector3<f64>,
    index: [usize; 3],
    weight: [f64; 3],
    len: usize,
}

impl Shortest {
    /// The active bounds, and their weights.
    pub(in crate::measure) fn support(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.index[..self.len].iter().copied().zip(self.weight[..self.len].iter().copied())
    }
}

/// The shortest vector within all bounds; none if there is no such vector, or rounding hides it.
///
/// Starting from no bounds, the most violated one joins the active ones, of which at most three
/// stay: the problem is of the kind of linear programs (Sharir and Welzl, A combinatorial bound for
/// linear programming and related problems, STACS 1992).
pub(in crate::measure) fn shortest(bounds: &[Bound]) -> Option<Shortest> {
    let scale = bounds.iter().map(|bound| bound.floor.abs()).fold(0.0, f64::max);
    let tolerance = 1e-13 * scale;
    let missed = |v: &Vector3<f64>, k: usize| bounds[k].floor - bounds[k].normal.dot(v);
    let mut found = Shortest::default();
    // A handful of exchanges of one bound for another is usual, for each makes v longer.
    for _ in 0..64 {
        let worst = (0..bounds.len()).max_by(|&p, &q| missed(&found.v, p).total_cmp(&missed(&found.v, q)));
        let Some(worst) = worst.filter(|&k| missed(&found.v, k) > tolerance) else { return Some(found) };
        let known = &found.index[..found.len];
        let mut next: Option<Shortest> = None;
        // Every choice of the new bound with up to two of the old.
        for choice in 0..1_usize << known.len() {
            let mut chosen = Shortest { index: [worst, 0, 0], len: 1, ..Shortest::default() };
            for (_, &k) in known.iter().enumerate().filter(|(bit, _)| choice >> bit & 1 == 1) {
                if chosen.len == 3 {
                    chosen.len = 0;
                    break;
                }
                chosen.index[chosen.len] = k;
                chosen.len += 1;
            }
            let Some(solved) = chosen.on_planes(bounds) else { continue };
            let within = known.iter().all(|&k| missed(&solved.v, k) <= 10.0 * tolerance);
            let shorter = next.is_none_or(|next| solved.v.norm_squared() < next.v.norm_squared());
            if within && shorter {
                next = Some(solved);
            }
        }
        found = next?;
    }
    None
}

impl Shortest {
    /// The shortest vector on the planes of the chosen bounds, if all of them are active.
    fn on_planes(mut self, bounds: &[Bound]) -> Option<Self> {
        let chosen = |i: usize| (i < self.len).then(|| &bounds[self.index[i]]);
        let gram = Matrix3::from_fn(|i, j| match (chosen(i), chosen(j)) {
            (Some(p), Some(q)) => p.normal.dot(&q.normal),
            _ => f64::from(u8::from(i == j)),
        });
        let floors = Vector3::from_fn(|i, _| chosen(i).map_or(0.0, |bound| bound.floor));
        let weight = gram.cholesky().filter(|_| self.len > 0 && gram.determinant() > 1e-12)?.solve(&floors);
        self.v = (0..self.len).filter_map(|i| Some(chosen(i)?.normal * weight[i])).sum();
        self.weight = weight.into();
        weight.iter().all(|weight| *weight >= 0.0).then_some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn nothing_within_the_bounds_is_shorter() {
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let inside = random.unit() * (2.0 * random.signed());
            let count = 1 + random.next() as usize % 20;
            let bounds: Vec<Bound> = (0..count)
                .map(|_| {
                    let normal = random.unit();
                    Bound { normal, floor: normal.dot(&inside) - random.signed().abs() }
                })
                .collect();
            let found = shortest(&bounds).unwrap();
            let label = format!("seed {seed}: {found:?}");
            assert!(bounds.iter().all(|bound| bound.normal.dot(&found.v) >= bound.floor - 1e-11), "{label}");
            // Duality: weights of at least 0 on planes that v lies on.
            let sum: Vector3<f64> = found.support().map(|(k, weight)| bounds[k].normal * weight).sum();
            assert!((sum - found.v).norm() < 1e-9 && found.support().all(|(_, weight)| weight >= 0.0), "{label}");
            for (k, weight) in found.support() {
                let off = bounds[k].normal.dot(&found.v) - bounds[k].floor;
                assert!(off.abs() < 1e-8 || weight < 1e-9, "{label}: {off}");
            }
        }
    }

    #[test]
    fn no_bounds_and_too_many() {
        assert_eq!(shortest(&[]).unwrap().v, Vector3::zeros());
        let slot = [Vector3::x(), -Vector3::x()].map(|normal| Bound { normal, floor: 1.0 });
        assert!(shortest(&slot).is_none());
    }
}
