//! Volume by quadrature over rays that may enter and leave the set several times.

use crate::body::{Ball, Normalization, Volume, fibonacci_lattice};
use crate::polynomial::{Chords, Polynomial};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Rays, of which the estimate of the error takes half.
const VOLUME_RAYS: usize = 20_000;

/// The volume, `⅓ ∫ Σ (to³ - from³) du / |det L|` over the chords of rays from the centre of
/// `ball`, which contains the set; and the middle of the longest chord, metres, if there is a
/// chord.
///
/// Where rays graze the set the integrand is not smooth, so that rules which rest on smoothness are
/// no better than any other, and worse where many rays of a ring graze it at once: the rays follow
/// a Fibonacci lattice, of equal weights.
pub(super) fn measure(
    polynomial: &Polynomial,
    normalization: &Normalization,
    inverse: &Matrix3<f64>,
    ball: &Ball,
) -> (Volume, Option<Vector3<f64>>) {
    let start = normalization.linear * (ball.center - normalization.center);
    let chords = Chords::new(polynomial, &start);
    let mut longest = (0.0, None);
    let mut rule = |rays: usize| {
        let mut sum = 0.0;
        for u in fibonacci_lattice(rays) {
            let metres = (inverse * u).norm();
            // A chord may come in pieces; the last one is kept open until the next does not adjoin
            // it.
            let mut open = (0.0, 0.0);
            let mut close = |(from, to): (f64, f64)| {
                if (to - from) * metres > longest.0 {
                    longest = ((to - from) * metres, Some(inverse * (u * (0.5 * (from + to))) + ball.center));
                }
            };
            chords.along(&u, ball.radius / metres, &mut |from, to| {
                sum += (to - from) * (to * to + to * from + from * from);
                open = if from == open.1 {
                    (open.0, to)
                } else {
                    close(open);
                    (from, to)
                };
            });
            close(open);
        }
        // A third of the cubes' mean times the area of the sphere.
        sum * (4.0 * PI / 3.0 / rays as f64) * inverse.determinant().abs()
    };
    let (fine, coarse) = (rule(VOLUME_RAYS), rule(VOLUME_RAYS / 2));
    (Volume { volume_m3: fine, error_m3: (fine - coarse).abs() }, longest.1)
}
