//! A diagnosis from recordings to words.

use std::time::Instant;

use nalgebra::DVector;

use super::candidates::Candidate;
use super::case::{Case, Judge};
use super::diagnosis::Diagnosis;
use super::extent::{Extent, Part};
use super::model::published;
use super::outcome::outcome;
use super::picture::pictures;
use super::rebase::rebased;
use super::reference::{Progress, Reference, Signature};
use super::search::search;
use super::setup::{Measured, Setup};
use super::spread::Spread;
use super::time::{line, power, sharpened};
use crate::calibrate::{self, Calibration, Light, RecordingSet, Scene as Pattern};
use crate::effects::{Camera, find};
use crate::error::{Error, Kind, Result};

/// Power over the mean from which on a line in the frame totals is worth a frequency.
const LINE: f64 = 12.0;

/// Furthest factor from the published numbers at which a calibration is believed.
const PLAUSIBLE: f64 = 2.5;

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
    let measured = setup.measure(set)?;
    let data = DVector::from_vec(measured.values.clone());
    let built;
    let reference = match options.reference {
        Some(reference) => {
            same_protocol(&setup, &reference.setup)?;
            reference
        }
        None => {
            let camera = match options.camera {
                // Maps are all spread: what the base cannot hold would bend it.
                Some(camera) if setup.maps => camera.clone(),
                Some(camera) => {
                    progress("own numbers", 0.0);
                    rebased(&setup, camera, &data, options.seed)?
                }
                None => calibrated(set, &setup)?,
            };
            built = Reference::new(setup.clone(), camera, options.seed, progress)?;
            &built
        }
    };
    let held = DVector::from_vec(other.measure(holdout.unwrap_or(set))?.values);
    let judge = Judge {
        data: &held,
        setup: (first != second).then_some(&other),
        held_out: holdout.is_some() || !alone,
    };
    let signatures = with_line(reference, &setup, &measured)?;
    let case = Case { reference, signatures: &signatures, data: &data, judge: &judge };
    let mut found = search(&case, progress)?;
    let mut diagnosis = outcome(reference, &mut found, &data, options.camera)?;
    if let Some((first, rows)) = setup.band {
        diagnosis.notes.push(format!(
            "The scene is large: rows {first} to {} were judged, which hold most of its even surface.",
            first + rows - 1
        ));
    }
    if let Some([fewest, most]) = setup.first_readouts {
        let first = if fewest == most { fewest.to_string() } else { format!("{fewest} to {most}") };
        diagnosis.notes.push(format!(
            "The recordings are large: the first {first} readouts of each were judged. --everything judges all of them, which sees weaker and slower effects and takes longer in proportion."
        ));
    }
    progress("pictures", 0.95);
    let last = (&found.fit.model, found.fit.u.as_slice());
    diagnosis.traces.pictures = pictures(reference, set, &measured.scans, last)?;
    if holdout.is_none() && alone {
        diagnosis
            .notes
            .push("No second set was given and this one cannot be cut: nothing was held out.".to_owned());
    } else if holdout.is_none() {
        diagnosis.notes.push(
            "No second set was given: the first half of every recording was fitted and the second half judged it, so effects must be stronger to be seen. A second set of the same scenes doubles what can be told.".to_owned(),
        );
    }
    if options.camera.is_none() {
        diagnosis.notes.push("No camera file was given: gain, dark current, their spreads, the threshold's spread and noise and the electrons of a spike were calibrated.".to_owned());
    }
    diagnosis.seconds = start.elapsed().as_secs_f64();
    Ok(diagnosis)
}

/// What every diagnosis needs.
fn poor(setup: &Setup, with_camera: bool) -> Result<()> {
    // Maps, or a still scene, judge a camera that is given.
    if with_camera && (setup.maps || setup.scenes.iter().any(|s| s.still.is_some())) {
        return Ok(());
    }
    let levels: Vec<f64> = setup.scenes.iter().filter_map(super::recorded::Scene::level).collect();
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

/// The published model with the set's own numbers, as far as a static calibration gives them.
fn calibrated(set: &RecordingSet, setup: &Setup) -> Result<Camera> {
    let camera = published(setup)?;
    let found = calibrate::observe(set, &mut |_, _| {})
        .and_then(|observed| calibrate::calibrate(&observed, &calibrate::Options::default()));
    // A set that drifts or contradicts itself has no static calibration; the search starts from the published numbers.
    let Ok(calibration) = found else { return Ok(camera) };
    moved(&camera, &calibration)
}

fn moved(camera: &Camera, c: &Calibration) -> Result<Camera> {
    let p = &c.population;
    let sensor = &camera.sensor;
    let bias = camera.effect("bias_voltage").map_or(0.0, |e| e.values()[0]);
    let swing = sensor.swing_v + bias;
    let phi = if p.sigma_phi.value > 2.0 * p.sigma_phi.error { p.sigma_phi.value } else { 0.0455 };
    let inverse = 1.0 + phi * phi;
    let to_pa = sensor.capacitance_ff * swing / (sensor.period_s() * 1e3);
    let own = |sd: f64, mean: f64| ((sd / mean).powi(2) - phi * phi).max(1e-4).sqrt();
    let (centre_d, spread_d) = usual_dark(c);
    let mean_d = (centre_d / inverse).max(1e-6);
    let values = [
        ("prnu", "mean", p.mean_a.value / inverse),
        ("prnu", "sigma", own(p.sd_a.value, p.mean_a.value) * p.mean_a.value / inverse),
        ("bias_voltage", "sigma", phi * swing),
        ("dark_current", "mean", mean_d * to_pa),
        ("dark_current", "sigma", own(spread_d, centre_d).min(0.8) * mean_d * to_pa),
        ("thermal_noise", "sigma", c.sigma_t.value * swing),
    ];
    let mut camera = camera.clone();
    for (name, key, value) in values {
        let effect = camera.effect(name).cloned().unwrap_or(find(name)?.neutral());
        // An effect that is not in the model can send a static calibration anywhere; the search's own
        // fit of these numbers then starts from the published ones.
        let usable = (1.0 / PLAUSIBLE..PLAUSIBLE).contains(&(value / effect.get(key)?));
        camera = if usable { camera.with(effect.with(key, value)?) } else { camera };
    }
    Ok(camera)
}

/// Dark rate of most pixels, and how it differs between them: a few hot ones would double a plain spread, and the search
/// would have to bring it back before it could name them.
fn usual_dark(c: &Calibration) -> (f64, f64) {
    let d: Vec<f64> = c.fits.iter().map(|f| f.d).collect();
    let errors: Vec<f64> = c.fits.iter().map(|f| f.var_d).collect();
    let (spread, error) = (Spread::of(&d), Spread::of(&errors).median());
    (spread.median(), (spread.sd().powi(2) - error).max(0.0).sqrt())
}

/// The signatures, with that of a flicker at the frequency that the frame totals show.
fn with_line(reference: &Reference, setup: &Setup, measured: &Measured) -> Result<Vec<Signature>> {
    let mut signatures = reference.signatures.clone();
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
    let mut flickers = 0;
    signatures.retain(|s| {
        flickers += usize::from(s.candidate.name == "flicker");
        s.candidate.name != "flicker" || flickers == 1
    });
    for signature in signatures.iter_mut().filter(|s| s.candidate.name == "flicker") {
        let mut candidate: Candidate = signature.candidate.clone();
        for (knob, at) in candidate.knobs.iter_mut().zip(&mut candidate.at) {
            if knob.key == "frequency_hz" {
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
