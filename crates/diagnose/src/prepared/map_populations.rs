//! Replaces the maps of a camera by populations, which a diagnosis compares with recordings.

use crate::sensors::model::effect_or_neutral;
use crate::statistics::order::Spread;
use crate::thresholds::MIN_TAIL_SKEW;
use spikelane::effects::{Camera, bias_voltage, dark_current, dark_tail, prnu};
use spikelane::error::Result;

/// Replaces each map of a camera by a population with the same median and spread.
pub(super) fn reduced(mut camera: Camera) -> Result<Camera> {
    let maps = std::mem::take(&mut camera.maps);
    if let Some(gain) = &maps.gain {
        let spread = Spread::of(gain);
        let effect = effect_or_neutral(&camera, &prnu::EFFECT)
            .with_value("mean", spread.median())?
            .with_value("sigma", spread.sd())?;
        camera = camera.with_effect(effect);
    }
    if let Some(dark) = &maps.dark_pa {
        camera = with_dark(camera, dark)?;
    }
    if let Some(swing) = &maps.swing_v {
        let effect =
            effect_or_neutral(&camera, &bias_voltage::EFFECT).with_value("sigma", Spread::of(swing).sd())?;
        camera = camera.with_effect(effect);
    }
    Ok(camera)
}

/// Replaces the map of dark currents by a normal or a log-normal population. The log-normal population has a tail.
/// Without it, a camera whose map has a tail would be reported as missing one.
fn with_dark(camera: Camera, dark: &[f64]) -> Result<Camera> {
    let spread = Spread::of(dark);
    let logarithms = Spread::of(&dark.iter().map(|d| d.ln()).collect::<Vec<f64>>());
    let tailed =
        spread.q[0] > 0.0 && spread.skew() > MIN_TAIL_SKEW && logarithms.skew().abs() < 0.5 * spread.skew();
    let effect = effect_or_neutral(&camera, &dark_current::EFFECT);
    if tailed {
        let sigma = logarithms.sd();
        let mean = spread.median() * (0.5 * sigma * sigma).exp();
        let effect = effect.with_value("mean", mean)?.with_value("sigma", 0.0)?;
        return Ok(camera
            .with_effect(effect)
            .with_effect(dark_tail::EFFECT.neutral().with_value("log_sigma", sigma)?));
    }
    let negative = if dark.iter().any(|d| *d < 0.0) { 0.0 } else { 1.0 };
    let effect = effect
        .with_value("mean", spread.median())?
        .with_value("sigma", spread.sd())?
        .with_value("negative", negative)?;
    // The map already contains the tail of the camera file, so the effect is removed.
    Ok(camera.with_effect(effect).without_effect(dark_tail::EFFECT.name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::effects::Maps;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    /// Returns the mean, the spread and the tail of the population that replaces a map. The map contains `current`
    /// of 4,000 normal draws.
    fn of(current: impl Fn(f64) -> f64) -> [f64; 3] {
        let seeds = Seeds { camera: 3, shot: 0, sequence: 0 };
        let normals = PatternRng::new(seeds, RandomStream::from_name("reduced")).normals();
        let mut camera = spikelane::presets::builtin("scsim-code").unwrap();
        camera.maps = Maps { dark_pa: Some(normals.take(4000).map(current).collect()), ..Maps::default() };
        let camera = reduced(camera).unwrap();
        let value = |effect: &str, key| camera.effect(effect).map_or(0.0, |e| e.get(key).unwrap());
        [value("dark_current", "mean"), value("dark_current", "sigma"), value("dark_tail", "log_sigma")]
    }

    #[test]
    fn a_map_has_the_law_of_its_quantiles() {
        // The standard error of the median of 4,000 draws is 1.25 / 63 of the spread. That of a spread from
        // quartiles is 1.17 / 63 of the spread. The limits are four standard errors.
        let [mean, sigma, tail] = of(|z| 0.45 + 0.1 * z);
        assert!(
            (mean - 0.45).abs() < 0.008 && (sigma - 0.1).abs() < 0.0075 && tail == 0.0,
            "{mean} {sigma} {tail}"
        );
        let [mean, sigma, tail] = of(|z| 0.4 * (0.43 * z).exp());
        let expected = 0.4 * (0.5_f64 * 0.43 * 0.43).exp();
        assert!(
            (mean / expected - 1.0).abs() < 0.05 && sigma == 0.0 && (tail - 0.43).abs() < 0.032,
            "{mean} {tail}"
        );
    }
}
