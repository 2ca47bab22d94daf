//! Lamps that flicker and drift. The recordings are simulated without the library.

use spikelane_calibrate::{CalibrateOptions, Calibration, RecordingSet, calibrate, measure_levels};

use crate::calibrate_support::{LightCourse, Noise, PUBLISHED_NOISE, pixels, traces};

const WIDTH: usize = 32;
const HEIGHT: usize = 24;
const READOUTS: u32 = 4000;

/// Noise that is drawn at resets, and a dark current with shot noise, as in the preset `physical`.
const PHYSICAL_NOISE: Noise = Noise {
    threshold_sd: 0.01,
    gain_sd: 0.02,
    sigma_t: 0.000_877,
    photons: 29_851.6,
    is_redrawn: false,
    dark_electrons: 29_851.6,
    ..PUBLISHED_NOISE
};

/// Calibrates a sensor with recordings of the stated `levels`. `relative` is the relative light of a readout at a stated level.
/// Its mean over a recording is 1. `leak` is light that reaches the sensor in all recordings.
fn calibrated(noise: &Noise, levels: &[f64], leak: f64, relative: impl Fn(f64, u32) -> f64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let mut set = format!("width = {WIDTH}\nheight = {HEIGHT}\nreadout_hz = 20000.0\nlayout = \"dat-top\"\n");
    let pixels = pixels(noise, WIDTH * HEIGHT, 11);
    for (k, level) in levels.iter().enumerate() {
        let mut sums = vec![0.0];
        (0..READOUTS).for_each(|t| sums.push(sums[t as usize] + relative(*level, t)));
        let course = LightCourse { light: level + leak, rise: 0.0, sums: Some(&sums) };
        let mut bytes = vec![0_u8; WIDTH * HEIGHT / 8 * READOUTS as usize];
        for (p, times) in traces(noise, &pixels, course, READOUTS, 500 + k as u64).iter().enumerate() {
            times.iter().for_each(|t| bytes[WIDTH * HEIGHT / 8 * *t as usize + p / 8] |= 1 << (p % 8));
        }
        std::fs::write(folder.path().join(format!("{k}.dat")), bytes).unwrap();
        set += &format!("[[recording]]\nfile = \"{k}.dat\"\nlight = {level:?}\n");
    }
    let path = folder.path().join("set.toml");
    std::fs::write(&path, set).unwrap();
    let observed = measure_levels(&RecordingSet::open(&path).unwrap(), &mut |_, _| {}).unwrap();
    calibrate(&observed, &CalibrateOptions::default()).unwrap()
}

/// A sine of 20 periods of 200 readouts, which is 100 Hz.
fn sine(t: u32) -> f64 {
    (std::f64::consts::TAU * f64::from(t) / 200.0).sin()
}

fn assert_within(calibration: &Calibration, noise: &Noise) {
    let sigma = calibration.sigma_t;
    assert!((sigma.value - noise.sigma_t).abs() < 3.0 * sigma.error, "{sigma:?} for {}", noise.sigma_t);
    let electrons = calibration.photons_at_full_light;
    let is_right =
        electrons.error.is_nan() || (electrons.value - noise.photons).abs() < 3.0 * electrons.error;
    assert!(is_right, "{electrons:?} for {}", noise.photons);
}

#[test]
fn flicker_moves_neither_noise_nor_electrons() {
    for noise in [PHYSICAL_NOISE, PUBLISHED_NOISE] {
        let calibration = calibrated(&noise, &[0.0, 0.03, 0.1, 0.5], 0.0, |_, t| 1.0 + 0.02 * sine(t));
        assert_within(&calibration, &noise);
        for lamp in calibration.lamps.iter().filter(|l| l.stated_light == 0.03 || l.stated_light == 0.1) {
            let flicker = lamp.flicker.unwrap();
            assert!((flicker.frequency_hz - 100.0).abs() < 0.1, "{flicker:?}");
            assert!((flicker.depth - 0.02).abs() < 0.0004, "{flicker:?}");
            assert!(lamp.is_light_change_removed);
        }
    }
}

#[test]
fn drift_moves_neither_noise_nor_electrons() {
    let rise = |_, t: u32| 1.0 + 0.05 * (f64::from(t) / f64::from(READOUTS) - 0.5);
    let calibration = calibrated(&PHYSICAL_NOISE, &[0.0, 0.03, 0.1, 0.5], 0.0, rise);
    assert_within(&calibration, &PHYSICAL_NOISE);
    assert!(calibration.lamps.iter().filter(|l| l.drifts && l.is_light_change_removed).count() >= 3);
}

/// The dark current may have shot noise or not, so the 95 % interval covers both.
#[test]
fn without_dim_light_the_noise_covers_shot_noise_of_the_dark() {
    let calibration = calibrated(&PHYSICAL_NOISE, &[0.0, 0.3, 0.6], 0.0, |_, _| 1.0);
    let sigma = calibration.sigma_t;
    let without = PHYSICAL_NOISE.sigma_t.hypot(29_851.6_f64.powf(-0.5));
    for truth in [PHYSICAL_NOISE.sigma_t, without] {
        assert!((sigma.value - truth).abs() < 1.96 * sigma.error * 1.05, "{sigma:?} {truth}");
    }
}

/// The dark rate is 0.0047 and the leak 0.03. The leak flickers by 5 %.
#[test]
fn flicker_in_the_dark_is_reported_and_its_noise_is_not_used() {
    let calibration = calibrated(&PHYSICAL_NOISE, &[0.0, 0.1, 0.3, 0.6], 0.03, |_, t| 1.0 + 0.05 * sine(t));
    let dark = &calibration.lamps[0];
    assert!((dark.flicker.unwrap().frequency_hz - 100.0).abs() < 0.5, "{dark:?}");
    assert!(calibration.sigma_t.error.is_nan(), "{:?}", calibration.sigma_t);
    assert!(calibration.cautions().iter().any(|c| c.contains("light reaches the sensor")));
}

/// The dark current has no shot noise. Light of 0.001 in all recordings causes a sixth of the dark rate, and its shot noise is six
/// times the variance of the threshold noise. The light is within the limits that the pixels set, so the intervals cover it.
#[test]
fn the_noise_covers_shot_noise_of_light_in_the_dark() {
    let noise = Noise {
        dark: 0.0055,
        dark_sd: 0.0011,
        sigma_t: 0.0008,
        photons: 4e4,
        dark_electrons: f64::INFINITY,
        ..PHYSICAL_NOISE
    };
    for leak in [0.0, 0.001] {
        let calibration = calibrated(&noise, &[0.0, 0.03, 0.1, 0.5], leak, |_, _| 1.0);
        let (sigma, electrons) = (calibration.sigma_t, calibration.photons_at_full_light);
        assert!((sigma.value - noise.sigma_t).abs() < 1.96 * sigma.error, "{leak}: {sigma:?}");
        assert!((electrons.value - noise.photons).abs() < 1.96 * electrons.error, "{leak}: {electrons:?}");
        assert!(calibration.notes.iter().any(|n| n.contains("may contain light")), "{leak}");
    }
}
