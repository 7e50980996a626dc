//! Poses of a batch in lanes.

use crate::measure::frames::pose::Pose;
use crate::measure::frames::quaternion::splat_quaternion;
use crate::measure::frames::vector::V3;
use crate::polynomial::{Aligned, Simd, Vector};

/// The pose of an answer: a single one stands for all.
#[inline(always)]
pub(super) fn pose_of(poses: &[Pose], answer: usize) -> &Pose {
    if let [all] = poses { all } else { &poses[answer] }
}

/// Quaternions of the poses of some answers: i, j, k and the real part.
#[inline(always)]
pub(super) fn lane_rotations<S: Simd, N: Vector<S>, const LANES: usize>(
    simd: S,
    poses: &[Pose],
    answers: &[usize; LANES],
) -> [N; 4] {
    if let [all] = poses {
        return splat_quaternion(simd, all.rotation());
    }
    let mut columns = Aligned([[0.0; LANES]; 4]);
    for lane in 0..N::COUNT {
        let q = &poses[answers[lane]].rotation().coords;
        for (column, entry) in columns.0.iter_mut().zip([q.x, q.y, q.z, q.w]) {
            column[lane] = entry;
        }
    }
    let column = |i: usize| N::load(simd, &columns.0[i]);
    [column(0), column(1), column(2), column(3)]
}

/// Translations of the poses of some answers from those of others on, metres in the world frame.
#[inline(always)]
pub(super) fn lane_translations<S: Simd, N: Vector<S>, const LANES: usize>(
    simd: S,
    poses: &[Pose],
    from: &[Pose],
    answers: &[usize; LANES],
) -> V3<N> {
    let mut columns = Aligned([[0.0; LANES]; 3]);
    for lane in 0..N::COUNT {
        let answer = answers[lane];
        // Differences of translations are exact to one rounding, however far from the world origin.
        let t = pose_of(poses, answer).translation() - pose_of(from, answer).translation();
        for (column, entry) in columns.0.iter_mut().zip([t.x, t.y, t.z]) {
            column[lane] = entry;
        }
    }
    let column = |i: usize| N::load(simd, &columns.0[i]);
    [column(0), column(1), column(2)]
}
