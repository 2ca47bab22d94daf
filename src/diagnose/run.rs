//! A diagnosis from recordings to words.

use std::borrow::Cow;
use std::time::Instant;

use nalgebra::DVector;

use crate::calibrate::{self, Light, Pattern, RecordingSet};
use crate::diagnose::answer::diagnosis::Diagnosis;
use crate::diagnose::answer::notes::of_the_sets;
use crate::diagnose::answer::outcome::outcome;
use crate::diagnose::answer::pictures::pictures;
use crate::diagnose::events::located::Events;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::null::reference::{Progress, Reference};
use crate::diagnose::null::signature::Signature;
use crate::diagnose::protocol::extent::{Extent, Part};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::search::context::{Case, Judge};
use crate::diagnose::search::own_numbers::rebased;
use crate::diagnose::search::search::{Found, search};
use crate::diagnose::sensors::catalogue::Candidate;
use crate::diagnose::sensors::published::calibrated;
use crate::diagnose::statistics::measured::Measured;
use crate::diagnose::statistics::measured::measure;
use crate::diagnose::statistics::readouts::{line, power, sharpened};
use crate::effects::{Camera, Catalogue, Definition};
use crate::error::{Error, Kind, Result};

/// Power over the mean from which on a line in the frame totals is worth a frequency.
const LINE: f64 = 12.0;

/// What a diagnosis is given besides the recordings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// The model to start from; without one the published model is calibrated.
    pub camera: Option<&'a Camera>,
    /// Simulations of an earlier diagnosis under the same protocol.
    pub reference: Option<&'a Reference>,
    /// Seed of all simulations.
    pub seed: u64,
    /// How much of large recordings is judged.
    pub extent: Extent,
    /// The effects that are looked for; without them those of this library. A `reference` has its own.
    pub effects: Option<&'a Catalogue>,
}

/// Finds what the model lacks.
///
/// With `holdout` the second set judges what the first one names; without it every recording is
/// cut in the middle.
///
/// # Errors
/// When a recording cannot be read, is too short, or the sets' protocols differ.
pub fn diagnose(
    set: &RecordingSet,
    holdout: Option<&RecordingSet>,
    options: Options<'_>,
    progress: Progress<'_>,
) -> Result<Diagnosis> {
    let start = Instant::now();
    let still = |r: &calibrate::Recording| matches!(r.light, Light::Scene(Pattern::StaticUnknown {}));
    let alone = set.recordings.is_empty() || set.recordings.iter().any(still);
    let (first, second) =
        if holdout.is_some() || alone { (Part::Whole, Part::Whole) } else { (Part::First, Part::Second) };
    let extent = options.extent;
    let (setup, other) = (Setup::of(set, first, extent)?, Setup::of(holdout.unwrap_or(set), second, extent)?);
    poor(&setup, options.camera.is_some())?;
    same_protocol(&setup, &other)?;
    progress("reading", 0.0);
    let measured = measure(&setup, set)?;
    let data = DVector::from_vec(measured.values.clone());
    let other_measured = measure(&other, holdout.unwrap_or(set))?;
    let held = DVector::from_vec(other_measured.values);
    let held_out = holdout.is_some() || !alone;
    let judge = Judge { data: &held, setup: (first != second).then_some(&other), held_out };
    let located = Events::new(measured.located.clone(), other_measured.located, held_out, &setup.scenes);
    let sets = Sets { set, measured: &measured, data: &data, judge: &judge, located: &located };
    let (reference, mut found) = match options.reference {
        Some(reference) => {
            same_protocol(&setup, &reference.setup)?;
            let signatures = with_line(reference, &measured)?;
            (Cow::Borrowed(reference), search(&sets.case(reference, &signatures), progress)?)
        }
        None => {
            let (reference, found) = sets.searched(setup.clone(), options, progress)?;
            (Cow::Owned(reference), found)
        }
    };
    let mut diagnosis = outcome(Fitter { reference: &reference, data: &data }, &mut found, options.camera)?;
    progress("pictures", 0.95);
    let last = (&found.fit.model, found.fit.u.as_slice());
    diagnosis.traces.pictures = pictures(&reference, set, &measured.scans, last)?;
    diagnosis.notes.extend(of_the_sets(&setup, options.camera, holdout.is_some(), alone));
    diagnosis.seconds = start.elapsed().as_secs_f64();
    Ok(diagnosis)
}

/// What a search is given besides a reference.
struct Sets<'a> {
    set: &'a RecordingSet,
    measured: &'a Measured,
    data: &'a DVector<f64>,
    judge: &'a Judge<'a>,
    located: &'a Events,
}

impl Sets<'_> {
    fn case<'a>(&'a self, reference: &'a Reference, signatures: &'a [Signature]) -> Case<'a> {
        Case {
            fitter: Fitter { reference, data: self.data },
            signatures,
            judge: self.judge,
            located: self.located,
        }
    }

    /// From the camera that is given, or from a calibrated one.
    fn searched(
        &self,
        setup: Setup,
        options: Options<'_>,
        progress: Progress<'_>,
    ) -> Result<(Reference, Found)> {
        let given = options.camera.map_or_else(|| calibrated(self.set, &setup), |c| Ok(c.clone()))?;
        let camera = match options.camera {
            // Maps are all spread: what the base cannot hold would bend it.
            Some(_) if !setup.maps => {
                progress("own numbers", 0.0);
                rebased(&setup, &given, self.data, options.seed)?
            }
            _ => given.clone(),
        };
        let library = Catalogue::new();
        let effects = options.effects.unwrap_or(&library);
        let reference = Reference::with_effects(setup, camera, options.seed, effects, progress)?;
        let signatures = with_line(&reference, self.measured)?;
        let case = self.case(&reference, &signatures);
        let mut found = search(&case, progress)?;
        progress("last steps", 0.94);
        case.end(&mut found, &given)?;
        Ok((reference, found))
    }
}

/// What every diagnosis needs.
fn poor(setup: &Setup, with_camera: bool) -> Result<()> {
    // Maps, or a still scene, judge a camera that is given.
    if with_camera && (setup.maps || setup.scenes.iter().any(|s| s.still.is_some())) {
        return Ok(());
    }
    let levels: Vec<f64> =
        setup.scenes.iter().filter_map(crate::diagnose::protocol::recorded::Scene::level).collect();
    let lit = levels.iter().filter(|l| **l > 0.0).count();
    if levels.len() >= 3 && lit >= 2 && setup.geometry.width() >= 8 && setup.geometry.height() >= 8 {
        return Ok(());
    }
    Err(Error::new(Kind::Input, "recording set")
        .found(format_args!("{} uniform levels, {lit} of them lit, at {}", levels.len(), setup.geometry))
        .expected("the dark and two or more lit levels, 8x8 pixels or more")
        .remedy(
            "record the dark, flats at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation, steps and a checkerboard",
        ))
}

fn same_protocol(a: &Setup, b: &Setup) -> Result<()> {
    let key = |s: &Setup| {
        let scenes: Vec<_> = s.scenes.iter().map(|x| (format!("{:?}", x.light), x.readouts)).collect();
        (s.geometry, s.readout_hz.to_bits(), scenes)
    };
    if key(a) == key(b) {
        return Ok(());
    }
    Err(Error::new(Kind::Input, "held-out recordings")
        .found("other scenes, lengths or another size")
        .expected("the same scenes in the same order, as long as those of the first set"))
}

/// The signatures, with those of swinging light at the frequency that the frame totals show.
fn with_line(reference: &Reference, measured: &Measured) -> Result<Vec<Signature>> {
    let (setup, mut signatures) = (&reference.setup, reference.signatures.clone());
    let mut best = (0.0, LINE);
    let mut bright: Vec<&[u32]> = Vec::new();
    for (scene, scan) in setup.scenes.iter().zip(&measured.scans) {
        if scene.constant() && scene.brightness() >= 0.2 {
            let found = line(&power(&scan.totals), scan.totals.len());
            best = if found.1 > best.1 { found } else { best };
            bright.push(&scan.totals);
        }
    }
    if best.0 == 0.0 {
        return Ok(signatures);
    }
    let frequency = sharpened(&bright, best.0);
    // One at the line stands for those at the frequencies that a strength is judged by.
    let mut kept: Vec<&Definition> = Vec::new();
    signatures.retain(|s| {
        let (effect, again) = (s.candidate.effect, kept.contains(&s.candidate.effect));
        kept.push(effect);
        line_of(effect).is_none() || !again
    });
    for signature in &mut signatures {
        let Some(line) = line_of(signature.candidate.effect) else { continue };
        let mut candidate: Candidate = signature.candidate.clone();
        for (knob, at) in candidate.knobs.iter_mut().zip(&mut candidate.at) {
            if knob.key == line {
                knob.centre = frequency * setup.readout_hz;
                // A third of the line's width: what the sharpened line leaves open.
                let bin = 0.3 / (frequency * setup.scenes[0].readouts as f64);
                knob.range = (knob.centre * (1.0 - bin), knob.centre * (1.0 + bin));
                *at = 0.0;
            }
        }
        *signature = reference.signature(candidate)?;
    }
    Ok(signatures)
}

/// The key of an effect's frequency, if it makes the light swing.
fn line_of(effect: &Definition) -> Option<&'static str> {
    effect.tried().find(|(_, tried)| tried.is_line).map(|(param, _)| param.key)
}
