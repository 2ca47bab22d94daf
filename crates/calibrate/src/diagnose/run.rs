//! A diagnosis from recordings to words.

use std::path::Path;
use std::time::Instant;

use nalgebra::DVector;

use crate::diagnose::answer::caution::cautious;
use crate::diagnose::answer::diagnosis::Diagnosis;
use crate::diagnose::answer::notes::of_the_sets;
use crate::diagnose::answer::outcome::outcome;
use crate::diagnose::answer::pictures::pictures;
use crate::diagnose::events::located::Events;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::given::about::About;
use crate::diagnose::given::base_model::BaseModel;
use crate::diagnose::given::taken::{Both, Taken};
use crate::diagnose::kept::folder::Kept;
use crate::diagnose::null::first_look::{First, FirstLook};
use crate::diagnose::null::reference::Reference;
use crate::diagnose::null::signature::Signature;
use crate::diagnose::null::simulated::Begun;
use crate::diagnose::null::watched::Progress;
use crate::diagnose::protocol::agreement::{poor, same_protocol};
use crate::diagnose::protocol::extent::{Extent, Part};
use crate::diagnose::search::context::{Case, Judge};
use crate::diagnose::search::own_numbers::rebased;
use crate::diagnose::search::search::{Found, search};
use crate::diagnose::search::with_line::with_line;
use crate::diagnose::sensors::published::published;
use crate::{self as calibrate, Light, Pattern, RecordingSet};
use spikelane::effects::{Camera, Catalogue, Maps, start_phase};
use spikelane::error::Result;

/// What a diagnosis is given besides the recordings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// The model to start from; without one the published model is calibrated.
    pub camera: Option<&'a Camera>,
    /// Simulations of an earlier diagnosis under the same protocol. The sets are then judged as they are: nothing is calibrated, and
    /// neither lamps nor the start of recordings are looked at.
    pub reference: Option<&'a Reference>,
    /// Seed of all simulations.
    pub seed: u64,
    /// How much of large recordings is judged.
    pub extent: Extent,
    /// The effects that are looked for; without them those of this library. A `reference` has its own.
    pub effects: Option<&'a Catalogue>,
    /// A folder that keeps simulations, so that a further diagnosis with the same ones does not make them again: one of the same sets with
    /// other words around it, or one that was stopped. It changes no number. Those of a `reference` are not kept.
    ///
    /// The same ones are those of the same protocol, camera, lamps and seed, to the bit, by the same version of this library and of its
    /// results. Each is a file, which appears whole, so that several processes may use one folder; one that is damaged is made again.
    /// Nothing is ever deleted: each version has a folder of its own in the given one, some megabytes for each diagnosis, which may be
    /// deleted when none runs. The version does not cover the code of `effects` of another crate: give another folder when that code changes.
    pub cache: Option<&'a Path>,
}

/// Finds what the model lacks.
///
/// With `holdout` the second set judges what the first one names; without it every recording is
/// cut in the middle.
///
/// # Errors
/// When a recording cannot be read, is too short, or the sets' protocols differ, or the folder for simulations cannot be made or
/// written to.
pub fn diagnose(
    set: &RecordingSet,
    holdout: Option<&RecordingSet>,
    options: Options<'_>,
    progress: Progress<'_>,
) -> Result<Diagnosis> {
    diagnose_and_tell(set, holdout, options, progress, &mut |_| {})
}

/// The same; `first` is told what is seen at first sight, after a third of the time that a set takes in which nothing is found.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_and_tell(
    set: &RecordingSet,
    holdout: Option<&RecordingSet>,
    options: Options<'_>,
    progress: Progress<'_>,
    first: &mut dyn FnMut(&FirstLook),
) -> Result<Diagnosis> {
    let start = Instant::now();
    let still = |r: &calibrate::Recording| matches!(r.light, Light::Scene(Pattern::StaticUnknown {}));
    let alone = set.recordings.is_empty() || set.recordings.iter().any(still);
    let parts = if holdout.is_some() || alone { [Part::Whole; 2] } else { [Part::First, Part::Second] };
    let sets = [set, holdout.unwrap_or(set)];
    let held_out = Held { second_set: holdout.is_some(), alone };
    let kept = options.cache.map(Kept::open).transpose()?;
    progress("reading", 0.0);
    let mut diagnosis = match options.reference {
        Some(reference) => shared(sets, parts, held_out, reference, options, progress)?,
        None => by_itself(sets, parts, held_out, options, kept.as_ref(), progress, first)?,
    };
    diagnosis.cached = kept.map(|kept| [kept.found(), kept.made()]);
    diagnosis.seconds = start.elapsed().as_secs_f64();
    Ok(diagnosis)
}

/// What judges.
#[derive(Clone, Copy)]
struct Held {
    second_set: bool,
    /// Whether the set cannot be cut.
    alone: bool,
}

impl Held {
    fn out(self) -> bool {
        self.second_set || !self.alone
    }
}

/// Sets that share a reference with others of their protocol.
fn shared(
    sets: [&RecordingSet; 2],
    parts: [Part; 2],
    held_out: Held,
    reference: &Reference,
    options: Options<'_>,
    progress: Progress<'_>,
) -> Result<Diagnosis> {
    let [fitted, judging] = [0, 1].map(|i| Taken::of(sets[i], parts[i], options.extent, &[]));
    let both =
        Both { fitted: fitted?, judging: judging?, aside: Vec::new(), begun_over: None, faults: Vec::new() };
    poor(&both.fitted.setup, options.camera.is_some())?;
    same_protocol(&both.fitted.setup, &both.judging.setup)?;
    same_protocol(&both.fitted.setup, &reference.setup)?;
    let given = Given::of(&both, parts, held_out);
    let signatures = with_line(reference, &both.fitted.measured)?;
    let found = search(&given.sets().case(reference, &signatures), progress)?;
    given.said(reference, found, options.camera, progress)
}

/// Sets with a reference of their own, of the camera that is given or that calibration finds.
fn by_itself(
    sets: [&RecordingSet; 2],
    parts: [Part; 2],
    held_out: Held,
    options: Options<'_>,
    kept: Option<&Kept>,
    progress: Progress<'_>,
    first: &mut dyn FnMut(&FirstLook),
) -> Result<Diagnosis> {
    let both = Both::read(sets, parts, options.extent)?;
    same_protocol(&both.fitted.setup, &both.judging.setup)?;
    let about = |base: Option<&BaseModel>| About {
        held_out: held_by(held_out),
        camera: match (options.camera, base) {
            (Some(given), _) => given.name.clone(),
            (None, Some(_)) => "the published model, calibrated".to_owned(),
            (None, None) => "none: nothing was calibrated".to_owned(),
        },
        seed: options.seed,
        numbers: base.map_or_else(Vec::new, |b| b.numbers.clone()),
        lamps: base.map_or_else(Vec::new, |b| b.lamps.clone()),
        ..About::of(&both.fitted.setup, &both.fitted.set)
    };
    if let Err(why) = poor(&both.fitted.setup, options.camera.is_some()) {
        if both.faults.is_empty() {
            return Err(why);
        }
        let camera = options.camera.map_or_else(|| published(&both.fitted.setup), |c| Ok(c.clone()))?;
        let about = Some(about(None));
        return Ok(Diagnosis { about, ..Diagnosis::stopped(both.faults, camera) });
    }
    progress("calibrating", 0.01);
    let base = BaseModel::of(&both, options.camera)?;
    let given = Given::of(&both, parts, held_out);
    // The numbers of a camera file may be wrong; those of another camera stand for nothing.
    // Maps are all spread: what the base cannot hold would bend it.
    let moved = (options.camera.is_some() || base.is_guessed()) && !both.fitted.setup.maps;
    let (reference, found) = given.sets().searched(&base.camera, moved, options, kept, progress, first)?;
    let own = options.camera.map(|_| &base.camera);
    let mut diagnosis = given.said(&reference, found, own, progress)?;
    cautious(&mut diagnosis, &reference);
    restore(&mut diagnosis.camera, options.camera)?;
    let base = if moved { base.fitted(&reference.model.camera)? } else { base };
    diagnosis.about = Some(about(Some(&base)));
    diagnosis.notes.extend(base.notes);
    Ok(diagnosis)
}

fn held_by(held_out: Held) -> String {
    match held_out {
        Held { second_set: true, .. } => "a second set",
        Held { alone: false, .. } => "the second half of every recording",
        Held { .. } => "nothing",
    }
    .to_owned()
}

/// What stood aside for the search: the camera's maps, and where its recordings start.
fn restore(camera: &mut Camera, given: Option<&Camera>) -> Result<()> {
    if let Some(given) = given
        && given.maps != Maps::default()
    {
        camera.maps = given.maps.clone();
    }
    let plain = camera.clone();
    *camera = match given.map(|given| given.effect(start_phase::EFFECT.name)) {
        Some(Some(own)) => plain.with(own.clone()),
        Some(None) => plain.without(start_phase::EFFECT.name),
        None => plain.with(start_phase::EFFECT.neutral().with("share", 1.0)?),
    };
    Ok(())
}

/// Two measured sets as vectors.
struct Given<'a> {
    both: &'a Both,
    data: DVector<f64>,
    judging: DVector<f64>,
    located: Events,
    parts: [Part; 2],
    held_out: Held,
}

/// What a search is given besides a reference.
struct Sets<'a> {
    taken: &'a Taken,
    data: &'a DVector<f64>,
    judge: Judge<'a>,
    located: &'a Events,
}

impl<'a> Given<'a> {
    fn of(both: &'a Both, parts: [Part; 2], held_out: Held) -> Self {
        let [fitted, judging] = [&both.fitted.measured, &both.judging.measured];
        let scenes = &both.fitted.setup.scenes;
        let located = Events::new(fitted.located.clone(), judging.located.clone(), held_out.out(), scenes);
        let [data, judging] = [fitted, judging].map(|m| DVector::from_vec(m.values.clone()));
        Self { both, data, judging, located, parts, held_out }
    }

    fn sets(&self) -> Sets<'_> {
        let setup = (self.parts[0] != self.parts[1]).then_some(&self.both.judging.setup);
        let judge = Judge { data: &self.judging, setup, held_out: self.held_out.out() };
        Sets { taken: &self.both.fitted, data: &self.data, judge, located: &self.located }
    }

    /// The words for what a search found.
    fn said(
        &self,
        reference: &Reference,
        mut found: Found,
        camera: Option<&Camera>,
        progress: Progress<'_>,
    ) -> Result<Diagnosis> {
        let mut diagnosis = outcome(Fitter { reference, data: &self.data }, &mut found, camera)?;
        progress("pictures", 0.95);
        let last = (&found.fit.model, found.fit.u.as_slice());
        let fitted = &self.both.fitted;
        diagnosis.traces.pictures = pictures(reference, &fitted.set, &fitted.measured.scans, last)?;
        let Held { second_set, alone } = self.held_out;
        diagnosis.notes.extend(of_the_sets(&fitted.setup, &self.both.aside, second_set, alone));
        diagnosis.faults.clone_from(&self.both.faults);
        Ok(diagnosis)
    }
}

impl Sets<'_> {
    fn case<'a>(&'a self, reference: &'a Reference, signatures: &'a [Signature]) -> Case<'a> {
        Case {
            fitter: Fitter { reference, data: self.data },
            signatures,
            judge: &self.judge,
            located: self.located,
        }
    }

    /// From a camera that is given, or calibrated; its numbers are `moved` first where nothing says that they are this sensor's.
    fn searched(
        &self,
        start: &Camera,
        moved: bool,
        options: Options<'_>,
        kept: Option<&Kept>,
        progress: Progress<'_>,
        first: &mut dyn FnMut(&FirstLook),
    ) -> Result<(Reference, Found)> {
        let setup = self.taken.setup.clone();
        let begun = if moved {
            progress("own numbers", 0.02);
            rebased(&setup, start, self.data, options.seed, kept)?
        } else {
            Begun::of(start.clone(), kept)
        };
        let library = Catalogue::new();
        let effects = options.effects.unwrap_or(&library);
        let first = First { data: self.data, told: first };
        let reference = Reference::looked(setup, begun, options.seed, effects, Some(first), progress)?;
        let signatures = with_line(&reference, &self.taken.measured)?;
        let case = self.case(&reference, &signatures);
        let mut found = search(&case, progress)?;
        progress("last steps", 0.94);
        case.end(&mut found, start)?;
        Ok((reference, found))
    }
}
