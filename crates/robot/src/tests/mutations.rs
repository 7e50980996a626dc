//! Damaged texts: whatever their content, the readers return.

use sublevel_testkit::Seeded;

use super::robots;
use crate::{read_srdf, read_urdf};

/// Texts per robot.
const MUTATIONS: u64 = 1500;

const PIECES: [&str; 16] = [
    "<",
    ">",
    "\"",
    "/",
    "&",
    "</robot>",
    "<link name=\"a\"/>",
    "<!--",
    "<![CDATA[",
    "]]>",
    "\u{7f}",
    "é",
    "-1",
    "1e999",
    "nan",
    " ",
];

/// Replaces, removes, repeats or inserts a few bytes.
fn mutated(text: &str, seed: u64) -> String {
    let mut random = Seeded(seed);
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..1 + random.index(4) {
        let at = random.index(bytes.len());
        let end = (at + 1 + random.index(40)).min(bytes.len());
        match random.index(5) {
            0 => bytes[at] = (random.next() % 128) as u8,
            1 => drop(bytes.drain(at..end)),
            2 => {
                let again = bytes[at..end].to_vec();
                let to = random.index(bytes.len());
                bytes.splice(to..to, again);
            }
            3 => bytes.truncate(at + 1),
            _ => drop(bytes.splice(at..at, PIECES[random.index(PIECES.len())].bytes())),
        }
        if bytes.is_empty() {
            bytes.push(b'<');
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn damaged_urdfs_are_read_or_refused() {
    for text in [robots::six_axis_arm(), robots::mobile_manipulator(), robots::two_arms("floating")] {
        let mut refused = 0;
        for seed in 0..MUTATIONS {
            if let Err(error) = read_urdf(&mutated(&text, seed)) {
                refused += 1;
                assert!(error.line >= 1 && error.column >= 1 && !error.path.is_empty(), "seed {seed}: {error}");
            }
        }
        assert!(refused > MUTATIONS / 2, "{refused} of {MUTATIONS}");
    }
}

#[test]
fn damaged_srdfs_are_read_or_refused() {
    let robot = read_urdf(&robots::two_arms("planar")).expect("a robot");
    let text = robots::two_arms_semantics();
    let refused = (0..MUTATIONS).filter(|seed| read_srdf(&mutated(&text, *seed), &robot).is_err()).count() as u64;
    assert!(refused > MUTATIONS / 2, "{refused} of {MUTATIONS}");
}
