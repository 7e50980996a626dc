//! Jobs on disk: what is acknowledged is there, what has ended is forgotten in time, and no id is
//! given twice.

use nalgebra::Vector3;
use sha2::{Digest, Sha256};

use super::{Disk, ball};
use crate::body::Body;
use crate::measure::Pose;
use crate::robot::motion::PairClass;
use crate::scene::RobotId;
use crate::store::rows::{JOBS, META, POINTS, TRIANGLES};
use crate::store::{
    Catalogue, CatalogueError, DeriveOutcome, DeriveRequest, DerivedLinkPair, FitGroup, FitOutcome, FitPolynomial,
    FitPreparation, FitRequest, FitTask, FitWithinGap, FittedKind, HierarchyMeasure, HierarchyOutcome,
    HierarchyRequest, HierarchySet, Job, JobOutcome, JobState, JobTask, MAX_ENDED_JOBS, MAX_QUEUED_JOBS, NewJob,
    RobotSource, StoreError,
};

fn request(name: &str) -> FitRequest {
    let polynomial = FitPolynomial { degree: Some(4), ..FitPolynomial::default() };
    let preparation = FitPreparation { trim: 1.0 / 3.0, min_thickness_m: None };
    let mode = FitWithinGap { max_gap_m: 0.1 + 0.2, polynomial, preparation };
    FitRequest { scale: 1e-3, ..FitRequest::new(name, mode) }
}

const CORNERS: [[u32; 3]; 1] = [[0, 1, 1]];

/// Coordinates that use all their bits, and the special ones.
fn points() -> Vec<Vector3<f64>> {
    vec![Vector3::new(0.1, -0.0, f64::MIN_POSITIVE / 3.0), Vector3::new(1.0 / 3.0, f64::MAX, -1e-300)]
}

pub(super) fn job(request_id: &str) -> NewJob {
    NewJob::fit(request_id.into(), request("it"), &points(), &CORNERS)
}

/// A solve about these bodies, the second at a pose whose numbers use all their bits.
pub(super) fn solve(request_id: &str, bodies: [&Body; 2]) -> NewJob {
    let apart = Pose::from_quaternion(Vector3::new(2.5, -0.0, 1.0 / 3.0), [0.1, 0.7, -0.1, 0.7]).expect("a pose");
    let sets = [(bodies[0], Pose::identity()), (bodies[1], apart)];
    let sets = sets.map(|(body, pose)| HierarchySet { body: *body.id(), pose });
    let request = HierarchyRequest { measure: HierarchyMeasure::Distance, sets, level: 1 };
    NewJob::hierarchy(request_id.into(), request)
}

fn found() -> JobState {
    JobState::Succeeded(JobOutcome::Hierarchy(HierarchyOutcome {
        lower: 0.1,
        upper: Some(0.1 + 0.2),
        points_m: Some([[0.5, -0.0, 1.0 / 3.0], [0.0; 3]]),
        is_exact: false,
        iterations: 14,
        seconds: 0.25,
    }))
}

fn done() -> JobState {
    JobState::Succeeded(JobOutcome::Fit(FitOutcome { bodies: Vec::new(), ladder: None, left_out: 2, left_out_m: 0.1 }))
}

fn end(catalogue: &Catalogue, id: u64, state: &JobState) -> Result<std::sync::Arc<Job>, CatalogueError> {
    catalogue
        .change_job(id, vec![ball(3.0).into()], |job| (!job.state.is_final()).then(|| (state.clone(), job.attempts)))
}

/// What a start would read now, a job among it that is as wanted.
fn saved(disk: &Disk, wanted: &Job) -> Catalogue {
    let copy = Disk::default();
    copy.bytes.lock().expect("sound").clone_from(&disk.bytes.lock().expect("sound"));
    let again = copy.load().expect("loads");
    assert_eq!(*again.job(wanted.id).expect("there"), *wanted);
    again
}

#[test]
fn every_acknowledged_state_is_on_disk() {
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    let (made, created) = catalogue.create_job(job("r")).expect("queued");
    let JobTask::Fit(FitTask { points: 2, .. }) = made.task else { panic!("{made:?}") };
    assert!(created && made.state == JobState::Queued);
    let saved = |wanted: &Job| saved(&disk, wanted);
    let bits = |points: &[Vector3<f64>]| points.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    let again = saved(&made);
    let (kept, corners) = again.job_mesh(made.id).expect("kept");
    assert_eq!((bits(&kept), corners), (bits(&points()), vec![[0, 1, 1]]));
    let (known, created) = again.create_job(job("r")).expect("known");
    assert!(!created && known == made);

    let running = catalogue.change_job(made.id, Vec::new(), |_| Some((JobState::Running, 1))).expect("moved on");
    assert_eq!((running.attempts, &running.state), (1, &JobState::Running));
    saved(&running);
    let ended = end(&catalogue, made.id, &done()).expect("ended");
    let again = saved(&ended);
    assert!(again.geometry(ball(3.0).id()).is_ok(), "the body came with the state");
    assert!(matches!(again.job_mesh(made.id), Err(CatalogueError::NoJob(_))), "the points went with it");
    // What has ended is not changed any more when its caller looks at it.
    assert_eq!(end(&catalogue, made.id, &JobState::Cancelled).expect("as it is"), ended);
}

/// A job as it is written: what later versions have to read, or to refuse by their format.
#[test]
fn the_row_of_a_job_has_one_form_and_is_what_request_ids_are_compared_by() {
    let polynomial = r#"{"degree":4,"objective":"logdet-p","cone":"sos","raw_frame":false,"refine":false}"#;
    let preparation = r#"{"trim":0.3333333333333333,"min_thickness_m":null}"#;
    let mode = format!(
        r#"{{"within_gap":{{"max_gap_m":0.30000000000000004,"polynomial":{polynomial},"preparation":{preparation}}}}}"#
    );
    let written = format!(r#"{{"name":"it","input":"","scale":0.001,"mode":{mode}}}"#);
    assert_eq!(serde_json::to_string(&request("it")).expect("JSON"), written);
    let new = NewJob::fit("r".into(), request("it"), &points(), &[]);
    let body = r#"{"id":"5f","gap_m":0.25,"mean_gap_m":0.125,"seconds":1.5,"optimum":null}"#;
    let state = format!(r#"{{"succeeded":{{"fit":{{"bodies":[{body}],"left_out":0,"left_out_m":0.0}}}}}}"#);
    let task = format!(r#"{{"fit":{{"request":{written},"points":2}}}}"#);
    let row =
        format!(r#"{{"id":1,"request_id":"r","digest":"{}","task":{task},"attempts":1,"state":{state}}}"#, new.digest);
    let disk = Disk::default();
    drop(disk.load().expect("a new catalogue"));
    write_job(&disk, &row);
    let catalogue = disk.load().expect("loads");
    let (known, created) = catalogue.create_job(new).expect("known");
    assert_eq!((created, &known.task), (false, &JobTask::Fit(FitTask { request: request("it"), points: 2 })));
    let JobState::Succeeded(JobOutcome::Fit(outcome)) = &known.state else { panic!("{known:?}") };
    assert_eq!((outcome.bodies[0].kind, outcome.bodies[0].gap_m), (FittedKind::Body, Some(0.25)));
    assert_eq!(serde_json::to_string(&*known).expect("JSON"), row, "nor is it written otherwise now");
}

/// Files of format 1 held flat orders: the file is refused by its format, such a row by its name.
#[test]
fn orders_of_earlier_versions_are_refused() {
    let order = r#"{"name":"it","input":"","degree":4,"objective":"logdet-p","refine":false,"slabs":0,"ladder":false,"max_gap_m":null,"trim":0.0,"min_thickness_m":null,"scale":1.0}"#;
    let row =
        format!(r#"{{"id":1,"request_id":"","digest":"5f","order":{order},"points":2,"attempts":0,"state":"queued"}}"#);
    let disk = Disk::default();
    drop(disk.load().expect("a new catalogue"));
    write_job(&disk, &row);
    let error = disk.load().expect_err("no request").to_string();
    assert!(error.contains("job 1") && error.contains("damaged"), "{error}");
    disk.meddle(|transaction| {
        transaction.open_table(META).expect("a table").insert("format", 1).expect("written");
    });
    let error = disk.load().expect_err("format 1").to_string();
    assert!(error.contains("has format 1") && error.contains("reads format 5"), "{error}");
    assert!(error.contains("another directory"), "{error}");
}

fn write_job(disk: &Disk, row: &str) {
    disk.meddle(|transaction| {
        transaction.open_table(JOBS).expect("a table").insert(1, row.as_bytes()).expect("written");
    });
}

#[test]
fn a_ladder_is_stored_with_its_rungs_and_keeps_them() {
    let points = [Vector3::new(0.1, 0.0, 0.0)];
    let rung = |radius| {
        let body = ball(radius).with_points(&points).expect("contained");
        std::sync::Arc::new(crate::body::Shape::Body(Box::new(body)))
    };
    let ladder = crate::scene::Ladder::new("steps", vec![rung(2.0), rung(1.0)]).expect("a ladder");
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    let id = catalogue.create_job(job("")).expect("queued").0.id;
    let stored = crate::scene::Geometry::Ladder(std::sync::Arc::new(ladder));
    let ladder = *stored.id();
    catalogue.change_job(id, vec![stored], |_| Some((done(), 1))).expect("ended");
    for catalogue in [catalogue, disk.load().expect("loads")] {
        assert_eq!(super::sizes(&catalogue), (3, 0));
        assert_eq!(catalogue.geometry(&ladder).expect("stored").rungs().len(), 2);
        let used = catalogue.delete_body(ball(2.0).id()).expect_err("a rung");
        assert!(matches!(used, CatalogueError::RungUsed { .. }), "{used}");
    }
    let catalogue = disk.load().expect("loads");
    catalogue.delete_body(&ladder).expect("deleted");
    catalogue.delete_body(ball(2.0).id()).expect("no rung any more");
    assert_eq!(super::sizes(&disk.load().expect("loads")), (1, 0));
}

/// The body that came first stays, and a ladder is made of what is stored: it has to be valid when
/// it is loaded.
#[test]
fn a_ladder_of_rungs_that_are_stored_without_their_points_is_refused() {
    let points = [Vector3::new(0.1, 0.0, 0.0)];
    let rung = |radius| {
        let body = ball(radius).with_points(&points).expect("contained");
        std::sync::Arc::new(crate::body::Shape::Body(Box::new(body)))
    };
    let ladder = crate::scene::Ladder::new("steps", vec![rung(2.0), rung(1.0)]).expect("a ladder");
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    catalogue.create_body(ball(1.0).into()).expect("stored");
    let ladder = crate::scene::Geometry::Ladder(std::sync::Arc::new(ladder));
    let refused = catalogue.create_body(ladder.clone()).expect_err("a rung without points");
    assert!(matches!(refused, CatalogueError::Ladder(_)), "{refused}");
    drop(catalogue);
    let catalogue = disk.load().expect("loads");
    assert_eq!(super::sizes(&catalogue), (1, 0));
    // A job keeps what it has made besides.
    let id = catalogue.create_job(job("")).expect("queued").0.id;
    catalogue.change_job(id, vec![ball(3.0).into(), ladder], |_| Some((done(), 1))).expect("ended");
    drop(catalogue);
    assert_eq!(super::sizes(&disk.load().expect("loads")), (2, 0));
}

#[test]
fn a_group_is_of_bodies_that_are_stored() {
    let catalogue = Disk::default().load().expect("a new catalogue");
    let there = *catalogue.create_body(ball(1.0).into()).expect("stored").0.id();
    let grouping = |body_ids| {
        let group = FitGroup { body_ids, ..FitGroup::default() };
        NewJob::fit(String::new(), FitRequest::new("them", group), &[], &[])
    };
    let missing = *ball(2.0).id();
    match catalogue.create_job(grouping(vec![there, missing])) {
        Err(CatalogueError::NoMember { index, id }) => assert_eq!((index, id), (1, missing)),
        unexpected => panic!("{unexpected:?}"),
    }
    let job = catalogue.create_job(grouping(vec![there])).expect("queued").0;
    assert_eq!(catalogue.job_mesh(job.id).expect("kept"), (Vec::new(), Vec::new()));
}

/// As fits, without points.
#[test]
fn solves_are_kept_in_every_state_and_known_by_their_content() {
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    let balls = [ball(0.5), ball(1.0)];
    for ball in &balls {
        catalogue.create_body(ball.clone().into()).expect("stored");
    }
    let asked = || solve("r", [&balls[0], &balls[1]]);
    let (made, created) = catalogue.create_job(asked()).expect("queued");
    assert!(created && made.task == asked().task);
    assert!(matches!(catalogue.job_mesh(made.id), Err(CatalogueError::NoJob(_))), "a solve has no points");
    let running = catalogue.change_job(made.id, Vec::new(), |_| Some((JobState::Running, 1))).expect("moved on");
    saved(&disk, &running);
    let none = JobState::Succeeded(JobOutcome::Hierarchy(HierarchyOutcome {
        lower: 0.0,
        upper: None,
        points_m: None,
        is_exact: false,
        iterations: 1,
        seconds: 0.0,
    }));
    for state in [found(), none] {
        let ended = catalogue.change_job(made.id, Vec::new(), |_| Some((state.clone(), 1))).expect("ended");
        assert_eq!(ended.state, state);
        saved(&disk, &ended);
    }
    drop(catalogue);
    let again = disk.load().expect("loads");
    assert!(!again.create_job(asked()).expect("known").1);
    for other in [solve("r", [&balls[1], &balls[0]]), job("r")] {
        let used = again.create_job(other).expect_err("another content");
        assert!(matches!(used, CatalogueError::RequestUsed { job: 1, .. }), "{used}");
    }
    // Of a body that is gone there is no further solve, and the one that there was stays.
    again.delete_body(balls[1].id()).expect("deleted");
    match again.create_job(solve("", [&balls[0], &balls[1]])) {
        Err(CatalogueError::NoSet { index: 1, id }) => assert_eq!(id, *balls[1].id()),
        unexpected => panic!("{unexpected:?}"),
    }
    assert!(!again.create_job(asked()).expect("known").1);
}

/// A search through the pairs of links of a robot, with numbers that use all their bits.
fn search(robot: RobotId) -> DeriveRequest {
    DeriveRequest { robot, margin_m: 0.1 + 0.2, max_boxes: 7, resolution_m: 1e-3 }
}

/// A pair of each class.
fn pairs() -> DeriveOutcome {
    let classes = [PairClass::Adjacent, PairClass::Never, PairClass::Always, PairClass::Collides, PairClass::Undecided];
    let pair = |class| DerivedLinkPair {
        links: ["base".into(), "tool".into()],
        class,
        witness: (class != PairClass::Never).then(|| vec![0.1, -0.0]),
        upper_m: (class != PairClass::Always).then_some(-0.25),
        is_certain: class == PairClass::Collides,
        boxes: 17,
        srdf_reason: (class == PairClass::Collides).then(|| "Never".to_owned()),
    };
    DeriveOutcome { pairs: classes.map(pair).into(), seconds: 0.25 }
}

/// As solves: about a robot.
#[test]
fn searches_through_pairs_are_kept_in_every_state_and_known_by_their_content() {
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    let load = |radius: &str| {
        let link = |name: &str| {
            let sphere = format!("<geometry><sphere radius=\"{radius}\"/></geometry>");
            format!("<link name=\"{name}\"><collision>{sphere}</collision></link>")
        };
        let joint = r#"<joint name="turn" type="continuous"><parent link="base"/><child link="tool"/></joint>"#;
        let urdf = format!("<robot name=\"arm\">{}{}{joint}</robot>", link("base"), link("tool"));
        let source = RobotSource { urdf, ..RobotSource::default() };
        *catalogue.load_robot(source).expect("a robot").0.robot.id()
    };
    let [robot, wider] = ["0.5", "0.75"].map(load);
    let asked = |request_id: &str| NewJob::derive(request_id.into(), search(robot));
    let (made, created) = catalogue.create_job(asked("r")).expect("queued");
    assert!(created && made.task == JobTask::Derive(search(robot)));
    assert!(matches!(catalogue.job_mesh(made.id), Err(CatalogueError::NoJob(_))), "it has no points");
    saved(&disk, &made);
    let found = JobState::Succeeded(JobOutcome::Derive(pairs()));
    for state in [JobState::Running, found, JobState::Failed("why".into()), JobState::Cancelled] {
        let changed = catalogue.change_job(made.id, Vec::new(), |_| Some((state.clone(), 1))).expect("moved on");
        assert_eq!((&changed.state, changed.attempts), (&state, 1));
        saved(&disk, &changed);
    }
    drop(catalogue);
    let again = disk.load().expect("loads");
    assert!(!again.create_job(asked("r")).expect("known").1);
    let same = search(robot);
    for other in [
        DeriveRequest { robot: wider, ..same },
        DeriveRequest { margin_m: 0.3, ..same },
        DeriveRequest { max_boxes: 8, ..same },
        DeriveRequest { resolution_m: 2e-3, ..same },
    ] {
        let used = again.create_job(NewJob::derive("r".into(), other)).expect_err("another content");
        assert!(matches!(used, CatalogueError::RequestUsed { job: 1, .. }), "{used}");
    }
    // Of a robot that is gone there is no further search, and the one that there was stays.
    again.delete_robot(&robot).expect("deleted");
    match again.create_job(asked("")) {
        Err(CatalogueError::NoRobot(id)) => assert_eq!(id, robot),
        unexpected => panic!("{unexpected:?}"),
    }
    assert!(!again.create_job(asked("r")).expect("known").1);
    drop(again);
    let again = disk.load().expect("loads");
    assert_eq!(again.job(made.id).expect("there").task, JobTask::Derive(same), "though its robot is gone");
}

/// A search as it is written, the robot only named in it.
#[test]
fn the_row_of_a_search_through_pairs_has_one_form() {
    let robot = "a7".repeat(32);
    let task = format!(
        r#"{{"derive":{{"robot":"{robot}","margin_m":0.30000000000000004,"max_boxes":7,"resolution_m":0.001}}}}"#
    );
    let new = NewJob::derive("r".into(), search(robot.parse().expect("an id")));
    assert_eq!(serde_json::to_string(&new.task).expect("JSON"), task);
    let digest: String = Sha256::digest(&task).iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(new.digest, digest, "what request ids are compared by");
    let pair = |class: &str, seen: &str, certain: bool, reason: &str| {
        format!(r#"{{"links":["base","tool"],"class":"{class}",{seen}"is_certain":{certain},"boxes":17{reason}}}"#)
    };
    let (witness, upper) = (r#""witness":[0.1,-0.0],"#, r#""upper_m":-0.25,"#);
    let both = format!("{witness}{upper}");
    let written = [
        pair("adjacent", &both, false, ""),
        pair("never", upper, false, ""),
        pair("always", witness, false, ""),
        pair("collides", &both, true, r#","srdf_reason":"Never""#),
        pair("undecided", &both, false, ""),
    ];
    let state = format!(r#"{{"succeeded":{{"derive":{{"pairs":[{}],"seconds":0.25}}}}}}"#, written.join(","));
    let row = format!(r#"{{"id":1,"request_id":"r","digest":"{digest}","task":{task},"attempts":1,"state":{state}}}"#);
    let disk = Disk::default();
    drop(disk.load().expect("a new catalogue"));
    write_job(&disk, &row);
    let (known, created) = disk.load().expect("loads").create_job(new).expect("known");
    assert_eq!((created, &known.state), (false, &JobState::Succeeded(JobOutcome::Derive(pairs()))));
    assert_eq!(serde_json::to_string(&*known).expect("JSON"), row, "nor is it written otherwise now");
}

#[test]
fn a_full_disk_leaves_jobs_as_they_were() {
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    let id = catalogue.create_job(job("")).expect("queued").0.id;
    disk.set_full(true);
    let failed = end(&catalogue, id, &done()).expect_err("full");
    assert!(matches!(failed, CatalogueError::Store(StoreError::Full { .. })), "{failed}");
    assert!(catalogue.create_job(job("")).is_err());
    assert_eq!(catalogue.job(id).expect("there").state, JobState::Queued);
    assert!(catalogue.geometry(ball(3.0).id()).is_err(), "half of a change");
    disk.set_full(false);
    assert_eq!(catalogue.job_mesh(id).expect("kept").0, points());
    assert_eq!(end(&catalogue, id, &done()).expect("space again").state, done());
    assert!(catalogue.geometry(ball(3.0).id()).is_ok());
    assert_eq!(catalogue.jobs(None, 9).0.len(), 1);
}

#[test]
fn a_request_id_is_for_one_content() {
    let catalogue = Disk::default().load().expect("a new catalogue");
    let first = catalogue.create_job(job("r")).expect("queued").0;
    let other_points = NewJob::fit("r".into(), request("it"), &points()[1..], &CORNERS);
    let other_triangles = NewJob::fit("r".into(), request("it"), &points(), &[[0, 1, 0]]);
    let other_request = NewJob::fit("r".into(), request("that"), &points(), &CORNERS);
    for other in [other_points, other_triangles, other_request] {
        match catalogue.create_job(other) {
            Err(CatalogueError::RequestUsed { request_id, job }) => assert_eq!((&*request_id, job), ("r", first.id)),
            unexpected => panic!("{unexpected:?}"),
        }
    }
    assert!(catalogue.create_job(job("")).expect("queued").1 && catalogue.create_job(job("")).expect("queued").1);
}

#[test]
fn the_queue_is_bounded_and_the_oldest_that_ended_are_forgotten() {
    let catalogue = Disk::default().load().expect("a new catalogue");
    for _ in 0..MAX_QUEUED_JOBS {
        catalogue.create_job(job("")).expect("queued");
    }
    assert!(matches!(catalogue.create_job(job("")), Err(CatalogueError::QueueFull)));
    let known = catalogue.create_job(NewJob::fit("r".into(), request("it"), &points(), &CORNERS));
    assert!(matches!(known, Err(CatalogueError::QueueFull)));
    // The first goes on waiting while others come and go.
    let mut last = MAX_QUEUED_JOBS as u64;
    end(&catalogue, 2, &JobState::Cancelled).expect("cancelled");
    for _ in 0..MAX_ENDED_JOBS {
        let id = catalogue.create_job(job("")).expect("queued").0.id;
        assert_eq!(id, last + 1);
        last = id;
        end(&catalogue, id, &JobState::Failed("why".into())).expect("failed");
    }
    assert!(catalogue.job(2).is_some());
    let one_more = catalogue.create_job(job("")).expect("queued").0.id;
    assert!(catalogue.job(2).is_none(), "forgotten");
    assert_eq!(catalogue.first_job(&JobState::Queued).expect("the first").id, 1);
    assert_eq!(catalogue.jobs(Some(last - 1), 9).0.iter().map(|job| job.id).collect::<Vec<_>>(), [last, one_more]);
}

#[test]
fn files_that_never_had_a_job_are_read() {
    let disk = Disk::default();
    drop(super::furnished(&disk));
    disk.meddle(|transaction| {
        transaction.delete_table(JOBS).expect("deleted");
        for table in [POINTS, TRIANGLES] {
            transaction.delete_table(table).expect("deleted");
        }
    });
    let catalogue = disk.load().expect("loads");
    assert_eq!((super::sizes(&catalogue), catalogue.jobs(None, 9).0.len()), ((1, 1), 0));
    assert!(matches!(catalogue.job_mesh(1), Err(CatalogueError::NoJob(_))));
    let id = catalogue.create_job(job("")).expect("queued").0.id;
    assert_eq!(catalogue.job_mesh(id).expect("kept").0, points());
}

#[test]
fn damaged_jobs_are_refused_by_name() {
    for (key, word) in [(1, "job 1"), (7, "says that it is 1")] {
        let disk = Disk::default();
        disk.load().expect("a new catalogue").create_job(job("")).expect("queued");
        disk.meddle(|transaction| {
            let mut table = transaction.open_table(JOBS).expect("a table");
            let row = table.remove(1).expect("read").expect("a row").value().to_vec();
            let row = if key == 1 { &row[..row.len() / 2] } else { &row[..] };
            table.insert(key, row).expect("written");
        });
        let error = disk.load().expect_err(word).to_string();
        assert!(error.contains(word) && error.contains("damaged"), "{error}");
    }
}
