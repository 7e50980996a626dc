//! A first sampling of all directions for the shortest translation out of an overlap, by the
//! outlines of the bodies. It proves nothing: it only spares the proof from being about one that is
//! not the shortest.

use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::vector::{apply_transposed, dot, rows};
use crate::polynomial::{Lanes, MAX_LANES, Number, Simd, Vector, WithSimd};
use nalgebra::Vector3;

/// The sampling, as vectorized work.
pub(super) struct Scout<'a> {
    pub(super) pair: &'a Pair<'a>,
}

/// Directions along each edge of the faces of a cube.
const STEPS: usize = 5;

/// All directions, in whole vectors.
const COUNT: usize = (6 * STEPS * STEPS).next_multiple_of(MAX_LANES);

/// The x, y and z of all directions, of any length; the last again where vectors are to be filled.
static DIRECTIONS: [[f64; COUNT]; 3] = {
    let mut columns = [[0.0; COUNT]; 3];
    let mut k = 0;
    while k < COUNT {
        let index = if k < 6 * STEPS * STEPS { k } else { 6 * STEPS * STEPS - 1 };
        let (face, i, j) = (index / (STEPS * STEPS), index / STEPS % STEPS, index % STEPS);
        columns[face / 2][k] = if face % 2 == 0 { 1.0 } else { -1.0 };
        columns[(face / 2 + 1) % 3][k] = (2 * i + 1) as f64 / STEPS as f64 - 1.0;
        columns[(face / 2 + 2) % 3][k] = (2 * j + 1) as f64 / STEPS as f64 - 1.0;
        k += 1;
    }
    columns
};

impl WithSimd for Scout<'_> {
    type Output = (Vector3<f64>, f64);

    /// The best of the directions, a unit vector from B to A, and about how deep A is in B along
    /// it; query frame.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (Vector3<f64>, f64) {
        let pair = self.pair;
        let splat = |value: f64| Lanes::<S>::splat(simd, value);
        let (outline_a, outline_b) = (pair.a.body.outline(), pair.b.body.outline());
        let offset =
            pair.a_to_query(&pair.a.body.normalization().center) - pair.b_to_query(&pair.b.body.normalization().center);
        let offset = [splat(offset.x), splat(offset.y), splat(offset.z)];
        let (rotation, unit) = (rows(simd, &pair.rotation), splat(1.0 / pair.unit()));
        let (mut least, mut best) = (splat(f64::INFINITY), splat(0.0));
        for from in (0..COUNT).step_by(Lanes::<S>::COUNT) {
            let mut n = [least; 3];
            for (n, column) in n.iter_mut().zip(&DIRECTIONS) {
                *n = Lanes::load(simd, &column[from..]);
            }
            let own = apply_transposed(&rotation, n);
            let x = outline_a.point(simd, outline_a.place(simd, [-n[0], -n[1], -n[2]]));
            let y = outline_b.point(simd, outline_b.place(simd, own));
            let along = (dot(own, y) - dot(n, x)) * unit;
            let depth = (along - dot(n, offset)) / dot(n, n).sqrt();
            let worse = least.le(depth);
            least = least.select(worse, depth);
            best = best.select(worse, splat(from as f64));
        }
        let mut columns = [[f64::INFINITY; MAX_LANES]; 2];
        least.store(&mut columns[0]);
        best.store(&mut columns[1]);
        // Of directions as good the first, whatever the number of lanes.
        let lanes = (0..Lanes::<S>::COUNT).map(|lane| (columns[0][lane], columns[1][lane] as usize + lane));
        let (depth, k) = lanes.min_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1))).unwrap_or_default();
        (Vector3::from_fn(|i, _| DIRECTIONS[i][k]).normalize(), depth)
    }
}

#[cfg(test)]
mod tests {
    use super::Scout;
    use crate::measure::frames::query_frame::Pair;
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{Options, WarmStart, penetration};
    use crate::polynomial::dispatch;
    use sublevel_testkit::Seeded;

    /// The depth along the direction it finds is little more than the least of all.
    #[test]
    fn the_best_of_the_samples_is_a_good_start() {
        let zoos: Vec<_> = (0..4).map(|seed| zoo(&mut Seeded(seed))).collect();
        let mut excess = Vec::new();
        for seed in 0..200 {
            let mut random = Seeded(61_000 + seed);
            let bodies = &zoos[seed as usize % 4];
            let (a, b) =
                (&bodies[random.next() as usize % bodies.len()], &bodies[random.next() as usize % bodies.len()]);
            let near = 0.5 * a.circumscribed().radius.min(b.circumscribed().radius);
            let (pose_a, pose_b) = (random_pose(&mut random, 0.1), random_pose(&mut random, near));
            let found = penetration(a, &pose_a, b, &pose_b, &Options::default(), &mut WarmStart::default());
            if found.lower <= 0.0 {
                continue;
            }
            let pair = Pair::new(a, &pose_a, b, &pose_b);
            let (n, depth) = dispatch(Scout { pair: &pair });
            assert!((n.norm() - 1.0).abs() < 1e-12, "seed {seed}");
            excess.push(depth * pair.unit() / found.upper);
        }
        excess.sort_by(f64::total_cmp);
        let at = |share: f64| excess[(share * excess.len() as f64) as usize];
        println!("{} pairs, excess {} {} {} {}", excess.len(), at(0.0), at(0.5), at(0.9), at(0.99));
        assert!(excess.len() >= 100 && at(0.0) > 0.5 && at(0.5) < 1.2 && at(0.9) < 2.0);
    }
}
