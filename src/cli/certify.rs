//! `sublevel certify`.

use super::{read, write_atomically};
use crate::body::{Body, Constraint, Normalization};
use crate::fit::certificate;
use crate::polynomial::{Exponents, Polynomial};
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::json;
use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;

/// Make a certificate for somebody else's polynomial: a body file of {x : g_1(x) <= 1, ..., g_m(x) <= 1}
///
/// The input is JSON such as
///
///   {"constraints": [{"exponents": [[4,0,0], [0,4,0], [0,0,2]], "coefficients": [1.0, 1.0, 4.0]}]}
///
/// with one entry of "exponents" per coefficient, x in metres. A "normalization" {"center": [..], "linear": [[..], [..], [..]]} makes
/// them polynomials of linear (x - center) instead, as in body files, which may be given, too: their certificates are made anew, and
/// what no polynomial tells (points, gap, provenance) is left out. The polynomials are stored as they are. One that is not sos-convex is refused with a bound of how far it is from it.
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

/// Polynomials, or what a body file has besides.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Input {
    name: Option<String>,
    normalization: Option<InputNormalization>,
    constraints: Vec<InputConstraint>,
    growth_center_m: Option<[f64; 3]>,
    #[serde(rename = "format")]
    _format: Option<IgnoredAny>,
    #[serde(rename = "kind")]
    _kind: Option<IgnoredAny>,
    #[serde(rename = "id")]
    _id: Option<IgnoredAny>,
    #[serde(rename = "degree")]
    _degree: Option<IgnoredAny>,
    #[serde(rename = "interior_point_m")]
    _interior_point_m: Option<IgnoredAny>,
    #[serde(rename = "min_value")]
    _min_value: Option<IgnoredAny>,
    #[serde(rename = "in_radius_m")]
    _in_radius_m: Option<IgnoredAny>,
    #[serde(rename = "circumscribed_ball")]
    _circumscribed_ball: Option<IgnoredAny>,
    #[serde(rename = "bounding_box")]
    _bounding_box: Option<IgnoredAny>,
    #[serde(rename = "volume_m3")]
    _volume_m3: Option<IgnoredAny>,
    #[serde(rename = "volume_error_m3")]
    _volume_error_m3: Option<IgnoredAny>,
    #[serde(rename = "gap_m")]
    _gap_m: Option<IgnoredAny>,
    #[serde(rename = "contained_points")]
    _contained_points: Option<IgnoredAny>,
    #[serde(rename = "provenance")]
    _provenance: Option<IgnoredAny>,
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
    #[serde(rename = "certificate")]
    _certificate: Option<IgnoredAny>,
}

/// Certifies and writes.
pub(super) fn run(args: &CertifyArgs) -> Result<(), Box<dyn Error>> {
    let place = args.file.display();
    let input: Input = serde_json::from_str(&read(&args.file)?)
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
        let (found, needed) = (coefficients.len(), exponents.len());
        return Err(
            format!("coefficients: has {found} entries for {needed} exponents; one is needed per exponent").into()
        );
    }
    let polynomial = Polynomial::new(exponents.iter().copied().zip(coefficients.iter().copied()).collect())?;
    let gram = certificate(&polynomial)?;
    Ok(Constraint { polynomial, gram })
}
