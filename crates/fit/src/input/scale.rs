//! Units of a file.

use nalgebra::Vector3;
use std::fmt;
use std::str::FromStr;

/// Metres per unit of a file along its axes x, y and z: as the `scale` of a mesh in a URDF, so that
/// negative factors mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale(Vector3<f64>);

/// Why numbers are no scale.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "scale: {0} is not one finite number above 0, nor three finite ones other than 0; give the metres per unit of \
     the file, 0.001 for millimetres, or one factor per axis such as 1,-1,1"
)]
pub struct ScaleError(pub String);

impl Default for Scale {
    fn default() -> Self {
        Self(Vector3::repeat(1.0))
    }
}

impl Scale {
    /// The same factor along all axes, finite and above 0.
    ///
    /// # Errors
    /// Any other factor.
    pub fn uniform(factor: f64) -> Result<Self, ScaleError> {
        if factor > 0.0 && factor.is_finite() {
            Ok(Self(Vector3::repeat(factor)))
        } else {
            Err(ScaleError(factor.to_string()))
        }
    }

    /// A factor for each axis, finite and other than 0; a negative one mirrors.
    ///
    /// # Errors
    /// Any other factors.
    pub fn per_axis(factors: [f64; 3]) -> Result<Self, ScaleError> {
        if factors.iter().all(|factor| factor.is_finite() && *factor != 0.0) {
            Ok(Self(factors.into()))
        } else {
            Err(ScaleError(factors.map(|factor| factor.to_string()).join(",")))
        }
    }

    /// The factors along x, y and z, metres per unit.
    pub fn factors(&self) -> [f64; 3] {
        self.0.into()
    }

    /// Whether it turns the inside of a closed mesh out, which the order of corners must follow.
    pub fn mirrors(&self) -> bool {
        self.0.iter().filter(|factor| **factor < 0.0).count() % 2 == 1
    }

    /// A point of the file in metres.
    pub fn apply(&self, x: &Vector3<f64>) -> Vector3<f64> {
        x.component_mul(&self.0)
    }
}

impl FromStr for Scale {
    type Err = ScaleError;

    fn from_str(text: &str) -> Result<Self, ScaleError> {
        let refused = || ScaleError(format!("{text:?}"));
        let factors: Vec<f64> =
            text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| refused())?;
        match factors[..] {
            [factor] => Self::uniform(factor),
            [x, y, z] => Self::per_axis([x, y, z]),
            _ => Err(refused()),
        }
    }
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.factors();
        if x > 0.0 && x == y && y == z { write!(f, "{x}") } else { write!(f, "{x},{y},{z}") }
    }
}

#[cfg(test)]
mod tests {
    use super::Scale;
    use nalgebra::Vector3;

    #[test]
    fn of_one_factor_or_three() {
        for (text, factors, mirrors) in [
            ("0.001", [1e-3; 3], false),
            ("1,-1,1", [1.0, -1.0, 1.0], true),
            ("-1, -2, 3", [-1.0, -2.0, 3.0], false),
            ("-1,-1,-1", [-1.0; 3], true),
        ] {
            let scale: Scale = text.parse().unwrap();
            assert_eq!((scale.factors(), scale.mirrors()), (factors, mirrors), "{text}");
            assert_eq!(scale.to_string().parse(), Ok(scale), "{text}");
            assert_eq!(scale.apply(&Vector3::new(1.0, 2.0, 3.0)).x, factors[0]);
        }
        for text in ["", "0", "-1", "nan", "inf", "1,1", "1,0,1", "1,nan,1", "1;1;1", "1,1,1,1", "mm"] {
            let refused = text.parse::<Scale>().unwrap_err().to_string();
            assert!(refused.contains("scale") && refused.contains("0.001"), "{text}: {refused}");
        }
    }
}
