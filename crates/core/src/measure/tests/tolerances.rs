//! Rounding bounds against exact arithmetic: no error met exceeds them, and none of them is much
//! larger than the errors met, so that brackets of far poses stay narrow.

use super::{at, random_pose};
use crate::body::Body;
use crate::measure::bounds::culling::{CULLING_SLACK, across};
use crate::measure::bounds::duality_bounds::DUALITY_ROUNDING;
use crate::measure::frames::pose::{RELATIVE_ERROR, RELATIVE_QUATERNION_ERROR, ROTATION_ERROR};
use crate::measure::solver::tangent_newton::{Relative, TAYLOR_ROUNDING};
use crate::measure::*;
use crate::polynomial::{Scalar, gamma};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use sublevel_testkit::Seeded;
use sublevel_testkit::reference::big::{Big, big, double, norm};

/// The rotation of a quaternion x y z w of any length, exactly up to 200 bits.
fn exact_rotation(q: &UnitQuaternion<f64>) -> [[Big; 3]; 3] {
    let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(big);
    let square = &x * &x + &y * &y + &z * &z + &w * &w;
    let two = big(2.0);
    let over = |value: Big| &two * value / &square;
    let one = big(1.0);
    [
        [&one - over(&y * &y + &z * &z), over(&x * &y - &w * &z), over(&x * &z + &w * &y)],
        [over(&x * &y + &w * &z), &one - over(&x * &x + &z * &z), over(&y * &z - &w * &x)],
        [over(&x * &z - &w * &y), over(&y * &z + &w * &x), &one - over(&x * &x + &y * &y)],
    ]
}

/// `Aᵀ B`.
fn transposed_product(a: &[[Big; 3]; 3], b: &[[Big; 3]; 3]) -> [[Big; 3]; 3] {
    let entry = |i: usize, j: usize| &a[0][i] * &b[0][j] + &a[1][i] * &b[1][j] + &a[2][i] * &b[2][j];
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// Operator norm of the deviation of a computed matrix from an exact one.
fn deviation(computed: &Matrix3<f64>, exact: &[[Big; 3]; 3]) -> f64 {
    Matrix3::from_fn(|i, j| double(&(big(computed[(i, j)]) - &exact[i][j]))).svd(false, false).singular_values.max()
}

/// A pose whose quaternion is as far from length 1 as poses accept without normalising.
fn longest_quaternion(random: &mut Seeded) -> Pose {
    let q = random_pose(random, 1.0).rotation().coords;
    let stretched = q * (1.0 + 1.8 * f64::EPSILON * random.signed());
    Pose::from_quaternion(Vector3::zeros(), stretched.into()).unwrap()
}

#[test]
fn rotation_matrices_are_off_by_less_than_the_bound() {
    let mut most: f64 = 0.0;
    for seed in 0..2000 {
        let pose = longest_quaternion(&mut Seeded(seed));
        let computed = pose.rotation().to_rotation_matrix().into_inner();
        most = most.max(deviation(&computed, &exact_rotation(pose.rotation())));
    }
    assert!(most <= ROTATION_ERROR && most > ROTATION_ERROR / 16.0, "{most:e} of {ROTATION_ERROR:e}");
}

#[test]
fn relative_rotations_are_off_by_less_than_the_bounds() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let (mut of_matrices, mut of_quaternions): (f64, f64) = (0.0, 0.0);
    for seed in 0..2000 {
        let mut random = Seeded(seed);
        let (a, b) = (longest_quaternion(&mut random), longest_quaternion(&mut random));
        let exact = transposed_product(&exact_rotation(a.rotation()), &exact_rotation(b.rotation()));
        let [turn_a, turn_b] = [&a, &b].map(|pose| pose.rotation().to_rotation_matrix().into_inner());
        of_matrices = of_matrices.max(deviation(&turn_a.tr_mul(&turn_b), &exact));
        let rows = Relative::<f64>::new(Scalar, &ball, &a, &ball, &b).rotation;
        of_quaternions = of_quaternions.max(deviation(&Matrix3::from_fn(|i, j| rows[i][j]), &exact));
    }
    assert!(of_matrices <= RELATIVE_ERROR && of_matrices > RELATIVE_ERROR / 32.0, "{of_matrices:e}");
    let bound = RELATIVE_QUATERNION_ERROR;
    assert!(of_quaternions <= bound && of_quaternions > bound / 64.0, "{of_quaternions:e} of {bound:e}");
}

/// Each is above the roundings that it is counted to cover.
#[test]
fn slacks_cover_the_roundings_they_are_counted_for() {
    assert!(DUALITY_ROUNDING >= gamma(127) && DUALITY_ROUNDING <= gamma(512));
    assert!(TAYLOR_ROUNDING >= gamma(255) && TAYLOR_ROUNDING <= gamma(1024));
    assert!(CULLING_SLACK >= gamma(16) && CULLING_SLACK <= gamma(256));
}

/// The distance of two centres of balls, which cheap bounds begin with.
#[test]
fn centres_are_as_far_apart_as_their_slack_allows() {
    for seed in 0..2000 {
        let mut random = Seeded(seed);
        let far = 10_f64.powi((seed % 13) as i32);
        let (pose_a, pose_b) = (random_pose(&mut random, far), random_pose(&mut random, far));
        let (x, y) = (random.unit() * far, random.unit());
        let (_, apart, error) = across((&pose_a, &x), (&pose_b, &y));
        let moved = |pose: &Pose, point: &Vector3<f64>| -> [Big; 3] {
            let turn = exact_rotation(pose.rotation());
            let turned = |i: usize| (0..3).map(|j| &turn[i][j] * big(point[j])).fold(big(0.0), |sum, term| sum + term);
            std::array::from_fn(|i| turned(i) + big(pose.translation()[i]))
        };
        let (p, q) = (moved(&pose_a, &x), moved(&pose_b, &y));
        let truth = norm(&std::array::from_fn(|i| &p[i] - &q[i]));
        let off = double(&(truth - big(apart))).abs();
        assert!(off <= error + CULLING_SLACK * apart, "seed {seed}: {off:e} above {error:e}");
    }
}

/// Balls and superellipsoids on a line, whose distance is exact in doubles: brackets asked to be
/// narrower than rounding allows contain it, and are as wide as rounding makes them.
#[test]
fn bodies_on_lines_are_bracketed_to_the_last_bits() {
    let options = Options::default().with_accuracy(1e-300).unwrap();
    for degree in [2, 4, 6, 8] {
        let body = Body::superellipsoid("body", Vector3::zeros(), Vector3::new(1.0, 0.5, 2.0), degree).unwrap();
        for gap in [0.0625, 1.0, 3.75, 1000.5] {
            let pose = at(2.0 + gap, 0.0, 0.0);
            let found = distance(&body, &Pose::identity(), &body, &pose, &options, &mut WarmStart::default());
            assert!(found.lower <= gap && gap <= found.upper, "{degree} {gap}: {found:?}");
            assert!(found.upper - found.lower <= 1e-12 * (4.0 + gap), "{degree} {gap}: {found:?}");
        }
    }
}
