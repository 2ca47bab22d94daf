//! Everything that makes a pixel imperfect: one file per effect.
//!
//! An effect edits the circuit of the pixels, or names operations that every
//! readout carries out, predicts what an observer will see, and says where a
//! diagnosis looks for it. To add one, write its file and its line in the list
//! below; it then has its keys in presets and on the command line, every
//! backend, its place in a diagnosis, its row in the docs and its property
//! tests. A crate that uses this one brings its own: see [`Catalogue`].

mod camera;
mod catalogue;
pub mod circuit;
pub mod definition;
mod effect;
mod model;
mod param;
mod tried;
mod window;

pub use camera::{Camera, Maps};
pub use catalogue::{Catalogue, find};
pub use circuit::Circuit;
pub use definition::{Definition, Events, Moments, Operating, Param, Tried};
pub use effect::Effect;
pub use model::{Model, Phases};

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
