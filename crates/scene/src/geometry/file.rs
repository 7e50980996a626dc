//! Files of everything an object can be made of: JSON that names its kind.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sublevel_core::body::{BodyFileError, Shape, SosBody};
use sublevel_core::measure::{Capsule, HalfSpace};

use super::capsule::NamedCapsule;
use super::half_space::NamedHalfSpace;
use super::kinds::Geometry;
use super::ladder::{Ladder, LadderError};

const FORMAT: &str = "sublevel/1";
const LADDER_KIND: &str = "ladder";
const HALF_SPACE_KIND: &str = "half-space";
const CAPSULE_KIND: &str = "capsule";

/// Why a file is not read.
#[derive(Debug, thiserror::Error)]
pub enum GeometryFileError {
    /// No JSON, or not that of such a file.
    #[error("is no file of a body, compound, ladder, sos-body, capsule or half-space: {0}")]
    Json(String),
    /// A body, compound or sos-body that cannot be read or proven.
    #[error(transparent)]
    Body(#[from] BodyFileError),
    /// A rung that cannot be read or proven.
    #[error("rungs[{index}]: {source}")]
    Rung {
        /// Its position.
        index: usize,
        /// The reason.
        source: BodyFileError,
    },
    /// Rungs that make no ladder.
    #[error("rungs: {0}")]
    Ladder(#[from] LadderError),
    /// A field that is wrong.
    #[error("{field} {why}")]
    Field {
        /// The field.
        field: &'static str,
        /// What is wrong with it, with the remedy.
        why: String,
    },
}

#[derive(Deserialize)]
struct Header {
    kind: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LadderFile {
    format: String,
    kind: String,
    id: String,
    name: String,
    /// Files of bodies, coarsest first.
    rungs: Vec<serde_json::Value>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HalfSpaceFile {
    format: String,
    kind: String,
    id: String,
    name: String,
    normal: [f64; 3],
    offset_m: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CapsuleFile {
    format: String,
    kind: String,
    id: String,
    name: String,
    radius_m: f64,
    half_height_m: f64,
}

impl Geometry {
    /// Reads and re-proves a file of whatever kind it names.
    ///
    /// # Errors
    /// The field that is wrong, the reason and the remedy.
    pub fn from_json(text: &str) -> Result<Self, GeometryFileError> {
        let header: Header = parse(text)?;
        match header.kind.as_str() {
            LADDER_KIND => ladder(text),
            HALF_SPACE_KIND => half_space(text),
            CAPSULE_KIND => capsule(text),
            _ if SosBody::is_file(text) => Ok(Self::SosBody(Arc::new(SosBody::from_json(text)?))),
            _ => Ok(Self::Solid(Arc::new(Shape::from_json(text)?))),
        }
    }

    /// Its file; reading it back gives the same numbers exactly.
    pub fn to_json(&self) -> String {
        match self {
            Self::Solid(shape) => shape_json(shape),
            Self::SosBody(body) => body.to_json(),
            Self::Ladder(ladder) => write(&LadderFile {
                format: FORMAT.into(),
                kind: LADDER_KIND.into(),
                id: ladder.id().to_string(),
                name: ladder.name().into(),
                // What was just written as JSON is JSON.
                rungs: ladder.rungs().iter().filter_map(|rung| serde_json::from_str(&shape_json(rung)).ok()).collect(),
            }),
            Self::Capsule(capsule) => write(&CapsuleFile {
                format: FORMAT.into(),
                kind: CAPSULE_KIND.into(),
                id: capsule.id().to_string(),
                name: capsule.name().into(),
                radius_m: capsule.capsule().radius_m(),
                half_height_m: capsule.capsule().half_height_m(),
            }),
            Self::HalfSpace(half_space) => write(&HalfSpaceFile {
                format: FORMAT.into(),
                kind: HALF_SPACE_KIND.into(),
                id: half_space.id().to_string(),
                name: half_space.name().into(),
                normal: (*half_space.half_space().normal()).into(),
                offset_m: half_space.half_space().offset(),
            }),
        }
    }
}

fn shape_json(shape: &Shape) -> String {
    match shape {
        Shape::Body(body) => body.to_json(),
        Shape::Compound(compound) => compound.to_json(),
    }
}

fn ladder(text: &str) -> Result<Geometry, GeometryFileError> {
    let file: LadderFile = parse(text)?;
    check("format", &file.format, FORMAT)?;
    let rung = |(index, rung): (usize, &serde_json::Value)| {
        let shape = Shape::from_json(&rung.to_string()).map_err(|source| GeometryFileError::Rung { index, source })?;
        Ok::<_, GeometryFileError>(Arc::new(shape))
    };
    let rungs = file.rungs.iter().enumerate().map(rung).collect::<Result<_, _>>()?;
    let ladder = Ladder::new(&file.name, rungs)?;
    check("id", &file.id, &ladder.id().to_string())?;
    Ok(Geometry::Ladder(Arc::new(ladder)))
}

fn half_space(text: &str) -> Result<Geometry, GeometryFileError> {
    let file: HalfSpaceFile = parse(text)?;
    check("format", &file.format, FORMAT)?;
    let half_space = HalfSpace::new(file.normal.into(), file.offset_m)
        .map_err(|error| GeometryFileError::Field { field: "normal", why: error.to_string() })?;
    let named = NamedHalfSpace::new(&file.name, half_space)
        .map_err(|error| GeometryFileError::Field { field: "name", why: error.to_string() })?;
    check("id", &file.id, &named.id().to_string())?;
    Ok(Geometry::HalfSpace(Arc::new(named)))
}

fn capsule(text: &str) -> Result<Geometry, GeometryFileError> {
    let file: CapsuleFile = parse(text)?;
    check("format", &file.format, FORMAT)?;
    let capsule = Capsule::new(file.radius_m, file.half_height_m).map_err(|error| GeometryFileError::Field {
        field: if error.size == "radius" { "radius_m" } else { "half_height_m" },
        why: error.to_string(),
    })?;
    let named = NamedCapsule::new(&file.name, capsule)
        .map_err(|error| GeometryFileError::Field { field: "name", why: error.to_string() })?;
    check("id", &file.id, &named.id().to_string())?;
    Ok(named.into())
}

fn check(field: &'static str, found: &str, expected: &str) -> Result<(), GeometryFileError> {
    if found == expected {
        return Ok(());
    }
    let why = format!("is \"{found}\", and \"{expected}\" is what belongs there; write the file again");
    Err(GeometryFileError::Field { field, why })
}

fn parse<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, GeometryFileError> {
    serde_json::from_str(text).map_err(|error| GeometryFileError::Json(error.to_string()))
}

fn write(file: &impl Serialize) -> String {
    // Plain data in memory is always written.
    serde_json::to_string_pretty(file).unwrap_or_default() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use sublevel_core::body::Body;

    fn rung(radius: f64, points: &[Vector3<f64>]) -> Arc<Shape> {
        let body = Body::ball("ball", Vector3::zeros(), radius).and_then(|ball| ball.renamed("rung"));
        let body = body.expect("a ball").with_points(points).expect("contained");
        Arc::new(Shape::Body(Box::new(body)))
    }

    fn all() -> Vec<Geometry> {
        let points = [Vector3::new(0.1, 0.2, 0.3), Vector3::zeros()];
        let ladder = Ladder::new("steps", vec![rung(2.0, &points), rung(1.0, &points)]).expect("a ladder");
        let normal = Vector3::new(0.6, 0.0, 0.8);
        let floor = NamedHalfSpace::new("floor", HalfSpace::new(normal, 0.1).expect("a half-space")).expect("a name");
        let cuboid = Body::cuboid("box", Vector3::new(0.1, 0.2, 0.3)).expect("a box");
        vec![
            Geometry::Solid(Arc::new(Shape::Body(Box::new(cuboid)))),
            Geometry::Ladder(Arc::new(ladder)),
            Geometry::HalfSpace(Arc::new(floor)),
        ]
    }

    #[test]
    fn files_survive_the_round_trip() {
        for geometry in all() {
            let text = geometry.to_json();
            let again = Geometry::from_json(&text).expect("its own file");
            assert_eq!((again.id(), again.name()), (geometry.id(), geometry.name()));
            assert_eq!(again.to_json(), text);
        }
    }

    #[test]
    fn what_was_edited_is_refused_by_field() {
        let [_, ladder, floor] = &all()[..] else { panic!("three") };
        let refused = |text: String| Geometry::from_json(&text).expect_err("refused").to_string();
        assert!(refused(floor.to_json().replace("0.6", "0.7")).contains("normal"));
        assert!(refused(floor.to_json().replace("0.1", "0.2")).starts_with("id is"));
        assert!(refused(floor.to_json().replace("sublevel/1", "sublevel/9")).starts_with("format is"));
        assert!(refused(floor.to_json().replace("\"floor\"", "\"\"")).starts_with("name"));
        assert!(refused("{}".into()).contains("kind"));
        let one_rung = ladder.to_json().replacen("rung\"", "other\"", 1);
        assert!(Geometry::from_json(&one_rung).is_ok(), "a name is no part of the id");
    }
}
