//! `sublevel scene show --svg`: a scene as a picture, its robots in several states.

use std::collections::HashMap;
use std::error::Error;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

use nalgebra::Vector3;

use super::numbers::Numbers;
use crate::body::{Aabb, Body, BodyId, Solid};
use crate::client::{Client, ClientError, Question, SceneState};
use crate::draw::{Ink, Outline, Panel, Silhouettes, Span, View, shadow, silhouette};
use crate::measure::Pose;
use crate::scene::query::Measure;
use crate::scene::{Geometry, NamedJointValues, Placement};

/// Directions in which the outline of a body is looked for.
const DIRECTIONS: usize = 180;

/// Colours of states, in their order.
const INKS: [Ink; 4] = [Ink::Blue, Ink::Orange, Ink::Green, Ink::Purple];

/// Pairs of a question.
const PAIRS: usize = 1000;

const VIEWS: [View; 3] = [View::Side, View::Front, View::Top];

/// A robot of the scene, and values of all its joints: NAME=V,V,...
#[derive(Clone, Debug)]
pub(super) struct RobotState {
    robot: String,
    values: Vec<f64>,
}

impl FromStr for RobotState {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let how = "give NAME=V,V,... with one value per joint, radians or metres";
        let (robot, values) = text.split_once('=').ok_or(how)?;
        let Numbers(values) = values.parse().map_err(|error| format!("{error}; {how}"))?;
        Ok(Self { robot: robot.into(), values })
    }
}

/// The nearest pair of a robot in a state and what is not of it.
struct Nearest {
    names: [String; 2],
    distance_m: f64,
    points: [Vector3<f64>; 2],
}

/// The picture of a scene as it stands, or with robots in some states, each in a colour of its own.
///
/// # Errors
/// A scene, robot or body that is not there, and more states than there are colours.
pub(super) async fn picture(client: &Client, scene: &str, states: &[RobotState]) -> Result<String, Box<dyn Error>> {
    if states.len() > INKS.len() {
        return Err(format!("--state: {} states; a picture takes {}", states.len(), INKS.len()).into());
    }
    let standing = client.scene(scene).await?;
    let mut drawn = Drawn::default();
    let moves = |name: &str| states.iter().any(|state| is_moved(&standing, name, &state.robot));
    for object in standing.objects.values().filter(|object| !moves(&object.name)) {
        drawn.add(client, object, Ink::Grey, true).await?;
    }
    if !states.is_empty() {
        // Nobody else draws at this nanosecond; the name of the scene might be too long already.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let fork = format!("picture-{}-{now}", std::process::id());
        client.fork_scene(scene, &fork).await?;
        let looked = look(client, &fork, states, &mut drawn).await;
        // What went wrong before says more.
        let deleted = client.delete_scene(&fork).await;
        looked?;
        deleted?;
    }
    drawn.notes.iter().for_each(|note| eprintln!("note: {note}"));
    Ok(drawn.to_svg(scene))
}

/// Puts the robots into their states, one after the other, and draws them.
async fn look(client: &Client, fork: &str, states: &[RobotState], drawn: &mut Drawn) -> Result<(), Box<dyn Error>> {
    for (index, (state, ink)) in states.iter().zip(INKS).enumerate() {
        let joints = NamedJointValues { joints: Vec::new(), values: state.values.clone() };
        client.set_joints(fork, &state.robot, joints).await?;
        let scene = client.scene(fork).await?;
        for object in scene.objects.values().filter(|object| is_moved(&scene, &object.name, &state.robot)) {
            drawn.add(client, object, ink, false).await?;
        }
        let (own, others): (Vec<&str>, Vec<&str>) =
            scene.objects.keys().map(|name| &**name).partition(|name| is_moved(&scene, name, &state.robot));
        let nearest = nearest(client, fork, (&own, &others)).await?;
        let label = match &nearest {
            Some(Nearest { names: [a, b], distance_m, .. }) => {
                let short = |name: &str| name.strip_prefix(&format!("{}/", state.robot)).unwrap_or(name).to_owned();
                format!("{}: {} to {}, {distance_m:.3} m", index + 1, short(a), short(b))
            }
            None => format!("{}", index + 1),
        };
        drawn.states.push(DrawnState { ink, label, nearest_m: nearest.map(|nearest| nearest.points) });
    }
    Ok(())
}

/// Whether an object is a link of a robot, or held by one.
fn is_moved(scene: &SceneState, name: &str, robot: &str) -> bool {
    let mut at = name;
    // Each step leads to an object of the scene, so there are at most as many steps as objects.
    for _ in 0..=scene.objects.len() {
        let Some(object) = scene.objects.get(at) else { return false };
        if at.strip_prefix(robot).is_some_and(|rest| rest.starts_with('/')) {
            return true;
        }
        match &object.attachment {
            Some(held) => at = &held.to,
            None => return false,
        }
    }
    false
}

/// The pair with the smallest signed distance of a robot and what is not of it.
async fn nearest(
    client: &Client,
    scene: &str,
    (own, others): (&[&str], &[&str]),
) -> Result<Option<Nearest>, ClientError> {
    let pairs: Vec<_> = own.iter().flat_map(|&a| others.iter().map(move |&b| (a, b))).collect();
    let mut nearest: Option<Nearest> = None;
    for pairs in pairs.chunks(PAIRS) {
        let answers = client.evaluate(scene, Question::pairs(pairs.iter().copied()), &[Measure::Signed]).await?;
        for row in answers.rows {
            let (Some(distance_m), Some(points)) = (row.value, row.answer.witnesses) else { continue };
            if nearest.as_ref().is_none_or(|nearest| distance_m < nearest.distance_m) {
                nearest = Some(Nearest { names: [row.a, row.b], distance_m, points });
            }
        }
    }
    Ok(nearest)
}

/// A state that is drawn.
struct DrawnState {
    ink: Ink,
    label: String,
    /// Nearest points, world frame, metres.
    nearest_m: Option<[Vector3<f64>; 2]>,
}

/// What is drawn so far.
#[derive(Default)]
struct Drawn {
    bodies: HashMap<BodyId, Geometry>,
    /// Outlines in the order of [`VIEWS`].
    outlines: [Vec<Outline>; 3],
    states: Vec<DrawnState>,
    has_obstacles: bool,
    notes: Vec<String>,
}

impl DrawnState {
    fn span(&self, view: View) -> Option<Span> {
        Some(Span { ink: self.ink, ends: self.nearest_m?.map(|point| view.project(&point)) })
    }
}

impl Drawn {
    /// Draws an object where it stands.
    async fn add(&mut self, client: &Client, object: &Placement, ink: Ink, solid: bool) -> Result<(), ClientError> {
        let Some(pose) = object.pose else { return Ok(()) };
        let geometry = match self.bodies.get(&object.body) {
            Some(geometry) => geometry.clone(),
            None => client.body(&object.body).await?,
        };
        self.bodies.insert(object.body, geometry.clone());
        if let Geometry::HalfSpace(_) = &geometry {
            self.notes.push(format!("{} has no end and is not drawn", object.name));
            return Ok(());
        }
        for (view, outlines) in VIEWS.into_iter().zip(&mut self.outlines) {
            outlines.extend(polygons(&geometry, &pose, view).into_iter().map(|polygons| Outline {
                ink,
                polygons,
                solid,
            }));
        }
        self.has_obstacles |= solid;
        Ok(())
    }

    fn to_svg(&self, title: &str) -> String {
        let panel = |(view, outlines): (View, &Vec<Outline>)| Panel {
            caption: view.name().into(),
            outlines: outlines.clone(),
            spans: self.states.iter().filter_map(|state| state.span(view)).collect(),
        };
        // The plan stands below the elevation with the same x axis.
        let mut panels = VIEWS.into_iter().zip(&self.outlines).map(panel);
        let rows = vec![panels.by_ref().take(2).collect(), panels.collect()];
        let mut legend: Vec<_> = self.states.iter().map(|state| (state.ink, state.label.clone())).collect();
        if self.has_obstacles {
            legend.push((Ink::Grey, "objects".into()));
        }
        Silhouettes { title: title.into(), legend, rows }.to_svg()
    }
}

/// The outlines of a shape where it stands, each of one part.
fn polygons(geometry: &Geometry, pose: &Pose, view: View) -> Vec<Vec<Vec<[f64; 2]>>> {
    let inward = pose.rotation().inverse();
    match geometry {
        Geometry::Solid(_) | Geometry::Ladder(_) => {
            let parts = geometry.rungs().last().map_or(&[][..], |shape| shape.parts());
            let part = |body: &Body| {
                let support = |n: &Vector3<f64>| pose.transform_point(&body.support(&(inward * n)).point);
                vec![silhouette(support, view, DIRECTIONS)]
            };
            parts.iter().map(part).collect()
        }
        Geometry::Capsule(capsule) => {
            let capsule = capsule.capsule();
            let axis = pose.transform_direction(&Vector3::z()) * capsule.half_height_m();
            let support = |n: &Vector3<f64>| pose.translation() + axis * axis.dot(n).signum() + n * capsule.radius_m();
            vec![vec![silhouette(support, view, DIRECTIONS)]]
        }
        Geometry::SosBody(body) => {
            let value = |x: &Vector3<f64>| body.value(&(inward * (x - pose.translation())));
            vec![shadow(value, 1.0, &placed(body.bounding_box(), pose), view)]
        }
        Geometry::HalfSpace(_) => Vec::new(),
    }
}

/// A box along the world's axes around a box of a body frame.
fn placed(bounds: &Aabb, pose: &Pose) -> Aabb {
    let corners = (0..8).map(|corner: usize| {
        let end = |axis: usize| if corner >> axis & 1 == 1 { bounds.max[axis] } else { bounds.min[axis] };
        pose.transform_point(&Vector3::new(end(0), end(1), end(2)))
    });
    let empty = Aabb { min: Vector3::repeat(f64::INFINITY), max: Vector3::repeat(f64::NEG_INFINITY) };
    corners.fold(empty, |around, x| Aabb { min: around.min.inf(&x), max: around.max.sup(&x) })
}
