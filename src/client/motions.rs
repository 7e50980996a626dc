//! Motions of robots: whole paths.

use super::columns::{index_pairs, name, number};
use super::connection::Client;
use super::error::ClientError;
use crate::measure::Pose;
use crate::scene::query::StateVerdict;
use crate::service::answer_wire;
use crate::service::packed::Packed;
use crate::service::proto::{CheckMotionsRequest, MovingObjects};

/// Many motions of one robot.
#[derive(Clone, Debug, Default)]
pub struct MotionsQuestion {
    request: CheckMotionsRequest,
    values: Packed,
    counts: Packed,
}

impl MotionsQuestion {
    /// Motions that set joints of a robot of the scene: those that are named, or all in the order
    /// of joint vectors. The others are as in the scene.
    pub fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>) -> Self {
        let joints = joints.into_iter().map(Into::into).collect();
        let request = CheckMotionsRequest { robot: robot.into(), joints, ..CheckMotionsRequest::default() };
        Self { request, ..Self::default() }
    }

    /// Adds a path through configurations, each the values of the joints in their order: radians,
    /// metres, unit quaternions.
    #[must_use]
    pub fn with_path<'a>(mut self, configurations: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut count = 0;
        for configuration in configurations {
            configuration.iter().for_each(|&value| self.values.number(value));
            count += 1;
        }
        self.counts.index(count);
        self
    }

    /// Adds the edges of a path one by one: from each configuration straight to the next.
    #[must_use]
    pub fn with_edges<Configuration: AsRef<[f64]>>(self, path: &[Configuration]) -> Self {
        path.windows(2).fold(self, |question, edge| question.with_path(edge.iter().map(AsRef::as_ref)))
    }

    /// A pair is in contact below this margin and its padding, metres.
    #[must_use]
    pub fn with_margin(mut self, margin_m: f64) -> Self {
        self.request.margin_m = margin_m;
        self
    }

    /// While objects that nothing holds move by themselves, each from the first pose to the second:
    /// along a line at a constant velocity, turning at a constant rate by the smaller angle. What
    /// they hold moves along.
    #[must_use]
    pub fn with_moving<'a>(mut self, moving: impl IntoIterator<Item = (&'a str, [Pose; 2])>) -> Self {
        self.request.moving = Some(moving_objects(moving));
        self
    }

    /// With certificates of the paths that are free.
    #[must_use]
    pub fn with_certificates(mut self) -> Self {
        self.request.certificates = true;
        self
    }

    fn asked(self, scene: &str) -> CheckMotionsRequest {
        let (joint_values, point_counts) = (self.values.into_bytes(), self.counts.into_bytes());
        CheckMotionsRequest { scene: scene.into(), joint_values, point_counts, ..self.request }
    }

    /// The request without its paths, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut CheckMotionsRequest {
        &mut self.request
    }
}

/// What is proven of one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedMotion {
    /// Whether it is free.
    pub verdict: StateVerdict,
    /// It is proven free up to this path parameter.
    pub alpha: f64,
    /// All pairs keep at least this signed distance less their padding as far as that, metres; NaN
    /// where nothing is proven.
    pub clearance_lower_m: f64,
    /// Of a contact, or of what is open: the two objects, and the path parameter at which it was
    /// seen.
    pub contact: Option<([String; 2], f64)>,
    /// Of a contact, the first pair before it that is not decided at the resolution, and the path
    /// parameter at which it was seen: `alpha` ends there.
    pub open: Option<([String; 2], f64)>,
    /// JSON text; none unless it was asked for and the motion is free.
    pub certificate: Option<String>,
    /// Of a motion that is invalid: the configuration that is wrong, counted over all motions of
    /// the question, why, and the remedy.
    pub reason: Option<String>,
}

/// Verdicts of motions.
#[derive(Clone, Debug)]
pub struct CheckedMotions {
    /// Revision all of them are true of.
    pub revision: u64,
    /// One per path.
    pub motions: Vec<CheckedMotion>,
    /// Whether every path was decided as far as its resolution.
    pub complete: bool,
}

impl CheckedMotions {
    /// Whether every path is proven free.
    pub fn are_free(&self) -> bool {
        self.verdicts().iter().all(|verdict| *verdict == StateVerdict::Free)
    }

    /// The verdicts, one per path.
    pub fn verdicts(&self) -> Vec<StateVerdict> {
        self.motions.iter().map(|motion| motion.verdict).collect()
    }
}

impl Client {
    /// Asks whether motions of a robot are free: whole paths, not samples.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn check_motions(&self, scene: &str, question: MotionsQuestion) -> Result<CheckedMotions, ClientError> {
        let response = self.queries().check_motions(question.asked(scene)).await.map_err(self.refused())?.into_inner();
        let verdicts = answer_wire::verdicts(&response.verdicts)?;
        let table = &response.objects;
        let named = |[a, b]: [u32; 2]| Some([name(table, a)?, name(table, b)?]);
        let pairs = index_pairs(&response.pairs).map(named);
        let open: Vec<_> = index_pairs(&response.open_pairs).map(named).collect();
        let text = |texts: &[String], row: usize| texts.get(row).filter(|text| !text.is_empty()).cloned();
        let rows = verdicts.into_iter().zip(pairs).enumerate().map(|(row, (verdict, pair))| CheckedMotion {
            verdict,
            alpha: number(&response.alpha, row),
            clearance_lower_m: number(&response.clearance_lower_m, row),
            contact: pair.map(|pair| (pair, number(&response.contact_s, row))),
            open: open.get(row).cloned().flatten().map(|pair| (pair, number(&response.open_s, row))),
            certificate: text(&response.certificates, row),
            reason: text(&response.reasons, row),
        });
        let motions: Vec<_> = rows.collect();
        if motions.len() != response.verdicts.len() {
            return Err(ClientError::Unexpected("another number of pairs than of paths"));
        }
        Ok(CheckedMotions { revision: response.scene_revision, motions, complete: response.complete })
    }
}

/// Objects, each with where it begins and ends.
pub(super) fn moving_objects<'a>(moving: impl IntoIterator<Item = (&'a str, [Pose; 2])>) -> MovingObjects {
    let (mut names, mut starts, mut ends) = (Vec::new(), Packed::default(), Packed::default());
    for (name, [start, end]) in moving {
        names.push(name.into());
        starts.pose(&start);
        ends.pose(&end);
    }
    MovingObjects { names, start_poses: starts.into_bytes(), end_poses: ends.into_bytes() }
}
