//! The model that a set without a camera file starts from.

use crate::calibrate::{self, Calibration, RecordingSet};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::statistics::quantiles::Spread;
use crate::effects::{
    Camera, bias_voltage, capacitor_mismatch, dark_current, prnu, shot_noise, start_phase, thermal_noise,
};
use crate::error::Result;

/// Furthest factor from the published numbers at which a calibration is believed.
const PLAUSIBLE: f64 = 2.5;

/// The published model with the set's own numbers, as far as a static calibration gives them.
pub(in crate::diagnose) fn calibrated(set: &RecordingSet, setup: &Setup) -> Result<Camera> {
    let camera = published(setup)?;
    let found = calibrate::observe(set, &mut |_, _| {})
        .and_then(|observed| calibrate::calibrate(&observed, &calibrate::CalibrateOptions::default()));
    // A set that drifts or contradicts itself has no static calibration; the search starts from the published numbers.
    let Ok(calibration) = found else { return Ok(camera) };
    moved(&camera, &calibration)
}

fn moved(camera: &Camera, c: &Calibration) -> Result<Camera> {
    let p = &c.population;
    let sensor = &camera.sensor;
    let bias = camera.effect(bias_voltage::EFFECT.name).map_or(0.0, |e| e.values()[0]);
    let swing = sensor.swing_v + bias;
    let phi = if p.sigma_phi.value > 2.0 * p.sigma_phi.error { p.sigma_phi.value } else { 0.0455 };
    let inverse = 1.0 + phi * phi;
    let to_pa = sensor.capacitance_ff * swing / (sensor.period_s() * 1e3);
    let own = |sd: f64, mean: f64| ((sd / mean).powi(2) - phi * phi).max(1e-4).sqrt();
    let (centre_d, spread_d) = usual_dark(c);
    let mean_d = (centre_d / inverse).max(1e-6);
    let values = [
        (&prnu::EFFECT, "mean", p.mean_a.value / inverse),
        (&prnu::EFFECT, "sigma", own(p.sd_a.value, p.mean_a.value) * p.mean_a.value / inverse),
        (&bias_voltage::EFFECT, "sigma", phi * swing),
        (&dark_current::EFFECT, "mean", mean_d * to_pa),
        (&dark_current::EFFECT, "sigma", own(spread_d, centre_d).min(0.8) * mean_d * to_pa),
        (&thermal_noise::EFFECT, "sigma", c.sigma_t.value * swing),
    ];
    let mut camera = camera.clone();
    for (definition, key, value) in values {
        let effect = camera.effect(definition.name).cloned().unwrap_or_else(|| definition.neutral());
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

/// The published model at `setup`'s size: what a diagnosis starts from without a camera file.
pub(in crate::diagnose) fn published(setup: &Setup) -> Result<Camera> {
    let mut camera = crate::presets::builtin("scsim-code")?;
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let dark =
        camera.effect(dark_current::EFFECT.name).cloned().unwrap_or_else(|| dark_current::EFFECT.neutral());
    camera = camera
        .with(dark.with("negative", 1.0)?)
        .with(shot_noise::EFFECT.neutral().with("strength", 1.0)?)
        .with(start_phase::EFFECT.neutral().with("share", 1.0)?)
        .without(capacitor_mismatch::EFFECT.name);
    camera.name = "published".to_owned();
    Ok(camera)
}
