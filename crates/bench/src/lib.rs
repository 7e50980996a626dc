//! Measurements of Sublevel beside other libraries and solvers, as reports with pictures and raw
//! numbers; and what its benches share. Not published: users of Sublevel compile none of it.

pub mod ablation;
pub mod accuracy;
mod baselines;
mod blocks;
pub mod comparison;
pub mod cost;
mod csv;
pub mod detail;
pub mod figures;
pub mod fits;
mod loopback;
mod machine;
mod measures;
mod messages;
pub mod numbers;
pub mod pairs;
pub mod panda;
pub mod scenes;
pub mod sets;
pub mod speed;
pub mod stability;
pub mod table1;
pub mod warm;
mod words;
mod workspace;

pub use machine::Machine;
pub use workspace::enter_workspace;
