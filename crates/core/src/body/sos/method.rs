//! How the polynomial of a set that need not be convex is chosen.

use serde::{Deserialize, Serialize};

use crate::body::Objective;

/// What makes a set that need not be convex.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SosMethod {
    /// The least objective, of the Gram matrix P of p, with `p + c |u|^degree` sos-convex.
    Relaxed {
        /// c > 0, unit-free; infinity for no bound of convexity at all. c = 0 makes bodies.
        #[serde(with = "number_as_text")]
        c: f64,
        /// What is minimised: `logdet-p` or `trace-p`.
        objective: Objective,
    },
    /// `m(x)ᵀ M⁻¹ m(x)` with the moment matrix M of the points, below the smallest level that
    /// contains all of them (Lasserre and Pauwels, NIPS 2016): a single matrix to invert.
    InverseMoment,
}

impl SosMethod {
    /// Name in reports and in the provenance of sets.
    pub fn name(self) -> &'static str {
        match self {
            Self::Relaxed { objective, .. } => objective.name(),
            Self::InverseMoment => "inverse-moment",
        }
    }
}

/// JSON has no infinity; the shortest decimal text has.
mod number_as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(number: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(number)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_keeps_every_number_and_infinity() {
        let relaxed =
            [0.1 + 0.2, 1e-300, f64::INFINITY].map(|c| SosMethod::Relaxed { c, objective: Objective::TraceP });
        for method in relaxed.into_iter().chain([SosMethod::InverseMoment]) {
            let text = serde_json::to_string(&method).unwrap();
            assert_eq!(serde_json::from_str::<SosMethod>(&text).unwrap(), method, "{text}");
        }
    }
}
