//! Calls to a server beside the same question in process.

use std::error::Error;

use prost::Message;
use sublevel::measure::{Options, Pose, WarmStart, distance};
use sublevel::scene::Crew;
use sublevel::service::proto::blob_service_client::BlobServiceClient;
use sublevel::service::proto::evaluate_request::Question;
use sublevel::service::proto::query_service_client::QueryServiceClient;
use sublevel::service::proto::{EvaluateRequest, Layout, Measure, PairList, UploadBlobRequest};

use super::bricks::{RUNS, brick, bricks, seconds};
use crate::loopback::Loopback;
use crate::panda::{Arm, LoadedArm, Problem, RobotServer, Site, StatesCall};

/// A call, and what it is compared with.
#[derive(Clone, Debug)]
pub(super) struct Call {
    /// The method.
    pub(super) method: String,
    /// What it is about.
    pub(super) about: String,
    /// Items of the call: pairs or states.
    pub(super) items: usize,
    /// Of the items, how many are free; none where that is not asked.
    pub(super) free: Option<usize>,
    pub(super) call_us: f64,
    /// The same in process, on all cores.
    pub(super) inside_us: f64,
    /// As many bytes both ways, with nothing solved; 0 where it is part of what is compared.
    pub(super) transport_us: f64,
}

impl Call {
    /// The call less its transport, over the time in process.
    pub(super) fn ratio(&self) -> f64 {
        (self.call_us - self.transport_us) / self.inside_us
    }
}

/// Pairs of the message.
const PAIRS: usize = 4096;
/// Objects on either side of the pairs.
const SIDE: usize = 64;

/// A message of 4 096 pairs of degree 6, warm, beside the library on all cores, and beside the
/// transport of as many bytes.
pub(super) fn evaluate(crew: &Crew) -> Result<Call, Box<dyn Error>> {
    let server = Loopback::start()?;
    let client = server.connect()?;
    let (scene, body) = (bricks(1, 2 * SIDE, 10.0)?, brick()?);
    let names: Vec<String> = scene.objects().map(|(_, object, _)| object.name.to_string()).collect();
    let poses: Vec<Pose> = scene.objects().map(|(_, _, pose)| *pose).collect();
    server.clients().block_on(async {
        let id = client.create_from_file(body.to_json()).await?.id;
        client.create_scene("bench").await?;
        client.put_objects("bench", names.iter().zip(&poses).map(|(name, pose)| (name.as_str(), &id, *pose))).await
    })?;

    let pairs: Vec<(usize, usize)> = (0..PAIRS).map(|i| (i % SIDE, SIDE + i / SIDE)).collect();
    let (share, mut warm) = (PAIRS.div_ceil(crew.threads()), vec![WarmStart::default(); PAIRS]);
    let inside = seconds(|| {
        std::thread::scope(|scope| {
            for (pairs, warm) in pairs.chunks(share).zip(warm.chunks_mut(share)) {
                scope.spawn(|| {
                    for (&(a, b), warm) in pairs.iter().zip(warm) {
                        let found = distance(&body, &poses[a], &body, &poses[b], &Options::default(), warm);
                        std::hint::black_box(found);
                    }
                });
            }
        });
        Ok(())
    })?;

    let indices: Vec<u8> = pairs.iter().flat_map(|&(a, b)| [a as u32, b as u32]).flat_map(u32::to_le_bytes).collect();
    // What every name takes on the wire beside its letters.
    let sent = indices.len() + names.iter().map(|name| name.len() + 2).sum::<usize>();
    let list = PairList { objects: names, pairs: indices.into(), ..PairList::default() };
    let request = EvaluateRequest {
        scene: "bench".into(),
        question: Some(Question::Pairs(list)),
        measures: vec![Measure::Distance.into()],
        layout: Layout::Columns.into(),
        ..EvaluateRequest::default()
    };
    let mut queries = QueryServiceClient::new(client.channel());
    let call = seconds(|| {
        let response = server.clients().block_on(queries.evaluate(request.clone()))?.into_inner();
        let column = response.columns.first().ok_or("no column")?;
        if column.status.len() == PAIRS { Ok(()) } else { Err("another number of answers".into()) }
    })?;
    // Values and bounds are 8 bytes each, the status one.
    let got = server.clients().block_on(queries.evaluate(request))?.into_inner();
    let got = got.encoded_len();

    let mut blobs = BlobServiceClient::new(client.channel());
    let blob = server.clients().block_on(client.upload(&vec![7; got]))?;
    // A piece of a blob that is never completed: nothing is hashed or written.
    let data = vec![1; sent].into();
    let piece = UploadBlobRequest { blob_id: "5f".repeat(32), total_bytes: 2 * sent as u64, offset: 0, data };
    let up = seconds(|| Ok(server.clients().block_on(blobs.upload_blob(piece.clone())).map(drop)?))?;
    let down = seconds(|| Ok(server.clients().block_on(client.download(&blob)).map(drop)?))?;
    server.stop()?;
    Ok(Call {
        method: "Evaluate".into(),
        about: "pairs of degree 6, warm".into(),
        items: PAIRS,
        free: None,
        call_us: 1e6 * call,
        inside_us: 1e6 * inside,
        transport_us: 1e6 * (up + down),
    })
}

/// States of a robot among the obstacles of problems, beside the same question in process.
pub(super) fn check_states(
    (arm, loaded): (&Arm, &LoadedArm),
    problems: &[&Problem],
    crew: &Crew,
) -> Result<Vec<Call>, Box<dyn Error>> {
    let server = RobotServer::start()?;
    let robot = server.load(loaded)?;
    let mut calls = Vec::new();
    for problem in problems {
        let StatesCall { states, free, call_us, inside_us } =
            server.check_states((arm, loaded, robot), &Site::new(problem)?, (crew, RUNS))?;
        calls.push(Call {
            method: "CheckStates".into(),
            about: format!("{} bodies, {}", loaded.pieces, problem.family),
            items: states,
            free: Some(free),
            call_us,
            inside_us,
            transport_us: 0.0,
        });
    }
    server.stop()?;
    Ok(calls)
}
