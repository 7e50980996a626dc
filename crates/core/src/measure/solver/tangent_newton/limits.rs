//! How many steps Newton's methods take and how long these are, as far as several of them share it.

/// Most evaluations, or steps, from one start before another method takes over.
///
/// Larger, searches that lead nowhere last longer; smaller, more of those that converge slowly are
/// cut off. It changes time only: the stages of `measure/tests/stages/` count what is solved.
pub(in crate::measure) const SEEK_ROUNDS: u32 = 20;

/// Evaluations, or steps, after which Newton's method should be near: from the last answer it
/// should have ended by then, and steps that are still long from elsewhere diverge or lead around
/// in circles.
///
/// Larger, such searches last longer; smaller, some that converge are given up. It changes time
/// only: `continuation_seeks_alone` counts what is solved.
pub(in crate::measure) const PATIENCE: u32 = 8;

/// Most times that a step beside a set with a closed form is made again for another feature of it
/// that the step leads to. It changes time only; no test pins it.
pub(in crate::measure) const FEATURES: usize = 5;

/// How often a step that has led into a set, or too far from a body, is taken back in part. It
/// changes time only; no test pins it.
pub(in crate::measure) const RETREATS: u32 = 6;

/// Longest move for which a linearization in the tangent plane is valid, relative to a body's size,
/// be that in metres or in normalized coordinates; dimensionless. A first step from the last answer
/// that is longer is no continuation.
///
/// Longer, Newton's method diverges from cold starts; shorter, it needs more rounds:
/// `continuation_seeks_alone` counts what it solves within its limit. No larger than a quarter:
/// bounds of curvature hold as far from a body as that.
pub(in crate::measure) const LONGEST_MOVE: f64 = 0.25;

/// Longest step of a single point for which linearizations are valid, in normalized coordinates
/// relative to the body's size there; dimensionless. Twice the move of two points: a set with a
/// closed form needs no linearization, and programs have all constraints and go from edge to edge.
///
/// Longer steps diverge, shorter ones take more rounds. `smooth_bodies_against_shapes`,
/// `active_sets_follow_alone` and `stages_of_level_distances_solve_alone` count what is solved.
pub(in crate::measure) const LONGEST_STEP: f64 = 0.5;

/// Length of a step relative to a body's size, dimensionless, that counts as near: the next is
/// about its square, or of a series, for surfaces are a power of the way there.
///
/// Larger, searches that diverge are kept, and steps far away are lengthened by chance; smaller,
/// some that converge are given up, and flat sides take more steps. `continuation_seeks_alone`
/// counts what is solved; `steps_that_converge_fast_are_newtons` pins series.
pub(in crate::measure) const NEAR: f64 = 0.05;

/// Longest Newton step, relative to the bodies, dimensionless, after which a bracket may be narrow:
/// what remains is about its square.
///
/// Larger, brackets are computed that stay wide; smaller, a step more is taken. It changes time
/// only: `.ci/instructions` pins it.
pub(in crate::measure) const WORTH_A_BRACKET: f64 = 1e-3;

/// Longest step, relative to the bodies or to their longest moves, dimensionless, after which only
/// rounding is left: the next one is about its square.
///
/// A larger value ends brackets too wide, a smaller one spends rounds on rounding. Exercised by
/// `impossible_accuracy_is_admitted` and `continuation_agrees_with_cold_answers_and_is_short`.
pub(in crate::measure) const SETTLED: f64 = 1e-9;

/// Square of a step of a single point in normalized coordinates, relative to the body's size there,
/// dimensionless, after which only rounding is left: 1e-11 of the body.
///
/// A larger value ends brackets too wide, a smaller one spends rounds on rounding. Exercised by
/// `smooth_bodies_against_shapes`.
pub(in crate::measure) const AT_REST_SQUARED: f64 = 1e-22;

/// Curvature times size, dimensionless, that is added where there is none, so that flat sides have
/// a system of full rank.
///
/// It must vanish beside every curvature that matters (1e-16 of rounding); zero leaves parallel
/// sides without a step. Exercised by `boxes_meet_face_edge_and_corner` and `boxes_side_by_side`.
pub(in crate::measure) const FLATTEST: f64 = 1e-20;
