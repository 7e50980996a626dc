//! Bodies that slabs cut by Newton's method with active sets, against the general search, which
//! shares nothing with it but the bodies' polynomials.

use super::{assert_normals_of_active, random_pose, zoo};
use crate::body::{Body, Constraint, Normalization};
use crate::measure::solver::stages::{Stage, except, only};
use crate::measure::*;
use crate::polynomial::{Exponents, HessianGram, HessianMonomial, Polynomial};
use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3};
use std::sync::OnceLock;
use sublevel_testkit::Seeded;

/// The constraint `(1 - ε) (a·z - b)² + ε |z|² <= 1`: a slab that bulges by so little that its
/// Hessian is just positive definite.
pub(in crate::measure) fn slab(a: &Vector3<f64>, b: f64) -> Constraint {
    let (share, round) = (1.0 - 1e-6, 1e-6);
    let hessian = (a * a.transpose() * share + Matrix3::identity() * round) * 2.0;
    let exponents = |v: Vector3<u8>| -> Exponents { v.into() };
    let unit = |i: usize| Vector3::<u8>::ith(i, 1);
    let mut terms = vec![(exponents(Vector3::zeros()), share * b * b)];
    for i in 0..3 {
        terms.push((exponents(unit(i)), -2.0 * share * b * a[i]));
        for j in i..3 {
            let part = if i == j { 0.5 } else { 1.0 };
            terms.push((exponents(unit(i) + unit(j)), part * hessian[(i, j)]));
        }
    }
    let polynomial = Polynomial::new(terms).unwrap();
    let basis = (0..3).map(|i| HessianMonomial { direction: i, exponents: [0, 0, 0] }).collect();
    let gram = HessianGram::nearest(&polynomial, basis, DMatrix::from_fn(3, 3, |i, j| hessian[(i, j)])).unwrap();
    Constraint { polynomial, gram }
}

/// A body of degree 4 to 8 cut by up to six slabs across random directions, turned within its
/// frame: one of 200, as making bodies takes longer than measuring them.
pub(in crate::measure) fn cut(random: &mut Seeded) -> Body {
    static BODIES: [OnceLock<Body>; 200] = [const { OnceLock::new() }; 200];
    let index = random.next() % 200;
    BODIES[index as usize].get_or_init(|| new_cut(&mut Seeded(61_000 + index))).clone()
}

fn new_cut(random: &mut Seeded) -> Body {
    // Of all sizes the constraint of a degree is the same.
    static ROUND: [OnceLock<Body>; 3] = [const { OnceLock::new() }; 3];
    let of_degree = random.next() % 3;
    let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
    let round = ROUND[of_degree as usize].get_or_init(|| {
        Body::superellipsoid("round", Vector3::zeros(), Vector3::repeat(1.0), 4 + 2 * of_degree as u8).unwrap()
    });
    let mut constraints = round.constraints().to_vec();
    for _ in 0..1 + random.next() % 6 {
        // Half widths of 0.5 to 0.9 of the body's, about a plane that is off its middle.
        let half_width = 0.7 + 0.2 * random.signed();
        constraints.push(slab(&(random.unit() / half_width), 0.2 * random.signed()));
    }
    let turn = UnitQuaternion::from_scaled_axis(random.unit() * -2.0).to_rotation_matrix();
    let linear = Matrix3::from_diagonal(&half.map(|size| 1.0 / size)) * turn.matrix();
    Body::new("cut", Normalization { center: random.unit() * 0.7, linear }, constraints).unwrap()
}

/// Ten thousand sizes apart the roundings of positions are a part of what is asked for.
#[test]
fn cut_bodies_far_apart_converge() {
    let bodies: Vec<Body> = (0..25).map(|seed| new_cut(&mut Seeded(75_000 + seed))).collect();
    let small = Body::superellipsoid("small", Vector3::zeros(), Vector3::repeat(0.02), 6).unwrap();
    for seed in 0..100 {
        let mut random = Seeded(75_100 + seed);
        let large = &bodies[(seed % 25) as usize];
        let far = 100.0 + 300.0 * random.positive();
        let pose_a = random_pose(&mut random, 1.0);
        let turned = random_pose(&mut random, 0.0);
        let pose_b = turned.with_translation(pose_a.translation() + random.unit() * far);
        for (of_a, of_b) in [((large, &pose_a), (&small, &pose_b)), ((&small, &pose_b), (large, &pose_a))] {
            let mut warm = WarmStart::default();
            for start in ["cold", "warm"] {
                let found = distance(of_a.0, of_a.1, of_b.0, of_b.1, &Options::default(), &mut warm);
                let label = format!("seed {seed}, {start}: {found:?}");
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.upper - found.lower <= 1e-9 * small.circumscribed().radius, "{label}");
                let truth = except(&[Stage::Edges], || {
                    distance(of_a.0, of_a.1, of_b.0, of_b.1, &Options::default(), &mut WarmStart::default())
                });
                assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}: {truth:?}");
                let (n, m) = (found.normal.expect("apart"), truth.normal.expect("apart"));
                assert!((n - m).norm() < 1e-9, "{label}: {truth:?}");
                assert_normals_of_active(1e-6, of_a, (&found.witness_a, &-n), &found.active_a, &label);
                assert_normals_of_active(1e-6, of_b, (&found.witness_b, &n), &found.active_b, &label);
            }
        }
    }
}

#[test]
fn cut_bodies_agree_with_the_general_search() {
    let smooth: Vec<Body> = (0..6).flat_map(|seed| zoo(&mut Seeded(seed))).filter(Body::is_smooth).collect();
    let gaps = [-0.1, -1e-6, 1e-9, 1e-6, 1e-3, 1e-2, 0.1, 1.0];
    let mut of_active = [0; 4];
    let mut by_gap = [(0, 0); 8];
    for seed in 0..600 {
        let mut random = Seeded(72_000 + seed);
        let a = cut(&mut random);
        let b =
            if seed / 8 % 2 == 0 { smooth[random.next() as usize % smooth.len()].clone() } else { cut(&mut random) };
        let size = a.circumscribed().radius.min(b.circumscribed().radius);
        let gap = gaps[(seed % 8) as usize] * size;
        let pose_a = random_pose(&mut random, 1.0);
        let far = 2.0 * (a.circumscribed().radius + b.circumscribed().radius) + b.circumscribed().center.norm();
        let turned = random_pose(&mut random, 0.0);
        let start = pose_a.transform_point(&a.circumscribed().center) + random.unit() * far;
        let mut pose_b = turned.with_translation(start - turned.transform_direction(&b.circumscribed().center));
        for _ in 0..6 {
            let found = except(&[Stage::Edges], || {
                distance(&a, &pose_a, &b, &pose_b, &Options::default(), &mut WarmStart::default())
            });
            let Some(n) = found.normal else { break };
            pose_b = pose_b.with_translation(pose_b.translation() + n * (found.value() - gap));
        }
        for swapped in [false, true] {
            let (mut first, mut second) = ((&a, pose_a), (&b, pose_b));
            if swapped {
                (first, second) = (second, first);
            }
            let (mut warm, mut alone) = (WarmStart::default(), WarmStart::default());
            for step in 0..4 {
                let ask =
                    |warm: &mut WarmStart| distance(first.0, &first.1, second.0, &second.1, &Options::default(), warm);
                let truth = except(&[Stage::Edges], || ask(&mut WarmStart::default()));
                let all = ask(&mut warm);
                let found = only(&[Stage::Edges], || ask(&mut alone));
                let label = format!("seed {seed} step {step} swapped {swapped}: {found:?} against {truth:?}");
                assert!(all.lower <= truth.upper && truth.lower <= all.upper, "{label}: {all:?}");
                assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}");
                assert_eq!(all.status, truth.status, "{label}: {all:?}");
                if truth.lower > 1e-8 * size {
                    let done = found.status == Status::Converged;
                    let of_gap = &mut by_gap[(seed % 8) as usize];
                    *of_gap = (of_gap.0 + usize::from(done), of_gap.1 + 1);
                    if done {
                        let (n, m) = (found.normal.expect("apart"), truth.normal.expect("apart"));
                        if truth.lower > 1e-4 * size {
                            assert!((n - m).norm() < 1e-5, "{label}");
                        }
                        let along = (found.witness_a - found.witness_b).norm();
                        assert!((along - found.upper).abs() < 1e-9 * (size + found.upper), "{label}");
                        assert_normals_of_active(
                            1e-6,
                            (first.0, &first.1),
                            (&found.witness_a, &-n),
                            &found.active_a,
                            &label,
                        );
                        assert_normals_of_active(
                            1e-6,
                            (second.0, &second.1),
                            (&found.witness_b, &n),
                            &found.active_b,
                            &label,
                        );
                        let of_cut = if swapped { &found.active_b } else { &found.active_a };
                        of_active[of_cut.iter().filter(|(_, multiplier)| *multiplier > 1e-9).count()] += 1;
                    }
                }
                // A little on.
                let moved = second.1.translation() + random.unit() * (0.003 * size);
                let turn = UnitQuaternion::from_scaled_axis(random.unit() * 0.003) * second.1.rotation();
                second.1 = Pose::from_quaternion(moved, turn.coords.into()).unwrap();
            }
        }
    }
    let percent = |(done, cases): (usize, usize)| 100.0 * done as f64 / cases as f64;
    let gaps_of = |from: usize| {
        let classes = by_gap.iter().skip(from);
        percent(classes.fold((0, 0), |(done, cases), (more, all)| (done + more, cases + all)))
    };
    println!("solved alone by gap: {by_gap:?}; of active constraints {of_active:?}");
    // A single side, edges and corners.
    assert!(of_active[1..].iter().all(|&count| count > 100), "{of_active:?}");
    // From contact up to gaps of 1e-9 doubles do not show the normal: the general search goes on.
    assert!(gaps_of(4) > 91.0 && gaps_of(3) > 83.0, "{} {}", gaps_of(4), gaps_of(3));
}
