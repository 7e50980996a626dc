//! Time of impact of two moving bodies by conservative advancement, never late.
//!
//! For a unit vector n fixed to one of the bodies let `s(t)` be the width of the gap between the
//! planes that n supports the two bodies with; the distance is at least that. If the second
//! derivative of `n·(x - y)` in time is at most M for all points x of A and y of B
//! ([`Motion::acceleration_between`]), then `n·(x - y)` stays above its chord minus `½ M (t -
//! t_0)(t_1 - t)`; and so does the smallest of them,
//!
//! ```text
//! s(t) >= (1 - u) s(t_0) + u s(t_1) - ½ M (t_1 - t_0)² u (1 - u),   t = t_0 + u (t_1 - t_0).
//! ```
//!
//! The bodies are apart up to the first root of the right-hand side. With n the normal of the
//! closest points at t_0 and t_1 where Newton's method expects contact, the bound and the distance
//! agree to first order at t_0, and the advance closes on the contact quadratically, where bounds
//! by the greatest speed close on it by a constant factor (Mirtich 1996). A plane that turns with a
//! body rests on the same face of it all the time; both are tried where one does not get far.

mod advance;
mod answer;
mod options;
mod search;
#[cfg(test)]
mod tests;

use crate::body::Solid;
use crate::measure::frames::motion::Motion;
pub use answer::{Impact, ImpactStatus};
pub use options::{DEFAULT_CONTACT, ImpactOptions, ImpactOptionsError, MAX_QUERIES};
use search::{Moving, Search};

/// First time at which two moving solids come within the contact distance of `options`. The answer
/// is never late.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{ImpactOptions, ImpactStatus, Motion, Pose, time_of_impact};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.05)?;
/// let slab = Body::cuboid("slab", Vector3::new(0.005, 1.0, 1.0))?;
/// let start = Pose::from_quaternion(Vector3::new(-10.055, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let shot = Motion::new(start, Vector3::new(100.0, 0.0, 0.0), Vector3::zeros(), *start.translation())?;
/// let still = Motion::still(Pose::identity());
/// let impact = time_of_impact(&ball, &shot, &slab, &still, &ImpactOptions::new(1.0)?);
/// assert_eq!(impact.status, ImpactStatus::Contact);
/// assert!(impact.time <= 0.1 && impact.time > 0.1 - 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn time_of_impact(
    a: &impl Solid,
    motion_a: &Motion,
    b: &impl Solid,
    motion_b: &Motion,
    options: &ImpactOptions<'_>,
) -> Impact {
    let contact = options.contact * a.circumscribed().radius.min(b.circumscribed().radius);
    let mut first = Impact { status: ImpactStatus::Apart, time: options.duration, distance: None, queries: 0 };
    for part_a in a.parts() {
        for part_b in b.parts() {
            // Later impacts than the first found so far do not count.
            let mut search = Search {
                a: Moving { body: part_a, motion: motion_a },
                b: Moving { body: part_b, motion: motion_b },
                contact,
                options,
                queries: 0,
            };
            let found = search.run(first.time);
            let queries = first.queries + found.queries;
            if found.status != ImpactStatus::Apart {
                first = found;
            }
            first.queries = queries;
        }
    }
    first
}
