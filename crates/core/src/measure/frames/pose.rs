//! Poses: rigid motions from a body frame to the world frame.

use crate::polynomial::gamma;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Largest deviation of a quaternion's length from 1, or of a matrix from the nearest rotation
/// (Frobenius norm), dimensionless, that is normalised away; worse is refused.
///
/// Single precision rounds at 1e-7. A smaller value refuses poses that were stored in it; a larger
/// one accepts maps that scale or shear. Pinned by `poses_are_normalised_or_refused`.
const TOLERANCE: f64 = 1e-6;

/// Computed length minus 1 of a quaternion that normalising would not improve, dimensionless:
/// dividing by a computed length leaves at most 1.5 epsilon.
///
/// A smaller value normalises again what a pose has returned, and changes its last bits; a larger
/// one keeps quaternions that [`ROTATION_ERROR`] does not cover. Pinned by
/// `the_quaternion_of_a_pose_makes_the_same_pose`.
const NORMALISED: f64 = 2.0 * f64::EPSILON;

/// Bound of the distance in operator norm, dimensionless, between the rotation matrix of a pose, as
/// computed, and the rotation of its quaternion normalised exactly, which is what the pose stands
/// for. The length of the quaternion is 1 within [`NORMALISED`] = 4 u and the 3 u of computing it,
/// hence 14 u of the matrix, and each entry costs 8 u more: below 30 u in operator norm.
///
/// A smaller value could make brackets miss the truth; a larger one widens brackets of bodies far
/// from their origins. Pinned by `rotation_matrices_are_off_by_less_than_the_bound`.
pub(in crate::measure) const ROTATION_ERROR: f64 = 16.0 * f64::EPSILON;

/// Bound of the error in operator norm, dimensionless, of a relative rotation that is the product
/// of two rotation matrices: each is off by at most [`ROTATION_ERROR`]; their product and sums with
/// it round a few times more, fewer than 16.
///
/// A smaller value could make brackets of poses far from the axes miss the truth; a larger one
/// widens them. Pinned by `relative_rotations_are_off_by_less_than_the_bounds`.
pub(in crate::measure) const RELATIVE_ERROR: f64 = 2.0 * ROTATION_ERROR + gamma(16);

/// The same of one that is the matrix of a product of two quaternions, as vectors compute it, with
/// fewer than 40 roundings: a bound of its own, for the other would widen with it. A smaller value
/// could make brackets of continuation miss the truth. Pinned by
/// `relative_rotations_are_off_by_less_than_the_bounds`.
pub(in crate::measure) const RELATIVE_QUATERNION_ERROR: f64 = 2.0 * ROTATION_ERROR + gamma(40);

/// A rigid motion `x_world = R x_body + t`, lengths in metres; R is the rotation of the stored
/// quaternion normalised exactly.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::Pose;
///
/// // A quarter turn about z, then one metre along x.
/// let half = std::f64::consts::FRAC_1_SQRT_2;
/// let pose = Pose::from_quaternion(Vector3::x(), [0.0, 0.0, half, half])?;
/// assert!((pose.transform_point(&Vector3::x()) - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-15);
/// assert!(Pose::from_quaternion(Vector3::x(), [0.0, 0.0, 0.0, 2.0]).is_err());
/// # Ok::<(), sublevel_core::measure::PoseError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    rotation: UnitQuaternion<f64>,
    translation: Vector3<f64>,
}

/// Why numbers are not a pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A coordinate is NaN or infinite.
    #[error("{field} is not finite; poses are finite numbers")]
    NotFinite {
        /// Which part.
        field: &'static str,
    },
    /// A translation beyond any use.
    #[error("translation reaches {0:e} m; at most 1e15 m can be distinguished from rounding")]
    TooFar(f64),
    /// A quaternion that is not of length one.
    #[error(
        "rotation is not a unit quaternion: its length deviates by {0:.3e}, at most 1e-6 is accepted; normalise it"
    )]
    NotUnit(f64),
    /// A matrix that is not a rotation.
    #[error(
        "rotation is not a rotation matrix: it deviates by {0:.3e} from the nearest one, at most 1e-6 is accepted; orthonormalise it"
    )]
    NotRotation(f64),
}

impl Pose {
    /// The pose that leaves everything where it is.
    pub fn identity() -> Self {
        Self { rotation: UnitQuaternion::identity(), translation: Vector3::zeros() }
    }

    /// Pose from a translation (m) and a quaternion `[x, y, z, w]` within 1e-6 of unit length,
    /// which is normalised.
    ///
    /// # Errors
    /// Numbers that are not finite, or a quaternion that is farther from unit length.
    pub fn from_quaternion(translation: Vector3<f64>, [x, y, z, w]: [f64; 4]) -> Result<Self, PoseError> {
        check_translation(&translation)?;
        let quaternion = Quaternion::new(w, x, y, z);
        if ![x, y, z, w].iter().all(|value| value.is_finite()) {
            return Err(PoseError::NotFinite { field: "rotation" });
        }
        let deviation = (quaternion.norm() - 1.0).abs();
        if deviation > TOLERANCE {
            return Err(PoseError::NotUnit(deviation));
        }
        // Normalising twice would move the last bits: the quaternion of a pose makes the same pose
        // again, bit for bit.
        let rotation = if deviation <= NORMALISED {
            UnitQuaternion::new_unchecked(quaternion)
        } else {
            UnitQuaternion::new_normalize(quaternion)
        };
        Ok(Self { rotation, translation })
    }

    /// Pose from a rotation matrix within 1e-6 of a rotation and a translation (m); the rotation
    /// used is the quaternion of the polar factor, rounded.
    ///
    /// # Errors
    /// Numbers that are not finite, or a matrix that is farther from its polar factor or a
    /// reflection.
    pub fn from_matrix(matrix: &Matrix3<f64>, translation: Vector3<f64>) -> Result<Self, PoseError> {
        check_translation(&translation)?;
        if !matrix.iter().all(|value| value.is_finite()) {
            return Err(PoseError::NotFinite { field: "rotation" });
        }
        // Far from orthonormal the nearest rotation does not matter: say how far the columns are.
        let skew = (matrix.transpose() * matrix - Matrix3::identity()).norm();
        if skew > 0.1 || matrix.determinant() <= 0.0 {
            return Err(PoseError::NotRotation(skew.max((matrix.determinant() - 1.0).abs())));
        }
        // Newton's iteration for the polar factor converges quadratically (Higham 1986).
        let mut polar = *matrix;
        for _ in 0..8 {
            let Some(inverse) = polar.try_inverse() else { return Err(PoseError::NotRotation(skew)) };
            polar = (polar + inverse.transpose()) * 0.5;
        }
        let deviation = (matrix - polar).norm();
        if !(deviation <= TOLERANCE) {
            return Err(PoseError::NotRotation(deviation));
        }
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(polar);
        Ok(Self { rotation: UnitQuaternion::from_rotation_matrix(&rotation), translation })
    }

    /// Pose of finite parts that were computed; the rotation is normalised.
    pub(in crate::measure) fn of_parts(rotation: UnitQuaternion<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation: UnitQuaternion::new_normalize(rotation.into_inner()), translation }
    }

    /// Rotation from the body frame to the world frame.
    pub fn rotation(&self) -> &UnitQuaternion<f64> {
        &self.rotation
    }

    /// World position of the body frame's origin, metres.
    pub fn translation(&self) -> &Vector3<f64> {
        &self.translation
    }

    /// The same orientation at another translation, metres.
    #[must_use]
    pub fn with_translation(&self, translation: Vector3<f64>) -> Self {
        Self { translation, ..*self }
    }

    /// World position of a point of the body frame.
    pub fn transform_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }

    /// The point of the body frame at a world position.
    pub(in crate::measure) fn inverse_transform_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse_transform_vector(&(point - self.translation))
    }

    /// World direction of a direction of the body frame.
    pub fn transform_direction(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * direction
    }
}

fn check_translation(translation: &Vector3<f64>) -> Result<(), PoseError> {
    if !translation.iter().all(|value| value.is_finite()) {
        return Err(PoseError::NotFinite { field: "translation" });
    }
    if translation.amax() > 1e15 { Err(PoseError::TooFar(translation.amax())) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quaternion_of_a_pose_makes_the_same_pose() {
        let mut angle = 0.0_f64;
        for _ in 0..10_000 {
            angle += 0.37;
            let raw = Vector3::new(angle.sin(), (1.3 * angle).cos(), (2.1 * angle).sin());
            let quaternion = Quaternion::new((0.7 * angle).cos(), raw.x, raw.y, raw.z);
            let unit = quaternion / quaternion.norm() * (1.0 + 1e-7 * angle.sin());
            let pose = Pose::from_quaternion(raw, [unit.i, unit.j, unit.k, unit.w]).expect("a pose");
            let again = Pose::from_quaternion(raw, pose.rotation().coords.into()).expect("a pose");
            assert_eq!(pose.rotation().coords.map(f64::to_bits), again.rotation().coords.map(f64::to_bits));
        }
    }
}
