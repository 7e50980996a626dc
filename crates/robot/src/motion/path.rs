//! Motions of a robot: curves of configurations.

use super::interval::Interval;
use super::screw::Screw;
use crate::counted;
use crate::description::JointKind;
use crate::kinematics::Kinematics;
use serde::{Deserialize, Serialize};

/// Most configurations of a path.
pub const MAX_PATH_POINTS: usize = 100_000;

/// Most control points of a Bézier segment.
pub const MAX_CONTROL_POINTS: usize = 16;

/// A curve of configurations over the path parameter s in [0, 1].
///
/// Between waypoints joint values are straight lines, those of planar joints too: their two
/// coordinates and their angle. Floating joints go from pose to pose as a screw: at a constant rate
/// about a line and along it, by the smaller angle. With n segments, segment k is the part `k / n
/// <= s <= (k + 1) / n`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Path {
    /// Values of a configuration.
    width: usize,
    /// Configurations, packed.
    points: Vec<f64>,
    /// Whether the points are control points of one Bézier segment; otherwise they are waypoints.
    bezier: bool,
}

/// Why numbers are no path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// Numbers that are not whole configurations.
    #[error("holds {}, which is no multiple of {width}, what a configuration takes", counted(*numbers, "number", "numbers"))]
    Numbers {
        /// How many there are.
        numbers: usize,
        /// Values of a configuration.
        width: usize,
    },
    /// Too few configurations.
    #[error("holds {}; a path has at least 2", counted(*.0, "configuration", "configurations"))]
    Few(usize),
    /// Too many configurations.
    #[error("holds {given} configurations; at most {most} are allowed")]
    Many {
        /// How many there are.
        given: usize,
        /// How many may be.
        most: usize,
    },
    /// Control points of a joint that turns by quaternions.
    #[error("a Bézier segment cannot move floating joints; use waypoints")]
    Floating,
}

impl Path {
    /// Straight lines between configurations, packed one after the other.
    ///
    /// # Errors
    /// Numbers that are not at least two whole configurations, or too many.
    pub fn waypoints(kinematics: &Kinematics, packed: Vec<f64>) -> Result<Self, PathError> {
        Self::new(kinematics, packed, false, MAX_PATH_POINTS)
    }

    /// One Bézier segment with these control points, packed one after the other.
    ///
    /// # Errors
    /// Numbers that are not at least two whole configurations, too many, or a robot with floating
    /// joints.
    pub fn bezier(kinematics: &Kinematics, packed: Vec<f64>) -> Result<Self, PathError> {
        if kinematics.variables().iter().any(|variable| variable.kind == JointKind::Floating) {
            return Err(PathError::Floating);
        }
        Self::new(kinematics, packed, true, MAX_CONTROL_POINTS)
    }

    fn new(kinematics: &Kinematics, points: Vec<f64>, bezier: bool, most: usize) -> Result<Self, PathError> {
        let width = kinematics.width();
        if width == 0 || !points.len().is_multiple_of(width) {
            return Err(PathError::Numbers { numbers: points.len(), width });
        }
        match points.len() / width {
            given @ ..2 => Err(PathError::Few(given)),
            given if given > most => Err(PathError::Many { given, most }),
            _ => Ok(Self { width, points, bezier }),
        }
    }

    /// Values of a configuration.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Waypoints or control points, one after the other.
    pub fn points(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.points.chunks_exact(self.width)
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        if self.bezier { 1 } else { self.points.len() / self.width - 1 }
    }

    /// Whether the numbers, which may come from anywhere, are a path of this robot.
    pub(crate) fn is_usable(&self, kinematics: &Kinematics) -> bool {
        let again = if self.bezier { Self::bezier } else { Self::waypoints };
        self.is_whole()
            && self.width == kinematics.width()
            && again(kinematics, self.points.clone()).is_ok()
            && self.points().all(|point| kinematics.check(point).is_ok())
    }

    /// Whether the numbers, which may come from anywhere, are at least two configurations.
    pub(crate) fn is_whole(&self) -> bool {
        self.width > 0 && self.points.len() >= 2 * self.width && self.points.len().is_multiple_of(self.width)
    }

    /// The configuration at s, clamped to [0, 1].
    pub fn at(&self, kinematics: &Kinematics, s: f64) -> Vec<f64> {
        let scaled = s.clamp(0.0, 1.0) * self.segments() as f64;
        let segment = (scaled as usize).min(self.segments() - 1);
        let mut configuration = Vec::new();
        self.inside(kinematics, segment, scaled - segment as f64, &mut configuration);
        configuration
    }

    fn point(&self, index: usize) -> &[f64] {
        &self.points[index * self.width..(index + 1) * self.width]
    }

    /// The configuration at t in [0, 1] of a segment.
    fn inside(&self, kinematics: &Kinematics, segment: usize, t: f64, configuration: &mut Vec<f64>) {
        configuration.clear();
        if self.bezier {
            configuration.extend((0..self.width).map(|value| self.blossom(value, t, t, 0)));
            return;
        }
        let (from, to) = (self.point(segment), self.point(segment + 1));
        configuration.extend(from.iter().zip(to).map(|(a, b)| a + (b - a) * t));
        for variable in kinematics.variables().iter().filter(|variable| variable.kind == JointKind::Floating) {
            let own = variable.first..variable.first + 7;
            Screw::new(&from[own.clone()], &to[own.clone()]).write_at(t, &mut configuration[own]);
        }
    }

    /// Coefficient of the curve of one value between t0 and t1, the point that takes t1 `ones`
    /// times and t0 otherwise; all of them make the hull of this part of the curve (de Casteljau).
    fn blossom(&self, value: usize, t0: f64, t1: f64, ones: usize) -> f64 {
        let mut row = [0.0; MAX_CONTROL_POINTS];
        let count = self.points.len() / self.width;
        for (entry, point) in row.iter_mut().zip(self.points()) {
            *entry = point[value];
        }
        for step in 1..count {
            let t = if step <= ones { t1 } else { t0 };
            for k in 0..count - step {
                row[k] = row[k] * (1.0 - t) + row[k + 1] * t;
            }
        }
        row[0]
    }

    /// The configuration in the middle of an interval, and how far each of its values goes from
    /// there at most. Of a floating joint the first entry is the length that its origin moves,
    /// metres, the fourth the angle that it turns by, radians, the others 0.
    pub(crate) fn middle(
        &self,
        kinematics: &Kinematics,
        interval: &Interval,
        configuration: &mut Vec<f64>,
        deviations: &mut Vec<f64>,
    ) {
        let segment = interval.segment as usize;
        self.inside(kinematics, segment, interval.middle(), configuration);
        deviations.clear();
        if self.bezier {
            let (t0, t1) = (interval.start(), interval.end());
            let count = self.points.len() / self.width;
            for (value, at) in configuration.iter().enumerate() {
                let size = self.points().fold(0.0, |size: f64, point| size.max(point[value].abs()));
                let spread = (0..count).map(|ones| (self.blossom(value, t0, t1, ones) - at).abs());
                let slack = PATH_ROUNDING * count as f64 * size;
                deviations.push(spread.fold(0.0, f64::max) + slack);
            }
            return;
        }
        let half = interval.half_width();
        let (from, to) = (self.point(segment), self.point(segment + 1));
        deviations.extend(from.iter().zip(to).map(|(a, b)| {
            let slack = if a == b { 0.0 } else { PATH_ROUNDING * (a.abs() + b.abs()) };
            (b - a).abs() * half * (1.0 + PATH_ROUNDING) + slack
        }));
        for variable in kinematics.variables().iter().filter(|variable| variable.kind == JointKind::Floating) {
            let own = variable.first..variable.first + 7;
            let (shift, turned) = Screw::new(&from[own.clone()], &to[own.clone()]).deviations(half);
            deviations[own.clone()].fill(0.0);
            (deviations[own.start], deviations[own.start + 3]) = (shift, turned);
        }
    }
}

/// Bound of the rounding of a value along a path, relative to the values at its ends; three
/// roundings a step of interpolation.
const PATH_ROUNDING: f64 = 8.0 * f64::EPSILON;
