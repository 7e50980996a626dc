//! Numbers and small linear algebra with 200 bits.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;

/// Significant bits: some 60 decimal digits.
const BITS: usize = 200;

/// A binary floating-point number of 200 bits.
pub type Big = FBig<HalfEven, 2>;

/// A point or direction.
pub type Vector = [Big; 3];

/// A number as it is.
///
/// # Panics
/// On NaN and infinities: a reference has no use for them.
pub fn big(x: f64) -> Big {
    Big::try_from(x).expect("a finite number").with_precision(BITS).value()
}

/// The nearest double.
pub fn double(x: &Big) -> f64 {
    x.to_f64().value()
}

/// The numbers of a nalgebra vector.
pub fn vector(v: &nalgebra::Vector3<f64>) -> Vector {
    [big(v.x), big(v.y), big(v.z)]
}

/// The nearest doubles.
pub fn doubles(v: &Vector) -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::from_fn(|i, _| double(&v[i]))
}

/// `|x|`.
pub fn abs(x: &Big) -> Big {
    if *x < Big::ZERO { -x } else { x.clone() }
}

pub fn dot(a: &Vector, b: &Vector) -> Big {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub fn norm(a: &Vector) -> Big {
    let square = dot(a, a);
    if square == Big::ZERO { square } else { square.sqrt() }
}

pub fn add(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] + &b[i])
}

pub fn sub(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] - &b[i])
}

pub fn scaled(a: &Vector, s: &Big) -> Vector {
    std::array::from_fn(|i| &a[i] * s)
}

pub fn cross(a: &Vector, b: &Vector) -> Vector {
    let minor = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Solves `m x = r` by elimination with complete pivoting. What pivots below 1e-50 of the largest
/// cannot determine stays 0: where minimisers are not unique, one of them is found all the same.
pub fn solve(mut m: Vec<Vec<Big>>, mut r: Vec<Big>) -> Vec<Big> {
    let n = r.len();
    let mut column: Vec<usize> = (0..n).collect();
    let mut rank = n;
    let mut first = big(0.0);
    for k in 0..n {
        let mut best = (k, k, big(-1.0));
        for i in k..n {
            for j in k..n {
                let size = abs(&m[i][j]);
                if size > best.2 {
                    best = (i, j, size);
                }
            }
        }
        let (i, j, size) = best;
        if k == 0 {
            first = size.clone();
        }
        if size <= &first * big(1e-50) {
            rank = k;
            break;
        }
        m.swap(k, i);
        r.swap(k, i);
        for row in &mut m {
            row.swap(k, j);
        }
        column.swap(k, j);
        let (above, below) = m.split_at_mut(k + 1);
        let pivot = &above[k];
        for (i, row) in below.iter_mut().enumerate() {
            if row[k] == Big::ZERO {
                continue;
            }
            let factor = &row[k] / &pivot[k];
            for j in k + 1..n {
                if pivot[j] != Big::ZERO {
                    row[j] -= &factor * &pivot[j];
                }
            }
            let step = &factor * &r[k];
            r[k + 1 + i] -= step;
        }
    }
    let mut x = vec![big(0.0); n];
    for k in (0..rank).rev() {
        let mut sum = r[k].clone();
        for j in k + 1..rank {
            sum -= &m[k][j] * &x[column[j]];
        }
        x[column[k]] = sum / &m[k][k];
    }
    x
}

#[test]
fn sixty_digits_are_kept() {
    let third = big(1.0) / big(3.0);
    let off = double(&abs(&(third * big(3.0) - big(1.0))));
    assert!(off < 1e-59, "{off:e}");
    let root = big(2.0).sqrt();
    let off = double(&abs(&(&root * &root - big(2.0))));
    assert!(off < 1e-58, "{off:e}");
}

#[test]
fn linear_systems_are_solved() {
    let m = [[1e-9, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]];
    let x = solve(m.iter().map(|row| row.iter().map(|&e| big(e)).collect()).collect(), vec![big(1.0); 3]);
    for row in m {
        let sum = (0..3).fold(big(-1.0), |sum, j| sum + big(row[j]) * &x[j]);
        assert!(double(&abs(&sum)) < 1e-55);
    }
    // Singular but consistent: any solution.
    let x = solve(vec![vec![big(1.0), big(1.0)], vec![big(2.0), big(2.0)]], vec![big(3.0), big(6.0)]);
    assert!(double(&abs(&(&x[0] + &x[1] - big(3.0)))) < 1e-55);
}
