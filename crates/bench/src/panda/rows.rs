//! What was measured: a row for each family of problems and each representation of the links.

use serde::Serialize;

use super::edges::samples;

/// The family of rows over all families.
pub(super) const ALL: &str = "all";

/// The representation of rows of coal.
pub(super) const COAL: &str = "hulls, coal";

/// All that is measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Tables {
    pub(super) states: Vec<StateRow>,
    pub(super) motions: Vec<MotionRow>,
    pub(super) links: Vec<LinkRow>,
    pub(super) meshes: Vec<MeshRow>,
    pub(super) srdf: Vec<SrdfRow>,
}

/// What stands for a link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct LinkRow {
    pub(super) representation: String,
    pub(super) link: String,
    /// Convex parts.
    pub(super) parts: usize,
    /// The largest of the parts.
    pub(super) degree: usize,
    /// How far a part reaches beyond the hull of what it is fitted to, metres; NaN where that is
    /// not known.
    pub(super) gap_m: f64,
}

/// States anywhere against the meshes of the links.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct MeshRow {
    pub(super) representation: String,
    pub(super) states: usize,
    /// Of these proven free among the obstacles, and with self-collision.
    pub(super) free: usize,
    pub(super) free_self: usize,
    /// Of the states, those in which meshes meet.
    pub(super) contacts: usize,
    /// Of those in which meshes meet, the ones that are called free of what they meet.
    pub(super) missed: usize,
}

/// Pairs of links that can touch at all, beside the SRDF.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SrdfRow {
    pub(super) representation: String,
    /// Pairs of links with geometry.
    pub(super) pairs: usize,
    /// Pairs that the SRDF marks as never touching, and those of them that are proven.
    pub(super) never: usize,
    pub(super) proven: usize,
    /// A pair that the SRDF leaves out and that touches, and how far its bodies overlap, metres.
    pub(super) wrong: String,
    pub(super) overlap_m: f64,
    /// Joint values at which it does, radians.
    pub(super) witness: String,
    /// Whether the hulls of the links do so as well.
    pub(super) is_certain: bool,
    /// Boxes of joint values that were looked at.
    pub(super) boxes: u64,
    pub(super) seconds: f64,
}

/// States of the problems of a family. Times are microseconds per state on one thread, medians of
/// the rounds; NaN where something is not measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct StateRow {
    pub(super) family: String,
    pub(super) representation: String,
    /// Convex pieces of all links.
    pub(super) pieces: usize,
    /// Starts and goals, all of which are free.
    pub(super) known: usize,
    /// Of these proven free among the obstacles.
    pub(super) kept: usize,
    /// Of these proven free with self-collision.
    pub(super) kept_self: usize,
    /// States anywhere.
    pub(super) random: usize,
    /// Of these proven free among the obstacles.
    pub(super) random_free: usize,
    /// Of the states anywhere that are proven free, those that coal's hulls call in contact; of
    /// coal its contacts.
    pub(super) contacts: Option<usize>,
    /// Among the obstacles, with no hint from the state before.
    pub(super) cold_us: f64,
    /// Among the obstacles, with hints.
    pub(super) scene_us: f64,
    /// The same, with the poses of the links that move given instead of joint values; coal is
    /// always given poses.
    pub(super) given_us: f64,
    /// With self-collision and hints.
    pub(super) self_us: f64,
    /// Distances of all pairs of a moving link and an obstacle, in states that degree 6 proves
    /// free.
    pub(super) distances_us: f64,
    /// Over gRPC on all cores.
    pub(super) call_us: f64,
    /// The same in process on all cores.
    pub(super) inside_us: f64,
}

/// Motions of the problems of a family: straight edges in joint space that are proven free, at most
/// one per problem. Times are microseconds per edge on one thread.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct MotionRow {
    pub(super) family: String,
    pub(super) representation: String,
    /// From where the edges start.
    pub(super) from: String,
    pub(super) length_rad: f64,
    /// Problems.
    pub(super) problems: usize,
    /// Edges.
    pub(super) free: usize,
    /// Of proofs: mean, median and 99th percentile.
    pub(super) mean_us: f64,
    pub(super) median_us: f64,
    pub(super) p99_us: f64,
    /// Mean number of configurations that a proof looks at.
    pub(super) configurations: f64,
    /// Mean of our own checks of samples at 1/32 rad.
    pub(super) sampled_us: f64,
    /// Mean of coal's checks of as many samples, without self-collision and kinematics.
    pub(super) coal_us: f64,
    /// Mean of proofs that write a certificate, and of its verification.
    pub(super) certified_us: f64,
    pub(super) verify_us: f64,
    /// Median of verification over proof, edge by edge.
    pub(super) verify_part: f64,
    /// Samples of the edges that were checked besides, and those found in contact.
    pub(super) samples: usize,
    pub(super) contacts: usize,
    /// Samples that coal has checked, and those in contact with its hulls; none without coal.
    pub(super) coal_samples: Option<usize>,
    pub(super) coal_contacts: Option<usize>,
}

impl StateRow {
    /// Share of the known-free states that are kept.
    pub(super) fn kept_share(&self) -> f64 {
        self.kept as f64 / self.known as f64
    }

    /// The row over all families of one representation.
    pub(super) fn of_all(rows: &[Self]) -> Option<Self> {
        let first = rows.first()?;
        let sum = |count: fn(&Self) -> usize| rows.iter().map(count).sum();
        // Every problem has as many states.
        let mean = |time: fn(&Self) -> f64| {
            let weight = |row: &&Self| row.known as f64;
            rows.iter().map(|row| weight(&row) * time(row)).sum::<f64>()
                / rows.iter().map(|row| weight(&row)).sum::<f64>()
        };
        Some(Self {
            family: ALL.into(),
            representation: first.representation.clone(),
            pieces: first.pieces,
            known: sum(|row| row.known),
            kept: sum(|row| row.kept),
            kept_self: sum(|row| row.kept_self),
            random: sum(|row| row.random),
            random_free: sum(|row| row.random_free),
            contacts: rows.iter().map(|row| row.contacts).sum(),
            cold_us: mean(|row| row.cold_us),
            scene_us: mean(|row| row.scene_us),
            given_us: mean(|row| row.given_us),
            self_us: mean(|row| row.self_us),
            distances_us: mean(|row| row.distances_us),
            call_us: mean(|row| row.call_us),
            inside_us: mean(|row| row.inside_us),
        })
    }
}

impl MotionRow {
    /// Microseconds per radian that is proven.
    pub(super) fn us_per_rad(&self) -> f64 {
        self.mean_us / self.length_rad
    }

    /// Microseconds of our check of one sample of these edges, a state that is free.
    pub(super) fn sample_us(&self) -> f64 {
        self.sampled_us / samples(self.length_rad) as f64
    }
}
