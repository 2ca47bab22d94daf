//! Cameras in the benchmark tables, and the light for these cameras.

use spikelane::effects::{ALL, find};
use spikelane::{Camera, Result, Sensor};

/// The noise effects of a benchmark camera.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoiseSet {
    Ideal,
    FixedPattern,
    AllNoise,
    FewElectrons,
    /// All noise effects and the named effect.
    FullWith(&'static str),
    /// Every effect of the catalog.
    AllEffects,
}

impl NoiseSet {
    pub(crate) const ALL: [Self; 4] = [Self::Ideal, Self::FixedPattern, Self::AllNoise, Self::FewElectrons];

    /// Noise sets that are measured only with the best backend.
    pub(crate) const RARE_EFFECTS: [Self; 5] = [
        Self::FullWith("spike_coupling"),
        Self::FullWith("supply_droop"),
        Self::FullWith("correlated_shot_noise"),
        Self::FullWith("readout_jitter"),
        Self::AllEffects,
    ];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::FixedPattern => "fixed pattern",
            Self::AllNoise => "full noise",
            Self::FewElectrons => "full, few electrons",
            Self::FullWith(effect) => effect,
            Self::AllEffects => "every effect",
        }
    }

    /// Returns a camera of 400x250 pixels. Its effects have their typical strengths.
    pub(crate) fn camera(self) -> Result<Camera> {
        let typical = |name: &str| find(name).map(|d| d.typical());
        let mut camera = Camera::ideal(Sensor::new(400, 250, 40_000.0)?).with_effect(typical("start_phase")?);
        if self == Self::Ideal {
            return Ok(camera);
        }
        for name in ["saturation_clamp", "prnu", "dark_current", "bias_voltage"] {
            camera = camera.with_effect(typical(name)?);
        }
        if self == Self::FixedPattern {
            return Ok(camera);
        }
        let thermal = typical("thermal_noise")?.with_text("noise_sampling", "every-readout")?;
        camera = camera.with_effect(typical("shot_noise")?).with_effect(thermal);
        if self == Self::FewElectrons {
            let dark = typical("dark_current")?.with_value("mean", 0.1)?.with_value("sigma", 0.02)?;
            camera = camera.with_effect(typical("dark_shot_noise")?).with_effect(dark);
        }
        match self {
            Self::FullWith(effect) => Ok(camera.with_effect(typical(effect)?)),
            Self::AllEffects => Ok(ALL.iter().fold(camera, |c, d| {
                if c.effect(d.name).is_some() { c } else { c.with_effect(d.typical()) }
            })),
            _ => Ok(camera),
        }
    }

    fn light_level(self) -> usize {
        if self == Self::FewElectrons { 0 } else { 60 }
    }
}

/// Returns `count` frames of 100,000 pixels. Pixels differ within a frame and between frames.
pub(crate) fn test_frames(noise: NoiseSet, count: usize) -> Vec<Vec<u8>> {
    let level = noise.light_level();
    let spread = if level == 0 { 1 } else { 40 };
    (0..count).map(|t| (0..100_000).map(|p| (level + (p * 7 + t * 13) % spread) as u8).collect()).collect()
}
