//! One object at several levels of detail.

use std::sync::Arc;

use sublevel_core::body::{BodyError, BodyId, ContainedPoints, Shape, check_name};

/// Most rungs of a ladder.
pub const MAX_RUNGS: usize = 8;

/// Bodies around one object, coarsest first. Each is proven to contain the same points.
#[derive(Clone, Debug)]
pub struct Ladder {
    name: String,
    id: BodyId,
    rungs: Vec<Arc<Shape>>,
}

/// Why bodies do not make a ladder.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LadderError {
    /// The name.
    #[error(transparent)]
    Name(#[from] BodyError),
    /// Too few or too many.
    #[error("a ladder has 2 to {MAX_RUNGS} rungs, not {0}; fit one with 'sublevel fit --ladder'")]
    Count(usize),
    /// A rung that is no single convex body.
    #[error("rung {0} is a compound; a ladder is made of single bodies")]
    Compound(usize),
    /// A rung that is not proven to contain what the first contains.
    #[error("rung {0} is not proven to contain the same points as rung 0; fit all of them to the same mesh")]
    Points(usize),
    /// Rungs of which a later one is larger.
    #[error("rung {0} is larger than the one before it; give the coarsest first")]
    Order(usize),
}

impl Ladder {
    /// A ladder of these rungs, coarsest first.
    ///
    /// # Errors
    /// A bad name, a number of rungs that is not accepted, compounds, and rungs that are not proven
    /// to contain the same points or not in the order of their volumes.
    pub fn new(name: &str, rungs: Vec<Arc<Shape>>) -> Result<Self, LadderError> {
        check_name(name)?;
        if !(2..=MAX_RUNGS).contains(&rungs.len()) {
            return Err(LadderError::Count(rungs.len()));
        }
        let (mut first, mut volume): (Option<&ContainedPoints>, f64) = (None, f64::INFINITY);
        for (index, rung) in rungs.iter().enumerate() {
            let Shape::Body(body) = &**rung else { return Err(LadderError::Compound(index)) };
            let points = body.points().ok_or(LadderError::Points(index))?;
            if *first.get_or_insert(points) != points {
                return Err(LadderError::Points(index));
            }
            if body.volume().volume_m3 > volume {
                return Err(LadderError::Order(index));
            }
            volume = body.volume().volume_m3;
        }
        let id = BodyId::of_ladder(rungs.iter().map(|rung| rung.id()));
        Ok(Self { name: name.to_owned(), id, rungs })
    }

    /// Name given by its maker.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hash of the ids of the rungs, in their order.
    pub fn id(&self) -> &BodyId {
        &self.id
    }

    /// The rungs, coarsest first.
    pub fn rungs(&self) -> &[Arc<Shape>] {
        &self.rungs
    }

    /// The rung with the smallest volume.
    pub fn finest(&self) -> &Arc<Shape> {
        // A ladder has at least two rungs.
        &self.rungs[self.rungs.len() - 1]
    }
}
