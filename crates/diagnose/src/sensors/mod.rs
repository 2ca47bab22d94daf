//! Simulation of recording sets: camera models with adjustable parameters, candidates of a search, and the simulator.

pub(super) mod catalog;
pub(super) mod context;
pub(super) mod lamp;
pub(super) mod model;
pub(super) mod simulate;
