//! Newton's steps towards answers on flat sides.
//!
//! Where surfaces are flat to order `m + 1` on the way X to the answer their slopes are as `X^m`
//! and Newton's step is X / m: of what is left, `1 - 1 / m` is left after it. How much the step
//! changes along the way that was taken since the last one shows m, along each of the two principal
//! directions of the curvature, and the step is made that many times as long (the secant method for
//! the steps, which have simple zeros where slopes have multiple ones: Traub, Iterative Methods for
//! the Solution of Equations, 1964, section 7.3).
//!
//! Where that leads surfaces are flat, and if one is tilted against the other by next to nothing
//! the answer is where their slopes make up for it. Newton's step would lead far beyond; the power
//! law of the slopes leads back.

use crate::measure::frames::vector::{V3, add_scaled, basis, scaled};
use crate::measure::solver::tangent_newton::{NEAR, Symmetric2};
use crate::polynomial::{MAX_DEGREE, Scalar, Simd};
use nalgebra::{Matrix3, Vector3};

/// Length of a step relative to the one before, dimensionless, below which Newton's method
/// converges as it should and is left alone.
///
/// At a root of multiplicity m steps shrink by 1 - 1/m, that is by a half or more. Larger, series
/// are not recognised; smaller, steps of plain roots are lengthened. Exercised by
/// `steps_that_converge_fast_are_newtons`.
const FAST: f64 = 0.55;

/// Change of the step along the way, relative to that, dimensionless, of slopes that vanish with a
/// power: 1/m of a root of multiplicity m, from 7 at most to 2 at least, with room for rounding.
///
/// Wider, other steps are taken for a series; narrower, roots are missed. Exercised by
/// `flat_sides_take_few_steps_however_flat_and_however_tilted`.
const SLOW: std::ops::Range<f64> = 0.06..0.6;

/// Deviation of the logarithm of a slope from that of a power, relative to it; dimensionless.
///
/// Larger, steps are lengthened that are of no power; smaller, powers with a rest of higher order
/// are missed. Exercised by `flat_sides_take_few_steps_however_flat_and_however_tilted`.
const TOLERATED: f64 = 0.05;

/// Length of a step relative to Newton's step before it, dimensionless, from which one leads to
/// where surfaces are flat.
///
/// Smaller, usual steps are cut; larger, steps across flat sides are not. Exercised by
/// `flat_sides_take_few_steps_however_flat_and_however_tilted`.
const LEAP: f64 = 1.5;

/// Length of a step relative to the way taken before it, dimensionless, beyond which next to no
/// curvature has made it.
///
/// Smaller, usual steps are cut; larger, steps to nowhere are taken. Exercised by
/// `flat_sides_take_few_steps_however_flat_and_however_tilted`.
const WILD: f64 = 0.3;

/// Cosine of the angle to the last step below which a step leads back: 154 degrees.
///
/// Nearer to -1, oscillations that drift are not cut; nearer to 0, turns are. Exercised by
/// `oscillating_steps_meet_between`.
const BACK: f64 = -0.9;

/// Length of a step relative to the last step, dimensionless, that is about the same: of one that
/// leads back it is that of an oscillation, and longer ones are cut after a corrected one.
///
/// Wider, a wrong correction is followed by another, and steps are cut that converge or diverge by
/// themselves; narrower, series are cut that converge. Exercised by
/// `oscillating_steps_meet_between` and
/// `flat_sides_take_few_steps_however_flat_and_however_tilted`.
const AS_FAR: std::ops::Range<f64> = 0.5..2.0;

/// A vector along the tangents.
type V2 = [f64; 2];

/// What is known of the last step.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Last {
    /// Newton's step.
    pub(in crate::measure) newton: V2,
    /// The one that was taken.
    pub(in crate::measure) taken: V2,
    /// The slope that it was made from.
    pub(in crate::measure) slope: V2,
    /// Whether what was taken had been corrected.
    pub(in crate::measure) corrected: bool,
}

/// A series of steps along the tangents of surfaces.
#[derive(Clone, Copy, Default)]
pub(in crate::measure) struct Series {
    last: Last,
    /// The tangents along which it was made.
    tangents: [V3<f64>; 2],
    /// The last step that [`Series::take`] has scaled, whether of the series or not.
    way: V3<f64>,
}

impl Series {
    /// Whether Newton's next step is not so much shorter than the last that the answer is near.
    #[inline(always)]
    pub(in crate::measure) fn is_slow(&self, newton: V2) -> bool {
        let last = dot(self.last.newton, self.last.newton);
        last > 0.0 && dot(newton, newton) > FAST * FAST * last
    }

    /// Whether that step, this long relative to the bodies, may have to be corrected.
    #[inline(always)]
    pub(in crate::measure) fn may_have_to_be_corrected(&self, newton: V2, length: f64) -> bool {
        let last = dot(self.last.newton, self.last.newton);
        last > 0.0 && (self.last.corrected || length < NEAR && self.is_slow(newton))
    }

    /// Whether the last step has been corrected.
    #[inline(always)]
    pub(in crate::measure) fn is_corrected(&self) -> bool {
        self.last.corrected
    }

    /// What to add to Newton's step along these tangents, made from a slope by `compliance`.
    #[inline(always)]
    pub(in crate::measure) fn correction<S: Simd>(
        &self,
        simd: S,
        tangents: [V3<f64>; 2],
        (newton, slope): (V2, V2),
        compliance: Symmetric2<f64>,
    ) -> Correction {
        let Last { newton: last, taken, slope: from, corrected } = self.last;
        let last = along(simd, tangents, across(simd, self.tangents, last));
        let taken = along(simd, tangents, across(simd, self.tangents, taken));
        let from = along(simd, tangents, across(simd, self.tangents, from));
        correction(newton, slope, compliance, &Last { newton: last, taken, slope: from, corrected })
    }

    /// Takes down a step along these tangents.
    #[inline(always)]
    pub(in crate::measure) fn push(&mut self, tangents: [V3<f64>; 2], last: Last) {
        (self.tangents, self.last) = (tangents, last);
    }

    /// Takes down that the step was cut to this.
    #[inline(always)]
    pub(in crate::measure) fn took(&mut self, taken: V2) {
        self.last.taken = taken;
    }

    /// The part to take of a step along these tangents, this long relative to the bodies; see
    /// [`part`].
    #[inline(always)]
    pub(in crate::measure) fn part<S: Simd>(&self, simd: S, tangents: [V3<f64>; 2], step: V2, length: f64) -> f64 {
        if length > 2.0 * NEAR && !self.last.corrected {
            part(across(simd, self.tangents, self.last.taken), across(simd, tangents, step))
        } else {
            1.0
        }
    }

    /// What to take of a step that is made from a gradient by a Hessian: no more than is this long
    /// by `length`, which measures the step with what is added to it. Without tangents to move
    /// along, or where a step leads out of the series, that ends and nothing is added.
    pub(in crate::measure) fn take(
        &mut self,
        tangents: Option<[V3<f64>; 2]>,
        step: &Vector3<f64>,
        (gradient, hessian): (&Vector3<f64>, &Matrix3<f64>),
        longest: f64,
        length: impl Fn(&Vector3<f64>) -> f64,
    ) -> Taken {
        let newton = length(&Vector3::zeros());
        let (way, was_corrected) = (self.way, self.is_corrected());
        let more = match tangents.filter(|_| newton <= longest || self.is_corrected()) {
            Some(tangents) => self.corrected(tangents, step, newton, gradient, hessian),
            None => {
                *self = Self::default();
                Vector3::zeros()
            }
        };
        let taken = length(&more);
        let step: V3<f64> = (step + more).into();
        let part = if taken > 2.0 * NEAR && !was_corrected { part(way, step) } else { 1.0 };
        if taken > longest || part < 1.0 {
            *self = Self::default();
        }
        let share = (longest / taken).min(part);
        self.way = scaled::<Scalar, f64>(step, share);
        Taken { more, share, length: newton.min(taken) }
    }

    /// What to add to a step of this length along these tangents.
    fn corrected(
        &mut self,
        tangents: [V3<f64>; 2],
        step: &Vector3<f64>,
        length: f64,
        gradient: &Vector3<f64>,
        hessian: &Matrix3<f64>,
    ) -> Vector3<f64> {
        let simd = Scalar;
        let (newton, slope) = (along(simd, tangents, (*step).into()), along(simd, tangents, (*gradient).into()));
        let mut correction = Correction::default();
        if self.may_have_to_be_corrected(newton, length) {
            let [t, u] = tangents.map(Vector3::from);
            // Its principal directions are those of its inverse.
            let curvature = [t.dot(&(hessian * t)), t.dot(&(hessian * u)), u.dot(&(hessian * u))];
            correction = self.correction(simd, tangents, (newton, slope), curvature);
        }
        let Correction { longer, shorter } = correction;
        let more: Vector3<f64> = across(simd, tangents, [longer[0] + shorter[0], longer[1] + shorter[1]]).into();
        let taken = along(simd, tangents, (step + more).into());
        self.push(tangents, Last { newton, taken, slope, corrected: correction != Correction::default() });
        more
    }
}

/// What is taken of a step.
pub(in crate::measure) struct Taken {
    /// What is added to all of it.
    pub(in crate::measure) more: Vector3<f64>,
    /// The part of the sum that is taken.
    pub(in crate::measure) share: f64,
    /// Length of the step, or of that sum where it is shorter.
    pub(in crate::measure) length: f64,
}

/// Along what the active gradients of one body leave to move, a plane by one and a line by two,
/// where there is but one of the other body.
pub(in crate::measure) fn tangents(of_a: &[Vector3<f64>], of_b: &[Vector3<f64>]) -> Option<[V3<f64>; 2]> {
    match (of_a, of_b) {
        ([normal], [_]) => {
            let [t, u, _] = basis(Scalar, (*normal).into());
            Some([t, u])
        }
        ([one, other], [_]) | ([_], [one, other]) => Some([one.cross(other).try_normalize(0.0)?.into(), [0.0; 3]]),
        _ => None,
    }
}

/// The part to take of a step after this way: all of it, but where it leads back about as far. What
/// is looked for then lies between, and where steps would vanish that change evenly is as good a
/// guess as any: Newton's method alone may oscillate for ever.
#[inline(always)]
fn part(way: V3<f64>, step: V3<f64>) -> f64 {
    let (way, step) = (Vector3::from(way), Vector3::from(step));
    let (past, now) = (way.norm(), step.norm());
    let back = way.dot(&step) < BACK * past * now && AS_FAR.contains(&(now / past));
    if back { past / (past + now) } else { 1.0 }
}

/// Components of a vector along tangents.
#[inline(always)]
pub(in crate::measure) fn along<S: Simd>(_: S, [t0, t1]: [V3<f64>; 2], v: V3<f64>) -> V2 {
    [crate::measure::frames::vector::dot::<S, f64>(t0, v), crate::measure::frames::vector::dot::<S, f64>(t1, v)]
}

/// The vector with these components.
#[inline(always)]
pub(in crate::measure) fn across<S: Simd>(_: S, [t0, t1]: [V3<f64>; 2], v: V2) -> V3<f64> {
    add_scaled::<S, f64>(scaled::<S, f64>(t0, v[0]), v[1], t1)
}

/// What to add to Newton's step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::measure) struct Correction {
    /// Where it is too short: the change of surfaces over it decreases with a power.
    pub(in crate::measure) longer: V2,
    /// Where it is too long: what surfaces change by over that is as the step has it.
    pub(in crate::measure) shorter: V2,
}

/// What to add to Newton's step, which is `compliance` times the slope or nearly so.
#[cold]
pub(in crate::measure) fn correction(newton: V2, slope: V2, compliance: Symmetric2<f64>, last: &Last) -> Correction {
    // Where both surfaces are flat the one direction says how far to go in the other.
    let most = if last.corrected { AS_FAR.end * dot(last.taken, last.taken).sqrt() } else { f64::INFINITY };
    let mut correction = Correction::default();
    for direction in principal(compliance) {
        let [step, last_step, way] = [newton, last.newton, last.taken].map(|v| dot(v, direction));
        let change = (last_step - step) / way;
        let fall = (dot(slope, direction) / dot(last.slope, direction)).abs();
        let power = way / last_step;
        let length = if SLOW.contains(&change) && is_power(fall, step / last_step, 1.0 / change) {
            // A polynomial of degree d has slopes of power d - 1 at most.
            step * (1.0 / change).min((MAX_DEGREE - 1) as f64)
        } else if power > LEAP && fall > 0.0 && step.abs() > WILD * way.abs() {
            (way * (1.0 + 1.0 / fall).powf(-1.0 / power)).copysign(step)
        } else if step.abs() > most {
            most.copysign(step)
        } else {
            step
        };
        let part = if length.abs() < step.abs() { &mut correction.shorter } else { &mut correction.longer };
        part[0] += (length - step) * direction[0];
        part[1] += (length - step) * direction[1];
    }
    correction
}

/// Whether slopes decrease about as a power of the remaining way.
fn is_power(fall: f64, left: f64, power: f64) -> bool {
    let expected = power * left.abs().ln();
    (fall.ln() - expected).abs() < TOLERATED * expected.abs()
}

/// Eigenvectors of a symmetric matrix.
fn principal([xx, xy, yy]: Symmetric2<f64>) -> [V2; 2] {
    let half = 0.5 * (xx - yy);
    let root = (half * half + xy * xy).sqrt();
    // Of the two forms of the first one that which does not cancel.
    let along = if half >= 0.0 { [half + root, xy] } else { [xy, root - half] };
    let length = dot(along, along).sqrt();
    let [x, y] = if length > 0.0 { along.map(|entry| entry / length) } else { [1.0, 0.0] };
    [[x, y], [-y, x]]
}

#[inline(always)]
fn dot(a: V2, b: V2) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    /// Slopes `sign(u) |u|^power - tilt` along each of two perpendicular directions.
    struct Sides {
        direction: V2,
        power: [f64; 2],
        tilt: [f64; 2],
    }

    impl Sides {
        fn directions(&self) -> [V2; 2] {
            let [x, y] = self.direction;
            [[x, y], [-y, x]]
        }

        /// Newton's step from a point, its matrix and the slope.
        fn newton(&self, at: V2) -> (V2, Symmetric2<f64>, V2) {
            let (mut step, mut compliance, mut slope) = ([0.0; 2], [0.0; 3], [0.0; 2]);
            for (k, d) in self.directions().into_iter().enumerate() {
                let u = dot(at, d);
                let of = -(u.abs().powf(self.power[k]).copysign(u) - self.tilt[k]);
                let inverse = 1.0 / (self.power[k] * u.abs().powf(self.power[k] - 1.0) + 1e-20);
                for i in 0..2 {
                    slope[i] += of * d[i];
                    step[i] += of * inverse * d[i];
                }
                compliance[0] += inverse * d[0] * d[0];
                compliance[1] += inverse * d[0] * d[1];
                compliance[2] += inverse * d[1] * d[1];
            }
            (step, compliance, slope)
        }

        /// Steps until the slope is below 1e-9 of the first one's scale.
        fn steps(&self, mut at: V2, pace: bool) -> u32 {
            let mut last: Option<Last> = None;
            for count in 0..200 {
                let (newton, compliance, slope) = self.newton(at);
                if dot(slope, slope).sqrt() < 1e-9 {
                    return count;
                }
                let mut taken = newton;
                if let Some(last) = last.as_ref().filter(|_| pace) {
                    let Correction { longer, shorter } = correction(newton, slope, compliance, last);
                    taken = [0, 1].map(|i| newton[i] + longer[i] + shorter[i]);
                }
                let length = dot(taken, taken).sqrt();
                let most = (0.25 / length).min(1.0);
                taken = [taken[0] * most, taken[1] * most];
                at = [at[0] + taken[0], at[1] + taken[1]];
                last = Some(Last { newton, taken, slope, corrected: taken != newton });
            }
            200
        }
    }

    #[test]
    fn flat_sides_take_few_steps_however_flat_and_however_tilted() {
        let mut random = Seeded(31);
        let (mut most, mut sum, mut plain) = (0, 0, 0);
        let cases = 2000;
        for _ in 0..cases {
            let angle = 3.0 * random.signed();
            let power = [0, 1].map(|_| [1.0, 3.0, 5.0, 7.0][random.next() as usize % 4]);
            let tilt =
                [0, 1].map(|_| if random.signed() < 0.0 { 0.0 } else { 10_f64.powf(-8.5 + 3.5 * random.signed()) });
            let sides = Sides { direction: [angle.cos(), angle.sin()], power, tilt };
            let at = [0.3 * random.signed(), 0.3 * random.signed()];
            let steps = sides.steps(at, true);
            most = most.max(steps);
            sum += steps;
            plain += sides.steps(at, false);
        }
        assert!(most <= 14 && sum < 4 * cases, "seed 31: most {most}, {sum} steps in {cases} cases");
        assert!(sum * 3 < plain, "seed 31: {sum} steps, {plain} of Newton's");
    }

    /// Newton's method for the root of the arc tangent oscillates for ever from 1.3917, and ever
    /// farther from beyond.
    #[test]
    fn oscillating_steps_meet_between() {
        for start in [1.38, 1.391_745_2, 1.4, 1.5] {
            let (mut x, mut series) = (start, Series::default());
            for _ in 0..8 {
                let step = Vector3::new(-(1.0 + x * x) * f64::atan(x), 0.0, 0.0);
                let taken = series.take(None, &step, (&step, &Matrix3::identity()), 10.0, |more| (step + more).norm());
                x += (step.x + taken.more.x) * taken.share;
            }
            assert!(x.abs() < 1e-9, "from {start}: {x}");
        }
    }

    #[test]
    fn steps_that_converge_fast_are_newtons() {
        let last = Last { newton: [0.1, 0.0], taken: [0.1, 0.0], slope: [0.1, 0.0], corrected: false };
        let mut series = Series::default();
        assert!(!series.may_have_to_be_corrected([0.01, 0.001], 0.01), "the first");
        series.push([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], last);
        assert!(!series.may_have_to_be_corrected([0.01, 0.001], 0.01), "much shorter");
        assert!(!series.may_have_to_be_corrected([0.08, 0.001], 0.08), "far");
        assert!(series.may_have_to_be_corrected([0.08, 0.001], 0.01), "hardly shorter");
        let compliance = [1.0, 0.0, 1.0];
        assert_eq!(correction([0.01, 0.001], [0.01, 0.001], compliance, &last), Correction::default());
        // As much shorter as those of a power, but from slopes of none.
        assert_eq!(correction([0.07, 0.0], [0.07, 0.0], compliance, &last), Correction::default());
    }
}
