//! `sublevel load`.

use std::error::Error;
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};

use super::write_atomically;
use crate::client::{Client, ClientOptions};
use crate::load::{Arrivals, EchoProcess, LoadOptions, LoadReport, Scenario, Watched, connect, measure, prepare};
use crate::robot::counted;

/// Load a running server, and report how long its answers take
///
/// In an open loop: calls are begun when they are due, however long earlier ones take, and their
/// time counts from then on. Beside it runs an echo server of equal message sizes, which shows what
/// the transport alone takes; it is encrypted if the server is. What it makes in the server is
/// removed at the end, also by Ctrl-C.
///
/// A scenario is one of pair, pairs, within, states, mixed, a recording (.jsonl) of
/// 'sublevel record', or a TOML file:
///   objects = 200          # bricks in the scene, in a cube of 2 reach_m
///   reach_m = 4.0
///   pose_rate_hz = 100     # messages a second of a stream that moves a tenth of them
///   [[calls]]
///   kind = "pairs"         # or "within" with margin_m, "states" with states and moving,
///                          # "recorded" with file
///   pairs = 64
///   weight = 2
///
/// Examples:
///   sublevel load pair --rate 1000
///   sublevel load mixed --rate 500,1000,2000,4000 --duration 30 --json load.json --svg load.svg
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct LoadArgs {
    /// Name or file of a scenario
    #[arg(value_name = "SCENARIO", default_value = "pair")]
    scenario: String,
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051")]
    server: String,
    /// Calls a second; several rates are measured one after the other
    #[arg(long, value_name = "RATE", value_delimiter = ',', default_value = "100")]
    rate: Vec<f64>,
    /// Seconds that count, of each rate
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    duration: f64,
    /// Seconds before that
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    warmup: f64,
    /// Connections that the calls are spread over
    #[arg(long, value_name = "N", default_value_t = 4)]
    connections: usize,
    /// Calls arrive at equal distances (constant) or independently of each other (poisson)
    #[arg(long, value_name = "HOW", default_value = "poisson", value_parser = arrivals)]
    arrivals: Arrivals,
    /// Number that scene and arrivals are drawn from
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Do not measure an echo server
    #[arg(long)]
    no_echo: bool,
    /// Core that the echo server runs on; 'taskset' gives the server and this command theirs
    #[arg(long, value_name = "CORE")]
    echo_core: Option<usize>,
    /// Process id of the server, on this machine: reports how busy it keeps the cores, and its
    /// memory
    #[arg(long, value_name = "PID")]
    server_pid: Option<u32>,
    /// File for all numbers
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// File for a picture: latency against offered load
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

fn arrivals(text: &str) -> Result<Arrivals, String> {
    match text {
        "constant" => Ok(Arrivals::Constant),
        "poisson" => Ok(Arrivals::Poisson),
        _ => Err("give constant or poisson".into()),
    }
}

impl LoadArgs {
    fn options(&self) -> Result<LoadOptions, String> {
        let seconds = |flag: &str, value: f64, least: f64| {
            let fits = value >= least && value <= 86_400.0;
            if fits {
                Ok(Duration::from_secs_f64(value))
            } else {
                Err(format!("{flag} {value}: give {least} to 86400"))
            }
        };
        if !(1..=1000).contains(&self.connections) {
            return Err(format!("--connections {}: give 1 to 1000", self.connections));
        }
        if let Some(rate) = self.rate.iter().find(|rate| !(**rate >= 0.01 && **rate <= 1e6)) {
            return Err(format!("--rate {rate}: give calls a second, 0.01 to 1e6"));
        }
        Ok(LoadOptions {
            connections: self.connections,
            arrivals: self.arrivals,
            warmup: seconds("--warmup", self.warmup, 0.0)?,
            duration: seconds("--duration", self.duration, 0.1)?,
            seed: self.seed,
        })
    }
}

/// Measures, and prints a table.
///
/// # Errors
/// What is wrong with the arguments or the scenario, a server that does not answer, and files that
/// cannot be written.
pub(super) fn run(args: &LoadArgs) -> Result<(), Box<dyn Error>> {
    let (options, scenario) = (args.options()?, Scenario::named(&args.scenario)?);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let report = runtime.block_on(load(args, &options, &scenario))?;
    if let Some(path) = &args.json {
        write_atomically(path, &serde_json::to_string_pretty(&report)?)?;
    }
    if let Some(path) = &args.svg {
        write_atomically(path, &report.to_svg()?)?;
    }
    io::stdout().lock().write_all(report.table().as_bytes())?;
    Ok(())
}

async fn load(args: &LoadArgs, options: &LoadOptions, scenario: &Scenario) -> Result<LoadReport, Box<dyn Error>> {
    let clients = connect(&args.server, &ClientOptions::from_environment(), options.connections).await?;
    let prepared = Arc::new(prepare(&clients[0], scenario, options.seed).await?);
    let mut terminate = signal(SignalKind::terminate())?;
    let measured = tokio::select! {
        measured = measured(args, options, scenario, (&prepared, &clients)) => measured,
        _ = tokio::signal::ctrl_c() => Err("stopped by Ctrl-C; nothing is reported".into()),
        _ = terminate.recv() => Err("stopped by SIGTERM; nothing is reported".into()),
    };
    // Also when something went wrong.
    let removed = prepared.remove(&clients[0]).await;
    let report = measured?;
    removed?;
    Ok(report)
}

async fn measured(
    args: &LoadArgs,
    options: &LoadOptions,
    scenario: &Scenario,
    (prepared, clients): (&Arc<crate::load::Prepared>, &[Client]),
) -> Result<LoadReport, Box<dyn Error>> {
    let answer_bytes = prepared.answer_bytes(&clients[0]).await?;
    let stream = (scenario.pose_rate_hz > 0.0)
        .then(|| tokio::spawn(prepared.clone().stream(clients[0].clone(), scenario.pose_rate_hz)));
    let probe = Some(Client::connect_with(&args.server, &ClientOptions::from_environment()).await?);
    let (mut server, watched) = (Vec::new(), Watched { pid: args.server_pid, probe });
    for &rate in &args.rate {
        server.push(measure(prepared, clients, (rate, &watched), options, &mut shown("server", rate)).await?);
    }
    if let Some(stream) = stream {
        stream.abort();
    }
    let mut of_echo = Vec::new();
    if !args.no_echo {
        let echo = std::env::current_exe()
            .and_then(|own| EchoProcess::start(&own, answer_bytes, is_encrypted(&args.server), args.echo_core))
            .map_err(|error| format!("cannot start the echo server: {error}; leave it out with --no-echo"))?;
        let clients = connect(echo.url(), &echo.options(), options.connections).await?;
        let watched = Watched { pid: Some(echo.pid()), probe: None };
        for &rate in &args.rate {
            of_echo.push(measure(prepared, &clients, (rate, &watched), options, &mut shown("echo", rate)).await?);
        }
    }
    Ok(LoadReport {
        scenario: args.scenario.clone(),
        arrivals: match args.arrivals {
            Arrivals::Constant => "constant",
            Arrivals::Poisson => "poisson",
        },
        connections: options.connections,
        encrypted: is_encrypted(&args.server),
        seconds: options.duration.as_secs_f64(),
        server,
        echo: of_echo,
    })
}

/// Whether calls to an address are encrypted. A scheme may have letters of either case.
fn is_encrypted(url: &str) -> bool {
    url.split_once(':').is_some_and(|(scheme, _)| scheme.eq_ignore_ascii_case("https"))
}

/// One line on a terminal, written again and again.
fn shown(target: &'static str, rate: f64) -> impl FnMut(f64, u64) {
    let terminal = io::stderr().is_terminal();
    move |seconds, answered| {
        if terminal {
            // Progress is not worth an error.
            let answers = counted(answered, "answer", "answers");
            let _ = write!(io::stderr(), "\r\x1b[K{target} at {rate}/s: {seconds:.0} s, {answers}\r");
        }
    }
}
