//! The stability catalogue: families of queries that broke collision libraries, as plain data.
//!
//! A family's functions give bodies, poses and what is known of the answer; they judge nothing.
//! Tests compare the answers to these cases with 200 bits, the chart `sublevel-bench stability`
//! against an arbiter that knows no solver, for other libraries too.
//!
//! Whatever is random comes from [`Draws`], so that a seed of either side replays its case.
//! Families 17 and 23 are about scenes and 24 is about servers: they are tested there.

mod case;
pub mod clouds;
pub mod contact;
pub mod data;
pub mod depth;
pub mod derivatives;
pub mod limits;
pub mod motion;
pub mod placement;
pub mod primitives;
pub mod rescues;
pub mod scale;
pub mod soak;
pub mod ties;

pub use crate::random::Draws;
pub use case::Case;
use std::fmt;
use sublevel_core::body::Body;

/// A family that pairs of bodies can be put to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Family {
    /// As in the list of families; labels and seeds go by it.
    pub number: u8,
    pub name: &'static str,
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "family {}, {}", self.number, self.name)
    }
}

/// All families here, in the order of their numbers.
pub const FAMILIES: [Family; 24] = [
    family(1, "kissing contact, gap of an ulp"),
    family(2, "iteration limit of 1 to 3"),
    family(3, "all but parallel faces"),
    family(4, "far apart, 1008 pairs a case"),
    family(5, "a common point inside"),
    family(6, "alike, shifted along an axis"),
    family(7, "coincident centres"),
    family(8, "normal and derivatives at contact"),
    family(9, "size ratio of up to a million"),
    family(10, "up to 1e9 m from the origin"),
    family(11, "units of 1e-9 to 1e9 m"),
    family(12, "needles and plates"),
    family(13, "parallel flats, accuracy 1e-4 to 1e-14"),
    family(14, "tip of degree 8 against a flat"),
    family(15, "smooth shapes of 20 cm, gap ±2 mm"),
    family(16, "deep penetration, on the way in"),
    family(18, "bad warm start"),
    family(19, "arguments swapped, frame moved"),
    family(20, "gradients against differences"),
    family(21, "ties are flagged, jumps too"),
    family(22, "time of impact: blade, slab, grazing"),
    family(25, "ill-conditioned data"),
    family(26, "fits of degenerate clouds"),
    family(27, "level distance saturates"),
];

/// The families between primitives: 100 more than the family has. Of impacts (22) and fits (26)
/// there are none: a capsule has no time of impact, and boxes, cylinders and balls are in 22.
pub const PRIMITIVES: [Family; 22] = [
    family(101, "primitives: kissing contact, gap of an ulp"),
    family(102, "primitives: iteration limit of 1 to 3"),
    family(103, "primitives: all but parallel sides"),
    family(104, "primitives: far apart"),
    family(105, "primitives: a common point inside"),
    family(106, "primitives: shifted along an axis"),
    family(107, "primitives: coincident centres"),
    family(108, "primitives: normal and derivatives at contact"),
    family(109, "primitives: size ratio of up to a million"),
    family(110, "primitives: up to 1e9 m from the origin"),
    family(111, "primitives: units of 1e-9 to 1e9 m"),
    family(112, "primitives: needles and plates"),
    family(113, "primitives: parallel flats, accuracy 1e-4 to 1e-14"),
    family(114, "primitives: tips, rims and corners against flats"),
    family(115, "primitives: of 20 cm, gap ±2 mm"),
    family(116, "primitives: deep penetration, on the way in"),
    family(118, "primitives: bad warm start"),
    family(119, "primitives: arguments swapped, frame moved"),
    family(120, "primitives: gradients against 200 bits"),
    family(121, "primitives: ties are flagged, jumps too"),
    family(125, "primitives: ill-conditioned data"),
    family(127, "primitives: level distance saturates"),
];

const fn family(number: u8, name: &'static str) -> Family {
    Family { number, name }
}

/// A body of a list.
pub fn any<'a>(random: &mut dyn Draws, bodies: &'a [Body]) -> &'a Body {
    &bodies[random.index(bodies.len())]
}

/// Two bodies of a list, and the sum of their circumradii, metres.
pub fn any_two<'a>(random: &mut dyn Draws, bodies: &'a [Body]) -> (&'a Body, &'a Body, f64) {
    let (a, b) = (any(random, bodies), any(random, bodies));
    (a, b, a.circumscribed().radius + b.circumscribed().radius)
}
