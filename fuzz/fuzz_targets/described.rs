//! What the targets of URDF and SRDF share.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::robot::{Description, DescriptionError, Geometry, Link};
use sublevel::scene;

/// What stands for every mesh.
static BALL: LazyLock<scene::Geometry> =
    LazyLock::new(|| Body::ball("ball", Vector3::zeros(), 0.1).expect("a ball").into());

/// An error is one line that says where in the text something is wrong, and what to do.
pub fn check_error(text: &str, error: &DescriptionError) {
    let shown = error.to_string();
    assert!(!shown.contains('\n') && shown.len() < 1 << 14, "{shown}");
    assert!(!error.path.is_empty() && !error.problem.is_empty() && !error.remedy.is_empty(), "{shown}");
    let (line, column) = (error.line as usize, error.column as usize);
    let there = text.split('\n').nth(line.checked_sub(1).expect("a line")).expect("a line of the text");
    assert!(column >= 1 && column <= there.chars().count() + 1, "{shown}");
}

/// Whether a link has a mesh.
pub fn has_mesh(link: &Link) -> bool {
    link.collisions.iter().any(|piece| matches!(piece.geometry, Geometry::Mesh { .. }))
}

/// A body for every link with a mesh, by the names of the links.
pub fn bodies(description: &Description) -> BTreeMap<Arc<str>, scene::Geometry> {
    let links = description.links.iter().filter(|link| has_mesh(link));
    links.map(|link| (link.name.clone(), BALL.clone())).collect()
}
