//! Motions of planar and floating joints, with first contacts in closed form.

use super::*;

/// A link on one joint whose values are the whole configuration, with a ball of radius 0.1 m.
fn on_joint(kind: JointKind, place: Pose, post: [f64; 3]) -> MotionProblem {
    let joint = Joint {
        name: "base".into(),
        kind,
        parent: 0,
        child: 1,
        origin: Isometry3::identity(),
        axis: Vector3::z_axis(),
        limits: None,
        mimic: None,
    };
    let links = ["world", "body"].map(|name| Link { name: name.into(), collisions: Vec::new() });
    let description = Description { name: "free".into(), links: links.into(), joints: vec![joint] };
    let kinematics = Arc::new(Kinematics::new(&description).expect("a tree"));
    let bodies = vec![MotionBody { name: "ball".into(), link: 1, place, shape: ball(0.1) }];
    let robot = MotionRobot { kinematics, base: Pose::identity(), bodies };
    let [x, y, z] = post;
    MotionProblem::new(robot, vec![still("post", ball(0.1), at(x, y, z))], 0.0, |_, _| Some(0.0)).expect("a problem")
}

/// The least s at which the centres are 0.2 m apart, by bisection of steps of a thousandth.
fn first_contact(post: [f64; 3], center: impl Fn(f64) -> Vector3<f64>) -> Option<f64> {
    let is_apart = |s: f64| (center(s) - Vector3::from(post)).norm() > 0.2;
    let step = (1..=1000).map(|k| f64::from(k) / 1000.0).find(|s| !is_apart(*s))?;
    let (mut free, mut met) = (step - 1e-3, step);
    for _ in 0..60 {
        let middle = 0.5 * (free + met);
        if is_apart(middle) { free = middle } else { met = middle }
    }
    Some(met)
}

fn check(problem: &MotionProblem, path: &Path, expected: Option<f64>) {
    let found = prove(problem, path, &MotionOptions { certificate: true, ..FIRST });
    match expected {
        Some(expected) => {
            assert_eq!(found.verdict, MotionVerdict::Contact);
            let met = found.contact.expect("a contact").s;
            assert!(found.alpha <= expected + 1e-9 && expected <= met + 1e-9, "{} {expected} {met}", found.alpha);
            assert!(met - found.alpha < 1e-5, "{} {met}", found.alpha);
        }
        None => {
            assert_eq!(found.verdict, MotionVerdict::Free);
            found.certificate.expect("a certificate").verify().expect("a proof");
        }
    }
}

#[test]
fn a_floating_joint_goes_as_a_screw() {
    // A door about a hinge along z through (1, 0, 0), by a right angle, lifted by 0.2 m.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let ends = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, -1.0, 0.2, 0.0, 0.0, half, half];
    let center = |s: f64| {
        let (sine, cosine) = (s * std::f64::consts::FRAC_PI_2).sin_cos();
        Vector3::new(1.0 - cosine, -sine, 0.2 * s)
    };
    // In the way, and where a straight line would meet it: 0.29 m from the arc.
    let middle = center(0.5);
    for post in [middle.into(), [0.5, -0.5, 0.1], center(0.9).into()] {
        let problem = on_joint(JointKind::Floating, Pose::identity(), post);
        let path = Path::waypoints(problem.kinematics(), ends.to_vec()).expect("a path");
        let expected = first_contact(post, center);
        assert_eq!(expected.is_none(), post == [0.5, -0.5, 0.1]);
        check(&problem, &path, expected);
        // A body elsewhere on the link goes about the same line: this one stays on it.
        let hinge = on_joint(JointKind::Floating, at(1.0, 0.0, 0.0), [1.0, 0.0, 0.35]);
        check(&hinge, &path, first_contact([1.0, 0.0, 0.35], |s| Vector3::new(1.0, 0.0, 0.2 * s)));
    }
}

#[test]
fn a_planar_joint_moves_along_a_line_while_it_turns() {
    // 2 m along x and 1 m along y, with half a turn; the ball is 0.5 m out on the link.
    let ends = vec![0.0, 0.0, 0.0, 2.0, 1.0, std::f64::consts::PI];
    let center = |s: f64| {
        let (sine, cosine) = (s * std::f64::consts::PI).sin_cos();
        Vector3::new(2.0 * s + 0.5 * cosine, s + 0.5 * sine, 0.0)
    };
    let mut met = 0;
    for post in [center(0.6).into(), center(0.97).into(), [1.0, 0.5, 0.0], [1.5, 0.75, 0.19], [0.6, 0.6, 0.1]] {
        let problem = on_joint(JointKind::Planar, at(0.5, 0.0, 0.0), post);
        let path = Path::waypoints(problem.kinematics(), ends.clone()).expect("a path");
        let expected = first_contact(post, center);
        met += usize::from(expected.is_some());
        check(&problem, &path, expected);
    }
    assert!(met == 3, "{met}");
    // A Bézier segment moves the same values along a curve.
    let curve = vec![0.0, 0.0, 0.0, 0.0, 2.0, 1.0, 2.0, 1.0, std::f64::consts::PI];
    let problem = on_joint(JointKind::Planar, at(0.5, 0.0, 0.0), [1.2, 1.6, 0.0]);
    let path = Path::bezier(problem.kinematics(), curve.clone()).expect("a path");
    let value = |k: usize, s: f64| {
        let [a, b, c] = [curve[k], curve[3 + k], curve[6 + k]];
        (1.0 - s) * (1.0 - s) * a + 2.0 * s * (1.0 - s) * b + s * s * c
    };
    let expected = first_contact([1.2, 1.6, 0.0], |s| {
        let (sine, cosine) = value(2, s).sin_cos();
        Vector3::new(value(0, s) + 0.5 * cosine, value(1, s) + 0.5 * sine, 0.0)
    });
    check(&problem, &path, expected);
}
