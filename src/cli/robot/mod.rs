//! `sublevel robot`.

pub(super) mod args;
mod link_fit;
mod pairs;
mod report;

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, Write};
use std::sync::Arc;

use crate::cli::files::{make_folder, read};
use crate::cli::push;
use crate::client::{Client, ClientOptions, StoredRobot};
use crate::robot::{Semantics, read_srdf, read_urdf};
use crate::scene::{Geometry, Robot, RobotId};
use crate::store::{LoadedRobot, RobotSource};
use args::RobotArgs;
use link_fit::{FittedLink, fit_links};
use pairs::derived;
use report::Report;

/// Fits the links that are meshes, checks the robot as a whole, and loads it into a server if one
/// is named.
pub(super) fn run(args: &RobotArgs) -> Result<(), Box<dyn Error>> {
    let urdf = read(&args.urdf)?;
    let description = read_urdf(&urdf).map_err(|error| format!("{}: {error}", args.urdf.display()))?;
    let srdf = args.srdf.as_deref().map(read).transpose()?.unwrap_or_default();
    let semantics = match &args.srdf {
        Some(path) => read_srdf(&srdf, &description).map_err(|error| format!("{}: {error}", path.display()))?,
        None => Semantics::default(),
    };
    for warning in &semantics.warnings {
        eprintln!("note: {}: {warning}", args.srdf.as_deref().unwrap_or(&args.urdf).display());
    }
    make_folder(&args.out)?;
    let fits = fit_links(args, &description)?;
    let bodies: BTreeMap<Arc<str>, Geometry> =
        fits.iter().map(|fit| (fit.link.clone(), fit.geometry.clone())).collect();
    let ids = bodies.iter().map(|(link, geometry)| (&**link, geometry.id()));
    let id = RobotId::of(&urdf, &srdf, ids);
    let robot = Robot::new(id, &description, &semantics, &bodies)
        .map_err(|error| format!("{}: {error}", args.urdf.display()))?;
    let mut report = Report::new(&robot, &semantics, &fits);
    let bodies = bodies.iter().map(|(link, body)| (link.clone(), *body.id())).collect();
    let source = RobotSource { urdf, srdf, bodies };
    if let Some(url) = &args.server {
        report.loaded(&load(url, &source, &fits)?);
    }
    if args.pairs {
        let loaded = LoadedRobot { source, robot: Arc::new(robot), description, semantics };
        report.derived(derived(&loaded)?);
    }
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        report.write(&mut out)?;
    }
    Ok(())
}

/// Stores the bodies of the links, then the robot.
fn load(url: &str, source: &RobotSource, fits: &[FittedLink]) -> Result<StoredRobot, Box<dyn Error>> {
    let files: Vec<_> = fits.iter().map(|fit| fit.file.clone()).collect();
    push::store(url, &files)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let client = Client::connect_with(url, &ClientOptions::from_environment()).await?;
        Ok(client.load_robot(source).await?)
    })
}
