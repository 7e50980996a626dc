//! How to enclose sets.

use super::error::EncloseError;
use crate::error::FitError;

/// Highest degree of multipliers that can be asked for.
pub const MAX_MULTIPLIER_DEGREE: usize = 4;

/// How to enclose.
#[derive(Clone, Debug, PartialEq)]
pub struct EncloseOptions {
    /// Degree of the polynomial: 2, 4, 6 or 8.
    pub degree: usize,
    /// Least degree of the multipliers: 0, 2 or 4. Where polynomial or set leave room for a higher
    /// one it is used, since nothing is saved otherwise. Multipliers of too low a degree make the
    /// body larger than it need be: around a quartic peanut, degree 6 with 2 is 8 % larger than
    /// with 4, and larger than degree 4.
    pub multiplier_degree: usize,
}

impl EncloseOptions {
    /// Multipliers that fill up to the degree of the polynomial where constraints are quadratic, as
    /// in the paper; of degree 4 at most.
    pub fn new(degree: usize) -> Self {
        Self { degree, multiplier_degree: degree.saturating_sub(2).min(MAX_MULTIPLIER_DEGREE) }
    }

    /// Checks the options, before any work.
    ///
    /// # Errors
    /// [`FitError::Degree`], [`EncloseError::MultiplierDegree`].
    pub fn check(&self) -> Result<(), EncloseError> {
        if ![2, 4, 6, 8].contains(&self.degree) {
            return Err(FitError::Degree(self.degree).into());
        }
        if !self.multiplier_degree.is_multiple_of(2) || self.multiplier_degree > MAX_MULTIPLIER_DEGREE {
            return Err(EncloseError::MultiplierDegree(self.multiplier_degree));
        }
        Ok(())
    }
}
