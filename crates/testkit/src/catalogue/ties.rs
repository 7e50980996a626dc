//! Where gradients jump: 21.

use super::Draws;
use crate::bodies::{b, e, moved, q};
use crate::random::pose;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::{Body, Compound};
use sublevel_core::measure::{Pose, WarmStart};

/// Family 21. A small body inside of a host, both turned alike: tied at the common centre, and
/// across mirror planes.
pub struct WaysOut {
    pub inner: Body,
    pub host: Body,
    pub turn: UnitQuaternion<f64>,
    pub depth_accuracy: f64,
    /// Ends of lines of the inner body's centre in the host's frame, metres: to the mirror image of
    /// the start, and across a diagonal to where another translation is the shortest.
    pub lines: [[Vector3<f64>; 2]; 2],
}

/// Turned by nothing, ties are exact.
pub fn ways_out(turn: &UnitQuaternion<f64>, random: &mut dyn Draws) -> WaysOut {
    let inner = [e(0.2, 0.2, 0.2), q(4, 0.3, 0.2, 0.25), b(0.3, 0.2, 0.25), q(8, 0.2, 0.3, 0.2)];
    let hosts = [b(1.0, 1.0, 1.0), b(1.0, 0.5, 2.0), q(8, 1.0, 1.0, 1.0), e(1.0, 1.0, 1.5), q(4, 1.0, 0.5, 1.0)];
    let (inner, host) = (&inner[random.index(4)], &hosts[random.index(5)]);
    let depth_accuracy = [1e-3, 1e-5][random.index(2)];
    let from = Vector3::from_fn(|_, _| 0.3 * random.signed());
    let mirrored = Vector3::new(-from.x, from.y, from.z);
    let axis = random.index(3);
    let other = Vector3::from_fn(|i, _| if i == axis { 0.35 } else { 0.05 * random.signed() });
    let lines = [[from, mirrored], [from, other]];
    WaysOut { inner: inner.clone(), host: host.clone(), turn: *turn, depth_accuracy, lines }
}

impl WaysOut {
    /// The host's pose.
    pub fn still(&self) -> Pose {
        pose(Vector3::zeros(), &self.turn)
    }

    /// The inner body's pose with its centre there in the host's frame, metres.
    pub fn place(&self, center: &Vector3<f64>) -> Pose {
        pose(self.turn * center, &self.turn)
    }
}

/// Family 21, the least distance over pairs: parts on both sides, and a body that passes between.
pub struct Parts {
    pub parts: Vec<Body>,
    pub both: Compound,
    pub third: Body,
}

/// Mirror images a metre to both sides of the plane x = 0.
pub fn mirrored_parts(random: &mut dyn Draws) -> Parts {
    let part = if random.index(2) == 0 { e(0.5, 0.3, 0.4) } else { q(4, 0.4, 0.5, 0.3) };
    let parts = [-1.0, 1.0].map(|side| beside(&part, &UnitQuaternion::identity(), side));
    Parts::new(parts.into(), e(0.6, 0.5, 0.4))
}

/// Two bodies that need not be alike, turned anyhow.
pub fn any_parts(random: &mut dyn Draws) -> Parts {
    let mut part = |side: f64| {
        let body = if random.index(2) == 0 { e(0.5, 0.3, 0.4) } else { q(4, 0.4, 0.5, 0.3) };
        beside(&body, &random.rotation(), side)
    };
    Parts::new(vec![part(-1.0), part(1.0)], q(6, 0.6, 0.5, 0.4))
}

/// The body turned, and moved along x by this, metres.
fn beside(body: &Body, turn: &UnitQuaternion<f64>, side: f64) -> Body {
    moved(body, turn, &Vector3::new(side, 0.0, 0.0))
}

impl Parts {
    fn new(parts: Vec<Body>, third: Body) -> Self {
        let both = Compound::new("both", parts.clone()).expect("two parts");
        Self { parts, both, third }
    }

    /// Where the third body's origin is, `aside` beside the plane between the parts, in their
    /// frame, metres.
    pub fn passing(aside: f64) -> Vector3<f64> {
        Vector3::new(aside, 2.0, 0.3)
    }
}

/// Normals that differ by this much have jumped.
const JUMP: f64 = 0.3;

/// Steps along a line on which jumps are looked for, and the share of the line to which one is
/// narrowed down without a flag.
const STEPS: u32 = 20;
/// See [`STEPS`].
const NARROW: f64 = 1e-15;

/// Whether an answer flags a tie, and its normal.
pub type Flagged = (bool, Vector3<f64>);

/// What following a line found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jumps {
    /// Jumps of the normal.
    pub count: u32,
    /// Where on the line one is without a flag.
    pub unflagged: Option<f64>,
}

/// Follows a line from 0 to 1 in small steps, each with the hint of the one before unless
/// `is_cold`, and narrows down each jump of the normal until a flag is met. Ends where none is.
pub fn follow(is_cold: bool, line: impl Fn(f64, &mut WarmStart) -> Flagged) -> Jumps {
    let jumped = |p: &Flagged, q: &Flagged| !p.0 && !q.0 && (p.1 - q.1).norm() > JUMP;
    let mut warm = WarmStart::default();
    let mut last = (0.0, line(0.0, &mut warm));
    let mut jumps = Jumps::default();
    for k in 1..=STEPS {
        let t = f64::from(k) / f64::from(STEPS);
        if is_cold {
            warm = WarmStart::default();
        }
        let found = (t, line(t, &mut warm));
        let (mut low, mut high) = (last, found);
        jumps.count += u32::from(jumped(&low.1, &high.1));
        while jumped(&low.1, &high.1) {
            let middle = 0.5 * (low.0 + high.0);
            if high.0 - low.0 <= NARROW {
                return Jumps { unflagged: Some(middle), ..jumps };
            }
            let between = (middle, line(middle, &mut WarmStart::default()));
            *(if jumped(&low.1, &between.1) { &mut high } else { &mut low }) = between;
        }
        last = found;
    }
    jumps
}
