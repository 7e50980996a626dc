//! What `--objective` names: an objective, or a method that minimises nothing.

use crate::body::{Objective, SosMethod, UnknownObjective};
use std::fmt;
use std::str::FromStr;

/// What `--objective` names.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) enum Choice {
    /// An objective of a program.
    Minimise(Objective),
    /// The inverse moment, which minimises nothing.
    InverseMoment,
}

impl Default for Choice {
    fn default() -> Self {
        Self::Minimise(Objective::default())
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Minimise(objective) => objective.fmt(f),
            Self::InverseMoment => f.write_str(SosMethod::InverseMoment.name()),
        }
    }
}

impl FromStr for Choice {
    type Err = UnknownObjective;

    fn from_str(name: &str) -> Result<Self, UnknownObjective> {
        if name == SosMethod::InverseMoment.name() {
            return Ok(Self::InverseMoment);
        }
        name.parse().map(Self::Minimise)
    }
}
