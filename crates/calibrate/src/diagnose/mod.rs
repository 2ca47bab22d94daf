//! Finding, naming and adding what the model of a camera lacks.
//!
//! [`diagnose`] measures a recording set (bits to one vector of [`Statistic`]s), simulates many sensors of
//! the calibrated model under the same protocol ([`Reference`]), and where the set is beyond what those
//! show, tries every effect of the catalogue: by its simulated signature first, then fitted in a
//! tournament. A name is kept only where recordings that were not fitted come nearer too.
//!
//! Maps are not fitted pixel by pixel: statistics of simulated *populations* are compared, so that
//! no map can swallow a spatial effect, and one simulation serves temporal and spatial statistics alike.

mod answer;
mod events;
mod fit;
mod given;
mod kept;
mod lab;
mod null;
mod protocol;
mod recording;
mod run;
mod search;
mod sensors;
mod statistics;
mod strengths;

pub use answer::diagnosis::{Diagnosis, FoundEffect, Gap, Misfit, Parameter, Traces, Unknown, Verdict};
pub use answer::page::write;
pub use answer::pictures::{Picture, Trace};
pub use lab::fault::{Fault, FaultKind};
pub use null::first_look::FirstLook;
pub use null::nameable::Nameable;
pub use null::nameable::SCORE;
pub use null::reference::Reference;
pub use null::watched::Progress;
pub use protocol::extent::{Extent, Part};
pub use protocol::recorded_set::Setup;
pub use run::diagnose_and_tell;
pub use run::{Options as DiagnoseOptions, diagnose};

pub use search::round::Fate;
pub use statistics::entry::Statistic;
pub use strengths::{Strengths, strengths};

/// The published model at the size and rate of a set: what a diagnosis starts from.
///
/// # Errors
/// Never, in practice: the model is built in.
pub fn published(setup: &Setup) -> spikelane::error::Result<spikelane::effects::Camera> {
    sensors::published::published(setup)
}
