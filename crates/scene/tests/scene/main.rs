//! Scenes against references that are as simple as can be: a model of names and poses, and all
//! pairs measured one by one.

mod abandoned;
mod brute_force;
mod capsules;
mod model;
mod own_starts;
mod robots;
mod sets;
mod worlds;
