//! Between messages and solves of the hierarchy.

use super::super::error::Invalid;
use super::super::proto::{
    self, CreateHierarchySolveRequest, HierarchyProgress, HierarchyResult, HierarchySet as SetMessage, HierarchyTask,
};
use super::super::wire::{body_id, count, pose, pose_message};
use crate::jobs::{Progress, RequestError, check_solve};
use crate::measure::Pose;
use crate::store::{HierarchyMeasure, HierarchyOutcome, HierarchyRequest, HierarchySet};

/// Where the bodies are in a CreateHierarchySolve call.
pub(in crate::service) const BODIES: [&str; 2] = ["a.body_id", "b.body_id"];

/// Measures of messages and of requests.
const MEASURES: [(proto::HierarchyMeasure, HierarchyMeasure); 2] = [
    (proto::HierarchyMeasure::Distance, HierarchyMeasure::Distance),
    (proto::HierarchyMeasure::LevelDistanceAOnB, HierarchyMeasure::LevelAOnB),
];

/// The request's id, and the request, checked but for its bodies.
pub(super) fn request(message: &CreateHierarchySolveRequest) -> Result<(String, HierarchyRequest), Invalid> {
    let CreateHierarchySolveRequest { request_id, a, b, measure, level } = message;
    let sets = [set(a.as_ref(), "a")?, set(b.as_ref(), "b")?];
    let level = usize::try_from(level.unwrap_or(0)).unwrap_or(usize::MAX);
    let request = HierarchyRequest { measure: read_measure(*measure)?, sets, level };
    check_solve(request_id, &request).map_err(refused)?;
    Ok((request_id.clone(), request))
}

/// A field of a request as the path of the message's field.
pub(super) fn refused(RequestError { field, why }: RequestError) -> Invalid {
    let path = match field {
        "a" => BODIES[0],
        "b" => BODIES[1],
        field => field,
    };
    Invalid::new(path, why)
}

fn set(message: Option<&SetMessage>, field: &str) -> Result<HierarchySet, Invalid> {
    let message = message.ok_or_else(|| Invalid::new(field, "is missing; name a body"))?;
    let body = body_id(&message.body_id, &format!("{field}.body_id"))?;
    let pose = match &message.pose {
        None => Pose::identity(),
        sent => pose(sent.as_ref(), &format!("{field}.pose"))?,
    };
    Ok(HierarchySet { body, pose })
}

fn read_measure(number: i32) -> Result<HierarchyMeasure, Invalid> {
    if number == i32::from(proto::HierarchyMeasure::Unspecified) {
        return Ok(HierarchyMeasure::default());
    }
    let known = MEASURES.iter().find(|(message, _)| i32::from(*message) == number).map(|(_, measure)| *measure);
    known.ok_or_else(|| Invalid::new("measure", "is none that this server knows"))
}

/// The message of a request.
pub(crate) fn message(request: &HierarchyRequest) -> CreateHierarchySolveRequest {
    let [a, b] = request.sets.map(|set| Some(set_message(&set)));
    let (measure, level) = (measure_number(request.measure), Some(count(request.level)));
    CreateHierarchySolveRequest { request_id: String::new(), a, b, measure, level }
}

fn set_message(HierarchySet { body, pose }: &HierarchySet) -> SetMessage {
    SetMessage { body_id: body.to_string(), pose: Some(pose_message(pose)) }
}

fn measure_number(measure: HierarchyMeasure) -> i32 {
    MEASURES.iter().find(|(_, known)| *known == measure).map_or(0, |(message, _)| (*message).into())
}

/// A solve as it stands; `progress` is of running ones only.
pub(in crate::service) fn task(
    request: &HierarchyRequest,
    progress: Option<Progress>,
    outcome: Option<&HierarchyOutcome>,
) -> HierarchyTask {
    let [a, b] = request.sets.map(|set| Some(set_message(&set)));
    HierarchyTask {
        a,
        b,
        measure: measure_number(request.measure),
        level: count(request.level),
        progress: progress.map(|progress| HierarchyProgress { iterations: progress.iterations }),
        result: outcome.map(result),
    }
}

fn result(outcome: &HierarchyOutcome) -> HierarchyResult {
    let point = |index: usize| {
        let points = outcome.points_m?;
        let [x, y, z] = points[index];
        Some(proto::Vector3 { x, y, z })
    };
    HierarchyResult {
        lower: outcome.lower,
        upper: outcome.upper,
        point_a_m: point(0),
        point_b_m: point(1),
        is_exact: outcome.is_exact,
        iterations: outcome.iterations as u64,
        duration_s: outcome.seconds,
    }
}

/// What a message says that a solve has found.
pub(crate) fn outcome(result: &HierarchyResult) -> HierarchyOutcome {
    let point = |point: &proto::Vector3| [point.x, point.y, point.z];
    let points_m = result.point_a_m.as_ref().zip(result.point_b_m.as_ref());
    HierarchyOutcome {
        lower: result.lower,
        upper: result.upper,
        points_m: points_m.map(|(a, b)| [point(a), point(b)]),
        is_exact: result.is_exact,
        iterations: usize::try_from(result.iterations).unwrap_or(usize::MAX),
        seconds: result.duration_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_and_outcomes_are_read_back_from_the_wire() {
        let pose = Pose::from_quaternion([0.1, -1e-300, 1.0 / 3.0].into(), [0.6, 0.0, 0.8, 0.0]).expect("a pose");
        let set = |digit: &str, pose| HierarchySet { body: digit.repeat(64).parse().expect("an id"), pose };
        let sets = [set("a", pose), set("7", Pose::identity())];
        for (level, measure) in [(0, MEASURES[0].1), (1, MEASURES[1].1), (2, MEASURES[1].1)] {
            let asked = HierarchyRequest { measure, sets, level };
            assert_eq!(request(&message(&asked)).expect("usable"), (String::new(), asked));
            let sent = task(&asked, None, None);
            assert_eq!((&sent.a, &sent.b, sent.level), (&message(&asked).a, &message(&asked).b, level as u32));
        }
        let found = HierarchyOutcome {
            lower: 0.1,
            upper: Some(0.25),
            points_m: Some([[1.0, -0.0, 1e-300], [0.1, 0.2, 0.3]]),
            is_exact: false,
            iterations: 17,
            seconds: 0.5,
        };
        for found in [found, HierarchyOutcome { upper: None, points_m: None, is_exact: true, ..found }] {
            assert_eq!(outcome(&result(&found)), found);
        }
    }
}
