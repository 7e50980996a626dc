//! The facets of a convex hull, from the hull code.

use nalgebra::Vector3;
use parry3d_f64::math::Vector as GlamVector;
use parry3d_f64::transformation::try_convex_hull;
use std::collections::HashMap;

/// Vertices and facets of the hull, as indices into `points`.
pub(super) fn facets(points: &[Vector3<f64>]) -> Result<(Vec<usize>, Vec<[usize; 3]>), String> {
    let converted: Vec<GlamVector> = points.iter().map(|p| GlamVector::new(p.x, p.y, p.z)).collect();
    // The hull code asserts its topology, which rounding can break.
    let (vertices, triangles) = std::panic::catch_unwind(|| try_convex_hull(&converted))
        .map_err(|_| "its facets lost their topology".to_string())?
        .map_err(|error| error.to_string())?;
    let index: HashMap<[u64; 3], usize> =
        points.iter().enumerate().map(|(i, p)| ([p.x.to_bits(), p.y.to_bits(), p.z.to_bits()], i)).collect();
    let vertices: Vec<usize> =
        vertices.iter().filter_map(|v| index.get(&[v.x.to_bits(), v.y.to_bits(), v.z.to_bits()]).copied()).collect();
    let triangles: Option<Vec<[usize; 3]>> = triangles
        .iter()
        .map(|t| Some([*vertices.get(t[0] as usize)?, *vertices.get(t[1] as usize)?, *vertices.get(t[2] as usize)?]))
        .collect();
    Ok((vertices.clone(), triangles.ok_or("it names a vertex that is not a point")?))
}
