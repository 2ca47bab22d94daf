//! Random draws as functions of an address. Earlier draws do not affect the value of a draw.
//!
//! The address consists of the seed, the stream of the effect, the pixel and the readout. Tiles, threads, vector widths
//! and resume points therefore cannot change a draw. There are two kinds of draws:
//! * [`pattern_rng`] draws the values of per-pixel tables once per camera. Its generator can jump to any pixel.
//! * [`hash`] draws the noise of every readout. Scalar and vector code draw equal values.

pub mod gauss;
pub mod hash;
mod mix;
pub mod pattern_rng;
pub mod poisson;
mod random_stream;

pub use random_stream::{RandomStream, Seeds};
