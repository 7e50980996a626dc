//! Proof that a compound covers a mesh, by a division of the mesh among its parts.

use super::compound::Compound;
use super::contained_points::{NotContained, all_inside};
use super::convex_body::Body;
use super::covering::{Covered, Covering};
use super::division::{Division, DivisionError};
use super::mesh_piece::{MeshError, Piece};
use super::spot::Spot;
use nalgebra::Vector3;

/// Why a compound is not proven to cover a mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NotCovered {
    /// The mesh is none.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The division does not match mesh and parts.
    #[error(transparent)]
    Division(#[from] DivisionError),
    /// A part does not contain its piece.
    #[error("part {part} does not hold its piece of the mesh: {source}")]
    Part {
        /// Which part, from 0.
        part: usize,
        /// The point of the piece that fails most.
        source: NotContained,
    },
}

impl Body {
    /// Proves a piece of a mesh inside, rounding included.
    ///
    /// # Errors
    /// The spot that fails most.
    pub fn prove_holds(&self, piece: &Piece) -> Result<f64, NotContained> {
        let value = |spot: &Spot| self.value_upper_within(&spot.x, spot.radius);
        all_inside(piece.spots().iter().map(value))
    }
}

impl Compound {
    /// Proves that this compound covers a mesh: every triangle, and what it encloses if it is
    /// closed. Each part must contain its pieces of those that the mesh is divided into. Returns
    /// how much is covered, and a rigorous upper bound of the constraints over the pieces.
    ///
    /// # Errors
    /// [`NotCovered`]: the part that fails, and where.
    pub fn prove_covers(
        &self,
        points: &[Vector3<f64>],
        triangles: &[[usize; 3]],
        division: &Division,
    ) -> Result<(Covered, f64), NotCovered> {
        let parts = self.parts();
        division.check(parts.len())?;
        let mesh = Piece::of_mesh(points, triangles)?;
        let mut is_closed = mesh.is_closed();
        let mut most = f64::NEG_INFINITY;
        for (part, (body, pieces)) in parts.iter().zip(division.pieces(mesh, parts.len())?).enumerate() {
            for piece in pieces {
                // What the pieces say of the interior rests on their being cycles: that is counted
                // again.
                is_closed = is_closed && piece.is_cycle();
                most = most.max(body.prove_holds(&piece).map_err(|source| NotCovered::Part { part, source })?);
            }
        }
        let covered = if is_closed { Covered::Interior } else { Covered::SurfaceOnly };
        Ok((covered, most))
    }

    /// The same compound with the record of the mesh that it is proven to cover.
    ///
    /// # Errors
    /// As [`Compound::prove_covers`].
    pub fn with_covering(
        mut self,
        points: &[Vector3<f64>],
        triangles: &[[usize; 3]],
        division: Division,
    ) -> Result<Self, NotCovered> {
        let (proven, _) = self.prove_covers(points, triangles, &division)?;
        self.covering = Some(Covering { proven, corners: Covering::corners(points, triangles), division });
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::{Covered, Covering, Division, DivisionError, NotCovered};
    use crate::body::{Aabb, Body, Compound, Cut, MeshError, Shape};
    use nalgebra::{UnitQuaternion, Vector3};

    const CUT: Cut = Cut { part: 0, normal: [1.0, 0.0, 0.0], height_m: 0.25 };

    /// An axis-aligned cuboid as a mesh.
    fn mesh(bounds: &Aabb) -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
        let corner = |i: u8, axis: usize| if i >> axis & 1 == 1 { bounds.max[axis] } else { bounds.min[axis] };
        let points = (0..8).map(|i| Vector3::from_fn(|axis, _| corner(i, axis))).collect();
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        (points, faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
    }

    fn unit() -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
        mesh(&Aabb { min: Vector3::repeat(-1.0), max: Vector3::repeat(1.0) })
    }

    fn by(cuts: &[Cut]) -> Division {
        Division::by_cuts(cuts.to_vec())
    }

    /// The box from `low` to `high` along x, and a bit more than 1 to both sides along the others.
    fn slice(low: f64, high: f64) -> Body {
        let half = Vector3::new((high - low) / 2.0, 1.0 + 1e-12, 1.0 + 1e-12);
        let body = Body::cuboid("slice", half).unwrap();
        body.moved(&UnitQuaternion::identity(), &(Vector3::x() * ((low + high) / 2.0))).unwrap()
    }

    #[test]
    fn parts_that_contain_their_pieces_cover_the_mesh() {
        let (points, triangles) = unit();
        let compound = Compound::new("two", vec![slice(-1.0 - 1e-12, 0.25 + 1e-12), slice(0.25 - 1e-12, 1.1)]).unwrap();
        let (covered, most) = compound.prove_covers(&points, &triangles, &by(&[CUT])).unwrap();
        assert!(covered == Covered::Interior && most <= 1.0 && most > 0.999, "{most}");
        let (covered, _) = compound.prove_covers(&points, &triangles[1..], &by(&[CUT])).unwrap();
        assert_eq!(covered, Covered::SurfaceOnly);
        let noted = compound.clone().with_covering(&points, &triangles, by(&[CUT])).unwrap();
        let covering = noted.covering().unwrap();
        assert_eq!((covering.proven, covering.corners.count), (Covered::Interior, 36));
        assert_eq!(covering.corners, Covering::corners(&points, &triangles));

        // Bodies that only meet in the plane of the cut leave the rounding of cut points uncovered,
        // and say so.
        for (left, right) in [(0.25, 0.25), (0.249, 0.26), (0.26, 0.251)] {
            let parts = vec![slice(-1.1, left), slice(right, 1.1)];
            let failure =
                Compound::new("two", parts).unwrap().prove_covers(&points, &triangles, &by(&[CUT])).unwrap_err();
            assert!(matches!(failure, NotCovered::Part { source, .. } if source.value > 1.0), "{failure}");
        }
        // Order counts: parts belong to pieces.
        let swapped = Compound::new("two", compound.parts().iter().rev().cloned().collect()).unwrap();
        assert!(matches!(
            swapped.prove_covers(&points, &triangles, &by(&[CUT])),
            Err(NotCovered::Part { part: 0, .. })
        ));
    }

    #[test]
    fn what_cannot_be_proven_is_refused() {
        let (points, triangles) = unit();
        let compound = Compound::new("two", vec![slice(-1.1, 1.1), slice(-1.1, 1.1)]).unwrap();
        let prove = |cuts: &[Cut]| compound.prove_covers(&points, &triangles, &by(cuts));
        assert!(prove(&[CUT]).is_ok());
        for cuts in [
            &[][..],
            &[CUT, CUT],
            &[Cut { part: 1, ..CUT }],
            &[Cut { height_m: f64::NAN, ..CUT }],
            &[Cut { normal: [0.0; 3], ..CUT }],
        ] {
            assert!(matches!(prove(cuts), Err(NotCovered::Division(_))), "{cuts:?}");
        }
        for (division, wrong) in [
            (Division { parts: vec![0, 2], ..by(&[CUT]) }, DivisionError::NoPart { piece: 1, part: 2, parts: 2 }),
            (Division { parts: vec![1, 1], ..by(&[CUT]) }, DivisionError::NoPiece(0)),
            (
                Division { parts: vec![0; 3], ..by(&[CUT]) },
                DivisionError::Pieces { cuts: 1, components: 1, expected: 3 },
            ),
            (Division { separated: true, ..by(&[]) }, DivisionError::Pieces { cuts: 0, components: 1, expected: 2 }),
        ] {
            assert_eq!(compound.prove_covers(&points, &triangles, &division), Err(NotCovered::Division(wrong)));
        }
        assert_eq!(
            compound.prove_covers(&points, &[[0, 1, 8]], &by(&[CUT])),
            Err(NotCovered::Mesh(MeshError::Corner { triangle: 0, point: 8, points: 8 }))
        );
        assert!(compound.prove_covers(&points, &[], &by(&[CUT])).is_err());
    }

    #[test]
    fn files_keep_compounds_and_refuse_changed_ones() {
        let (points, triangles) = unit();
        let parts = vec![slice(-1.1, 0.3).with_gap(0.2), slice(0.2, 1.1).with_gap(0.1)];
        let compound = Compound::new("two", parts).unwrap().with_covering(&points, &triangles, by(&[CUT])).unwrap();
        let text = compound.to_json();
        let again = Compound::from_json(&text).unwrap();
        assert_eq!(again.to_json(), text);
        assert_eq!((again.id(), again.gap_m(), again.covering()), (compound.id(), Some(0.2), compound.covering()));
        assert!(again.prove_covers(&points, &triangles, &again.covering().unwrap().division).is_ok());
        for (from, to, field) in [
            ("\"gap_m\": 0.2,", "\"gap_m\": 0.1,", "gap_m"),
            ("\"part\":0", "\"part\":1", "covering.cuts[0]"),
            ("\"name\": \"two\"", "\"name\": \"\"", "name"),
            ("\"kind\": \"compound\"", "\"kind\": \"body\"", "not a body file"),
            ("\"degree\": 2", "\"degree\": 4", "parts[0]: degree"),
        ] {
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text, "{from}");
            let message = Shape::from_json(&changed).unwrap_err().to_string();
            assert!(message.contains(field), "{from}: {message}");
        }
        let id = compound.id().to_string();
        let other = compound.parts()[0].id().to_string();
        let message = Compound::from_json(&text.replacen(&id, &other, 1)).unwrap_err().to_string();
        assert!(message.starts_with("id "), "{message}");
        assert!(Body::from_json(&text).is_err());
    }

    #[test]
    fn parts_contain_components_and_several_pieces() {
        let far = mesh(&Aabb { min: Vector3::repeat(5.0), max: Vector3::repeat(6.0) });
        let (mut points, mut triangles) = unit();
        triangles.extend(far.1.iter().map(|triangle| triangle.map(|corner| corner + points.len())));
        points.extend(far.0);
        let small = slice(-0.6, 0.6).moved(&UnitQuaternion::identity(), &Vector3::repeat(5.5)).unwrap();
        // Pieces: what is below of the first box, the second box, what is above of the first.
        let compound = Compound::new("two", vec![slice(-1.1, 1.1), small]).unwrap();
        let division = Division { separated: true, cuts: vec![CUT], parts: vec![0, 1, 0] };
        let (covered, _) = compound.prove_covers(&points, &triangles, &division).unwrap();
        assert_eq!(covered, Covered::Interior);
        let swapped = Division { parts: vec![1, 0, 1], ..division.clone() };
        let failure = compound.prove_covers(&points, &triangles, &swapped).unwrap_err();
        assert!(matches!(failure, NotCovered::Part { part: 0, .. }), "{failure}");
        // A separated division without cuts and parts is one component to each part.
        let plain = Division { separated: true, ..Division::default() };
        assert!(compound.prove_covers(&points, &triangles, &plain).is_ok());
        assert!(compound.prove_covers(&points, &triangles, &Division::by_cuts(vec![CUT])).is_err());

        let compound = compound.with_covering(&points, &triangles, division.clone()).unwrap();
        let text = compound.to_json();
        let again = Compound::from_json(&text).unwrap();
        assert_eq!(again.to_json(), text);
        assert_eq!(again.covering().unwrap().division, division);
        let compact: String = text.split_whitespace().collect();
        assert!(compact.contains("\"separated\":true") && compact.contains("\"parts\":[0,1,0]"), "{compact}");
        for (from, to, field) in [
            ("[0,1,0]", "[0,2,0]", "covering.parts[1]"),
            ("[0,1,0]", "[0,0,0]", "covering.parts"),
            ("[0,1,0]", "[0]", "covering.cuts"),
            ("\"part\":0", "\"part\":2", "covering.cuts[0]"),
            ("\"separated\":true,", "", "covering.cuts"),
        ] {
            let changed = compact.replacen(from, to, 1);
            assert_ne!(changed, compact, "{from}");
            let said = Compound::from_json(&changed).unwrap_err().to_string();
            assert!(said.contains(field), "{from}: {said}");
        }
    }

    #[test]
    fn files_with_cuts_alone_are_read_and_proven_as_before() {
        let (points, triangles) = unit();
        let parts = vec![slice(-1.1, 0.3), slice(0.2, 1.1)];
        let compound = Compound::new("two", parts).unwrap().with_covering(&points, &triangles, by(&[CUT])).unwrap();
        let compact: String = compound.to_json().split_whitespace().collect();
        let covering =
            compact.split("\"covering\":").nth(1).and_then(|rest| rest.split(",\"provenance\"").next()).unwrap();
        // The whole record, as the first files had it.
        let corners = Covering::corners(&points, &triangles);
        let old = format!(
            "{{\"proven\":\"interior\",\"corners\":{},\"cuts\":[{{\"part\":0,\"normal\":[1.0,0.0,0.0],\"height_m\":0.25}}]}}",
            serde_json::to_string(&corners).unwrap()
        );
        assert_eq!(covering, old);
        let again = Compound::from_json(&compact).unwrap();
        let division = &again.covering().unwrap().division;
        assert_eq!(*division, by(&[CUT]));
        assert!(again.prove_covers(&points, &triangles, division).is_ok());
    }
}
