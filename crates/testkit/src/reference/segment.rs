//! Segments with 200 bits: what a capsule is about, and what a point is of no length.

use super::big::{Big, Vector, abs, add, big, dot, scaled, sub, vector};
use super::solid::rotation;
use nalgebra::Vector3;
use sublevel_core::measure::Pose;

/// The segment of the z axis of a pose from minus to plus a half height, in the frame of work of
/// [`super::Solid`]: origin at a point of the world, lengths in `unit` metres.
pub(super) struct Segment {
    pub(super) center: Vector,
    /// Unit vector.
    pub(super) axis: Vector,
    pub(super) half: Big,
}

impl Segment {
    pub(super) fn new(half_height_m: f64, pose: &Pose, origin: &Vector3<f64>, unit: f64) -> Self {
        let rows = rotation(pose);
        let per_metre = big(1.0) / big(unit);
        let shift = sub(&vector(pose.translation()), &vector(origin));
        Self {
            center: scaled(&shift, &per_metre),
            axis: rows.map(|[_, _, z]| z),
            half: big(half_height_m) * &per_metre,
        }
    }

    /// The point at a place along the axis, 0 in the middle.
    pub(super) fn at(&self, place: &Big) -> Vector {
        add(&self.center, &scaled(&self.axis, place))
    }

    /// The place of the point nearest to v.
    pub(super) fn place(&self, v: &Vector) -> Big {
        self.within(dot(&self.axis, &sub(v, &self.center)))
    }

    /// The place, or the end beyond which it lies.
    pub(super) fn within(&self, place: Big) -> Big {
        let low = -&self.half;
        if place > self.half {
            self.half.clone()
        } else if place < low {
            low
        } else {
            place
        }
    }

    /// The point nearest to v.
    pub(super) fn nearest(&self, v: &Vector) -> Vector {
        self.at(&self.place(v))
    }

    /// The largest `n·s` over its points s.
    pub(super) fn height(&self, n: &Vector) -> Big {
        dot(n, &self.center) + &self.half * abs(&dot(n, &self.axis))
    }
}
