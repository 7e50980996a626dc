//! How deep two bodies overlap: the best direction (`local_search`, from `direction_sampling`), and
//! the proof that no other is better (`sweep`, over `sphere_branch_and_bound`).

pub(in crate::measure) mod local_search;
pub(in crate::measure) mod sweep;

mod direction_sampling;
mod sphere_branch_and_bound;
