//! The obvious ways to a distance, at their best settings: plain Newton, a general nonlinear
//! program, level 0 of the hierarchy.

mod level0;
mod newton;
mod posed;
mod slsqp;
mod solver;

pub(crate) use level0::ConicProgram;
pub(crate) use newton::newton;
pub(crate) use posed::{Posed, between};
pub(crate) use slsqp::slsqp;
pub(crate) use solver::Clarabel;

#[cfg(test)]
pub(crate) mod tests {
    use super::Posed;
    use nalgebra::Vector3;
    use sublevel::body::Body;
    use sublevel::measure::Pose;
    pub(crate) use sublevel_testkit::random::at;

    type Known = (Body, Body, Pose, f64);

    /// Balls of radius 1 and 0.5, centres 3 apart.
    pub(crate) fn balls_apart() -> Known {
        let ball = |radius| Body::ball("ball", Vector3::zeros(), radius).unwrap();
        (ball(1.0), ball(0.5), at(2.0, 2.0, 1.0), 1.5)
    }

    /// Ellipsoids that face each other along a common axis.
    pub(crate) fn axes_apart() -> Known {
        let egg = |x, y, z| Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(x, y, z)).unwrap();
        (egg(1.0, 0.6, 0.8), egg(0.5, 0.7, 0.9), at(2.25, 0.0, 0.0), 0.75)
    }

    /// A start that is not the solution, unlike the line between these centres.
    pub(crate) fn aside([a, b]: &[Posed<'_>; 2]) -> [Vector3<f64>; 2] {
        let beside = Vector3::new(0.0, 0.3, -0.2);
        [a.facing(&(b.inside() + beside)), b.facing(&(a.inside() - 2.0 * beside))]
    }
}
