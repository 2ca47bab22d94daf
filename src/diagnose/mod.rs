//! Finding, naming and adding what the model of a camera lacks.
//!
//! [`diagnose`] measures a recording set (bits to one vector of [`Statistic`]s), simulates many sensors of
//! the calibrated model under the same protocol ([`Reference`]), and where the set is beyond what those
//! show, tries every effect of the catalogue: by its simulated signature first, then fitted in a
//! tournament. A name is kept only where recordings that were not fitted come nearer too.
//!
//! Maps are not fitted pixel by pixel: statistics of simulated *populations* are compared, so that
//! no map can swallow a spatial effect, and one simulation serves temporal and spatial statistics alike.

mod alarm;
mod bits;
mod calibrated;
mod candidates;
mod case;
mod contradicted;
mod crossed;
mod derivatives;
mod diagnosis;
mod drawn;
mod edges;
mod ending;
mod events;
mod extent;
mod faint;
mod fit;
mod interval;
mod intervals;
mod likelihood;
mod limits;
mod lines;
mod located;
mod lost;
mod maps;
mod metric;
mod missing;
mod model;
mod nameable;
mod notes;
mod outcome;
mod own;
mod page;
mod picture;
mod pinned;
mod quiet;
mod rebase;
mod recorded;
mod redraw;
mod reference;
mod refine;
mod remembered;
mod repeated;
mod round;
mod run;
mod scan;
mod search;
mod seen;
mod settle;
mod setup;
mod simulated;
mod slope;
mod spectra;
mod spread;
mod still;
mod time;
mod together;
mod tournament;
mod vector;
mod wave;
mod weed;

pub use diagnosis::{Diagnosis, Fate, FoundEffect, Gap, Misfit, Parameter, Traces, Unknown, Verdict};
pub use extent::{Extent, Part};
pub use limits::Limits;
pub use nameable::{Nameable, SCORE};
pub use page::page;
pub use picture::{Picture, Trace};
pub use recorded::Scene;
pub use reference::{Progress, Reference};
pub use run::{Options, diagnose};
pub use setup::Setup;
pub use still::Still;
pub use vector::Statistic;

use crate::effects::Camera;
use crate::error::Result;

/// The published model at the size and rate of a set: what a diagnosis starts from.
///
/// # Errors
/// Never, in practice: the model is built in.
pub fn published(setup: &Setup) -> Result<Camera> {
    model::published(setup)
}
