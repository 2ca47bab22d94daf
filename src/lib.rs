//! Spike-camera simulation: light in, bit-packed spike streams out.
//!
//! Each pixel of a spike camera integrates light. When the charge passes a threshold, the pixel sets a flag and the
//! integration starts again. The camera reads all flags 20,000 to 40,000 times per second, one bit per pixel. This crate
//! simulates such cameras with the circuit noise of the SCSim paper (arXiv 2405.16790) and further effects. Pixels are
//! simulated in SIMD lanes. The bits do not depend on the machine, the instruction set or the number of threads.
//!
//! ```
//! use spikelane::{Camera, Seeds, Sensor, Simulator, effects};
//!
//! // A sensor of 64x48 pixels, 20,000 readouts per second, with shot noise and a gain spread of 2 %.
//! let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?)
//!     .with_effect(effects::find("start_phase")?.typical())
//!     .with_effect(effects::find("shot_noise")?.typical())
//!     .with_effect(effects::find("prnu")?.neutral().with_value("sigma", 0.02)?);
//! let mut simulator = Simulator::new(&camera, Seeds { camera: 1, shot: 2, sequence: 0 })?;
//! let light = vec![51u8; 64 * 48]; // a fifth of full scale, which is 255
//! let spikes = simulator.run(&light, 100)?;
//!
//! // A fifth of full scale fires at every fifth readout on average.
//! let rate = spikes.spikes() as f64 / (100.0 * 64.0 * 48.0);
//! assert!((rate - 0.2).abs() < 0.002);
//! # Ok::<(), spikelane::Error>(())
//! ```
//!
//! # Where to start
//! * [`Camera`] is a sensor with [`effects`]. [`presets`] contains cameras with cited sources and reads camera files.
//! * [`Simulator`] simulates a camera. [`Simulator::run`] returns [`SpikeFrames`], and [`Simulator::fill`] writes into
//!   your buffer.
//! * [`Light`] is one frame, a linear transition between two frames, or a sequence of frames on a timeline.
//! * [`SimulatorOptions`] sets threads, the instruction set and the maximum light.
//! * [`reconstruct`] computes images from spikes.
//!
//! # Features
//! | feature | default | adds |
//! |---|---|---|
//! | `threads` | yes | simulators on several threads (rayon) |
//! | `presets` | yes | cameras with cited sources, and camera files (serde, toml) |
//! | `maps` | no | camera files with per-pixel maps (blake3) |
//! | `serde` | no | `Serialize` and `Deserialize` for plain values such as [`Geometry`] and [`Seeds`] |
//! | `ndarray` | no | conversions from and to `ndarray` arrays |
//! | `image` | no | conversions from grayscale images of the `image` crate |
//!
//! Without default features the crate opens no file, starts no thread and has no global state.
//!
//! # Platforms
//! The crate supports Linux, macOS, Windows and WebAssembly. On x86-64 the kernels use SSE4.1, AVX2 or AVX-512. On
//! every other target, including WebAssembly, the kernels use portable lanes. The minimum Rust version is 1.89.
//!
//! # Other packages
//! Files, scenes, measurements, calibration, data sets, metrics, the viewer and the program are in separate packages:
//! `spikelane-io`, `spikelane-scene`, `spikelane-measure`, `spikelane-calibrate`, `spikelane-dataset`,
//! `spikelane-benchmark`, `spikelane-view` and `spikelane-cli`.

mod conversions;
mod count;
mod draws;
pub mod effects;
pub mod error;
mod inputs;
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
#[doc(hidden)]
pub mod variants;

#[cfg(feature = "image")]
pub use conversions::gray_image;
pub use draws::pattern_rng::{PatternRng, PixelRng};
pub use draws::{RandomStream, Seeds};
pub use effects::{Camera, Effect};
pub use error::{Error, ErrorKind, Result};
pub use kernels::Backend;
pub use plan::{Plan, SimulatorState};
pub use sensor::Sensor;
pub use simulate::{FrameRef, Light, Simulator, SimulatorOptions};
pub use spikes::{Geometry, Spike, SpikeFrame, SpikeFrames, SpikeFramesRef};
