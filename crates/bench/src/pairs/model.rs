//! A shape of some kind about an object, as this library and others take it.

use nalgebra::Vector3;
use parry3d_f64::math::{Pose as ParryPose, Vector};
use parry3d_f64::shape::{HalfSpace as ParryHalfSpace, SharedShape};
use sublevel::body::{Body, BodyError};
use sublevel::fit::{FitOptions, ball};
use sublevel::measure::{
    Capsule, CapsuleDistance, Decision, HalfSpace, HalfSpaceDistance, Options, Pose, Status, WarmStart, distance,
    distance_of_capsule_to_half_space, distance_of_capsules, distance_to_capsule, distance_to_half_space, overlap,
    overlap_of_capsule_with_half_space, overlap_of_capsules, overlap_with_capsule, overlap_with_half_space,
};

use super::kind::Kind;
use crate::comparison::sweep::Answer;
use crate::comparison::{ComparisonError, FitCache, NoHull, PeerShape, Subject};

/// Slabs of a body that slabs cut.
const SLABS: usize = 6;

/// A shape about the origin or about its object.
pub(super) struct Model {
    form: Form,
    /// The same where other libraries have it, too.
    primitive: Option<PeerShape<'static>>,
    /// The vertices of the convex hull of the object, metres.
    hull: Vec<Vector3<f64>>,
}

enum Form {
    Body(Box<Body>),
    /// With a body that contains it, for motions.
    Capsule(Capsule, Box<Body>),
    /// The points with z at most 0, with the ball whose motions it takes.
    HalfSpace(HalfSpace, Box<Body>),
}

/// What is known of the distance of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    lower_m: f64,
    pub(super) upper_m: f64,
    /// From the second to the first.
    pub(super) normal: Option<Vector3<f64>>,
    pub(super) converged: bool,
    pub(super) iterations: u32,
}

impl Found {
    /// Of a shape from a half-space.
    fn above(half_space: &HalfSpace, found: &HalfSpaceDistance) -> Self {
        Self {
            lower_m: found.lower,
            upper_m: found.upper,
            normal: Some(*half_space.normal()),
            converged: found.status == Status::Converged,
            iterations: found.iterations,
        }
    }

    fn signed(found: &CapsuleDistance) -> Self {
        // How deep an axis is in a body is not measured; that they overlap is known.
        let settled = found.status == Status::Converged || found.upper <= 0.0;
        let (lower_m, upper_m) = (found.lower, found.upper);
        Self { lower_m, upper_m, normal: found.normal, converged: settled, iterations: found.iterations }
    }

    pub(super) fn answer(&self) -> Answer {
        Answer { iterations: Some(self.iterations), failed: !self.converged, overlap: self.upper_m <= 0.0 }
    }

    /// The decision that a signed distance is.
    #[inline]
    fn decision(lower_m: f64, upper_m: f64) -> Answer {
        Answer { iterations: None, failed: lower_m <= 0.0 && upper_m > 0.0, overlap: upper_m <= 0.0 }
    }
}

impl Model {
    /// The shape of a kind about an object.
    pub(super) fn build(kind: Kind, subject: &Subject, cache: &FitCache) -> Result<Self, ComparisonError> {
        let failed =
            |what: String| ComparisonError::Representation { mesh: subject.name, method: kind.name().into(), what };
        let fitted = |degree, slabs| {
            let options = FitOptions { degree, slabs, ..FitOptions::default() };
            cache.body(subject.name, &subject.mesh, &options)
        };
        let (low, high) =
            subject.hull.iter().fold((subject.hull[0], subject.hull[0]), |(l, h), v| (l.inf(v), h.sup(v)));
        // The longest along z.
        let mut half: [f64; 3] = ((high - low) * 0.5).into();
        half.sort_by(f64::total_cmp);
        let radius_m = 0.5 * (half[0] + half[1]);
        let body = |made: Result<Body, BodyError>| made.map(Box::new).map_err(|error| failed(error.to_string()));
        let smallest_ball = || {
            let around = ball(subject.name, &subject.hull).map_err(|error| failed(error.to_string()))?;
            let radius_m = around.body.circumscribed().radius;
            Ok::<_, ComparisonError>((body(Body::ball(subject.name, Vector3::zeros(), radius_m))?, radius_m))
        };
        let (form, primitive) = match kind {
            Kind::Ball => {
                let (made, radius_m) = smallest_ball()?;
                (Form::Body(made), Some(PeerShape::Ball { radius_m }))
            }
            Kind::HalfSpace => {
                let half_space = HalfSpace::new(Vector3::z(), 0.0).map_err(|error| failed(error.to_string()))?;
                (Form::HalfSpace(half_space, smallest_ball()?.0), None)
            }
            Kind::Degree(degree) => (Form::Body(Box::new(fitted(degree, 0)?)), None),
            Kind::SlabCut => (Form::Body(Box::new(fitted(6, SLABS)?)), None),
            Kind::Cuboid => {
                let half_extents_m = half.into();
                (
                    Form::Body(body(Body::cuboid(subject.name, half_extents_m))?),
                    Some(PeerShape::Cuboid { half_extents_m }),
                )
            }
            Kind::Cylinder => {
                let made = body(Body::cylinder(subject.name, radius_m, half[2]))?;
                (Form::Body(made), Some(PeerShape::Cylinder { radius_m, half_height_m: half[2] }))
            }
            Kind::Capsule => {
                let radius_m = radius_m.min(0.75 * half[2]);
                let half_height_m = half[2] - radius_m;
                let capsule = Capsule::new(radius_m, half_height_m).map_err(|error| failed(error.to_string()))?;
                let around = body(Body::cylinder(subject.name, radius_m, half[2]))?;
                (Form::Capsule(capsule, around), Some(PeerShape::Capsule { radius_m, half_height_m }))
            }
        };
        Ok(Self { form, primitive, hull: subject.hull.clone() })
    }

    /// A body that is the shape or contains it; of a half-space a ball.
    pub(super) fn body(&self) -> &Body {
        match &self.form {
            Form::Body(body) | Form::Capsule(_, body) | Form::HalfSpace(_, body) => body,
        }
    }

    pub(super) fn is_half_space(&self) -> bool {
        matches!(self.form, Form::HalfSpace(..))
    }

    /// The shape as coal's program takes it: itself, or the convex hull of its object; it knows no
    /// half-spaces.
    pub(super) fn coal(&self) -> Option<PeerShape<'_>> {
        (!self.is_half_space()).then(|| self.primitive.unwrap_or(PeerShape::Hull(&self.hull)))
    }

    /// The shape as parry takes it, with its frame in ours.
    pub(super) fn parry(&self) -> Result<(SharedShape, ParryPose), NoHull> {
        match self.coal() {
            Some(shape) => shape.parry(),
            None => Ok((SharedShape::new(ParryHalfSpace::new(Vector::new(0.0, 0.0, 1.0))), ParryPose::IDENTITY)),
        }
    }

    /// Distance of this shape where it is from another at `pose`, signed with a capsule. A
    /// half-space stays where it is, and this shape is at `pose`; the distance is signed.
    #[inline]
    pub(super) fn distance(&self, other: &Self, pose: &Pose, warm: &mut WarmStart) -> Found {
        let (origin, options) = (Pose::identity(), Options::default());
        match (&self.form, &other.form) {
            (Form::Body(a), Form::Body(b)) => {
                let found = distance(&**a, &origin, &**b, pose, &options, warm);
                Found {
                    lower_m: found.lower,
                    upper_m: found.upper,
                    normal: found.normal,
                    converged: found.status == Status::Converged,
                    iterations: found.iterations,
                }
            }
            (Form::Body(a), Form::HalfSpace(half_space, _)) => {
                Found::above(half_space, &distance_to_half_space(&**a, pose, half_space, &options, warm))
            }
            (Form::Capsule(a, _), Form::HalfSpace(half_space, _)) => {
                Found::above(half_space, &distance_of_capsule_to_half_space(a, pose, half_space, &options))
            }
            // Never the first of a pair: from what contains the other.
            (Form::HalfSpace(half_space, _), _) => {
                let found = distance_to_half_space(other.body(), pose, half_space, &options, warm);
                Found { normal: Some(-half_space.normal()), ..Found::above(half_space, &found) }
            }
            (Form::Body(a), Form::Capsule(b, _)) => {
                Found::signed(&distance_to_capsule(&**a, &origin, b, pose, &options, warm))
            }
            (Form::Capsule(a, _), Form::Body(b)) => {
                let found = Found::signed(&distance_to_capsule(&**b, pose, a, &origin, &options, warm));
                Found { normal: found.normal.map(|n| -n), ..found }
            }
            (Form::Capsule(a, _), Form::Capsule(b, _)) => {
                Found::signed(&distance_of_capsules(a, &origin, b, pose, &options))
            }
        }
    }

    /// Whether both overlap, from nothing but the pose.
    #[inline]
    pub(super) fn overlap(&self, other: &Self, pose: &Pose) -> Answer {
        let (origin, options, warm) = (Pose::identity(), Options::default(), &mut WarmStart::default());
        let found = match (&self.form, &other.form) {
            (Form::Body(a), Form::Body(b)) => overlap(&**a, &origin, &**b, pose, &options, warm),
            (Form::Body(a), Form::Capsule(b, _)) => overlap_with_capsule(&**a, &origin, b, pose, &options, warm),
            (Form::Capsule(a, _), Form::Body(b)) => overlap_with_capsule(&**b, pose, a, &origin, &options, warm),
            (Form::Capsule(a, _), Form::Capsule(b, _)) => overlap_of_capsules(a, &origin, b, pose),
            (Form::Body(a), Form::HalfSpace(half_space, _)) => {
                overlap_with_half_space(&**a, pose, half_space, &options, warm)
            }
            (Form::Capsule(a, _), Form::HalfSpace(half_space, _)) => {
                overlap_of_capsule_with_half_space(a, pose, half_space)
            }
            // Never the first of a pair.
            (Form::HalfSpace(..), _) => {
                let found = self.distance(other, pose, warm);
                return Found::decision(found.lower_m, found.upper_m);
            }
        };
        Answer {
            iterations: None,
            failed: matches!(found, Decision::Undecided { .. }),
            overlap: found == Decision::Yes,
        }
    }
}
