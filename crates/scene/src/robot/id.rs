//! Identity of a robot: a hash of what it was loaded from.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use sha2::{Digest, Sha256};
use sublevel_core::body::BodyId;

/// SHA-256 of what a robot was loaded from.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RobotId([u8; 32]);

impl RobotId {
    /// That of two texts and of bodies of links: SHA-256 of `robot`, then of the lengths of both
    /// texts as little-endian u64, the texts, and per body the length of the name of its link, the
    /// name, and the body's id as text. A robot without SRDF has an empty one. The bodies are given
    /// in the order of the names.
    pub fn of<'a>(urdf: &str, srdf: &str, bodies: impl IntoIterator<Item = (&'a str, &'a BodyId)>) -> Self {
        let mut hash = Sha256::new_with_prefix("robot");
        let length = |text: &str| (text.len() as u64).to_le_bytes();
        for text in [urdf, srdf] {
            hash.update(length(text));
        }
        hash.update(urdf);
        hash.update(srdf);
        for (link, id) in bodies {
            hash.update(length(link));
            hash.update(link);
            hash.update(id.to_string());
        }
        Self(hash.finalize().into())
    }
}

impl fmt::Display for RobotId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for RobotId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "RobotId({self})")
    }
}

/// As its text.
impl Serialize for RobotId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for RobotId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

/// A text that is not the id of a robot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a robot id; an id is 64 hexadecimal digits")]
pub struct ParseRobotIdError(String);

impl FromStr for RobotId {
    type Err = ParseRobotIdError;

    fn from_str(text: &str) -> Result<Self, ParseRobotIdError> {
        let error = || ParseRobotIdError(text.chars().take(80).collect());
        if text.len() != 64 || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(error());
        }
        let mut bytes = [0; 32];
        for (i, byte) in bytes.iter_mut().enumerate() {
            *byte = u8::from_str_radix(&text[2 * i..2 * i + 2], 16).map_err(|_| error())?;
        }
        Ok(Self(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_counts_and_texts_come_back() {
        let capsule = BodyId::of_capsule(0.1, 0.2);
        let ids = [
            RobotId::of("a", "", []),
            RobotId::of("", "a", []),
            RobotId::of("ab", "", []),
            RobotId::of("a", "b", []),
            RobotId::of("a", "", [("link", &capsule)]),
            RobotId::of("a", "link", []),
        ];
        for (index, id) in ids.iter().enumerate() {
            assert_eq!(id.to_string().parse(), Ok(*id));
            assert!(!ids[..index].contains(id), "{index}");
        }
        assert!("12".parse::<RobotId>().is_err());
    }
}
