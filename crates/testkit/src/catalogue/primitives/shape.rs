//! Shapes and how they are drawn.

use super::super::Draws;
use crate::bodies::{b, c, cut, cylinder, e, moved, p, placed, q};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Capsule, HalfSpace, Pose};

/// A kind of shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    Ball,
    Ellipsoid,
    Cuboid,
    Cylinder,
    Capsule,
    /// A capsule of no radius.
    Segment,
    Point,
    HalfSpace,
    /// A body of one constraint of degree 4 to 8.
    Smooth,
    /// A body of degree 6 that slabs cut: its surface has edges, and no closed form.
    Cut,
}

impl Kind {
    /// All that are primitives.
    pub const PRIMITIVES: [Self; 8] = [
        Self::Ball,
        Self::Ellipsoid,
        Self::Cuboid,
        Self::Cylinder,
        Self::Capsule,
        Self::Segment,
        Self::Point,
        Self::HalfSpace,
    ];
}

/// A shape in its own frame.
#[derive(Clone, Debug)]
pub enum Shape {
    Body(Box<Body>),
    /// About the z axis; also segments.
    Capsule(Capsule),
    /// The origin.
    Point,
    /// All points with z at most 0.
    HalfSpace,
}

impl Shape {
    fn of_body(body: Body) -> Self {
        Self::Body(Box::new(body))
    }

    /// One of the kind with sizes about this, metres, over one decade; of bodies but balls each
    /// second one stands off the origin of its frame, and turned.
    pub fn drawn(kind: Kind, size: f64, random: &mut dyn Draws) -> Self {
        if random.index(2) == 0 {
            return Self::centred(kind, size, random);
        }
        let unit = match kind {
            Kind::Ellipsoid => e(1.0, 1.0, 1.0),
            Kind::Cuboid => b(1.0, 1.0, 1.0),
            Kind::Cylinder => cylinder(1.0, 1.0),
            Kind::Cut => cut(1.0, 1.0, 1.0),
            _ => {
                return match Self::centred(kind, size, random) {
                    // How deep a capsule is in a ball is known in its closed form, which 200 bits
                    // have of balls about the origin.
                    Self::Body(body) if kind != Kind::Ball => {
                        let (turn, shift) = (random.rotation(), random.unit() * (0.5 * size));
                        Self::of_body(moved(&body, &turn, &shift))
                    }
                    shape => shape,
                };
            }
        };
        let [x, y, z] = Self::sizes(size, random);
        let sizes = if kind == Kind::Cylinder { [x, x, z] } else { [x, y, z] };
        let (turn, shift) = (random.rotation(), random.unit() * (0.5 * size));
        Self::of_body(placed(&unit, sizes, &turn, &shift))
    }

    /// About this, metres, over one decade.
    fn sizes(size: f64, random: &mut dyn Draws) -> [f64; 3] {
        [(); 3].map(|()| random.between(0.3, 3.0) * size)
    }

    /// The same about the origin of its frame and along its axes.
    pub fn centred(kind: Kind, size: f64, random: &mut dyn Draws) -> Self {
        let sizes = Self::sizes(size, random);
        match kind {
            Kind::Smooth => Self::of_body(match random.index(6) {
                0 => q(4, size, 0.5 * size, 0.7 * size),
                1 => q(6, 0.5 * size, size, 0.8 * size),
                2 => q(8, size, 0.5 * size, 0.7 * size),
                3 => p(6, size),
                4 => c(4, size, 0.5 * size),
                _ => c(8, 0.5 * size, size),
            }),
            kind => Self::of_sizes(kind, sizes),
        }
    }

    /// Whether it has flat sides that its closed form, if it has one, does not know.
    pub fn is_flat(&self) -> bool {
        let Self::Body(body) = self else { return false };
        body.closed_form().is_none() && (body.degree() >= 6 || !body.is_smooth())
    }

    /// One of the kind with these sizes, metres: half-axes, half-extents, radius and half height,
    /// as many as it has; `Q8` of the smooth kind.
    pub fn of_sizes(kind: Kind, [x, y, z]: [f64; 3]) -> Self {
        let capsule = |radius, half| Self::Capsule(Capsule::new(radius, half).expect("sizes are not negative"));
        match kind {
            Kind::Ball => Self::of_body(e(x, x, x)),
            Kind::Ellipsoid => Self::of_body(e(x, y, z)),
            Kind::Cuboid => Self::of_body(b(x, y, z)),
            Kind::Cylinder => Self::of_body(cylinder(x, z)),
            Kind::Capsule => capsule(x, z),
            Kind::Segment => capsule(0.0, z),
            Kind::Point => Self::Point,
            Kind::HalfSpace => Self::HalfSpace,
            Kind::Smooth => Self::of_body(q(8, x, y, z)),
            Kind::Cut => Self::of_body(cut(x, y, z)),
        }
    }

    /// What it is, for people.
    pub fn name(&self) -> &str {
        match self {
            Self::Body(body) => body.name(),
            Self::Capsule(capsule) if capsule.radius_m() == 0.0 => "segment",
            Self::Capsule(_) => "capsule",
            Self::Point => "point",
            Self::HalfSpace => "half-space",
        }
    }

    /// Circumradius, metres; 0 of points and half-spaces.
    pub fn reach_m(&self) -> f64 {
        match self {
            Self::Body(body) => body.circumscribed().radius,
            Self::Capsule(capsule) => capsule.reach_m(),
            Self::Point | Self::HalfSpace => 0.0,
        }
    }

    /// How far it reaches along the axes of its frame, metres, of those of [`Shape::of_sizes`];
    /// half-spaces along z.
    pub fn halves(kind: Kind, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match kind {
            Kind::Ball => [x; 3],
            Kind::Ellipsoid | Kind::Cuboid | Kind::Smooth => [x, y, z],
            Kind::Cut => [0.8 * x, y, 0.6 * z],
            Kind::Cylinder => [x, x, z],
            Kind::Capsule => [x, x, x + z],
            Kind::Segment => [0.0, 0.0, z],
            Kind::Point | Kind::HalfSpace => [0.0; 3],
        }
    }

    /// The half-space of the world that [`Shape::HalfSpace`] is at a pose.
    pub fn half_space(pose: &Pose) -> HalfSpace {
        let n = pose.transform_direction(&Vector3::z());
        HalfSpace::new(n, n.dot(pose.translation())).expect("a unit normal")
    }
}
