//! The published model.

use crate::diagnose::protocol::recorded_set::Setup;
use spikelane::effects::{Camera, capacitor_mismatch, dark_current, shot_noise, start_phase};
use spikelane::error::Result;

/// The published model at `setup`'s size: what a diagnosis starts from without a camera file.
pub(in crate::diagnose) fn published(setup: &Setup) -> Result<Camera> {
    let mut camera = spikelane::presets::builtin("scsim-code")?;
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let dark =
        camera.effect(dark_current::EFFECT.name).cloned().unwrap_or_else(|| dark_current::EFFECT.neutral());
    camera = camera
        .with_effect(dark.with_value("negative", 1.0)?)
        .with_effect(shot_noise::EFFECT.neutral().with_value("strength", 1.0)?)
        .with_effect(start_phase::EFFECT.neutral().with_value("share", 1.0)?)
        .without_effect(capacitor_mismatch::EFFECT.name);
    camera.name = "published".to_owned();
    Ok(camera)
}
