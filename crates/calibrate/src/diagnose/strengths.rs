//! How strong effects must be before a set can name them.

use crate::RecordingSet;
use crate::diagnose::given::base_model::BaseModel;
use crate::diagnose::given::taken::Both;
use crate::diagnose::kept::folder::Kept;
use crate::diagnose::lab::fault::Fault;
use crate::diagnose::null::nameable::Nameable;
use crate::diagnose::null::reference::Reference;
use crate::diagnose::null::simulated::Begun;
use crate::diagnose::null::watched::Progress;
use crate::diagnose::protocol::extent::Part;
use crate::diagnose::run::Options;
use spikelane::effects::Catalogue;
use spikelane::error::Result;

/// What a set can name.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Strengths {
    /// The smallest strength of each effect, where a second set of the same scenes judges. With each recording cut in two instead it is
    /// 1.4 times that.
    pub nameable: Vec<Nameable>,
    /// Effects that the set cannot show, however strong.
    pub not_testable: Vec<&'static str>,
    /// Recordings that were left out.
    pub faults: Vec<Fault>,
    /// The numbers that sensors were simulated with, in words.
    pub notes: Vec<String>,
}

/// The smallest nameable strengths on `set`, by sensors as its data, or the camera that is given, have them.
///
/// # Errors
/// When a recording cannot be read or is too short, or the folder for simulations cannot be made or written to.
pub fn strengths(set: &RecordingSet, options: Options<'_>, progress: Progress<'_>) -> Result<Strengths> {
    let kept = options.cache.map(Kept::open).transpose()?;
    progress("reading", 0.0);
    let both = Both::read([set, set], [Part::Whole; 2], options.extent)?;
    let base = BaseModel::of(&both, options.camera)?;
    let library = Catalogue::new();
    let effects = options.effects.unwrap_or(&library);
    let setup = both.fitted.setup;
    let begun = Begun::of(base.camera, kept.as_ref());
    let reference = Reference::looked(setup, begun, options.seed, effects, None, progress)?;
    Ok(Strengths {
        nameable: reference.nameable(),
        not_testable: reference.not_testable(),
        faults: both.faults,
        notes: base.notes,
    })
}
