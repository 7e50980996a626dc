//! Where rays from one point run through `{p <= 1}`: chords, found from the Bernstein form of p
//! along each ray.
//!
//! A polynomial on an interval lies between the least and the largest of its Bernstein
//! coefficients, and has no more roots there than these change sign. Halving the interval (de
//! Casteljau) leaves pieces that are inside, outside, or have a single crossing. Nothing is asked
//! of the shape of the set.

use super::dense::{Dense, dense, shift};
use super::{Exponents, Polynomial, monomials};
use nalgebra::Vector3;

/// Halvings after which a piece counts as what it is in its middle: p touches 1 there, or nearly.
const MAX_CHORD_DEPTH: usize = 40;

/// A polynomial about a point, ready to be followed along rays from there.
#[derive(Clone, Debug)]
pub struct Chords {
    /// Per degree j: exponents and coefficients of the terms of p of that degree about the point.
    parts: Vec<Vec<(Exponents, f64)>>,
    /// Bernstein coefficient i of `t^j` on [0, 1]: `C(i, j) / C(degree, j)`.
    conversion: Vec<Vec<f64>>,
}

impl Chords {
    /// Of rays from `start`.
    pub fn new(polynomial: &Polynomial, start: &Vector3<f64>) -> Self {
        let degree = polynomial.degree();
        let mut here: Dense = dense(polynomial.terms());
        for axis in 0..3 {
            shift(&mut here, degree, start[axis], axis);
        }
        let mut parts = vec![Vec::new(); degree + 1];
        for e in monomials(degree) {
            let [a, b, c] = e.map(usize::from);
            parts[a + b + c].push((e, here[a][b][c]));
        }
        let choose = |n: usize, k: usize| (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64);
        let entry = |i: usize, j: usize| if j <= i { choose(i, j) / choose(degree, j) } else { 0.0 };
        let conversion = (0..=degree).map(|i| (0..=degree).map(|j| entry(i, j)).collect()).collect();
        Self { parts, conversion }
    }

    /// Calls `chord(from, to)` for the pieces `start + r direction`, `from <= r <= to`, of the ray
    /// up to r = `reach` where p is at most 1, in their order; adjoining pieces come one by one.
    pub fn along(&self, direction: &Vector3<f64>, reach: f64, chord: &mut impl FnMut(f64, f64)) {
        let degree = self.parts.len() - 1;
        let scaled = direction * reach;
        let mut powers = [[1.0; 3]; 9];
        for e in 1..=degree {
            for i in 0..3 {
                powers[e][i] = powers[e - 1][i] * scaled[i];
            }
        }
        let value = |e: &Exponents| (0..3).map(|i| powers[usize::from(e[i])][i]).product::<f64>();
        let mut line = [0.0; 9];
        for (coefficient, part) in line.iter_mut().zip(&self.parts) {
            *coefficient = part.iter().map(|(e, c)| c * value(e)).sum();
        }
        line[0] -= 1.0;
        let mut control = [0.0; 9];
        for (target, row) in control.iter_mut().zip(&self.conversion) {
            *target = row.iter().zip(&line).map(|(w, c)| w * c).sum();
        }
        inside(&mut control[..=degree], (0.0, reach), MAX_CHORD_DEPTH, chord);
    }
}

/// Pieces of the interval where the polynomial with these Bernstein coefficients is at most 0.
fn inside(control: &mut [f64], (from, to): (f64, f64), depth: usize, chord: &mut impl FnMut(f64, f64)) {
    let above = control.iter().filter(|&&b| b > 0.0).count();
    if above == 0 {
        return chord(from, to);
    }
    let changes = control.windows(2).filter(|pair| (pair[0] > 0.0) != (pair[1] > 0.0)).count();
    if above == control.len() {
        return;
    }
    if changes == 1 {
        let crossing = from + (to - from) * crossing(control);
        return if control[0] > 0.0 { chord(crossing, to) } else { chord(from, crossing) };
    }
    let mut left = [0.0; 9];
    halve(control, &mut left[..control.len()]);
    let middle = 0.5 * (from + to);
    if depth == 0 {
        if control[0] <= 0.0 {
            chord(from, to);
        }
        return;
    }
    inside(&mut left[..control.len()], (from, middle), depth - 1, chord);
    inside(control, (middle, to), depth - 1, chord);
}

/// Splits Bernstein coefficients into those of the first half, in `left`, and those of the second,
/// in place.
pub(super) fn halve(control: &mut [f64], left: &mut [f64]) {
    let n = control.len();
    for k in 0..n {
        left[k] = control[0];
        for i in 0..n - 1 - k {
            control[i] = 0.5 * (control[i] + control[i + 1]);
        }
    }
}

/// The only root in [0, 1] of a polynomial whose Bernstein coefficients change sign once: bisection
/// made safe by the signs at the ends, sped up by Newton's method.
fn crossing(control: &[f64]) -> f64 {
    let rising = control[0] <= 0.0;
    let (mut low, mut high, mut t) = (0.0, 1.0, 0.5);
    for _ in 0..100 {
        let (value, slope) = value_and_slope(control, t);
        if (value > 0.0) == rising {
            high = t;
        } else {
            low = t;
        }
        let newton = t - value / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - t).abs() <= 1e-15 || high - low <= 1e-15 {
            return next;
        }
        t = next;
    }
    t
}

/// De Casteljau's scheme at t.
fn value_and_slope(control: &[f64], t: f64) -> (f64, f64) {
    let n = control.len() - 1;
    let mut row = [0.0; 9];
    row[..=n].copy_from_slice(control);
    for k in (2..=n).rev() {
        for i in 0..k {
            row[i] += t * (row[i + 1] - row[i]);
        }
    }
    (row[0] + t * (row[1] - row[0]), n as f64 * (row[1] - row[0]))
}

#[cfg(test)]
mod tests {
    use super::Chords;
    use crate::polynomial::{Exponents, Polynomial, monomials};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// `1 + Π (x - root)` along x, plus y² + z²: below 1 between roots.
    fn with_roots(roots: &[f64]) -> Polynomial {
        let mut line = vec![1.0];
        for root in roots {
            let mut next = vec![0.0; line.len() + 1];
            for (k, c) in line.iter().enumerate() {
                next[k + 1] += c;
                next[k] -= root * c;
            }
            line = next;
        }
        line[0] += 1.0;
        let mut terms: Vec<(Exponents, f64)> = line.iter().enumerate().map(|(k, &c)| ([k as u8, 0, 0], c)).collect();
        terms.extend([([0, 2, 0], 1.0), ([0, 0, 2], 1.0)]);
        Polynomial::new(terms).unwrap()
    }

    fn chords(p: &Polynomial, start: Vector3<f64>, direction: Vector3<f64>, reach: f64) -> Vec<(f64, f64)> {
        let mut found: Vec<(f64, f64)> = Vec::new();
        Chords::new(p, &start).along(&direction, reach, &mut |from, to| match found.last_mut() {
            Some(last) if from - last.1 < 1e-12 => last.1 = to,
            _ => found.push((from, to)),
        });
        found
    }

    #[test]
    fn all_crossings_are_found_also_close_ones() {
        for roots in [
            vec![0.5_f64, 1.0],
            vec![0.1, 0.2, 0.7, 0.9],
            vec![-1.0, 0.3, 0.4, 0.5, 1.5, 2.0],
            vec![0.1, 0.15, 0.6, 0.600_001, 1.1, 1.2, 1.7, 1.9],
            vec![-3.0, -2.0, -1.0, -0.5],
        ] {
            let expected: Vec<(f64, f64)> = roots
                .chunks(2)
                .map(|pair| (pair[0].max(0.0), pair[1].clamp(0.0, 3.0)))
                .filter(|(from, to)| from < to)
                .collect();
            let found = chords(&with_roots(&roots), Vector3::zeros(), Vector3::x(), 3.0);
            assert_eq!(found.len(), expected.len(), "{roots:?}: {found:?}");
            for (a, b) in found.iter().zip(&expected) {
                assert!((a.0 - b.0).abs() < 1e-7 && (a.1 - b.1).abs() < 1e-7, "{roots:?}: {found:?}");
            }
        }
    }

    #[test]
    fn a_double_root_is_met_with_a_chord_of_no_length_or_none() {
        for roots in [vec![0.7, 0.7], vec![0.2, 0.5, 0.7, 0.7], vec![1.0 / 3.0; 6]] {
            let length: f64 = chords(&with_roots(&roots), Vector3::zeros(), Vector3::x(), 2.0)
                .iter()
                .map(|(from, to)| to - from)
                .filter(|length| *length < 0.1)
                .sum();
            // Of order 2k: rounding moves roots by its 2k-th root.
            assert!(length < 1e-2 && (roots.len() > 4 || length < 1e-6), "{roots:?}: {length}");
        }
    }

    #[test]
    fn dense_sampling_agrees() {
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            let p =
                Polynomial::new(monomials(degree).into_iter().map(|e| (e, 3.0 * random.signed())).collect()).unwrap();
            let start = Vector3::from_fn(|_, _| random.signed());
            let direction = Vector3::from_fn(|_, _| random.signed()).normalize();
            let found = chords(&p, start, direction, 2.0);
            for k in 0..2000 {
                let r = 2.0 * (f64::from(k) + 0.5) / 2000.0;
                let value = p.evaluate(&(start + direction * r)).value;
                let inside = found.iter().any(|(from, to)| (*from..=*to).contains(&r));
                assert!(inside == (value <= 1.0) || (value - 1.0).abs() < 1e-9, "seed {seed}, r {r}: {value}");
            }
        }
    }
}
