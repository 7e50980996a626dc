//! The highest value of a polynomial on a triangle, bounded by its Bernstein form there.
//!
//! On the triangle `v0 + s (v1 - v0) + t (v2 - v0)` a polynomial of degree n is `Σ b_ij B_ij(s, t)`
//! with the Bernstein polynomials `B_ij = n!/(i! j! k!) s^i t^j (1 - s - t)^k`, k = n - i - j,
//! which are nowhere negative and add up to 1: no value exceeds the largest `b_ij`, and those of
//! the corners are attained. Halving the triangle (de Casteljau) brings the two together
//! quadratically (Farin, Triangular Bernstein-Bézier patches, CAGD 3, 1986).

use super::ray_intervals::halve;
use super::{Polynomial, gamma};
use nalgebra::Vector3;
use std::collections::BinaryHeap;

/// Halvings of a triangle before the bound is left as it is.
const HALVINGS: usize = 2000;

/// Largest depth of halvings: the bound covers their rounding up to there.
const MAX_TRIANGLE_DEPTH: usize = 60;

/// Difference of a bound above the level from the value found at which the search for it ends; in
/// values of the polynomial, relative to 1.
///
/// It decides only how closely a triangle that reaches outside is reported. A larger value reports
/// larger peaks than there are; a smaller one takes more halvings. Pinned by
/// `no_sample_exceeds_the_bound_and_the_bound_is_close`.
const PEAK_ACCURACY: f64 = 1e-3;

/// Roundings into a coefficient: up to 4 for each of at most 24 steps of the Horner schemes, 60 for
/// the Bernstein form, one for each of at most 8 averages in every halving; some to spare.
const BERNSTEIN_ROUNDINGS: usize = 200 + 8 * MAX_TRIANGLE_DEPTH;

/// How high a polynomial reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// A value that is attained, up to rounding.
    pub attained: f64,
    /// Proven upper bound of all values.
    pub most: f64,
}

/// Coefficients `[i][j]`, i + j <= degree, of a function on a triangle.
type Net = [[f64; 9]; 9];

/// A triangle, its Bernstein coefficients, and the largest of these.
struct Patch {
    net: Net,
    most: f64,
    /// Barycentric places of the corners v0 (s = t = 0), v1 (s = 1) and v2 (t = 1), all but v0's
    /// share.
    corners: [[f64; 2]; 3],
    depth: usize,
}

impl PartialEq for Patch {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Patch {}

impl PartialOrd for Patch {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Patch {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.most.total_cmp(&other.most)
    }
}

impl Polynomial {
    /// How high the polynomial reaches on the triangle with these corners, and within `distance`
    /// (each coordinate) of it.
    ///
    /// The proven bound is as tight as it takes to be on one side of `level`, or within a
    /// thousandth of the highest value found.
    pub fn peak(&self, corners: &[Vector3<f64>; 3], distance: f64, level: f64) -> Peak {
        peak(self, corners, distance, level)
    }
}

/// See [`Polynomial::peak`].
fn peak(p: &Polynomial, corners: &[Vector3<f64>; 3], distance: f64, level: f64) -> Peak {
    let degree = p.degree();
    let [v0, v1, v2] = corners;
    let (e1, e2) = (v1 - v0, v2 - v0);
    // What rounds is a sum of products of absolute values, at most |p| where all coordinates are as
    // large as this.
    let reach = (v0.abs() + e1.abs() + e2.abs()).amax() * (1.0 + 4.0 * f64::EPSILON) + distance;
    let (magnitude, slope) = p.absolute.magnitude(reach);
    let slack = (gamma(BERNSTEIN_ROUNDINGS) * magnitude + slope * distance) * (1.0 + 1e-13);
    let gram = [e1, e2].map(|a| [e1, e2].map(|b| a.dot(&b)));

    let first =
        Patch::new(bernstein(&on_triangle(p, v0, &e1, &e2), degree), degree, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0);
    let mut attained = first.at_corners(degree);
    let mut heap = BinaryHeap::from([first]);
    for _ in 0..HALVINGS {
        let Some(highest) = heap.peek() else { break };
        let most = highest.most + slack;
        let decided = most <= level || attained > level && most - attained <= PEAK_ACCURACY * attained.abs().max(1.0);
        // A NaN is never decided, but halving does not mend it.
        if decided || highest.depth == MAX_TRIANGLE_DEPTH || most.is_nan() {
            break;
        }
        let Some(patch) = heap.pop() else { break };
        for half in patch.halves(degree, &gram) {
            attained = attained.max(half.at_corners(degree));
            heap.push(half);
        }
    }
    Peak { attained, most: heap.peek().map_or(f64::INFINITY, |patch| patch.most + slack) }
}

impl Patch {
    fn new(net: Net, degree: usize, corners: [[f64; 2]; 3], depth: usize) -> Self {
        let most = (0..=degree).flat_map(|i| &net[i][..=degree - i]);
        Self { net, most: largest(most.copied()), corners, depth }
    }

    fn at_corners(&self, degree: usize) -> f64 {
        self.net[0][0].max(self.net[degree][0]).max(self.net[0][degree])
    }

    /// The two halves by the longest edge; `gram` are the products of the edges of the first
    /// triangle.
    fn halves(self, degree: usize, gram: &[[f64; 2]; 2]) -> [Self; 2] {
        let square = |a: usize, b: usize| {
            let d: [f64; 2] = std::array::from_fn(|i| self.corners[b][i] - self.corners[a][i]);
            d[0] * d[0] * gram[0][0] + 2.0 * d[0] * d[1] * gram[0][1] + d[1] * d[1] * gram[1][1]
        };
        let lengths = [square(0, 1), square(1, 2), square(2, 0)];
        let longest = (0..3).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(0);
        let Self { mut net, mut corners, depth, .. } = self;
        for _ in 0..longest {
            net = turned(&net, degree);
            corners.rotate_left(1);
        }
        // Along the edge from v0 to v1 every row of equal j is a polynomial of one variable.
        let (mut near, mut far) = ([[0.0; 9]; 9], [[0.0; 9]; 9]);
        for j in 0..=degree {
            let count = degree - j + 1;
            let (mut row, mut left) = ([0.0; 9], [0.0; 9]);
            for i in 0..count {
                row[i] = net[i][j];
            }
            halve(&mut row[..count], &mut left[..count]);
            for i in 0..count {
                near[i][j] = left[i];
                far[i][j] = row[i];
            }
        }
        let [c0, c1, c2] = corners;
        let middle = std::array::from_fn(|i| 0.5 * (c0[i] + c1[i]));
        [Self::new(near, degree, [c0, middle, c2], depth + 1), Self::new(far, degree, [middle, c1, c2], depth + 1)]
    }
}

/// Largest of the values; NaN if any is NaN.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, |most, value| if value.is_nan() || value > most { value } else { most })
}

/// The net with its corners renamed: v1, v2, v0 become v0, v1, v2.
fn turned(net: &Net, degree: usize) -> Net {
    let mut result = [[0.0; 9]; 9];
    for i in 0..=degree {
        for j in 0..=degree - i {
            // i belongs to the new v1, which was v2, j to the new v2, which was v0, and the rest to
            // what was v1.
            result[i][j] = net[degree - i - j][i];
        }
    }
    result
}

/// Coefficients of `s^i t^j` of `p(v0 + s e1 + t e2)`: nested Horner schemes in x, y and z, each a
/// polynomial of s and t.
fn on_triangle(p: &Polynomial, v0: &Vector3<f64>, e1: &Vector3<f64>, e2: &Vector3<f64>) -> Net {
    let degree = p.degree();
    let all = super::dense::dense(p.terms());
    let mut outer = [[0.0; 9]; 9];
    for c in (0..=degree).rev() {
        let mut middle = [[0.0; 9]; 9];
        for b in (0..=degree - c).rev() {
            let mut inner = [[0.0; 9]; 9];
            for a in (0..=degree - b - c).rev() {
                inner = times(&inner, degree - b - c - a, [v0.x, e1.x, e2.x]);
                inner[0][0] += all[a][b][c];
            }
            middle = times(&middle, degree - c - b, [v0.y, e1.y, e2.y]);
            add(&mut middle, &inner, degree - c - b);
        }
        outer = times(&outer, degree - c, [v0.z, e1.z, e2.z]);
        add(&mut outer, &middle, degree - c);
    }
    outer
}

/// A polynomial of degree below `degree` times `constant + s along_s + t along_t`.
fn times(net: &Net, degree: usize, [constant, along_s, along_t]: [f64; 3]) -> Net {
    let mut product = [[0.0; 9]; 9];
    for i in 0..=degree {
        for j in 0..=degree - i {
            let mut sum = constant * net[i][j];
            if i > 0 {
                sum += along_s * net[i - 1][j];
            }
            if j > 0 {
                sum += along_t * net[i][j - 1];
            }
            product[i][j] = sum;
        }
    }
    product
}

fn add(sum: &mut Net, other: &Net, degree: usize) {
    for i in 0..=degree {
        for j in 0..=degree - i {
            sum[i][j] += other[i][j];
        }
    }
}

/// Bernstein coefficients from those of powers: that of `s^a t^b` at (i, j) is
/// `i!/(i - a)! · j!/(j - b)! · (n - a - b)!/n!`, at most 1.
fn bernstein(powers: &Net, n: usize) -> Net {
    let falling = |i: usize, a: usize| ((i + 1 - a)..=i).map(|k| k as f64).product::<f64>();
    let mut net = [[0.0; 9]; 9];
    for i in 0..=n {
        for j in 0..=n - i {
            for a in 0..=i {
                for b in 0..=j {
                    net[i][j] += powers[a][b] * (falling(i, a) * falling(j, b) / falling(n, a + b));
                }
            }
        }
    }
    net
}

#[cfg(test)]
mod tests {
    use super::{Peak, bernstein, on_triangle};
    use crate::polynomial::{Polynomial, monomials};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    fn random(seed: u64) -> (Polynomial, [Vector3<f64>; 3], Seeded) {
        let mut random = Seeded(seed);
        let degree = [2, 4, 6, 8][(seed % 4) as usize];
        let terms = monomials(degree).into_iter().map(|e| (e, random.signed())).collect();
        let size = 10_f64.powf(random.signed());
        let corners = std::array::from_fn(|_| Vector3::from_fn(|_, _| size * random.signed()));
        (Polynomial::new(terms).unwrap(), corners, random)
    }

    #[test]
    fn the_bernstein_form_is_the_polynomial() {
        for seed in 0..40 {
            let (p, [v0, v1, v2], mut random) = random(seed);
            let n = p.degree();
            let net = bernstein(&on_triangle(&p, &v0, &(v1 - v0), &(v2 - v0)), n);
            let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
            for _ in 0..20 {
                let (s, t) = (random.signed().abs(), random.signed().abs());
                let mut sum = 0.0;
                for i in 0..=n {
                    for j in 0..=n - i {
                        let k = n - i - j;
                        let share = factorial(n) / (factorial(i) * factorial(j) * factorial(k));
                        sum += net[i][j] * share * s.powi(i as i32) * t.powi(j as i32) * (1.0 - s - t).powi(k as i32);
                    }
                }
                let value = p.evaluate(&(v0 + (v1 - v0) * s + (v2 - v0) * t)).value;
                assert!(
                    (sum - value).abs() < 1e-8 * (1.0 + net.as_flattened().iter().fold(0.0, |m, b| b.abs().max(m)))
                );
            }
        }
    }

    #[test]
    fn no_sample_exceeds_the_bound_and_the_bound_is_close() {
        for seed in 0..200 {
            let (p, [v0, v1, v2], mut random) = random(seed);
            let highest = (0..3000)
                .map(|_| {
                    let (s, t) = (random.signed().abs(), random.signed().abs());
                    let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                    p.evaluate(&(v0 + (v1 - v0) * s + (v2 - v0) * t)).value
                })
                .fold(f64::NEG_INFINITY, f64::max);
            let rounding = 1e-12 * highest.abs().max(1.0);
            // Below the level as soon as that is sure, above it closely.
            for level in [highest - 1.0, highest + 0.01, highest + 10.0] {
                let Peak { attained, most } = p.peak(&[v0, v1, v2], 0.0, level);
                assert!(most >= highest - rounding && most >= attained - rounding, "seed {seed}");
                if level < highest {
                    assert!(most - attained <= 1.1e-3 * attained.abs().max(1.0), "seed {seed}: {attained} {most}");
                }
                if level >= highest + 0.01 {
                    // Random samples may miss the very top.
                    assert!(most <= level || attained > highest, "seed {seed}: {most} {highest}");
                }
            }
        }
    }

    #[test]
    fn a_triangle_that_touches_the_level_from_below_is_not_lost() {
        // |z|² on a triangle inscribed in the circle of radius 1 - 1e-10.
        let p = Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)]).unwrap();
        let corners = [0.0_f64, 2.0, 4.0].map(|a| Vector3::new(a.cos(), a.sin(), 0.0) * (1.0 - 1e-10));
        assert!(p.peak(&corners, 1e-16, 1.0).most <= 1.0);
        let grown = corners.map(|v| v * (1.0 + 2e-10));
        assert!(p.peak(&grown, 1e-16, 1.0).most > 1.0);
    }
}
