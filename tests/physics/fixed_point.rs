//! The errors of the fixed-point arithmetic are within the bounds of the plan.
//!
//! The plan bounds the error of a rate by at most 1e-6 spikes per readout plus 2e-6 of the rate. It bounds the relative
//! error of the phase variance by 1 %.

use crate::common_oracle::{camera_with, charges, preset, seeds};
use spikelane::FrameRef;
use spikelane::SimulatorOptions;
use spikelane::spikes::{Geometry, bit};
use spikelane::unstable::draws::gauss;
use spikelane::{Backend, Camera, Plan, Simulator};

const LIGHTS: [f32; 6] = [0.0, 0.003, 0.05, 0.31, 0.77, 0.9];

#[test]
fn every_presets_bounds_are_the_designs() {
    for preset in spikelane::presets::ALL {
        let plan = Plan::new(&crate::common_oracle::preset(preset.name, 64, 2), seeds(0)).unwrap();
        let b = plan.error_bounds();
        assert!(b.rate_absolute <= 1e-6 && b.rate_relative <= 2e-6, "{}: {b:?}", preset.name);
        assert!(b.phase_variance_relative <= 0.01, "{}: {b:?}", preset.name);
    }
}

/// Returns a preset with its fixed pattern but without noise. Negative dark currents are set to zero, because they drain
/// charge.
fn noiseless_preset(name: &str) -> Camera {
    let camera = preset(name, 256, 1);
    let camera = ["shot_noise", "dark_shot_noise", "thermal_noise", "dead_time", "start_phase"]
        .iter()
        .fold(camera, |c, effect| c.without_effect(effect));
    let dark = camera.effect("dark_current").unwrap().clone().with_value("negative", 1.0).unwrap();
    camera.with_effect(dark)
}

/// The charge that a pixel collects in 2^17 readouts equals its spikes plus its stored charge. The stored charge is
/// known to 2^-16 steps. The mean increment is therefore known to 1e-14 thresholds, which is far below the error bound
/// of the plan.
#[test]
fn the_mean_increment_is_within_the_plans_bounds_of_the_exact_one() {
    let readouts = 1 << 17;
    for name in ["physical", "scsim-code"] {
        let camera = noiseless_preset(name);
        let geometry = camera.sensor.geometry;
        let model = camera.model(seeds(0)).unwrap();
        let (mut worst, mut allowed) = (0.0f64, 0.0);
        for light in LIGHTS {
            let plan = Plan::new(&camera, seeds(0)).unwrap();
            let bounds = *plan.error_bounds();
            let mut simulator = Simulator::from_plan(plan.clone());
            let mut bytes = vec![0; readouts * geometry.frame_bytes()];
            simulator.fill(FrameRef::new(&[light; 256]), &mut bytes).unwrap();
            let counts = counts(&bytes, geometry);
            for (p, charge) in charges(&plan, simulator.state()).iter().enumerate() {
                let law = model.law(p);
                let exact = (law.gain * f64::from(light) + law.dark) / law.threshold;
                if exact >= 1.0 {
                    continue;
                }
                let mean = (f64::from(counts[p]) + charge) / readouts as f64;
                // A pixel whose threshold is below the nominal threshold has fewer steps, so its bound is larger.
                let bound = bounds.rate_absolute / law.threshold + bounds.rate_relative * exact;
                let error = (mean - exact).abs();
                assert!(
                    error <= bound,
                    "{name} at {light}, pixel {p}: {mean} {exact}, off by {error:e}, bound {bound:e}"
                );
                if error / bound > worst {
                    (worst, allowed) = (error / bound, bound);
                }
            }
        }
        eprintln!("{name}: largest error is {worst:.2} of its bound ({allowed:.1e})");
        assert!(worst > 0.05, "a bound that nothing approaches is no bound");
    }
}

fn counts(bytes: &[u8], geometry: Geometry) -> Vec<u32> {
    let mut counts = vec![0; geometry.pixels()];
    for frame in bytes.chunks_exact(geometry.frame_bytes()) {
        (0..geometry.pixels()).filter(|&p| bit(frame, p)).for_each(|p| counts[p] += 1);
    }
    counts
}

/// A pixel with a negative dark current is above full scale for a long time, then in the dark. In the dark it fires its
/// surplus while its charge drains.
///
/// Without noise, the exact law predicts the number of spikes with an error of at most one spike at the last readout.
/// An implementation error would change the number by tens of spikes. Examples are a threshold that is lost at the
/// smallest value of the state, and a pixel that fires drained charge.
#[test]
fn surplus_refills_charge_that_a_negative_current_drains() {
    let camera = preset("scsim-code", 4096, 1);
    let camera = ["shot_noise", "dark_shot_noise", "thermal_noise", "dead_time", "start_phase"]
        .iter()
        .fold(camera, |c, effect| c.without_effect(effect));
    let model = camera.model(seeds(0)).unwrap();
    let geometry = camera.sensor.geometry;
    let plan = Plan::with_max_light(&camera, seeds(0), 1.6).unwrap();
    let mut simulator = Simulator::from_plan(plan);
    let (bright, dark) = (3300, 4000);
    let mut bytes = vec![0; dark * geometry.frame_bytes()];
    let before = &mut bytes[..bright * geometry.frame_bytes()];
    simulator.fill(FrameRef::new(&[1.6; 4096]), before).unwrap();
    simulator.fill(FrameRef::new(&[0.0; 4096]), &mut bytes).unwrap();
    let counts = counts(&bytes, geometry);
    let mut draining = 0;
    for p in (0..4096).filter(|&p| model.law(p).dark < 0.0) {
        let law = model.law(p);
        let (mut charge, mut spikes) = (0.0, 0);
        for t in 0..bright + dark {
            charge += if t < bright { law.gain * 1.6 } else { 0.0 } + law.dark;
            if charge >= law.threshold {
                charge -= law.threshold;
                spikes += u32::from(t >= bright);
            }
        }
        assert!(counts[p].abs_diff(spikes) <= 1, "pixel {p}: {} spikes, by the law {spikes}", counts[p]);
        draining += 1;
    }
    assert!(draining >= 10, "{draining} pixels with a negative current");
}

/// Compares the exact law with a plan. A reset loses a share of the charge that remains: `by_law` in the law and `lost`
/// in the plan. Returns the number of different bits and the number of spikes.
///
/// 1,024 pixels without noise run for 600 readouts above full scale. Their charge grows until resets lose as much as the
/// light adds. The pixels then run for 300 readouts below full scale, which empty the pixels, and for 300 readouts above
/// full scale.
fn differing_bits(lost: f64, by_law: f64) -> (usize, usize) {
    let loses =
        |v: f64| spikelane::effects::find("partial_reset").unwrap().neutral().with_value("lost_remainder", v);
    let mut camera = noiseless_preset("scsim-code");
    camera.sensor = spikelane::Sensor::new(1024, 1, 20_000.0).unwrap();
    let camera = camera.with_effect(loses(lost).unwrap());
    let (geometry, model) = (camera.sensor.geometry, camera.model(seeds(0)).unwrap());
    let stretches = [(600, 1.6f32), (300, 0.11), (300, 1.3)];
    let plan = Plan::with_max_light(&camera, seeds(0), 1.6).unwrap();
    assert!(plan.rules().counts_surplus && plan.tables().ceiling.is_empty());
    let mut simulator = Simulator::from_plan(plan);
    let mut bytes = Vec::new();
    for (readouts, light) in stretches {
        let mut part = vec![0; readouts * geometry.frame_bytes()];
        simulator.fill(FrameRef::new(&[light; 1024]), &mut part).unwrap();
        bytes.extend(part);
    }
    let mut differing = 0;
    for p in 0..1024 {
        let (law, mut charge, mut t) = (model.law(p), 0.0, 0);
        for (readouts, light) in stretches {
            for _ in 0..readouts {
                charge += law.gain * f64::from(light) + law.dark;
                let fires = charge >= law.threshold;
                charge = if fires { (charge - law.threshold) * (1.0 - by_law) } else { charge };
                differing += usize::from(fires != bit(&bytes[t * geometry.frame_bytes()..], p));
                t += 1;
            }
        }
    }
    (differing, spikelane::spikes::count_spikes(&bytes) as usize)
}

/// In 1,200 readouts, fixed-point arithmetic changes a charge by about 1e-6 thresholds. About one in 10^6 spikes may
/// therefore be one readout late.
///
/// With a million spikes, a few bits differ. If the lost share is 0.1 % too large, hundreds of bits differ.
#[test]
fn a_reset_loses_its_share_of_the_charge_above_full_scale_too() {
    for lost in [0.0053, 0.05, 0.37] {
        let (differing, spikes) = differing_bits(lost, lost);
        let (changed, _) = differing_bits(lost, lost * 1.001);
        eprintln!(
            "loss of {lost}: {differing} bits of {spikes} spikes apart, {changed} with a thousandth more"
        );
        assert!(differing <= 10 && changed > 400, "loss of {lost}: {differing} of {spikes}, {changed}");
    }
    let (differing, _) = differing_bits(1.0, 1.0);
    assert!(differing <= 10, "a hard reset: {differing} bits apart");
}

/// Compares the variance of the charges of 2^20 empty pixels after one readout.
///
/// The standard error of the variance is 0.14 % for one simulator and 0.07 % for the four simulators here. The test
/// allows 4.5 standard errors, which are 0.3 %, plus 1 %. The light levels are below and above the transition from
/// counted quanta to normal noise at 64 quanta. They are also below and above the transition to noise in whole steps,
/// at a standard deviation of 5 steps.
#[test]
fn shot_noise_has_its_phase_variance_to_one_per_cent_at_any_light() {
    let shot: &[(&str, f64)] = &[("strength", 1.0)];
    let camera = camera_with(1024, 1024, &[("shot_noise", shot)]);
    let electrons = camera.model(seeds(0)).unwrap().electrons();
    let geometry = camera.sensor.geometry;
    for light in [1e-4, 0.00212, 0.00216, 0.0027, 0.0029, 0.02, 0.2, 0.9] {
        let (mut sum, mut square, mut n) = (0.0, 0.0, 0.0);
        for shot in 0..4 {
            let plan = Plan::new(&camera, seeds(shot)).unwrap();
            let mut simulator = Simulator::from_plan(plan.clone());
            let mut bytes = vec![0; geometry.frame_bytes()];
            let frame = vec![light as f32; geometry.pixels()];
            simulator.fill(&frame, &mut bytes).unwrap();
            for charge in charges(&plan, simulator.state()) {
                let deviation = charge - light;
                sum += deviation;
                square += deviation * deviation;
                n += 1.0;
            }
        }
        let exact = light / electrons;
        let (bias, variance) = (sum / n, square / n);
        let off = variance / exact - 1.0;
        eprintln!("light {light}: variance off by {off:+.5}, mean by {:+.1e} of a threshold", bias);
        assert!(off.abs() < 0.01 + 4.5 * (2.0f64 / n).sqrt(), "light {light}: {off}");
        // The standard error of the mean is the standard deviation divided by 2,048. The test also allows the error of
        // the plan's bounds.
        assert!(bias.abs() < 4.5 * (exact / n).sqrt() + 1e-6 + 2e-6 * light, "light {light}: {bias}");
    }
}

/// Compares the variance of the frozen threshold noise of 2^20 new pixels with the exact variance. The noise is read
/// from the saved state, in steps.
///
/// The standard deviations are between a fraction of a step and 5 % of the threshold. Above 5 steps, noise is drawn in
/// whole steps.
#[test]
fn threshold_noise_has_its_variance_to_one_per_cent_at_any_strength() {
    for sigma in [2e-5, 1e-4, 3.3e-4, 3.45e-4, 9.64e-4, 6.36e-3, 55e-3] {
        let camera = camera_with(1024, 1024, &[("thermal_noise", &[("sigma", sigma)])]);
        let plan = Plan::new(&camera, seeds(3)).unwrap();
        let bytes = plan.initial_state().to_bytes();
        let column = |i: usize| u64::from_le_bytes(std::array::from_fn(|b| bytes[16 + 8 * i + b])) as usize;
        let lengths: Vec<usize> = (0..6).map(column).collect();
        let held = 64 + 2 * lengths[..4].iter().sum::<usize>();
        let fine = held + 2 * lengths[4];
        let word = |at: usize| i16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let value = |p: usize| {
            let fraction = if lengths[5] == 0 { 0 } else { word(fine + 2 * p) as u16 };
            f64::from(word(held + 2 * p)) + f64::from(fraction) / 65_536.0
        };
        let n = 1024 * 1024;
        let mean = (0..n).map(value).sum::<f64>() / n as f64;
        let variance = (0..n).map(|p| value(p).powi(2)).sum::<f64>() / n as f64;
        let exact = (sigma / 1.1 * f64::from(plan.threshold_steps())).powi(2);
        let off = variance / exact - 1.0;
        eprintln!(
            "{sigma} V ({} columns): variance off by {off:+.5}, mean {mean:+.2e} steps",
            lengths[5].min(1)
        );
        assert!(off.abs() < 0.01 + 4.5 * (2.0 / n as f64).sqrt(), "{sigma}: {off}");
        assert!(mean.abs() < 4.5 * (exact / n as f64).sqrt() + 0.033, "{sigma}: {mean}");
    }
}

/// The rounded product `(z m + 2^14) >> 15` rounds halves up.
///
/// For most multipliers `m`, the mean rounding error of all 65,536 draws `z` is 0. If `m` is a multiple of 2^k, the
/// mean error is at most 2^(k-16) steps.
#[test]
fn the_rounding_multiply_is_biased_only_by_its_ties() {
    let draws: Vec<i64> = (0..=u16::MAX).map(|b| i64::from(gauss::draw(b))).collect();
    for m in (122..4096i64).step_by(37).chain((7..15).map(|k| 1 << k)) {
        let sum: i64 = draws.iter().map(|z| (z * m + (1 << 14)) >> 15).sum();
        let bias = sum as f64 / 65_536.0;
        let bound = 2.0f64.powi(m.trailing_zeros() as i32 - 16);
        assert!(bias.abs() <= 1.3 * bound + 1e-4, "{m}: {bias} {bound}");
    }
}

/// A pixel starts with a charge of up to twelve thresholds and fires at every readout until no whole threshold remains.
///
/// It never fires again in the dark. The test runs on every backend.
#[test]
fn a_start_of_many_thresholds_fires_them_one_by_one() {
    let model = camera_with(256, 1, &[]).model(seeds(0)).unwrap();
    let charge = 12.0 * model.circuit.threshold_fc();
    let camera = camera_with(256, 1, &[("start_phase", &[("share", 0.0), ("charge", charge)])]);
    let geometry = camera.sensor.geometry;
    for backend in Backend::ALL.into_iter().filter(|b| b.is_available()) {
        let plan = Plan::new(&camera, seeds(0)).unwrap();
        let mut simulator = SimulatorOptions::new().backend(backend).build_from_plan(plan).unwrap();
        let mut bytes = vec![0; 40 * geometry.frame_bytes()];
        simulator.fill(&[0u8; 256], &mut bytes).unwrap();
        let frames: Vec<&[u8]> = bytes.chunks_exact(geometry.frame_bytes()).collect();
        let mut spread = [0; 12];
        for p in 0..256 {
            let spikes = frames.iter().filter(|frame| bit(frame, p)).count();
            assert!(frames[..spikes].iter().all(|frame| bit(frame, p)), "{backend}, pixel {p}: a gap");
            spread[spikes] += 1;
        }
        // 256 pixels are distributed between twelve counts. The expected number per count is 21, with a standard
        // deviation of 4.4.
        assert!(spread.iter().all(|n| (4..=43).contains(n)), "{backend}: {spread:?}");
    }
}
