//! Poses of one object in the frame of another, as arguments and in files.

use super::files::read;
use super::numbers::PoseNumbers;
use crate::measure::{Pose, PoseError};
use crate::robot::counted;
use nalgebra::{Matrix3, Vector3};
use std::error::Error;
use std::path::PathBuf;

/// Arguments that say where B is.
#[derive(Debug, clap::Args)]
pub(super) struct PoseArgs {
    /// Pose of B in A's frame: translation (m), then quaternion unless it is not turned [default:
    /// identity]
    #[arg(long, value_name = "X,Y,Z[,QX,QY,QZ,QW]", allow_hyphen_values = true, conflicts_with = "poses")]
    pose: Option<PoseNumbers>,
    /// File of poses of B in A's frame, one a line: r00 r01 r02 r10 .. r22 tx ty tz; a blank line
    /// starts a new trajectory
    #[arg(long, value_name = "FILE")]
    poses: Option<PathBuf>,
}

impl PoseArgs {
    /// The poses, trajectory by trajectory.
    ///
    /// # Errors
    /// A file that cannot be read, or holds no poses, named in the error.
    pub(super) fn trajectories(&self) -> Result<Vec<Vec<Pose>>, Box<dyn Error>> {
        match (&self.pose, &self.poses) {
            (Some(pose), _) => Ok(vec![vec![pose.0]]),
            (None, Some(path)) => {
                parse_file(&read(path)?).map_err(|error| format!("{}: {error}", path.display()).into())
            }
            (None, None) => Ok(vec![vec![Pose::identity()]]),
        }
    }
}

/// Why a text holds no poses.
#[derive(Debug, thiserror::Error)]
enum PosesError {
    /// A number is none.
    #[error("{place}'{text}' is not a number")]
    Number { place: String, text: String },
    /// Too few or too many numbers.
    #[error("{place}{} where {expected} are needed: {order}", counted(*found, "number", "numbers"))]
    Count { place: String, found: usize, expected: usize, order: &'static str },
    /// The numbers are no rigid motion.
    #[error("{place}{source}")]
    Pose { place: String, source: PoseError },
    /// No pose at all.
    #[error("there is no pose in the file; give one a line")]
    Empty,
}

fn numbers<const N: usize>(
    words: impl Iterator<Item = impl AsRef<str>>,
    place: &str,
    order: &'static str,
) -> Result<[f64; N], PosesError> {
    let mut found = Vec::with_capacity(N);
    for word in words {
        let text = word.as_ref();
        let number = text
            .parse()
            .map_err(|_| PosesError::Number { place: place.into(), text: text.chars().take(40).collect() })?;
        found.push(number);
    }
    let count = found.len();
    found.try_into().map_err(|_| PosesError::Count { place: place.into(), found: count, expected: N, order })
}

/// Trajectories of poses `r00 r01 r02 r10 .. r22 tx ty tz`, one a line, separated by blank lines.
fn parse_file(text: &str) -> Result<Vec<Vec<Pose>>, PosesError> {
    let mut trajectories = vec![Vec::new()];
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            trajectories.push(Vec::new());
            continue;
        }
        let place = format!("line {}: ", index + 1);
        let n: [f64; 12] = numbers(line.split_whitespace(), &place, "r00 r01 r02 r10 r11 r12 r20 r21 r22 tx ty tz")?;
        let pose = Pose::from_matrix(&Matrix3::from_row_slice(&n[..9]), Vector3::new(n[9], n[10], n[11]))
            .map_err(|source| PosesError::Pose { place, source })?;
        if let Some(last) = trajectories.last_mut() {
            last.push(pose);
        }
    }
    trajectories.retain(|trajectory| !trajectory.is_empty());
    if trajectories.is_empty() { Err(PosesError::Empty) } else { Ok(trajectories) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_split_into_trajectories() {
        let line = "1 0 0 0 1 0 0 0 1 0.5 0 0";
        let text = format!("{line}\n{line}\n\n\n{line}\n");
        let lengths: Vec<_> = parse_file(&text).unwrap().iter().map(Vec::len).collect();
        assert_eq!(lengths, [2, 1]);
    }

    #[test]
    fn bad_poses_are_named() {
        let message = |text: &str| parse_file(text).unwrap_err().to_string();
        assert!(message("1 0 0 0 1 0 0 0 1 0.5 0").starts_with("line 1: 11 numbers where 12"));
        assert!(message("\n1 0 0 0 1 0 0 0 1 0.5 0 zero").starts_with("line 2: 'zero'"));
        assert!(message("1 0 0 0 1 0 0 0 1.001 0 0 0").contains("deviates by 1.0"));
        assert!(message("1 0 0 0 1 0 0 0 NaN 0 0 0").contains("not finite"));
        assert!(message(" \n\n").contains("no pose"));
    }
}
