//! Fit jobs as their users meet them: uploads, progress, cancelling, restarts, refusals.

mod command;
mod counted;
mod groups;
mod jobs;
mod options;
mod refused;
mod restarts;
mod uploads;

use std::time::Instant;

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::fit::Mesh;
use sublevel::scene::Geometry;
use sublevel::service::proto::create_fit_request::Source;
use sublevel::service::proto::fit_mesh::Content;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::fit_points::{Coordinates, Corners};
use sublevel::service::proto::job::Task;
use sublevel::service::proto::{
    CancelJobRequest, CreateFitRequest, FitBody, FitMesh, FitOptions, FitPoints, FitProgress, FitResult,
    GetBodyRequest, GetJobRequest, Job, JobState, WatchJobRequest, WatchJobResponse, get_body_response,
};
use tonic::{Status, Streaming};

use crate::harness::{Clients, Numbers, PATIENCE};

/// Points on a ball with a bite of noise, metres: all but a few are vertices of their hull.
fn cloud(count: usize, seed: u64) -> Vec<Vector3<f64>> {
    let mut numbers = Numbers(seed);
    let mut number = || numbers.next();
    (0..count).map(|_| Vector3::new(number(), number(), number()).normalize() * (1.0 + 0.01 * number())).collect()
}

/// A quarter of a ring, open at both ends and turned so that no axis fits it, metres.
pub(crate) fn arc() -> Mesh {
    let turn = nalgebra::Rotation3::from_euler_angles(0.4, -0.3, 0.9);
    let (along, around) = (16, 8);
    let point = |k: u32| {
        let (i, j) = (f64::from(k / around), f64::from(k % around));
        let (a, b) = (1.6 * i / f64::from(along), std::f64::consts::TAU * j / f64::from(around));
        let r = 1.0 + 0.2 * b.cos();
        turn * Vector3::new(r * a.cos(), r * a.sin(), 0.2 * b.sin())
    };
    let at = |i: u32, j: u32| (i * around + j % around) as usize;
    let cells = (0..along - 1).flat_map(|i| (0..around).map(move |j| (i, j)));
    let halves = |(i, j)| [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]];
    Mesh { points: (0..along * around).map(point).collect(), triangles: cells.flat_map(halves).collect() }
}

/// The text of a mesh file that is read back exactly.
fn off(mesh: &Mesh) -> String {
    let mut text = format!("OFF\n{} {} 0\n", mesh.points.len(), mesh.triangles.len());
    mesh.points.iter().for_each(|point| text += &format!("{} {} {}\n", point.x, point.y, point.z));
    mesh.triangles.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text
}

/// What a fit is asked for, before its points.
fn header(name: &str, options: FitOptions) -> CreateFitRequest {
    CreateFitRequest { name: name.into(), options: Some(options), ..CreateFitRequest::default() }
}

fn asked(mode: Mode) -> FitOptions {
    FitOptions { mode: Some(mode), ..FitOptions::default() }
}

/// One body of this degree.
fn body(degree: u32) -> FitBody {
    FitBody { degree: Some(degree), ..FitBody::default() }
}

/// Fits in well below a second.
fn quick() -> FitOptions {
    asked(Mode::Body(body(2)))
}

/// Fits for much longer than any test waits for it to begin.
fn long() -> FitOptions {
    asked(Mode::Body(FitBody { refine: true, slabs: 15, ..body(8) }))
}

fn coordinates(points: &[Vector3<f64>]) -> Vec<u8> {
    points.iter().flatten().flat_map(|number| number.to_le_bytes()).collect()
}

fn corners(triangles: &[[usize; 3]]) -> Vec<u8> {
    triangles.iter().flatten().flat_map(|&corner| (corner as u32).to_le_bytes()).collect()
}

/// Points without triangles, in the message itself.
fn points(points: &[Vector3<f64>]) -> Option<Source> {
    let coordinates = Some(Coordinates::Points(coordinates(points).into()));
    Some(Source::Points(FitPoints { coordinates, corners: None }))
}

/// Points with triangles, in the message itself.
fn triangles(mesh: &Mesh) -> Option<Source> {
    let coordinates = Some(Coordinates::Points(coordinates(&mesh.points).into()));
    let corners = Some(Corners::Triangles(corners(&mesh.triangles).into()));
    Some(Source::Points(FitPoints { coordinates, corners }))
}

/// A mesh file in the message itself.
fn mesh_file(format: i32, file: &str) -> Option<Source> {
    Some(Source::Mesh(FitMesh { format, content: Some(Content::File(file.to_owned().into_bytes().into())) }))
}

/// A job as tests look at it.
#[derive(Clone, Debug, PartialEq)]
struct FitJob {
    id: String,
    name: String,
    options: Option<FitOptions>,
    point_count: u64,
    state: JobState,
    attempts: u32,
    failure: String,
    progress: Option<FitProgress>,
    result: Option<FitResult>,
}

impl FitJob {
    fn state(&self) -> JobState {
        self.state
    }
}

impl From<Job> for FitJob {
    fn from(job: Job) -> Self {
        let (state, Job { id, attempts, failure, task, .. }) = (job.state(), job);
        let Some(Task::Fit(fit)) = task else { panic!("a fit") };
        let (name, options, point_count) = (fit.name, fit.options, fit.point_count);
        Self { id, name, options, point_count, state, attempts, failure, progress: fit.progress, result: fit.result }
    }
}

/// What a call that makes a job answers, with the job.
#[derive(Debug)]
struct Created {
    job: FitJob,
    created: bool,
}

impl Clients {
    async fn upload(&mut self, request: CreateFitRequest) -> Result<Created, Status> {
        let response = self.fits.create_fit(request).await?.into_inner();
        Ok(Created { job: self.job(&response.job_id).await, created: response.created })
    }

    /// Queues a job about these points; many are sent as a blob.
    async fn queue(&mut self, header: CreateFitRequest, cloud: &[Vector3<f64>]) -> FitJob {
        let source = if cloud.is_empty() {
            None
        } else if cloud.len() > 10_000 {
            let client = sublevel::client::Client::connect(&self.url).await.expect("the server answers");
            let blob = client.upload(&coordinates(cloud)).await.expect("uploaded");
            let coordinates = Some(Coordinates::PointsBlobId(blob));
            Some(Source::Points(FitPoints { coordinates, corners: None }))
        } else {
            points(cloud)
        };
        self.upload(CreateFitRequest { source, ..header }).await.expect("queued").job
    }

    /// Queues a job about this mesh.
    async fn queue_mesh(&mut self, header: CreateFitRequest, mesh: &Mesh) -> FitJob {
        self.upload(CreateFitRequest { source: triangles(mesh), ..header }).await.expect("queued").job
    }

    async fn job(&mut self, id: &str) -> FitJob {
        let response = self.jobs.get_job(GetJobRequest { id: id.into() }).await.expect("there").into_inner();
        response.job.expect("a job").into()
    }

    async fn cancel(&mut self, id: &str) -> FitJob {
        let request = CancelJobRequest { id: id.into() };
        self.jobs.cancel_job(request).await.expect("cancelled").into_inner().job.expect("a job").into()
    }

    async fn watch(&mut self, id: &str) -> Streaming<WatchJobResponse> {
        self.jobs.watch_job(WatchJobRequest { id: id.into() }).await.expect("a watch").into_inner()
    }

    /// Waits until the job is being solved: past its hull, in the middle of its first program.
    async fn under_way(&mut self, id: &str) -> FitJob {
        let mut watch = self.watch(id).await;
        let start = Instant::now();
        loop {
            let job = next(&mut watch).await.expect("it goes on").expect("it has not ended");
            if job.progress.is_some_and(|progress| progress.iterations > 0) {
                assert_eq!(job.state(), JobState::Running);
                return job;
            }
            assert!(start.elapsed() < PATIENCE, "{job:?}");
        }
    }

    /// Waits for the end of a job.
    async fn ended(&mut self, id: &str) -> FitJob {
        let mut watch = self.watch(id).await;
        let mut last = None;
        while let Some(job) = next(&mut watch).await.expect("it goes on") {
            last = Some(job);
        }
        last.expect("a state")
    }

    /// The file of a stored body of any kind.
    async fn file(&mut self, id: &str) -> String {
        let response = self.bodies.get_body(GetBodyRequest { id: id.into() }).await.expect("stored").into_inner();
        let Some(get_body_response::Content::File(file)) = response.content else { panic!("a file") };
        let file = String::from_utf8(file.to_vec()).expect("text");
        assert_eq!(Geometry::from_json(&file).expect("proven").id().to_string(), id);
        file
    }

    /// The stored body, re-proven from its file.
    async fn body(&mut self, id: &str) -> Body {
        Body::from_json(&self.file(id).await).expect("proven")
    }
}

/// The next message of a watch; none at its end.
async fn next(watch: &mut Streaming<WatchJobResponse>) -> Result<Option<FitJob>, Status> {
    let message = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time")?;
    Ok(message.map(|message| message.job.expect("a job").into()))
}
