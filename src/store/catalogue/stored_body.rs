//! A body of the catalogue. One that was read from the disk is proven before its first use.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;

use crate::body::BodyId;
use crate::scene::Geometry;
use crate::store::rows::LadderRow;

use super::error::CatalogueError;

/// A body with its proof, once it was asked for.
#[derive(Debug)]
pub(super) struct StoredBody {
    id: BodyId,
    /// Of a ladder.
    rungs: Vec<BodyId>,
    /// What was read, until it is proven.
    row: Mutex<Option<BodyRow>>,
    /// The body, or why it is not what was stored.
    proof: OnceLock<Result<Geometry, Arc<str>>>,
}

/// What the disk says about a body.
#[derive(Debug)]
pub(super) enum BodyRow {
    /// A body file.
    File(String),
    /// A ladder, and the bodies that are its rungs.
    Ladder(LadderRow, Vec<Arc<StoredBody>>),
}

impl StoredBody {
    /// A body that was just made.
    pub(super) fn new(geometry: Geometry) -> Self {
        let rungs = match &geometry {
            Geometry::Ladder(ladder) => ladder.rungs().iter().map(|rung| *rung.id()).collect(),
            Geometry::Solid(_) | Geometry::SosBody(_) | Geometry::Capsule(_) | Geometry::HalfSpace(_) => Vec::new(),
        };
        Self { id: *geometry.id(), rungs, row: Mutex::default(), proof: Ok(geometry).into() }
    }

    /// A body that was read from the disk.
    pub(super) fn read(id: BodyId, row: BodyRow) -> Self {
        let rungs = match &row {
            BodyRow::File(_) => Vec::new(),
            BodyRow::Ladder(_, rungs) => rungs.iter().map(|rung| rung.id).collect(),
        };
        Self { id, rungs, row: Mutex::new(Some(row)), proof: OnceLock::new() }
    }

    pub(super) fn id(&self) -> &BodyId {
        &self.id
    }

    /// Ids of the rungs of a ladder.
    pub(super) fn rungs(&self) -> &[BodyId] {
        &self.rungs
    }

    /// Whether it was looked at since it was read.
    pub(super) fn is_examined(&self) -> bool {
        self.proof.get().is_some()
    }

    /// Whether it was looked at, and is not what was stored.
    pub(super) fn is_damaged(&self) -> bool {
        matches!(self.proof.get(), Some(Err(_)))
    }

    /// The body. The first call proves it, for milliseconds; others meanwhile wait.
    ///
    /// # Errors
    /// When it is not what was stored.
    pub(super) fn geometry(&self) -> Result<Geometry, CatalogueError> {
        let proof = self.proof.get_or_init(|| {
            let row = self.row.lock().unwrap_or_else(PoisonError::into_inner).take();
            let defect = Err("proving it was ended by a defect of the program".to_owned());
            let proof = catch_unwind(AssertUnwindSafe(|| self.prove(row))).unwrap_or(defect);
            proof.map_err(|why| {
                tracing::error!(id = %self.id, why, "a body of the catalogue is damaged and is not used");
                why.into()
            })
        });
        proof.clone().map_err(|why| CatalogueError::DamagedBody { id: self.id, why })
    }

    fn prove(&self, row: Option<BodyRow>) -> Result<Geometry, String> {
        let body = match row {
            Some(BodyRow::File(file)) => Geometry::from_json(&file).map_err(|error| error.to_string())?,
            Some(BodyRow::Ladder(row, rungs)) => {
                let rung = |id: &BodyId| rungs.iter().find(|rung| rung.id == *id)?.geometry().ok();
                Geometry::Ladder(Arc::new(row.ladder(rung)?))
            }
            None => return Err("it was read twice, by a defect of the program".to_owned()),
        };
        if *body.id() == self.id { Ok(body) } else { Err(format!("it has the content of body {}", body.id())) }
    }
}

/// Proves bodies on several threads, until `stop`.
pub(super) fn prove_each(bodies: &[Arc<StoredBody>], threads: usize, stop: &AtomicBool) {
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some(body) = bodies.get(next.fetch_add(1, Ordering::Relaxed)) {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            // Who uses it learns what is wrong.
            let _ = body.geometry();
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads.min(bodies.len()) {
            // Without it this thread does all.
            let _ = thread::Builder::new().spawn_scoped(scope, work);
        }
        work();
    });
}
