//! The whole job on shapes the program makes itself.

pub mod shapes;
