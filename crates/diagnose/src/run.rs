//! A diagnosis from recordings to words.

use std::path::Path;
use std::time::{Duration, Instant};

use nalgebra::DVector;

use crate::answer::diagnosis::Diagnosis;
use crate::answer::qualifications::qualify;
use crate::cache::folder::SimulationCache;
use crate::comparison::{Comparison, HeldOut};
use crate::null_model::baseline::{Baseline, FIRST_SIGNATURE_DRAWS, StartingCamera};
use crate::null_model::preliminary_result::PreliminaryResult;
use crate::null_model::reference::NullModel;
use crate::prepared::base_model::BaseModel;
use crate::prepared::prepared_set::{DataSplit, PreparedSet};
use crate::prepared::provenance::Provenance;
use crate::protocol::extent::{ReadoutSelection, RecordingPart};
use crate::protocol::recorded_set::{check_sufficient, same_protocol};
use crate::search::base_parameter_fit::rebased;
use crate::search::search::search;
use crate::search::undecided::Undecided;
use crate::sensors::context::{Deadline, SimulationContext, in_time};
use crate::sensors::model::published;
use spikelane::effects::{Camera, Catalog, Maps, readout_jitter, start_phase};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane_calibrate::ProgressCallback;
use spikelane_calibrate::{self as calibrate, ColorFilters, RecordingSet, Stimulus, StimulusPattern};

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
    let held_out = HeldOut { has_second_set: holdout.is_some(), is_divisible: !alone };
    let cache = options.cache.map(SimulationCache::open).transpose()?;
    let context = SimulationContext { cache, deadline: Deadline::new(start, options.time_limit) };
    progress("reading", 0.0);
    [Some(set), holdout].into_iter().flatten().try_for_each(check_gray)?;
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

/// Returns an error if `set` states the color filters of its camera.
fn check_gray(set: &RecordingSet) -> Result<()> {
    match set.color_filters()? {
        ColorFilters::Mosaic(mosaic) => Err(color_filter_error(format_args!("the mosaic {mosaic}"))),
        ColorFilters::Unknown | ColorFilters::Absent => Ok(()),
    }
}

/// Returns the error about a camera with color filters. The models of a diagnosis have one light for all pixels.
pub(crate) fn color_filter_error(found: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Input, "recordings of a diagnosis")
        .found(found)
        .expected("a camera without color filters, because all pixels of a model receive the same light")
        .remedy("calibrate the set, whose report compares the channels, or compare it with cameras")
}

/// Sets that share a reference with others of their protocol.
fn shared(
    sets: [&RecordingSet; 2],
    parts: [RecordingPart; 2],
    held_out: HeldOut,
    reference: &NullModel,
    options: DiagnoseOptions<'_>,
    progress: ProgressCallback<'_>,
) -> Result<Diagnosis> {
    let [fitted, judging] =
        [0, 1].map(|i| PreparedSet::of(sets[i], parts[i], options.readout_selection, &[]));
    let split = DataSplit {
        fitted: fitted?,
        judging: judging?,
        aside: Vec::new(),
        begun_over: None,
        faults: Vec::new(),
    };
    check_sufficient(&split.fitted.setup, options.camera.is_some())?;
    same_protocol(&split.fitted.setup, &split.judging.setup)?;
    same_protocol(&split.fitted.setup, &reference.setup)?;
    let comparison = Comparison::new(&split, parts, held_out).shifted(reference);
    let signatures = comparison.signatures(reference)?;
    let found = search(&comparison.search(reference, &signatures), progress)?;
    comparison.diagnosis(reference, found, options.camera, progress)
}

/// Sets with a reference of their own, of the camera that is given or that calibration finds.
fn by_itself(
    sets: [&RecordingSet; 2],
    parts: [RecordingPart; 2],
    held_out: HeldOut,
    options: DiagnoseOptions<'_>,
    context: &SimulationContext,
    progress: ProgressCallback<'_>,
    first: &mut dyn FnMut(&PreliminaryResult),
) -> Result<Diagnosis> {
    let mut split = DataSplit::read(sets, parts, options.readout_selection)?;
    same_protocol(&split.fitted.setup, &split.judging.setup)?;
    let description = Provenance::of(&split.fitted.setup, &split.fitted.set);
    let about = |base: Option<&BaseModel>| Provenance {
        held_out: held_out.description().to_owned(),
        camera: match (options.camera, base) {
            (Some(given), _) => given.name.clone(),
            (None, Some(_)) => "the published model, calibrated".to_owned(),
            (None, None) => "none, because no calibration was possible".to_owned(),
        },
        seed: options.seed,
        base_parameters: base.map_or_else(Vec::new, |b| b.numbers.clone()),
        ..description.clone()
    };
    if let Err(why) = check_sufficient(&split.fitted.setup, options.camera.is_some()) {
        if split.faults.is_empty() {
            return Err(why);
        }
        let camera = options.camera.map_or_else(|| published(&split.fitted.setup), |c| Ok(c.clone()))?;
        let about = Some(about(None));
        return Ok(Diagnosis { provenance: about, ..Diagnosis::stopped(split.faults, camera) });
    }
    progress("calibrating", 0.01);
    let base = BaseModel::of(&split, options.camera)?;
    split.fitted.find_light(&base.camera, options.seed)?;
    // The numbers of a camera file may be wrong; those of another camera stand for nothing.
    // Maps are all spread: what the base cannot hold would bend it.
    let moved = (options.camera.is_some() || base.is_guessed()) && !split.fitted.setup.has_rate_maps;
    let library = Catalog::new();
    let effects = options.effects.unwrap_or(&library);
    let mut first_simulations = || -> Result<Baseline> {
        let start = if moved {
            progress("own numbers", 0.02);
            let data = DVector::from_vec(split.fitted.measured.values.clone());
            let start = rebased(&split.fitted.setup, &base.camera, &data, options.seed, context)?;
            let is_lit_otherwise = split.fitted.find_light(&start.camera, options.seed)?;
            if is_lit_otherwise { StartingCamera::new(start.camera, context) } else { start }
        } else {
            StartingCamera::new(base.camera.clone(), context)
        };
        split.fitted.sum_sources();
        Baseline::first(split.fitted.setup.clone(), start, options.seed, effects, progress)
    };
    let Some(baseline) = in_time(first_simulations())? else {
        let mut diagnosis = Diagnosis::without_comparison(split.faults, base.camera.clone());
        restore(&mut diagnosis.camera, options.camera)?;
        diagnosis.provenance = Some(about(Some(&base)));
        diagnosis.notes.extend(base.notes);
        return Ok(diagnosis);
    };
    let own = options.camera.map(|_| &base.camera);
    let preliminary = NullModel::preliminary(&baseline)?;
    split.judging.light_as(&preliminary, held_out.has_second_set)?;
    let comparison = Comparison::new(&split, parts, held_out);
    let (reference, mut diagnosis) = match comparison.agreement(&preliminary, own, progress)? {
        Some(diagnosis) => (preliminary, diagnosis),
        None => {
            let result = PreliminaryResult::new(&preliminary, &preliminary.shifted(&comparison.fitted));
            first(&result);
            match in_time(NullModel::complete(baseline, FIRST_SIGNATURE_DRAWS, progress))? {
                Some(reference) => {
                    let comparison = comparison.shifted(&reference);
                    let found = comparison.search_result(&reference, &base.camera, progress)?;
                    let diagnosis = comparison.diagnosis(&reference, found, own, progress)?;
                    (reference, diagnosis)
                }
                None => {
                    let comparison = comparison.shifted(&preliminary);
                    let search = comparison.search(&preliminary, &preliminary.signatures);
                    let found = search.unfinished(Undecided::Agreement(result.likely_effects))?;
                    let diagnosis = comparison.diagnosis(&preliminary, found, own, progress)?;
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
