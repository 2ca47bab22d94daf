//! Spike-camera simulation: light in, bit-packed spike streams out.
//!
//! A spike camera's pixel gathers charge and fires when it passes a
//! threshold, 20,000 to 40,000 times a second. This crate simulates such
//! cameras with the circuit noise of the SCSim paper (arXiv 2405.16790) and
//! beyond, in SIMD lanes, with the same bits on every machine, thread count
//! and instruction set.
//!
//! ```
//! use spikelane::{Camera, Geometry, Seeds, Sensor, Simulator, effects, simulate::FrameRef};
//!
//! // A 64x48 sensor read 20,000 times a second, with shot noise and a 2 % gain spread.
//! let sensor = Sensor::new(64, 48, 20_000.0)?;
//! let camera = Camera::ideal(sensor)
//!     .with(effects::find("start_phase")?.typical())
//!     .with(effects::find("shot_noise")?.typical())
//!     .with(effects::find("prnu")?.neutral().with("sigma", 0.02)?);
//!
//! // Hold one grey frame for 100 readouts; every readout becomes a packed frame.
//! let mut simulator = Simulator::new(&camera, Seeds { camera: 1, shot: 2, sequence: 0 })?;
//! let light = vec![51u8; sensor.geometry.pixels()];
//! let mut packed = vec![0; 100 * sensor.geometry.frame_bytes()];
//! simulator.push(FrameRef::u8(&light, sensor.geometry), &mut packed)?;
//!
//! // A fifth of full scale fires at every fifth readout, on average.
//! let rate = spikelane::spikes::count(&packed) as f64 / (100.0 * 64.0 * 48.0);
//! assert!((rate - 0.2).abs() < 0.002);
//!
//! // The state can be saved, and the run resumed elsewhere.
//! let saved = simulator.state().to_bytes();
//! # let _ = saved;
//! # Ok::<(), spikelane::Error>(())
//! ```
//!
//! `docs/README.md` lists the pages by what a reader asks: guides, reference, why it
//! can be trusted, and what was tried on the way.

// What is public for this crate's own benches and tests alone is linted with them, and with the program, which uses all of it.
#![cfg_attr(
    not(all(feature = "internals", feature = "cli")),
    allow(unreachable_pub, dead_code, unused_imports)
)]

#[cfg(all(feature = "files", feature = "threads"))]
pub mod calibrate;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(all(feature = "files", feature = "threads"))]
#[allow(unreachable_pub, reason = "what its rooms share is not narrowed yet")]
pub mod diagnose;
pub mod effects;
pub mod error;
#[cfg(feature = "files")]
pub mod formats;
#[cfg(feature = "presets")]
#[allow(dead_code, reason = "some features use a part of it")]
mod inputs;
mod interpolation;
pub mod light;
pub mod measure;
pub mod pixel;
#[cfg(feature = "presets")]
pub mod presets;
pub mod reconstruct;
#[cfg(feature = "scene")]
pub mod scene;
pub mod sensor;
mod setters;
pub mod simulate;
pub mod spikes;
pub mod units;

#[doc(hidden)]
pub mod threads;

#[cfg(all(feature = "files", feature = "threads", feature = "internals"))]
#[doc(hidden)]
pub mod compare;
#[cfg(all(feature = "files", feature = "threads", not(feature = "internals")))]
mod compare;
#[cfg(all(feature = "scene", feature = "internals"))]
#[doc(hidden)]
pub mod dataset;
#[cfg(all(feature = "scene", not(feature = "internals")))]
mod dataset;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod draws;
#[cfg(not(feature = "internals"))]
mod draws;
#[cfg(feature = "internals")]
#[doc(hidden)]
#[allow(unreachable_pub, reason = "what its rooms share is not narrowed yet")]
pub mod kernels;
#[cfg(not(feature = "internals"))]
mod kernels;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub mod live;
#[cfg(all(feature = "files", not(feature = "internals")))]
mod live;
#[cfg(all(feature = "presets", feature = "internals"))]
#[doc(hidden)]
pub mod npy;
#[cfg(all(feature = "presets", not(feature = "internals")))]
mod npy;
#[cfg(feature = "internals")]
#[doc(hidden)]
#[allow(unreachable_pub, reason = "what its rooms share is not narrowed yet")]
pub mod plan;
#[cfg(not(feature = "internals"))]
mod plan;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub mod report;
#[cfg(all(feature = "files", not(feature = "internals")))]
mod report;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub mod storage;
#[cfg(all(feature = "files", not(feature = "internals")))]
mod storage;

pub use draws::pattern::Pattern;
pub use draws::{Seeds, Stream};
pub use effects::{Camera, Effect};
pub use error::{Error, Kind, Result};
pub use kernels::Backend;
pub use plan::{Plan, State};
pub use sensor::Sensor;
pub use simulate::Simulator;
pub use spikes::{Geometry, Packed};

// The examples of these pages run with the tests.
#[cfg(all(doctest, feature = "files"))]
#[doc = include_str!("../docs/guides/embedding.md")]
struct Embedding;

#[cfg(all(doctest, feature = "scene"))]
#[doc = include_str!("../docs/reference/scenes.md")]
struct Scenes;
