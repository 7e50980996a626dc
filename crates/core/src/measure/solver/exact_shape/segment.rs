//! The segment of the z axis, which capsules are balls about, and the point.

use super::cuboid::FLATTEST;
use super::projectable::{ON, Offset, Projectable};
use crate::measure::frames::vector::{V3, basis, dot};
use crate::polynomial::Simd;

/// `y_0 = y_1 = 0`, `|y_2| <= half_length`, metres; a point where that is 0.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Segment {
    pub(in crate::measure) half_length: f64,
}

/// Beside the segment.
const SIDE: u8 = 1;

/// Beyond one of its ends.
const END: u8 = 2;

impl Projectable for Segment {
    #[inline(always)]
    fn project<S: Simd>(&self, _: S, x: V3<f64>) -> V3<f64> {
        [0.0, 0.0, x[2].max(-self.half_length).min(self.half_length)]
    }

    #[inline(always)]
    fn offset<S: Simd>(&self, simd: S, x: V3<f64>) -> Offset {
        let nearest = self.project(simd, x);
        let v = [x[0], x[1], x[2] - nearest[2]];
        let distance = dot::<S, f64>(v, v).sqrt();
        let inverse = 1.0 / distance;
        let frame = basis(simd, v);
        let end = v[2] != 0.0 || self.half_length == 0.0;
        // Across the axis alone where the segment is beside.
        let along = |a: V3<f64>, b: V3<f64>| if end { 0.0 } else { a[2] * b[2] * inverse };
        let [t0, t1, _] = frame;
        let curvature = [inverse - along(t0, t0), -along(t0, t1), inverse - along(t1, t1)];
        Offset { distance, frame, curvature, feature: if end { END } else { SIDE } }
    }

    #[inline(always)]
    fn height<S: Simd>(&self, _: S, n: V3<f64>) -> f64 {
        self.half_length * n[2].abs()
    }

    #[inline(always)]
    fn in_normal_cone<S: Simd>(&self, _: S, feature: u8, n: V3<f64>) -> V3<f64> {
        if feature == SIDE {
            let inverse = 1.0 / (n[0] * n[0] + n[1] * n[1]).sqrt();
            [n[0] * inverse, n[1] * inverse, 0.0]
        } else {
            n
        }
    }

    #[inline(always)]
    fn feature_at<S: Simd>(&self, _: S, y: V3<f64>) -> u8 {
        if y[2].abs() >= self.half_length * ON { END } else { SIDE }
    }

    #[inline(always)]
    fn slide<S: Simd>(&self, _: S, y: V3<f64>, pull: V3<f64>) -> f64 {
        let held = y[2].abs() >= self.half_length * ON && y[2] * pull[2] >= 0.0;
        if held { 0.0 } else { pull[2].abs() }
    }

    #[inline(always)]
    fn line<S: Simd>(&self, _: S, feature: u8) -> Option<V3<f64>> {
        (feature == SIDE).then_some([0.0, 0.0, 1.0])
    }

    fn thinnest(&self) -> f64 {
        0.0
    }

    #[inline(always)]
    fn shrunk(&self, by: f64) -> Self {
        Self { half_length: (self.half_length - by).max(0.0) }
    }

    #[inline(always)]
    fn faces_towards<S: Simd>(&self, _: S, _: V3<f64>) -> ([V3<f64>; 3], usize) {
        ([[0.0; 3]; 3], 0)
    }

    #[inline(always)]
    fn least<S: Simd>(&self, simd: S, y: V3<f64>, gradient: V3<f64>, hessian: &[f64; 6]) -> V3<f64> {
        self.project(simd, [0.0, 0.0, y[2] - gradient[2] / hessian[5].max(FLATTEST)])
    }

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.half_length
    }
}
