//! Planar and floating joints against poses that are composed by hand.

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use sublevel_testkit::Seeded;

use crate::{Kinematics, read_urdf};

/// A body that flies, an arm on it, and two pads that slide and turn in planes: one across z, one
/// across an oblique axis.
const URDF: &str = r#"<robot name="free">
  <link name="world"/><link name="torso"/><link name="arm"/><link name="pad"/><link name="wedge"/>
  <joint name="fly" type="floating"><parent link="world"/><child link="torso"/>
    <origin xyz="0.1 -0.2 0.3" rpy="0.1 0.2 0.3"/></joint>
  <joint name="elbow" type="revolute"><parent link="torso"/><child link="arm"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="glide" type="planar"><parent link="arm"/><child link="pad"/>
    <origin xyz="0.2 0 0" rpy="0 0.5 0"/><axis xyz="0 0 1"/></joint>
  <joint name="skew" type="planar"><parent link="pad"/><child link="wedge"/>
    <origin xyz="0 0.3 0.1" rpy="-0.4 0 1"/><axis xyz="0 0.6 0.8"/></joint>
</robot>"#;

/// Poses of torso, arm, pad and wedge.
fn by_hand(values: &[f64]) -> [Isometry3<f64>; 4] {
    let turn = UnitQuaternion::from_euler_angles;
    let frame = |x: f64, y: f64, z: f64, rotation: UnitQuaternion<f64>| {
        Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation)
    };
    let still = UnitQuaternion::identity();
    let &[x, y, z, i, j, k, w, elbow, u, v, a, p, q, b] = values else { panic!("{} values", values.len()) };
    let flown = frame(x, y, z, UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)));
    let torso = frame(0.1, -0.2, 0.3, turn(0.1, 0.2, 0.3)) * flown;
    let arm = torso * frame(0.0, 0.0, 0.5, still) * frame(0.0, 0.0, 0.0, turn(0.0, elbow, 0.0));
    let pad = arm * frame(0.2, 0.0, 0.0, turn(0.0, 0.5, 0.0)) * frame(u, v, 0.0, turn(0.0, 0.0, a));
    // Across (0, 0.6, 0.8): (0, -0.8, 0.6) and (1, 0, 0), whose cross product it is.
    let about = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.6, 0.8) * b);
    let wedge = pad * frame(0.0, 0.3, 0.1, turn(-0.4, 0.0, 1.0)) * frame(q, -0.8 * p, 0.6 * p, about);
    [torso, arm, pad, wedge]
}

fn values(seeded: &mut Seeded) -> Vec<f64> {
    let q = seeded.rotation().coords;
    let size = [1e-3, 1.0, 30.0][seeded.index(3)];
    let mut all: Vec<f64> = (0..3).map(|_| size * seeded.signed()).collect();
    all.extend([q.x, q.y, q.z, q.w]);
    all.extend((0..7).map(|_| 1.9 * seeded.signed()));
    all
}

#[test]
fn poses_and_jacobians_are_those_composed_by_hand() {
    let kinematics = Kinematics::new(&read_urdf(URDF).expect("a description")).expect("a tree");
    assert_eq!(kinematics.width(), 14);
    let base = Isometry3::identity();
    for seed in 0..200 {
        let mut seeded = Seeded(seed);
        let values = values(&mut seeded);
        kinematics.check(&values).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let mut poses = Vec::new();
        kinematics.forward(&base, &values, &mut poses);
        for (link, expected) in by_hand(&values).iter().enumerate() {
            let pose = &poses[link + 1];
            let size = 1.0 + expected.translation.vector.norm();
            let error = (pose.translation.vector - expected.translation.vector).norm();
            assert!(error < 1e-12 * size, "seed {seed}, link {link}: position off by {error:e} m");
            let error =
                (pose.rotation.to_rotation_matrix().matrix() - expected.rotation.to_rotation_matrix().matrix()).norm();
            assert!(error < 1e-12, "seed {seed}, link {link}: rotation off by {error:e}");
            // A point of the link, and how it turns, by central differences of the poses by hand.
            let local = Point3::from(seeded.unit());
            let columns = kinematics.jacobian(&poses, &values, link + 1, &(pose * local).coords);
            assert_eq!(columns.len(), values.len());
            for (value, (linear, angular)) in columns.iter().enumerate() {
                let step = 1e-5;
                let [ahead, behind] = [step, -step].map(|by| {
                    let mut moved = values.clone();
                    moved[value] += by;
                    by_hand(&moved)[link]
                });
                let differences = ((ahead * local) - (behind * local)) / (2.0 * step);
                let error = (linear - differences).norm();
                assert!(error < 1e-6, "seed {seed}, link {link}, value {value}: velocity off by {error:e}");
                let turning = (ahead.rotation * behind.rotation.inverse()).scaled_axis() / (2.0 * step);
                let error = (angular - turning).norm();
                assert!(error < 1e-6, "seed {seed}, link {link}, value {value}: turn off by {error:e}");
            }
        }
    }
}
