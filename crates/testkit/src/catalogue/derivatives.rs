//! Gradients against differences: 20.

use super::{Case, Draws, any_two};
use sublevel_core::body::Body;

/// Signed gaps, relative to the smaller body: far, near, grazing, touching, overlapping.
pub const GAPS: [f64; 14] = [300.0, 10.0, 1.0, 0.1, 1e-2, 1e-4, 1e-6, 1e-8, 0.0, -1e-8, -1e-6, -1e-4, -1e-2, -0.1];

/// How many of the [`GAPS`] are apart.
pub const APART: usize = 8;

/// Family 20. Two bodies 2.5 sizes apart, to be moved to one of the [`GAPS`].
pub fn apart(zoo: &[Body], random: &mut dyn Draws) -> Case {
    let (a, b, sum) = any_two(random, zoo);
    Case::new(a, random.pose(0.3), b, random.pose(2.5 * sum), "apart")
}
