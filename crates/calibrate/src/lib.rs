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
mod population;
mod result;
mod snee;
pub mod unstable;

/// The default estimator. `fitter/estimate.rs` lists its steps.
mod fitter {
    mod additivity;
    pub(super) mod alignment;
    pub(super) mod dark_light;
    pub(super) mod diagnostics;
    pub(super) mod estimate;
    pub(super) mod identifiability;
    pub(super) mod levels;
    mod light_prior;
    pub(super) mod noise;
    pub(super) mod noise_sampling;
    mod scale_posterior;
    pub(super) mod shape;
    pub(super) mod state;
}

/// The formulas of the estimators. They do not depend on recordings.
mod formulas {
    pub(super) mod draw_integrals;
    pub(super) mod fit;
    pub(super) mod phase;
    pub(super) mod robust;
    pub(super) mod selection;
}

/// Output of a calibration: camera file, maps and reports.
mod output {
    mod emva_1288;
    pub(super) mod files;
    pub(super) mod html_report;
    mod verdict;
}

/// Recording sets: plans, files, measurements and checks.
mod recordings {
    pub(super) mod check;
    pub(super) mod color_filters;
    pub(super) mod drift;
    pub(super) mod light_change;
    pub(super) mod light_unit;
    pub(super) mod measure_levels;
    pub(super) mod observations;
    pub(super) mod protocol;
    pub(super) mod published_maps;
    pub(super) mod recorded_camera;
    pub(super) mod recording_set;
    pub(super) mod sources;
}
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
