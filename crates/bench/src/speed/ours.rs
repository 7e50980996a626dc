//! Our representations of an object: all contain it, and this is proven when they are made.

use super::cover::cover;
use super::round::{smallest_capsule, smallest_cylinder};
use crate::comparison::ComparisonError;
use crate::comparison::FitCache;
use crate::comparison::Subject;
use nalgebra::{Matrix3, Vector3};
use std::ops::ControlFlow;
use sublevel::body::{Body, BodyError, Normalization, Shape};
use sublevel::fit::{FitOptions, OrientedBox, ball, fit_parts, smallest_box};
use sublevel::measure::{Capsule, Pose};

/// How an object is represented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// The smallest ball.
    Ball,
    /// The box along the axes of the object's frame.
    AxisBox,
    /// The smallest box at any orientation.
    OrientedBox,
    /// The smallest cylinder about an axis of that box.
    Cylinder,
    /// The smallest capsule about an axis of that box.
    Capsule,
    /// A body of a degree with the least log det, its volume refined or not.
    Body { degree: usize, refine: bool },
    /// A body of a degree, cut by slabs.
    Slabs { degree: usize, slabs: usize },
    /// A compound of so many bodies of a degree.
    Parts { parts: usize, degree: usize },
    /// So many balls over the surface.
    Balls(usize),
}

/// Two objects as they are represented.
pub(super) enum Models {
    Shapes([Shape; 2]),
    /// With their frames in those of the objects.
    Capsules([(Capsule, Pose); 2]),
}

impl Models {
    /// The shapes; none of capsules.
    pub(super) fn shapes(&self) -> Option<(&Shape, &Shape)> {
        match self {
            Self::Shapes([a, b]) => Some((a, b)),
            Self::Capsules(_) => None,
        }
    }
}

/// A box is made larger by this part: rounding leaves no point outside.
const SLACK: f64 = 1e-12;

impl Method {
    /// All of them, or those of a quick run, which are fitted in seconds.
    pub(super) fn all(quick: bool) -> Vec<Self> {
        let plain = |degree| Self::Body { degree, refine: false };
        let refined = |degree| Self::Body { degree, refine: true };
        let parts = |parts, degree| Self::Parts { parts, degree };
        let mut all = vec![Self::Ball, Self::AxisBox, Self::OrientedBox, Self::Cylinder, Self::Capsule];
        all.extend([2, 4, 6].map(plain));
        all.extend([4, 6].map(refined));
        all.push(Self::Slabs { degree: 4, slabs: 4 });
        all.extend([parts(4, 4), Self::Balls(32)]);
        if !quick {
            all.extend([plain(8), refined(8)]);
            all.extend([Self::Slabs { degree: 2, slabs: 3 }, Self::Slabs { degree: 6, slabs: 6 }]);
            all.extend([parts(8, 4), parts(16, 4), Self::Balls(128)]);
        }
        all
    }

    /// Name for people.
    pub(super) fn name(self) -> String {
        match self {
            Self::Ball => "ball".into(),
            Self::AxisBox => "axis-aligned box".into(),
            Self::OrientedBox => "oriented box".into(),
            Self::Cylinder => "cylinder".into(),
            Self::Capsule => "capsule".into(),
            Self::Body { degree: 2, .. } => "ellipsoid".into(),
            Self::Body { degree, refine: false } => format!("degree {degree}"),
            Self::Body { degree, refine: true } => format!("degree {degree}, refined"),
            Self::Slabs { degree, slabs } => format!("degree {degree}, {slabs} slabs"),
            Self::Parts { parts, degree } => format!("compound of {parts}, degree {degree}"),
            Self::Balls(count) => format!("cover of {count} balls"),
        }
    }

    /// A few letters for beside a point.
    pub(super) fn mark(self) -> String {
        match self {
            Self::Ball => "ball".into(),
            Self::AxisBox => "axis box".into(),
            Self::OrientedBox => "box".into(),
            Self::Cylinder => "cylinder".into(),
            Self::Capsule => "capsule".into(),
            Self::Body { degree: 2, .. } => "ellipsoid".into(),
            Self::Body { degree, .. } => degree.to_string(),
            Self::Slabs { degree, slabs } => format!("{degree}+{slabs}"),
            Self::Parts { parts, .. } => parts.to_string(),
            Self::Balls(count) => count.to_string(),
        }
    }

    /// Whether it contains the convex hull, not the mesh alone.
    pub(super) fn holds_hull(self) -> bool {
        !matches!(self, Self::Parts { .. } | Self::Balls(_))
    }

    /// The representation of two objects.
    pub(super) fn build(self, [a, b]: [&Subject; 2], cache: &FitCache) -> Result<Models, ComparisonError> {
        Ok(match self {
            Self::Capsule => Models::Capsules([self.capsule(a)?, self.capsule(b)?]),
            _ => Models::Shapes([self.shape(a, cache)?, self.shape(b, cache)?]),
        })
    }

    fn capsule(self, Subject { name, hull, .. }: &Subject) -> Result<(Capsule, Pose), ComparisonError> {
        let failed = |what: String| ComparisonError::Representation { mesh: name, method: self.name(), what };
        let found = smallest_capsule(hull).ok_or_else(|| failed("a mesh without points".into()))?;
        let capsule = Capsule::new(found.radius, found.half_height).map_err(|error| failed(error.to_string()))?;
        let frame = Pose::from_matrix(&found.axes, found.center).map_err(|error| failed(error.to_string()))?;
        Ok((capsule, frame))
    }

    fn shape(self, subject: &Subject, cache: &FitCache) -> Result<Shape, ComparisonError> {
        let Subject { name, mesh, hull, .. } = subject;
        let failed = |what: String| ComparisonError::Representation { mesh: name, method: self.name(), what };
        let boxed = |found: OrientedBox| {
            let body = cuboid(name, &found).map_err(|error| failed(error.to_string()))?;
            let body = body.with_points(&mesh.points).map_err(|error| failed(error.to_string()))?;
            Ok(Shape::Body(Box::new(body)))
        };
        match self {
            Self::Ball => {
                let rung = ball(name, &mesh.points).map_err(|error| failed(error.to_string()))?;
                Ok(Shape::Body(Box::new(rung.body)))
            }
            Self::AxisBox => boxed(OrientedBox::along(Matrix3::identity(), hull)),
            Self::OrientedBox => boxed(smallest_box(hull)),
            Self::Cylinder | Self::Capsule => {
                let found = smallest_cylinder(hull).ok_or_else(|| failed("a mesh without points".into()))?;
                let body = found.cylinder(name).map_err(|error| failed(error.to_string()))?;
                let body = body.with_points(&mesh.points).map_err(|error| failed(error.to_string()))?;
                Ok(Shape::Body(Box::new(body)))
            }
            Self::Body { degree, refine } => {
                let options = FitOptions { degree, refine, ..FitOptions::default() };
                Ok(Shape::Body(Box::new(cache.body(name, mesh, &options)?)))
            }
            Self::Slabs { degree, slabs } => {
                let options = FitOptions { degree, slabs, ..FitOptions::default() };
                Ok(Shape::Body(Box::new(cache.body(name, mesh, &options)?)))
            }
            Self::Parts { parts, degree } => {
                let options = FitOptions { degree, ..FitOptions::default() };
                let key = format!("{parts} parts {options:?}");
                Ok(cache.take(&format!("{name}-d{degree}-p{parts}"), mesh, &key, || {
                    let made = fit_parts(name, mesh, parts, &options, &mut |_| ControlFlow::Continue(()))?;
                    Ok(Shape::Compound(Box::new(made.compound)))
                })?)
            }
            Self::Balls(count) => {
                let made = cover(name, mesh, count).map_err(|error| failed(error.to_string()))?;
                Ok(Shape::Compound(Box::new(made)))
            }
        }
    }
}

/// A box anywhere as a body: three pairs of faces, each a quadratic.
fn cuboid(name: &str, found: &OrientedBox) -> Result<Body, BodyError> {
    let half = found.half_extents * (1.0 + SLACK);
    let unit = Body::cuboid(name, Vector3::repeat(1.0))?;
    let linear = Matrix3::from_diagonal(&half.map(|h| 1.0 / h)) * found.axes.transpose();
    Body::new(name, Normalization { center: found.center, linear }, unit.constraints().to_vec())
}
