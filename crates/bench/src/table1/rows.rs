//! The rows of the table: what is built around each mesh, and what the paper prints for it.

use sublevel::fit::Objective;

/// The meshes, with their numbers in the Princeton Mesh Segmentation Benchmark.
pub(super) const MESHES: [(&str, &str); 5] =
    [("human", "10"), ("chair", "101"), ("hand", "181"), ("vase", "361"), ("octopus", "121")];

/// What is built around a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// The convex hull of the vertices.
    Hull,
    /// The smallest ball.
    Ball,
    /// The box along the axes of the frame.
    AxisBox,
    /// The smallest box at any orientation.
    OrientedBox,
    /// The sos-convex body of a degree with the least objective, refined or not.
    Convex(Objective, usize, bool),
    /// The inverse-moment set of a degree.
    InverseMoment(usize),
    /// The set of a degree with the least objective whose convexity is relaxed by c.
    Relaxed(f64, Objective, usize),
}

/// A row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    /// What is built.
    pub(super) method: Method,
    /// Volumes that the paper prints, in the order of [`MESHES`].
    pub(super) printed: Option<[f64; 5]>,
}

impl Method {
    /// Name of the row.
    pub(super) fn name(self) -> String {
        match self {
            Self::Hull => "convex hull".into(),
            Self::Ball => "smallest ball".into(),
            Self::AxisBox => "axis-aligned box".into(),
            Self::OrientedBox => "smallest oriented box".into(),
            Self::Convex(objective, degree, refined) => {
                format!("sos-convex {degree}, {objective}{}", if refined { ", refined" } else { "" })
            }
            Self::InverseMoment(degree) => format!("inverse moment {degree}"),
            Self::Relaxed(c, objective, degree) => format!("sos {degree}, c = {c}, {objective}"),
        }
    }

    /// Degree of its polynomial, where it is one.
    pub(super) fn degree(self) -> Option<usize> {
        match self {
            Self::Convex(_, degree, _) | Self::InverseMoment(degree) | Self::Relaxed(_, _, degree) => Some(degree),
            _ => None,
        }
    }
}

/// All rows in the order of the paper's Table I, with those that it does not have after their kin.
pub(super) fn rows() -> Vec<Row> {
    use Objective::{LogDetH, LogDetP, TraceH, TraceP};
    let print = |method, printed| Row { method, printed: Some(printed) };
    let ours = |method| Row { method, printed: None };
    let convex = |objective, degree| Method::Convex(objective, degree, false);
    let refined = |degree| Method::Convex(LogDetP, degree, true);
    vec![
        print(Method::Hull, [0.29, 0.66, 0.36, 0.91, 0.5]),
        print(Method::Ball, [3.74, 3.73, 3.84, 3.91, 4.1]),
        ours(Method::AxisBox),
        print(Method::OrientedBox, [0.59, 1.0, 0.81, 1.73, 1.28]),
        print(convex(LogDetP, 2), [0.58, 1.79, 0.82, 1.16, 1.30]),
        print(convex(TraceP, 2), [0.97, 1.80, 1.40, 1.2, 1.76]),
        print(convex(LogDetH, 4), [0.57, 1.55, 0.69, 1.13, 1.04]),
        print(convex(TraceH, 4), [0.56, 2.16, 1.28, 1.09, 3.13]),
        print(convex(LogDetP, 4), [0.44, 1.19, 0.53, 1.05, 0.86]),
        print(convex(TraceP, 4), [0.57, 1.25, 0.92, 1.09, 1.02]),
        ours(refined(4)),
        print(convex(LogDetH, 6), [0.57, 1.27, 0.58, 1.09, 0.93]),
        print(convex(TraceH, 6), [0.56, 1.30, 0.57, 1.09, 0.87]),
        print(convex(LogDetP, 6), [0.41, 1.02, 0.45, 0.99, 0.74]),
        print(convex(TraceP, 6), [0.45, 1.21, 0.48, 1.03, 0.79]),
        ours(refined(6)),
        ours(convex(LogDetP, 8)),
        ours(refined(8)),
        print(Method::InverseMoment(2), [4.02, 1.42, 2.14, 1.36, 1.74]),
        print(Method::InverseMoment(4), [1.53, 0.95, 0.90, 1.25, 0.75]),
        print(Method::InverseMoment(6), [0.48, 0.54, 0.58, 1.10, 0.57]),
        print(Method::Relaxed(10.0, LogDetP, 4), [0.38, 0.72, 0.42, 1.05, 0.63]),
        print(Method::Relaxed(10.0, TraceP, 4), [0.51, 0.78, 0.48, 1.11, 0.71]),
        print(Method::Relaxed(10.0, LogDetP, 6), [0.35, 0.49, 0.34, 0.92, 0.41]),
        print(Method::Relaxed(10.0, TraceP, 6), [0.37, 0.56, 0.39, 0.99, 0.54]),
        print(Method::Relaxed(100.0, LogDetP, 4), [0.36, 0.64, 0.39, 1.05, 0.46]),
        print(Method::Relaxed(100.0, TraceP, 4), [0.42, 0.74, 0.46, 1.10, 0.54]),
        print(Method::Relaxed(100.0, LogDetP, 6), [0.21, 0.21, 0.26, 0.82, 0.28]),
        print(Method::Relaxed(100.0, TraceP, 6), [0.22, 0.30, 0.29, 0.85, 0.37]),
    ]
}
