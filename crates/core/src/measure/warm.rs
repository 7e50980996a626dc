//! Warm starts: what one answer gives the next query of the same pair.

use crate::body::Body;
use crate::measure::frames::query_frame::Pair;
use crate::measure::other_parts::OtherParts;
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::continuation::Trace;
use crate::measure::solver::edge_newton::{EdgeShapeTrace, EdgeTrace};
use crate::measure::solver::exact_shape::ExactTrace;
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::level_continuation::LevelTrace;
use nalgebra::Vector3;

/// A caller-owned hint from an earlier answer, for the next query of the same pair and measure in
/// the same order; [`WarmStart::default`] is a cold start.
///
/// It may change the time a query takes, never its answer beyond the bracket: a hint of another
/// pair, of a pose far away, or of nonsense does not prove a narrow bracket, and the solve starts
/// cold. Copying it forks a trajectory.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance};
///
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 2.0))?;
/// let mut warm = WarmStart::default();
/// for step in 0..10 {
///     let x = 5.0 - 0.1 * f64::from(step);
///     let pose = Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
///     let answer = distance(&egg, &Pose::identity(), &egg, &pose, &Options::default(), &mut warm);
///     assert!((answer.value() - (x - 2.0)).abs() < 1e-8);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct WarmStart {
    pub(super) hint: Hint,
    /// Which parts of the two solids it is about.
    pub(super) parts: (u16, u16),
    /// What is known of all other pairs of parts.
    pub(super) others: Option<OtherParts>,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Hint {
    #[default]
    Cold,
    /// As little, but that continuation from where the bodies face each other has diverged.
    Diverged,
    /// Witnesses in the frames of their own bodies, normal in A's frame.
    Apart { x_a: Vector3<f64>, y_b: Vector3<f64>, normal_a: Vector3<f64>, active_a: ActiveSet, active_b: ActiveSet },
    /// Witnesses on smooth parts of both surfaces, with how they answer motions.
    Smooth(Trace),
    /// Witnesses of bodies of several constraints, with what is active there.
    Edges(EdgeTrace),
    /// Nearest point of a body of several constraints to one with a closed form, with what is
    /// active there.
    EdgeShape(EdgeShapeTrace),
    /// Nearest point of a smooth body to one with a closed form.
    Exact(ExactTrace),
    /// Of two bodies with closed forms, the point of A that is nearest to B or in it, in A's frame.
    Shapes { x_a: Vector3<f64> },
    /// A common point in A's frame.
    Overlap { point_a: Vector3<f64> },
    /// Minimiser of a level distance on smooth parts of both bodies, with how it answers motions.
    LevelSmooth(LevelTrace),
    /// The interior point of the first body of a level distance lay in the second.
    Saturated,
    /// Minimiser of a level distance in B's frame.
    Level { x_b: Vector3<f64>, active_a: ActiveSet, active_b: ActiveSet },
    /// Witness of a single body in its frame.
    Single { y: Vector3<f64>, active: ActiveSet },
}

impl WarmStart {
    pub(super) fn is_cold(&self) -> bool {
        matches!(self.hint, Hint::Cold)
    }
}

impl Hint {
    /// A hint of witnesses x of A and y of B with the normal, in the query frame, and what is
    /// active there.
    pub(super) fn apart(pair: &Pair<'_>, [x, y, n]: [&Vector3<f64>; 3], (a, b): &(Active, Active)) -> Self {
        let (active_a, active_b) = (a.bits(), b.bits());
        Self::Apart { x_a: pair.to_a(x), y_b: pair.to_b(y), normal_a: *n, active_a, active_b }
    }

    /// Witnesses of the last answer, each in its body's frame, metres.
    pub(super) fn witnesses(&self, a: &Body, b: &Body) -> Option<[Vector3<f64>; 2]> {
        let [x, y] = match self {
            Self::Apart { x_a, y_b, .. } => return Some([*x_a, *y_b]),
            Self::Smooth(trace) => trace.points(),
            Self::Edges(trace) => trace.points(),
            _ => return None,
        };
        Some([a.normalization().center + Vector3::from(x), b.normalization().center + Vector3::from(y)])
    }

    /// Unit normal of the last answer, from B to A, in A's frame.
    pub(super) fn normal_a(&self) -> Option<Vector3<f64>> {
        match self {
            Self::Apart { normal_a, .. } => Some(*normal_a),
            Self::Smooth(trace) => Some(trace.normal_a()),
            Self::Edges(trace) => Some(trace.normal_a()),
            _ => None,
        }
    }
}
