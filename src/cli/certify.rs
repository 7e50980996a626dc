//! `sublevel certify`.

use super::files::{read, write_atomically};
use crate::body::{Body, Constraint, Normalization};
use crate::fit::certificate;
use crate::polynomial::{Exponents, Polynomial};
use crate::robot::counted;
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::json;
use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;

/// Make a certificate for somebody else's polynomial: a body file of {x : g_1(x) <= 1, ..., g_m(x)
/// <= 1}
///
/// The input is JSON such as
///
/// {"constraints": [{"exponents": [[4,0,0], [0,4,0], [0,0,2]], "coefficients": [1.0, 1.0, 4.0]}]}
///
/// with one entry of "exponents" per coefficient, x in metres. A "normalization" {"center": [..],
/// "linear": [[..], [..], [..]]} makes them polynomials of linear (x - center) instead, as in body
/// files. These may be given, too: their certificates are made again, and what no polynomial says
/// (points, gap, provenance) is left out. The polynomials are stored as they are; one that is not
/// sos-convex is refused with a bound of how far it is from it.
///
/// Example: sublevel certify quartic.json --out quartic-body.json
#[derive(Debug, clap::Args)]
pub(super) struct CertifyArgs {
    /// JSON file of polynomials
    file: PathBuf,
    /// Body file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Name of the body [default: that of the input, or its file's]
    #[arg(long)]
    name: Option<String>,
    /// Print one JSON object instead of a sentence
    #[arg(long)]
    json: bool,
}

/// What body files say besides the polynomials.
const OF_BODY_FILES: [&str; 15] = [
    "format",
    "kind",
    "id",
    "degree",
    "interior_point_m",
    "min_value",
    "in_radius_m",
    "circumscribed_ball",
    "bounding_box",
    "volume_m3",
    "volume_error_m3",
    "gap_m",
    "contained_points",
    "contained_sets",
    "provenance",
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Input {
    name: Option<String>,
    normalization: Option<InputNormalization>,
    constraints: Vec<InputConstraint>,
    growth_center_m: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InputNormalization {
    center: [f64; 3],
    linear: [[f64; 3]; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InputConstraint {
    exponents: Vec<Exponents>,
    coefficients: Vec<f64>,
    /// Made again.
    #[serde(rename = "certificate")]
    _certificate: Option<IgnoredAny>,
}

fn parse(text: &str) -> Result<Input, serde_json::Error> {
    let mut object: serde_json::Map<String, serde_json::Value> = serde_json::from_str(text)?;
    object.retain(|key, _| !OF_BODY_FILES.contains(&key.as_str()));
    Input::deserialize(serde_json::Value::Object(object))
}

/// Certifies and writes.
pub(super) fn run(args: &CertifyArgs) -> Result<(), Box<dyn Error>> {
    let place = args.file.display();
    let input = parse(&read(&args.file)?)
        .map_err(|error| format!("{place}: not polynomials as JSON: {error}; see 'sublevel certify --help'"))?;
    let normalization = input.normalization.map_or(
        Normalization { center: Vector3::zeros(), linear: Matrix3::identity() },
        |InputNormalization { center, linear }| Normalization {
            center: center.into(),
            linear: Matrix3::from_fn(|i, j| linear[i][j]),
        },
    );
    let constraints = input
        .constraints
        .iter()
        .enumerate()
        .map(|(i, constraint)| certified(constraint).map_err(|error| format!("{place}: constraints[{i}]: {error}")))
        .collect::<Result<Vec<_>, _>>()?;
    let stem = args.file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = args.name.clone().or(input.name).or(stem).unwrap_or_default();
    let mut body = Body::new(&name, normalization, constraints).map_err(|error| format!("{place}: {error}"))?;
    if let Some(center) = input.growth_center_m {
        body = body.with_growth_center(center.into()).map_err(|error| format!("{place}: {error}"))?;
    }
    write_atomically(&args.out, &body.to_json())?;
    let mut out = io::stdout().lock();
    if args.json {
        let report = json!({
            "body": args.out.display().to_string(),
            "id": body.id().to_string(),
            "degree": body.degree(),
            "constraints": body.constraints().len(),
            "proven": true,
        });
        serde_json::to_writer(&mut out, &report)?;
        writeln!(out)?;
    } else {
        writeln!(out, "{}: proven sos-convex and bounded, degree {}", args.out.display(), body.degree())?;
    }
    Ok(())
}

fn certified(constraint: &InputConstraint) -> Result<Constraint, Box<dyn Error>> {
    let InputConstraint { exponents, coefficients, .. } = constraint;
    if exponents.len() != coefficients.len() {
        let found = counted(coefficients.len(), "entry", "entries");
        let needed = counted(exponents.len(), "exponent", "exponents");
        return Err(format!("coefficients: has {found} for {needed}; one is needed per exponent").into());
    }
    let polynomial = Polynomial::new(exponents.iter().copied().zip(coefficients.iter().copied()).collect())?;
    let gram = certificate(&polynomial)?;
    Ok(Constraint { polynomial, gram })
}
