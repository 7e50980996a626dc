//! The calls of the protocol, and the role that each needs.

use super::tokens::Role;

/// The role that each call needs.
const CALLS: [(&str, Role); 38] = [
    ("BlobService/DownloadBlob", Role::Read),
    ("BlobService/UploadBlob", Role::Write),
    ("BodyService/CreateBody", Role::Write),
    ("BodyService/DeleteBody", Role::Write),
    ("BodyService/GetBody", Role::Read),
    ("BodyService/GetBodyMesh", Role::Read),
    ("BodyService/ListBodies", Role::Read),
    ("FitService/CreateFit", Role::Write),
    ("HierarchyService/CreateHierarchySolve", Role::Write),
    ("JobService/CancelJob", Role::Write),
    ("JobService/GetJob", Role::Read),
    ("JobService/ListJobs", Role::Read),
    ("JobService/WatchJob", Role::Read),
    ("QueryService/CastRays", Role::Read),
    ("QueryService/CheckMotions", Role::Read),
    ("QueryService/CheckStates", Role::Read),
    ("QueryService/Clearance", Role::Read),
    ("QueryService/Evaluate", Role::Read),
    ("QueryService/EvaluateStream", Role::Read),
    ("QueryService/Explain", Role::Read),
    ("QueryService/VerifyMotion", Role::Read),
    ("QueryService/Watch", Role::Read),
    ("RobotService/DeleteRobot", Role::Write),
    ("RobotService/DeriveAllowedPairs", Role::Write),
    ("RobotService/GetRobot", Role::Read),
    ("RobotService/ListRobots", Role::Read),
    ("RobotService/LoadRobot", Role::Write),
    ("SceneService/CommitFork", Role::Write),
    ("SceneService/CreateScene", Role::Write),
    ("SceneService/DeleteScene", Role::Write),
    ("SceneService/ForkScene", Role::Write),
    ("SceneService/GetScene", Role::Read),
    ("SceneService/ListScenes", Role::Read),
    ("SceneService/StreamPoses", Role::Write),
    ("SceneService/UpdateScene", Role::Write),
    ("SceneService/WatchScene", Role::Read),
    ("ServerService/Backup", Role::Admin),
    ("ServerService/GetServerInfo", Role::Read),
];

/// What the paths of [`CALLS`] begin with.
const PACKAGE: &str = "/sublevel.v1.";

/// The role that a call needs. What is no call of ours, such as reflection, reads at most.
pub(super) fn needed(path: &str) -> Role {
    let Some(call) = path.strip_prefix(PACKAGE) else { return Role::Read };
    CALLS.iter().find(|(name, _)| *name == call).map_or(Role::Admin, |(_, role)| *role)
}

/// Calls whose messages come one after the other for as long as somebody likes.
const STREAMS: [&str; 6] = [
    "JobService/WatchJob",
    "QueryService/EvaluateStream",
    "QueryService/Watch",
    "SceneService/StreamPoses",
    "SceneService/WatchScene",
    "ServerService/Backup",
];

/// Whether messages of a call may come long after its beginning; what is no call of ours may be.
pub(super) fn is_stream(path: &str) -> bool {
    let call = path.strip_prefix(PACKAGE);
    call.is_none_or(|call| STREAMS.contains(&call))
}

/// What a call is counted under: one name for all that are none of ours, which may be anything.
pub(super) fn label(path: &str) -> &'static str {
    let known = path.strip_prefix(PACKAGE).and_then(|call| CALLS.iter().find(|(name, _)| *name == call));
    known.map_or("other", |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::proto::FILE_DESCRIPTOR_SET;
    use prost::Message;
    use prost_types::FileDescriptorSet;

    #[test]
    fn every_call_has_a_role() {
        let files = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).expect("descriptors").file;
        let ours = files.iter().filter(|file| file.package() == "sublevel.v1");
        let mut calls: Vec<String> = ours
            .clone()
            .flat_map(|file| &file.service)
            .flat_map(|service| service.method.iter().map(|method| format!("{}/{}", service.name(), method.name())))
            .collect();
        calls.sort();
        let streams = ours.clone().flat_map(|file| &file.service).flat_map(|service| {
            let streams = service.method.iter().filter(|method| method.client_streaming() || method.server_streaming());
            streams.map(|method| format!("/sublevel.v1.{}/{}", service.name(), method.name()))
        });
        let mut streams: Vec<_> = streams.collect();
        streams.sort();
        assert_eq!(streams, STREAMS.map(|call| format!("{PACKAGE}{call}")));
        assert!(!is_stream("/sublevel.v1.QueryService/Evaluate"));
        assert_eq!(CALLS.map(|(call, _)| call.to_owned()).to_vec(), calls);
        assert_eq!(needed("/sublevel.v1.SceneService/UpdateScene"), Role::Write);
        assert_eq!(needed("/sublevel.v1.SceneService/Unknown"), Role::Admin);
        assert_eq!(label("/sublevel.v1.QueryService/Evaluate"), "QueryService/Evaluate");
        assert_eq!(label("/grpc.health.v1.Health/Check"), "other");
        assert_eq!(needed("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo"), Role::Read);
    }
}
