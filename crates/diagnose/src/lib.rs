//! Diagnosis: finds, names and adds the effects that a camera model is missing.
//!
//! [`diagnose`] reduces a recording set to one vector of statistics ([`DiagnosticStatistic`]). It simulates many
//! sensors of the calibrated model under the same protocol ([`NullModel`]). If the set deviates significantly from
//! these, it tries every effect of the catalog: first by simulated signatures, then by fits in a tournament. An
//! effect is kept only if the model also approaches recordings that were not fitted.
//!
//! Maps are not fitted pixel by pixel. The diagnosis compares statistics of simulated *populations*, so that no map
//! can absorb a spatial effect. One simulation serves both temporal and spatial statistics.

mod answer;
mod cache;
mod comparison;
mod detectability;
mod events;
mod fit;
mod lab;
mod null_model;
mod prepared;
mod protocol;
mod recording;
mod run;
mod search;
mod sensors;
mod statistics;
mod thresholds;

pub use answer::diagnosis::{
    DiagnosedLamp, Diagnosis, Discrepancy, FoundEffect, LampImpact, LimitTest, Parameter, ParameterMismatch,
    ReportData, UnexplainedStatistic, Verdict,
};
pub use answer::effect_limits::EffectLimit;
pub use answer::figures::RateResidual;
pub use answer::figures::{NamedCurve, SetPlots};
pub use answer::page::write_diagnosis;
pub use lab::fault::{Fault, FaultKind};
pub use null_model::detectability::DETECTION_SCORE;
pub use null_model::detectability::Detectability;
pub use null_model::preliminary_result::PreliminaryResult;
pub use null_model::reference::NullModel;
pub use protocol::extent::{ReadoutSelection, RecordingPart};
pub use protocol::recorded_set::Setup;
pub use run::diagnose_with_preliminary;
pub use run::{DiagnoseOptions, diagnose};

pub use detectability::{DetectabilityReport, detectability};
pub use search::round::EliminationReason;
pub use statistics::vector::DiagnosticStatistic;

/// Returns the published model with the size and the rate of a set: the initial model of a diagnosis.
///
/// # Errors
/// Never in practice: the model is built in.
pub fn published_camera(setup: &Setup) -> spikelane::error::Result<spikelane::effects::Camera> {
    sensors::model::published(setup)
}
