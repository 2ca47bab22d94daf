//! Calibrates the camera model with recordings of known light.
//!
//! [`RecordingSet`] lists the recordings. [`measure_levels`] reads them in one pass and in constant memory. [`calibrate`]
//! estimates the line `x = a light + d` of every pixel and the noise of the population. [`Calibration::camera`] returns
//! the camera that `simulate` uses. [`estimate_snee`] is the estimator of the SCSim paper, for comparison. [`Protocol`]
//! plans recordings and writes synthetic recordings.
//!
//! * `x`: charge per readout, in thresholds of the pixel.
//! * `light`: light level. Light 1 is full light and causes one spike per readout.
//! * `a`: gain of the pixel, in thresholds per readout at full light.
//! * `d`: dark rate of the pixel, in thresholds per readout.
//!
//! `docs/why/calibration.md` describes the method and its accuracy.

pub mod compare;
mod fitter;
mod formulas;
mod output;
mod population;
mod recordings;
mod result;
mod snee;
pub mod unstable;

pub use fitter::estimate::calibrate;
pub use formulas::fit::PixelFit;
pub use formulas::fit::{RateWeighting, fit_line, fit_line_least_absolute};
pub use formulas::phase::interval_growth_ratio;
pub use formulas::selection::{firing_draw_variance, noise_rate_gain};
pub use output::files::CalibrationFiles;
pub use population::Population;
pub use population::threshold_spread;
pub use recordings::color_filters::ColorFilters;
pub use recordings::measure_levels::{ProgressCallback, measure_levels};
pub use recordings::observations::{Flicker, IntervalNoise, LightLevel, Observations};
pub use recordings::protocol::{Precision, predict_precision};
pub use recordings::protocol::{Protocol, RecordedSet};
pub use recordings::published_maps::import_maps;
pub use recordings::recorded_camera::RecordedCamera;
pub use recordings::recording_set::{DEFAULT_LIGHT_UNCERTAINTY, UNSPECIFIED_LIGHT};
pub use recordings::recording_set::{RateMap, Recording, RecordingSet, Stimulus, StimulusPattern};
pub use recordings::sources::DEFAULT_SOURCE_REPEATABILITY;
pub use result::{
    AdditiveSum, Additivity, CalibrateOptions, Calibration, ChannelFit, FieldTerm, Lamp, LightField,
};
pub use snee::{EdgeCounts, SneeMaps, SneeOptions, SneePixel, estimate_snee};
pub use spikelane::pixel::NoiseSampling;
