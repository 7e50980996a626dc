//! What a fit minimises: a measure of a Gram matrix that stands in for the volume.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The objective of a fit, over sos-convex polynomials p with `p <= 1` at the points.
///
/// With Gram matrices `p = zᵀPz` on the monomials z and `yᵀ∇²p y = wᵀHw` on the monomials w linear
/// in y. At degree 2 both log dets are the volume of the ellipsoid; above, all four are heuristics
/// (Ahmadi, Hall, Makadia and Sindhwani, RSS 2017, section III).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Objective {
    /// `-log det P`: tightest of the four nearly always, and the same in every affine frame.
    #[default]
    #[serde(rename = "logdet-p")]
    LogDetP,
    /// `tr P⁻¹` in the unit frame: dominated by the largest eigenvalues of P⁻¹.
    #[serde(rename = "trace-p")]
    TraceP,
    /// `-log det H` with p a sum of squares (Magnani, Lall and Boyd, CDC 2005): curvature
    /// everywhere; the same in every affine frame.
    #[serde(rename = "logdet-h")]
    LogDetH,
    /// `tr H⁻¹` in the unit frame, with p a sum of squares.
    #[serde(rename = "trace-h")]
    TraceH,
}

/// A name that is no objective.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("objective: {0:?} is not one of logdet-p, trace-p, logdet-h, trace-h; logdet-p is nearly always the tightest")]
pub struct UnknownObjective(pub String);

impl Objective {
    /// All objectives.
    pub const ALL: [Self; 4] = [Self::LogDetP, Self::TraceP, Self::LogDetH, Self::TraceH];

    /// Name on the command line, in reports, in stored requests and in the provenance of bodies.
    pub fn name(self) -> &'static str {
        match self {
            Self::LogDetP => "logdet-p",
            Self::TraceP => "trace-p",
            Self::LogDetH => "logdet-h",
            Self::TraceH => "trace-h",
        }
    }

    /// Highest degree it is offered for: the Hessian's matrix has 60 rows at degree 8, where
    /// nothing is gained by it.
    pub fn max_degree(self) -> usize {
        match self {
            Self::LogDetP | Self::TraceP => 8,
            Self::LogDetH | Self::TraceH => 6,
        }
    }
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Objective {
    type Err = UnknownObjective;

    fn from_str(name: &str) -> Result<Self, UnknownObjective> {
        Self::ALL.into_iter().find(|o| o.name() == name).ok_or_else(|| UnknownObjective(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for objective in Objective::ALL {
            assert_eq!(objective.to_string().parse(), Ok(objective));
            assert_eq!(serde_json::to_string(&objective).unwrap(), format!("{:?}", objective.name()));
        }
        assert!("volume".parse::<Objective>().unwrap_err().to_string().contains("logdet-p"));
    }
}
