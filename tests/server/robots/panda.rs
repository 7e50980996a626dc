//! The SRDF of the Panda arm against what is proven of its pairs of links, and a contact that the
//! SRDF leaves out, shown on the meshes themselves.

use std::future::pending;
use std::path::Path;

use nalgebra::{Isometry3, Point3};
use sublevel::client::{ExplainQuestion, RobotFiles, RobotPlacement, SceneState};
use sublevel::fit::{ReadOptions, read_mesh};
use sublevel::robot::motion::{DEFAULT_DERIVE_RESOLUTION_M, DEFAULT_MAX_BOXES, PairClass};
use sublevel::robot::{Geometry, MeshPaths, read_urdf};
use sublevel::scene::NamedJointValues;
use sublevel::scene::query::StateVerdict;
use sublevel::store::{DeriveRequest, DerivedLinkPair};
use sublevel_testkit::data;
use sublevel_testkit::triangles::{Triangle, crossings};

use crate::harness::Running;

/// The triangles of a link in the world, from the files alone, where the scene says that the link
/// is.
fn triangles(urdf: &Path, scene: &SceneState, link: &str) -> Vec<Triangle> {
    let description = read_urdf(&std::fs::read_to_string(urdf).expect("a file")).expect("a robot");
    let paths = MeshPaths::new(urdf.parent().expect("a folder"));
    let pose = scene.objects[format!("arm/{link}").as_str()].pose.expect("a pose");
    let frame = Isometry3::from_parts((*pose.translation()).into(), *pose.rotation());
    let of_link = description.links.iter().find(|of| &*of.name == link).expect("a link");
    let mut found = Vec::new();
    for collision in &of_link.collisions {
        let Geometry::Mesh { uri, scale } = &collision.geometry else { panic!("{link} is no mesh") };
        let mesh = read_mesh(&paths.resolve(uri).expect("a path"), &ReadOptions::default()).expect("a mesh").mesh;
        let place = |index: &usize| {
            let point = Point3::from(mesh.points[*index].component_mul(scale));
            (frame * collision.origin * point).coords
        };
        found.extend(mesh.triangles.iter().map(|corners| corners.each_ref().map(place)));
    }
    found
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs SUBLEVEL_DATA"]
async fn a_pair_that_the_srdf_leaves_out_collides_and_all_others_never_do() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let client = server.client().await;
    let [urdf, srdf] = ["panda/panda.urdf", "panda/panda.srdf"].map(data);
    let robot = client.load_robot_files(&RobotFiles::new(&urdf).with_srdf(&srdf)).await.expect("loaded");
    let asked = DeriveRequest {
        robot: robot.id,
        margin_m: 0.0,
        max_boxes: DEFAULT_MAX_BOXES,
        resolution_m: DEFAULT_DERIVE_RESOLUTION_M,
    };
    let found = client.derive_allowed_pairs(&asked, |_| {}, pending()).await.expect("derived");
    assert_eq!(found.pairs.len(), 55, "eleven links with meshes");
    let of_reason = |reason: &str| -> Vec<&DerivedLinkPair> {
        found.pairs.iter().filter(|pair| pair.srdf_reason.as_deref() == Some(reason)).collect()
    };
    let never = of_reason("Never");
    let proven = never.iter().filter(|pair| pair.class == PairClass::Never).count();
    let boxes: u32 = found.pairs.iter().map(|pair| pair.boxes).sum();
    println!("{proven} of {} pairs never touch, {boxes} boxes of all pairs in {:.1} s", never.len(), found.seconds);
    assert_eq!((never.len(), proven), (23, 22));
    assert!(never.iter().all(|pair| pair.class != PairClass::Never || pair.upper_m.is_none_or(|upper| upper > 0.0)));
    assert!(of_reason("Adjacent").iter().all(|pair| pair.class == PairClass::Adjacent));
    // Pairs that are checked have to be: all of them can touch.
    let checked: Vec<_> = found.pairs.iter().filter(|pair| pair.srdf_reason.is_none()).collect();
    assert_eq!(checked.len(), 21);
    assert!(checked.iter().all(|pair| pair.class == PairClass::Collides && pair.is_certain), "{checked:?}");

    let wrong: Vec<_> = found.pairs.iter().filter(|pair| pair.contradicts_srdf()).collect();
    let [wrong] = &wrong[..] else { panic!("{wrong:?}") };
    assert_eq!((wrong.links.each_ref().map(String::as_str), wrong.class), (LINKS, PairClass::Collides));
    let depth = -wrong.upper_m.expect("a depth");
    let witness = wrong.witness.clone().expect("joint values");
    for (value, joint) in witness.iter().zip(&robot.joints) {
        let limits = joint.limits.expect("limits");
        assert!(limits.lower <= *value && *value <= limits.upper, "{}: {value}", joint.name);
    }
    assert!(wrong.is_certain && depth > 0.05, "{wrong:?}");

    // There, and where others have found it, the bodies overlap, and the meshes intersect.
    client.create_scene("cell").await.expect("made");
    client.place_robot("cell", &RobotPlacement::new("arm", &robot)).await.expect("placed");
    let elsewhere = vec![0.0, 0.0, 1.2981, -3.0407, -2.5962, 2.8449, 0.0];
    for (values, least_m) in [(witness, 0.99 * depth), (elsewhere, 0.024)] {
        let named = NamedJointValues { joints: Vec::new(), values: values.clone() };
        client.set_joints("cell", "arm", named).await.expect("set");
        let mut ask = ExplainQuestion::of_robot("arm", []).with_joint_values(&values);
        ask.request_mut().include_allowed = true;
        let explained = client.explain("cell", ask).await.expect("answered");
        assert_eq!(explained.verdict, StateVerdict::Contact);
        let names = LINKS.map(|link| format!("arm/{link}"));
        let pair = explained.pairs.iter().find(|pair| names.iter().all(|name| pair.pair.contains(name)));
        let pair = pair.expect("the pair");
        assert!(pair.is_contact && -pair.upper_m >= least_m, "{pair:?}");
        let scene = client.scene("cell").await.expect("a scene");
        let [a, b] = LINKS.map(|link| triangles(&urdf, &scene, link));
        let count = crossings(&a, &b);
        println!(
            "{} and {} at {values:.4?}: bodies overlap by {:.1} mm; of {} and {} triangles {count} pairs intersect",
            LINKS[0],
            LINKS[1],
            -1e3 * pair.upper_m,
            a.len(),
            b.len()
        );
        assert!(count > 0, "the meshes themselves intersect");
    }
    // At rest they are far apart, and no triangles of theirs intersect.
    let rest = NamedJointValues { joints: Vec::new(), values: vec![0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785] };
    client.set_joints("cell", "arm", rest).await.expect("set");
    let scene = client.scene("cell").await.expect("a scene");
    let [a, b] = LINKS.map(|link| triangles(&urdf, &scene, link));
    assert_eq!(crossings(&a, &b), 0);
}

/// What the SRDF says never touch.
const LINKS: [&str; 2] = ["panda_link2", "panda_link6"];
