//! Addressed random draws.
//!
//! Every draw is a pure function of (seed, stream of the effect, pixel,
//! readout), so tiles, threads, lanes and resume points cannot change it.
//! There are two kinds: [`pattern`] fills per-pixel tables once, from a
//! generator that can jump to any pixel; [`hash`] gives the draws of every
//! readout, with the same value in scalar code and in lanes.

pub mod gauss;
pub mod hash;
mod mix;
pub mod pattern;
pub mod poisson;
mod stream;

pub use stream::{Seeds, Stream};
