//! The points that attain clearances, beside bodies and kinematics that are written out here.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use sublevel::body::BodyId;
use sublevel::client::{BodySource, ClearanceQuestion, Client, NearPair};
use sublevel::measure::Pose;
use sublevel::scene::query::AnswerStatus;
use sublevel::scene::{Subject, Update};
use sublevel_testkit::random::{pose, seeds};
use sublevel_testkit::{Seeded, bodies, sos_bodies};

use super::{cell, joints, served};

/// Width of a bracket, in metres, of bodies of about a metre.
const NARROW: f64 = 1e-8;

/// A set about its origin, lengths in metres.
#[derive(Clone, Copy, Debug)]
enum Form {
    /// `Σ |x_i / s_i|^degree <= 1`.
    Power([f64; 3], i32),
    /// `(|(x, y)| / r)^degree + |z / h|^degree <= 1`.
    Rounded(f64, f64, i32),
    /// Half-extents.
    Cuboid([f64; 3]),
    /// Radius and half-height.
    Cylinder(f64, f64),
    /// Radius and half the length of the axis.
    Capsule(f64, f64),
    /// `z <= 0`.
    Below,
    /// Around the unit circle in the plane `z = 0`; not convex.
    Torus(f64),
}

impl Form {
    /// At most 1 inside, of the order of the distance beyond.
    fn level(self, x: &Vector3<f64>) -> f64 {
        let wall = x.x.hypot(x.y);
        match self {
            Self::Power(s, degree) => (0..3).map(|i| (x[i] / s[i]).abs().powi(degree)).sum(),
            Self::Rounded(r, h, degree) => (wall / r).powi(degree) + (x.z / h).abs().powi(degree),
            Self::Cuboid(h) => (0..3).map(|i| (x[i] / h[i]).abs()).fold(0.0, f64::max),
            Self::Cylinder(r, h) => (wall / r).max((x.z / h).abs()),
            Self::Capsule(r, h) => (x - Vector3::new(0.0, 0.0, x.z.clamp(-h, h))).norm() / r,
            Self::Below => 1.0 + x.z,
            Self::Torus(r) => (wall - 1.0).hypot(x.z) / r,
        }
    }

    /// The most that n·x is inside; none of a set that is not convex.
    fn support(self, n: &Vector3<f64>) -> Option<f64> {
        let wall = n.x.hypot(n.y);
        // Norms of degree and of q are dual to each other.
        let dual = |values: &[f64], degree: i32| {
            let q = f64::from(degree) / f64::from(degree - 1);
            values.iter().map(|value| value.abs().powf(q)).sum::<f64>().powf(1.0 / q)
        };
        Some(match self {
            Self::Power(s, degree) => dual(&[s[0] * n.x, s[1] * n.y, s[2] * n.z], degree),
            Self::Rounded(r, h, degree) => dual(&[r * wall, h * n.z], degree),
            Self::Cuboid(h) => (0..3).map(|i| h[i] * n[i].abs()).sum(),
            Self::Cylinder(r, h) => r * wall + h * n.z.abs(),
            Self::Capsule(r, h) => r + h * n.z.abs(),
            Self::Below if (n - Vector3::z()).norm() < 1e-9 => 0.0,
            Self::Below => f64::INFINITY,
            Self::Torus(_) => return None,
        })
    }
}

/// A set where it stands.
#[derive(Clone, Copy, Debug)]
struct Placed {
    form: Form,
    at: Isometry3<f64>,
}

impl Placed {
    fn level(&self, x: &Vector3<f64>) -> f64 {
        self.form.level(&self.at.inverse_transform_point(&Point3::from(*x)).coords)
    }

    fn support(&self, n: &Vector3<f64>) -> Option<f64> {
        Some(self.at.translation.vector.dot(n) + self.form.support(&self.at.inverse_transform_vector(n))?)
    }

    /// Distance of a point outside of a torus.
    fn beyond_torus(&self, x: &Vector3<f64>) -> Option<f64> {
        let Form::Torus(r) = self.form else { return None };
        Some((self.level(x) - 1.0) * r)
    }
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(*pose.translation()), *pose.rotation())
}

/// The bodies of a crane, by the values of its two joints.
fn crane(name: &str, base_x: f64, [lift, slide]: [f64; 2]) -> BTreeMap<String, Placed> {
    let up = |z: f64| Isometry3::translation(0.0, 0.0, z);
    let post = Isometry3::translation(base_x, 0.0, 0.0);
    let turn =
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::y_axis(), lift));
    let arm = post * up(0.3) * turn;
    let hand = arm * up(1.0 + slide);
    let links = [
        ("post", Form::Cuboid([0.1, 0.1, 0.2]), post),
        ("arm", Form::Capsule(0.05, 0.3), arm * up(0.5)),
        ("hand", Form::Power([0.1; 3], 2), hand),
        ("finger", Form::Power([0.02; 3], 2), hand * up(0.2 + 0.5 * slide)),
    ];
    links.map(|(link, form, at)| (format!("{name}/{link}"), Placed { form, at })).into()
}

/// What stands around, with its body on the server.
async fn things(client: &Client) -> Vec<(&'static str, Form, BodyId)> {
    let mut things = Vec::new();
    for (name, form, file) in [
        ("egg", Form::Power([0.3, 0.2, 0.1], 2), bodies::e(0.3, 0.2, 0.1).to_json()),
        ("cushion", Form::Power([0.2, 0.15, 0.3], 4), bodies::q(4, 0.2, 0.15, 0.3).to_json()),
        ("drum", Form::Rounded(0.15, 0.3, 4), bodies::c(4, 0.15, 0.3).to_json()),
        ("crate", Form::Cuboid([0.2, 0.3, 0.1]), bodies::b(0.2, 0.3, 0.1).to_json()),
        ("tin", Form::Cylinder(0.1, 0.2), bodies::cylinder(0.1, 0.2).to_json()),
        ("ring", Form::Torus(0.2), sos_bodies::torus(0.2).to_json()),
    ] {
        things.push((name, form, client.create_from_file(file).await.expect("stored").id));
    }
    for (name, form, source) in [
        ("limb", Form::Capsule(0.08, 0.25), BodySource::Capsule { radius: 0.08, half_height: 0.25 }),
        ("floor", Form::Below, BodySource::HalfSpace { normal: Vector3::z(), offset: 0.0 }),
    ] {
        things.push((name, form, client.create_body(name, source).await.expect("stored").id));
    }
    things
}

/// What the rows of some states were.
#[derive(Debug, Default)]
struct Seen {
    apart: usize,
    overlapping: usize,
    without: usize,
    padded: usize,
    /// Kinds of pairs.
    pairs: BTreeMap<[String; 2], usize>,
}

impl Seen {
    /// Holds a row against the two bodies where they stand.
    fn check(&mut self, near: &NearPair, [a, b]: [&Placed; 2], seed: u64) {
        let NearPair { lower_m, upper_m, .. } = *near;
        assert_eq!(near.witnesses_m.is_some(), upper_m.is_finite(), "seed {seed}: {near:?}");
        let Some([x, y]) = near.witnesses_m else {
            self.without += 1;
            return;
        };
        *self.pairs.entry(near.pair.clone()).or_default() += 1;
        self.padded += usize::from(near.padding_m != 0.0);
        let (of_a, of_b) = (a.level(&x), b.level(&y));
        assert!(of_a <= 1.0 + 1e-9 && of_b <= 1.0 + 1e-9, "seed {seed}: {of_a} {of_b} {near:?}");
        let apart = (x - y).norm();
        if lower_m > 0.0 {
            self.apart += 1;
            assert!(lower_m - 1e-12 <= apart && apart <= upper_m + 1e-12, "seed {seed}: {apart} {near:?}");
            // That no points are nearer, two parallel planes show, or the ring.
            let n = (x - y) / apart;
            let least = match (a.support(&-n), b.support(&n)) {
                (Some(most_a), Some(most_b)) => -most_a - most_b,
                _ => a.beyond_torus(&y).or_else(|| b.beyond_torus(&x)).expect("one of them is the ring"),
            };
            assert!(least >= apart - 1e-6, "seed {seed}: {least} {apart} {near:?}");
            assert!(least <= upper_m + 1e-6, "seed {seed}: {least} {apart} {near:?}");
        } else if upper_m < 0.0 && near.status == AnswerStatus::Converged {
            self.overlapping += 1;
            // They are as far apart along the normal as the planes there that part the bodies.
            let n = near.normal.expect("a normal");
            let signed = n.dot(&(x - y));
            let slack = NARROW - 1e-6 * lower_m;
            assert!(lower_m - slack <= signed && signed <= upper_m + slack, "seed {seed}: {signed} {near:?}");
            let planes = -a.support(&-n).expect("convex") - b.support(&n).expect("convex");
            assert!((planes - signed).abs() <= slack, "seed {seed}: {planes} {signed} {near:?}");
        }
    }
}

/// Somewhere around the first robot, 0.6 m to 2 m from a point of it.
fn somewhere(random: &mut Seeded) -> Pose {
    let length = random.between(0.6, 2.0);
    let around = random.pose(length);
    pose(*around.translation() + Vector3::new(0.0, 0.0, 0.8), around.rotation())
}

#[tokio::test(flavor = "multi_thread")]
async fn witnesses_attain_the_distances_and_lie_on_the_bodies() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let things = things(&client).await;
    let mut seen = [(); 2].map(|()| Seen::default());
    for seed in seeds(1, 4, &[]) {
        let random = &mut Seeded(seed);
        let mut standing = BTreeMap::new();
        let mut objects = Vec::new();
        for (name, form, id) in &things {
            let pose = if *name == "floor" { Pose::identity() } else { somewhere(random) };
            standing.insert((*name).to_owned(), Placed { form: *form, at: isometry(&pose) });
            objects.push((*name, id, pose));
        }
        client.put_objects("cell", objects).await.expect("placed");
        // The other crane and the ball that hangs above it are as `cell` makes them.
        let other = [2.0 * random.signed(), 0.2 * random.positive()];
        client.set_joints("cell", "two", joints(&[], &other)).await.expect("set");
        standing.extend(crane("two", 3.0, other));
        let thing = Form::Power([0.05; 3], 2);
        standing.insert("post".into(), Placed { form: thing, at: Isometry3::translation(3.0, 0.0, 2.0) });
        // Paddings, which move nothing.
        let padding = |random: &mut Seeded| Some(0.2 * random.signed());
        let update = Update {
            group_paddings: vec![("one".into(), padding(random)), ("two".into(), padding(random))],
            pair_paddings: vec![((Subject::Object("one/hand".into()), Subject::Object("egg".into())), padding(random))],
            ..Update::default()
        };
        client.update_scene("cell", &update).await.expect("padded");
        // States of the robot.
        let states: Vec<[f64; 2]> = (0..24).map(|_| [2.0 * random.signed(), 0.2 * random.positive()]).collect();
        let ask = ClearanceQuestion::of_robot("one", [], 5.0).with_configurations(&states).with_witnesses();
        let found = client.clearance("cell", ask).await.expect("answered");
        for (values, state) in states.iter().zip(&found.states) {
            let mut placed = standing.clone();
            placed.extend(crane("one", 0.0, *values));
            let held = placed["one/hand"].at * Isometry3::translation(0.0, 0.0, 0.3);
            placed.insert("held".into(), Placed { form: thing, at: held });
            assert!(state.checked && state.near.len() > 40, "seed {seed}: {}", state.near.len());
            for near in &state.near {
                seen[0].check(near, [&placed[&near.pair[0]], &placed[&near.pair[1]]], seed);
            }
        }
        // States of objects, the robots as they stand in the scene.
        let mut placed = standing;
        placed.extend(crane("one", 0.0, [0.0; 2]));
        placed.insert("held".into(), Placed { form: thing, at: Isometry3::translation(0.0, 0.0, 1.6) });
        let names = ["egg", "drum", "crate", "limb"];
        let poses: Vec<Pose> = (0..24 * names.len()).map(|_| somewhere(random)).collect();
        let ask = ClearanceQuestion::new(names, 5.0).with_states(&poses).with_witnesses();
        let found = client.clearance("cell", ask).await.expect("answered");
        for (poses, state) in poses.chunks(names.len()).zip(&found.states) {
            for (name, pose) in names.iter().zip(poses) {
                placed.get_mut(*name).expect("it stands").at = isometry(pose);
            }
            assert!(state.checked && state.near.len() > 40, "seed {seed}: {}", state.near.len());
            for near in &state.near {
                seen[1].check(near, [&placed[&near.pair[0]], &placed[&near.pair[1]]], seed);
            }
        }
    }
    for Seen { apart, overlapping, without, padded, pairs } in seen {
        println!("{apart} apart, {overlapping} overlapping, {without} without, {padded} padded, {} kinds", pairs.len());
        assert!(apart > 3000 && overlapping > 30 && pairs.len() > 45, "{apart} {overlapping} {pairs:?}");
        assert!(padded > 300, "{padded}");
        // Only where no upper bound is known: capsules beside the ring.
        assert!(without < apart / 10, "{without}");
    }
}
