//! The imperfections of a camera. Each file defines one effect.
//!
//! An effect edits the circuits of the pixels or lists operations for every readout. It also predicts how it changes
//! the spike statistics, and lists the parameter values that a diagnosis tries.
//!
//! To add an effect to this library, write its file and add the file's name to the list below. Presets, the program,
//! every backend and the property tests then include the effect. `CONTRIBUTING.md` lists the steps for the diagnosis and
//! the docs.
//! Another crate adds its own effects through [`Catalog`].

mod camera;
mod catalog;
pub mod circuit;
pub mod definition;
mod effect;
mod model;
mod param;
mod search_spec;
mod window;

pub use camera::{Camera, Maps};
pub use catalog::{Catalog, find};
pub use circuit::Circuit;
pub use definition::{AmbiguityGroup, Definition, EventKind, Moments, OperatingPoint, Param, SearchSpec};
pub use effect::Effect;
pub use model::{Model, StartPhases};

/// The names that the files of the effects use.
mod prelude {
    pub(super) use super::circuit::Circuit;
    pub(super) use super::definition::{
        AmbiguityGroup, Definition, EventKind, Moments, OperatingPoint, Param, SearchSpec, Values,
    };
    pub(super) use crate::draws::pattern_rng::PatternRng;
    pub(super) use crate::pixel::Op;
    pub(super) use crate::sensor::Sensor;
    pub(super) use crate::units::Unit;
}

macro_rules! effects {
    ($($name:ident),* $(,)?) => {
        $(pub mod $name;)*

        /// Every effect, in the order in which circuits are edited.
        pub const ALL: &[&Definition] = &[$(&$name::EFFECT),*];
    };
}

effects![
    capacitor_mismatch,
    bias_voltage,
    column_pattern,
    row_pattern,
    prnu,
    smooth_prnu,
    dark_current,
    dark_tail,
    gain_dark_correlation,
    vignetting,
    edge_columns,
    hot_pixels,
    dead_pixels,
    crosstalk,
    flicker,
    response_nonlinearity,
    gain_drift,
    image_lag,
    telegraph_dark,
    shot_noise,
    dark_shot_noise,
    correlated_shot_noise,
    thermal_noise,
    comparator_noise,
    readout_jitter,
    row_noise,
    slow_threshold_noise,
    adaptation,
    supply_droop,
    start_phase,
    dead_time,
    partial_reset,
    leak,
    spike_coupling,
    saturation_clamp,
    missed_spikes,
    false_spikes,
    dropped_readouts,
    repeated_readouts,
];
