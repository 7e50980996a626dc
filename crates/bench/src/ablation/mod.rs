//! What is lost without each stage of a search: how many answers are not converged without it, how
//! many brackets would be wrong, and what it saves in iterations and time.

#[cfg(feature = "ablation")]
mod counted;
#[cfg(feature = "ablation")]
mod library;
#[cfg(feature = "ablation")]
mod report;
mod shown;

pub(crate) use shown::Shown;

#[cfg(feature = "ablation")]
pub use counting::{Ablation, ablation};

#[cfg(feature = "ablation")]
mod counting {
    use super::counted::{Others, Table, bodies, draws, families, rescues};
    use crate::Machine;
    use std::ops::ControlFlow;

    /// Most cases of each stability family.
    const CASES: u64 = 700;

    /// What was counted.
    pub struct Ablation {
        pub(super) machine: Machine,
        pub(super) queries: f64,
        /// By the name of the queries.
        pub(super) tables: [(&'static str, Table); 4],
    }

    /// Puts `queries` draws of distances, a tenth as many of other questions, the cases of the
    /// stability families and the named rescues, each with all stages and without each of them.
    /// `progress` receives what is going on and can stop it, which leaves nothing.
    pub fn ablation(queries: f64, progress: &mut dyn FnMut(&str) -> ControlFlow<()>) -> Option<Ablation> {
        let bodies = bodies();
        let [mut distances, mut others, mut of_families, mut of_rescues] = <[Table; 4]>::default();
        let (most, fewer) = (queries as u64, (0.1 * queries) as u64);
        let mut at = |done: u64| progress(&format!("distances: {done} of {most}"));
        let stopped = draws(&mut distances, &bodies, Others::No, (1, most), &mut at).is_break();
        let mut at = |done: u64| progress(&format!("other questions: {done} of {fewer}"));
        if stopped || draws(&mut others, &bodies, Others::Yes, (1, fewer), &mut at).is_break() {
            return None;
        }
        if progress("stability families").is_break() {
            return None;
        }
        families(&mut of_families, CASES.min(fewer));
        rescues(&mut of_rescues);
        let tables = [("draws", distances), ("others", others), ("families", of_families), ("rescues", of_rescues)];
        Some(Ablation { machine: Machine::this(), queries, tables })
    }
}
