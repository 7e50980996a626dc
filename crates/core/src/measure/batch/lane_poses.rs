//! Poses of a batch in lanes.

use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::V3;
use crate::polynomial::{Aligned, Simd, Vector};

/// Quaternions of poses (i, j, k and the real part) and their translations from another pose on,
/// metres in the world frame.
#[inline(always)]
pub(super) fn lane_poses<S: Simd, N: Vector<S>, const LANES: usize>(
    simd: S,
    poses: &[Pose],
    indices: &[usize; LANES],
    from: &Pose,
) -> ([N; 4], V3<N>) {
    let mut columns = Aligned([[0.0; LANES]; 7]);
    for lane in 0..N::COUNT {
        let pose = &poses[indices[lane]];
        let q = &pose.rotation().coords;
        // Differences of translations are exact to one rounding, however far from the world origin.
        let t = pose.translation() - from.translation();
        for (column, entry) in columns.0.iter_mut().zip([q.x, q.y, q.z, q.w, t.x, t.y, t.z]) {
            column[lane] = entry;
        }
    }
    let column = |i: usize| N::load(simd, &columns.0[i]);
    ([column(0), column(1), column(2), column(3)], [column(4), column(5), column(6)])
}
