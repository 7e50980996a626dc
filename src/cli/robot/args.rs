//! Arguments of `sublevel robot`.

use std::path::PathBuf;

use crate::cli::fit::length::length;

/// Load a robot: fit bodies to the meshes of its links, check its URDF and SRDF, and send it to a
/// server
///
/// Boxes, cylinders, spheres and capsules of the URDF are taken exactly. Around the meshes of each
/// link one body is fitted, in the frame of the link, or with --max-gap the cheapest representation
/// that reaches at most so far beyond them; it is written to the folder as <link>-<hash>.json and
/// not fitted again while meshes and options stay the same. The table says how well each link is
/// followed; a planner loses about the configurations in which links are nearer to something than
/// their gaps.
///
/// With --server the bodies are stored there and the robot is loaded: scenes then place it by its
/// id, and CheckStates, Clearance and CheckMotions take its joint values.
///
/// Examples:
///
/// sublevel robot panda.urdf --srdf panda.srdf --out panda
///
/// sublevel robot panda.urdf --srdf panda.srdf --out panda --pairs
///
/// sublevel robot panda.urdf --max-gap 1cm --out panda --server http://127.0.0.1:50051
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct RobotArgs {
    /// URDF file; run xacro first on a xacro file
    pub(super) urdf: PathBuf,
    /// SRDF file, for pairs of links that may touch
    #[arg(long, value_name = "FILE")]
    pub(super) srdf: Option<PathBuf>,
    /// Folder for the bodies of the links; made with its parents when it is not there
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Degree of the body of each link, with refined volume: 2, 4, 6 or 8 [default: 6]
    #[arg(long, value_name = "N")]
    pub(super) degree: Option<usize>,
    /// How far a body may reach beyond the convex hull of its link, or of the parts of this: the
    /// cheapest that does, instead of one body of a degree
    ///
    /// Such as 5mm, 2cm, or 0.005 (metres). Smaller gaps take more parts and higher degrees, and
    /// longer queries.
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with = "degree")]
    pub(super) max_gap: Option<f64>,
    /// Where package://NAME/... of meshes lies; may be given several times
    #[arg(long = "package", value_name = "NAME=DIR", value_parser = package)]
    pub(super) packages: Vec<(String, PathBuf)>,
    /// Folder in which packages are looked for by their names; may be given several times. The
    /// folder of the URDF is looked into last
    #[arg(long = "search", value_name = "DIR")]
    pub(super) search: Vec<PathBuf>,
    /// Prove for every pair of links whether it can touch at any joint values within the limits,
    /// and compare with the SRDF
    ///
    /// Takes seconds to minutes. Pairs that never touch need no check; where the SRDF leaves out a
    /// pair that can, the joint values at which it does are shown. A server does the same as a job:
    /// RobotService.DeriveAllowedPairs.
    #[arg(long)]
    pub(super) pairs: bool,
    /// Address of a server to load the robot into, such as http://127.0.0.1:50051
    #[arg(long, value_name = "URL")]
    pub(super) server: Option<String>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub(super) json: bool,
}

fn package(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, folder)) if !name.is_empty() && !folder.is_empty() => Ok((name.to_owned(), folder.into())),
        _ => Err("not NAME=DIR, such as panda=/opt/robots/panda".to_owned()),
    }
}
