//! The commands: arguments in, tables or JSON out, errors as one line.
//!
//! Standard output has results only; progress and logs go to standard error.

mod backup;
#[cfg(feature = "fit")]
mod certify;
#[cfg(feature = "fit")]
mod demo;
mod echo;
mod files;
#[cfg(feature = "fit")]
mod fit;
#[cfg(feature = "fit")]
mod group;
mod health;
#[cfg(feature = "fit")]
mod hierarchy;
mod load;
mod measure;
#[cfg(feature = "fit")]
mod mesh;
mod numbers;
mod outcome;
mod poses;
mod primitive;
#[cfg(feature = "fit")]
mod progress;
mod push;
mod record;
#[cfg(feature = "fit")]
mod remote;
#[cfg(feature = "fit")]
mod robot;
mod scene;
mod scene_picture;
mod serve;
mod show;
mod sos_body;
mod token;
mod verify;
mod verify_args;

use clap::Parser;
pub use files::{read, write_atomically};
pub use outcome::{Outcome, exit_code};
use std::process::ExitCode;

/// Real-time collision and proximity queries on certified convex polynomial bodies
///
/// Objects are stored as sets {x : p(x) <= 1} of sos-convex polynomials, fitted offline around
/// meshes and proven to contain them. Every answer is a bracket that is proven to contain the
/// truth.
///
#[cfg_attr(
    feature = "fit",
    doc = "A first tour: 'sublevel demo'. With meshes of your own: 'fit', then 'measure' without a server, or 'serve' and 'push'."
)]
#[cfg_attr(
    not(feature = "fit"),
    doc = "Built without the feature 'fit': 'fit', 'certify', 'hierarchy', 'robot' and 'demo' are left out."
)]
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100)]
enum Command {
    #[cfg(feature = "fit")]
    Demo(demo::DemoArgs),
    #[cfg(feature = "fit")]
    Fit(fit::args::FitArgs),
    Show(show::ShowArgs),
    Verify(verify_args::VerifyArgs),
    #[cfg(feature = "fit")]
    Certify(certify::CertifyArgs),
    Measure(measure::MeasureArgs),
    #[cfg(feature = "fit")]
    Hierarchy(hierarchy::HierarchyArgs),
    Serve(serve::ServeArgs),
    Push(push::PushArgs),
    Primitive(primitive::PrimitiveArgs),
    #[cfg(feature = "fit")]
    Robot(robot::args::RobotArgs),
    Scene(scene::SceneArgs),
    Health(health::HealthArgs),
    Token(token::TokenArgs),
    Load(load::LoadArgs),
    Record(record::RecordArgs),
    #[command(hide = true)]
    Echo(echo::EchoArgs),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
}

/// Runs the command line of this process. Exit code 0: done; 1: failed, with one line on standard
/// error, or a checked claim is not proven; 2: the arguments are wrong.
pub fn main() -> ExitCode {
    let done = |()| true;
    let outcome: Outcome = match Command::parse() {
        #[cfg(feature = "fit")]
        Command::Demo(args) => demo::run(&args).map(done).map_err(Into::into),
        #[cfg(feature = "fit")]
        Command::Fit(args) => fit::run(&args).map(done),
        Command::Show(args) => show::run(&args).map(done),
        Command::Verify(args) => verify::run(&args),
        #[cfg(feature = "fit")]
        Command::Certify(args) => certify::run(&args).map(done),
        Command::Measure(args) => measure::run(&args).map(done),
        #[cfg(feature = "fit")]
        Command::Hierarchy(args) => hierarchy::run(&args).map(done),
        Command::Serve(args) => serve::run(&args).map(done),
        Command::Push(args) => push::run(&args).map(done),
        Command::Primitive(args) => primitive::run(&args).map(done),
        #[cfg(feature = "fit")]
        Command::Robot(args) => robot::run(&args).map(done),
        Command::Scene(args) => scene::run(&args).map(done),
        Command::Health(args) => health::run(&args),
        Command::Token(args) => token::run(&args).map(done),
        Command::Load(args) => load::run(&args).map(done),
        Command::Record(args) => record::run(&args).map(done),
        Command::Echo(args) => echo::run(&args).map(done),
        Command::Backup(args) => backup::backup(&args).map(done),
        Command::Restore(args) => backup::restore(&args).map(done),
    };
    exit_code(outcome)
}
