use super::*;
use crate::tests::unwatched;
use crate::{Coordinates, FitError, Objective, SosMethod, SosOptions, certificate, fit_sos};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;
use sublevel_core::body::{BasicSet, Body, Containment, Normalization, Obstacle, SosBody};
use sublevel_core::polynomial::{ContainmentProof, NotContaining, Polynomial};
use sublevel_testkit::Seeded;

mod printed;

/// Three ellipsoids apart from each other, as in the paper's figure; in units of `size` metres
/// about `center`.
fn three_ellipsoids(size: f64, center: Vector3<f64>) -> Vec<Body> {
    let place = [
        ([0.9, 0.4, 0.3], [0.0, 0.0, 0.0], [0.3, 0.2, 0.5]),
        ([0.3, 0.7, 0.4], [1.6, 0.5, 0.2], [1.0, -0.4, 0.1]),
        ([0.5, 0.3, 0.6], [0.4, 1.5, -0.6], [-0.6, 0.8, 0.3]),
    ];
    place
        .into_iter()
        .map(|(axes, shift, [a, b, c])| {
            let body = Body::ellipsoid("e", Vector3::zeros(), Vector3::from(axes) * size).unwrap();
            body.moved(&UnitQuaternion::from_euler_angles(a, b, c), &(Vector3::from(shift) * size + center)).unwrap()
        })
        .collect()
}

fn obstacles(bodies: &[Body]) -> Vec<Obstacle> {
    bodies.iter().cloned().map(Into::into).collect()
}

fn around(bodies: &[Body], degree: usize) -> Enclosure {
    let options = EncloseOptions::new(degree);
    let enclosure =
        enclose_obstacles("all", &obstacles(bodies).iter().collect::<Vec<_>>(), &options, &mut unwatched).unwrap();
    for body in bodies {
        // A hundred times as many points as the solver saw.
        for i in 0..60_000 {
            let u = sublevel_testkit::Seeded(i);
            let direction = direction(u);
            let value = enclosure.body.value(&body.boundary_along(&direction));
            assert!(value <= 1.0, "degree {degree}: {value}");
        }
    }
    enclosure
}

fn direction(mut random: Seeded) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.signed()).normalize()
}

#[test]
fn higher_degrees_are_smaller_around_three_ellipsoids_and_above_the_hull() {
    let bodies = three_ellipsoids(1.0, Vector3::zeros());
    let points: Vec<_> = bodies.iter().flat_map(|body| body.boundary().iter().copied()).collect();
    let hull = crate::hull::convex_hull(&points).unwrap().volume;
    let mut last = f64::INFINITY;
    for degree in [2, 4, 6, 8] {
        let all = around(&bodies, degree);
        let volume = all.body.volume().volume_m3;
        println!(
            "degree {degree}: volume {volume:.5}, {:.4} hulls, objective {:.6} within {:.1e}, gap {:.4} m, {} steps, {:.2} s",
            volume / hull,
            all.objective_value,
            all.optimality_gap,
            all.gap.most_m,
            all.iterations,
            all.seconds
        );
        assert!(volume < last && volume > hull);
        assert!(all.optimality_gap.abs() < if degree < 8 { 2e-5 } else { 1e-3 });
        last = volume;
    }
}

/// The smallest ellipsoid around two equal balls, by brute force over its half-axes: `(x/a)² +
/// (r/b)² <= 1` on the balls.
#[test]
fn two_balls_in_an_ellipsoid() {
    let (radius, offset) = (0.7, 1.3);
    let bodies: Vec<Body> =
        [-1.0, 1.0].map(|s| Body::ball("b", Vector3::new(s * offset, 0.0, 0.0), radius).unwrap()).into();
    let volume = around(&bodies, 2).body.volume().volume_m3;
    let width = |a: f64| {
        // The least b that leaves (offset + r cos t)²/a² + (r sin t)²/b² <= 1 for all t.
        let squares = (1..4000).map(|i| {
            let t = f64::from(i) * std::f64::consts::PI / 4000.0;
            (radius * t.sin()).powi(2) / (1.0 - ((offset + radius * t.cos()) / a).powi(2))
        });
        squares.fold(0.0, f64::max).sqrt()
    };
    let axes = (1..4000).map(|i| (offset + radius) * (1.0 + f64::from(i) * 5e-4));
    let exact = axes.map(|a| a * width(a).powi(2)).fold(f64::INFINITY, f64::min) * 4.0 / 3.0 * std::f64::consts::PI;
    println!("{volume} where {exact} is exact");
    assert!((volume / exact - 1.0).abs() < 2e-5, "{volume} where {exact} is exact");
}

#[test]
fn a_single_body_of_the_degree_comes_back() {
    for degree in [2_u8, 4] {
        let body = Body::superellipsoid("s", Vector3::new(5.0, 0.0, 1.0), Vector3::new(0.2, 0.5, 0.3), degree).unwrap();
        let all = around(std::slice::from_ref(&body), usize::from(degree));
        let ratio = all.body.volume().volume_m3 / body.volume().volume_m3;
        println!("degree {degree}: {ratio}");
        // No polynomial has a larger log det on the ball; others do on the superellipsoid.
        assert!((1.0..1.03).contains(&ratio) && (degree > 2 || ratio < 1.00002), "degree {degree}: {ratio}");
    }
}

#[test]
fn enclosures_follow_units_and_places() {
    let reference = around(&three_ellipsoids(1.0, Vector3::zeros()), 4);
    for (size, far) in [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e6), (1e-3, 10.0)] {
        let bodies = three_ellipsoids(size, Vector3::new(far, -far, 0.5 * far));
        let all = around(&bodies, 4);
        let ratio = all.body.volume().volume_m3 / reference.body.volume().volume_m3 / size.powi(3);
        println!("size {size:e} m at {far:e} m: {:.1e}", ratio - 1.0);
        assert!((ratio - 1.0).abs() < 1e-4, "size {size:e} m at {far:e} m: {ratio}");
    }
}

/// A set of one polynomial of x itself, with points of it by rejection.
fn sampled<'a>(polynomial: &'a Polynomial, normalization: &'a Normalization, reach: f64) -> Region<'a> {
    let mut random = Seeded(7);
    let points = (0..60_000).map(|_| Vector3::from_fn(|_, _| reach * random.signed()));
    let inside = points.filter(|x| polynomial.evaluate(&(normalization.linear * x)).value < 1.0).take(3000).collect();
    Region { set: BasicSet { normalization, polynomials: vec![polynomial] }, inside }
}

/// `1 + ((|x|² + s)² - 4 Σ w_i x_i² - level) / scale`.
fn quartic(s: f64, w: [f64; 3], level: f64, scale: f64) -> Polynomial {
    let axis = |i: usize, n: u8| std::array::from_fn(|k| if k == i { n } else { 0 });
    let mut terms = vec![([0, 0, 0], 1.0 + (s * s - level) / scale)];
    for i in 0..3 {
        terms.push((axis(i, 4), 1.0 / scale));
        terms.push((axis(i, 2), (2.0 * s - 4.0 * w[i]) / scale));
        let both = std::array::from_fn(|k| if k == i { 0 } else { 2 });
        terms.push((both, 2.0 / scale));
    }
    Polynomial::new(terms).unwrap()
}

#[test]
fn sets_that_are_not_convex_are_convexified() {
    let identity = Normalization { center: Vector3::zeros(), linear: nalgebra::Matrix3::identity() };
    // Cassini's peanut: products of the distances to (±1, 0, 0) of at most 1.05²; and a torus of
    // radii 1 and 0.4.
    let peanut = quartic(1.0, [1.0, 0.0, 0.0], 1.05_f64.powi(4), 1.05_f64.powi(4));
    let torus = quartic(1.0 - 0.16, [1.0, 1.0, 0.0], 0.0, 1.0);
    for (name, set, reach) in [("peanut", peanut, 1.5), ("torus", torus, 1.5)] {
        assert!(certificate(&set).is_err(), "{name} is meant not to be convex");
        let region = sampled(&set, &identity, reach);
        let hull = crate::hull::convex_hull(&region.inside).unwrap().volume;
        let mut last = f64::INFINITY;
        for degree in [2, 4, 6] {
            let options = EncloseOptions::new(degree);
            let all = enclose(name, std::slice::from_ref(&region), &options, &mut unwatched).unwrap();
            let volume = all.body.volume().volume_m3;
            println!(
                "{name}, degree {degree}: {:.4} hulls of samples, gap {:.3} m, {:.2} s",
                volume / hull,
                all.gap.most_m,
                all.seconds
            );
            let mut random = Seeded(11);
            for _ in 0..100_000 {
                let x = Vector3::from_fn(|_, _| reach * random.signed());
                assert!(set.evaluate(&x).value > 1.0 || all.body.value(&x) <= 1.0, "{name}, degree {degree}: {x}");
            }
            assert!(volume > hull && volume < last, "{name}, degree {degree}");
            last = volume;
        }
    }
}

#[test]
fn proofs_of_what_is_not_so_fail() {
    let bodies = three_ellipsoids(0.1, Vector3::new(1.0, 2.0, 3.0));
    let all = around(&bodies, 4);
    let (outer, inner) = (BasicSet::from(&all.body), BasicSet::from(&bodies[0]));
    let good = &all.containments[0];
    assert_eq!(good.prove(&outer, &inner), Ok(()));
    // The set of another proof, a set that reaches out, a body that is smaller, matrices that were
    // changed, no frame.
    assert!(all.containments[1].prove(&outer, &inner).is_err());
    let touching =
        bodies[0].boundary().iter().map(|x| (all.body.value(x), x)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    let out = (touching.1 - bodies[0].interior_point()) * 0.05;
    let moved = bodies[0].moved(&UnitQuaternion::identity(), &out).unwrap();
    assert!(all.body.value(&(touching.1 + out)) > 1.0);
    assert!(good.prove(&outer, &BasicSet::from(&moved)).is_err());
    let smaller = outer.polynomials[0].with_constant_shifted(1.0 - touching.0 + 1e-3);
    assert!(good.prove(&BasicSet { polynomials: vec![&smaller], ..outer.clone() }, &inner).is_err());
    for entry in [(0, 0), (3, 3), (7, 2)] {
        let mut rest = good.proofs[0].rest().clone();
        rest[entry] -= 1e-2;
        rest[(entry.1, entry.0)] = rest[entry];
        let proof = ContainmentProof::new(good.proofs[0].multipliers().to_vec(), rest).unwrap();
        assert!(Containment { proofs: vec![proof], ..good.clone() }.prove(&outer, &inner).is_err(), "{entry:?}");
    }
    let mut multipliers = good.proofs[0].multipliers().to_vec();
    multipliers[0][(1, 1)] = -1e-9;
    let proof = ContainmentProof::new(multipliers, good.proofs[0].rest().clone()).unwrap();
    let failure = Containment { proofs: vec![proof], ..good.clone() }.prove(&outer, &inner);
    assert!(matches!(failure, Err(NotContaining::Multiplier { index: 0, .. })), "{failure:?}");
    let mut flat = good.clone();
    flat.frame.axes.column_mut(2).fill(0.0);
    assert_eq!(flat.prove(&outer, &inner), Err(NotContaining::Frame));
    let none = Containment { proofs: vec![], ..good.clone() };
    assert!(matches!(none.prove(&outer, &inner), Err(NotContaining::Malformed(_))));
}

#[test]
fn files_keep_the_proofs() {
    let bodies = three_ellipsoids(1.0, Vector3::zeros());
    let text = around(&bodies, 4).body.to_json();
    let again = Body::from_json(&text).unwrap();
    assert_eq!(again.to_json(), text);
    for (set, body) in again.sets().iter().zip(&bodies) {
        assert_eq!(set.id, *body.id());
        set.containment.prove(&BasicSet::from(&again), &BasicSet::from(body)).unwrap();
    }
    for (what, with, field) in [
        ("\"origin_m\":[", "\"origin_m\":[7,", "not a body file"),
        ("\"rest\":[[", "\"rest\":[[1,", "contained_sets[0].proofs"),
    ] {
        let error = Body::from_json(&text.replacen(what, with, 1)).unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
    // What is moved is not known to contain what stays.
    assert!(again.moved(&UnitQuaternion::identity(), &Vector3::x()).unwrap().sets().is_empty());
}

#[test]
fn given_bodies_are_proven_inside_down_to_small_clearances() {
    let turn = UnitQuaternion::from_euler_angles(0.3, 0.5, -0.2);
    let shift = Vector3::new(30.0, -4.0, 2.0);
    let place = |body: Body| body.moved(&turn, &shift).unwrap();
    let half = Vector3::new(0.3, 0.2, 0.5);
    let outers = [
        ("ball", place(Body::ball("o", Vector3::zeros(), 1.0).unwrap())),
        ("quartic", place(Body::superellipsoid("o", Vector3::zeros(), Vector3::repeat(1.0), 4).unwrap())),
        ("box", place(Body::cuboid("o", Vector3::repeat(1.0)).unwrap())),
    ];
    for (name, outer) in &outers {
        for room in [0.3, 1e-2, 1e-4] {
            // A ball that all but touches from inside.
            let inner = place(Body::ball("i", Vector3::new(0.0, 0.4, 0.0), 0.6 - room).unwrap());
            containment(outer, &(&inner).into(), 2).unwrap_or_else(|error| panic!("{name}, {room}: {error}"));
            let out = place(Body::ball("i", Vector3::new(0.0, 0.4, 0.0), 0.6 + room).unwrap());
            let error = containment(outer, &(&out).into(), 2).unwrap_err();
            assert!(matches!(error, NoContainment::Outside { .. } | NoContainment::None { .. }), "{name}: {error}");
        }
        // Several constraints inside.
        let boxes = place(Body::cuboid("i", half).unwrap());
        containment(outer, &(&boxes).into(), 2).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

#[test]
fn neighbours_are_grouped_and_others_left_alone() {
    let cube = |x: f64, y: f64| {
        let body = Body::cuboid("cube", Vector3::repeat(0.1)).unwrap();
        body.moved(&UnitQuaternion::from_matrix(Rotation3::identity().matrix()), &Vector3::new(x, y, 0.0)).unwrap()
    };
    let bodies = [cube(0.0, 0.0), cube(3.0, 0.0), cube(0.21, 0.0), cube(0.0, 5.0), cube(3.0, 0.21), cube(0.21, 0.21)];
    let volumes = |groups: &[Group]| groups.iter().map(|group| group.cover.body().volume().volume_m3).sum::<f64>();
    let members = |groups: &[Group]| groups.iter().map(|group| group.members.clone()).collect::<Vec<_>>();
    let total: f64 = bodies.iter().map(|body| body.volume().volume_m3).sum();
    for (growth, expected) in [
        (1e-3, vec![vec![0], vec![1], vec![2], vec![3], vec![4], vec![5]]),
        // Those in an L, and those in a row, of which the next best are metres away.
        (1.5, vec![vec![0, 2, 5], vec![1, 4], vec![3]]),
    ] {
        let groups = group(&obstacles(&bodies), growth, &EncloseOptions::new(4), &mut unwatched).unwrap();
        println!("growth {growth}: {:?}, {:+.3}", members(&groups), volumes(&groups) / total - 1.0);
        assert_eq!(members(&groups), expected, "growth {growth}");
        assert!(volumes(&groups) <= (1.0 + growth) * total);
        for Group { members, cover } in &groups {
            assert_eq!(cover.enclosure().map_or(1, |all| all.body.sets().len()), members.len());
        }
    }
    let none = group(&obstacles(&bodies), 0.0, &EncloseOptions::new(4), &mut unwatched);
    assert_eq!(none.unwrap_err(), EncloseError::Growth(0.0));
}

/// A set around points on an L, in the plane x = `across`, that follows its bend.
fn bent(across: f64) -> SosBody {
    let mut random = Seeded(5);
    let mut points = Vec::new();
    for _ in 0..400 {
        let [a, b, c] = [(); 3].map(|()| 0.1 * random.signed());
        let along = random.signed().abs();
        points.extend([Vector3::new(across + a, b, along), Vector3::new(across + a, along, c)]);
    }
    let method = SosMethod::Relaxed { c: 100.0, objective: Objective::LogDetP };
    let options = SosOptions { degree: 4, method, coordinates: Coordinates::Unit, solver: None, input: String::new() };
    fit_sos("bent", &points, &[], &options, &mut unwatched).unwrap().body
}

#[test]
fn sos_bodies_are_convexified_alone_and_among_bodies() {
    let set = bent(0.0);
    let chords = set.chords(5000);
    assert!(chords.iter().all(|(from, to)| set.value(&((from + to) * 0.5)) <= 1.0));
    let ends: Vec<_> = chords.iter().flat_map(|(from, to)| [*from, *to]).collect();
    let bridges = (0..ends.len()).map(|i| (ends[i] + ends[(7919 * i) % ends.len()]) * 0.5);
    assert!(bridges.filter(|x| set.value(x) > 1.0).count() > 100, "the set is meant not to be convex");
    let obstacle = Obstacle::from(set.clone());
    let all = enclose_obstacles("hull", &[&obstacle], &EncloseOptions::new(4), &mut unwatched).unwrap();
    let hull = crate::hull::convex_hull(&ends).unwrap().volume;
    let volume = all.body.volume().volume_m3;
    println!("volume {:.3} hulls, {:.3} sets, {:.2} s", volume / hull, volume / set.volume().volume_m3, all.seconds);
    assert!(volume > hull && volume < 1.8 * hull);
    for (from, to) in set.chords(20_000) {
        assert!(
            all.body.value(&(from + (to - from) * 1e-6)) <= 1.0 && all.body.value(&(to + (from - to) * 1e-6)) <= 1.0
        );
    }
    // From the stored numbers alone.
    let again = Body::from_json(&all.body.to_json()).unwrap();
    let file = Obstacle::from_json(&set.to_json()).unwrap();
    let record = &again.sets()[0];
    assert_eq!((&record.id, &*record.name), (file.id(), "bent"));
    record.containment.prove(&BasicSet::from(&again), &BasicSet::from(&file)).unwrap();
    assert!(record.containment.prove(&BasicSet::from(&again), &BasicSet::from(&bent(0.01))).is_err());

    // A ball in the bend costs nothing, one far off stays alone.
    let ball = |y: f64| Obstacle::from(Body::ball("ball", Vector3::new(0.0, y, 0.3), 0.1).unwrap());
    let groups = group(&[obstacle, ball(0.3), ball(9.0)], 0.05, &EncloseOptions::new(4), &mut unwatched).unwrap();
    assert_eq!(groups.iter().map(|group| &group.members[..]).collect::<Vec<_>>(), [&[0, 1][..], &[2]]);
    let groups = group(&[bent(0.0).into(), bent(9.0).into()], 0.05, &EncloseOptions::new(4), &mut unwatched).unwrap();
    assert_eq!(groups.len(), 2);
    assert!(groups.iter().all(|group| group.cover.enclosure().is_some()), "what is not convex never stays as it is");
}

#[test]
fn bad_input_is_reported_before_any_work() {
    let bodies = three_ellipsoids(1.0, Vector3::zeros());
    let regions: Vec<Region> = bodies.iter().map(Into::into).collect();
    let ask = |name: &str, regions: &[Region], degree, multiplier_degree| {
        let options = EncloseOptions { degree, multiplier_degree };
        enclose(name, regions, &options, &mut |_| panic!("no work is to be done")).unwrap_err()
    };
    assert_eq!(ask("a", &regions, 3, 2), FitError::Degree(3).into());
    assert_eq!(ask("a", &regions, 4, 1), EncloseError::MultiplierDegree(1));
    assert_eq!(ask("a", &regions, 4, 6), EncloseError::MultiplierDegree(6));
    assert_eq!(ask("a", &[], 4, 2), EncloseError::Count(0));
    assert_eq!(ask("a", &vec![regions[0].clone(); MAX_SETS + 1], 4, 2), EncloseError::Count(MAX_SETS + 1));
    assert!(matches!(ask("", &regions, 4, 2), EncloseError::Fit(FitError::Name(_))));
    let broken = |change: &dyn Fn(&mut Region)| {
        let mut regions = regions.clone();
        change(&mut regions[1]);
        ask("a", &regions, 4, 2)
    };
    assert_eq!(broken(&|region| region.set.polynomials.clear()), EncloseError::NoPolynomial(1));
    assert!(matches!(broken(&|region| region.inside.truncate(3)), EncloseError::Points { index: 1, .. }));
    assert!(matches!(broken(&|region| region.inside[5].x = f64::NAN), EncloseError::Points { index: 1, .. }));
    // Points around the set instead of in it.
    let around = |region: &mut Region| {
        region
            .inside
            .iter_mut()
            .for_each(|x| *x = *bodies[1].interior_point() + (*x - bodies[1].interior_point()) * 3.0);
    };
    assert_eq!(broken(&around), EncloseError::Start(1));
    let cancelled = enclose("a", &regions, &EncloseOptions::new(4), &mut |_| ControlFlow::Break(()));
    assert_eq!(cancelled.unwrap_err(), FitError::Cancelled.into());
}
