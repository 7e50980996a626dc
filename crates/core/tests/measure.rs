//! Distances between fitted bodies: brackets, optimality at the witnesses, several constraints, no
//! allocation.

use nalgebra::Vector3;
use sublevel_core::body::{Body, Compound};
use sublevel_core::measure::{
    Capsule, CapsuleDistance, Distance, HalfSpace, ImpactOptions, Motion, Options, Pose, Ray, Status, Sweep, WarmStart,
    capsule_nearer_to_half_space_than, capsules_nearer_than, capsules_within_margin, cast_ball, cast_ray, distance,
    distance_batch, distance_of_capsule_to_half_space, distance_of_capsules, distance_to_capsule,
    distance_to_capsule_batch, distance_to_half_space, distance_to_point, growth_distance, is_solved_in_lanes,
    level_distance, nearer_than, nearer_to_capsule_than, nearer_to_half_space_than, overlap,
    overlap_of_capsule_with_half_space, overlap_of_capsules, overlap_with_capsule, overlap_with_half_space,
    penetration, signed_distance, time_of_impact, translation_hessian, within_margin, within_margin_of_capsule,
};
use sublevel_testkit::Seeded;
use sublevel_testkit::bodies::{cut, cylinder};

/// Chair and human at degrees 2, 4 and 6.
fn fitted() -> Vec<(&'static Body, &'static Body)> {
    sublevel_testkit::bodies::fitted().as_chunks().0.iter().map(|[chair, human]| (chair, human)).collect()
}

/// Gradient of a body of one constraint at a world point, world frame, and the constraint's value.
fn gradient(body: &Body, pose: &Pose, x: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let local = pose.rotation().inverse_transform_vector(&(x - pose.translation()));
    let jet = body.placement().jet(&body.constraints()[0], &local);
    (jet.value, pose.transform_direction(&jet.gradient))
}

/// The optimality conditions at the witnesses: both on the surface, normals opposite along the line
/// between them.
fn check_optimality(answer: &Distance, (a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose), label: &str) {
    let n = (answer.witness_a - answer.witness_b).normalize();
    let (value_a, g_a) = gradient(a, pose_a, &answer.witness_a);
    let (value_b, g_b) = gradient(b, pose_b, &answer.witness_b);
    assert!((value_a - 1.0).abs() < 1e-7 && (value_b - 1.0).abs() < 1e-7, "{label}: {value_a} {value_b}");
    // A bracket of 1e-9 determines the angles to its square root.
    for (name, error) in [("A", g_a.normalize() + n), ("B", g_b.normalize() - n)] {
        assert!(error.norm() < 1e-4, "{label}: normal of {name} is off by {:e}", error.norm());
    }
    let reported = answer.normal.unwrap_or_else(|| panic!("{label}: no normal"));
    assert!((reported - n).norm() < 1e-4, "{label}: reported normal is off by {:e}", (reported - n).norm());
}

#[test]
fn two_hundred_random_poses_of_fitted_bodies() {
    let (mut apart, mut overlapping) = (0, 0);
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let (chair, human) = fitted()[(seed % 3) as usize];
        let size = chair.circumscribed().radius.max(human.circumscribed().radius);
        let far = size * (1.2 + 1.1 * random.signed());
        let (pose_a, pose_b) = (random.pose(0.3), random.pose(far));
        let answer = distance(chair, &pose_a, human, &pose_b, &Options::default(), &mut WarmStart::default());
        let label = format!("seed {seed}: {answer:?}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        assert!(answer.lower <= answer.upper && answer.upper - answer.lower <= 1e-9 * size, "{label}");
        if answer.upper == 0.0 {
            overlapping += 1;
            assert_eq!(answer.witness_a, answer.witness_b, "{label}");
            assert!(answer.normal.is_none(), "{label}");
        } else if answer.lower > 1e-6 {
            apart += 1;
            check_optimality(&answer, (chair, &pose_a), (human, &pose_b), &label);
        }
        for (p, pose_p, q, pose_q) in [(chair, &pose_a, human, &pose_b), (human, &pose_b, chair, &pose_a)] {
            let level = level_distance(p, pose_p, q, pose_q, &Options::default(), &mut WarmStart::default());
            let label = format!("seed {seed}: {level:?}");
            assert_eq!(level.status, Status::Converged, "{label}");
            assert!(level.upper - level.lower <= 1e-9 * level.upper.abs().max(1.0), "{label}");
            assert_eq!(level.lower > 1.0, answer.lower > 0.0, "{label} against {answer:?}");
            // Stationarity: on the boundary of q the gradients oppose each other; inside, p's
            // vanishes.
            let (_, g_p) = gradient(p, pose_p, &level.witness);
            let (value_q, g_q) = gradient(q, pose_q, &level.witness);
            if value_q > 1.0 - 1e-6 {
                let turn = g_p.normalize() + g_q.normalize();
                assert!(turn.norm() < 1e-3 || g_p.norm() < 1e-3, "{label}: gradients are off by {:e}", turn.norm());
            } else {
                assert!(g_p.norm() * p.circumscribed().radius < 1e-3, "{label}: {:e}", g_p.norm());
            }
        }
    }
    println!("{apart} apart, {overlapping} overlapping");
    assert!(apart > 60 && overlapping > 30, "{apart} apart, {overlapping} overlapping");
}

#[test]
fn a_box_against_a_fitted_chair() {
    let (chair, _) = fitted()[2];
    let crate_ = Body::cuboid("crate", Vector3::new(0.3, 0.2, 0.25)).unwrap();
    let can = Body::cylinder("can", 0.1, 0.4).unwrap();
    for seed in 0..100 {
        let mut random = Seeded(1000 + seed);
        let other = if seed % 2 == 0 { &crate_ } else { &can };
        let size = chair.circumscribed().radius;
        let (pose_a, pose_b) = (random.pose(0.1), random.pose(size * 1.5));
        let answer = distance(other, &pose_a, chair, &pose_b, &Options::default(), &mut WarmStart::default());
        let label = format!("seed {seed}: {answer:?}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        assert!(answer.upper - answer.lower <= 1e-9 * size, "{label}");
        // Independent: support gap of the reported normal over the boundary points of both.
        if let Some(n) = answer.normal {
            let along = |body: &Body, pose: &Pose, n: Vector3<f64>| {
                let points = body.boundary().iter().map(|x| n.dot(&pose.transform_point(x)));
                points.fold(f64::MIN, f64::max)
            };
            let gap = -along(other, &pose_a, -n) - along(chair, &pose_b, n);
            assert!(gap >= answer.lower - 1e-9, "{label}: boundary points are only {gap} apart");
        }
        for (p, pose_p, q, pose_q) in [(other, &pose_a, chair, &pose_b), (chair, &pose_b, other, &pose_a)] {
            let level = level_distance(p, pose_p, q, pose_q, &Options::default(), &mut WarmStart::default());
            assert_eq!(level.status, Status::Converged, "seed {seed}: {level:?}");
        }
    }
}

#[test]
fn a_solve_allocates_nothing() {
    let (chair, human) = fitted()[2];
    let crate_ = Body::cuboid("crate", Vector3::new(0.3, 0.2, 0.25)).unwrap();
    for seed in 0..30 {
        let mut random = Seeded(2000 + seed);
        let other = if seed % 2 == 0 { human } else { &crate_ };
        let (pose_a, pose_b) = (random.pose(0.0), random.pose(0.4 + 0.1 * seed as f64));
        let (mut warm, mut warm_level) = (WarmStart::default(), WarmStart::default());
        let counted = allocation_counter::measure(|| {
            for _ in 0..2 {
                distance(chair, &pose_a, other, &pose_b, &Options::default(), &mut warm);
                level_distance(chair, &pose_a, other, &pose_b, &Options::default(), &mut warm_level);
            }
        });
        assert_eq!(counted.count_total, 0, "seed {seed}");
        let poses: Vec<Pose> = (0..40).map(|k| random.pose(0.1 * f64::from(k))).collect();
        let mut answers = vec![Distance::default(); poses.len()];
        let counted = allocation_counter::measure(|| {
            distance_batch(chair, &pose_a, other, &poses, &Options::default(), &mut answers).expect("as many places");
        });
        assert_eq!(counted.count_total, 0, "batch, seed {seed}");
    }
}

/// Neither do those of other measures and kinds of bodies, apart, near and in overlap, of compounds
/// as well.
#[test]
fn no_kind_of_query_allocates() {
    let (chair, _) = fitted()[2];
    let crate_ = || Body::cuboid("crate", Vector3::new(0.3, 0.2, 0.25)).unwrap();
    let can = cylinder(0.25, 0.3);
    let sliced = cut(0.3, 0.4, 0.2);
    let bodies = [chair.clone(), crate_(), can.clone(), sliced.clone()];
    let at = |body: &Body, x: f64| body.moved(&Default::default(), &Vector3::new(x, 0.0, 0.0)).unwrap();
    let pile = Compound::new("pile", vec![crate_(), at(&can, 0.6), at(&sliced, -0.7), at(chair, 1.4)]).unwrap();
    let capsule = Capsule::new(0.1, 0.3).unwrap();
    let plane = HalfSpace::new(Vector3::z(), 0.0).unwrap();
    let options = Options::default();
    for seed in 0..40 {
        let mut random = Seeded(4000 + seed);
        let (pose_a, pose_b) = (random.pose(0.0), random.pose(0.1 + 0.04 * seed as f64));
        let ray = Ray::new(*pose_b.translation(), random.unit(), 10.0).unwrap();
        let sweep = Sweep::new(ray, 0.05).unwrap();
        let still = Motion::still(pose_a);
        // Towards the other, turning, for a second.
        let velocity = pose_a.translation() - pose_b.translation();
        let moving = Motion::new(pose_b, velocity, random.unit(), *pose_b.translation()).unwrap();
        let second = ImpactOptions::new(1.0).unwrap();
        let counted = |name: &str, query: &mut dyn FnMut(&mut WarmStart)| {
            let mut warm = WarmStart::default();
            let counted = allocation_counter::measure(|| {
                query(&mut warm);
                query(&mut warm);
            });
            assert_eq!(counted.count_total, 0, "{name}, seed {seed}");
        };
        for a in &bodies {
            let of_a = a.name();
            for b in &bodies {
                let name = |what: &str| format!("{what} of {of_a} and {}", b.name());
                counted(&name("distance"), &mut |warm| {
                    distance(a, &pose_a, b, &pose_b, &options, warm);
                });
                counted(&name("overlap"), &mut |warm| {
                    overlap(a, &pose_a, b, &pose_b, &options, warm);
                });
                counted(&name("threshold"), &mut |warm| {
                    nearer_than(a, &pose_a, b, &pose_b, 0.3, &options, warm).unwrap();
                });
                counted(&name("margin"), &mut |warm| {
                    within_margin(a, &pose_a, b, &pose_b, 0.3, &options, warm).unwrap();
                });
                counted(&name("level distance"), &mut |warm| {
                    level_distance(a, &pose_a, b, &pose_b, &options, warm);
                });
                counted(&name("growth distance"), &mut |warm| {
                    growth_distance(a, &pose_a, b, &pose_b, &options, warm);
                });
                counted(&name("signed distance"), &mut |warm| {
                    signed_distance(a, &pose_a, b, &pose_b, &options, warm);
                });
                counted(&name("penetration"), &mut |warm| {
                    penetration(a, &pose_a, b, &pose_b, &options, warm);
                });
                counted(&name("time of impact"), &mut |_| {
                    time_of_impact(a, &still, b, &moving, &second);
                });
                counted(&name("Hessian"), &mut |warm| {
                    let found = distance(a, &pose_a, b, &pose_b, &options, warm);
                    translation_hessian(a, &pose_a, b, &pose_b, &found);
                });
            }
            counted(&format!("capsule and {of_a}"), &mut |warm| {
                distance_to_capsule(a, &pose_a, &capsule, &pose_b, &options, warm);
                overlap_with_capsule(a, &pose_a, &capsule, &pose_b, &options, warm);
                nearer_to_capsule_than(a, &pose_a, &capsule, &pose_b, 0.3, &options, warm).unwrap();
                within_margin_of_capsule(a, &pose_a, &capsule, &pose_b, 0.3, &options, warm).unwrap();
            });
            counted(&format!("point and {of_a}"), &mut |warm| {
                distance_to_point(a, &pose_a, pose_b.translation(), &options, warm).unwrap();
            });
            counted(&format!("half-space and {of_a}"), &mut |warm| {
                distance_to_half_space(a, &pose_b, &plane, &options, warm);
                overlap_with_half_space(a, &pose_b, &plane, &options, warm);
                nearer_to_half_space_than(a, &pose_b, &plane, 0.3, &options, warm).unwrap();
            });
            counted(&format!("ray and {of_a}"), &mut |_| {
                cast_ray(a, &pose_a, &ray, &options);
            });
            counted(&format!("moving ball and {of_a}"), &mut |_| {
                cast_ball(a, &pose_a, &sweep, &options);
            });
            counted(&format!("pile and {of_a}"), &mut |warm| {
                distance(&pile, &pose_a, a, &pose_b, &options, warm);
                overlap(&pile, &pose_a, a, &pose_b, &options, warm);
                nearer_than(&pile, &pose_a, a, &pose_b, 0.3, &options, warm).unwrap();
                within_margin(&pile, &pose_a, a, &pose_b, 0.3, &options, warm).unwrap();
                level_distance(&pile, &pose_a, a, &pose_b, &options, warm);
                growth_distance(&pile, &pose_a, a, &pose_b, &options, warm);
            });
        }
        counted("capsules", &mut |_| {
            distance_of_capsules(&capsule, &pose_a, &capsule, &pose_b, &options);
            overlap_of_capsules(&capsule, &pose_a, &capsule, &pose_b);
            capsules_nearer_than(&capsule, &pose_a, &capsule, &pose_b, 0.3).unwrap();
            capsules_within_margin(&capsule, &pose_a, &capsule, &pose_b, 0.3, &options).unwrap();
        });
        counted("capsule and half-space", &mut |_| {
            distance_of_capsule_to_half_space(&capsule, &pose_b, &plane, &options);
            overlap_of_capsule_with_half_space(&capsule, &pose_b, &plane);
            capsule_nearer_to_half_space_than(&capsule, &pose_b, &plane, 0.3).unwrap();
        });
        counted("pile and capsule", &mut |warm| {
            distance_to_capsule(&pile, &pose_a, &capsule, &pose_b, &options, warm);
            overlap_with_capsule(&pile, &pose_a, &capsule, &pose_b, &options, warm);
            nearer_to_capsule_than(&pile, &pose_a, &capsule, &pose_b, 0.3, &options, warm).unwrap();
            within_margin_of_capsule(&pile, &pose_a, &capsule, &pose_b, 0.3, &options, warm).unwrap();
        });
        counted("pile and point", &mut |warm| {
            distance_to_point(&pile, &pose_a, pose_b.translation(), &options, warm).unwrap();
        });
        counted("pile and half-space", &mut |warm| {
            distance_to_half_space(&pile, &pose_b, &plane, &options, warm);
            overlap_with_half_space(&pile, &pose_b, &plane, &options, warm);
            nearer_to_half_space_than(&pile, &pose_b, &plane, 0.3, &options, warm).unwrap();
        });
        counted("pile, ray and moving ball", &mut |_| {
            cast_ray(&pile, &pose_a, &ray, &options);
            cast_ball(&pile, &pose_a, &sweep, &options);
        });
        counted("pile and pile", &mut |warm| {
            distance(&pile, &pose_a, &pile, &pose_b, &options, warm);
            overlap(&pile, &pose_a, &pile, &pose_b, &options, warm);
        });
        // Depths of compounds take a search of all directions for each pair of parts.
        if seed % 8 == 0 {
            counted("depths of piles", &mut |warm| {
                signed_distance(&pile, &pose_a, &pile, &pose_b, &options, warm);
                penetration(&pile, &pose_a, &pile, &pose_b, &options, warm);
            });
            counted("time of impact of piles", &mut |_| {
                time_of_impact(&pile, &still, &pile, &moving, &second);
            });
        }
    }
}

/// Nor do batches: in lanes beside each other and beside shapes, pose by pose, of compounds, and
/// those of capsules.
#[test]
fn no_batch_allocates() {
    let (chair, human) = fitted()[2];
    let crate_ = Body::cuboid("crate", Vector3::new(0.3, 0.2, 0.25)).unwrap();
    let (can, sliced) = (cylinder(0.25, 0.3), cut(0.3, 0.4, 0.2));
    let balls = [0.2, 0.3].map(|radius| Body::ball("ball", Vector3::zeros(), radius).unwrap());
    let beside = can.moved(&Default::default(), &Vector3::new(0.7, 0.0, 0.0)).unwrap();
    let pile = Compound::new("pile", vec![crate_.clone(), beside]).unwrap();
    let capsule = Capsule::new(0.1, 0.3).unwrap();
    let options = Options::default();
    let lanes = [
        (chair, human),
        (chair, &crate_),
        (&can, chair),
        (chair, &balls[0]),
        (&balls[0], &balls[1]),
        (&crate_, &can),
        (&crate_, &crate_),
        (&can, &can),
    ];
    let alone = [(&sliced, chair), (&sliced, &sliced), (&sliced, &crate_)];
    for (a, b) in lanes {
        assert!(is_solved_in_lanes(a, b), "{} and {}", a.name(), b.name());
    }
    for (a, b) in alone {
        assert!(!is_solved_in_lanes(a, b), "{} and {}", a.name(), b.name());
    }
    for seed in 0..10 {
        let mut random = Seeded(5000 + seed);
        let pose_a = random.pose(0.0);
        // From overlap to apart.
        let poses: Vec<Pose> = (0..40).map(|k| random.pose(0.05 * f64::from(k))).collect();
        let mut answers = vec![Distance::default(); poses.len()];
        let mut of_capsules = vec![CapsuleDistance::default(); poses.len()];
        let counted = |name: &str, query: &mut dyn FnMut()| {
            let counted = allocation_counter::measure(query);
            assert_eq!(counted.count_total, 0, "{name}, seed {seed}");
        };
        for (a, b) in lanes.into_iter().chain(alone) {
            counted(&format!("{} and {}", a.name(), b.name()), &mut || {
                distance_batch(a, &pose_a, b, &poses, &options, &mut answers).expect("as many places");
            });
        }
        counted("pile and chair", &mut || {
            distance_batch(&pile, &pose_a, chair, &poses, &options, &mut answers).expect("as many places");
        });
        for body in [chair, human, &crate_, &can, &sliced, &balls[0]] {
            counted(&format!("capsule and {}", body.name()), &mut || {
                distance_to_capsule_batch(body, &[pose_a], &capsule, &poses, &options, &mut of_capsules)
                    .expect("as many places");
            });
        }
        counted("capsule and pile", &mut || {
            distance_to_capsule_batch(&pile, &poses, &capsule, &[pose_a], &options, &mut of_capsules)
                .expect("as many places");
        });
    }
}
