//! The kinds of shapes that a pair is made of.

/// A kind of shape, around the same object as the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The smallest ball about the object.
    Ball,
    /// A body of degree 2, 4, 6 or 8; of degree 2 an ellipsoid.
    Degree(usize),
    /// A body of degree 6 that six slabs cut.
    SlabCut,
    /// A box as large as the object along its axes.
    Cuboid,
    /// A cylinder of about its size.
    Cylinder,
    /// A capsule of about its size.
    Capsule,
    /// All on one side of a plane; second of a pair only.
    HalfSpace,
}

impl Kind {
    /// All of them, those of one smooth polynomial first.
    pub(super) const ALL: [Self; 10] = [
        Self::Ball,
        Self::Degree(2),
        Self::Degree(4),
        Self::Degree(6),
        Self::Degree(8),
        Self::SlabCut,
        Self::Cuboid,
        Self::Cylinder,
        Self::Capsule,
        Self::HalfSpace,
    ];

    /// Those of a quick run.
    pub(super) const QUICK: [Self; 5] = [Self::Ball, Self::Degree(4), Self::Cuboid, Self::Capsule, Self::HalfSpace];

    /// Its name for people, by which [`Kind::named`] finds it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Degree(2) => "ellipsoid",
            Self::Degree(4) => "degree 4",
            Self::Degree(6) => "degree 6",
            Self::Degree(_) => "degree 8",
            Self::SlabCut => "slab-cut",
            Self::Cuboid => "box",
            Self::Cylinder => "cylinder",
            Self::Capsule => "capsule",
            Self::HalfSpace => "half-space",
        }
    }

    /// The kind of this name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Whether other libraries have the very shape; of the rest they take the convex hull of the
    /// object.
    pub(super) fn is_exact(self) -> bool {
        matches!(self, Self::Ball | Self::Cuboid | Self::Cylinder | Self::Capsule)
    }

    /// Whether it is the first of some pair, and of all with those that come after it: two
    /// half-spaces have no distance.
    pub(super) fn is_first(self) -> bool {
        self != Self::HalfSpace
    }
}
