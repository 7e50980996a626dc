//! From problems to claims and back: a certificate is read without the scene it was made in.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use sublevel_core::body::Shape;
use sublevel_core::measure::{Capsule, HalfSpace, Pose};

use super::certificate_error::CertificateError;
use super::claim::{
    BodyRecord, Claim, DigestedClaim, JointRecord, ObstacleRecord, PlacedRecord, PoseRecord, RobotRecord, ShapeRecord,
};
use super::geometry::{MotionBody, MotionItem, MotionObstacle, MotionShape, PlacedObstacle};
use super::problem::{MotionProblem, MotionRobot};
use super::verify_options::VerifyOptions;
use crate::description::{Description, Joint, Limits, Link, Mimic};
use crate::kinematics::Kinematics;

impl MotionProblem {
    /// What certificates say of it.
    pub(crate) fn claim(&self) -> &Arc<DigestedClaim> {
        self.claim.get_or_init(|| Arc::new(DigestedClaim::new(Claim::of(self))))
    }
}

impl Claim {
    /// What is claimed of a problem's paths.
    fn of(problem: &MotionProblem) -> Self {
        let mut solids = Solids::default();
        let bodies = problem.bodies.iter().map(|body| BodyRecord {
            name: body.name.to_string(),
            link: body.link,
            place: numbers(&body.place),
            shape: solids.record(&body.shape),
        });
        let bodies = bodies.collect();
        let obstacles = problem.obstacles.iter().map(|obstacle| {
            let placed = match &obstacle.placed {
                PlacedObstacle::Still(shape, pose) => PlacedRecord::Still(solids.record(shape), numbers(pose)),
                PlacedObstacle::Moving { shape, from, to, place } => {
                    let (shape, from, to) = (solids.record(shape), numbers(from), numbers(to));
                    if *place == Pose::identity() {
                        PlacedRecord::Moving(shape, from, to)
                    } else {
                        PlacedRecord::Carried(shape, from, to, numbers(place))
                    }
                }
                PlacedObstacle::HalfSpace(half_space, error_m) => {
                    PlacedRecord::HalfSpace((*half_space.normal()).into(), half_space.offset(), *error_m)
                }
            };
            ObstacleRecord { name: obstacle.name.to_string(), placed }
        });
        let obstacles = obstacles.collect();
        let counted: BTreeMap<_, _> = problem.rules.iter().map(|&(a, b, padding_m)| ((a, b), padding_m)).collect();
        let all = items(problem.bodies.len(), problem.obstacles.len());
        let base = &problem.base;
        Self {
            robot: RobotRecord::of(problem.kinematics.description()),
            base: isometry_numbers(base),
            solids: solids.files,
            bodies,
            obstacles,
            margin_m: problem.margin_m,
            allowed: all.filter(|pair| !counted.contains_key(pair)).collect(),
            paddings_m: problem.rules.iter().filter(|(_, _, padding_m)| *padding_m != 0.0).copied().collect(),
        }
    }

    /// Makes the problem again; every body is proven again unless its id is known. More than `most`
    /// pairs are refused.
    pub(crate) fn problem(&self, options: &VerifyOptions<'_>, most: usize) -> Result<MotionProblem, CertificateError> {
        let kinematics = self.robot.kinematics()?;
        let solids: Vec<Arc<Shape>> =
            (0..).zip(&self.solids).map(|(index, file)| solid(index, file, options)).collect::<Result<_, _>>()?;
        let shape = |part: &dyn Fn() -> String, record: &ShapeRecord| match record {
            ShapeRecord::Solid(index) => {
                let solid = solids.get(*index).ok_or_else(|| wrong(part(), "there is no such solid"))?;
                Ok(MotionShape::Solid(solid.clone()))
            }
            ShapeRecord::Capsule(radius_m, half_height_m) => Capsule::new(*radius_m, *half_height_m)
                .map(MotionShape::Capsule)
                .map_err(|error| wrong(part(), &error.to_string())),
        };
        let mut bodies = Vec::with_capacity(self.bodies.len());
        for (index, body) in self.bodies.iter().enumerate() {
            let part = || format!("claim.bodies[{index}]");
            let (place, shape) = (pose(&part, &body.place)?, shape(&part, &body.shape)?);
            bodies.push(MotionBody { name: body.name.as_str().into(), link: body.link, place, shape });
        }
        let mut obstacles = Vec::with_capacity(self.obstacles.len());
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            let part = || format!("claim.obstacles[{index}]");
            let placed = match &obstacle.placed {
                PlacedRecord::Still(of, at) => PlacedObstacle::Still(shape(&part, of)?, pose(&part, at)?),
                PlacedRecord::Moving(of, from, to) => {
                    let (shape, from, to) = (shape(&part, of)?, pose(&part, from)?, pose(&part, to)?);
                    PlacedObstacle::Moving { shape, from, to, place: Pose::identity() }
                }
                PlacedRecord::Carried(of, from, to, place) => {
                    let (shape, from, to) = (shape(&part, of)?, pose(&part, from)?, pose(&part, to)?);
                    PlacedObstacle::Moving { shape, from, to, place: pose(&part, place)? }
                }
                PlacedRecord::HalfSpace(normal, offset, error_m) => {
                    let half_space = HalfSpace::new((*normal).into(), *offset);
                    let half_space = half_space.map_err(|error| wrong(part(), &error.to_string()))?;
                    if !(*error_m >= 0.0 && error_m.is_finite()) {
                        return Err(wrong(part(), "its error is no length"));
                    }
                    PlacedObstacle::HalfSpace(half_space, *error_m)
                }
            };
            obstacles.push(MotionObstacle { name: obstacle.name.as_str().into(), placed });
        }
        let rules = self.rules(most)?;
        let base = pose(&|| "claim.base".to_owned(), &self.base)?;
        let robot = MotionRobot { kinematics: Arc::new(kinematics), base, bodies };
        MotionProblem::of_rules(robot, obstacles, self.margin_m, rules)
            .map_err(|error| wrong("claim".to_owned(), &error.to_string()))
    }

    /// Pairs that count, with their paddings: all but those allowed.
    fn rules(&self, most: usize) -> Result<Vec<(MotionItem, MotionItem, f64)>, CertificateError> {
        let (bodies, obstacles) = (self.bodies.len(), self.obstacles.len());
        let all = bodies.saturating_mul(bodies.saturating_sub(1)) / 2 + bodies.saturating_mul(obstacles);
        if all.saturating_sub(self.allowed.len()) > most {
            return Err(wrong("claim.bodies".to_owned(), "more pairs count than there are records"));
        }
        let allowed: std::collections::BTreeSet<_> = self.allowed.iter().copied().collect();
        let paddings: BTreeMap<_, _> = self.paddings_m.iter().map(|&(a, b, padding_m)| ((a, b), padding_m)).collect();
        let rules = items(bodies, obstacles)
            .filter(|pair| !allowed.contains(pair))
            .map(|(a, b)| (a, b, paddings.get(&(a, b)).copied().unwrap_or(0.0)));
        Ok(rules.collect())
    }
}

/// All pairs of items that could count, in order.
fn items(bodies: usize, obstacles: usize) -> impl Iterator<Item = (MotionItem, MotionItem)> {
    (0..bodies).flat_map(move |a| {
        let others = (a + 1..bodies).map(MotionItem::Body);
        others.chain((0..obstacles).map(MotionItem::Obstacle)).map(move |b| (MotionItem::Body(a), b))
    })
}

/// Files of solids, each written once.
#[derive(Default)]
struct Solids {
    places: BTreeMap<String, usize>,
    files: Vec<serde_json::Value>,
}

impl Solids {
    fn record(&mut self, shape: &MotionShape) -> ShapeRecord {
        match shape {
            MotionShape::Capsule(capsule) => ShapeRecord::Capsule(capsule.radius_m(), capsule.half_height_m()),
            MotionShape::Solid(shape) => {
                let place = *self.places.entry(shape.id().to_string()).or_insert_with(|| {
                    let text = match &**shape {
                        Shape::Body(body) => body.to_json(),
                        Shape::Compound(compound) => compound.to_json(),
                    };
                    // What a body has written is JSON.
                    self.files.push(serde_json::from_str(&text).unwrap_or_default());
                    self.files.len() - 1
                });
                ShapeRecord::Solid(place)
            }
        }
    }
}

fn solid(index: usize, file: &serde_json::Value, options: &VerifyOptions<'_>) -> Result<Arc<Shape>, CertificateError> {
    options.check_time()?;
    let id = file.get("id").and_then(serde_json::Value::as_str);
    let shape = id.zip(options.known).and_then(|(id, known)| known(id));
    // Of a body that is known the numbers have to be the same, not only the id.
    if let Some(shape) = shape.filter(|shape| Solids::default().file(shape) == *file) {
        return Ok(shape);
    }
    let shape = Shape::from_json(&file.to_string());
    shape.map(Arc::new).map_err(|error| wrong(format!("claim.solids[{index}]"), &error.to_string()))
}

impl Solids {
    fn file(mut self, shape: &Arc<Shape>) -> serde_json::Value {
        self.record(&MotionShape::Solid(shape.clone()));
        self.files.pop().unwrap_or_default()
    }
}

impl RobotRecord {
    fn of(description: &Description) -> Self {
        let joints = description.joints.iter().map(|joint| JointRecord {
            name: joint.name.to_string(),
            kind: joint.kind,
            parent: joint.parent,
            child: joint.child,
            origin: isometry_numbers(&joint.origin),
            axis: joint.axis.into_inner().into(),
            limits: joint.limits.map(|limits| [limits.lower, limits.upper]),
            mimic: joint.mimic.map(|mimic| (mimic.joint, mimic.multiplier, mimic.offset)),
        });
        Self {
            name: description.name.to_string(),
            links: description.links.iter().map(|link| link.name.to_string()).collect(),
            joints: joints.collect(),
        }
    }

    fn kinematics(&self) -> Result<Kinematics, CertificateError> {
        let mut joints = Vec::with_capacity(self.joints.len());
        for (index, joint) in self.joints.iter().enumerate() {
            let part = || format!("claim.robot.joints[{index}]");
            let axis = Vector3::from(joint.axis);
            let mimic = joint.mimic.map(|(joint, multiplier, offset)| Mimic { joint, multiplier, offset });
            let is_finite = mimic.is_none_or(|mimic| mimic.multiplier.is_finite() && mimic.offset.is_finite());
            // Not `>`: a NaN is refused, too.
            if !((axis.norm() - 1.0).abs() <= UNIT && is_finite) {
                return Err(wrong(part(), "its axis is no unit vector, or it follows by no number"));
            }
            joints.push(Joint {
                name: joint.name.as_str().into(),
                kind: joint.kind,
                parent: joint.parent,
                child: joint.child,
                origin: isometry(&part, &joint.origin)?,
                axis: Unit::new_unchecked(axis),
                limits: joint.limits.map(|[lower, upper]| Limits { lower, upper }),
                mimic,
            });
        }
        let links = self.links.iter().map(|name| Link { name: name.as_str().into(), collisions: Vec::new() });
        let description = Description { name: self.name.as_str().into(), links: links.collect(), joints };
        Kinematics::new(&description).map_err(|error| wrong("claim.robot".to_owned(), &error.to_string()))
    }
}

/// How far the length of an axis may be from 1.
const UNIT: f64 = 1e-14;

fn numbers(pose: &Pose) -> PoseRecord {
    let ([x, y, z], q) = ((*pose.translation()).into(), pose.rotation());
    [x, y, z, q.i, q.j, q.k, q.w]
}

fn isometry_numbers(pose: &Isometry3<f64>) -> PoseRecord {
    let (t, q) = (pose.translation.vector, pose.rotation);
    [t.x, t.y, t.z, q.i, q.j, q.k, q.w]
}

fn pose(part: &impl Fn() -> String, &[x, y, z, i, j, k, w]: &PoseRecord) -> Result<Pose, CertificateError> {
    Pose::from_quaternion(Vector3::new(x, y, z), [i, j, k, w]).map_err(|error| wrong(part(), &error.to_string()))
}

/// The same numbers, bit for bit, if they are a pose.
fn isometry(part: &impl Fn() -> String, numbers: &PoseRecord) -> Result<Isometry3<f64>, CertificateError> {
    pose(part, numbers)?;
    let &[x, y, z, i, j, k, w] = numbers;
    let rotation = Quaternion::new(w, i, j, k);
    if (rotation.norm() - 1.0).abs() > UNIT {
        return Err(wrong(part(), "its quaternion is not of length 1"));
    }
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_unchecked(rotation)))
}

fn wrong(part: String, reason: &str) -> CertificateError {
    CertificateError::Part { part, reason: reason.to_owned() }
}
