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

use super::direction::{Angle, Direction, HERE, ON_AXIS, tangents};
use super::pair::CrossedCylinders;
use crate::measure::solver::exact_shape::cuboid_axes::ALIGNED;
use crate::measure::solver::exact_shape::cylinder_axes::EllipseArc;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Most candidates: nine that are known beforehand, and rims.
///
/// Fewer, rims are dropped, and the pair may be left to the general search; more take memory only.
const MOST_CANDIDATES: usize = 24;

/// Most steps of Newton's method.
///
/// Fewer, rims near an axis are not found, whose curvature changes fast; more are in vain. It
/// changes time only.
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

    /// Takes for the best, of those that overlap by as much but for rounding and are not elsewhere,
    /// the one with the fewest kinks: beside a kink that f falls from, it falls by less than
    /// rounding, and the normals differ.
    pub(super) fn choose(&mut self, pair: &CrossedCylinders, elsewhere: f64) {
        let best = self.best().direction;
        let kinks = |candidate: &Candidate| match candidate.place {
            Place::Rims => 0,
            Place::Circle(_) => 1,
            Place::Axis(_) | Place::Pole => 2,
        };
        let as_good = |candidate: &Candidate| {
            let Direction { n, overlap, .. } = candidate.direction;
            overlap <= best.overlap + pair.error && n.dot(&best.n) > elsewhere
        };
        let all = (0..self.count).filter(|&i| as_good(&self.all[i]));
        let chosen = all.min_by(|&i, &j| {
            let [p, q] = [&self.all[i], &self.all[j]];
            kinks(p).cmp(&kinks(q)).then(p.direction.overlap.total_cmp(&q.direction.overlap))
        });
        self.best = chosen.unwrap_or(self.best);
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
                let slope = self.smooth_at_axis(direction, i);
                (slope.norm() > self.radii[i]).then(|| slope * (-BESIDE_AXIS / slope.norm()))
            }
            Place::Circle(i) => {
                let falls = -self.least_slope(direction, candidate.place);
                let [.., bent] = self.form_on_circle(direction, i, HERE);
                let angle = (falls / (bent - direction.overlap).max(falls)).min(0.25);
                let slope = self.slope_across(direction, i);
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
            Place::Axis(_) => by_slope(self.least_slope(direction, place), lower).map(|cosine| Cap { cosine, lower }),
            Place::Pole => {
                let bent = lower - self.curvature(direction, [0.0, 1.0]);
                by_slope(self.least_slope(direction, place), bent).map(|cosine| Cap { cosine, lower })
            }
            Place::Circle(i) => {
                let slope = self.least_slope(direction, place);
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

    /// Whether the normal of a candidate is that of the least overlap to 1e-7: where f is smooth it
    /// curves enough, and at kinks it rises on all sides by more than rounding.
    pub(super) fn is_aligned(&self, candidate: &Candidate) -> bool {
        let Candidate { direction, place, .. } = candidate;
        let rises = || self.least_slope(direction, *place) > self.error;
        match *place {
            Place::Axis(_) => rises(),
            // What is across both axes is off by as much as these over the sine of their angle.
            Place::Pole => rises() && self.turned <= ALIGNED * self.sine,
            Place::Circle(i) => {
                let [along, _, across] = self.form_on_circle(direction, i, HERE).map(|bent| bent - direction.overlap);
                // Beside the circle, f is least where it rises no more.
                let falls = self.error - self.least_slope(direction, *place);
                self.error <= ALIGNED * along && (falls <= 0.0 || falls <= ALIGNED * across)
            }
            Place::Rims => self.error <= ALIGNED * (self.curvature(direction, HERE) - direction.overlap),
        }
    }

    /// The unit tangent at a candidate along which f rises least, or about that.
    pub(super) fn flattest(&self, candidate: &Candidate) -> Vector3<f64> {
        let Candidate { direction, place, .. } = candidate;
        let (e, f) = tangents(&direction.n);
        match *place {
            Place::Axis(i) => {
                let smooth = self.smooth_at_axis(direction, i);
                (smooth - direction.n * direction.n.dot(&smooth)).try_normalize(self.error).unwrap_or(e)
            }
            Place::Circle(i) => direction.n.cross(&self.axes[i]).normalize(),
            Place::Pole => e,
            Place::Rims => {
                let [first, mixed, last] = self.form(direction, (&e, &f), HERE);
                // Across the direction of the larger eigenvalue.
                let angle = 0.5 * (2.0 * mixed).atan2(first - last) + std::f64::consts::FRAC_PI_2;
                e * angle.cos() + f * angle.sin()
            }
        }
    }

    /// The least slope of f away from a kink, metres per radian: across it, or in any direction.
    fn least_slope(&self, direction: &Direction, place: Place) -> f64 {
        match place {
            Place::Axis(i) => self.radii[i] - self.smooth_at_axis(direction, i).norm(),
            Place::Circle(i) => self.half_heights[i] - self.slope_across(direction, i).abs(),
            Place::Pole => {
                // In coordinates along the axes.
                let second = self.between.y / self.sine;
                let first = self.between.x - second * self.axes[1].x;
                let [a, b] = self.half_heights;
                (a - first.abs()).min(b - second.abs()) * self.sine
            }
            Place::Rims => 0.0,
        }
    }

    /// The gradient along an axis of what has no kink there, and of another kink the subgradient
    /// with which it is shortest.
    fn smooth_at_axis(&self, direction: &Direction, i: usize) -> Vector3<f64> {
        let (j, mut smooth) = (1 - i, direction.gradient);
        if direction.cosines[j].abs() <= ON_AXIS {
            let (axis, half) = (&self.axes[j], self.half_heights[j]);
            smooth -= axis * half.copysign(direction.cosines[j]);
            smooth -= axis * smooth.dot(axis).clamp(-half, half);
        }
        smooth
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
