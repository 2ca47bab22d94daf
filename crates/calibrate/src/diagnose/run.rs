//! A diagnosis from recordings to words.

use std::path::Path;
use std::time::{Duration, Instant};

use nalgebra::DVector;

use crate::ProgressCallback;
use crate::diagnose::answer::diagnosis::Diagnosis;
use crate::diagnose::answer::figures::rate_residuals;
use crate::diagnose::answer::figures::set_plots;
use crate::diagnose::answer::outcome::outcome;
use crate::diagnose::answer::qualifications::qualify;
use crate::diagnose::answer::qualifications::set_notes;
use crate::diagnose::cache::folder::SimulationCache;
use crate::diagnose::events::locations::Events;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::given::about::Provenance;
use crate::diagnose::given::base_model::BaseModel;
use crate::diagnose::given::taken::{Both, Taken};
use crate::diagnose::null::baseline::{Baseline, FIRST_SIGNATURE_DRAWS, StartingCamera};
use crate::diagnose::null::first_look::PreliminaryResult;
use crate::diagnose::null::reference::NullModel;
use crate::diagnose::null::signature::Signature;
use crate::diagnose::protocol::extent::{ReadoutSelection, RecordingPart};
use crate::diagnose::protocol::recorded_set::{check_sufficient, same_protocol};
use crate::diagnose::search::context::{Case, Judge};
use crate::diagnose::search::own_numbers::rebased;
use crate::diagnose::search::search::{Found, search};
use crate::diagnose::search::undecided::Undecided;
use crate::diagnose::search::with_line::with_line;
use crate::diagnose::sensors::context::{Deadline, SimulationContext, in_time};
use crate::diagnose::sensors::model::published;
use crate::{self as calibrate, RecordingSet, Stimulus, StimulusPattern};
use spikelane::effects::{Camera, Catalog, Maps, readout_jitter, start_phase};
use spikelane::error::Result;

/// Options of a diagnosis.
#[derive(Clone, Copy, Debug, Default)]
pub struct DiagnoseOptions<'a> {
    /// The initial model; if `None`, the published model is calibrated.
    pub camera: Option<&'a Camera>,
    /// Simulations of an earlier diagnosis under the same protocol.
    ///
    /// The sets are then judged as they are. They are not calibrated, and neither lamps nor the start of recordings
    /// are checked.
    pub null_model: Option<&'a NullModel>,
    /// Seed of all simulations.
    pub seed: u64,
    /// The readouts of large recordings that are judged.
    pub readout_selection: ReadoutSelection,
    /// Effects that are searched; if `None`, those of this library. A `null_model` has its own effects.
    pub effects: Option<&'a Catalog>,
    /// Folder of cached simulations, which a further diagnosis of the same sets can reuse, also after one that was
    /// stopped.
    ///
    /// The cache changes no result. The simulations of a `null_model` are not cached. A simulation is reused if
    /// protocol, camera, lamps and seed are identical to the bit. It must also come from the same version of this
    /// library and of its results.
    ///
    /// Each simulation is a file that appears only when it is complete, so several processes can use one folder. A
    /// damaged file is simulated again. Files are never deleted. Each version has its own subfolder, with some
    /// megabytes per diagnosis. You may delete a subfolder when no diagnosis is running. The version does not cover
    /// the code of `effects` from another crate: use another folder if that code changes.
    pub cache: Option<&'a Path>,
    /// Longest time for simulations, from the start of the diagnosis.
    ///
    /// At the limit, the diagnosis ends with the best result so far, and the field `undecided` of [`Diagnosis`] lists the open
    /// questions. Reading, calibrating and writing do not stop at the limit. A result within the limit does not depend
    /// on it. After the limit, the result depends on the speed of the machine; with `cache`, a further diagnosis
    /// continues.
    pub time_limit: Option<Duration>,
}

/// Finds the effects that a camera model is missing.
///
/// With `holdout`, the second set judges the effects that the first one shows. Without it, every recording is cut in
/// the middle, and the second half judges.
///
/// # Errors
/// If a recording cannot be read or is too short, or the protocols of the sets differ. If the light of a set has another
/// unit. If the cache folder cannot be created or written to.
pub fn diagnose(
    set: &RecordingSet,
    holdout: Option<&RecordingSet>,
    options: DiagnoseOptions<'_>,
    progress: ProgressCallback<'_>,
) -> Result<Diagnosis> {
    diagnose_with_preliminary(set, holdout, options, progress, &mut |_| {})
}

/// Finds missing effects as [`diagnose`] does, and passes a preliminary result to `on_preliminary`.
///
/// The preliminary result takes a third of the time of a diagnosis that finds nothing.
///
/// # Errors
/// See [`diagnose`].
pub fn diagnose_with_preliminary(
    set: &RecordingSet,
    holdout: Option<&RecordingSet>,
    options: DiagnoseOptions<'_>,
    progress: ProgressCallback<'_>,
    on_preliminary: &mut dyn FnMut(&PreliminaryResult),
) -> Result<Diagnosis> {
    let start = Instant::now();
    let still =
        |r: &calibrate::Recording| matches!(r.light, Stimulus::Scene(StimulusPattern::StaticUnknown {}));
    let alone = set.recordings.is_empty() || set.recordings.iter().any(still);
    let parts = if holdout.is_some() || alone {
        [RecordingPart::Whole; 2]
    } else {
        [RecordingPart::FirstHalf, RecordingPart::SecondHalf]
    };
    let sets = [set, holdout.unwrap_or(set)];
    let held_out = Held { second_set: holdout.is_some(), alone };
    let cache = options.cache.map(SimulationCache::open).transpose()?;
    let context = SimulationContext { cache, deadline: Deadline::new(start, options.time_limit) };
    progress("reading", 0.0);
    if options.null_model.is_none() {
        [Some(set), holdout].into_iter().flatten().try_for_each(RecordingSet::check_light_unit)?;
    }
    let mut diagnosis = match options.null_model {
        Some(reference) => {
            shared(sets, parts, held_out, &reference.within(&context.deadline), options, progress)?
        }
        None => by_itself(sets, parts, held_out, options, &context, progress, on_preliminary)?,
    };
    diagnosis.cache_counts = context.cache.map(|cache| [cache.hit_count(), cache.miss_count()]);
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
    parts: [RecordingPart; 2],
    held_out: Held,
    reference: &NullModel,
    options: DiagnoseOptions<'_>,
    progress: ProgressCallback<'_>,
) -> Result<Diagnosis> {
    let [fitted, judging] = [0, 1].map(|i| Taken::of(sets[i], parts[i], options.readout_selection, &[]));
    let both =
        Both { fitted: fitted?, judging: judging?, aside: Vec::new(), begun_over: None, faults: Vec::new() };
    check_sufficient(&both.fitted.setup, options.camera.is_some())?;
    same_protocol(&both.fitted.setup, &both.judging.setup)?;
    same_protocol(&both.fitted.setup, &reference.setup)?;
    let given = Given::of(&both, parts, held_out).shifted(reference);
    let sets = given.sets();
    let signatures = sets.signatures(reference)?;
    let found = search(&sets.case(reference, &signatures), progress)?;
    given.said(reference, found, options.camera, progress)
}

/// Sets with a reference of their own, of the camera that is given or that calibration finds.
fn by_itself(
    sets: [&RecordingSet; 2],
    parts: [RecordingPart; 2],
    held_out: Held,
    options: DiagnoseOptions<'_>,
    context: &SimulationContext,
    progress: ProgressCallback<'_>,
    first: &mut dyn FnMut(&PreliminaryResult),
) -> Result<Diagnosis> {
    let mut both = Both::read(sets, parts, options.readout_selection)?;
    same_protocol(&both.fitted.setup, &both.judging.setup)?;
    let description = Provenance::of(&both.fitted.setup, &both.fitted.set);
    let about = |base: Option<&BaseModel>| Provenance {
        held_out: held_by(held_out),
        camera: match (options.camera, base) {
            (Some(given), _) => given.name.clone(),
            (None, Some(_)) => "the published model, calibrated".to_owned(),
            (None, None) => "none, because no calibration was possible".to_owned(),
        },
        seed: options.seed,
        base_parameters: base.map_or_else(Vec::new, |b| b.numbers.clone()),
        ..description.clone()
    };
    if let Err(why) = check_sufficient(&both.fitted.setup, options.camera.is_some()) {
        if both.faults.is_empty() {
            return Err(why);
        }
        let camera = options.camera.map_or_else(|| published(&both.fitted.setup), |c| Ok(c.clone()))?;
        let about = Some(about(None));
        return Ok(Diagnosis { provenance: about, ..Diagnosis::stopped(both.faults, camera) });
    }
    progress("calibrating", 0.01);
    let base = BaseModel::of(&both, options.camera)?;
    both.fitted.find_light(&base.camera, options.seed)?;
    // The numbers of a camera file may be wrong; those of another camera stand for nothing.
    // Maps are all spread: what the base cannot hold would bend it.
    let moved = (options.camera.is_some() || base.is_guessed()) && !both.fitted.setup.has_rate_maps;
    let library = Catalog::new();
    let effects = options.effects.unwrap_or(&library);
    let mut first_simulations = || -> Result<Baseline> {
        let start = if moved {
            progress("own numbers", 0.02);
            let data = DVector::from_vec(both.fitted.measured.values.clone());
            let start = rebased(&both.fitted.setup, &base.camera, &data, options.seed, context)?;
            let is_lit_otherwise = both.fitted.find_light(&start.camera, options.seed)?;
            if is_lit_otherwise { StartingCamera::new(start.camera, context) } else { start }
        } else {
            StartingCamera::new(base.camera.clone(), context)
        };
        both.fitted.sum_sources();
        Baseline::first(both.fitted.setup.clone(), start, options.seed, effects, progress)
    };
    let Some(baseline) = in_time(first_simulations())? else {
        let mut diagnosis = Diagnosis::without_comparison(both.faults, base.camera.clone());
        restore(&mut diagnosis.camera, options.camera)?;
        diagnosis.provenance = Some(about(Some(&base)));
        diagnosis.notes.extend(base.notes);
        return Ok(diagnosis);
    };
    let own = options.camera.map(|_| &base.camera);
    let preliminary = NullModel::preliminary(&baseline)?;
    both.judging.light_as(&preliminary, held_out.second_set)?;
    let given = Given::of(&both, parts, held_out);
    let (reference, mut diagnosis) = match given.agreement(&preliminary, own, progress)? {
        Some(diagnosis) => (preliminary, diagnosis),
        None => {
            let result = PreliminaryResult::new(&preliminary, &preliminary.shifted(&given.data));
            first(&result);
            match in_time(NullModel::complete(baseline, FIRST_SIGNATURE_DRAWS, progress))? {
                Some(reference) => {
                    let given = given.shifted(&reference);
                    let found = given.sets().searched(&reference, &base.camera, progress)?;
                    let diagnosis = given.said(&reference, found, own, progress)?;
                    (reference, diagnosis)
                }
                None => {
                    let given = given.shifted(&preliminary);
                    let case = given.sets();
                    let case = case.case(&preliminary, &preliminary.signatures);
                    let found = case.unfinished(Undecided::Agreement(result.likely_effects))?;
                    let diagnosis = given.said(&preliminary, found, own, progress)?;
                    (preliminary, diagnosis)
                }
            }
        }
    };
    qualify(&mut diagnosis, &reference);
    restore(&mut diagnosis.camera, options.camera)?;
    let base = if moved { base.fitted(&reference.model.camera)? } else { base };
    diagnosis.provenance = Some(about(Some(&base)));
    diagnosis.notes.extend(base.notes);
    Ok(diagnosis)
}

fn held_by(held_out: Held) -> String {
    match held_out {
        Held { second_set: true, .. } => "a second recording set",
        Held { alone: false, .. } => "the second half of every recording",
        Held { .. } => "none",
    }
    .to_owned()
}

/// What stood aside for the search: the camera's maps, its band of jitter, and where its recordings start.
fn restore(camera: &mut Camera, given: Option<&Camera>) -> Result<()> {
    if let Some(jitter) = given.and_then(|given| given.effect(readout_jitter::EFFECT.name)) {
        *camera = camera.clone().with_effect(jitter.clone());
    }
    if let Some(given) = given
        && given.maps != Maps::default()
    {
        camera.maps = given.maps.clone();
    }
    let plain = camera.clone();
    *camera = match given.map(|given| given.effect(start_phase::EFFECT.name)) {
        Some(Some(own)) => plain.with_effect(own.clone()),
        Some(None) => plain.without_effect(start_phase::EFFECT.name),
        None => plain.with_effect(start_phase::EFFECT.neutral().with_value("share", 1.0)?),
    };
    Ok(())
}

/// Two measured sets as vectors.
#[derive(Clone)]
struct Given<'a> {
    both: &'a Both,
    data: DVector<f64>,
    judging: DVector<f64>,
    located: Events,
    parts: [RecordingPart; 2],
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
    fn of(both: &'a Both, parts: [RecordingPart; 2], held_out: Held) -> Self {
        let [fitted, judging] = [&both.fitted.measured, &both.judging.measured];
        let scenes = &both.fitted.setup.recordings;
        let located = Events::new(fitted.located.clone(), judging.located.clone(), held_out.out(), scenes);
        let [data, judging] = [fitted, judging].map(|m| DVector::from_vec(m.values.clone()));
        Self { both, data, judging, located, parts, held_out }
    }

    /// With the data in the coordinates of `reference`, which knows the light of the recordings as it was found.
    fn shifted(&self, reference: &NullModel) -> Self {
        let [data, judging] = [&self.data, &self.judging].map(|data| reference.shifted(data));
        Self { data, judging, ..self.clone() }
    }

    /// The diagnosis of a set that agrees with the first simulations of the model, or `None`.
    ///
    /// The limits of `preliminary` are stricter than those of a search, so a set that agrees here raises no alarm later.
    fn agreement(
        &self,
        preliminary: &NullModel,
        camera: Option<&Camera>,
        progress: ProgressCallback<'_>,
    ) -> Result<Option<Diagnosis>> {
        let given = self.shifted(preliminary);
        let sets = given.sets();
        let signatures = sets.signatures(preliminary)?;
        let Some(found) = sets.case(preliminary, &signatures).agreement()? else { return Ok(None) };
        let diagnosis = given.said(preliminary, found, camera, progress)?;
        // A number of a camera file is judged by all simulations.
        Ok(Some(diagnosis).filter(|d| d.parameter_mismatches.is_empty()))
    }

    fn sets(&self) -> Sets<'_> {
        let Both { fitted, judging, .. } = self.both;
        let is_other = self.parts[0] != self.parts[1] || !judging.setup.has_light_of(&fitted.setup);
        let setup = is_other.then_some(&judging.setup);
        let judge = Judge { data: &self.judging, setup, held_out: self.held_out.out() };
        Sets { taken: &self.both.fitted, data: &self.data, judge, located: &self.located }
    }

    /// The words for what a search found.
    fn said(
        &self,
        reference: &NullModel,
        mut found: Found,
        camera: Option<&Camera>,
        progress: ProgressCallback<'_>,
    ) -> Result<Diagnosis> {
        let mut diagnosis = outcome(Fitter { reference, data: &self.data }, &mut found, camera)?;
        progress("pictures", 0.95);
        reference.model.context.deadline.lift();
        let last = (&found.fit.model, found.fit.u.as_slice());
        let fitted = &self.both.fitted;
        diagnosis.rates = rate_residuals(reference, &found, &self.data, &fitted.measured.scans);
        diagnosis.traces.plots = set_plots(reference, &fitted.set, &fitted.measured.scans, last)?;
        let Held { second_set, alone } = self.held_out;
        diagnosis.notes.extend(set_notes(&fitted.setup, &self.both.aside, second_set, alone));
        diagnosis.faults.clone_from(&self.both.faults);
        Ok(diagnosis)
    }
}

impl Sets<'_> {
    fn case<'a>(&'a self, reference: &'a NullModel, signatures: &'a [Signature]) -> Case<'a> {
        Case {
            fitter: Fitter { reference, data: self.data },
            signatures,
            judge: &self.judge,
            located: self.located,
        }
    }

    /// The signatures for a search of the fitted set; after the time limit, those of the null model.
    fn signatures(&self, reference: &NullModel) -> Result<Vec<Signature>> {
        let signatures = in_time(with_line(reference, &self.taken.measured))?;
        Ok(signatures.unwrap_or_else(|| reference.signatures.clone()))
    }

    fn searched(
        &self,
        reference: &NullModel,
        start: &Camera,
        progress: ProgressCallback<'_>,
    ) -> Result<Found> {
        let signatures = self.signatures(reference)?;
        let case = self.case(reference, &signatures);
        let mut found = search(&case, progress)?;
        progress("last steps", 0.94);
        if in_time(case.end(&mut found, start))?.is_none() {
            found.undecided.push(Undecided::BaseNumbers);
        }
        Ok(found)
    }
}
