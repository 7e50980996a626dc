//! What every reader makes: points and the polygons between them, before they become triangles.

use super::polygon::triangulate;
use super::{Defect, Mesh, ReadOptions, Remarks};
use nalgebra::Vector3;

/// Points and polygons of a file, in its units.
#[derive(Debug, Default)]
pub(super) struct Surface {
    pub(super) points: Vec<Vector3<f64>>,
    /// Corners of all loops of all polygons, one after the other.
    corners: Vec<usize>,
    /// Where each loop ends among the corners.
    loops: Vec<usize>,
    faces: Vec<Face>,
}

/// A polygon: an outline, and loops around its holes.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// The line it stands in, counted from 1, or its number among the faces, counted from 0.
    place: Place,
    /// Where its last loop ends among the loops.
    end: usize,
}

/// Where a face stands in its file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// In a line, counted from 1.
    Line(usize),
    /// Among the faces, counted from 0.
    Face(usize),
}

impl Place {
    /// A defect of the face there.
    pub(super) fn defect(self, reason: String) -> Defect {
        match self {
            Self::Line(number) => Defect::line(number, reason),
            Self::Face(index) => Defect::new(format!("face {index} (counted from 0)"), reason),
        }
    }
}

impl Surface {
    /// Adds a polygon without holes.
    pub(super) fn add_face(&mut self, place: Place, corners: impl IntoIterator<Item = usize>) {
        self.add_polygon(place, [corners]);
    }

    /// Adds a polygon of an outline and the loops around its holes, in this order.
    pub(super) fn add_polygon<C: IntoIterator<Item = usize>>(
        &mut self,
        place: Place,
        loops: impl IntoIterator<Item = C>,
    ) {
        for corners in loops {
            self.corners.extend(corners);
            self.loops.push(self.corners.len());
        }
        self.faces.push(Face { place, end: self.loops.len() });
    }

    /// The mesh in metres, with what was left out of it.
    ///
    /// # Errors
    /// A face that names a point which does not exist; the first point with coordinates that are
    /// not finite, unless the options leave such points out.
    pub(super) fn into_mesh(mut self, options: &ReadOptions) -> Result<(Mesh, Remarks), SurfaceError> {
        self.check_corners()?;
        for point in &mut self.points {
            *point = options.scale.apply(point);
        }
        let mut remarks = Remarks::default();
        if let Some(vertex) = self.points.iter().position(|point| !is_finite(point)) {
            if !options.drop_nan {
                return Err(SurfaceError::NotFinite { vertex, coordinates: self.points[vertex].into() });
            }
            self.drop_points(&mut remarks);
        }
        let mut triangles = Vec::new();
        for (_, loops) in self.polygons() {
            let is_simple = triangulate(&self.points, &loops, &mut triangles);
            remarks.crossing_faces += usize::from(!is_simple);
        }
        if options.scale.mirrors() {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        Ok((Mesh { points: self.points, triangles }, remarks))
    }

    /// Faces with their places, in their order.
    fn polygons(&self) -> impl Iterator<Item = (Place, Vec<&[usize]>)> {
        let mut first_loop = 0;
        self.faces.iter().map(move |face| {
            let loops = first_loop..std::mem::replace(&mut first_loop, face.end).max(face.end);
            let start = |index: usize| if index == 0 { 0 } else { self.loops[index - 1] };
            (face.place, loops.map(|index| &self.corners[start(index)..self.loops[index]]).collect())
        })
    }

    fn check_corners(&self) -> Result<(), Defect> {
        let count = self.points.len();
        for (place, loops) in self.polygons() {
            if let Some(corner) = loops.into_iter().flatten().find(|&&corner| corner >= count) {
                let reason = format!("vertex {corner} (counted from 0) is named, but there are {count}");
                return Err(place.defect(reason));
            }
        }
        Ok(())
    }

    /// Leaves out points with coordinates that are not finite, and the faces that need them.
    fn drop_points(&mut self, remarks: &mut Remarks) {
        let mut kept = Self::default();
        let mut places = Vec::with_capacity(self.points.len());
        for point in &self.points {
            places.push(is_finite(point).then_some(kept.points.len()));
            kept.points.extend(is_finite(point).then_some(*point));
        }
        for (place, loops) in self.polygons() {
            let moved: Option<Vec<Vec<usize>>> =
                loops.iter().map(|corners| corners.iter().map(|&corner| places[corner]).collect()).collect();
            match moved {
                Some(loops) => kept.add_polygon(place, loops),
                None => remarks.dropped_faces += 1,
            }
        }
        remarks.dropped_points = self.points.len() - kept.points.len();
        *self = kept;
    }
}

fn is_finite(point: &Vector3<f64>) -> bool {
    point.iter().all(|value| value.is_finite())
}

/// Why a surface is no mesh.
#[derive(Debug)]
pub(super) enum SurfaceError {
    Defect(Defect),
    NotFinite { vertex: usize, coordinates: [f64; 3] },
}

impl From<Defect> for SurfaceError {
    fn from(defect: Defect) -> Self {
        Self::Defect(defect)
    }
}
