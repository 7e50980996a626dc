//! The page of reasons shows what the server sends.

use std::io;

use crate::scene::LadderError;

use super::*;

const BODY: &str = "60903b1c9cd58c912cb5106f9bc4cc15b9299ab45865fac4be3fafe00281829d";
const OTHER: &str = "07de18983f8b3f7d52e1b243892fa3af09e205092408c6f18b5aaaae620b4fef";
const ROBOT: &str = "1f0e3dad99908345f7439f8ffabdffc4b2f1a1d5d2b6b1d8f5a9d4c3e2f1a0b9";
const OTHER_ROBOT: &str = "2f0e3dad99908345f7439f8ffabdffc4b2f1a1d5d2b6b1d8f5a9d4c3e2f1a0b9";

fn of_store(error: StoreError) -> Status {
    catalogue(&error.into(), "scene")
}

fn of_scene(error: SceneError) -> Status {
    catalogue(&error.into(), "scene")
}

/// One refusal of each reason, in the words of the page.
fn example(reason: Reason) -> Status {
    let (body, robot) = (BODY.parse().expect("an id"), ROBOT.parse().expect("an id"));
    let at = |list, index| Entry { list, index, part: Part::Subject };
    match reason {
        Reason::InvalidField => Invalid::new("pairs[0]", "pairs an object with itself; name two").into(),
        Reason::SceneNotFound => catalogue(&CatalogueError::NoScene("nowhere".into()), "scene"),
        Reason::ObjectNotFound => of_scene(SceneError::NoObject { at: at(List::Poses, 2), name: "crate".into() }),
        Reason::BodyNotFound => catalogue(&CatalogueError::NoBody(body), "id"),
        Reason::RobotNotFound => of_scene(SceneError::NoRobot { at: at(List::Joints, 0), name: "arm".into() }),
        Reason::JobNotFound => catalogue(&CatalogueError::NoJob("17".into()), "id"),
        Reason::BlobNotFound => {
            let why =
                format!("no complete blob {OTHER}; upload it with UploadBlob, or again if it was idle for ten minutes");
            not_found(reason, OTHER, "points.points_blob_id", why)
        }
        Reason::RevisionMismatch => of_scene(SceneError::Revision { expected: 7, current: 9 }),
        Reason::ParentChanged => {
            let error = CatalogueError::ParentChanged { fork: "plan".into(), expected: 7, current: 9 };
            catalogue(&error, "fork")
        }
        Reason::SceneChanged => {
            let why = "objects came or went since the page before; begin again with an empty page_token";
            aborted(reason, "page_token", why, 9)
        }
        Reason::LimitExceeded => at_most("pairs", 200_000, ("max_answers", 1 << 17)).expect_err("too many"),
        Reason::Overloaded => shed(Duration::from_secs(5)),
        Reason::TokenMissing => unauthenticated(false),
        Reason::TokenUnknown => unauthenticated(true),
        Reason::RoleNeeded => permission_denied("/sublevel.v1.SceneService/CreateScene", "cell", Role::Write),
        Reason::BodyInUse => {
            let error = CatalogueError::BodyUsed { id: body, scene: "kitchen".into(), object: "chair".into() };
            catalogue(&error, "id")
        }
        Reason::RobotInUse => {
            let error = CatalogueError::RobotUsed { id: robot, scene: "cell".into(), robot: "arm".into() };
            catalogue(&error, "id")
        }
        Reason::SceneExists => catalogue(&CatalogueError::SceneExists("cell".into()), "name"),
        Reason::SceneFull => {
            of_scene(SceneError::Full { what: "objects", count: (1 << 17) + 1, limit: crate::scene::MAX_OBJECTS })
        }
        Reason::ObjectHolds => of_scene(SceneError::Holds { name: "tray".into(), held: "cup".into() }),
        Reason::NotAFork => catalogue(&CatalogueError::NoFork("cell".into()), "fork"),
        Reason::ParentGone => {
            catalogue(&CatalogueError::NoParent { fork: "plan".into(), parent: "cell".into() }, "fork")
        }
        Reason::RungWithoutPoints => catalogue(&LadderError::Points(1).into(), "body"),
        Reason::NoSurface => no_surface(BODY),
        Reason::QueueFull => catalogue(&CatalogueError::QueueFull, "job"),
        Reason::RequestIdUsed => {
            catalogue(&CatalogueError::RequestUsed { request_id: "fit-7".into(), job: 17 }, "request_id")
        }
        Reason::DiskFull => {
            of_store(StoreError::Full { dir: "data".into(), source: io::ErrorKind::StorageFull.into() })
        }
        Reason::DiskFailed => {
            of_store(StoreError::Directory { dir: "data".into(), source: io::ErrorKind::PermissionDenied.into() })
        }
        Reason::CatalogueDamaged => of_store(StoreError::Damaged { dir: "data".into(), what: "a row".into() }),
        Reason::DamagedBody => {
            let why = format!("it has the content of body {OTHER}").into();
            catalogue(&CatalogueError::DamagedBody { id: body, why }, "id")
        }
        Reason::DamagedRobot => {
            let why = format!("it has the content of robot {OTHER_ROBOT}").into();
            catalogue(&CatalogueError::DamagedRobot { id: robot, why }, "id")
        }
        Reason::DamagedScene => {
            let why = format!("its robot \"arm\", {ROBOT}, cannot be used");
            catalogue(&CatalogueError::DamagedScene { scene: "cell".into(), why }, "scene")
        }
        Reason::CallTooLong => too_slow(Duration::from_secs(120)),
        Reason::Deadline => deadline(),
        Reason::Loading => unavailable(reason, "8120 of 10000 bodies are still to be proven; try again in a moment"),
        Reason::Stopping => unavailable(reason, "the server stops; watch again when it is back"),
        Reason::RevisionNotReached => {
            let why = "scene \"cell\" is at revision 7, not yet at 9 (at_least_revision); try again";
            unavailable(reason, why)
        }
        Reason::Internal => internal(&"a defect"),
        Reason::InternalPanic => abandoned(),
    }
}

#[test]
fn the_page_shows_each_reason_as_commands_print_it_and_names_its_details() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/errors.md")).expect("the page");
    for &reason in Reason::ALL {
        let status = example(reason);
        let details = status.get_error_details();
        let info = details.error_info().expect("every refusal has a reason");
        assert_eq!((info.reason.as_str(), info.domain.as_str()), (reason.name(), "sublevel"));

        let section = page.split_once(&format!("\n## {}\n", reason.name())).expect("a section").1;
        let section = section.split("\n## ").next().expect("its text");
        let printed = format!("\nerror: the server refused: {} ({:?})\n", status.message(), status.code());
        assert!(section.contains(&printed), "{}: the page does not show{printed}", reason.name());
        // The code as gRPC writes it begins the section, without its underscores as Rust does.
        let code = section.trim_start().split('.').next().expect("a sentence");
        let plain = format!("{:?}", status.code()).to_uppercase();
        assert_eq!(code.replace('_', ""), plain, "{}", reason.name());

        let mut named: Vec<&str> = info.metadata.keys().map(String::as_str).collect();
        let kinds = [
            ("BadRequest", details.bad_request().is_some()),
            ("ResourceInfo", details.resource_info().is_some()),
            ("RetryInfo", details.retry_info().is_some()),
            ("PreconditionFailure", details.precondition_failure().is_some()),
        ];
        named.extend(kinds.iter().filter(|(_, sent)| *sent).map(|(kind, _)| *kind));
        for name in named {
            assert!(section.contains(&format!("`{name}`")), "{} does not name {name}", reason.name());
        }
        for (kind, sent) in kinds {
            assert!(sent || !section.contains(&format!("`{kind}`")), "{} has no {kind}", reason.name());
        }
    }
}

#[test]
fn failures_of_the_disk_name_no_path() {
    let dir = || std::path::PathBuf::from("/var/lib/secret");
    let io = || io::ErrorKind::PermissionDenied.into();
    for error in [
        StoreError::Full { dir: dir(), source: io() },
        StoreError::Directory { dir: dir(), source: io() },
        StoreError::InUse { dir: dir() },
        StoreError::Damaged { dir: dir(), what: "/var/lib/secret".into() },
        StoreError::Empty { file: dir() },
    ] {
        let status = of_store(error);
        assert!(!status.message().contains("secret"), "{}", status.message());
    }
}

#[test]
fn names_that_are_not_found_are_shown_in_part() {
    let name = "x".repeat(100_000);
    let status = not_found(Reason::RobotNotFound, &name, "robot", format!("no robot \"{name}\"; place it first"));
    assert!(status.message().len() < 1100 && status.details().len() < 5120, "{}", status.details().len());
    let resource = status.get_details_resource_info().expect("a resource");
    assert_eq!(resource.resource_name, format!("{}…", &name[..1024]));
}
