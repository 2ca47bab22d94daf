//! A diagnosis in four stages: [`Recordings`], [`Prepared`], [`Search`], [`Diagnosis`].

use std::path::Path;
use std::time::{Duration, Instant};

use crate::null_model::baseline::Baseline;
use crate::null_model::model::NullModel;
use crate::null_model::preliminary_result::PreliminaryResult;
use crate::prepared::base_model::{BaseModel, color_filter_error};
use crate::prepared::preparation::Prepared;
use crate::prepared::provenance::Provenance;
use crate::prepared::recordings::{HeldOut, Recordings};
use crate::recordings::extent::ReadoutSelection;
use crate::recordings::setup::{check_sufficient, same_protocol};
use crate::search::round::Undecided;
use crate::search::state::Search;
use crate::sensors::cache::SimulationCache;
use crate::sensors::deadline::{Deadline, SimulationContext, in_time};
use crate::sensors::model::published;
use crate::thresholds::FIRST_SIGNATURE_DRAWS;
use crate::verdict::diagnosis::Diagnosis;
use crate::verdict::qualifications::qualify;
use spikelane::effects::{Camera, Catalog, Maps, readout_jitter, start_phase};
use spikelane::error::Result;
use spikelane_calibrate::{
    ColorFilters, ProgressCallback, Recording, RecordingSet, Stimulus, StimulusPattern,
};

/// Options of a diagnosis.
#[derive(Clone, Copy, Debug, Default)]
pub struct DiagnoseOptions<'a> {
    /// The initial model. If it is `None`, the published model is calibrated from the recordings.
    pub camera: Option<&'a Camera>,
    /// The null model of an earlier diagnosis under the same protocol, with its simulations.
    ///
    /// With a null model, all recordings are compared as they are: no calibration takes place. Faults of lamps and
    /// the start phases of recordings are not checked.
    pub null_model: Option<&'a NullModel>,
    /// Seed of all simulations.
    pub seed: u64,
    /// The readouts of large recordings that are compared with the model.
    pub readout_selection: ReadoutSelection,
    /// The effects that are searched. If it is `None`, all effects of this library are searched. A `null_model`
    /// contains its own effects, which are used instead.
    pub effects: Option<&'a Catalog>,
    /// Folder of cached simulations. A later diagnosis of the same sets can reuse them, even if the earlier one was
    /// stopped.
    ///
    /// The cache does not change any result. A simulation is reused if the protocol, the camera, the lamps and the
    /// seed are identical to the last bit. It must also come from the same version of this library and of its
    /// results. The simulations of a `null_model` are not cached.
    ///
    /// Each simulation is one file, which appears only when it is complete. Several processes can therefore use one
    /// folder. A damaged file is simulated again. The diagnosis never deletes a file. Each version has its own
    /// subfolder, with some megabytes per diagnosis. You may delete a subfolder when no diagnosis is running. If
    /// `effects` contains code of another crate, the version does not identify this code: use another folder when
    /// the code changes.
    pub cache: Option<&'a Path>,
    /// Largest duration of the simulations, measured from the start of the diagnosis.
    ///
    /// At the limit, the diagnosis ends with the best result so far. The field `undecided` of [`Diagnosis`] then
    /// lists the open questions. Reading, calibrating and writing do not stop at the limit.
    ///
    /// If the diagnosis ends before the limit, its result does not depend on the limit. If the limit ends it, the
    /// result depends on the speed of the machine. With `cache`, a further diagnosis continues from the stored
    /// simulations.
    pub time_limit: Option<Duration>,
}

/// Finds the effects that a camera model is missing.
///
/// If `holdout` is given, the effects that `set` shows are tested on this second set. Otherwise, every recording is
/// divided in the middle, and the effects of the first half are tested on the second half.
///
/// # Errors
/// If a recording cannot be read or is too short, or the sets follow different protocols. If the stated light of a
/// set is not relative to saturation. If the cache folder cannot be created or written to.
pub fn diagnose(
    set: &RecordingSet,
    holdout: Option<&RecordingSet>,
    options: DiagnoseOptions<'_>,
    progress: ProgressCallback<'_>,
) -> Result<Diagnosis> {
    diagnose_with_preliminary(set, holdout, options, progress, &mut |_| {})
}

/// Finds missing effects as [`diagnose`] does, and calls `on_preliminary` with a preliminary result.
///
/// The preliminary result is available after a third of the duration of a diagnosis that finds nothing.
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
    let cache = options.cache.map(SimulationCache::open).transpose()?;
    let context = SimulationContext { cache, deadline: Deadline::new(start, options.time_limit) };
    progress("reading", 0.0);
    let stated = || [Some(set), holdout].into_iter().flatten();
    stated().try_for_each(check_gray)?;
    let sets = [set, holdout.unwrap_or(set)];
    let held_out = match holdout {
        Some(_) => HeldOut::SecondSet,
        None if is_divisible(set) => HeldOut::SecondHalves,
        None => HeldOut::None,
    };
    let mut diagnosis = match options.null_model {
        Some(null_model) => {
            let recordings = Recordings::unchecked(sets, held_out, options.readout_selection, &[])?;
            with_null_model(&recordings, &null_model.within(&context.deadline), options.camera, progress)?
        }
        None => {
            stated().try_for_each(RecordingSet::check_light_unit)?;
            let recordings = Recordings::read(sets, held_out, options.readout_selection)?;
            with_simulations(recordings, options, &context, progress, on_preliminary)?
        }
    };
    diagnosis.cache_counts = context.cache.map(|cache| [cache.hit_count(), cache.miss_count()]);
    diagnosis.seconds = start.elapsed().as_secs_f64();
    Ok(diagnosis)
}

/// Returns whether the recordings of `set` can be divided into halves. The set must contain recordings, and none of
/// them may show a static scene of unknown light.
fn is_divisible(set: &RecordingSet) -> bool {
    let is_static = |r: &Recording| matches!(r.light, Stimulus::Scene(StimulusPattern::StaticUnknown {}));
    !set.recordings.is_empty() && !set.recordings.iter().any(is_static)
}

/// Returns an error if `set` states that its camera has color filters.
fn check_gray(set: &RecordingSet) -> Result<()> {
    match set.color_filters()? {
        ColorFilters::Mosaic(mosaic) => Err(color_filter_error(format_args!("the mosaic {mosaic}"))),
        ColorFilters::Unknown | ColorFilters::Absent => Ok(()),
    }
}

/// Diagnoses recordings with the null model of an earlier diagnosis.
fn with_null_model(
    recordings: &Recordings,
    null_model: &NullModel,
    camera: Option<&Camera>,
    progress: ProgressCallback<'_>,
) -> Result<Diagnosis> {
    let [fitted, judging] = [&recordings.fitted.setup, &recordings.judging.setup];
    check_sufficient(fitted, camera.is_some())?;
    same_protocol(fitted, judging)?;
    same_protocol(fitted, &null_model.setup)?;
    let search = Search::new(recordings, null_model)?;
    let found = search.add_effects(progress)?;
    search.diagnosis(found, camera, progress)
}

/// Diagnoses recordings in three stages: preparation, comparison with simulated sensors, qualification of the result.
fn with_simulations(
    recordings: Recordings,
    options: DiagnoseOptions<'_>,
    context: &SimulationContext,
    progress: ProgressCallback<'_>,
    on_preliminary: &mut dyn FnMut(&PreliminaryResult),
) -> Result<Diagnosis> {
    let DiagnoseOptions { camera, seed, .. } = options;
    let fitted = &recordings.fitted.setup;
    same_protocol(fitted, &recordings.judging.setup)?;
    if let Err(error) = check_sufficient(fitted, camera.is_some()) {
        if recordings.faults.is_empty() {
            return Err(error);
        }
        let camera_or_published = camera.map_or_else(|| published(fitted), |c| Ok(c.clone()))?;
        let provenance = Some(Provenance::new(&recordings, camera, None, seed));
        return Ok(Diagnosis { provenance, ..Diagnosis::stopped(recordings.faults, camera_or_published) });
    }
    progress("calibrating", 0.01);
    let base = BaseModel::new(&recordings, camera)?;
    let prepared = Prepared::new(recordings, base, camera.is_some(), seed, context, progress)?;
    let library = Catalog::new();
    let baseline = prepared.baseline(options.effects.unwrap_or(&library), progress);
    let mut diagnosis = match in_time(baseline)? {
        Some(baseline) => compare(&prepared, baseline, camera.is_some(), progress, on_preliminary)?,
        None => {
            let faults = prepared.recordings.faults.clone();
            Diagnosis::without_comparison(faults, prepared.base.camera.clone())
        }
    };
    restore(&mut diagnosis.camera, camera)?;
    let Prepared { recordings, base, .. } = prepared;
    diagnosis.provenance = Some(Provenance::new(&recordings, camera, Some(&base), seed));
    diagnosis.notes.extend(base.notes);
    Ok(diagnosis)
}

/// Compares recordings with the first simulations. If they do not agree, completes the null model and searches for
/// effects.
///
/// The limits of the first simulations are stricter than those of a search. A set that is within them would
/// therefore not raise an alarm in a search.
fn compare(
    prepared: &Prepared,
    baseline: Baseline,
    is_given: bool,
    progress: ProgressCallback<'_>,
    on_preliminary: &mut dyn FnMut(&PreliminaryResult),
) -> Result<Diagnosis> {
    let Prepared { recordings, base, .. } = prepared;
    let given = is_given.then_some(&base.camera);
    let first_model = NullModel::preliminary(&baseline)?;
    let first = Search::new(recordings, &first_model)?;
    if let Some(found) = first.agreement()? {
        let mut diagnosis = first.diagnosis(found, given, progress)?;
        // The first simulations do not suffice to test the parameters of a camera file. If a parameter seems wrong,
        // all simulations test it.
        if diagnosis.parameter_mismatches.is_empty() {
            qualify(&mut diagnosis, &first_model);
            return Ok(diagnosis);
        }
    }
    let preliminary = PreliminaryResult::new(&first_model, &first.fitter.data);
    on_preliminary(&preliminary);
    let complete = in_time(NullModel::complete(baseline, FIRST_SIGNATURE_DRAWS, progress))?;
    let (found, search) = match &complete {
        Some(null_model) => {
            let search = Search::new(recordings, null_model)?;
            (search.find_effects(&base.camera, progress)?, search)
        }
        None => (first.unfinished(Undecided::Agreement(preliminary.likely_effects))?, first),
    };
    let mut diagnosis = search.diagnosis(found, given, progress)?;
    qualify(&mut diagnosis, search.fitter.reference);
    Ok(diagnosis)
}

/// Restores the properties of the given camera that the search replaced: its maps, its jitter band, and the start
/// phases of its pixels.
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
