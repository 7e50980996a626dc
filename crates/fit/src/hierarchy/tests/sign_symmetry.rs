//! Sign symmetries: the same bounds from smaller matrices.

use super::{bound, quartic, set};
use crate::hierarchy::atoms::Atoms;
use crate::hierarchy::moments::MomentRelaxation;
use crate::hierarchy::sign_symmetry::SignSymmetry;
use crate::hierarchy::solve::{EXACT, solved};
use crate::hierarchy::{PlacedSet, hierarchy_level_distance};
use crate::progress::Watch;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::Body;
use sublevel_core::measure::{Options, Pose, WarmStart, distance};
use sublevel_core::polynomial::{PairPolynomial, Point, Polynomial};
use sublevel_testkit::Seeded;

/// What a relaxation gives.
struct Outcome {
    lower: f64,
    atoms: Vec<Atoms>,
    rows: usize,
    seconds: f64,
}

fn outcome(relaxation: &MomentRelaxation, objective: &PairPolynomial, most: &[f64; 6]) -> Outcome {
    let start = Instant::now();
    let mut unwatched = |_| ControlFlow::Continue(());
    let (solution, rows) = solved(relaxation, 0, &mut Watch::new(&mut unwatched)).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let lower = objective.lower_bound(&relaxation.squares(objective, &solution, &rows), most).unwrap();
    Outcome { lower, atoms: relaxation.atoms(&solution), rows: relaxation.rows(), seconds }
}

/// The squared distance with its symmetry, and without.
fn of_two(sets: [&PlacedSet; 2], level: usize) -> [Outcome; 2] {
    let frames = [sets[0].frame(0).unwrap(), sets[1].frame(1).unwrap()];
    let objective = PairPolynomial::squared_distance(&frames[0], &frames[1]);
    let most = sets.map(PlacedSet::coordinate_bounds);
    let most: [f64; 6] = std::array::from_fn(|k| most[k / 3][k % 3]);
    let with = MomentRelaxation::of_two(&objective, sets, level);
    let without = MomentRelaxation::of_two_with(&objective, sets, level, &SignSymmetry::none());
    [with, without].map(|relaxation| outcome(&relaxation, &objective, &most))
}

/// A level distance of a first set of one polynomial, likewise.
fn of_one(sets: [&PlacedSet; 2], level: usize) -> [Outcome; 2] {
    let [a, b, c] = sets[1].coordinate_bounds();
    let map = sets[1].frame_in(1, sets[0]).unwrap();
    let p = sets[0].set.polynomials[0];
    let objective = [PairPolynomial::substituted(p, &map, Point::First)];
    let with = MomentRelaxation::of_one(&objective, p.degree(), sets[1], level);
    let none = SignSymmetry::none();
    let without = MomentRelaxation::of_one_with(&objective, p.degree(), sets[1], level, &none);
    [with, without].map(|relaxation| outcome(&relaxation, &objective[0], &[a, b, c, 0.0, 0.0, 0.0]))
}

/// A random polynomial that bends inwards, bounded by half a cube of 4, of even powers of y and z,
/// and of x where it is `even`.
fn symmetric(random: &mut Seeded, degree: u8, even: bool) -> Polynomial {
    let mut terms: Vec<_> =
        [[degree, 0, 0], [0, degree, 0], [0, 0, degree]].into_iter().map(|exponents| (exponents, 1.0)).collect();
    for exponents in [[2, 0, 0], [0, 2, 0], [0, 0, 2], [2, 2, 0], [0, 2, 2]] {
        terms.push((exponents, 0.9 * random.signed()));
    }
    if !even {
        terms.extend([[1, 0, 0], [3, 0, 0], [1, 2, 0]].map(|exponents| (exponents, 0.5 * random.signed())));
    }
    Polynomial::new(terms).unwrap()
}

/// Random sets, mirror images of themselves, one moved along an axis of the other and both turned
/// alike: the bounds are those of the whole matrices, proven from smaller ones, and so is what is
/// said about minimisers.
#[test]
fn bounds_are_the_same_with_symmetry_and_without() {
    let (mut several, mut worst) = (0, 0.0_f64);
    for seed in 0..24 {
        let mut random = Seeded(seed);
        let degree = [4, 4, 6][seed as usize % 3];
        let polynomials = [0, 1].map(|k| symmetric(&mut random, degree, (seed + k) % 4 < 2));
        // Every third pair is not turned at all.
        let turn = Vector3::from_fn(|_, _| random.signed()) * f64::from(u8::from(seed / 3 % 3 > 0));
        let turn = Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_scaled_axis(turn));
        let away = turn * Translation3::new(4.0 + random.signed(), 0.0, 0.0);
        let sets = [set(&polynomials[0], 2.0, turn), set(&polynomials[1], 2.0, away)];
        let sets = [&sets[0], &sets[1]];
        for (what, [with, without], level) in
            [("distance", of_two(sets, 0), 0), ("distance", of_two(sets, 1), 1), ("level", of_one(sets, 0), 0)]
        {
            println!(
                "seed {seed}, {what} {level}: {} of {} rows, {} and {}, {:.4} and {:.4} s",
                with.rows, without.rows, with.lower, without.lower, with.seconds, without.seconds
            );
            assert!(3 * with.rows < without.rows * if level == 0 { 2 } else { 1 }, "seed {seed}, {what}");
            // To the width at which brackets are called exact; what the solver leaves is part of both.
            let [of_blocks, of_whole] = [&with, &without].map(|outcome| match what {
                "distance" => outcome.lower.max(0.0).sqrt() / sets.iter().map(|set| set.radius_m()).sum::<f64>(),
                _ => outcome.lower / without.lower.abs().max(1.0),
            });
            worst = worst.max((of_blocks - of_whole).abs());
            assert!((of_blocks - of_whole).abs() < EXACT, "seed {seed}, {what} {level}");
            for (a, b) in with.atoms.iter().zip(&without.atoms) {
                assert_eq!(
                    (a.is_flat, a.points.len(), a.determines_other),
                    (b.is_flat, b.points.len(), b.determines_other),
                    "seed {seed}, {what} {level}"
                );
            }
        }
        let found = bound(sets, 1).unwrap();
        assert!(found.lower_m <= found.upper_m, "seed {seed}: {found:?}");
        let [_, whole] = of_two(sets, 1);
        let lower_m = whole.lower.max(0.0).sqrt();
        // Each bracket contains the distance.
        assert!(lower_m <= found.upper_m, "seed {seed}: {lower_m} {found:?}");
        if found.is_exact {
            several += usize::from(found.minimisers.len() > 1);
            // The mirror image of a nearest pair is one.
            for flip in [Vector3::new(1.0, -1.0, 1.0), Vector3::new(1.0, 1.0, -1.0)] {
                let mirrored = |x: &Vector3<f64>| turn * (turn.inverse() * x).component_mul(&flip);
                for [x, y] in &found.minimisers {
                    let image = [mirrored(x), mirrored(y)];
                    let near = |pair: &[Vector3<f64>; 2]| (0..2).all(|k| (pair[k] - image[k]).norm() < 0.1);
                    assert!(!found.has_all_minimisers || found.minimisers.iter().any(near), "seed {seed}: {found:?}");
                }
            }
        }
        let level = hierarchy_level_distance(sets, 0, &mut |_| ControlFlow::Continue(())).unwrap();
        assert!(level.lower <= level.upper, "seed {seed}: {level:?}");
    }
    println!("{several} with several minimisers, bounds differ by {worst:e} at most");
    assert!(several > 2, "{several}");
}

/// Convex bodies side by side: exact, against the measure; and what the blocks save at each level.
#[test]
fn superellipsoids_side_by_side_are_exact_in_smaller_matrices() {
    let mut cases = vec![(4, 0, [58, 140]), (4, 1, [278, 846]), (6, 0, [152, 450]), (6, 1, [524, 1686])];
    if std::env::var_os("SUBLEVEL_LONG").is_some() {
        cases.extend([(4, 2, [1418, 4940]), (6, 2, [1946, 6872])]);
    }
    for (degree, level, rows) in cases {
        let body = |name: &str, axes: [f64; 3]| Body::superellipsoid(name, Vector3::zeros(), axes.into(), degree);
        let bodies = [body("a", [1.0, 0.8, 0.6]).unwrap(), body("b", [0.5, 0.9, 0.7]).unwrap()];
        let there = Pose::identity().with_translation(Vector3::new(3.0, 0.0, 0.0));
        let here = Pose::identity();
        let truth = distance(&bodies[0], &here, &bodies[1], &there, &Options::default(), &mut WarmStart::default());
        let sets = [
            PlacedSet::of_body(&bodies[0], Isometry3::identity()),
            PlacedSet::of_body(&bodies[1], Isometry3::translation(3.0, 0.0, 0.0)),
        ];
        let sets = [&sets[0], &sets[1]];
        let [with, without] = of_two(sets, level);
        println!(
            "degree {degree}, level {level}: {} and {} rows, {:.4} and {:.4} s, {} and {}",
            with.rows, without.rows, with.seconds, without.seconds, with.lower, without.lower
        );
        assert_eq!([with.rows, without.rows], rows, "degree {degree}, level {level}");
        let found = bound(sets, level).unwrap();
        assert!(found.lower_m <= truth.upper && found.upper_m >= truth.lower, "{found:?} {truth:?}");
        assert!(found.is_exact && !found.minimisers.is_empty(), "degree {degree}, level {level}: {found:?}");
        // Tips of degree 6 are so flat that points beside them are as near to the width of a bracket.
        let size = sets.iter().map(|set| set.radius_m()).sum::<f64>();
        for [x, y] in &found.minimisers {
            assert!((x - y).norm() <= truth.upper + EXACT * size, "degree {degree}, level {level}: {found:?}");
        }
    }
}

/// Of sets that no change of signs leaves as they are, the program is what it was, to the last bit.
#[test]
fn without_symmetry_nothing_changes() {
    for seed in 0..6 {
        let mut random = Seeded(seed);
        let polynomials = [quartic(&mut random), quartic(&mut random)];
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| random.signed()));
        let pose = Isometry3::from_parts(Translation3::new(4.0, 1.0, 0.5), turn);
        let sets = [set(&polynomials[0], 2.0, Isometry3::identity()), set(&polynomials[1], 2.0, pose)];
        let sets = [&sets[0], &sets[1]];
        for [with, without] in [of_two(sets, 0), of_one(sets, 0)] {
            assert_eq!((with.rows, with.lower), (without.rows, without.lower), "seed {seed}");
        }
    }
}
