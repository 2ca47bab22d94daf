//! Tests that defects, uneven light, mosaics and wrong lamps do not move the noise by more than its errors.
//!
//! The cameras have 48x48 pixels and recordings of 4,000 readouts. The error of the threshold noise is then 1.3 %, and
//! the error of the redraw share is 0.06. A value is within its error if it deviates by less than three errors. Without a
//! fault, one of 370 values deviates by more. Each seed is fixed.

use crate::calibrate_support::score::{assert_within_error, fit, mean_and_sd, observations_at};
use crate::calibrate_support::{Noise, PUBLISHED_NOISE, Pixel, pixels};
use spikelane_calibrate::{Calibration, NoiseSampling, Observations};
use spikelane_measure::Estimate;

const SIDE: u32 = 48;
const READOUTS: u32 = 4000;
const LIGHTS: [f64; 5] = [0.0, 0.04, 0.08, 0.3, 0.6];
/// Published noise that is constant between resets.
const FROZEN_NOISE: Noise = Noise { is_redrawn: false, ..PUBLISHED_NOISE };

fn camera(noise: &Noise, seed: u64) -> Vec<Pixel> {
    pixels(noise, (SIDE * SIDE) as usize, seed)
}

fn observe(noise: &Noise, truth: &[Pixel], seed: u64) -> Observations {
    observations_at(&LIGHTS, noise, truth, SIDE, READOUTS, 100 * seed)
}

/// Checks threshold noise, redraw share and photons.
#[track_caller]
fn assert_noise(calibration: &Calibration, noise: &Noise) {
    assert_within_error("threshold noise", calibration.sigma_t, noise.sigma_t);
    let share = if noise.is_redrawn { 1.0 } else { 0.0 };
    assert_within_error("redraw share", calibration.redraw_share, share);
    assert!(calibration.is_noise_sampling_identified, "{:?}", calibration.redraw_share);
    let rule = if noise.is_redrawn { NoiseSampling::EveryReadout } else { NoiseSampling::EveryReset };
    assert_eq!(calibration.noise_sampling, rule);
    assert_within_error("photons", calibration.photons_at_full_light, noise.photons);
    assert!(calibration.sigma_t.error < 0.03 * noise.sigma_t, "{:?}", calibration.sigma_t);
}

/// With 5e-5 false spikes, every fifth pixel has a false spike in the dark. The plain mean would be 0.1 instead of
/// 0.0058.
#[test]
fn rare_false_spikes_do_not_move_the_noise() {
    for (seed, false_spikes) in [(1, 0.0), (2, 5e-6), (3, 5e-5)] {
        let noise = Noise { false_spikes, ..PUBLISHED_NOISE };
        assert_noise(&fit(&observe(&noise, &camera(&noise, seed), seed)), &noise);
    }
}

/// Light that falls off by the share `falloff` to the corners, with the mean 1.
fn with_falloff(mut truth: Vec<Pixel>, falloff: f64) -> Vec<Pixel> {
    let at = |i: usize| (2 * i + 1) as f64 / f64::from(SIDE) - 1.0;
    let light = |p: usize| {
        let (row, column) = (p / SIDE as usize, p % SIDE as usize);
        1.0 - falloff * 0.5 * (at(row).powi(2) + at(column).powi(2))
    };
    let mean = (0..truth.len()).map(light).sum::<f64>() / truth.len() as f64;
    truth.iter_mut().enumerate().for_each(|(p, pixel)| pixel.light = light(p) / mean);
    truth
}

#[test]
fn uneven_light_moves_neither_noise_nor_gain_spread() {
    for (seed, noise, falloff) in [
        (11, PUBLISHED_NOISE, 0.2),
        (12, PUBLISHED_NOISE, 0.6),
        (13, FROZEN_NOISE, 0.35),
        (14, FROZEN_NOISE, 0.5),
    ] {
        let truth = with_falloff(camera(&noise, seed), falloff);
        let calibration = fit(&observe(&noise, &truth, seed));
        assert_noise(&calibration, &noise);
        let field = calibration.light_field.as_ref().unwrap();
        // The center of a corner pixel is at 47/48 of the distance to the corner.
        let corner = falloff * (47.0_f64 / 48.0).powi(2);
        // The polynomial deviates by up to 0.5 %.
        assert!(
            (field.corner_falloff.value - corner).abs() < 3.0 * field.corner_falloff.error + 0.005,
            "{:?} for {corner}",
            field.corner_falloff
        );
        let spread = mean_and_sd(truth.iter().map(|p| p.gain / p.phi)).1;
        assert_within_error("spread of gain", calibration.population.sd_a, spread);
    }
}

#[test]
fn uniform_light_has_no_shape() {
    for seed in 21..25 {
        let calibration = fit(&observe(&PUBLISHED_NOISE, &camera(&PUBLISHED_NOISE, seed), seed));
        assert!(calibration.light_field.is_none() && calibration.class_gains.is_empty());
    }
}

#[test]
fn a_wide_gain_spread_does_not_move_the_redraw_share() {
    let noise = Noise { gain_sd: 0.1, ..FROZEN_NOISE };
    assert_noise(&fit(&observe(&noise, &camera(&noise, 31), 31)), &noise);
}

/// The classes of an RGGB sensor, and rows with half of the gain.
#[test]
fn a_mosaic_has_the_gains_of_its_classes() {
    for (seed, noise, gains) in
        [(41, PUBLISHED_NOISE, [0.55, 1.0, 1.0, 0.45]), (42, FROZEN_NOISE, [1.0, 1.0, 0.5, 0.5])]
    {
        let mut truth = camera(&noise, seed);
        let class = |p: usize| 2 * (p / SIDE as usize % 2) + p % SIDE as usize % 2;
        truth.iter_mut().enumerate().for_each(|(p, pixel)| pixel.light = gains[class(p)]);
        let calibration = fit(&observe(&noise, &truth, seed));
        assert_within_error("threshold noise", calibration.sigma_t, noise.sigma_t);
        assert_within_error(
            "redraw share",
            calibration.redraw_share,
            if noise.is_redrawn { 1.0 } else { 0.0 },
        );
        assert_eq!(calibration.class_gains.len(), 4);
        for (c, found) in calibration.class_gains.iter().enumerate() {
            let of_class =
                truth.iter().enumerate().filter(|(p, _)| class(*p) == c).map(|(_, pixel)| pixel.a());
            let (mean, _) = mean_and_sd(of_class);
            // The scale of the light is common to all classes. Its error is 1 % divided by the root of four levels.
            assert!(
                (found.value / mean - 1.0).abs() < 3.0 * found.error / mean + 1e-3,
                "{c}: {found:?} for {mean}"
            );
        }
        let mean = gains.iter().sum::<f64>() / 4.0;
        let spread = mean * mean_and_sd(truth.iter().map(|p| p.gain / p.phi)).1;
        assert_within_error("spread of gain", calibration.population.sd_a, spread);
    }
}

#[test]
fn hot_and_blinking_pixels_move_neither_noise_nor_gain_spread() {
    for (seed, noise) in [(51, PUBLISHED_NOISE), (52, FROZEN_NOISE)] {
        let mut truth = camera(&noise, seed);
        for (i, pixel) in truth.iter_mut().step_by(20).enumerate() {
            match i % 2 {
                0 => pixel.dark *= 8.0,
                _ => pixel.blink = 0.02 + 0.01 * (i % 60) as f64,
            }
        }
        let calibration = fit(&observe(&noise, &truth, seed));
        assert_noise(&calibration, &noise);
        let spread = mean_and_sd(truth.iter().map(Pixel::a)).1;
        assert_within_error("spread of gain", calibration.population.sd_a, spread);
    }
}

/// In 1,000 readouts a pixel fires about five times in the dark. The rule is right, or it is not identified.
#[test]
fn short_recordings_do_not_give_the_wrong_rule() {
    for (seed, noise) in [(61, PUBLISHED_NOISE), (62, FROZEN_NOISE), (63, FROZEN_NOISE)] {
        let observed =
            observations_at(&[0.0, 0.1, 0.3, 0.6], &noise, &camera(&noise, seed), SIDE, 1000, 100 * seed);
        let calibration = fit(&observed);
        assert_within_error(
            "redraw share",
            calibration.redraw_share,
            if noise.is_redrawn { 1.0 } else { 0.0 },
        );
        let is_redrawn = calibration.noise_sampling == NoiseSampling::EveryReadout;
        assert!(!calibration.is_noise_sampling_identified || is_redrawn == noise.is_redrawn);
        assert_within_error("threshold noise", calibration.sigma_t, noise.sigma_t);
    }
}

/// Photons at full light change with the unit of light. Electrons per threshold do not change.
#[test]
fn electrons_do_not_depend_on_the_unit_of_light() {
    let mut observed = observe(&PUBLISHED_NOISE, &camera(&PUBLISHED_NOISE, 71), 71);
    let first = fit(&observed);
    observed.levels.iter_mut().for_each(|l| l.light *= 1.3);
    let second = fit(&observed);
    let ratio = |value: fn(&Calibration) -> Estimate| value(&second).value / value(&first).value;
    // The fit of the levels ends at a relative step of 1e-7.
    assert!((ratio(|c| c.electrons_per_threshold) - 1.0).abs() < 1e-4);
    assert!((ratio(|c| c.photons_at_full_light) * 1.3 - 1.0).abs() < 1e-4);
    let mean = first.population.mean_a.value;
    assert_within_error("electrons", first.electrons_per_threshold, PUBLISHED_NOISE.photons / mean);
}

/// A lamp that is off by 20 % is named. It keeps its recording, and the other levels determine the scale.
#[test]
fn a_lamp_that_is_off_is_named_and_kept() {
    let mut observed = observe(&PUBLISHED_NOISE, &camera(&PUBLISHED_NOISE, 81), 81);
    observed.levels[3].light *= 1.2;
    observed.levels[4].light_uncertainty = Some(0.02);
    let calibration = fit(&observed);
    let off: Vec<bool> = calibration.lamps.iter().map(|l| l.is_outlier).collect();
    assert_eq!(off, [false, false, false, true, false]);
    let lamp = &calibration.lamps[3];
    // The pixels determine the light to 1e-4. The level that is off keeps 1/900 of its weight.
    assert!((lamp.found_light() / 0.3 - 1.0).abs() < 1e-3, "{lamp:?}");
    assert!((lamp.pull().unwrap() + 0.2 / 1.2 / 0.01).abs() < 0.1, "{lamp:?}");
    assert_eq!(calibration.lamps[4].stated_uncertainty, 0.02);
    assert!(calibration.notes.iter().any(|n| n.starts_with("Lamp off")), "{:?}", calibration.notes);
    assert!(calibration.to_json()["lamps"][3]["pull"].as_f64().unwrap() < -3.5);
}

/// Every lamp is off by several times its stated uncertainty. The set is accepted, and the error contains the truth.
#[test]
fn lamps_that_contradict_each_other_are_accepted() {
    let mut observed = observe(&PUBLISHED_NOISE, &camera(&PUBLISHED_NOISE, 91), 91);
    for (level, off) in observed.levels[1..].iter_mut().zip([0.04, -0.05, 0.06, -0.04]) {
        level.light *= 1.0 + off;
    }
    let calibration = fit(&observed);
    assert!(calibration.lamps.iter().filter(|l| l.is_outlier).count() >= 2, "{:?}", calibration.lamps);
    let truth = mean_and_sd(camera(&PUBLISHED_NOISE, 91).iter().map(Pixel::a)).0;
    assert_within_error("mean gain", calibration.population.mean_a, truth);
}
