//! Tests that color cameras are calibrated for each filter, with and without a declared mosaic.
//!
//! The cameras have 48x48 pixels, published noise and recordings of 4,000 readouts. A value is within its error if it
//! deviates by less than three errors. Each seed is fixed.

use crate::calibrate_support::score::{assert_within_error, fit, mean_and_sd, observations_at};
use crate::calibrate_support::{PUBLISHED_NOISE, Pixel, pixels};
use spikelane::sensor::Mosaic;
use spikelane_calibrate::{CalibrateOptions, Calibration, ColorFilters, Observations, calibrate};

const SIDE: usize = 48;
const READOUTS: u32 = 4000;
const LIGHTS: [f64; 5] = [0.0, 0.04, 0.08, 0.3, 0.6];
const BAYER: [&str; 4] = ["RGGB", "BGGR", "GRBG", "GBRG"];

/// The light of the lamp behind each filter.
fn filter_light(name: char) -> f64 {
    match name {
        'R' => 0.55,
        'B' => 0.4,
        _ => 1.0,
    }
}

/// Returns the letter of pixel `p`. The letters are counted here, without the library's parser.
fn letter(pattern: &str, p: usize) -> char {
    let index = 2 * (p / SIDE % 2) + p % SIDE % 2;
    pattern.chars().nth(index).unwrap()
}

fn color_camera(pattern: &str, seed: u64) -> Vec<Pixel> {
    let mut truth = pixels(&PUBLISHED_NOISE, SIDE * SIDE, seed);
    truth.iter_mut().enumerate().for_each(|(p, pixel)| pixel.light = filter_light(letter(pattern, p)));
    truth
}

fn observe(truth: &[Pixel], seed: u64, filters: ColorFilters) -> Observations {
    let observed = observations_at(&LIGHTS, &PUBLISHED_NOISE, truth, SIDE as u32, READOUTS, 100 * seed);
    Observations { filters, ..observed }
}

fn declared(pattern: &str) -> ColorFilters {
    ColorFilters::Mosaic(pattern.parse().unwrap())
}

#[track_caller]
fn assert_sensor(calibration: &Calibration, truth: &[Pixel]) {
    assert_within_error("threshold noise", calibration.sigma_t, PUBLISHED_NOISE.sigma_t);
    assert_within_error("redraw share", calibration.redraw_share, 1.0);
    // The pixels behind the filter that transmits the most have the gain 1.
    assert_within_error("photons", calibration.photons_at_full_light, PUBLISHED_NOISE.photons);
    let dark = mean_and_sd(truth.iter().map(Pixel::d)).0;
    assert_within_error("dark rate", calibration.population.mean_d, dark);
    assert!(calibration.hot_pixels.len() + calibration.poor_fit_pixels.len() < 10);
}

#[test]
fn each_filter_of_a_declared_bayer_pattern_has_its_light_and_its_population() {
    for (seed, pattern) in (61..).zip(BAYER) {
        let truth = color_camera(pattern, seed);
        let calibration = fit(&observe(&truth, seed, declared(pattern)));
        assert_sensor(&calibration, &truth);
        assert_eq!(calibration.channels.iter().map(|c| c.name).collect::<String>(), "RGB", "{pattern}");
        for channel in &calibration.channels {
            let here = truth.iter().enumerate().filter(|(p, _)| letter(pattern, *p) == channel.name);
            let (mean, spread) = mean_and_sd(here.map(|(_, pixel)| pixel.a()));
            assert_within_error("light", channel.light, filter_light(channel.name));
            assert_within_error("spread", channel.population.sd_a, spread);
            // All channels share the scale of the light. Its error is 1 % divided by the root of four levels.
            let gain = channel.population.mean_a.value / mean;
            assert!((gain - 1.0).abs() < 3.0 * 0.005, "{pattern} {}: {gain}", channel.name);
        }
        let mosaic = calibration.camera().unwrap().mosaic.unwrap();
        assert_eq!(mosaic.to_string(), pattern);
        for channel in mosaic.channels() {
            // The mean of 576 gains has a relative error of 0.3 %.
            assert!((channel.white() / filter_light(channel.name) - 1.0).abs() < 0.012, "{channel:?}");
        }
    }
}

#[test]
fn undeclared_filters_are_found_and_calibrated() {
    for (seed, pattern) in (71..).zip(BAYER) {
        let truth = color_camera(pattern, seed);
        let observed = observe(&truth, seed, ColorFilters::Unknown);
        let named = observed.detected_mosaics().expect("a pattern").map(|mosaic| mosaic.to_string());
        assert!(named.contains(&pattern.to_owned()), "{named:?}");
        let calibration = fit(&observed);
        assert_sensor(&calibration, &truth);
        assert_eq!(calibration.mosaic.as_ref().map(Mosaic::to_string).as_deref(), Some("KLMN"));
        for (class, channel) in calibration.channels.iter().enumerate() {
            assert_within_error("light", channel.light, filter_light(pattern.chars().nth(class).unwrap()));
        }
    }
}

#[test]
fn filters_that_the_set_excludes_are_gains() {
    let truth = color_camera("RGGB", 75);
    let calibration = fit(&observe(&truth, 75, ColorFilters::Absent));
    assert!(calibration.mosaic.is_none() && calibration.channels.is_empty());
    assert_eq!(calibration.class_gains.len(), 4);
}

#[test]
fn a_wrong_phase_is_an_error_that_names_the_right_one_and_a_swap_of_red_and_blue_is_not() {
    for pattern in ["RGGB", "GRBG"] {
        let truth = color_camera(pattern, 81);
        for wrong in BAYER {
            let result = calibrate(&observe(&truth, 81, declared(wrong)), &CalibrateOptions::default());
            // The green pixels of RGGB and BGGR are at the same positions.
            let is_same_phase =
                letter(wrong, 0) == 'G' && pattern == "GRBG" || letter(wrong, 0) != 'G' && pattern == "RGGB";
            match result {
                Ok(_) => assert!(is_same_phase, "{pattern} {wrong}"),
                Err(error) => {
                    assert!(!is_same_phase, "{pattern} {wrong}: {error}");
                    assert!(error.to_string().contains(pattern), "{pattern} {wrong}: {error}");
                }
            }
        }
    }
}

#[test]
fn quad_filters_have_one_population_per_color() {
    let pattern = "RRGG/RRGG/GGBB/GGBB";
    let rows: Vec<&str> = pattern.split('/').collect();
    let name = |p: usize| rows[p / SIDE % 4].chars().nth(p % SIDE % 4).unwrap();
    let mut truth = pixels(&PUBLISHED_NOISE, SIDE * SIDE, 91);
    truth.iter_mut().enumerate().for_each(|(p, pixel)| pixel.light = filter_light(name(p)));
    let calibration = fit(&observe(&truth, 91, declared("quad-RGGB")));
    assert_sensor(&calibration, &truth);
    for channel in &calibration.channels {
        assert_within_error("light", channel.light, filter_light(channel.name));
    }
}

#[test]
fn a_lamp_that_changes_its_color_is_a_caution() {
    let truth = color_camera("RGGB", 95);
    let mut observed = observe(&truth, 95, declared("RGGB"));
    let is_warm = |c: &Calibration| c.cautions().iter().any(|text| text.contains("color of the lamps"));
    assert!(!is_warm(&fit(&observed)));
    // The lamp of the level 0.3 has 5 % more red light.
    let warm: Vec<Pixel> = (0..)
        .zip(&truth)
        .map(|(p, pixel)| Pixel {
            light: pixel.light * if letter("RGGB", p) == 'R' { 1.05 } else { 1.0 },
            ..*pixel
        })
        .collect();
    observed.levels[3] = observe(&warm, 96, ColorFilters::Unknown).levels.swap_remove(3);
    let calibration = fit(&observed);
    assert!(is_warm(&calibration), "{:?}", calibration.channels);
}
