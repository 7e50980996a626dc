//! The picture of a motion in the tutorial: the arm at the start of the straight way through the
//! wall and at alpha, and how near it comes to contact on the way.

use nalgebra::Vector3;
use sublevel::body::{Body, Solid};
use sublevel::client::{CheckedMotion, ClearanceQuestion, Client, MotionsQuestion};
use sublevel::draw::{Ink, LineChart, Mark, Outline, Panel, Series, Silhouettes, Span, View, silhouette, stacked};
use sublevel::measure::Pose;
use sublevel::scene::NamedJointValues;
use sublevel::scene::query::StateVerdict;
use sublevel_testkit::data;

use super::robot::{self, PATH};
use crate::harness::Running;

const SCENE: &str = "straight-on";

/// Motions that the way is cut into, for a clearance of each.
const PARTS: u32 = 28;

/// Configurations of the way that are looked at one by one, less one.
const STEPS: u32 = 8 * PARTS;

/// How far a proven clearance may be below the true one, metres.
const ACCURACY_M: f64 = 1e-3;

/// Where nothing moves by more than this, metres, the search for the first contact ends.
const RESOLUTION_M: f64 = 1e-4;

/// Most that a proven clearance may be below the nearest pair of the configurations of its part,
/// metres: the first joint alone turns, by 1.4 rad, and each configuration is at most half a step
/// from one of these, 3.2 mm for a point 1 m from the axis. No point of the arm is that far from it.
const BELOW_M: f64 = 5e-3;

/// What is known of the straight way from the start to the goal.
struct Way {
    whole: CheckedMotion,
    /// One after the other, [`PARTS`] of them.
    parts: Vec<CheckedMotion>,
    /// Path parameter of a configuration, and signed distance of its nearest pair at most, metres.
    nearest: Vec<(f64, f64)>,
    /// Points of both sides of the nearest pair at alpha, metres, world frame.
    touching_m: [Vector3<f64>; 2],
}

/// Draws the picture, which has to say what the one in `docs/` says. `UPDATE_PICTURES=1` writes
/// that one again.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs SUBLEVEL_DATA"]
async fn the_picture_of_the_motion_shows_what_is_proven() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let url = server.url();
    let files = (data("panda/panda.urdf"), data("panda/panda.srdf"));
    robot::plan(&url, (files.0.as_path(), files.1.as_path()), SCENE, &PATH).await.expect("planned");
    let client = Client::connect(&url).await.expect("the server answers");
    let way = look(&client).await;
    check(&way);
    let drawn = stacked(&[arms(&client, &way).await, chart(&way)]);
    let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/planning-motion.svg");
    if std::env::var_os("UPDATE_PICTURES").is_some() {
        return std::fs::write(kept, drawn).expect("written");
    }
    let kept = std::fs::read_to_string(kept).expect("a picture");
    assert_eq!(texts(&drawn), texts(&kept), "UPDATE_PICTURES=1 draws it again");
}

/// The configuration at a path parameter, radians.
fn at(s: f64) -> [f64; 7] {
    let (start, goal) = (PATH[0], PATH[PATH.len() - 1]);
    std::array::from_fn(|joint| start[joint] + s * (goal[joint] - start[joint]))
}

/// Path parameters that cut the way into equal steps.
fn steps(count: u32) -> impl Iterator<Item = f64> {
    (0..=count).map(move |step| f64::from(step) / f64::from(count))
}

async fn look(client: &Client) -> Way {
    let ask = |path: &[[f64; 7]]| {
        let mut question = MotionsQuestion::of_robot("arm", []).with_edges(path);
        question.request_mut().first_contact = true;
        question.request_mut().resolution_m = Some(RESOLUTION_M);
        question
    };
    let mut whole = client.check_motions(SCENE, ask(&[at(0.0), at(1.0)])).await.expect("answered").motions;
    let whole = whole.remove(0);
    let ends: Vec<_> = steps(PARTS).map(at).collect();
    let mut question = ask(&ends);
    question.request_mut().clearance_accuracy_m = Some(ACCURACY_M);
    let parts = client.check_motions(SCENE, question).await.expect("answered").motions;
    let mut places: Vec<f64> = steps(STEPS).chain([whole.alpha]).collect();
    places.sort_by(f64::total_cmp);
    let states: Vec<_> = places.iter().map(|&s| at(s)).collect();
    let question = ClearanceQuestion::of_robot("arm", [], 1.0).with_configurations(&states).with_witnesses();
    let near = client.clearance(SCENE, question.with_max_pairs(1).without_gradients()).await.expect("answered");
    let near: Vec<_> = near.states.iter().map(|state| state.closest().expect("a pair within 1 m")).collect();
    assert_eq!((parts.len(), near.len()), (PARTS as usize, STEPS as usize + 2));
    let at_alpha = places.iter().position(|s| *s == whole.alpha).expect("alpha is one of them");
    let touching_m = near[at_alpha].witnesses_m.expect("two points");
    let nearest = places.into_iter().zip(near.iter().map(|near| near.upper_m)).collect();
    Way { whole, parts, nearest, touching_m }
}

/// The motion, its parts and its configurations agree.
fn check(way: &Way) {
    let Way { whole, parts, nearest, .. } = way;
    let (pair, contact_s) = whole.contact.as_ref().expect("a contact");
    assert!(whole.verdict == StateVerdict::Contact && pair.contains(&"wall".to_owned()), "{whole:?}");
    assert!(whole.alpha > 0.0 && whole.alpha <= *contact_s && contact_s - whole.alpha < 1e-3, "{whole:?}");
    let bounds: Vec<f64> = steps(PARTS).collect();
    let first = parts.iter().position(|part| part.verdict != StateVerdict::Free).expect("the wall is in the way");
    assert_eq!(parts[first].verdict, StateVerdict::Contact);
    assert!(bounds[first] <= *contact_s && whole.alpha <= bounds[first + 1], "part {first}: {whole:?}");
    assert_eq!(parts[parts.len() - 1].verdict, StateVerdict::Free, "the goal");
    for (part, ends) in parts.iter().zip(bounds.windows(2)).filter(|(part, _)| part.verdict == StateVerdict::Free) {
        let within = nearest.iter().filter(|(s, _)| (ends[0]..=ends[1]).contains(s));
        let least = within.map(|(_, upper_m)| *upper_m).fold(f64::INFINITY, f64::min);
        let proven = part.clearance_lower_m;
        assert!(proven > 0.0 && proven <= least && proven > least - BELOW_M, "{ends:?}: {proven} of {least}");
    }
}

/// The arm at the start and at alpha, and the wall, from above.
async fn arms(client: &Client, way: &Way) -> String {
    let mut outlines = Vec::new();
    for (s, ink) in [(0.0, Ink::Blue), (way.whole.alpha, Ink::Orange)] {
        let joints = NamedJointValues { joints: Vec::new(), values: at(s).to_vec() };
        client.set_joints(SCENE, "arm", joints).await.expect("set");
        let scene = client.scene(SCENE).await.expect("a scene");
        // The wall stands still: once is enough.
        for object in scene.objects.values().filter(|object| s == 0.0 || &*object.name != "wall") {
            let is_wall = &*object.name == "wall";
            let (pose, ink) = (object.pose.expect("a pose"), if is_wall { Ink::Grey } else { ink });
            let geometry = client.body(&object.body).await.expect("a body");
            let shape = geometry.rungs().last().expect("a solid");
            outlines.extend(shape.parts().iter().map(|part| Outline {
                ink,
                polygons: vec![from_above(part, &pose)],
                solid: is_wall,
            }));
        }
    }
    let touching = Span { ink: Ink::Orange, ends: way.touching_m.map(|point| View::Top.project(&point)) };
    let panel = Panel { caption: View::Top.name().into(), outlines, spans: vec![touching] };
    let legend = [(Ink::Blue, "start"), (Ink::Orange, "alpha, with the contact"), (Ink::Grey, "wall")];
    let legend = legend.map(|(ink, label)| (ink, label.to_owned())).into();
    Silhouettes { title: "The straight way".into(), legend, rows: vec![vec![panel]] }.to_svg()
}

/// The outline of a body where it stands, metres.
fn from_above(body: &Body, pose: &Pose) -> Vec<[f64; 2]> {
    let inward = pose.rotation().inverse();
    silhouette(|n| pose.transform_point(&body.support(&(inward * n)).point), View::Top, 180)
}

/// The nearest pair of configurations, and what is proven of the parts.
fn chart(way: &Way) -> String {
    let Way { whole, parts, nearest, .. } = way;
    let (pair, _) = whole.contact.as_ref().expect("a contact");
    let link = pair.iter().find(|name| *name != "wall").expect("a link");
    // What is nearer than the resolution is on the lower edge, as contact is.
    let seen = nearest.iter().map(|&(s, upper_m)| (s, if upper_m < RESOLUTION_M { 0.0 } else { upper_m }));
    let bounds: Vec<f64> = steps(PARTS).collect();
    let stairs = parts.iter().zip(bounds.windows(2)).flat_map(|(part, ends)| {
        let proven = if part.verdict == StateVerdict::Free { part.clearance_lower_m } else { 0.0 };
        [(ends[0], proven), (ends[1], proven)]
    });
    let top = nearest.iter().map(|(_, upper_m)| *upper_m).fold(RESOLUTION_M, f64::max);
    let series = |label: &str, ink, dashed, points| Series { label: label.into(), ink, dashed, points };
    let chart = LineChart {
        title: format!("Straight on: proven free up to {:.4}, where {link} meets the wall", whole.alpha),
        x_label: "path parameter s".into(),
        y_label: "clearance (m)".into(),
        series: vec![
            series("nearest pair at s", Ink::Blue, false, seen.collect()),
            series("proven of each part", Ink::Orange, true, stairs.collect()),
            series("alpha", Ink::Green, false, vec![(whole.alpha, 0.0), (whole.alpha, top)]),
        ],
        mark: Mark { value: RESOLUTION_M, label: "resolution".into() },
    };
    chart.to_svg().expect("a chart")
}

/// The words and numbers of a picture, in their order.
fn texts(svg: &str) -> Vec<&str> {
    let texts = svg.split("<text").skip(1).filter_map(|rest| rest.split_once('>')?.1.split("</text>").next());
    texts.map(str::trim).collect()
}
