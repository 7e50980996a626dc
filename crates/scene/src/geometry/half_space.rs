//! Half-spaces with a name, as floors and walls.

use sublevel_core::body::{BodyError, BodyId, check_name};
use sublevel_core::measure::HalfSpace;

/// A half-space `{x : normal·x <= offset}` of the body frame, with a name.
#[derive(Clone, Debug)]
pub struct NamedHalfSpace {
    name: String,
    id: BodyId,
    half_space: HalfSpace,
}

impl NamedHalfSpace {
    /// A half-space of the body frame, metres.
    ///
    /// # Errors
    /// A name that bodies may not have either.
    pub fn new(name: &str, half_space: HalfSpace) -> Result<Self, BodyError> {
        check_name(name)?;
        let id = BodyId::of_half_space(half_space.normal(), half_space.offset());
        Ok(Self { name: name.to_owned(), id, half_space })
    }

    /// Name given by its maker.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hash of its normal and offset.
    pub fn id(&self) -> &BodyId {
        &self.id
    }

    /// The half-space in the body frame.
    pub fn half_space(&self) -> &HalfSpace {
        &self.half_space
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn normals_settle() {
        let mut random = Seeded(11);
        for index in 0..200_000 {
            let length = 1.0 + 1e-7 * random.signed();
            let half_space = HalfSpace::new(random.unit() * length, random.signed()).expect("a half-space");
            let again = HalfSpace::new(*half_space.normal(), half_space.offset()).expect("a half-space");
            assert!(again == half_space, "seed 11, {index}: {half_space:?} {again:?}");
        }
    }
}
