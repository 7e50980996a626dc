//! The worker's decisions, one by one.

use std::sync::Arc;

use nalgebra::Vector3;
use tokio::task::spawn_blocking;

use super::worker::{claim, ended, finish, put_back, recover};
use super::{Jobs, Phase, Progress, fit_group, fit_mesh};
use crate::robot::motion::PairClass;
use crate::store::{
    Catalogue, DeriveOutcome, DeriveRequest, FitBody, FitGroup, FitPolynomial, FitRequest, JobOutcome, JobState,
    NewJob, RobotSource, Store,
};
use sublevel_testkit::Seeded;

fn request(degree: usize) -> FitRequest {
    let polynomial = FitPolynomial { degree: Some(degree), ..FitPolynomial::default() };
    FitRequest::new("it", FitBody { polynomial, ..FitBody::default() })
}

/// A catalogue with one job that was claimed, and where it lies.
fn claimed() -> (tempfile::TempDir, Catalogue, u64) {
    let dir = tempfile::tempdir().expect("a directory");
    let catalogue = Catalogue::load(Store::open(dir.path()).expect("a new catalogue")).expect("loads");
    let mut random = Seeded(5);
    let points: Vec<_> = (0..40).map(|_| Vector3::from_fn(|_, _| random.signed())).collect();
    catalogue.create_job(NewJob::fit(String::new(), request(4), &points, &[])).expect("queued");
    let job = claim(&catalogue).expect("the disk works").expect("a job");
    assert_eq!((&job.state, job.attempts), (&JobState::Running, 1));
    assert!(claim(&catalogue).expect("the disk works").is_none(), "one job is claimed once");
    (dir, catalogue, job.id)
}

/// The stop comes when the board does not know the job yet; the catalogue does.
#[test]
fn a_job_that_is_cancelled_before_it_is_on_the_board_makes_nothing() {
    let (_dir, catalogue, id) = claimed();
    let (jobs, job) = (Jobs::default(), catalogue.job(id).expect("there"));
    assert_eq!(jobs.cancel(&catalogue, id).expect("cancelled").state, JobState::Cancelled);
    jobs.tell(|board| board.begin(id));
    jobs.execute(&catalogue, &job).expect_err("nothing to fit");
    let state = finish(&catalogue, id, &(JobState::Failed("why".into()), Vec::new())).expect("as it is").state.clone();
    assert_eq!(state, JobState::Cancelled);
}

/// The end of a job is reported once, whatever caused it.
#[test]
fn each_job_is_counted_once() {
    let (_dir, catalogue, id) = claimed();
    let heard = Arc::new(std::sync::Mutex::new(Vec::new()));
    let jobs = {
        let heard = heard.clone();
        Jobs::heard_by(move |job, took| heard.lock().expect("no panic").push((job.state.clone(), took)))
    };
    for _ in 0..2 {
        jobs.cancel(&catalogue, id).expect("cancelled");
    }
    assert_eq!(*heard.lock().expect("no panic"), [(JobState::Cancelled, None)]);
    // One that kills the server is given up, and returned to be reported.
    let (_dir, catalogue, id) = claimed();
    assert!(recover(&catalogue).expect("begun again").is_empty());
    claim(&catalogue).expect("the disk works").expect("the job");
    let given_up = recover(&catalogue).expect("given up");
    assert_eq!(given_up.iter().map(|job| job.id).collect::<Vec<_>>(), [id]);
}

/// The result comes after the cancel was acknowledged.
#[test]
fn a_result_that_comes_too_late_is_dropped_with_its_bodies() {
    let (_dir, catalogue, id) = claimed();
    let (jobs, job) = (Jobs::default(), catalogue.job(id).expect("there"));
    jobs.tell(|board| board.begin(id));
    let made = ended(Ok(jobs.execute(&catalogue, &job)));
    assert!(
        matches!(&made.0, JobState::Succeeded(JobOutcome::Fit(outcome)) if outcome.bodies.len() == 1),
        "{:?}",
        made.0
    );
    jobs.cancel(&catalogue, id).expect("cancelled");
    assert_eq!(finish(&catalogue, id, &made).expect("as it is").state, JobState::Cancelled);
    assert_eq!(catalogue.counts().bodies, 0);
    // The same without the cancel.
    let (_dir, catalogue, id) = claimed();
    assert_eq!(finish(&catalogue, id, &made).expect("stored").state, made.0);
    assert_eq!(catalogue.counts().bodies, 1);
}

#[test]
fn a_kill_counts_as_an_attempt_and_an_orderly_stop_does_not() {
    let (_dir, catalogue, id) = claimed();
    let now = || catalogue.job(id).map(|job| (job.state.clone(), job.attempts)).expect("there");
    for _ in 0..5 {
        put_back(&catalogue, id).expect("back");
        assert_eq!(now(), (JobState::Queued, 0));
        recover(&catalogue).expect("nothing to do");
        assert_eq!(claim(&catalogue).expect("the disk works").expect("the job").attempts, 1);
    }
    recover(&catalogue).expect("begun again");
    assert_eq!(now(), (JobState::Queued, 1));
    assert_eq!(claim(&catalogue).expect("the disk works").expect("the job").attempts, 2);
    recover(&catalogue).expect("given up");
    assert!(matches!(now(), (JobState::Failed(why), 2) if why.contains("killed 2 times")));
    recover(&catalogue).expect("nothing to do");
    assert!(claim(&catalogue).expect("the disk works").is_none());
}

#[tokio::test]
async fn a_panic_is_a_failed_job_with_its_message() {
    let points: Vec<u8> = Vec::new();
    let panics = [
        (spawn_blocking(|| panic!("so it {}", "ends")), "so it ends"),
        (spawn_blocking(|| panic!("plainly")), "plainly"),
        (spawn_blocking(move || panic!("{}", points[3])), "index out of bounds"),
    ];
    for (panic, word) in panics {
        match ended(panic.await) {
            (JobState::Failed(why), bodies) => assert!(why.contains(word) && bodies.is_empty(), "{why}"),
            (state, ..) => panic!("{state:?}"),
        }
    }
}

/// The disk fails while a job ends: the worker keeps at it until it works.
#[tokio::test]
async fn a_change_is_made_as_soon_as_the_disk_works() {
    let (_dir, catalogue, _) = claimed();
    let (jobs, catalogue) = (Jobs::default(), Arc::new(catalogue));
    let tries = Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let failing = |until: usize| {
        let tries = tries.clone();
        move |_: &Catalogue| {
            let before = tries.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
            if before < until { Err(crate::store::CatalogueError::QueueFull) } else { Ok(before) }
        }
    };
    assert_eq!(jobs.retry_until_committed(&catalogue, failing(1)).await, Some(1));
    jobs.stop();
    assert_eq!(jobs.retry_until_committed(&catalogue, failing(usize::MAX)).await, None, "a stop ends the wait");
}

/// Points and groups go to functions of their own.
#[test]
fn a_request_about_bodies_is_not_executed_on_a_mesh_nor_the_other_way_round() {
    let unwatched = |_, _| std::ops::ControlFlow::Continue(());
    let points = vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    let mesh = crate::fit::Mesh { points, triangles: Vec::new() };
    let group = FitRequest::new("it", FitGroup::default());
    for failed in [fit_mesh(&group, mesh, unwatched), fit_group(&request(4), &[], unwatched)] {
        let why = failed.expect_err("the wrong mode").to_string();
        assert!(why.starts_with("group: "), "{why}");
    }
}

/// A ball that goes round another one by two joints, 0.5 m away from it everywhere: where this is
/// the margin, no search through boxes of joint values is over before its last box.
const ORBIT: &str = r#"<robot name="orbit">
  <link name="base"><collision><geometry><sphere radius="0.25"/></geometry></collision></link>
  <link name="middle"><collision><geometry><sphere radius="0.125"/></geometry></collision></link>
  <link name="tip"><collision><origin xyz="1 0 0"/><geometry><sphere radius="0.25"/></geometry></collision></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="middle"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><parent link="middle"/><child link="tip"/><axis xyz="0 1 0"/></joint>
</robot>"#;

/// What the job of a search through the pairs of [`ORBIT`] finds, and how far it says that it is;
/// `stopped` before it begins or not.
fn searched(stopped: bool) -> (DeriveOutcome, Progress) {
    let dir = tempfile::tempdir().expect("a directory");
    let catalogue = Catalogue::load(Store::open(dir.path()).expect("a new catalogue")).expect("loads");
    let source = RobotSource { urdf: ORBIT.into(), ..RobotSource::default() };
    let robot = *catalogue.load_robot(source).expect("a robot").0.robot.id();
    let request = DeriveRequest { robot, margin_m: 0.5, max_boxes: 1000, resolution_m: 1e-3 };
    catalogue.create_job(NewJob::derive(String::new(), request)).expect("queued");
    let job = claim(&catalogue).expect("the disk works").expect("a job");
    let jobs = Jobs::default();
    jobs.tell(|board| board.begin(job.id));
    if stopped {
        jobs.tell(|board| board.stop(job.id));
    }
    let (found, bodies) = jobs.execute(&catalogue, &job).expect("pairs");
    let JobOutcome::Derive(found) = found else { panic!("{found:?}") };
    assert!(bodies.is_empty(), "it makes none");
    let progress = jobs.news().borrow().progress(job.id).expect("it is on the board");
    (found, progress)
}

#[test]
fn a_search_through_pairs_counts_all_boxes_and_ends_when_it_is_stopped() {
    let (found, progress) = searched(false);
    let looked_at = found.pairs.iter().map(|pair| (pair.class, pair.boxes));
    let adjacent = (PairClass::Adjacent, 1);
    assert_eq!(looked_at.collect::<Vec<_>>(), [adjacent, (PairClass::Undecided, 1000), adjacent]);
    // The last report is that the third pair begins.
    assert_eq!(progress, Progress { phase: Phase::Solving, rounds: 3, iterations: 1001, ..Progress::default() });
    let (found, progress) = searched(true);
    assert!(found.pairs.len() == 3 && found.pairs.iter().all(|pair| pair.boxes == 0), "{found:?}");
    assert_eq!(progress.iterations, 0);
}
