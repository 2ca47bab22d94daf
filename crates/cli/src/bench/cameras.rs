//! What the tables measure: cameras, and their light.

use spikelane::effects::{ALL, find};
use spikelane::{Camera, Result, Sensor};

/// What a camera of the table has.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Noise {
    Ideal,
    Fixed,
    Full,
    FewElectrons,
    /// Full noise, and this effect.
    With(&'static str),
    /// Every effect of the catalogue.
    All,
}

impl Noise {
    pub(crate) const ALL: [Self; 4] = [Self::Ideal, Self::Fixed, Self::Full, Self::FewElectrons];

    /// What is told for the widest backend alone.
    pub(crate) const RARER: [Self; 5] = [
        Self::With("spike_coupling"),
        Self::With("supply_droop"),
        Self::With("correlated_shot_noise"),
        Self::With("readout_jitter"),
        Self::All,
    ];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Fixed => "fixed pattern",
            Self::Full => "full noise",
            Self::FewElectrons => "full, few electrons",
            Self::With(effect) => effect,
            Self::All => "every effect",
        }
    }

    /// A camera of 400x250 pixels with these effects at their typical strengths.
    pub(crate) fn camera(self) -> Result<Camera> {
        let typical = |name: &str| find(name).map(|d| d.typical());
        let mut camera = Camera::ideal(Sensor::new(400, 250, 40_000.0)?).with(typical("start_phase")?);
        if self == Self::Ideal {
            return Ok(camera);
        }
        for name in ["saturation_clamp", "prnu", "dark_current", "bias_voltage"] {
            camera = camera.with(typical(name)?);
        }
        if self == Self::Fixed {
            return Ok(camera);
        }
        let thermal = typical("thermal_noise")?.with_text("redraw", "every-readout")?;
        camera = camera.with(typical("shot_noise")?).with(thermal);
        if self == Self::FewElectrons {
            let dark = typical("dark_current")?.with("mean", 0.1)?.with("sigma", 0.02)?;
            camera = camera.with(typical("dark_shot_noise")?).with(dark);
        }
        match self {
            Self::With(effect) => Ok(camera.with(typical(effect)?)),
            Self::All => Ok(ALL
                .iter()
                .fold(camera, |c, d| if c.effect(d.name).is_some() { c } else { c.with(d.typical()) })),
            _ => Ok(camera),
        }
    }

    fn level(self) -> usize {
        if self == Self::FewElectrons { 0 } else { 60 }
    }
}

/// Frames of 100,000 pixels that differ from pixel to pixel and from frame to frame.
pub(crate) fn frames(noise: Noise, count: usize) -> Vec<Vec<u8>> {
    let level = noise.level();
    let spread = if level == 0 { 1 } else { 40 };
    (0..count).map(|t| (0..100_000).map(|p| (level + (p * 7 + t * 13) % spread) as u8).collect()).collect()
}
