//! Tests that the estimator recovers the known parameters of a camera, with errors near the Cramer-Rao bound.

use crate::calibrate_support::score::{Firing, Score, mean_and_sd, observations, observations_at, score};
use crate::calibrate_support::{PUBLISHED_NOISE, Pixel, pixels};
use spikelane_calibrate::{
    CalibrateOptions, Calibration, PixelFit, calibrate, firing_draw_variance, noise_rate_gain,
};

fn report(calibration: &Calibration, s: &Score, readouts: u32) {
    println!("{} pixels, {readouts} readouts", calibration.fits.len());
    println!("rmse a {:.6} % d {:.4} %", 100.0 * s.rmse[0], 100.0 * s.rmse[1] / PUBLISHED_NOISE.dark);
    println!("over the bound {:.3?} ({:.3?} of known thresholds)", s.ratio, s.ratio_known);
    println!("coverage {:.4?}", s.coverage);
    println!("{:#?}", calibration.population);
    println!("sigma_t {:?} true {}", calibration.sigma_t, PUBLISHED_NOISE.sigma_t);
    println!(
        "electrons {:?}, share {:?}, {:?}",
        calibration.photons_at_full_light, calibration.redraw_share, calibration.noise_sampling
    );
    println!("misfits {} chi2 {:?}", calibration.poor_fit_pixels.len(), calibration.reduced_chi2());
}

fn check(width: u32, height: u32, readouts: u32, seed: u64) {
    let noise = PUBLISHED_NOISE;
    let truth = pixels(&noise, (width * height) as usize, seed);
    let calibration =
        calibrate(&observations(&noise, &truth, width, readouts), &CalibrateOptions::default()).unwrap();
    let line = |f: &PixelFit| [f.a, f.d, f.var_a, f.var_d];
    let lines: Vec<_> = calibration.fits.iter().map(line).collect();
    let s = score(&noise, &truth, &lines, readouts);
    report(&calibration, &s, readouts);
    let n = truth.len() as f64;
    // For `n` pixels, the relative error of the RMSE is `1/sqrt(2 n)`, and the error of the coverage is
    // `sqrt(.05 * .95 / n)`.
    let slack = 4.0 / (2.0 * n).sqrt();
    assert!(s.ratio.iter().all(|r| *r < 1.15 + slack && *r > 0.95 - slack), "{:?}", s.ratio);
    let slack = 4.0 * (0.05 * 0.95 / n).sqrt();
    assert!(s.coverage.iter().all(|c| (0.92 - slack..0.98 + slack).contains(c)), "{:?}", s.coverage);
    let (mean_a, sd_a) = mean_and_sd(truth.iter().map(Pixel::a));
    let (mean_d, sd_d) = mean_and_sd(truth.iter().map(Pixel::d));
    let p = &calibration.population;
    for (estimate, truth) in [(p.mean_a, mean_a), (p.sd_a, sd_a), (p.mean_d, mean_d), (p.sd_d, sd_d)] {
        println!("{:.7} for {truth:.7}, {:+.4} %", estimate.value, 100.0 * (estimate.value / truth - 1.0));
        assert!((estimate.value / truth - 1.0).abs() < 5e-3, "{estimate:?} for {truth}");
    }
    let phi = p.sigma_phi;
    assert!((phi.value - noise.threshold_sd).abs() < 3.0 * phi.error, "{phi:?}");
    assert!(
        (calibration.sigma_t.value - noise.sigma_t).abs() < 3.0 * calibration.sigma_t.error,
        "{:?}",
        calibration.sigma_t
    );
    if n > 9e4 && readouts >= 10_000 {
        assert!(phi.error / phi.value < 0.025, "{phi:?}");
        assert!(calibration.sigma_t.error / calibration.sigma_t.value < 0.005, "{:?}", calibration.sigma_t);
    }
}

#[test]
fn a_camera_of_known_truth_is_recovered_near_the_bound() {
    check(64, 40, 10_000, 5);
}

/// Returns the deviations of three estimates from the truth, in standard errors of the estimates. The estimates are the
/// spread of the thresholds, the threshold noise and the electrons. The cameras differ in their pixels and in the noise
/// draws.
///
/// The dark level and three dim levels contain all information about the noise. The bright level determines the gain.
fn calibrated_noise(width: u32, height: u32, readouts: u32, cameras: u64) -> Vec<[f64; 3]> {
    let noise = PUBLISHED_NOISE;
    let lights = [0.0, 10.0 / 255.0, 20.0 / 255.0, 30.0 / 255.0, 0.3];
    let one = |camera: u64| {
        let truth = pixels(&noise, (width * height) as usize, 1000 + camera);
        let observed = observations_at(&lights, &noise, &truth, width, readouts, 10 * camera);
        let calibration = calibrate(&observed, &CalibrateOptions::default()).unwrap();
        let phi = mean_and_sd(truth.iter().map(|p| p.phi)).1;
        let all = [
            (calibration.population.sigma_phi, phi),
            (calibration.sigma_t, noise.sigma_t),
            (calibration.photons_at_full_light, noise.photons),
        ];
        println!(
            "{camera}: {}",
            all.map(|(e, t)| format!("{:.6e} +- {:.1e} for {t:.6e}", e.value, e.error)).join(", ")
        );
        all.map(|(e, truth)| (e.value - truth) / e.error)
    };
    (0..cameras).map(one).collect()
}

/// Checks that the estimates of every camera are within three standard errors of the truth. Also checks that their mean
/// over the cameras is within three standard errors of the mean.
fn check_noise(width: u32, height: u32, readouts: u32, cameras: u64) {
    let all = calibrated_noise(width, height, readouts, cameras);
    for (i, name) in ["spread of thresholds", "threshold noise", "electrons"].into_iter().enumerate() {
        let off: Vec<f64> = all.iter().map(|z| z[i]).collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64 * (off.len() as f64).sqrt();
        println!("{name}: {off:.2?} standard errors, their mean {mean:+.2} of its own");
        assert!(off.iter().all(|z| z.abs() < 3.0), "{name}: {off:.2?}");
        assert!(mean.abs() < 3.0, "{name}: {off:.2?}");
    }
}

#[test]
fn noise_estimates_are_within_their_errors() {
    // With six cameras, the error of the threshold noise is 0.5 %, and the error of the electrons is 2 %.
    check_noise(64, 40, 10_000, 6);
}

/// A hot pixel must not be mistaken for a pixel with a low threshold. A tenth of the threshold would mean ten times the
/// noise, and the fit would choose the wrong sampling rule.
#[test]
fn hot_pixels_have_thresholds_like_the_others() {
    let noise = PUBLISHED_NOISE;
    let mut truth = pixels(&noise, 32 * 20, 77);
    truth[..15].iter_mut().for_each(|p| p.dark = 0.05);
    let lights = [0.0, 0.04, 0.08, 0.3, 0.6];
    let calibration =
        calibrate(&observations_at(&lights, &noise, &truth, 32, 4000, 900), &CalibrateOptions::default())
            .unwrap();
    assert_eq!(calibration.hot_pixels, (0..15).collect::<Vec<_>>());
    for p in 0..15 {
        let [threshold, sd] = calibration.threshold_posteriors[p];
        assert!((threshold - truth[p].phi).abs() < 4.0 * sd && sd < 0.06, "{p}: {threshold} +- {sd}");
    }
    let share = calibration.redraw_share;
    assert!((share.value - 1.0).abs() < 4.0 * share.error, "{share:?}");
}

#[test]
#[ignore = "takes minutes"]
fn long_noise_of_whole_sensors_lies_within_its_errors() {
    // With six cameras, the error of the photons is 0.27 %. Without the correction for correlated phases, the photons
    // would be too high by 1.4 %.
    check_noise(400, 250, 10_000, 6);
}

#[test]
fn simulated_firing_draws_match_the_integrals() {
    let firing = Firing::new();
    for g in [0.1, 0.3, 0.8, 2.0, 6.0, 40.0] {
        // The tolerance is about twice the sum of the error of the simulation, 0.6 %, and of its interpolation, 0.5 %.
        assert!(
            (firing.variance(g) / firing_draw_variance(g) - 1.0).abs() < 0.025,
            "{g}: {} and {}",
            firing.variance(g),
            firing_draw_variance(g)
        );
    }
    // The gain is the mean of 50,000 draws times `g`. It is as accurate as the integral only for these values of `g`.
    for g in [0.1, 0.3, 0.8, 2.0] {
        assert!(
            (firing.gain(g) / noise_rate_gain(g) - 1.0).abs() < 0.03,
            "{g}: {} and {}",
            firing.gain(g),
            noise_rate_gain(g)
        );
    }
}

#[test]
#[ignore = "400x250 pixels take minutes; the figures of docs/why/calibration.md"]
fn long_a_whole_sensor_is_recovered_near_the_bound() {
    check(400, 250, 10_000, 9);
}

#[test]
#[ignore = "a minute or more"]
fn long_recordings_are_recovered_near_the_bound() {
    check(64, 40, 100_000, 9);
}
