//! Fitting the model to a camera from recordings of known light.
//!
//! [`RecordingSet`] names the recordings, [`observe`] reads them in one pass
//! and constant memory, [`calibrate`] estimates every pixel's rate
//! `x = a light + d` (in thresholds per readout) and the population's noise,
//! and [`Calibration::camera`] makes the camera that `simulate` takes.
//! [`snee`] is the estimator of the SCSim paper, for comparison.
//! [`Protocol`] plans recordings and writes synthetic ones.
//!
//! `docs/why/calibration.md` has the method and what it reaches.

pub mod compare;
pub mod diagnose;
mod fitter;
mod formulas;
mod population;
mod result;
mod sets;
mod snee;
mod written;

pub use fitter::estimate::calibrate;
pub use formulas::fit::PixelFit;
pub use formulas::fit::{Weighting, fit_line, least_absolute};
pub use formulas::phase::growth_ratio;
pub use formulas::selection::{nu, psi};
pub use population::Population;
pub use population::threshold_spread;
pub use result::LIGHT_UNCERTAINTY;
pub use result::{CalibrateOptions, Calibration, Lamp, Redrawn};
pub(crate) use sets::check::alike;
pub use sets::observe::{Progress, observe};
pub use sets::observed::{IntervalNoise, Level, Observed};
pub use sets::protocol::Protocol;
pub use sets::protocol::{Precision, predict};
pub use sets::published_maps::import_maps;
pub use sets::recordings::UNTOLD;
pub use sets::recordings::{Light, Pattern, RateMap, Recording, RecordingSet};
pub use snee::{Edges, Snee, SneeMaps, SneeOptions, snee};
pub use written::output::{Files, write};
pub use written::page::page;
