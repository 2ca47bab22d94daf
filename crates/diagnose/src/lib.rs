//! Diagnosis: finds, names and adds the effects that a camera model is missing.
//!
//! [`diagnose`] reduces a recording set to one vector of statistics ([`DiagnosticStatistic`]). It simulates many
//! sensors of the calibrated model under the same protocol ([`NullModel`]). If the set deviates significantly from
//! these sensors, it tries every effect of the catalog. It first compares the simulated change by each effect, the
//! signature, with the deviation. It then fits the most similar effects and compares the fits in a tournament. An
//! effect is kept only if the model with the effect also agrees better with recordings that were not fitted.
//!
//! The maps of a camera are not fitted pixel by pixel, because a fitted map could absorb a spatial effect. Instead,
//! the diagnosis compares statistics of simulated *populations* of pixels. One simulation provides both the
//! temporal and the spatial statistics.

/// Recordings: their protocol, and scans of their bits.
mod recordings {
    pub(crate) mod bits;
    pub(crate) mod extent;
    pub(crate) mod joint;
    pub(crate) mod recorded_scene;
    pub(crate) mod scan;
    pub(crate) mod setup;
    pub(crate) mod stretches;
}

/// Statistics: one vector of numbers for a recording set, and for a simulated set.
mod statistics {
    pub(crate) mod maps;
    pub(crate) mod measured_set;
    pub(crate) mod order;
    pub(crate) mod readouts;
    pub(crate) mod spectrum;
    pub(crate) mod vector;
}

/// Faults of lamps, scenes and files. A diagnosis reports them before it searches effects of the camera.
///
/// A fault changes single recordings, or only their light. An effect of the camera changes all recordings, and its
/// change is a smooth function of the light.
mod faults {
    pub(crate) mod fault;
    pub(crate) mod fault_scan;
    mod levels;
    mod motion;
    mod unsteady_light;
}

/// Lost and repeated readouts.
mod events {
    pub(crate) mod locations;
    mod lost_readouts;
    mod repeated_readouts;
}

/// Light: lamps and sources whose light deviates from the stated light.
mod light {
    pub(crate) mod found_light;
    pub(crate) mod lamp;
    pub(crate) mod lamp_posterior;
    pub(crate) mod offsets;
}

/// Simulated sensors: models with adjustable parameters, candidates of a search, the simulator, and its caches.
mod sensors {
    pub(crate) mod cache;
    mod cache_key;
    pub(crate) mod catalog;
    pub(crate) mod deadline;
    pub(crate) mod memory;
    pub(crate) mod model;
    pub(crate) mod simulate;
}

/// Preparation before the comparison: usable recordings, found light, and parameters of the base model.
mod prepared {
    pub(crate) mod base_model;
    mod base_parameter_fit;
    mod map_populations;
    mod negative_currents;
    pub(crate) mod preparation;
    pub(crate) mod provenance;
    pub(crate) mod recordings;
    mod start_phases;
}

/// The null model: mean and covariance of the statistics of clean sensors, derivatives, signatures of effects, and
/// limits.
mod null_model {
    pub(crate) mod baseline;
    pub(crate) mod derivatives;
    pub(crate) mod detectability;
    pub(crate) mod limits;
    pub(crate) mod metric;
    pub(crate) mod model;
    mod posterior_draw;
    pub(crate) mod preliminary_result;
    #[cfg(test)]
    mod preliminary_tests;
    mod progress;
    pub(crate) mod signature;
    pub(crate) mod vectors;
}

/// Fits of models with effects to a set. Each fitted model is also compared with its own simulations.
mod fits {
    pub(crate) mod fit;
    pub(crate) mod fitter;
    pub(crate) mod interval;
    pub(crate) mod likelihood;
    pub(crate) mod refine;
    pub(crate) mod scored_fit;
    pub(crate) mod self_consistency;
    pub(crate) mod slopes;
}

/// The search: rounds of tournaments between effects, tests on held-out recordings, and backward elimination.
mod search {
    pub(crate) mod backward_elimination;
    pub(crate) mod effect_search;
    pub(crate) mod last_steps;
    pub(crate) mod line_signatures;
    pub(crate) mod parameter_mismatch;
    pub(crate) mod round;
    pub(crate) mod state;
    pub(crate) mod tournament;
}

/// Verdict: the result of a search as a diagnosis, its qualifications, and the report.
mod verdict {
    mod about_page;
    pub(crate) mod diagnosis;
    pub(crate) mod effect_limits;
    pub(crate) mod figures;
    pub(crate) mod outcome;
    pub(crate) mod page;
    pub(crate) mod qualifications;
    mod recommended_recordings;
}

mod detectability;
mod run;
mod thresholds;

pub use detectability::{DetectabilityReport, detectability};
pub use faults::fault::{Fault, FaultKind};
pub use null_model::detectability::{DETECTION_SCORE, Detectability};
pub use null_model::model::NullModel;
pub use null_model::preliminary_result::PreliminaryResult;
pub use recordings::extent::{ReadoutSelection, RecordingPart};
pub use recordings::setup::Setup;
pub use run::{DiagnoseOptions, diagnose, diagnose_with_preliminary};
pub use search::round::EliminationReason;
pub use statistics::vector::DiagnosticStatistic;
pub use verdict::diagnosis::{
    DiagnosedLamp, Diagnosis, Discrepancy, FoundEffect, LampImpact, LimitTest, Parameter, ParameterMismatch,
    ReportData, UnexplainedStatistic, Verdict,
};
pub use verdict::effect_limits::EffectLimit;
pub use verdict::figures::{NamedCurve, RateResidual, SetPlots};
pub use verdict::page::write_diagnosis;

/// Returns the published model with the frame size and the readout rate of a set. It is the initial model of a
/// diagnosis without a camera file.
///
/// # Errors
/// Never in practice: the model is built in.
pub fn published_camera(setup: &Setup) -> spikelane::error::Result<spikelane::effects::Camera> {
    sensors::model::published(setup)
}
