//! Fit jobs as their users meet them: uploads, progress, cancelling, restarts, refusals.

mod command;
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
use sublevel::service::proto::create_fit_request::Part;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::{
    CancelFitRequest, CreateFitRequest, CreateFitResponse, FitBody, FitHeader, FitJob, FitOptions, FitState,
    GetBodyRequest, GetFitRequest, PointChunk, TriangleChunk, WatchFitRequest, WatchFitResponse,
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
fn arc() -> Mesh {
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

fn triangles(triangles: &[[usize; 3]]) -> CreateFitRequest {
    let corners = triangles.iter().flatten().map(|&corner| corner as u32).collect();
    message(Part::Triangles(TriangleChunk { corners }))
}

fn header(name: &str, options: FitOptions) -> FitHeader {
    FitHeader { name: name.into(), options: Some(options), ..FitHeader::default() }
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

fn message(part: Part) -> CreateFitRequest {
    CreateFitRequest { part: Some(part) }
}

fn chunk(points: &[Vector3<f64>]) -> CreateFitRequest {
    let coordinates = points.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
    message(Part::Points(PointChunk { coordinates }))
}

impl Clients {
    async fn upload(&mut self, messages: Vec<CreateFitRequest>) -> Result<CreateFitResponse, Status> {
        Ok(self.fits.create_fit(tokio_stream::iter(messages)).await?.into_inner())
    }

    /// Queues a job about these points.
    async fn queue(&mut self, header: FitHeader, points: &[Vector3<f64>]) -> FitJob {
        let mut messages = vec![message(Part::Header(header))];
        messages.extend(points.chunks(50_000).map(chunk));
        self.upload(messages).await.expect("queued").job.expect("a job")
    }

    /// Queues a job about this mesh.
    async fn queue_mesh(&mut self, header: FitHeader, mesh: &Mesh) -> FitJob {
        let (some, others) = mesh.triangles.split_at(mesh.triangles.len() / 3);
        let messages = vec![message(Part::Header(header)), triangles(some), chunk(&mesh.points), triangles(others)];
        self.upload(messages).await.expect("queued").job.expect("a job")
    }

    async fn job(&mut self, id: &str) -> FitJob {
        self.fits.get_fit(GetFitRequest { id: id.into() }).await.expect("there").into_inner().job.expect("a job")
    }

    async fn cancel(&mut self, id: &str) -> FitJob {
        let request = CancelFitRequest { id: id.into() };
        self.fits.cancel_fit(request).await.expect("cancelled").into_inner().job.expect("a job")
    }

    async fn watch(&mut self, id: &str) -> Streaming<WatchFitResponse> {
        self.fits.watch_fit(WatchFitRequest { id: id.into() }).await.expect("a watch").into_inner()
    }

    /// Waits until the job is being solved: past its hull, in the middle of its first program.
    async fn under_way(&mut self, id: &str) -> FitJob {
        let mut watch = self.watch(id).await;
        let start = Instant::now();
        loop {
            let job = next(&mut watch).await.expect("it goes on").expect("it has not ended");
            if job.progress.is_some_and(|progress| progress.iterations > 0) {
                assert_eq!(job.state(), FitState::Running);
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

    /// The stored body, re-proven from its file.
    async fn body(&mut self, id: &str) -> Body {
        let response = self.bodies.get_body(GetBodyRequest { id: id.into() }).await.expect("stored").into_inner();
        let body = Body::from_json(std::str::from_utf8(&response.body_file_json).expect("text")).expect("proven");
        assert_eq!(body.id().to_string(), id);
        body
    }
}

/// The next message of a watch; none at its end.
async fn next(watch: &mut Streaming<WatchFitResponse>) -> Result<Option<FitJob>, Status> {
    let message = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time")?;
    Ok(message.map(|message| message.job.expect("a job")))
}
