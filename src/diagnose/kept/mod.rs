//! Vectors that earlier diagnoses have simulated already.
//!
//! A vector is a function of protocol, camera, lamps and seed, and of the code that simulates. Where all of these are the same to the bit,
//! it is taken from a folder; a neighbour's is never taken in its place.

pub(super) mod folder;
mod program;
