//! Pairs of links of a robot in messages.

use super::error::Invalid;
use super::limits::MAX_MESSAGE_BYTES;
use super::packed::Packed;
use super::proto::{self, AllowedPairsProgress, AllowedPairsResult, AllowedPairsTask, DeriveAllowedPairsRequest};
use super::robot_wire::robot_id;
use crate::jobs::{Progress, RequestError, check_derive};
use crate::robot::motion::{DEFAULT_DERIVE_RESOLUTION_M, DEFAULT_MAX_BOXES, PairClass};
use crate::store::{DeriveOutcome, DeriveRequest, DerivedLinkPair, LoadedRobot};

/// Classes of messages and of outcomes.
const CLASSES: [(proto::PairClass, PairClass); 5] = [
    (proto::PairClass::Adjacent, PairClass::Adjacent),
    (proto::PairClass::Never, PairClass::Never),
    (proto::PairClass::Always, PairClass::Always),
    (proto::PairClass::Collides, PairClass::Collides),
    (proto::PairClass::Undecided, PairClass::Undecided),
];

/// The request's id, and the request, checked but for its robot.
pub(super) fn request(message: &DeriveAllowedPairsRequest) -> Result<(String, DeriveRequest), Invalid> {
    let request = DeriveRequest {
        robot: robot_id(&message.robot_id, "robot_id")?,
        margin_m: message.margin_m,
        max_boxes: message.max_boxes.unwrap_or(DEFAULT_MAX_BOXES),
        resolution_m: message.resolution_m.unwrap_or(DEFAULT_DERIVE_RESOLUTION_M),
    };
    let refused = |RequestError { field, why }| Invalid::new(field, why);
    check_derive(&message.request_id, &request).map_err(refused)?;
    Ok((message.request_id.clone(), request))
}

/// Bytes that a pair of links takes in a message at most, but for the names of the links, its
/// witness, and the reason of the SRDF.
const PAIR_BYTES: usize = 64;

/// Bytes of a job that a message has beside its pairs, at most.
const JOB_BYTES: usize = 1024;

/// Refuses a robot whose pairs of links, each with a witness, may fit no message.
pub(super) fn check_size(loaded: &LoadedRobot) -> Result<(), Invalid> {
    let kinematics = loaded.robot.kinematics();
    let with_geometry = kinematics.links().iter().zip(loaded.robot.links()).filter(|(_, link)| link.is_some());
    let (links, name_bytes) = with_geometry.fold((0, 0), |(links, bytes), (name, _)| (links + 1, bytes + name.len()));
    let others = links.max(1) - 1;
    let pairs = links * others / 2 * (PAIR_BYTES + 8 * kinematics.width());
    let reasons: usize = loaded.semantics.disabled_pairs.iter().map(|pair| pair.reason.len()).sum();
    // A link is named by its pairs with all others.
    if pairs + others * name_bytes + reasons > MAX_MESSAGE_BYTES - JOB_BYTES {
        let why = format!(
            "has {links} links with geometry; the names of all pairs, their witnesses and what the SRDF says of them \
             may fit no message"
        );
        return Err(Invalid::new("robot_id", why));
    }
    Ok(())
}

/// The message of a request.
pub(crate) fn message(request: &DeriveRequest) -> DeriveAllowedPairsRequest {
    let DeriveRequest { robot, margin_m, max_boxes, resolution_m } = *request;
    DeriveAllowedPairsRequest {
        request_id: String::new(),
        robot_id: robot.to_string(),
        margin_m,
        max_boxes: Some(max_boxes),
        resolution_m: Some(resolution_m),
    }
}

/// A search as it stands; `progress` is of running ones only.
pub(super) fn task(
    request: &DeriveRequest,
    progress: Option<Progress>,
    outcome: Option<&DeriveOutcome>,
) -> AllowedPairsTask {
    AllowedPairsTask {
        robot_id: request.robot.to_string(),
        margin_m: request.margin_m,
        max_boxes: request.max_boxes,
        resolution_m: request.resolution_m,
        progress: progress
            .map(|progress| AllowedPairsProgress { pairs_begun: progress.rounds, boxes: progress.iterations }),
        result: outcome.map(|DeriveOutcome { pairs, seconds }| AllowedPairsResult {
            pairs: pairs.iter().map(pair_message).collect(),
            duration_s: *seconds,
        }),
    }
}

fn pair_message(pair: &DerivedLinkPair) -> proto::DerivedPair {
    let class = CLASSES.iter().find(|(_, class)| *class == pair.class);
    let mut witness = Packed::default();
    pair.witness.iter().flatten().for_each(|&value| witness.number(value));
    proto::DerivedPair {
        link_a: pair.links[0].clone(),
        link_b: pair.links[1].clone(),
        class: class.map_or(0, |(message, _)| (*message).into()),
        witness: witness.into_bytes(),
        upper_m: pair.upper_m,
        certain: pair.is_certain,
        boxes: pair.boxes,
        srdf_reason: pair.srdf_reason.clone(),
        contradicts_srdf: pair.contradicts_srdf(),
    }
}

/// What a message says that was proven; none where it cannot be read.
pub(crate) fn outcome(result: &AllowedPairsResult) -> Option<DeriveOutcome> {
    let pair = |pair: &proto::DerivedPair| {
        let (_, class) = CLASSES.iter().find(|(message, _)| i32::from(*message) == pair.class)?;
        let (witness, rest) = pair.witness.as_chunks::<8>();
        let witness: Vec<f64> = witness.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        rest.is_empty().then(|| DerivedLinkPair {
            links: [pair.link_a.clone(), pair.link_b.clone()],
            class: *class,
            witness: Some(witness).filter(|witness| !witness.is_empty()),
            upper_m: pair.upper_m,
            is_certain: pair.certain,
            boxes: pair.boxes,
            srdf_reason: pair.srdf_reason.clone(),
        })
    };
    Some(DeriveOutcome { pairs: result.pairs.iter().map(pair).collect::<Option<_>>()?, seconds: result.duration_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_and_outcomes_are_read_back_from_the_wire() {
        let robot = "a7".repeat(32).parse().expect("an id");
        let asked = DeriveRequest { robot, margin_m: -0.01, max_boxes: 7, resolution_m: 1e-4 };
        assert_eq!(request(&message(&asked)).expect("usable"), (String::new(), asked));
        let pair = |(index, (_, class)): (usize, &(proto::PairClass, PairClass))| DerivedLinkPair {
            links: ["base".into(), format!("hand {index}")],
            class: *class,
            witness: (*class != PairClass::Never).then(|| vec![0.1, -0.0, 1e-300]),
            upper_m: Some(-0.25),
            is_certain: index % 2 == 0,
            boxes: 17,
            srdf_reason: (index < 3).then(|| "Never".to_owned()),
        };
        let found = DeriveOutcome { pairs: CLASSES.iter().enumerate().map(pair).collect(), seconds: 0.5 };
        let sent = task(&asked, None, Some(&found));
        assert_eq!(outcome(&sent.result.expect("a result")), Some(found));
    }
}
