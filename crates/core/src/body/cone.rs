//! Where the Gram matrix of the Hessian form comes from: all semidefinite matrices, or smaller
//! cones of them that are cheaper.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The convex cone that the Gram matrix H of the Hessian form `yᵀ∇²p y = wᵀHw` is taken from.
///
/// Every diagonally dominant matrix is scaled diagonally dominant, and every one of those positive
/// semidefinite, so that volumes grow from one to the next; but the first needs linear and the
/// second only second-order cones where the third needs a semidefinite one (Ahmadi and Majumdar,
/// SIAM J. Appl. Algebra Geometry 3, 2019). Dominance depends on the frame, semidefiniteness does
/// not: it is asked for in the frame in which the smallest ellipsoid is the unit ball, along its
/// axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cone {
    /// Positive semidefinite: p sos-convex.
    #[default]
    Sos,
    /// A sum of semidefinite matrices with two rows: p sdsos-convex.
    Sdsos,
    /// No diagonal entry below the sum of the magnitudes of the others of its row: p dsos-convex.
    Dsos,
}

/// A name that is no cone.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cone: {0:?} is not one of sos, sdsos, dsos; sos is the tightest, the others need no semidefinite program")]
pub struct UnknownCone(pub String);

impl Cone {
    /// All cones, the largest first.
    pub const ALL: [Self; 3] = [Self::Sos, Self::Sdsos, Self::Dsos];

    /// Name on the command line, in reports and in stored requests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sos => "sos",
            Self::Sdsos => "sdsos",
            Self::Dsos => "dsos",
        }
    }
}

impl fmt::Display for Cone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Cone {
    type Err = UnknownCone;

    fn from_str(name: &str) -> Result<Self, UnknownCone> {
        Self::ALL.into_iter().find(|cone| cone.name() == name).ok_or_else(|| UnknownCone(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for cone in Cone::ALL {
            assert_eq!(cone.to_string().parse(), Ok(cone));
            assert_eq!(serde_json::to_string(&cone).unwrap(), format!("{:?}", cone.name()));
        }
        assert!("socp".parse::<Cone>().unwrap_err().to_string().contains("sdsos"));
    }
}
