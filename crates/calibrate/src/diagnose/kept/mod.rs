//! Vectors that earlier diagnoses have simulated already.
//!
//! A vector is a function of protocol, camera, lamps and seed, which its key contains to the last bit, and of the code that simulates,
//! which [`RESULTS_VERSION`](folder::RESULTS_VERSION) identifies.

pub(super) mod folder;
