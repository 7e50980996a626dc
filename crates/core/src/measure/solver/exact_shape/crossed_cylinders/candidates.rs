//! Directions along which two cylinders may overlap least, and how far around each of them they
//! overlap by no less.
//!
//! On the circle across an axis, the overlap is that of a disc and the shadow of the other cylinder
//! along the axis, which an ellipse ends: [`EllipseArc`]. Between rims, Newton's method finds the
//! least nearby.
//!
//! About a candidate n, f is nowhere less up to the angle β if along all tangents τ
//!
//! ```text
//! f'(n; τ) >= (f(n) - ρ(τ)) tan(β/2),
//! ```
//!
//! ρ a lower bound of the curvature up to β. Along an axis and at the pole the slope is at least k
//! along all of them, and `tan(β/2) = k / (f - λ)`. On a circle it is `k |sin ω|` at the angle ω
//! with it, and with A, B, C the factors of the form of ρ it is enough that
//! `k / tan(β/2) >= B² / (A - f) + max(f - C, 0)`.

use super::CrossedCylinders;
use super::direction::{Angle, Direction, HERE, ON_AXIS, tangents};
use crate::measure::solver::exact_shape::cylinder_axes::EllipseArc;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Most candidates: nine that are known beforehand, and rims.
const MOST_CANDIDATES: usize = 24;

/// Most steps of Newton's method.
const MOST_STEPS: u32 = 12;

/// Length of a step of Newton's method, radians, after which the direction is known to rounding.
///
/// Larger, it is not; smaller, a step more is taken. It changes time only.
const CONVERGED: f64 = 1e-9;

/// Cosine of the largest angle of caps, dimensionless.
///
/// Smaller, caps of candidates that are not near are worked out; larger, more triangles are looked
/// at. It changes time only.
const WIDEST: f64 = 0.5;

/// Most halvings of the versine of an angle in the search for a cap.
///
/// Fewer, triangles about candidates that are all but flat come to nothing; more are in vain where
/// there is no cap. It changes time only.
const MOST_HALVINGS: u32 = 16;

/// How far from an axis Newton's method starts where f falls from it, radians.
///
/// Larger or smaller, more searches end elsewhere, and the place is found from triangles. It
/// changes time only.
const BESIDE_AXIS: f64 = 0.1;

/// Square of the distance of two unit vectors up to which they are the same candidate.
///
/// Larger, candidates with caps of their own would be dropped; smaller, one is kept many times. It
/// changes time only.
const SAME_SQUARED: f64 = 1e-14;

/// Where f may be least.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// Along this axis.
    Axis(usize),
    /// On the circle across this axis.
    Circle(usize),
    /// Across both axes.
    Pole,
    /// Where it is smooth.
    Rims,
}

/// Directions about a candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cap {
    /// Of the angle up to which they are.
    pub(super) cosine: f64,
    /// Along none of them is the overlap less, metres: that of the candidate but for rounding.
    pub(super) lower: f64,
}

/// A direction along which the cylinders may overlap least.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) direction: Direction,
    pub(super) place: Place,
    /// Once it was asked for.
    cap: Option<Option<Cap>>,
}

/// All candidates that are known, and the best of them.
pub(super) struct Candidates {
    all: [Candidate; MOST_CANDIDATES],
    count: usize,
    best: usize,
}

impl Candidates {
    /// All but rims, and those rims that f falls towards from the others.
    pub(super) fn new(pair: &CrossedCylinders) -> Self {
        let pole = Candidate { direction: pair.along(Vector3::z()), place: Place::Pole, cap: None };
        let mut candidates = Self { all: [pole; MOST_CANDIDATES], count: 1, best: 0 };
        let across = [[0.0, 1.0], [-pair.axes[1].y, pair.axes[1].x]];
        for (i, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
            candidates.push(pair, pair.along(pair.axes[i] * sign), Place::Axis(i));
            let [x, y] = across[i].map(|component| sign * component);
            let level = pair.between.x * x + pair.between.y * y - pair.half_heights[1 - i] * pair.sine;
            let arc = EllipseArc {
                radius: pair.radii[1 - i],
                zeta: pair.axes[1].x,
                w: [pair.between.z, level],
                ends: [0.0, f64::INFINITY],
            };
            if let Some((u, _)) = arc.least(gamma(32) * pair.reach) {
                candidates.push(pair, pair.along(Vector3::new(x, y, u) / u.hypot(1.0)), Place::Circle(i));
            }
        }
        candidates
    }

    /// One more, and where f falls towards from it.
    pub(super) fn push(&mut self, pair: &CrossedCylinders, direction: Direction, place: Place) {
        let is_known = self.iter().any(|other| (other.direction.n - direction.n).norm_squared() < SAME_SQUARED);
        if is_known || self.count == MOST_CANDIDATES {
            return;
        }
        let candidate = Candidate { direction, place, cap: None };
        self.all[self.count] = candidate;
        if direction.overlap < self.best().direction.overlap {
            self.best = self.count;
        }
        self.count += 1;
        if let Some(rims) = pair.beside(&candidate).and_then(|start| pair.newton(start)) {
            self.push(pair, rims, Place::Rims);
        }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Candidate> {
        self.all[..self.count].iter()
    }

    pub(super) fn best(&self) -> &Candidate {
        &self.all[self.best]
    }

    /// How far places have to be off for the normal of the best to be off by a radian, metres.
    pub(super) fn best_arm(&self, pair: &CrossedCylinders) -> f64 {
        let Candidate { direction, place, .. } = self.best();
        match *place {
            Place::Axis(_) => f64::INFINITY,
            // Axes are off by an angle, and what is across both by that over the sine of theirs.
            Place::Pole => pair.sine * pair.reach,
            Place::Circle(i) => pair.form_on_circle(direction, i, HERE)[0] - direction.overlap,
            Place::Rims => pair.curvature(direction, HERE) - direction.overlap,
        }
    }

    /// A lower bound of f, metres, in a cone of directions that is in the cap of a candidate.
    pub(super) fn bound_within_cap(&mut self, pair: &CrossedCylinders, edges: &[Vector3<f64>; 3]) -> Option<f64> {
        self.all[..self.count].iter_mut().find_map(|candidate| {
            let Candidate { direction, place, cap } = candidate;
            let farthest = edges.iter().map(|n| n.dot(&direction.n)).fold(1.0, f64::min);
            if farthest < WIDEST {
                return None;
            }
            let cap = (*cap.get_or_insert_with(|| pair.cap(direction, *place)))?;
            (farthest >= cap.cosine).then_some(cap.lower)
        })
    }
}

impl CrossedCylinders {
    /// The least of f near a direction between rims; none where Newton's method leads to none.
    pub(super) fn newton(&self, start: Direction) -> Option<Direction> {
        let mut now = start;
        for _ in 0..MOST_STEPS {
            let (e, f) = tangents(&now.n);
            let [first, mixed, last] = self.form(&now, (&e, &f), HERE);
            let (p, q) = (first - now.overlap, last - now.overlap);
            let determinant = p * q - mixed * mixed;
            if !(p > 0.0 && determinant > 0.0) {
                return None;
            }
            let (u, v) = (now.gradient.dot(&e), now.gradient.dot(&f));
            let step = (e * (mixed * v - q * u) + f * (mixed * u - p * v)) / determinant;
            let length = step.norm();
            // The form changes over distances from the axes.
            let share = (0.5 * now.sines[0].min(now.sines[1]) / length).min(1.0);
            let next = self.along((now.n + step * share).normalize());
            let is_beyond_circle = (0..2).any(|i| next.cosines[i] * start.cosines[i] <= 0.0);
            if next.n.z < 0.0 || is_beyond_circle {
                return None;
            }
            now = next;
            if length < CONVERGED {
                return Some(now);
            }
        }
        None
    }

    /// Where Newton's method starts beside a candidate that f falls from.
    fn beside(&self, candidate: &Candidate) -> Option<Direction> {
        let direction = &candidate.direction;
        let step = match candidate.place {
            Place::Axis(i) => {
                let slope = direction.gradient.norm();
                (slope > self.radii[i]).then(|| direction.gradient * (-BESIDE_AXIS / slope))
            }
            Place::Circle(i) => {
                let slope = self.slope_across(direction, i);
                let falls = slope.abs() - self.half_heights[i];
                let [.., bent] = self.form_on_circle(direction, i, HERE);
                let angle = (falls / (bent - direction.overlap).max(falls)).min(0.25);
                (falls > 0.0).then(|| self.axes[i] * -angle.copysign(slope))
            }
            Place::Pole | Place::Rims => None,
        }?;
        Some(self.along((direction.n + step).normalize()))
    }

    /// The directions about a candidate up to an angle at which none is less.
    pub(super) fn cap(&self, direction: &Direction, place: Place) -> Option<Cap> {
        let lower = direction.overlap;
        match place {
            Place::Axis(i) => {
                // Of what has no kink there, and of kinks the subgradient that is least steep.
                let (j, mut smooth) = (1 - i, direction.gradient);
                if direction.cosines[j].abs() <= ON_AXIS {
                    let (axis, half) = (&self.axes[j], self.half_heights[j]);
                    smooth -= axis * half.copysign(direction.cosines[j]);
                    smooth -= axis * smooth.dot(axis).clamp(-half, half);
                }
                by_slope(self.radii[i] - smooth.norm(), lower).map(|cosine| Cap { cosine, lower })
            }
            Place::Pole => {
                // In coordinates along the axes.
                let second = self.between.y / self.sine;
                let first = self.between.x - second * self.axes[1].x;
                let [a, b] = self.half_heights;
                let slope = (a - first.abs()).min(b - second.abs()) * self.sine;
                let curvature = self.curvature(direction, [0.0, 1.0]);
                by_slope(slope, lower - curvature).map(|cosine| Cap { cosine, lower })
            }
            Place::Circle(i) => {
                let slope = self.half_heights[i] - self.slope_across(direction, i).abs();
                let rest = direction.gradient.dot(&direction.n.cross(&self.axes[i])).abs();
                widest(|[cosine, sine]| {
                    let [first, mixed, last] = self.form_on_circle(direction, i, [cosine, sine]);
                    let steep = first - lower;
                    let enough =
                        steep > 0.0 && slope * (1.0 + cosine) / sine >= mixed * mixed / steep + (lower - last).max(0.0);
                    enough.then_some(lower - rest * sine)
                })
            }
            Place::Rims => widest(|angle| {
                let bound = self.bound(direction, angle);
                (bound >= lower - 0.5 * self.error).then_some(bound)
            }),
        }
    }

    /// The slope of f across a circle, metres per radian, along its axis, but for the kink.
    fn slope_across(&self, direction: &Direction, i: usize) -> f64 {
        direction.gradient.dot(&self.axes[i]) - self.half_heights[i].copysign(direction.cosines[i])
    }

    /// The form of curvatures on a circle: along it first, across it last.
    fn form_on_circle(&self, direction: &Direction, i: usize, angle: Angle) -> [f64; 3] {
        let axis = &self.axes[i];
        self.form(direction, (&direction.n.cross(axis), &-axis), angle)
    }
}

/// Cosine of the angle β with `tan(β/2) = slope / bent`, up to the widest.
fn by_slope(slope: f64, bent: f64) -> Option<f64> {
    let (slope_squared, bent_squared) = (slope * slope, bent * bent);
    let cosine = || (bent_squared - slope_squared) / (bent_squared + slope_squared);
    (slope > 0.0).then(|| if bent <= slope { WIDEST } else { cosine().max(WIDEST) })
}

/// The cap of the largest of some angles at which there is a bound.
fn widest(bound: impl Fn(Angle) -> Option<f64>) -> Option<Cap> {
    let mut versine = 1.0 - WIDEST;
    for _ in 0..MOST_HALVINGS {
        let cosine = 1.0 - versine;
        if let Some(lower) = bound([cosine, (versine * (1.0 + cosine)).sqrt()]) {
            return Some(Cap { cosine, lower });
        }
        versine *= 0.5;
    }
    None
}
