//! Tests of SCSim's published code: its dark rate, the spreads of its rates, its synchronized start, and the effect of
//! threshold noise, which raises the rate of dim pixels.

use crate::common_oracle::{Estimate, camera_with, oracle, preset, seeds, simulate_times};
use spikelane::{Camera, Simulator, effects};

/// Returns the spikes per readout of every pixel in uniform light. The stream is not stored.
fn rates(camera: &Camera, light: f32, warm: usize, readouts: usize) -> Vec<f64> {
    let geometry = camera.sensor.geometry;
    let frame = vec![light; geometry.pixels()];
    let mut simulator = Simulator::new(camera, seeds(2)).unwrap();
    let mut bytes = vec![0; 100 * geometry.frame_bytes()];
    let mut counts = vec![0u32; geometry.pixels()];
    for block in 0..(warm + readouts) / 100 {
        simulator.fill(&frame, &mut bytes).unwrap();
        if block < warm / 100 {
            continue;
        }
        for packed in bytes.chunks_exact(geometry.frame_bytes()) {
            for (i, byte) in packed.iter().enumerate().filter(|(_, b)| **b != 0) {
                (0..8).filter(|b| byte >> b & 1 != 0).for_each(|b| counts[8 * i + b] += 1);
            }
        }
    }
    counts.iter().map(|&c| f64::from(c) / readouts as f64).collect()
}

fn mean_and_cv(values: &[f64]) -> (f64, f64) {
    let e = Estimate::from_values(values.iter().copied());
    (e.mean, e.error * (e.pixels as f64).sqrt() / e.mean)
}

/// The nominal dark interval is the threshold divided by the mean dark current, which is 213.9 readouts.
///
/// The mean rate is higher than the nominal rate for three reasons:
///
/// * The mean of 1/threshold exceeds 1/(mean threshold) by the relative variance of the threshold (0.21 %).
/// * A pixel with a negative current has the rate zero, not a negative rate (0.06 %).
/// * With threshold noise that is redrawn at every readout, pixels fire early. A simulation of the exact law gives the
///   factor by which this noise raises the rate.
///
/// With 100,000 pixels and 4,000 readouts, the standard error of the plan's mean rate is 4e-5 for a given fixed
/// pattern. A simulation of the exact law with 400 pixels and 20,000 readouts gives the factor by which noise raises
/// the rate. The standard error of this factor is 0.05 %. The test allows 0.25 %. The nominal rate differs by 0.6 %.
#[test]
fn the_dark_interval_is_the_exact_laws_and_not_the_nominal_one() {
    let camera = preset("scsim-code", 400, 250);
    let model = camera.model(seeds(2)).unwrap();
    let ideal = |p: usize| (model.law(p).dark / model.law(p).threshold).max(0.0);
    let expected: Vec<f64> = (0..100_000).map(ideal).collect();

    let small = preset("scsim-code", 400, 1);
    let few = oracle(&small.model(seeds(2)).unwrap(), &[0.0; 400], 10_000, 20_000, 1);
    let raised = few.rate().mean / Estimate::from_values(expected[..400].iter().copied()).mean;

    let (mean, cv) = mean_and_cv(&rates(&camera, 0.0, 4000, 4000));
    let (ideal_mean, ideal_cv) = mean_and_cv(&expected);
    let predicted = ideal_mean * raised;
    eprintln!(
        "1/(mean dark rate): plan {:.2}, oracle {:.2} (without noise {:.2}), nominal {:.2}; CV {cv:.4}, oracle {ideal_cv:.4}; factor {raised:.5}",
        1.0 / mean,
        1.0 / predicted,
        1.0 / ideal_mean,
        4.348 * 1.0924 / (0.4442 * 0.05)
    );
    assert!((mean / predicted - 1.0).abs() < 0.0025, "{mean} {predicted}");
    assert!((1.0 / mean - 212.6).abs() < 0.8, "{}", 1.0 / mean);
    // With 100,000 pixels, the standard error of the spread is 0.22 %. The randomness of counts adds 0.001 to the
    // spread.
    assert!((cv - ideal_cv).abs() < 0.005 && (cv - 0.39).abs() < 0.01, "{cv} {ideal_cv}");
}

/// The spreads of capacitor (0.29 %), bias (4.55 %) and gain (5.77 %) together spread the rate from light by 7.35 %.
///
/// The dark current reduces the relative spread of the rates. With 100,000 pixels, the standard error of the spread is
/// 0.22 %.
#[test]
fn light_spreads_by_seven_per_cent() {
    let camera = preset("scsim-code", 400, 250);
    let model = camera.model(seeds(2)).unwrap();
    let ideal: Vec<f64> =
        (0..100_000).map(|p| model.law(p)).map(|law| (law.gain * 0.5 + law.dark) / law.threshold).collect();
    let (_, cv) = mean_and_cv(&rates(&camera, 0.5, 100, 600));
    let (_, expected) = mean_and_cv(&ideal);
    eprintln!("light CV: plan {cv:.4}, oracle {expected:.4}");
    assert!((cv - expected).abs() < 0.001 && (cv - 0.073).abs() < 0.002, "{cv} {expected}");
}

/// If all pixels start within a fifth of a threshold, they fire together under light of 0.19 thresholds per readout.
///
/// The standard error of a share of 20,000 pixels is at most 0.0035.
#[test]
fn its_own_start_phase_fires_in_a_burst_and_a_uniform_one_does_not() {
    let code_camera = preset("scsim-code", 400, 50);
    let uniform = code_camera
        .clone()
        .with_effect(effects::find("start_phase").unwrap().neutral().with_value("share", 1.0).unwrap());
    let light = vec![0.19f32; 20_000];
    let shares = |camera: &Camera| -> (Vec<f64>, Vec<f64>) {
        let at = |times: &crate::common_oracle::SpikeTimes, t: u32| {
            times.pixels.iter().filter(|p| p.contains(&t)).count() as f64 / 20_000.0
        };
        let simulated = simulate_times(camera, seeds(2), &light, 0, 20);
        let truth = oracle(&camera.model(seeds(2)).unwrap(), &light, 0, 20, 3);
        (0..20).map(|t| (at(&simulated, t), at(&truth, t))).unzip()
    };
    let (simulated, truth) = shares(&code_camera);
    let mean = 0.1947;
    eprintln!("shares firing at readouts 0 to 9: {:.3?}, oracle {:.3?}", &simulated[..10], &truth[..10]);
    assert!(simulated[..3].iter().all(|&s| s < 0.001), "{simulated:?}");
    assert!((simulated[4] / mean - 3.7).abs() < 0.25, "{}", simulated[4] / mean);
    for (a, b) in simulated.iter().zip(&truth) {
        // Plan and law have equal pixels but different start phases. 4.5 standard errors of the difference of two
        // shares of 20,000 pixels are at most 0.0225.
        assert!((a - b).abs() < 0.0225, "{simulated:?} {truth:?}");
    }
    let (simulated, truth) = shares(&uniform);
    for share in simulated.iter().chain(&truth) {
        assert!((share - mean).abs() < 4.5 * (mean * (1.0 - mean) / 20_000.0f64).sqrt(), "{simulated:?}");
    }
}

/// 400 pixels run for 20,000 readouts at rate 0.021. Each count of 420 spikes has an error of less than one spike.
///
/// If each count of 420 spikes has an error below one spike, the mean rate of 400 pixels is known to 0.01 %. The
/// difference between plan and exact law is known to 0.015 %, and the test allows 0.05 %. Without noise, the rate
/// equals the light exactly.
#[test]
fn threshold_noise_redrawn_at_every_readout_raises_dim_rates_and_frozen_noise_does_not() {
    for (sigma, tabled) in [(6.36e-3, 0.0015), (20e-3, 0.012), (50e-3, 0.05)] {
        for noise_sampling in [0.0, 1.0] {
            let noise: &[(&str, f64)] = &[("sigma", sigma), ("noise_sampling", noise_sampling)];
            let camera = camera_with(400, 1, &[("thermal_noise", noise), ("start_phase", &[("share", 1.0)])]);
            let light = vec![0.021f32; 400];
            let deviation = simulate_times(&camera, seeds(9), &light, 200, 20_000).rate().mean / 0.021 - 1.0;
            let model = camera.model(seeds(9)).unwrap();
            let truth = oracle(&model, &light, 200, 20_000, 4).rate().mean / 0.021 - 1.0;
            eprintln!(
                "{sigma} V, noise_sampling {noise_sampling}: plan {deviation:+.5}, oracle {truth:+.5}, tabled {tabled}"
            );
            assert!((deviation - truth).abs() < 5e-4, "{sigma} {noise_sampling}: {deviation} {truth}");
            if noise_sampling == 0.0 {
                assert!(deviation.abs() < 5e-4, "{sigma}: frozen noise moves the rate by {deviation}");
            } else {
                // The values in the table have two digits. They were measured together with the other noise of the code.
                assert!((deviation / tabled - 1.0).abs() < 0.35, "{sigma}: {deviation}, tabled {tabled}");
            }
        }
    }
}
