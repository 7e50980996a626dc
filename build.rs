//! Compiles `proto/` in plain Rust, so that building needs no `protoc`.

use std::{env, error::Error, fs, path::PathBuf};

use protox::prost::Message;

const FILES: [&str; 11] = [
    "sublevel/v1/types.proto",
    "sublevel/v1/body.proto",
    "sublevel/v1/robot.proto",
    "sublevel/v1/scene.proto",
    "sublevel/v1/motion.proto",
    "sublevel/v1/query.proto",
    "sublevel/v1/fit.proto",
    "sublevel/v1/hierarchy.proto",
    "sublevel/v1/job.proto",
    "sublevel/v1/blob.proto",
    "sublevel/v1/server.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=proto");

    let descriptors = protox::compile(FILES, ["proto"])?;
    // Reflection serves this file.
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("sublevel.v1.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure().bytes(".sublevel.v1").compile_fds(descriptors)?;
    Ok(())
}
