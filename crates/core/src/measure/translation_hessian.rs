//! Second derivative of the distance under translation.

use crate::body::{Body, Solid};
use crate::measure::distance::Distance;
use crate::measure::frames::pose::Pose;
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector3};

/// Hessian of the distance of `a` and `b` with respect to the translation of either body (world
/// frame, 1/m), at an answer of [`crate::measure::distance`] for these poses; that with respect to
/// both in turn is its negative.
///
/// With the normal n, tangents T across it and the curvatures `W_i = Tᵀ H_i T / |g_i|` of the
/// surfaces at the witnesses, it is `T A (A + W_B)⁺ W_B Tᵀ`, `A = W_A (I + D W_A)⁻¹`: zero along n,
/// and where either body is flat. None on overlap, at contact, and where several constraints of one
/// body meet: the distance has no second derivative there. Of compounds it is that of the parts the
/// answer is about, which holds for the compounds unless the answer is tied.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance, translation_hessian};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(4.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = distance(&ball, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// let hessian = translation_hessian(&ball, &Pose::identity(), &ball, &apart, &answer).unwrap();
/// // The distance |c| - 2 has the second derivative 1/4 across the line of centres.
/// assert!((hessian[(1, 1)] - 0.25).abs() < 1e-6 && hessian[(0, 0)].abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn translation_hessian(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    answer: &Distance,
) -> Option<Matrix3<f64>> {
    let [a, b] = [a.parts().get(usize::from(answer.parts[0]))?, b.parts().get(usize::from(answer.parts[1]))?];
    let n = answer.normal?;
    if !(answer.lower > 0.0) {
        return None;
    }
    let first = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let t = n.cross(&first).normalize();
    let tangents = Matrix3x2::from_columns(&[t, n.cross(&t)]);
    let w_a = curvature(a, pose_a, &answer.witness_a, &tangents, answer.active_a.iter())?;
    let w_b = curvature(b, pose_b, &answer.witness_b, &tangents, answer.active_b.iter())?;
    let bent = w_a * (Matrix2::identity() + w_a * answer.value()).try_inverse()?;
    // Both are positive semidefinite: in the null space of the sum, both vanish.
    let eigen = (bent + w_b).symmetric_eigen();
    let smallest = eigen.eigenvalues.amax() * 1e-12;
    let inverse = Matrix2::from_diagonal(&eigen.eigenvalues.map(|e| if e > smallest { 1.0 / e } else { 0.0 }));
    let pseudo = eigen.eigenvectors * inverse * eigen.eigenvectors.transpose();
    let hessian = tangents * (bent * pseudo * w_b) * tangents.transpose();
    Some((hessian + hessian.transpose()) * 0.5)
}

/// Curvature of a surface across the tangents, 1/m, where one constraint is active.
fn curvature(
    body: &Body,
    pose: &Pose,
    witness: &Vector3<f64>,
    tangents: &Matrix3x2<f64>,
    mut active: impl Iterator<Item = (usize, f64)>,
) -> Option<Matrix2<f64>> {
    let (index, _) = active.next()?;
    if active.next().is_some() {
        return None;
    }
    let rotation = pose.rotation();
    let local = rotation.inverse_transform_vector(&(witness - pose.translation()));
    let jet = body.placement().jet(&body.constraints()[index], &local);
    let own = Matrix3x2::from_columns(&[
        rotation.inverse_transform_vector(&tangents.column(0).into_owned()),
        rotation.inverse_transform_vector(&tangents.column(1).into_owned()),
    ]);
    Some(own.transpose() * jet.hessian * own / jet.gradient.norm())
}
