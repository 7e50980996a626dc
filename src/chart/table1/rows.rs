//! The rows of the table: what is built around each mesh, and what the paper prints for it.

use crate::fit::Objective;

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
        }
    }

    /// Degree of its polynomial, where it is one.
    pub(super) fn degree(self) -> Option<usize> {
        match self {
            Self::Convex(_, degree, _) => Some(degree),
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
    ]
}
