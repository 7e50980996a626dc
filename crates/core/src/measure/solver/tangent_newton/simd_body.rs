//! Bodies as Newton's method for distances sees them: each in its normalized coordinates, B where
//! it stands as seen from A.

use crate::body::{Body, ConstraintTrust};
use crate::measure::frames::pose::{Pose, RELATIVE_QUATERNION_ERROR};
use crate::measure::frames::vector::{
    M3, V3, add_scaled, apply, apply_symmetric, apply_transposed, dot, rows, subtract, times_transposed,
};
use crate::polynomial::{Number, NumberJet, Simd, gamma};
use nalgebra::Vector3;

/// Where B stands as seen from A.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Relative<N> {
    /// Rotation from B's frame to A's.
    pub(in crate::measure) rotation: M3<N>,
    /// Centre of B's normalization in the query frame.
    pub(in crate::measure) origin: V3<N>,
    /// Bound of the displacement of a computed z of B within its ball, metres.
    pub(in crate::measure) displacement: N,
}

impl Relative<f64> {
    /// B at `pose_b` as seen from A at `pose_a`.
    #[inline(always)]
    pub(in crate::measure) fn new<S: Simd>(simd: S, a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> Self {
        // Differences of translations are exact to one rounding, however far from the world origin.
        let conjugate = pose_a.rotation().conjugate();
        let moved = conjugate * (pose_b.translation() - pose_a.translation());
        let rotation = (conjugate * pose_b.rotation()).to_rotation_matrix();
        let home = (&a.normalization().center, a.trust().center);
        Self::from_parts(simd, home, rows(simd, rotation.matrix()), [moved.x, moved.y, moved.z], b)
    }
}

impl<N: Copy> Relative<N> {
    /// B turned by `rotation` and then moved by `translation`, as seen from a point of A's frame
    /// (metres) with its distance from the origin there.
    #[inline(always)]
    pub(in crate::measure) fn from_parts<S: Simd>(
        simd: S,
        (center_a, center_norm): (&Vector3<f64>, f64),
        rotation: M3<N>,
        translation: V3<N>,
        b: &Body,
    ) -> Self
    where
        N: Number<S>,
    {
        let splat = |v: &Vector3<f64>| [N::splat(simd, v.x), N::splat(simd, v.y), N::splat(simd, v.z)];
        let turned = apply(&rotation, splat(&b.normalization().center));
        let from = splat(center_a);
        let mut origin = from;
        for i in 0..3 {
            origin[i] = turned[i] + (translation[i] - from[i]);
        }
        let trust = b.trust();
        let fixed = (RELATIVE_QUATERNION_ERROR + trust.rounding) * trust.reach
            + RELATIVE_QUATERNION_ERROR * trust.center
            + gamma(8) * center_norm;
        let far = translation[0].abs() + translation[1].abs() + translation[2].abs();
        Self {
            rotation,
            origin,
            displacement: N::splat(simd, RELATIVE_QUATERNION_ERROR + gamma(8))
                .mul_add(far, N::splat(simd, fixed * (1.0 + 1e-13))),
        }
    }
}

/// A body in the query frame: its map to normalized coordinates and what is known near it.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Side<'a, N> {
    pub(super) body: &'a Body,
    /// Which of the constraints is active.
    pub(in crate::measure) active: usize,
    /// What is known of it near the body.
    trust: &'a ConstraintTrust,
    linear: M3<N>,
    origin: V3<N>,
    pub(in crate::measure) displacement: N,
}

impl<'a, N: Copy> Side<'a, N> {
    /// The body whose frame the query frame is.
    #[inline(always)]
    pub(in crate::measure) fn at_home<S: Simd>(simd: S, body: &'a Body, active: usize) -> Self
    where
        N: Number<S>,
    {
        let zero = N::splat(simd, 0.0);
        Self {
            body,
            active,
            trust: &body.trust().constraints[active],
            linear: rows(simd, &body.normalization().linear),
            origin: [zero; 3],
            displacement: N::splat(simd, body.trust().rounding * body.trust().reach),
        }
    }

    /// The other body.
    #[inline(always)]
    pub(in crate::measure) fn away<S: Simd>(simd: S, body: &'a Body, active: usize, relative: &Relative<N>) -> Self
    where
        N: Number<S>,
    {
        let Relative { rotation, origin, displacement } = *relative;
        let linear = times_transposed(&rows(simd, &body.normalization().linear), &rotation);
        Self { body, active, trust: &body.trust().constraints[active], linear, origin, displacement }
    }

    /// The body with another of its constraints as the active one.
    #[inline(always)]
    pub(in crate::measure) fn with_active(&self, active: usize) -> Self {
        Self { active, trust: &self.body.trust().constraints[active], ..*self }
    }

    /// The body with a constraint of which this is known, in place of the active one.
    #[inline(always)]
    pub(in crate::measure) fn with_trust<'b>(&self, trust: &'b ConstraintTrust) -> Side<'b, N>
    where
        'a: 'b,
    {
        Side { trust, ..*self }
    }

    #[inline(always)]
    pub(in crate::measure) fn body(&self) -> &'a Body {
        self.body
    }

    #[inline(always)]
    pub(super) fn trust(&self) -> &'a ConstraintTrust {
        self.trust
    }

    /// The active constraint at a point in its normalized coordinates, and whether the point lies
    /// in the ball of the body's [`crate::body::Trust`].
    #[inline(always)]
    pub(in crate::measure) fn jet<S: Simd>(&self, simd: S, v: V3<N>) -> (NumberJet<N>, N::Mask)
    where
        N: Number<S>,
    {
        let z = apply(&self.linear, subtract(v, self.origin));
        let radius = self.body.trust().radius;
        let inside = dot(z, z).le(N::splat(simd, radius * radius));
        (self.body.constraints()[self.active].polynomial.jet(simd, z), inside)
    }

    /// The vectors of the basis, each in normalized coordinates.
    #[inline(always)]
    pub(in crate::measure) fn localize<S: Simd>(&self, _: S, basis: &M3<N>) -> M3<N>
    where
        N: Number<S>,
    {
        [apply(&self.linear, basis[0]), apply(&self.linear, basis[1]), apply(&self.linear, basis[2])]
    }
}

impl Side<'_, f64> {
    /// The normalized coordinates of a point.
    #[inline(always)]
    pub(in crate::measure) fn normalized<S: Simd>(&self, _: S, v: V3<f64>) -> V3<f64> {
        apply::<S, f64>(&self.linear, subtract::<S, f64>(v, self.origin))
    }

    /// The gradient by points of the query frame, per metre.
    #[inline(always)]
    pub(in crate::measure) fn gradient<S: Simd>(&self, _: S, jet: &NumberJet<f64>) -> V3<f64> {
        apply_transposed::<S, f64>(&self.linear, jet.gradient)
    }

    /// The Hessian by points of the query frame, per square metre: xx, xy, xz, yy, yz, zz.
    #[inline(always)]
    pub(in crate::measure) fn hessian<S: Simd>(&self, _: S, jet: &NumberJet<f64>) -> [f64; 6] {
        let column = |j: usize| [self.linear[0][j], self.linear[1][j], self.linear[2][j]];
        let columns = [column(0), column(1), column(2)];
        let bent = columns.map(|column| apply_symmetric::<S, f64>(&jet.hessian, column));
        let entry = |i: usize, j: usize| dot::<S, f64>(columns[i], bent[j]);
        [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
    }

    /// Bound of the relative error of a gradient by the rounding of the body's map and of the pose.
    #[inline(always)]
    pub(in crate::measure) fn turn(&self) -> f64 {
        RELATIVE_QUATERNION_ERROR + gamma(64) * self.body.trust().condition
    }

    /// The point itself if it lies in the ball of the body's [`crate::body::Trust`], else about
    /// where the line to the centre meets the surface, by the value of the active constraint at the
    /// point.
    #[inline(always)]
    pub(in crate::measure) fn brought_near<S: Simd>(&self, _: S, v: V3<f64>, value: f64) -> V3<f64> {
        let from = subtract::<S, f64>(v, self.origin);
        let z = apply::<S, f64>(&self.linear, from);
        let fraction = self.body.trust().radius / dot::<S, f64>(z, z).sqrt();
        if fraction >= 1.0 {
            return v;
        }
        // Well inside the ball, or rounding would leave it outside.
        let fraction = (0.97 * fraction).min(self.share_within(value));
        add_scaled::<S, f64>(self.origin, fraction, from)
    }

    /// About where the line from a point outside of the body to the centre meets the surface, by
    /// the value of the active constraint at the point, which is left where it is if it is inside.
    #[inline(always)]
    pub(in crate::measure) fn on_the_surface<S: Simd>(&self, _: S, v: V3<f64>, value: f64) -> V3<f64> {
        let from = subtract::<S, f64>(v, self.origin);
        add_scaled::<S, f64>(self.origin, self.share_within(value).min(1.0), from)
    }

    /// Which part of the way from the centre to a point with this value of the active constraint
    /// lies in the body, about: values rise with the power of their degree.
    #[inline(always)]
    fn share_within(&self, value: f64) -> f64 {
        let degree = self.body.constraints()[self.active].polynomial.degree() as f64;
        value.powf(-1.0 / degree)
    }

    /// Square of a step in the basis that `local` is of, in normalized coordinates, relative to the
    /// body's size there: however thin a body is, its surface bends about as much over all steps of
    /// the same relative length.
    #[inline(always)]
    pub(in crate::measure) fn relative_square<S: Simd>(&self, _: S, local: &M3<f64>, step: V3<f64>) -> f64 {
        let delta = apply_transposed::<S, f64>(local, step);
        dot::<S, f64>(delta, delta) / self.body.trust().radius.powi(2)
    }

    /// The largest of the constraints at v, as computed, and a bound of it for v itself: of what
    /// the rounding of the body's map displaces points by it rises no more than its slope allows.
    /// Not numbers outside of the ball of the body's [`crate::body::Trust`].
    #[inline(always)]
    pub(in crate::measure) fn highest<S: Simd>(&self, simd: S, v: V3<f64>) -> [f64; 2] {
        let displaced = self.displacement * (1.0 + 1e-14);
        let mut highest = [f64::NEG_INFINITY; 2];
        for (i, trust) in self.body.trust().constraints.iter().enumerate() {
            let (jet, inside) = self.with_active(i).jet(simd, v);
            let gradient = self.gradient(simd, &jet);
            let slope = dot::<S, f64>(gradient, gradient).sqrt() * (1.0 + self.turn()) + trust.gradient_error;
            let raised = displaced * (slope + trust.curvature_ceiling * displaced) * (1.0 + 1e-13);
            let bound = jet.value + trust.value_error + raised;
            // The larger of a number and none would be the number.
            if !inside || bound.is_nan() {
                return [f64::NAN; 2];
            }
            highest = [highest[0].max(jet.value), highest[1].max(bound)];
        }
        highest
    }

    /// Whether all constraints but the active one are proven to hold at (a point within the
    /// displacement of) v.
    #[inline(always)]
    pub(in crate::measure) fn others_hold<S: Simd>(&self, simd: S, v: V3<f64>) -> bool {
        let mut hold = true;
        if self.body.constraints().len() > 1 {
            for i in (0..self.body.constraints().len()).filter(|&i| i != self.active) {
                let (jet, inside) = self.with_active(i).jet(simd, v);
                hold &= inside && jet.value + self.body.trust().constraints[i].value_error <= 1.0;
            }
        }
        hold
    }
}
