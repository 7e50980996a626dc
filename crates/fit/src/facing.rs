//! A convex polytope as planes sorted by direction: whether a point is inside is decided by the few
//! planes that it faces.

use nalgebra::Vector3;

/// Most cells along an edge of the cube of directions.
const MOST_CELLS: usize = 32;

/// Half-spaces around a point, by the directions in which each can be the first that a ray from
/// there leaves.
pub(super) struct Facing {
    center: Vector3<f64>,
    /// Unit normals, and the distance of each plane from the centre.
    planes: Vec<(Vector3<f64>, f64)>,
    grid: usize,
    /// For each cell of directions the planes that some ray through it leaves first, and perhaps
    /// others.
    cells: Vec<Vec<u32>>,
}

impl Facing {
    /// Half-spaces `normal·x <= offset` with unit normals; none unless the centre is inside them
    /// all.
    pub(super) fn new(center: Vector3<f64>, planes: impl Iterator<Item = (Vector3<f64>, f64)>) -> Option<Self> {
        let planes: Vec<_> = planes.map(|(normal, offset)| (normal, offset - normal.dot(&center))).collect();
        if planes.is_empty() || !planes.iter().all(|(_, distance)| *distance > 0.0) {
            return None;
        }
        let grid = (((planes.len() / 6) as f64).sqrt() as usize).clamp(1, MOST_CELLS);
        let cells =
            (0..cell_count(grid)).map(|cell| first_planes(&planes, &DirectionCap::around(cell, grid))).collect();
        Some(Self { center, planes, grid, cells })
    }

    /// How far the point is beyond the planes it faces: at most 0 just where it is inside all
    /// half-spaces.
    pub(super) fn beyond(&self, x: &Vector3<f64>) -> f64 {
        let x = x - self.center;
        let faced = self.cells[cell_of(&x, self.grid)].iter().map(|&plane| self.planes[plane as usize]);
        faced.map(|(normal, distance)| normal.dot(&x) - distance).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// A spherical cap that contains the directions of a cell: those within an angle of an axis.
struct DirectionCap {
    axis: Vector3<f64>,
    angle: f64,
}

impl DirectionCap {
    fn around(cell: usize, grid: usize) -> Self {
        let (face, row, column) = (cell / (grid * grid), cell / grid % grid, cell % grid);
        let at = |i: f64, j: f64| {
            let place = |k: f64| 2.0 * k / grid as f64 - 1.0;
            let mut u = Vector3::zeros();
            u[face / 2] = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
            u[(face / 2 + 1) % 3] = place(i);
            u[(face / 2 + 2) % 3] = place(j);
            u.normalize()
        };
        let (row, column) = (row as f64, column as f64);
        let axis = at(row + 0.5, column + 0.5);
        // The farthest of a convex spherical polygon is a corner.
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)].map(|(i, j)| at(row + i, column + j));
        Self { axis, angle: corners.iter().map(|corner| corner.angle(&axis)).fold(0.0, f64::max) * (1.0 + 1e-9) }
    }
}

fn first_planes(planes: &[(Vector3<f64>, f64)], cap: &DirectionCap) -> Vec<u32> {
    // A ray at the angle t to a normal leaves the half-space at distance / cos t, or never. In the
    // cap t is at least and at most:
    let (sin, cos) = cap.angle.sin_cos();
    let cosines = planes.iter().map(|(normal, distance)| {
        let along = normal.dot(&cap.axis);
        let across = (1.0 - along * along).max(0.0).sqrt();
        let least = if along >= cos { 1.0 } else { along * cos + across * sin };
        (*distance, least, along * cos - across * sin)
    });
    let reach = |distance: f64, cosine: f64| if cosine > 0.0 { distance / cosine } else { f64::INFINITY };
    let latest = cosines.clone().map(|(distance, _, most)| reach(distance, most)).fold(f64::INFINITY, f64::min);
    let first = |(distance, least, _)| reach(distance, least) <= latest * (1.0 + 1e-9);
    cosines.enumerate().filter(|&(_, plane)| first(plane)).map(|(index, _)| index as u32).collect()
}

/// How many cells the sphere of directions has.
pub(super) fn cell_count(grid: usize) -> usize {
    6 * grid * grid
}

/// The cell of a direction: a square of a grid on one face of the cube around the centre.
pub(super) fn cell_of(x: &Vector3<f64>, grid: usize) -> usize {
    let axis = x.iamax();
    let place = |k: usize| {
        let share = x[k] / x[axis].abs();
        ((0.5 * (share + 1.0) * grid as f64) as usize).min(grid - 1)
    };
    let face = 2 * axis + usize::from(x[axis] < 0.0);
    (face * grid + place((axis + 1) % 3)) * grid + place((axis + 2) % 3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn the_faced_planes_bound_what_all_planes_bound() {
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let mut vector = || Vector3::from_fn(|_, _| random.signed());
            let center = vector() * 10.0;
            let planes: Vec<(Vector3<f64>, f64)> = (0..[1, 4, 40, 400, 4000][(seed % 5) as usize])
                .map(|_| {
                    let normal = vector().normalize();
                    // Some polytopes are flat, and most have many planes that are no facets.
                    let distance = 0.01 + (normal.x.abs() + 0.1 * normal.y.abs()) * (1.0 + 0.1 * vector().x.abs());
                    (normal, distance + normal.dot(&center))
                })
                .collect();
            let facing = Facing::new(center, planes.iter().copied()).unwrap();
            let mut inside = 0;
            for k in 0..2000 {
                let x = center + vector() * 4.0_f64.powi(k % 6 - 4);
                let all = planes.iter().map(|(normal, offset)| normal.dot(&x) - offset).fold(f64::MIN, f64::max);
                let faced = facing.beyond(&x);
                assert!((faced <= 0.0) == (all <= 0.0) || all.abs() < 1e-12, "seed {seed}: {faced} {all}");
                assert!(faced <= all + 1e-12, "seed {seed}: {faced} {all}");
                inside += usize::from(all <= 0.0);
            }
            assert!(inside > 0 && (planes.len() == 1 || inside < 2000), "seed {seed}: {inside}");
            let most = facing.cells.iter().map(Vec::len).max().unwrap();
            assert!(planes.len() < 4000 || most < planes.len() / 4, "{most} of {}", planes.len());
        }
        let out = [(Vector3::x(), 1.0), (-Vector3::x(), -1.5)];
        assert!(
            Facing::new(Vector3::zeros(), out.into_iter()).is_none()
                && Facing::new(Vector3::zeros(), [].into_iter()).is_none()
        );
    }
}
