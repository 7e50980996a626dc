//! The stability catalogue: families of queries that broke collision libraries, one function per
//! family.
//!
//! Every answer is compared with the truth with 200 bits (`sublevel_testkit::reference`) or in
//! closed form. Sizes are small here; the same draws in their billions are the endurance bench.

mod exact;
mod judge;
mod truth;

mod axes;
mod capsules;
mod contact;
mod depth;
mod gradients;
mod limits;
mod motion;
mod over_shapes;
mod placement;
mod primitives;
mod recheck;
mod scale;
