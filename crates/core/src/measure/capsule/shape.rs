//! Capsules as their sizes.

use crate::body::ClosedForm;

/// All points within a radius of the segment of the z axis from minus to plus a half height, in
/// their own frame; checked when made. A segment of a radius of 0, a ball of a half height of 0, a
/// point of both.
///
/// ```
/// use sublevel_core::measure::Capsule;
///
/// let forearm = Capsule::new(0.05, 0.2)?;
/// assert_eq!(forearm.half_height_m(), 0.2);
/// assert!(Capsule::new(-0.05, 0.2).is_err());
/// # Ok::<(), sublevel_core::measure::CapsuleError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    radius_m: f64,
    half_height_m: f64,
}

/// Why numbers are no capsule.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the {size} of a capsule is {value} m; give a number from 0 to 1e15, 0 for none")]
pub struct CapsuleError {
    /// Which size.
    pub size: &'static str,
    /// What it was given as, metres.
    pub value: f64,
}

impl Capsule {
    /// The capsule of a radius and a half height, that of its axis, in metres.
    ///
    /// # Errors
    /// A size that is negative, not finite or beyond 1e15 m.
    pub fn new(radius_m: f64, half_height_m: f64) -> Result<Self, CapsuleError> {
        for (size, value) in [("radius", radius_m), ("half height", half_height_m)] {
            if !(0.0..=1e15).contains(&value) {
                return Err(CapsuleError { size, value });
            }
        }
        Ok(Self { radius_m, half_height_m })
    }

    /// A single point.
    pub const POINT: Self = Self { radius_m: 0.0, half_height_m: 0.0 };

    /// Radius, metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Half of the length of the axis, metres.
    pub fn half_height_m(&self) -> f64 {
        self.half_height_m
    }

    /// Radius of the ball about its centre that contains it, metres.
    pub fn reach_m(&self) -> f64 {
        self.radius_m + self.half_height_m
    }

    /// The smaller one of the circumradii of a solid and of the capsule, metres: that of the solid
    /// for a point, which has no size.
    pub(in crate::measure) fn smaller_size_m(&self, of_solid: f64) -> f64 {
        if self.reach_m() > 0.0 { of_solid.min(self.reach_m()) } else { of_solid }
    }

    /// Itself as shapes are measured.
    pub(in crate::measure) fn closed_form(&self) -> ClosedForm {
        ClosedForm::capsule(self.radius_m, self.half_height_m)
    }
}
