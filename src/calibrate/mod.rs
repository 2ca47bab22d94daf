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

mod below;
mod check;
mod doubt;
mod drift;
mod estimate;
mod fit;
mod lamps;
mod levels;
mod noise;
mod observe;
mod output;
mod page;
mod phase;
mod population;
mod protocol;
mod published_maps;
mod recordings;
mod result;
mod rule;
mod said;
mod selection;
mod snee;
mod solve;

pub use estimate::calibrate;
pub use fit::{PixelFit, Weighting, fit_line, least_absolute};
pub use observe::{IntervalNoise, Level, Observed, Progress, observe};
pub use output::{Files, write};
pub use page::page;
pub use phase::growth_ratio;
pub use population::{Population, threshold_spread};
pub use protocol::{Precision, Protocol, predict};
pub use published_maps::import_maps;
pub use recordings::{Light, RateMap, Recording, RecordingSet, Scene, UNTOLD};
pub use result::{Calibration, LIGHT_UNCERTAINTY, Lamp, Options, Redrawn};
pub use selection::{nu, psi};
pub use snee::{Edges, Snee, SneeMaps, SneeOptions, snee};
