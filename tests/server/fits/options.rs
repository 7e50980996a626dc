//! All that `sublevel fit` knows, asked of a server: the very same bodies and files.

use std::ops::ControlFlow;

use sublevel::fit::{self, Mesh, Objective, Progress, Representation, SosMethod};
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::fit_sos_body::Method;
use sublevel::service::proto::{
    BodyKind, CreateFitRequest, FitBody, FitCompound, FitCone, FitInverseMoment, FitObjective, FitOptions, FitRelaxed,
    FitSosBody, FitWithinGap, JobState, ListBodiesRequest, ListJobsRequest, MeshFormat, UpdateSceneRequest,
};

use super::{FitJob, arc, asked, body, header, long, mesh_file, off, triangles};
use crate::harness::{Clients, Running, at, object};

fn unwatched(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Kind, id and file of the one thing that a job made.
async fn made(clients: &mut Clients, job: FitJob) -> (BodyKind, String, String) {
    let result = job.result.unwrap_or_else(|| panic!("{}", job.failure));
    let [made] = &result.bodies[..] else { panic!("{result:?}") };
    let file = clients.file(&made.body_id).await;
    (made.kind(), made.body_id.clone(), file)
}

/// A compound of at most this many parts of degree 2.
fn cut(parts: u32) -> FitOptions {
    asked(Mode::Compound(FitCompound { parts, degree: Some(2), ..FitCompound::default() }))
}

/// What is near enough, of at most this degree.
fn within(max_gap_m: f64, degree: u32) -> FitOptions {
    asked(Mode::WithinGap(FitWithinGap { max_gap_m, degree: Some(degree), ..FitWithinGap::default() }))
}

/// A set of degree 4 that need not be convex.
fn set(method: Method) -> FitOptions {
    asked(Mode::SosBody(FitSosBody { degree: Some(4), raw_frame: false, method: Some(method) }))
}

fn compound(mesh: &Mesh, parts: usize) -> sublevel::body::Compound {
    let options = fit::FitOptions { degree: 2, ..fit::FitOptions::default() };
    fit::fit_parts("arc", mesh, parts, &options, &mut unwatched).expect("a compound").compound
}

fn sos(mesh: &Mesh, method: SosMethod) -> (BodyKind, String, String) {
    let (coordinates, input) = (fit::Coordinates::Unit, String::new());
    let options = fit::SosOptions { degree: 4, method, coordinates, solver: None, input };
    let body = fit::fit_sos("arc", &mesh.points, &mesh.triangles, &options, &mut unwatched).expect("a set").body;
    assert!(body.covered().is_some_and(|covered| covered.triangles == mesh.triangles.len()));
    (BodyKind::SosBody, body.id().to_string(), body.to_json())
}

/// The method of a set that need not be convex, if one is asked for.
fn method(options: &FitOptions) -> Option<Method> {
    match options.mode {
        Some(Mode::SosBody(set)) => set.method,
        _ => None,
    }
}

async fn ended(clients: &mut Clients, options: FitOptions, mesh: &Mesh) -> FitJob {
    let id = clients.queue_mesh(header("arc", options), mesh).await.id;
    clients.ended(&id).await
}

#[tokio::test(flavor = "multi_thread")]
async fn cones_and_the_raw_frame_make_bodies() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mesh = arc();
    let fitted = |options: fit::FitOptions| {
        let body = fit::fit("arc", &mesh.points, &options, &mut unwatched).expect("a fit").body;
        (BodyKind::Body, body.id().to_string(), body.to_json())
    };
    let plain = || fit::FitOptions { degree: 4, ..fit::FitOptions::default() };
    let cone = |cone: FitCone| FitBody { cone: cone.into(), ..body(4) };
    let raw = FitBody { objective: FitObjective::TraceP.into(), raw_frame: true, ..body(4) };
    let (objective, coordinates) = (Objective::TraceP, fit::Coordinates::Raw);
    for (asked_body, expected) in [
        (cone(FitCone::Sos), fitted(plain())),
        (cone(FitCone::Sdsos), fitted(fit::FitOptions { cone: fit::Cone::Sdsos, ..plain() })),
        (cone(FitCone::Dsos), fitted(fit::FitOptions { cone: fit::Cone::Dsos, ..plain() })),
        (raw, fitted(fit::FitOptions { objective, coordinates, ..plain() })),
    ] {
        let job = ended(&mut clients, asked(Mode::Body(asked_body)), &mesh).await;
        // What was left open is reported.
        let objective = asked_body.objective().max(FitObjective::LogdetP).into();
        let cone = asked_body.cone().max(FitCone::Sos).into();
        let reported = asked(Mode::Body(FitBody { objective, cone, ..asked_body }));
        assert_eq!(job.options, Some(FitOptions { scale: Some(1.0), ..reported }));
        let found = made(&mut clients, job).await;
        clients.body(&found.1).await;
        // Provenance says how long it took to the second of the clock at most.
        assert_eq!((found.0, &found.1), (expected.0, &expected.1));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn compounds_and_sets_are_stored_like_bodies() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mesh = arc();
    let three = compound(&mesh, 3);
    let file_of =
        |compound: &sublevel::body::Compound| (BodyKind::Compound, compound.id().to_string(), compound.to_json());
    // A gap for which three parts of degree 2 are the cheapest.
    let gap = three.gap_m().expect("a gap") * 1.0001;
    let library = fit::FitOptions { degree: 2, ..fit::FitOptions::default() };
    let near = match fit::cheapest_within("arc", &mesh, gap, &library, &mut unwatched).expect("a compound") {
        Representation::Compound(fit) => fit.compound,
        Representation::Body(rung) => panic!("{:?}", rung.gap),
    };
    let asked_c = |c: f64| set(Method::Relaxed(FitRelaxed { c, objective: FitObjective::LogdetP.into() }));
    let relaxed = |c: f64| sos(&mesh, SosMethod::Relaxed { c, objective: Objective::default() });
    let cases = [
        (cut(3), file_of(&three)),
        (within(gap, 2), file_of(&near)),
        (asked_c(10.0), relaxed(10.0)),
        (asked_c(f64::INFINITY), relaxed(f64::INFINITY)),
        (set(Method::InverseMoment(FitInverseMoment {})), sos(&mesh, SosMethod::InverseMoment)),
    ];
    let mut jobs = Vec::new();
    for (options, expected) in &cases {
        let job = ended(&mut clients, options.clone(), &mesh).await;
        assert_eq!(made(&mut clients, job.clone()).await, *expected, "{options:?}");
        let reported = job.options.clone().expect("options");
        assert_eq!(method(&reported), method(options), "{reported:?}");
        jobs.push(job);
    }
    let list = ListBodiesRequest::default();
    let bodies = clients.bodies.list_bodies(list.clone()).await.expect("a list").into_inner().bodies;
    let mut expected: Vec<_> = cases.iter().map(|(_, (kind, id, _))| (id.clone(), *kind)).collect();
    expected.sort();
    expected.dedup();
    assert_eq!(bodies.iter().map(|body| (body.id.clone(), body.kind())).collect::<Vec<_>>(), expected);
    // All of them can be placed.
    clients.make_scene("room").await;
    let upsert_objects = bodies.iter().map(|body| object(&body.id[..8], &body.id, at(0.0))).collect();
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;

    // Jobs and what they made are there after a kill.
    server.kill();
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    for job in &jobs {
        assert_eq!(clients.job(&job.id).await, *job);
        assert_eq!(clients.cancel(&job.id).await, *job);
    }
    let listed = clients.jobs.list_jobs(ListJobsRequest::default()).await.expect("a list").into_inner().jobs;
    assert_eq!(listed.into_iter().map(FitJob::from).collect::<Vec<_>>(), jobs);
    let again = clients.bodies.list_bodies(list).await.expect("a list").into_inner().bodies;
    assert_eq!(again, bodies);
    assert_eq!(clients.scene("room").await.objects.len(), bodies.len());
}

/// Points alone do not tell where to cut, and a mesh file says as much as triangles that are sent.
#[tokio::test(flavor = "multi_thread")]
async fn triangles_come_packed_or_in_a_mesh_file() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mesh = arc();
    let two = compound(&mesh, 2);
    let source = mesh_file(MeshFormat::Off.into(), &off(&mesh));
    let request = CreateFitRequest { source, ..header("arc", cut(2)) };
    let id = clients.upload(request).await.expect("queued").job.id;
    let job = clients.ended(&id).await;
    let (_, id, file) = made(&mut clients, job).await;
    assert_eq!((id, file), (two.id().to_string(), two.to_json()));

    let gap = within(two.gap_m().expect("a gap") * 1.0001, 8);
    let id = clients.queue(header("arc", gap.clone()), &mesh.points).await.id;
    let job = clients.ended(&id).await;
    assert_eq!(made(&mut clients, job).await.0, BodyKind::Body);
    // What is trimmed or thickened has lost them.
    for options in [FitOptions { trim: 0.02, ..gap.clone() }, FitOptions { min_thickness_m: Some(1.0), ..gap }] {
        let job = ended(&mut clients, options, &mesh).await;
        assert_eq!(made(&mut clients, job).await.0, BodyKind::Body);
    }
}

/// The request id stands for options and triangles, too, and both outlive a server.
#[tokio::test(flavor = "multi_thread")]
async fn what_was_asked_for_survives_a_kill() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mesh = arc();
    let first = clients.queue(header("first", long()), &super::cloud(400, 43)).await.id;
    clients.under_way(&first).await;
    let request = |parts: u32, count: usize| {
        let some = Mesh { triangles: mesh.triangles[..count].to_vec(), ..mesh.clone() };
        let request_id = "1679091c".into();
        CreateFitRequest { request_id, source: triangles(&some), ..header("arc", cut(parts)) }
    };
    let all = mesh.triangles.len();
    let job = clients.upload(request(3, all)).await.expect("queued").job;
    assert_eq!(job.state(), JobState::Queued);
    server.kill();

    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    for (parts, count) in [(4, all), (3, all - 1)] {
        let other = clients.upload(request(parts, count)).await.expect_err("another content");
        assert_eq!(other.code(), tonic::Code::AlreadyExists, "{other:?}");
    }
    clients.cancel(&first).await;
    let ended = clients.ended(&job.id).await;
    let three = compound(&mesh, 3);
    assert_eq!(made(&mut clients, ended.clone()).await, (BodyKind::Compound, three.id().to_string(), three.to_json()));
    let again = clients.upload(request(3, all)).await.expect("known");
    assert_eq!((again.created, again.job), (false, ended));
}
