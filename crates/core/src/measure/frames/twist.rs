//! Derivatives with respect to poses.

use nalgebra::Vector3;

/// Derivative of a measure with respect to the twist (v, ω) of one body, world frame.
///
/// A twist moves the points of the body by `v + ω × (x - t)`, t the translation of its pose
/// (metres): `t <- t + v`, `R <- exp(ω) R`. Chain it for other parametrizations. For a measure in
/// metres both parts are per metre and per radian in turn: `linear` without unit, `angular` in
/// metres per radian; for one without unit, 1/m and 1/rad.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::Twist;
///
/// // A gradient n at the point x, about the translation t.
/// let (n, x, t) = (Vector3::x(), Vector3::new(0.0, 2.0, 0.0), Vector3::zeros());
/// let gradient = Twist { linear: n, angular: (x - t).cross(&n) };
/// assert_eq!(gradient.angular, Vector3::new(0.0, 0.0, -2.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// Derivative with respect to the velocity v, per metre.
    pub linear: Vector3<f64>,
    /// Derivative with respect to the angular velocity ω, per radian.
    pub angular: Vector3<f64>,
}

impl std::ops::Add for Twist {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

impl Twist {
    /// No change.
    pub(in crate::measure) const ZERO: Self =
        Self { linear: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };

    /// Derivative of a measure that grows with `gradient · δx` when the body's material point at
    /// `point` moves by δx; `center` is the translation of the body's pose, all in the world frame.
    pub(in crate::measure) fn of_gradient(gradient: Vector3<f64>, point: &Vector3<f64>, center: &Vector3<f64>) -> Self {
        Self { linear: gradient, angular: (point - center).cross(&gradient) }
    }
}
