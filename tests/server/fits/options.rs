//! All that `sublevel fit` knows, asked of a server: the very same bodies and files.

use std::ops::ControlFlow;

use sublevel::fit::{self, Mesh, Objective, Progress, Representation, SosMethod};
use sublevel::service::proto::create_fit_request::Part;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::fit_sos_body::Method;
use sublevel::service::proto::{
    FitBody, FitCompound, FitCone, FitInverseMoment, FitJob, FitObjective, FitOptions, FitRelaxed, FitSosBody,
    FitState, FitWithinGap, FittedKind, ListBodiesRequest, ListFitsRequest, MeshFormat,
};

use super::{arc, asked, body, chunk, header, long, message, off, triangles};
use crate::harness::{Clients, Running};

fn unwatched(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Kind, id and file of the one thing that a job made.
fn made(job: FitJob) -> (FittedKind, String, String) {
    let result = job.result.unwrap_or_else(|| panic!("{}", job.failure));
    let [made] = &result.bodies[..] else { panic!("{result:?}") };
    let file = String::from_utf8(made.file_json.to_vec()).expect("text");
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

fn sos(mesh: &Mesh, method: SosMethod) -> (FittedKind, String, String) {
    let (coordinates, input) = (fit::Coordinates::Unit, String::new());
    let options = fit::SosOptions { degree: 4, method, coordinates, input };
    let body = fit::fit_sos("arc", &mesh.points, &mesh.triangles, &options, &mut unwatched).expect("a set").body;
    assert!(body.covered().is_some_and(|covered| covered.triangles == mesh.triangles.len()));
    (FittedKind::SosBody, body.id().to_string(), body.to_json())
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
        (FittedKind::Body, body.id().to_string(), String::new())
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
        let found = made(job);
        clients.body(&found.1).await;
        assert_eq!(found, expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn compounds_and_sets_are_kept_with_their_jobs() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mesh = arc();
    let three = compound(&mesh, 3);
    let file_of =
        |compound: &sublevel::body::Compound| (FittedKind::Compound, compound.id().to_string(), compound.to_json());
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
        assert_eq!(made(job.clone()), *expected, "{options:?}");
        let reported = job.options.clone().expect("options");
        assert_eq!(method(&reported), method(options), "{reported:?}");
        jobs.push(job);
    }
    let bodies = clients.bodies.list_bodies(ListBodiesRequest::default()).await.expect("a list").into_inner().bodies;
    assert!(bodies.is_empty(), "no body has been made");

    // The file comes with the job alone, and is there after a kill.
    server.kill();
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    for job in &jobs {
        assert_eq!(clients.job(&job.id).await, *job);
        assert_eq!(clients.cancel(&job.id).await, *job);
    }
    let mut listed = clients.fits.list_fits(ListFitsRequest::default()).await.expect("a list").into_inner().jobs;
    assert_eq!(listed.len(), jobs.len());
    for (listed, job) in listed.iter_mut().zip(&jobs) {
        assert_ne!(listed, job);
        let file = job.result.as_ref().unwrap().bodies[0].file_json.clone();
        listed.result.as_mut().unwrap().bodies[0].file_json = file;
        assert_eq!(listed, job, "nothing but the file is left out");
    }
}

/// Points alone do not tell where to cut, and a mesh file says as much as triangles that are sent.
#[tokio::test(flavor = "multi_thread")]
async fn triangles_come_as_chunks_or_in_a_mesh_file() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mesh = arc();
    let two = compound(&mesh, 2);
    let mut from_file = header("arc", cut(2));
    from_file.mesh_format = MeshFormat::Off.into();
    let mut messages = vec![message(Part::Header(from_file))];
    messages.extend(off(&mesh).into_bytes().chunks(1000).map(|bytes| message(Part::Mesh(bytes.to_vec().into()))));
    let id = clients.upload(messages).await.expect("queued").job.expect("a job").id;
    let (_, id, file) = made(clients.ended(&id).await);
    assert_eq!((id, file), (two.id().to_string(), two.to_json()));

    let gap = within(two.gap_m().expect("a gap") * 1.0001, 8);
    let id = clients.queue(header("arc", gap.clone()), &mesh.points).await.id;
    assert_eq!(made(clients.ended(&id).await).0, FittedKind::Body);
    // What is trimmed or thickened has lost them.
    for options in [FitOptions { trim: 0.02, ..gap.clone() }, FitOptions { min_thickness_m: Some(1.0), ..gap }] {
        assert_eq!(made(ended(&mut clients, options, &mesh).await).0, FittedKind::Body);
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
        let mut header = header("arc", cut(parts));
        header.request_id = "1679091c".into();
        vec![message(Part::Header(header)), chunk(&mesh.points), triangles(&mesh.triangles[..count])]
    };
    let all = mesh.triangles.len();
    let job = clients.upload(request(3, all)).await.expect("queued").job.expect("a job");
    assert_eq!(job.state(), FitState::Queued);
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
    assert_eq!(made(ended.clone()), (FittedKind::Compound, three.id().to_string(), three.to_json()));
    let again = clients.upload(request(3, all)).await.expect("known");
    assert_eq!((again.created, again.job), (false, Some(ended)));
}
