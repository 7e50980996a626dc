//! Methods that find answers; what a method finds counts only if a bracket proves it.
//!
//! Continuation from the answer before (`continuation`, with `predictor`, `tangent_newton`,
//! `step_acceleration` on a `two_point_problem`), guesses (`initial_guess`, `support_table_gjk`),
//! Newton's method with active sets (`edge_newton`, `kkt_newton` on the `kkt_system`,
//! `active_set_qp` on `equality_program`s), interior points
//! (`barrier_programs`), and refinement in double-double arithmetic (`refinement`,
//! `double_double`).

pub(super) mod active_constraints;
pub(super) mod active_set_qp;
pub(super) mod barrier_programs;
pub(super) mod common_point;
pub(super) mod continuation;
pub(super) mod convex_root_bracket;
pub(super) mod depth;
pub(super) mod double_double;
pub(super) mod edge_newton;
pub(super) mod equality_program;
pub(super) mod exact_shape;
pub(super) mod initial_guess;
pub(super) mod kkt_newton;
pub(super) mod kkt_system;
pub(super) mod level_continuation;
pub(super) mod level_newton;
pub(super) mod linear_systems;
pub(super) mod min_norm_point;
pub(super) mod predictor;
pub(super) mod projection;
pub(super) mod prospect;
pub(super) mod ray_program;
pub(super) mod refinement;
pub(super) mod stages;
pub(super) mod step_acceleration;
pub(super) mod stop_criterion;
pub(super) mod support_point;
pub(super) mod support_table_gjk;
pub(super) mod tangent_newton;
pub(super) mod two_point_problem;
