//! Scenes and questions: what the service adds to the library, and how scenes grow.
//!
//! ```text
//! cargo bench -p sublevel-bench --bench scenes
//! ```
//!
//! Medians of several runs, all cores; ratios within one run are what counts.

use std::error::Error;
use std::net::{Ipv4Addr, SocketAddr};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use sublevel::body::{Body, BodyId, Shape};
use sublevel::client::{Client, Question, StatesQuestion};
use sublevel::fit;
use sublevel::measure::{Options, Pose, WarmStart, distance};
use sublevel::scene::query::{Ask, Found, Measure, Operand, Pairs, Selection, StateVerdict, States, Within, combined};
use sublevel::scene::{Crew, Geometry, Ladder, Placement, Scene, Slot, Update};
use sublevel::service::proto::{Layout, Verdict};
use sublevel::service::{ServeOptions, Server};
use sublevel_testkit::Seeded;

fn main() -> Result<(), Box<dyn Error>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    println!("{threads} threads, {}\n", sublevel::polynomial::widest());
    let crew = Crew::new(threads)?;
    messages(threads)?;
    ticks(&crew)?;
    forks()?;
    ladders(&crew)
}

/// Median time of several runs after one that finds everything cold.
fn median(mut run: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<Duration, Box<dyn Error>> {
    run()?;
    let mut times = Vec::new();
    for _ in 0..11 {
        let start = Instant::now();
        run()?;
        times.push(start.elapsed());
    }
    times.sort();
    Ok(times[times.len() / 2])
}

fn brick() -> Result<Body, Box<dyn Error>> {
    Ok(Body::superellipsoid("brick", Vector3::zeros(), Vector3::new(0.5, 0.3, 0.2), 6)?)
}

/// A scene of so many bricks in a cube of this half edge, metres.
fn bricks(seed: u64, count: usize, reach: f64) -> Result<Scene, Box<dyn Error>> {
    let (mut random, body) = (Seeded(seed), Geometry::from(brick()?));
    let place = |index: usize, pose: Pose| Placement {
        name: format!("brick-{index}").into(),
        body: *body.id(),
        pose: Some(pose),
        group: "".into(),
        padding_m: None,
        attachment: None,
    };
    let pose = |random: &mut Seeded| {
        let translation = reach * Vector3::from_fn(|_, _| random.signed());
        Pose::from_quaternion(translation, random.rotation().coords.into())
    };
    let upserts =
        (0..count).map(|index| Ok(place(index, pose(&mut random)?))).collect::<Result<_, Box<dyn Error>>>()?;
    Ok(Scene::new("bench", 0)?.updated(&Update { upserts, ..Update::default() }, |_: &BodyId| Some(body.clone()))?)
}

/// Messages of pairs and of states over gRPC, beside the library's time for the same.
fn messages(threads: usize) -> Result<(), Box<dyn Error>> {
    let data = tempfile::Builder::new().prefix("sublevel-bench-").tempdir()?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = runtime.block_on(Server::bind(ServeOptions { listen, data: data.path().to_owned() }))?;
    let url = format!("http://{}", server.local_addr());
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let serving = runtime.spawn(server.run(async {
        let _ = stopped.await;
    }));
    let client = runtime.block_on(Client::connect(&url))?;
    let (count, size) = (128_usize, 4096_usize);
    let scene = bricks(1, count, 10.0)?;
    let names: Vec<String> = scene.objects().map(|(_, object, _)| object.name.to_string()).collect();
    let poses: Vec<Pose> = scene.objects().map(|(_, _, pose)| *pose).collect();
    runtime.block_on(async {
        let id = client.create_from_file(brick()?.to_json()).await?.id;
        client.create_scene("bench").await?;
        let objects = names.iter().zip(&poses).map(|(name, pose)| (name.as_str(), &id, *pose));
        client.put_objects("bench", objects).await?;
        Ok::<_, Box<dyn Error>>(())
    })?;

    // The library, warm, the pairs split over all cores.
    let body = brick()?;
    let pairs: Vec<(usize, usize)> = (0..size).map(|i| (i % 64, 64 + i / 64)).collect();
    let mut warm: Vec<WarmStart> = vec![WarmStart::default(); size];
    let library = median(|| {
        std::thread::scope(|scope| {
            for (pairs, warm) in pairs.chunks(size.div_ceil(threads)).zip(warm.chunks_mut(size.div_ceil(threads))) {
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
    let named = pairs.iter().map(|&(a, b)| (names[a].as_str(), names[b].as_str()));
    let mut question = Question::pairs(named);
    let indices: Vec<u8> = pairs.iter().flat_map(|&(a, b)| [a as u32, b as u32]).flat_map(u32::to_le_bytes).collect();
    let list = sublevel::service::proto::PairList {
        objects: names.clone(),
        pairs: indices.clone().into(),
        ..Default::default()
    };
    let request = question.request_mut();
    request.question = Some(sublevel::service::proto::evaluate_request::Question::Pairs(list));
    (request.layout, request.outputs, request.scene) = (Layout::Columns.into(), Vec::new(), "bench".into());
    request.measures = vec![sublevel::service::proto::Measure::Distance.into()];
    let request = request.clone();
    let mut queries = sublevel::service::proto::query_service_client::QueryServiceClient::new(client.channel());
    let service = median(|| {
        let response = runtime.block_on(queries.evaluate(request.clone()))?.into_inner();
        if response.columns[0].status.len() == size { Ok(()) } else { Err("another number of answers".into()) }
    })?;
    // As many bytes both ways, and nothing solved.
    let (sent, got) = (indices.len() + 12 * count, 17 * size);
    let blob = runtime.block_on(client.upload(&vec![7; got]))?;
    let mut blobs = sublevel::service::proto::blob_service_client::BlobServiceClient::new(client.channel());
    let piece = sublevel::service::proto::UploadBlobRequest {
        blob_id: "5f".repeat(32),
        total_bytes: (2 * sent) as u64,
        offset: 0,
        data: vec![1; sent].into(),
    };
    let up = median(|| {
        runtime.block_on(blobs.upload_blob(piece.clone()))?;
        Ok(())
    })?;
    let down = median(|| {
        runtime.block_on(client.download(&blob))?;
        Ok(())
    })?;
    let times = [service, library, up, down].map(|time| time.as_secs_f64() * 1e6);
    println!(
        "Evaluate, {size} pairs of degree 6, warm: {:.0} µs; library {:.0} µs, echo {:.0} µs",
        times[0],
        times[1],
        times[2] + times[3]
    );
    println!("  less the echo, over the library: {:.2}\n", (times[0] - times[2] - times[3]) / times[1]);

    // States of eleven bodies among the others.
    let (states, moving) = (1000, 11);
    let state_poses: Vec<Pose> = (0..states)
        .flat_map(|state| {
            let x = 0.01 * state as f64 - 5.0;
            (0..moving)
                .map(|k| Pose::from_quaternion(Vector3::new(x, k as f64 - 5.0, 0.0), [0.0, 0.0, 0.0, 1.0]))
                .collect::<Vec<_>>()
        })
        .collect::<Result<_, _>>()?;
    let objects = || names[..moving].iter().map(String::as_str);
    let mut checked = Vec::new();
    let service = median(|| {
        let question = StatesQuestion::new(objects()).with_states(&state_poses);
        checked = runtime.block_on(client.check_states("bench", question))?.verdicts;
        Ok(())
    })?;
    let slots: Vec<Slot> = objects().filter_map(|name| scene.slot(name)).collect();
    let packed: Vec<f64> = state_poses.iter().flat_map(numbers).collect();
    let crew = Crew::new(threads)?;
    let mut verdicts = Vec::new();
    let library = median(|| {
        let question = States::new(scene.clone(), &slots, packed.clone(), 0.0, false)?;
        verdicts = crew.ask(Arc::new(question), Arc::default())?.concat();
        Ok(())
    })?;
    let free = verdicts.iter().filter(|answer| answer.verdict == StateVerdict::Free).count();
    assert_eq!(free, checked.iter().filter(|&&verdict| verdict == Verdict::Free).count());
    let times = [service, library].map(|time| time.as_secs_f64() * 1e6);
    println!(
        "CheckStates, {states} states of {moving} bodies, {free} free: {:.0} µs; in process {:.0} µs ({:.2})\n",
        times[0],
        times[1],
        times[0] / times[1]
    );
    let _ = stop.send(());
    runtime.block_on(serving)??;
    runtime.shutdown_timeout(Duration::from_secs(1));
    Ok(())
}

fn numbers(pose: &Pose) -> [f64; 7] {
    let (t, q) = (pose.translation(), pose.rotation().coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

/// A tenth of the objects moves, and everything nearer to them than 5 cm is asked for.
fn ticks(crew: &Crew) -> Result<(), Box<dyn Error>> {
    println!("objects  moved  near pairs  tick ms  of that solving ms  ratio");
    for count in [1_000_usize, 3_000, 10_000, 30_000, 100_000] {
        // As dense whatever the number: about five near pairs for each moved object.
        let mut scene = bricks(3, count, 0.40 * (count as f64).cbrt())?;
        let mut random = Seeded(4);
        let moved: Vec<Slot> = (0..count as u32).filter(|slot| slot % 10 == 0).collect();
        let ask = Ask::new(vec![Measure::Distance])?;
        let (mut found, mut solving): (Vec<Found>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut ticks = Vec::new();
        for _ in 0..9 {
            let step = |slot: Slot, random: &mut Seeded| {
                let pose = scene.pose(slot)?;
                let by = 0.01 * Vector3::from_fn(|_, _| random.signed());
                Pose::from_quaternion(pose.translation() + by, pose.rotation().coords.into())
                    .ok()
                    .map(|pose| (slot, pose))
            };
            let poses: Vec<(Slot, Pose)> = moved.iter().filter_map(|&slot| step(slot, &mut random)).collect();
            let start = Instant::now();
            scene = scene.with_poses(&poses)?;
            let selection = Selection::of(&scene, moved.iter().copied(), &Default::default());
            let question = Within::new(scene.clone(), ask.clone(), selection, 0.05);
            found = combined(&scene, crew.ask(Arc::new(question), Arc::default())?).0;
            ticks.push(start.elapsed().as_secs_f64() * 1e3);
            // The same pairs, known beforehand.
            let operands = (0..count as u32).map(Operand::Object).collect();
            let question =
                Pairs::new(scene.clone(), ask.clone(), operands, found.iter().map(|found| found.pair).collect())?;
            let start = Instant::now();
            crew.ask(Arc::new(question), Arc::default())?;
            solving.push(start.elapsed().as_secs_f64() * 1e3);
        }
        ticks.sort_by(f64::total_cmp);
        solving.sort_by(f64::total_cmp);
        let (tick, solve) = (ticks[4], solving[4]);
        println!(
            "{count:>7}  {:>5}  {:>10}  {tick:>7.2}  {solve:>18.2}  {:>5.2}",
            moved.len(),
            found.len(),
            tick / solve
        );
    }
    println!();
    Ok(())
}

fn forks() -> Result<(), Box<dyn Error>> {
    let scene = bricks(5, 10_000, 9.0)?;
    let fork = median(|| {
        std::hint::black_box(scene.fork("fork")?);
        Ok(())
    })?;
    println!("fork of a scene of 10 000 objects: {:.2} µs\n", fork.as_secs_f64() * 1e6);
    Ok(())
}

/// Decisions of a cluttered scene with ladders and with their finest rungs alone.
fn ladders(crew: &Crew) -> Result<(), Box<dyn Error>> {
    let mut random = Seeded(6);
    let points: Vec<Vector3<f64>> =
        (0..60).map(|_| Vector3::new(0.3 * random.signed(), 0.2 * random.signed(), 0.1 * random.signed())).collect();
    let options = fit::FitOptions { degree: 6, ..fit::FitOptions::default() };
    let rungs = fit::ladder("object", &points, &options, &mut |_| ControlFlow::Continue(()))?;
    let rungs: Vec<Arc<Shape>> = rungs.into_iter().map(|rung| Arc::new(Shape::Body(Box::new(rung.body)))).collect();
    let finest = Geometry::Solid(rungs[rungs.len() - 1].clone());
    let ladder = Geometry::Ladder(Arc::new(Ladder::new("object", rungs)?));
    let mut results = Vec::new();
    for (name, geometry) in [("degree 6", finest), ("ladder", ladder)] {
        let mut random = Seeded(7);
        let place = |index: usize, pose: Pose| Placement {
            name: format!("o{index}").into(),
            body: *geometry.id(),
            pose: Some(pose),
            group: "".into(),
            padding_m: None,
            attachment: None,
        };
        let upserts = (0..400).map(|index| place(index, random.pose(2.0))).collect();
        let scene = Scene::new("clutter", 0)?
            .updated(&Update { upserts, ..Update::default() }, |_: &BodyId| Some(geometry.clone()))?;
        let slots: Vec<Slot> = (0..11).collect();
        let packed: Vec<f64> = (0..500 * 11).flat_map(|_| numbers(&random.pose(2.0))).collect();
        let mut verdicts = Vec::new();
        let time = median(|| {
            let question = States::new(scene.clone(), &slots, packed.clone(), 0.0, false)?;
            let answers = crew.ask(Arc::new(question), Arc::default())?.concat();
            verdicts = answers.iter().map(|answer| answer.verdict).collect();
            Ok(())
        })?;
        let free = verdicts.iter().filter(|&&verdict| verdict == StateVerdict::Free).count();
        println!("{name}: 500 states of 11 among 400 objects, {free} free: {:.2} ms", time.as_secs_f64() * 1e3);
        results.push((time, verdicts));
    }
    assert!(results[0].1 == results[1].1, "the decisions differ");
    println!("  degree 6 over ladder: {:.2}, same decisions", results[0].0.as_secs_f64() / results[1].0.as_secs_f64());
    Ok(())
}
