//! The direction along which two cylinders at an angle overlap least.
//!
//! Along a unit vector n they overlap by
//!
//! ```text
//! f(n) = Σ (r |n × a| + h |n · a|) - n · t,
//! ```
//!
//! summed over both, a the axis, r the radius, h the half height, t from the centre of the first to
//! that of the second. f is least in one of four kinds of places ([`candidates`]):
//!
//! - along an axis, across a cap, where `r |n × a|` has a kink;
//! - on the circle across an axis, along the wall, where `h |n · a|` has one;
//! - at the pole, across both axes, where both circles meet;
//! - elsewhere, where a rim touches a rim and f is smooth.
//!
//! No place is less by more than rounding: that is proven by branch and bound over spherical
//! triangles ([`branch_and_bound`]), with bounds by the curvature of the difference of the
//! cylinders ([`direction`]).

mod branch_and_bound;
mod candidates;
mod direction;
mod pair;

use self::candidates::Candidates;
pub(super) use self::pair::CrossedCylinders;
use super::cuboid_axes::LeastOverlap;
use nalgebra::Vector3;

impl CrossedCylinders {
    /// The direction from the first to the second, in the frame of the first, along which they
    /// overlap least; none where it is not known to 1e-7. Directions at an angle with a cosine
    /// below `elsewhere` are others.
    pub(super) fn least_overlap(&self, elsewhere: f64) -> Option<LeastOverlap> {
        let mut candidates = Candidates::new(self);
        let proven = self.branch_and_bound(&mut candidates);
        candidates.choose(self, elsewhere);
        let best = candidates.best().direction;
        let upper = best.overlap + self.error;
        let n = (self.frame * best.n).into();
        if upper < 0.0 {
            return Some(LeastOverlap { lower: f64::NEG_INFINITY, upper, n, elsewhere: f64::INFINITY });
        }
        let proven = proven?;
        let is_known = best.overlap - proven <= 3.0 * self.error && self.is_aligned(candidates.best());
        let elsewhere = self.elsewhere(&candidates, elsewhere);
        is_known.then_some(LeastOverlap { lower: proven - 2.0 * self.error, upper, n, elsewhere })
    }

    /// The least overlap known along directions elsewhere, metres: candidates, what is symmetric to
    /// them, and where the cone of what is not elsewhere ends.
    fn elsewhere(&self, candidates: &Candidates, elsewhere: f64) -> f64 {
        let n = &candidates.best().direction.n;
        let e = self.flattest(candidates.best());
        let f = n.cross(&e);
        let sine = (1.0 - elsewhere * elsewhere).sqrt();
        let around = [e, f, -e, -f].map(|tangent| n * elsewhere + tangent * sine);
        let symmetric = |m: Vector3<f64>| {
            let mirrored = Vector3::new(m.x, m.y, -m.z);
            [m, mirrored, -m, -mirrored]
        };
        let all = candidates.iter().flat_map(|candidate| symmetric(candidate.direction.n));
        let others = all.filter(|m| m.dot(n) < elsewhere).chain(around);
        others.map(|m| self.along(m).overlap).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::candidates::Place;
    use super::direction::tangents;
    use super::*;
    use sublevel_testkit::Seeded;

    /// Two cylinders, the first along z.
    struct Pair {
        sizes: [[f64; 2]; 2],
        axes: [Vector3<f64>; 2],
        between: Vector3<f64>,
    }

    impl Pair {
        /// By the definition.
        fn overlap(&self, n: &Vector3<f64>) -> f64 {
            let [radii, heights] = self.sizes;
            let of = |i: usize| radii[i] * n.cross(&self.axes[i]).norm() + heights[i] * n.dot(&self.axes[i]).abs();
            of(0) + of(1) - n.dot(&self.between)
        }

        /// The point of the difference farthest along n.
        fn farthest(&self, n: &Vector3<f64>) -> Vector3<f64> {
            let [radii, heights] = self.sizes;
            let of = |i: usize| {
                let along = n.dot(&self.axes[i]);
                let radial = (n - self.axes[i] * along).normalize();
                let radial = radial - self.axes[i] * self.axes[i].dot(&radial);
                self.axes[i] * heights[i].copysign(along) + radial * radii[i]
            };
            of(0) + of(1)
        }

        /// Deep inside, just inside of a random place of the surface, in a plane of symmetry or on
        /// it; a sixth at right angles, a fifth nearly parallel, some as thick as each other.
        fn random(seed: u64) -> Self {
            let mut random = Seeded(seed);
            let mut size = || 0.1 * 20_f64.powf(random.positive());
            let mut sizes = [[size(), size()], [size(), size()]];
            if seed.is_multiple_of(13) {
                sizes[0][1] = sizes[0][0];
            }
            let mut axis = random.unit();
            if seed % 6 == 1 {
                axis = Vector3::new(axis.x, axis.y, 0.0).normalize();
            } else if seed.is_multiple_of(5) {
                axis = (Vector3::z() + axis * 10_f64.powf(-8.0 * random.positive())).normalize();
            }
            let mut pair = Self { sizes, axes: [Vector3::z(), axis], between: Vector3::zeros() };
            let deep = sizes.iter().flatten().sum::<f64>() * random.positive() * 0.5;
            let n = random.unit();
            pair.between = match seed % 4 {
                0 => pair.farthest(&n) * (1.0 - 10_f64.powf(-4.0 * random.positive())),
                1 => pair.farthest(&n) - n * deep * 10_f64.powf(-3.0 * random.positive()),
                2 => n * deep,
                _ => Vector3::new(n.x, 0.0, n.z) * deep * f64::from(u8::from(!seed.is_multiple_of(7))),
            };
            pair
        }

        fn crossed(&self) -> CrossedCylinders {
            CrossedCylinders::new(self.sizes, (self.axes[1], self.between), (1e-15, 0.0))
        }
    }

    /// The least found by a search that knows of no kinks: the best of random directions, then of
    /// random steps that become shorter.
    fn brute_force(pair: &Pair, random: &mut Seeded) -> f64 {
        let mut best = (f64::INFINITY, Vector3::z());
        let attempt = |n: Vector3<f64>, best: &mut (f64, Vector3<f64>)| {
            let overlap = pair.overlap(&n);
            let is_better = overlap < best.0;
            if is_better {
                *best = (overlap, n);
            }
            is_better
        };
        for _ in 0..4000 {
            attempt(random.unit(), &mut best);
        }
        let mut step = 0.1;
        while step > 1e-7 {
            let better = (0..20).any(|_| attempt((best.1 + random.unit() * step).normalize(), &mut best));
            step *= if better { 1.5 } else { 0.5 };
        }
        best.0
    }

    #[test]
    fn no_direction_overlaps_by_less() {
        let (mut met, mut open, mut apart, mut ties) = ([0; 4], 0, 0, [0; 2]);
        for seed in 0..4000 {
            let pair = Pair::random(seed);
            let crossed = pair.crossed();
            let Some(found) = crossed.least_overlap(0.99) else {
                open += 1;
                continue;
            };
            let label = format!("seed {seed}: {found:?}");
            let n = Vector3::from(found.n);
            assert!((n.norm() - 1.0).abs() < 1e-14, "{label}");
            assert!((pair.overlap(&n) - found.upper).abs() <= 2.0 * crossed.error(), "{label}");
            if found.upper < 0.0 {
                apart += 1;
                continue;
            }
            assert!(found.upper - found.lower <= 8.0 * crossed.error(), "{label}");
            assert!(found.elsewhere >= found.lower, "{label}");
            // Ties around the normal are seen, whatever the direction of the valley.
            let (e, f) = tangents(&n);
            let cone = (0..90).map(|i| {
                let turn = std::f64::consts::TAU * f64::from(i) / 90.0;
                pair.overlap(&(n * 0.99 + (e * turn.cos() + f * turn.sin()) * (1.0_f64 - 0.99 * 0.99).sqrt()))
            });
            if cone.fold(f64::INFINITY, f64::min) < found.upper * 1.01 {
                ties[usize::from(found.elsewhere > found.upper * 1.02)] += 1;
            }
            let least = brute_force(&pair, &mut Seeded(seed));
            assert!(found.lower <= least, "{label} against {least:e}");
            let mut candidates = Candidates::new(&crossed);
            crossed.branch_and_bound(&mut candidates);
            met[match candidates.best().place {
                Place::Axis(_) => 0,
                Place::Circle(_) => 1,
                Place::Pole => 2,
                Place::Rims => 3,
            }] += 1;
        }
        println!("axes, circles, pole, rims: {met:?}, open {open}, apart {apart}, ties seen, missed {ties:?}");
        assert!(10 * ties[1] <= ties[0], "{ties:?}");
        assert!(met.iter().all(|count| *count > 200), "{met:?}");
        assert!(open < 400, "{open}");
    }

    /// From just inside of a place of the surface, that is the nearest one, and its normal is the
    /// direction, also where rims are all but a wall or a cap, and where sizes differ.
    #[test]
    fn normals_are_those_of_the_surface() {
        let (mut known, mut open) = (0, 0);
        for seed in 0..6000 {
            let mut random = Seeded(40_000 + seed);
            let mut pair = Pair::random(4 * seed + 1);
            for size in pair.sizes.iter_mut().flatten() {
                *size *= 10_f64.powf(-2.0 * random.positive() * f64::from(u8::from(seed % 3 == 0)));
            }
            let tilt = 10_f64.powf(-8.0 + 5.0 * random.positive()) * 1_f64.copysign(random.signed());
            let axis = pair.axes[random.index(2)];
            let tangent = (random.unit() - axis).cross(&axis).normalize();
            let n = match seed % 4 {
                0 => random.unit(),
                1 => (axis + tangent * tilt).normalize(),
                _ => (tangent + axis * tilt).normalize(),
            };
            let thin = pair.sizes.iter().flatten().fold(f64::INFINITY, |least, size| least.min(*size));
            let depth = 1e-3 * thin;
            pair.between = pair.farthest(&n) - n * depth;
            let Some(found) = pair.crossed().least_overlap(0.99) else {
                open += 1;
                continue;
            };
            let label = format!("seed {seed}, {n:?} {depth:e}: {found:?}");
            let error = pair.crossed().error();
            assert!(found.lower <= depth + error && found.upper >= 0.0, "{label}");
            if found.upper < depth - error || found.elsewhere < depth + 1e-6 * depth {
                continue;
            }
            known += 1;
            // At a kink the normal of the place may be any up to the one that is found.
            assert!((Vector3::from(found.n) - n).norm() <= 2e-7, "{label}");
        }
        println!("known {known}, open {open}");
        assert!(known > 2000, "{known}");
    }

    /// Where a mirror image overlaps by as much, it is known as a direction elsewhere.
    #[test]
    fn what_is_symmetric_is_elsewhere() {
        for seed in 0..400 {
            let pair = Pair { between: Vector3::zeros(), ..Pair::random(4 * seed + 2) };
            let Some(found) = pair.crossed().least_overlap(0.99) else { continue };
            assert!((found.elsewhere - found.upper).abs() <= 4.0 * pair.crossed().error(), "seed {seed}: {found:?}");
        }
    }

    /// f at random directions within an angle is at least the bound that is given for it.
    #[test]
    fn bounds_hold_up_to_their_angle() {
        let mut tight = 0;
        for seed in 0..4000 {
            let pair = Pair::random(seed).crossed();
            let mut random = Seeded(50_000 + seed);
            let direction = pair.along(random.unit());
            let angle = 10_f64.powf(-2.0 * random.positive());
            let bound = pair.bound(&direction, [angle.cos(), angle.sin()]);
            let (e, f) = tangents(&direction.n);
            for _ in 0..50 {
                let (turn, share) = (std::f64::consts::TAU * random.positive(), angle * random.positive().sqrt());
                let tangent = e * turn.cos() + f * turn.sin();
                let n = direction.n * share.cos() + tangent * share.sin();
                let overlap = pair.along(n).overlap;
                assert!(overlap >= bound - pair.error, "seed {seed}: {overlap:e} below {bound:e}");
                tight += u32::from(overlap <= bound + 0.01 * direction.overlap.abs());
            }
        }
        assert!(tight > 100, "{tight}");
    }

    /// f at random directions in the cap about a candidate is at least its bound.
    #[test]
    fn caps_hold_up_to_their_angle() {
        let mut met = [0; 4];
        for seed in 0..2000 {
            let pair = Pair::random(seed).crossed();
            let mut random = Seeded(60_000 + seed);
            let mut candidates = Candidates::new(&pair);
            pair.branch_and_bound(&mut candidates);
            for candidate in candidates.iter() {
                let Some(cap) = pair.cap(&candidate.direction, candidate.place) else { continue };
                met[match candidate.place {
                    Place::Axis(_) => 0,
                    Place::Circle(_) => 1,
                    Place::Pole => 2,
                    Place::Rims => 3,
                }] += 1;
                let n = candidate.direction.n;
                let (e, f) = tangents(&n);
                for _ in 0..50 {
                    let (turn, share) =
                        (std::f64::consts::TAU * random.positive(), cap.cosine.acos() * random.positive().sqrt());
                    let overlap = pair.along(n * share.cos() + (e * turn.cos() + f * turn.sin()) * share.sin()).overlap;
                    assert!(overlap >= cap.lower - pair.error, "seed {seed}: {overlap:e}, {candidate:?} {cap:?}");
                }
            }
        }
        println!("{met:?}");
        assert!(met.iter().all(|count| *count > 100), "{met:?}");
    }
}
