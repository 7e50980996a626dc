//! What can be asked of a fit: one type for the command line, the store and the wire.
//!
//! Each mode has the options that go with it and no others, so that options which exclude each
//! other cannot be written down. Ranges of numbers are checked by `jobs`.

use serde::{Deserialize, Serialize};

use crate::body::{BodyId, Cone, Objective, Solver, SosMethod};

/// What a fit is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitRequest {
    /// Name of the bodies to be made.
    pub name: String,
    /// Where the points are from, for their provenance; may be empty.
    pub input: String,
    /// Metres per unit of the coordinates that are sent; 1 for groups, which have none.
    pub scale: f64,
    /// What to make, and how.
    pub mode: FitMode,
    /// What solves the programs; none for the faster one, and the other where that fails.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<Solver>,
}

/// What to make, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FitMode {
    /// One convex body around points.
    Body(FitBody),
    /// Every rung up to a degree, the smallest ball first.
    Ladder(FitLadder),
    /// What is cheapest to query and near enough to the convex hull of the points.
    WithinGap(FitWithinGap),
    /// A union of convex bodies that covers a mesh.
    Compound(FitCompound),
    /// A set around points that need not be convex.
    SosBody(FitSosBody),
    /// Convex bodies around stored bodies.
    Group(FitGroup),
}

/// How the polynomials of convex bodies are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitPolynomial {
    /// Degree: 2, 4, 6 or 8, or the highest tried of modes that try several; none for the default
    /// of the mode.
    pub degree: Option<usize>,
    /// What is minimised.
    pub objective: Objective,
    /// Where the Gram matrix of the Hessian form is taken from.
    pub cone: Cone,
    /// Whether traces are measured in the coordinates of the points, metres.
    pub raw_frame: bool,
    /// Whether to minimise the volume itself afterwards.
    pub refine: bool,
}

/// What happens to the points before a fit; afterwards they have no triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitPreparation {
    /// Fraction of the points to leave out, the outermost ones; 0 to 0.5.
    pub trim: f64,
    /// Thickness of points that have less, metres.
    pub min_thickness_m: Option<f64>,
}

/// Options of [`FitMode::Body`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitBody {
    /// Its polynomial; of degree 6 if none is given.
    pub polynomial: FitPolynomial,
    /// Most slabs to cut the body by, a count.
    pub slabs: usize,
    /// What happens to the points first.
    pub preparation: FitPreparation,
}

/// Options of [`FitMode::Ladder`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitLadder {
    /// The polynomials; up to the highest degree of the objective if none is given.
    pub polynomial: FitPolynomial,
    /// Most slabs to cut every rung but the ball by, a count.
    pub slabs: usize,
    /// What happens to the points first.
    pub preparation: FitPreparation,
}

/// Options of [`FitMode::WithinGap`], which chooses slabs and parts itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitWithinGap {
    /// How far the result may reach beyond the hull, metres, above 0.
    pub max_gap_m: f64,
    /// The polynomials; up to the highest degree of the objective if none is given.
    pub polynomial: FitPolynomial,
    /// What happens to the points first.
    pub preparation: FitPreparation,
}

/// Options of [`FitMode::Compound`], which cuts the mesh as it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitCompound {
    /// Most parts, a count.
    pub parts: usize,
    /// The polynomial of each part; of degree 6 if none is given.
    pub polynomial: FitPolynomial,
    /// Most slabs to cut each part by, a count.
    pub slabs: usize,
}

/// Options of [`FitMode::SosBody`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitSosBody {
    /// How its polynomial is chosen.
    pub method: SosMethod,
    /// Degree of the polynomial: 2, 4, 6 or 8; 6 if none is given.
    pub degree: Option<usize>,
    /// Whether traces and what relaxes convexity are measured in the coordinates of the points,
    /// metres; of no consequence for inverse moments.
    pub raw_frame: bool,
    /// What happens to the points first.
    pub preparation: FitPreparation,
}

/// Options of [`FitMode::Group`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitGroup {
    /// Ids of the stored bodies.
    pub body_ids: Vec<BodyId>,
    /// How much volume several bodies around them may add, as a fraction of theirs; one body around
    /// all if none is given.
    pub max_growth: Option<f64>,
    /// Least degree of the multipliers: 0, 2 or 4; that of the bodies less 2, at most 4, if none is
    /// given.
    pub multiplier_degree: Option<usize>,
    /// Degree of the bodies: 2, 4, 6 or 8; 4 if none is given.
    pub degree: Option<usize>,
}

impl Default for FitMode {
    fn default() -> Self {
        Self::Body(FitBody::default())
    }
}

impl FitRequest {
    /// A request about points in metres, or about a group, from an input without a name.
    pub fn new(name: impl Into<String>, mode: impl Into<FitMode>) -> Self {
        Self { name: name.into(), input: String::new(), scale: 1.0, mode: mode.into(), solver: None }
    }

    /// The group that it is about, if it is about one and not about points.
    pub fn group(&self) -> Option<&FitGroup> {
        match &self.mode {
            FitMode::Group(group) => Some(group),
            _ => None,
        }
    }

    /// Whether triangles matter: only the points of one convex body do, and what is trimmed has
    /// lost them.
    pub fn uses_triangles(&self) -> bool {
        match &self.mode {
            FitMode::Compound(_) => true,
            FitMode::WithinGap(FitWithinGap { preparation, .. }) | FitMode::SosBody(FitSosBody { preparation, .. }) => {
                preparation.trim == 0.0
            }
            FitMode::Body(_) | FitMode::Ladder(_) | FitMode::Group(_) => false,
        }
    }
}

impl FitMode {
    /// Its name in stored requests and in messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Body(_) => "body",
            Self::Ladder(_) => "ladder",
            Self::WithinGap(_) => "within_gap",
            Self::Compound(_) => "compound",
            Self::SosBody(_) => "sos_body",
            Self::Group(_) => "group",
        }
    }

    /// What happens to the points before the fit; nothing in modes that take what they are given.
    pub fn preparation(&self) -> FitPreparation {
        match self {
            Self::Body(FitBody { preparation, .. })
            | Self::Ladder(FitLadder { preparation, .. })
            | Self::WithinGap(FitWithinGap { preparation, .. })
            | Self::SosBody(FitSosBody { preparation, .. }) => *preparation,
            Self::Compound(_) | Self::Group(_) => FitPreparation::default(),
        }
    }
}

macro_rules! modes {
    ($($mode:ident($options:ident)),*) => {
        $(impl From<$options> for FitMode {
            fn from(options: $options) -> Self {
                Self::$mode(options)
            }
        })*
    };
}

modes!(
    Body(FitBody),
    Ladder(FitLadder),
    WithinGap(FitWithinGap),
    Compound(FitCompound),
    SosBody(FitSosBody),
    Group(FitGroup)
);
