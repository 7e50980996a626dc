//! Arguments that are several numbers.

use std::str::FromStr;

use nalgebra::Vector3;

use crate::measure::Pose;
use crate::robot::counted;

/// Any number of numbers with commas between them.
#[derive(Clone, Debug)]
pub(super) struct Numbers(pub(super) Vec<f64>);

impl FromStr for Numbers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self)
    }
}

/// Three numbers with commas between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triple(pub(super) Vector3<f64>);

impl FromStr for Triple {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = numbers(text)?;
        let [x, y, z] = numbers[..] else {
            let count = counted(numbers.len(), "number", "numbers");
            return Err(format!("{count}; give three with commas between them, such as 0.5,0.3,0.02"));
        };
        Ok(Self(Vector3::new(x, y, z)))
    }
}

/// A pose, metres: X,Y,Z, or with a unit quaternion X,Y,Z,QX,QY,QZ,QW.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoseNumbers(pub(super) Pose);

impl FromStr for PoseNumbers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = numbers(text)?;
        let (translation, quaternion) = match numbers[..] {
            [x, y, z] => (Vector3::new(x, y, z), [0.0, 0.0, 0.0, 1.0]),
            [x, y, z, i, j, k, w] => (Vector3::new(x, y, z), [i, j, k, w]),
            _ => {
                let count = counted(numbers.len(), "number", "numbers");
                return Err(format!("{count}; give X,Y,Z or X,Y,Z,QX,QY,QZ,QW"));
            }
        };
        Pose::from_quaternion(translation, quaternion).map(Self).map_err(|error| error.to_string())
    }
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| word.trim().parse().map_err(|_| format!("\"{}\" is not a number", word.trim()));
    text.split(',').map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_and_triples_are_read_or_refused() {
        assert!("0,0,0,0,0,0,1".parse::<PoseNumbers>().is_ok());
        assert_eq!("1, 2, -3".parse::<PoseNumbers>().expect("a pose").0.translation().z, -3.0);
        let refused = |text: &str| text.parse::<PoseNumbers>().expect_err(text);
        assert!(refused("0,0,0,0,0,0").contains("6 numbers"));
        assert!(refused("0,0,0,0,0,0,2").contains("unit quaternion"));
        assert!(refused("0,x,0").contains("\"x\" is not a number"));
        assert_eq!("1,2,3".parse::<Triple>().expect("three").0, Vector3::new(1.0, 2.0, 3.0));
        assert!("1,2".parse::<Triple>().expect_err("two").contains("2 numbers"));
        assert!("1".parse::<Triple>().expect_err("one").starts_with("1 number; "));
    }
}
