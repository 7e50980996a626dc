//! Several bodies as one: their union, rigidly attached to one frame.

use super::body_error::{BodyError, check_name};
use super::bounds::{Aabb, Ball};
use super::convex_body::Body;
use super::covering::Covering;
use super::id::BodyId;
use super::part_tree::PartTree;
use super::provenance::Provenance;
use super::solid::{Sealed, Solid};
use nalgebra::Vector3;

/// Most parts a compound may have.
pub const MAX_PARTS: usize = 256;

/// The union of bodies that share one frame, such as the links of a hand in one grasp; convex or
/// not, connected or not.
///
/// ```
/// use nalgebra::{UnitQuaternion, Vector3};
/// use sublevel_core::body::{Body, Compound};
///
/// let head = Body::ball("head", Vector3::new(0.0, 0.0, 0.5), 0.1)?;
/// let handle = Body::cylinder("handle", 0.02, 0.5)?;
/// let tilt = UnitQuaternion::from_euler_angles(0.1, 0.0, 0.0);
/// let tilted = handle.moved(&tilt, &Vector3::zeros())?;
/// let hammer = Compound::new("hammer", vec![head, tilted])?;
/// assert_eq!(hammer.parts().len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Compound {
    name: String,
    id: BodyId,
    parts: Vec<Body>,
    circumscribed: Ball,
    bounding_box: Aabb,
    tree: PartTree,
    pub(super) covering: Option<Covering>,
    pub(super) provenance: Option<Provenance>,
}

/// Why bodies do not make a compound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompoundError {
    /// The name.
    #[error(transparent)]
    Name(#[from] BodyError),
    /// No part or too many.
    #[error("a compound has 1 to {MAX_PARTS} parts, not {0}; merge parts or split the object")]
    PartCount(usize),
}

impl Compound {
    /// The union of these bodies; [`Body::moved`] places a body elsewhere in the common frame.
    ///
    /// # Errors
    /// A bad name, no part, or more than [`MAX_PARTS`].
    pub fn new(name: &str, parts: Vec<Body>) -> Result<Self, CompoundError> {
        check_name(name)?;
        if !(1..=MAX_PARTS).contains(&parts.len()) {
            return Err(CompoundError::PartCount(parts.len()));
        }
        let boxes = || parts.iter().map(Body::bounding_box);
        let bounding_box = Aabb {
            min: Vector3::from_fn(|i, _| boxes().map(|b| b.min[i]).fold(f64::INFINITY, f64::min)),
            max: Vector3::from_fn(|i, _| boxes().map(|b| b.max[i]).fold(f64::NEG_INFINITY, f64::max)),
        };
        let center = bounding_box.min + (bounding_box.max - bounding_box.min) * 0.5;
        // Four roundings of the norm and one of the sum, and those of the difference, which count
        // with the positions.
        let around = |ball: &Ball| {
            let positions = f64::EPSILON * (center.norm() + ball.center.norm());
            ((ball.center - center).norm() + ball.radius + positions) * (1.0 + 8.0 * f64::EPSILON)
        };
        let radius = parts.iter().map(|part| around(part.circumscribed())).fold(0.0, f64::max);
        Ok(Self {
            tree: PartTree::new(&parts),
            name: name.to_owned(),
            id: BodyId::of_parts(parts.iter().map(Body::id)),
            parts,
            circumscribed: Ball { center, radius },
            bounding_box,
            covering: None,
            provenance: None,
        })
    }

    /// The same compound with its origin noted: the objective of its parts, and the hull of the
    /// whole object.
    pub fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = Some(provenance);
        self
    }

    /// Name given by its maker.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hash of the ids of the parts, in their order.
    pub fn id(&self) -> &BodyId {
        &self.id
    }

    /// The parts.
    pub fn parts(&self) -> &[Body] {
        &self.parts
    }

    /// Highest degree of the parts.
    pub fn degree(&self) -> usize {
        self.parts.iter().map(Body::degree).max().unwrap_or(0)
    }

    /// Upper bound of the distance of any point of the compound from the union of the convex hulls
    /// of the pieces that its parts were fitted to, metres: the largest [`Body::gap_m`] of the
    /// parts, if all have one. The hull of the whole object contains that union, so the bound is
    /// good for it, too.
    pub fn gap_m(&self) -> Option<f64> {
        self.parts.iter().map(Body::gap_m).try_fold(0.0, |most: f64, gap| Some(most.max(gap?)))
    }

    /// Which mesh the compound was proven to cover.
    pub fn covering(&self) -> Option<&Covering> {
        self.covering.as_ref()
    }

    /// Where the compound comes from.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.provenance.as_ref()
    }

    /// A ball proven to contain all parts, metres.
    pub fn circumscribed(&self) -> &Ball {
        &self.circumscribed
    }

    /// A box proven to contain all parts, metres.
    pub fn bounding_box(&self) -> &Aabb {
        &self.bounding_box
    }
}

impl Sealed for Compound {}

impl Solid for Compound {
    fn parts(&self) -> &[Body] {
        Compound::parts(self)
    }

    fn id(&self) -> &BodyId {
        Compound::id(self)
    }

    fn circumscribed(&self) -> &Ball {
        Compound::circumscribed(self)
    }

    fn bounding_box(&self) -> &Aabb {
        Compound::bounding_box(self)
    }

    fn tree(&self) -> Option<&PartTree> {
        Some(&self.tree)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use sublevel_testkit::Seeded;

    fn turn(random: &mut Seeded) -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(3.0 * random.signed(), 3.0 * random.signed(), 3.0 * random.signed())
    }

    #[test]
    fn moved_bodies_are_the_same_set_elsewhere() {
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let half = Vector3::from_fn(|_, _| 5_f64.powf(random.signed()));
            let body = match seed % 4 {
                0 => Body::superellipsoid("q", Vector3::new(1.0, 2.0, -3.0), half, 8).unwrap(),
                1 => Body::cuboid("box", half).unwrap(),
                2 => Body::cylinder("can", half.x, half.y).unwrap(),
                _ => Body::ellipsoid("egg", Vector3::zeros(), half).unwrap(),
            };
            let (rotation, shift) = (turn(&mut random), Vector3::from_fn(|_, _| 10.0 * random.signed()));
            let moved = body.moved(&rotation, &shift).unwrap();
            assert!(moved.constraints() == body.constraints() && moved.id() != body.id());
            for _ in 0..50 {
                let x = body.interior_point() + Vector3::from_fn(|_, _| 2.0 * random.signed()).component_mul(&half);
                let (before, after) = (body.value(&x), moved.value(&(rotation * x + shift)));
                assert!((before - after).abs() <= 1e-11 * (1.0 + before), "seed {seed}: {before} {after}");
            }
            // Derived values are those of the moved set.
            let size = body.circumscribed().radius;
            assert!((moved.volume().volume_m3 / body.volume().volume_m3 - 1.0).abs() < 1e-9, "seed {seed}");
            assert!((moved.interior_point() - (rotation * body.interior_point() + shift)).norm() < 1e-9 * size);
            assert!((moved.in_radius() / body.in_radius() - 1.0).abs() < 1e-6, "seed {seed}");
            for point in body.boundary() {
                let point = rotation * point + shift;
                assert!((point - moved.circumscribed().center).norm() <= moved.circumscribed().radius * (1.0 + 1e-9));
                let Aabb { min, max } = moved.bounding_box();
                assert!((0..3).all(|i| point[i] > min[i] - 1e-9 * size && point[i] < max[i] + 1e-9 * size));
            }
        }
        let body = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let nowhere = Vector3::new(f64::NAN, 0.0, 0.0);
        assert!(matches!(body.moved(&UnitQuaternion::identity(), &nowhere), Err(BodyError::Normalization(_))));
    }

    #[test]
    fn what_holds_of_points_does_not_move_along() {
        let point = Vector3::new(0.1, 0.2, 0.3);
        let body = Body::ball("ball", Vector3::zeros(), 1.0).unwrap().with_points(&[point]).unwrap();
        assert!(body.moved(&UnitQuaternion::identity(), &Vector3::x()).unwrap().points().is_none());
    }

    #[test]
    fn bounds_of_a_compound_contain_all_parts() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let parts: Vec<Body> = (0..1 + seed % 5)
                .map(|_| {
                    let shift = Vector3::from_fn(|_, _| 5.0 * random.signed());
                    let body = Body::cuboid("b", Vector3::from_fn(|_, _| 3_f64.powf(random.signed()))).unwrap();
                    body.moved(&turn(&mut random), &shift).unwrap()
                })
                .collect();
            let compound = Compound::new("c", parts).unwrap();
            let (ball, bounds) = (compound.circumscribed(), compound.bounding_box());
            for part in compound.parts() {
                assert!(
                    (part.circumscribed().center - ball.center).norm() + part.circumscribed().radius <= ball.radius
                );
                for x in part.boundary() {
                    assert!((0..3).all(|i| x[i] >= bounds.min[i] && x[i] <= bounds.max[i]), "seed {seed}");
                }
            }
        }
        assert_eq!(Compound::new("none", vec![]).unwrap_err(), CompoundError::PartCount(0));
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let many = vec![ball.clone(); MAX_PARTS + 1];
        assert_eq!(Compound::new("many", many).unwrap_err(), CompoundError::PartCount(MAX_PARTS + 1));
        assert!(matches!(Compound::new("", vec![ball]), Err(CompoundError::Name(BodyError::Name(_)))));
    }
}
