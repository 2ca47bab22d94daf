//! Caches of simulated vectors: a folder for later diagnoses, and memory for one search.
//!
//! A vector is a function of protocol, camera, lamps and seed, and of the code that simulates. The key of a vector
//! contains the inputs to the last bit. [`RESULTS_VERSION`](folder::RESULTS_VERSION) identifies the code.

pub(super) mod folder;
pub(super) mod key;
pub(super) mod memory;
