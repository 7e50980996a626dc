//! What a load is made of.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// A scene of random objects, the calls about it, and a stream of poses beside them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Objects of the scene.
    #[serde(default = "objects")]
    pub objects: usize,
    /// Half the edge of the cube that they are in, metres.
    #[serde(default = "reach_m")]
    pub reach_m: f64,
    /// Calls, each as often as its weight says.
    pub calls: Vec<Share>,
    /// Messages a second of a stream that moves a tenth of the objects; 0: none.
    #[serde(default)]
    pub pose_rate_hz: f64,
}

/// One kind of call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Share {
    /// Evaluate: distances of pairs by name.
    Pairs {
        /// Pairs of a call.
        pairs: usize,
        /// How often, beside the others.
        #[serde(default = "weight")]
        weight: f64,
    },
    /// Evaluate: everything within a margin of one object.
    Within {
        /// Metres.
        margin_m: f64,
        /// How often, beside the others.
        #[serde(default = "weight")]
        weight: f64,
    },
    /// CheckStates of some objects.
    States {
        /// States of a call.
        states: usize,
        /// Objects that a state places.
        moving: usize,
        /// How often, beside the others.
        #[serde(default = "weight")]
        weight: f64,
    },
    /// Calls of a recording, in their order and again from the beginning; the server has the scenes
    /// that they name.
    Recorded {
        /// The recording.
        file: PathBuf,
        /// How often, beside the others.
        #[serde(default = "weight")]
        weight: f64,
    },
}

fn objects() -> usize {
    200
}

fn reach_m() -> f64 {
    4.0
}

fn weight() -> f64 {
    1.0
}

/// Why there is no scenario.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{}: {source}; name a file of a scenario, or one of pair, pairs, within, states, mixed", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It says something else.
    #[error("{place}: {why}")]
    Content {
        /// The file.
        place: String,
        /// The reason.
        why: String,
    },
}

impl Share {
    /// How often, beside the others.
    pub(super) fn weight(&self) -> f64 {
        match self {
            Self::Pairs { weight, .. }
            | Self::Within { weight, .. }
            | Self::States { weight, .. }
            | Self::Recorded { weight, .. } => *weight,
        }
    }
}

impl Scenario {
    /// One of the scenarios that have a name, or one from a file.
    ///
    /// # Errors
    /// A file that cannot be read, and what is no scenario.
    pub fn named(name: &str) -> Result<Self, ScenarioError> {
        let text = match name {
            "pair" => "calls = [{ kind = \"pairs\", pairs = 1 }]",
            "pairs" => "calls = [{ kind = \"pairs\", pairs = 64 }]",
            "within" => "calls = [{ kind = \"within\", margin_m = 0.05 }]",
            "states" => "calls = [{ kind = \"states\", states = 100, moving = 11 }]",
            "mixed" => {
                "pose_rate_hz = 100\n\
                 calls = [{ kind = \"pairs\", pairs = 1, weight = 6 }, { kind = \"within\", margin_m = 0.05, weight = 3 }, \
                 { kind = \"states\", states = 50, moving = 11 }]"
            }
            // The messages of `sublevel record`.
            path if Path::new(path).extension().is_some_and(|extension| extension == "jsonl") => {
                let calls = vec![Share::Recorded { file: path.into(), weight: weight() }];
                return Ok(Self { objects: 2, reach_m: reach_m(), calls, pose_rate_hz: 0.0 });
            }
            path => {
                let path = Path::new(path);
                let text = std::fs::read_to_string(path)
                    .map_err(|source| ScenarioError::File { path: path.to_owned(), source })?;
                return Self::parse(&text, name);
            }
        };
        Self::parse(text, name)
    }

    fn parse(text: &str, place: &str) -> Result<Self, ScenarioError> {
        let refused = |why: String| ScenarioError::Content { place: place.to_owned(), why };
        let scenario: Self = toml::from_str(text).map_err(|error| refused(error.message().to_owned()))?;
        scenario.check().map_err(refused)?;
        Ok(scenario)
    }

    fn check(&self) -> Result<(), String> {
        let between = |what: &str, value: usize, least: usize, most: usize| {
            let fits = (least..=most).contains(&value);
            if fits { Ok(()) } else { Err(format!("{what} is {value}; give {least} to {most}")) }
        };
        between("objects", self.objects, 2, 100_000)?;
        // Not `>`: a NaN is refused too.
        if !(self.reach_m > 0.0 && self.reach_m <= 1e6) {
            return Err(format!("reach_m is {}; give metres above 0", self.reach_m));
        }
        if !(0.0..=10_000.0).contains(&self.pose_rate_hz) {
            return Err(format!("pose_rate_hz is {}; give 0 to 10000", self.pose_rate_hz));
        }
        if self.calls.is_empty() {
            return Err("calls is empty; give at least one".into());
        }
        for (index, share) in self.calls.iter().enumerate() {
            let weight = share.weight();
            if !(weight > 0.0 && weight.is_finite()) {
                return Err(format!("calls[{index}].weight is {weight}; give a number above 0"));
            }
            match share {
                Share::Pairs { pairs, .. } => between(&format!("calls[{index}].pairs"), *pairs, 1, 10_000)?,
                Share::Within { margin_m, .. } if !(0.0..=1e6).contains(margin_m) => {
                    return Err(format!("calls[{index}].margin_m is {margin_m}; give metres, at least 0"));
                }
                Share::Within { .. } | Share::Recorded { .. } => {}
                Share::States { states, moving, .. } => {
                    between(&format!("calls[{index}].moving"), *moving, 1, self.objects)?;
                    between(&format!("calls[{index}].states"), *states, 1, 60_000 / moving)?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenarios_are_read_or_refused_by_field() {
        for name in ["pair", "pairs", "within", "states", "mixed"] {
            assert!(Scenario::named(name).is_ok(), "{name}");
        }
        assert!(Scenario::named("nowhere.toml").expect_err("absent").to_string().contains("nowhere.toml"));
        for (text, word) in [
            ("calls = []", "calls is empty"),
            ("objects = 1\ncalls = [{ kind = \"pairs\", pairs = 1 }]", "objects is 1"),
            ("calls = [{ kind = \"pairs\", pairs = 0 }]", "calls[0].pairs is 0"),
            ("calls = [{ kind = \"within\", margin_m = -1.0 }]", "calls[0].margin_m"),
            ("calls = [{ kind = \"pairs\", pairs = 1, weight = nan }]", "calls[0].weight"),
            ("calls = [{ kind = \"orbit\" }]", "orbit"),
            ("call = []", "call"),
        ] {
            let why = Scenario::parse(text, "test").expect_err(text).to_string();
            assert!(why.contains(word), "{text}: {why}");
        }
    }
}
