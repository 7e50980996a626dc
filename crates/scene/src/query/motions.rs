//! Whether motions of a robot are free: whole paths of joint values, proven.

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use sublevel_core::measure::Pose;
use sublevel_robot::motion::{
    Certificate, CertificateError, MotionAnswer, MotionBody, MotionItem, MotionObstacle, MotionOptions, MotionProblem,
    MotionProblemError, MotionRobot, MotionShape, MotionVerdict, MotionWorkspace, Path, PathError, PlacedObstacle,
    VerifiedMotion, VerifyOptions,
};
use sublevel_robot::{ConfigurationError, Kinematics, counted};

use super::thing::{Thing, WorldHalfSpace};
use crate::crew::{Question, Stop};
use crate::geometry::Geometry;
use crate::object::{Object, Slot};
use crate::poses::compose;
use crate::robot::{JointsError, places};
use crate::scene::Scene;

/// Farthest that points of a robot are from the origin of its world, metres; the error of turned
/// half-spaces grows with it.
const REACH_M: f64 = 1e4;

/// Most joint values of all paths together, those of joints that are not named included.
const MAX_PATH_VALUES: usize = 1 << 22;

thread_local! {
    static WORKSPACE: RefCell<MotionWorkspace> = RefCell::new(MotionWorkspace::default());
}

/// Why motions cannot be checked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RobotMotionsError {
    /// A robot that is not there.
    #[error("no robot \"{0}\" in the scene; place it first")]
    NoRobot(Arc<str>),
    /// An object that moves by itself and is part of the robot, or held by something else.
    #[error("object \"{0}\" moves with what holds it; name objects that nothing holds")]
    Held(Arc<str>),
    /// An object of which nothing is known that could be checked.
    #[error("object \"{0}\" is a set without a box around it, which no motion can be checked against")]
    NoShape(Arc<str>),
    /// A robot that stands, or can move, too far away from the origin of its world.
    #[error(
        "robot \"{0}\" is too far from the origin of the world for half-spaces that are turned; move the scene nearer"
    )]
    Far(Arc<str>),
    /// An object twice.
    #[error("object \"{0}\" is named twice; name it once")]
    Twice(Arc<str>),
    /// A half-space that is to move, by itself or with the robot.
    #[error("object \"{0}\" is a half-space, which cannot move while a motion is checked; use a box")]
    HalfSpace(Arc<str>),
    /// A held object that is too far from its link.
    #[error("object \"{0}\" is held too far away from its link to have a pose")]
    TooFar(Arc<str>),
    /// Bodies that make no problem.
    #[error(transparent)]
    Problem(#[from] MotionProblemError),
    /// Joints that are not there.
    #[error(transparent)]
    Joints(#[from] JointsError),
    /// Values that are not those of the paths.
    #[error(
        "holds {}; {} of {} take {}", counted(*given, "number", "numbers"),
        counted(*points, "configuration", "configurations"), counted(*width, "value", "values"), points * width
    )]
    Values {
        /// How many there are.
        given: usize,
        /// Configurations of all paths together.
        points: usize,
        /// Values of a configuration.
        width: usize,
    },
    /// More values than are kept at once, those of joints that are not named included.
    #[error("takes {numbers} joint values, all joints counted; at most {MAX_PATH_VALUES} are taken at once")]
    Large {
        /// How many there are.
        numbers: usize,
    },
    /// Configurations that make no path.
    #[error("path {index} {error}")]
    Path {
        /// Position of the path.
        index: usize,
        /// Why.
        error: PathError,
    },
}

/// What the configurations of a path are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathKind {
    /// Waypoints, joined by straight lines of joint values.
    #[default]
    Waypoints,
    /// Control points of a Bézier segment.
    Bezier,
}

/// An object that moves by itself while the robot does, with everything that it holds: from one
/// pose to another over the path parameter; body frame to world frame, metres.
#[derive(Clone, Copy, Debug)]
pub struct MovingObject {
    /// Its slot.
    pub slot: Slot,
    /// Where it is at the start of every path.
    pub from: Pose,
    /// Where it is at the end of every path.
    pub to: Pose,
}

/// What is known of one motion of a robot.
#[derive(Clone, Debug)]
pub enum RobotMotionAnswer {
    /// It was looked at.
    Checked(Box<MotionAnswer>),
    /// A configuration of the path is not usable: its position, and why.
    Invalid(usize, ConfigurationError),
    /// The question ended before.
    NotChecked,
}

/// Paths of one robot, each to be proven free. Links and what they hold count against each other
/// and against everything else, as in [`States`](super::States).
#[derive(Debug)]
pub struct RobotMotions {
    scene: Scene,
    problem: Arc<MotionProblem>,
    slots: ItemSlots,
    /// Values of joints that paths do not name.
    rest: Vec<f64>,
    paths: Vec<Path>,
    settings: MotionSettings,
    stop_at_first: bool,
    /// The first path in order that is known not to be free.
    first_bad: AtomicUsize,
}

/// Slots of bodies and obstacles, and which of them only contain their objects.
#[derive(Clone, Debug, Default)]
struct ItemSlots {
    bodies: Vec<Slot>,
    obstacles: Vec<Slot>,
    /// Items that stand for sos-bodies by a box around these.
    boxes: Vec<MotionItem>,
}

/// How motions are searched, see [`MotionOptions`].
#[derive(Clone, Copy, Debug)]
pub struct MotionSettings {
    /// Where no point can move by more than this, metres, an open pair stays undecided.
    pub resolution_m: f64,
    /// Most configurations per path.
    pub max_configurations: u32,
    /// Whether the first contact is bracketed.
    pub first_contact: bool,
    /// Width to which the clearance of a free motion is proven, metres; none: at least the margin.
    pub clearance_accuracy_m: Option<f64>,
    /// Whether certificates are made.
    pub certificates: bool,
    /// Whether no earlier answers are used as starts.
    pub cold: bool,
}

impl Default for MotionSettings {
    fn default() -> Self {
        let MotionOptions { resolution_m, max_configurations, .. } = MotionOptions::default();
        Self {
            resolution_m,
            max_configurations,
            first_contact: false,
            clearance_accuracy_m: None,
            certificates: false,
            cold: false,
        }
    }
}

impl RobotMotions {
    /// Motions of a robot among the objects of a scene, some of which move by themselves; in
    /// contact below `margin_m` and the padding.
    ///
    /// # Errors
    /// A robot that is not there, objects that cannot move by themselves, and a margin that is not
    /// finite.
    pub fn new(
        scene: Scene,
        robot: &str,
        moving: &[MovingObject],
        margin_m: f64,
        include_allowed: bool,
    ) -> Result<Self, RobotMotionsError> {
        let (problem, slots) = problem(&scene, robot, moving, margin_m, include_allowed)?;
        let rest = scene.robot(robot).map(|instance| instance.configuration().to_vec()).unwrap_or_default();
        Ok(Self {
            rest,
            scene,
            problem: Arc::new(problem),
            slots,
            paths: Vec::new(),
            settings: MotionSettings::default(),
            stop_at_first: false,
            first_bad: AtomicUsize::new(usize::MAX),
        })
    }

    /// The robot that moves.
    pub fn kinematics(&self) -> &Kinematics {
        self.problem.kinematics()
    }

    /// With paths as packed values of joints, path after path: of those named, in their order, or
    /// of all that follow no other one; what is not named is as in the scene. `points` are the
    /// numbers of configurations of the paths.
    ///
    /// # Errors
    /// A joint that is not there or named twice, another number of values, and configurations that
    /// make no path.
    pub fn with_joint_paths(
        self,
        joints: &[Arc<str>],
        values: &[f64],
        points: &[usize],
        kind: PathKind,
    ) -> Result<Self, RobotMotionsError> {
        let kinematics = self.kinematics();
        let places = places(kinematics, joints)?;
        let (given, width) = (values.len(), places.len());
        let count = points.iter().fold(0, |sum: usize, points| sum.saturating_add(*points));
        if count.checked_mul(width) != Some(given) {
            return Err(RobotMotionsError::Values { given, points: count, width });
        }
        let numbers = count.saturating_mul(self.rest.len());
        if numbers > MAX_PATH_VALUES {
            return Err(RobotMotionsError::Large { numbers });
        }
        let (mut paths, mut rest) = (Vec::with_capacity(points.len()), values);
        for (index, points) in points.iter().enumerate() {
            let (own, after) = rest.split_at(points * width);
            rest = after;
            let mut packed = Vec::with_capacity(points * self.rest.len());
            for row in own.chunks_exact(width.max(1)) {
                let first = packed.len();
                packed.extend_from_slice(&self.rest);
                places.iter().zip(row).for_each(|(place, value)| packed[first + place] = *value);
            }
            let path = match kind {
                PathKind::Waypoints => Path::waypoints(kinematics, packed),
                PathKind::Bezier => Path::bezier(kinematics, packed),
            };
            paths.push(path.map_err(|error| RobotMotionsError::Path { index, error })?);
        }
        Ok(self.with_paths(paths))
    }

    /// With these paths, which are of [`RobotMotions::kinematics`].
    #[must_use]
    pub fn with_paths(mut self, paths: Vec<Path>) -> Self {
        self.paths = paths;
        self
    }

    /// Searches in this way.
    #[must_use]
    pub fn with_settings(mut self, settings: MotionSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Ends at the first path, in order, that is not free.
    #[must_use]
    pub fn stopping_at_first(mut self) -> Self {
        self.stop_at_first = true;
        self
    }

    /// The slot of an item of an answer.
    pub fn slot(&self, item: MotionItem) -> Slot {
        match item {
            MotionItem::Body(index) => self.slots.bodies[index],
            MotionItem::Obstacle(index) => self.slots.obstacles[index],
        }
    }

    /// The scene that the motions are checked in.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The paths, in their order.
    pub fn paths(&self) -> &[Path] {
        &self.paths
    }

    /// Checks a certificate against this robot and scene as they are.
    ///
    /// # Errors
    /// What differs, or why it proves nothing; and that `stop` has ended the check.
    pub fn verify(&self, certificate: &Certificate, stop: &Stop) -> Result<VerifiedMotion, CertificateError> {
        let options = VerifyOptions { stop: Some(stop.flag()), ..VerifyOptions::default() };
        certificate.verify_against_with(&self.problem, &options)
    }

    fn check(&self, index: usize, stop: &Stop) -> RobotMotionAnswer {
        let is_late = self.stop_at_first && self.first_bad.load(Ordering::Relaxed) < index;
        if is_late || stop.is_set() {
            return RobotMotionAnswer::NotChecked;
        }
        let path = &self.paths[index];
        for (point, configuration) in path.points().enumerate() {
            if let Err(error) = self.kinematics().check(configuration) {
                return RobotMotionAnswer::Invalid(point, error);
            }
        }
        let MotionSettings { resolution_m, max_configurations, first_contact, clearance_accuracy_m, .. } =
            self.settings;
        let options = MotionOptions {
            resolution_m,
            max_configurations,
            first_contact,
            clearance_accuracy_m,
            certificate: self.settings.certificates,
            stop: Some(stop.flag()),
        };
        let mut answer = if self.settings.cold {
            self.problem.prove(path, &options, &mut MotionWorkspace::default())
        } else {
            WORKSPACE.with_borrow_mut(|workspace| self.problem.prove(path, &options, workspace))
        };
        // A box around an object may be in contact where the object is not.
        let is_box = |item: &MotionItem| self.slots.boxes.contains(item);
        if answer.contact.as_ref().is_some_and(|contact| contact.items.iter().any(is_box))
            && answer.verdict == MotionVerdict::Contact
        {
            answer.verdict = MotionVerdict::Undecided;
        }
        RobotMotionAnswer::Checked(Box::new(answer))
    }
}

impl Question for RobotMotions {
    type Part = RobotMotionAnswer;

    fn chunks(&self) -> usize {
        self.paths.len()
    }

    fn solve(&self, chunk: usize, stop: &Stop) -> RobotMotionAnswer {
        let answer = self.check(chunk, stop);
        let is_free = matches!(&answer, RobotMotionAnswer::Checked(answer) if answer.verdict == MotionVerdict::Free);
        if !is_free {
            self.first_bad.fetch_min(chunk, Ordering::Relaxed);
        }
        answer
    }
}

/// The robot with what it holds, and everything else as obstacles.
fn problem(
    scene: &Scene,
    robot: &str,
    moving: &[MovingObject],
    margin_m: f64,
    include_allowed: bool,
) -> Result<(MotionProblem, ItemSlots), RobotMotionsError> {
    let instance = scene.robot(robot).ok_or_else(|| RobotMotionsError::NoRobot(robot.into()))?;
    let mut slots = ItemSlots::default();
    let (mut bodies, mut places) = (Vec::new(), HashMap::new());
    for (link, slot) in instance.link_slots().iter().enumerate() {
        if let Some((slot, object)) = slot.and_then(|slot| Some((slot, scene.object(slot)?))) {
            places.insert(slot, (link, Pose::identity()));
            add_body(&mut bodies, &mut slots, (slot, object), link, Pose::identity())?;
        }
    }
    let links: Vec<Slot> = slots.bodies.clone();
    for slot in scene.held_by(&links) {
        let Some(object) = scene.object(slot) else { continue };
        let Some(attachment) = &object.attachment else { continue };
        let Some(&(link, place)) = scene.slot(&attachment.to).and_then(|holder| places.get(&holder)) else { continue };
        let place = compose(&place, &attachment.pose).map_err(|_| RobotMotionsError::TooFar(object.name.clone()))?;
        if matches!(object.geometry, Geometry::HalfSpace(_)) {
            return Err(RobotMotionsError::HalfSpace(object.name.clone()));
        }
        places.insert(slot, (link, place));
        add_body(&mut bodies, &mut slots, (slot, object), link, place)?;
    }
    let mut motions = HashMap::new();
    for object in moving {
        let Some(named) = scene.object(object.slot) else { continue };
        if places.contains_key(&object.slot) || named.attachment.is_some() || named.link.is_some() {
            return Err(RobotMotionsError::Held(named.name.clone()));
        }
        if matches!(named.geometry, Geometry::HalfSpace(_)) {
            return Err(RobotMotionsError::HalfSpace(named.name.clone()));
        }
        let motion = Carried { from: object.from, to: object.to, place: Pose::identity() };
        if motions.insert(object.slot, motion).is_some() {
            return Err(RobotMotionsError::Twice(named.name.clone()));
        }
    }
    // What they hold, each after its holder.
    let holders: Vec<Slot> = moving.iter().map(|object| object.slot).collect();
    for slot in scene.held_by(&holders) {
        let Some((object, attachment)) =
            scene.object(slot).and_then(|object| Some((object, object.attachment.as_ref()?)))
        else {
            continue;
        };
        let holder = scene.slot(&attachment.to).and_then(|holder| motions.get(&holder));
        let Some(&Carried { from, to, place }) = holder else { continue };
        if matches!(object.geometry, Geometry::HalfSpace(_)) {
            return Err(RobotMotionsError::HalfSpace(object.name.clone()));
        }
        let place = compose(&place, &attachment.pose).map_err(|_| RobotMotionsError::TooFar(object.name.clone()))?;
        motions.insert(slot, Carried { from, to, place });
    }
    let mut obstacles = Vec::new();
    for (slot, object, pose) in scene.objects().filter(|(slot, _, _)| !places.contains_key(slot)) {
        let placed =
            placed(object, pose, motions.get(&slot)).ok_or_else(|| RobotMotionsError::NoShape(object.name.clone()))?;
        if matches!(object.geometry, Geometry::SosBody(_)) {
            slots.boxes.push(MotionItem::Obstacle(obstacles.len()));
        }
        slots.obstacles.push(slot);
        obstacles.push(MotionObstacle { name: object.name.clone(), placed });
    }
    let slot = |item: MotionItem| match item {
        MotionItem::Body(index) => slots.bodies[index],
        MotionItem::Obstacle(index) => slots.obstacles[index],
    };
    let padding = |a: MotionItem, b: MotionItem| {
        let (a, b) = (slot(a), slot(b));
        (include_allowed || !scene.is_allowed(a, b)).then(|| scene.padding_m(a, b))
    };
    let moving = MotionRobot { kinematics: instance.robot().kinematics().clone(), base: *instance.base(), bodies };
    // The normal of a half-space that was turned is off by a rounding that grows with the distance.
    let is_far = !(moving.kinematics.reach_m() + instance.base().translation().norm() <= 0.5 * REACH_M);
    let is_turned = |half_space: &WorldHalfSpace| half_space.slack_m(REACH_M) > half_space.slack_m(0.0);
    let mut things = scene.objects().map(|(_, object, pose)| Thing::object(object, pose));
    if is_far && things.any(|thing| matches!(&thing, Thing::HalfSpace(half_space) if is_turned(half_space))) {
        return Err(RobotMotionsError::Far(robot.into()));
    }
    let problem = MotionProblem::new(moving, obstacles, margin_m, padding)?;
    Ok((problem, slots))
}

fn add_body(
    bodies: &mut Vec<MotionBody>,
    slots: &mut ItemSlots,
    (slot, object): (Slot, &Arc<Object>),
    link: usize,
    place: Pose,
) -> Result<(), RobotMotionsError> {
    // Links are no half-spaces, and held ones are refused.
    let shape = shape(object).ok_or_else(|| RobotMotionsError::NoShape(object.name.clone()))?;
    if matches!(object.geometry, Geometry::SosBody(_)) {
        slots.boxes.push(MotionItem::Body(bodies.len()));
    }
    slots.bodies.push(slot);
    bodies.push(MotionBody { name: object.name.clone(), link, place, shape });
    Ok(())
}

/// The finest body of an object, the box around an sos-body; none of a half-space.
fn shape(object: &Object) -> Option<MotionShape> {
    match &object.geometry {
        Geometry::Capsule(capsule) => Some(MotionShape::Capsule(*capsule.capsule())),
        _ => object.solids().last().map(|solid| MotionShape::Solid(solid.clone())),
    }
}

/// How an obstacle moves: a frame from one pose to another, and its place there.
#[derive(Clone, Copy)]
struct Carried {
    from: Pose,
    to: Pose,
    place: Pose,
}

/// An obstacle where it stands, or as it moves.
fn placed(object: &Object, pose: &Pose, motion: Option<&Carried>) -> Option<PlacedObstacle> {
    if let Thing::HalfSpace(half_space) = Thing::object(object, pose) {
        return Some(PlacedObstacle::HalfSpace(half_space.half_space, half_space.slack_m(REACH_M)));
    }
    let shape = shape(object)?;
    Some(match motion {
        Some(&Carried { from, to, place }) => PlacedObstacle::Moving { shape, from, to, place },
        None => PlacedObstacle::Still(shape, *pose),
    })
}
