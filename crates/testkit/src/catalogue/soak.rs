//! The bodies that long runs of queries are drawn from.

use crate::bodies::{b, c, cut, cylinder, e, p, q};
use sublevel_core::body::Body;

/// Half-extents of bodies with edges, metres.
const HALVES: [[f64; 3]; 12] = [
    [0.6, 0.9, 0.3],
    [1.0, 1.0, 1e-3],
    [0.02, 0.03, 0.01],
    [1.0, 1.0, 1.0],
    [5.0, 4.0, 0.05],
    [0.01, 0.01, 2.0],
    [8.0, 6.0, 7.0],
    [0.3, 0.02, 0.4],
    [2.0, 0.5, 0.5],
    [0.05, 0.04, 0.06],
    [0.2, 0.2, 2.0],
    [1.5, 1.0, 0.7],
];

/// Analytic bodies of every kind, sizes 1e-2 to 10, thin and round. More than half of them have
/// edges: boxes, cylinders, and bodies that slabs cut.
pub fn bodies() -> Vec<Body> {
    let mut all = vec![
        e(1.0, 1.0, 1.0),
        e(1.0, 0.7, 0.4),
        e(0.01, 0.01, 1.0),
        e(1.0, 1.0, 0.01),
        e(0.03, 0.02, 0.025),
        e(10.0, 6.0, 8.0),
    ];
    for [x, y, z] in HALVES {
        all.extend([b(x, y, z), cylinder(x, z), cut(x, y, z)]);
    }
    for degree in [4, 6, 8] {
        all.extend([q(degree, 0.8, 0.5, 1.1), q(degree, 0.05, 0.05, 1.0), q(degree, 1.0, 1.0, 0.02)]);
        all.extend([c(degree, 0.5, 1.0), c(degree, 1.0, 0.05), p(degree, 0.7), p(degree, 0.02), p(degree, 5.0)]);
    }
    all
}
