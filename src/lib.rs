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
//! Files, scenes, measurements, calibration, data sets and the program are packages of their own beside this one:
//! `spikelane-io`, `spikelane-scene`, `spikelane-measure`, `spikelane-calibrate`, `spikelane-dataset`, `spikelane-cli`.

mod draws;
pub mod effects;
pub mod error;
mod inputs;
mod interpolation;
mod kernels;
pub mod light;
mod npy;
pub mod pixel;
mod plan;
#[cfg(feature = "presets")]
pub mod presets;
pub mod reconstruct;
pub mod sensor;
mod setters;
pub mod simulate;
pub mod spikes;
mod threads;
pub mod units;
pub mod unstable;

pub use draws::pattern::Pattern;
pub use draws::{Seeds, Stream};
pub use effects::{Camera, Effect};
pub use error::{Error, Kind, Result};
pub use kernels::Backend;
pub use plan::{Plan, State};
pub use sensor::Sensor;
pub use simulate::Simulator;
pub use spikes::{Geometry, Packed};
