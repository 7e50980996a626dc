//! The table: which method passes which family.

use super::method::Method;
use super::runner::Cell;
use crate::machine::Machine;

/// One row: the cells of the methods that can be asked.
pub(super) struct Row {
    pub(super) number: u8,
    pub(super) name: &'static str,
    pub(super) cells: Vec<Cell>,
}

/// Who passes what.
pub struct Stability {
    pub(super) machine: Machine,
    /// Version of coal, if it took part.
    pub(super) coal: Option<String>,
    /// Version of clarabel, if it took part.
    pub(super) solver: Option<String>,
    pub(super) quick: bool,
    /// The columns that were asked for.
    pub(super) methods: Vec<Method>,
    pub(super) rows: Vec<Row>,
}
