//! Tests that the report of `measure` shows a property if and only if the recording has this property.

use crate::measure_support::{Stream, uniform};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use spikelane::effects::find;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::{Camera, Seeds, presets};
use spikelane_io::simulate::Simulator;
use spikelane_measure::{
    Estimate, MeasureOptions, MeasuredRecording, ReportedStatistic, high_pass, map_correlations,
    pattern_correlations, spectrum, summarize,
};

fn recording(stream: &Stream) -> MeasuredRecording {
    MeasuredRecording::from_frames(SpikeFramesRef::new(stream.geometry, &stream.packed()).unwrap()).unwrap()
}

fn find_statistic<'a>(all: &'a [ReportedStatistic], key: &str) -> &'a ReportedStatistic {
    all.iter().find(|t| t.key == key).unwrap()
}

/// Returns a map of white noise. The share `missing` of the pixels is NaN.
fn white(pixels: usize, missing: f64, random: &mut Pcg64Mcg) -> Vec<f64> {
    let mut pixel = || {
        let value = (0..4).map(|_| uniform(random)).sum::<f64>();
        if uniform(random) < missing { f64::NAN } else { value }
    };
    (0..pixels).map(|_| pixel()).collect()
}

#[test]
fn a_white_pattern_has_no_correlation_at_any_size() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    for (width, height, missing) in [(8, 6, 0.0), (13, 24, 0.0), (32, 24, 0.1), (96, 64, 0.0)] {
        let rounds = 200_000 / (width * height);
        let (mut estimates, mut errors) = (vec![Vec::new(); 4], [0.0; 4]);
        for _ in 0..rounds {
            let map = white(width * height, missing, &mut random);
            let c = pattern_correlations(&map, width);
            for (i, e) in [c.right, c.lower, c.diagonal, c.antidiagonal].iter().enumerate() {
                estimates[i].push(e.value);
                errors[i] += e.error / rounds as f64;
            }
        }
        for (values, stated) in estimates.into_iter().zip(errors) {
            let mean = Estimate::mean(values);
            // The mean of a ratio has a bias of order 1 / pixels. The bias is less than a fiftieth of one error.
            let bias = 2.0 / (width * height) as f64;
            assert!(mean.value.abs() < 4.0 * mean.error + bias, "{width}x{height}: {mean:?}");
            let scatter = mean.error * (mean.samples as f64).sqrt();
            // The relative error of the scatter is 1 / sqrt(2 rounds). Bartlett's formula ignores borders and missing pixels.
            let allowed = 0.1 + 4.0 / (2.0 * rounds as f64).sqrt();
            assert!((stated / scatter - 1.0).abs() < allowed, "{width}x{height}: {stated} {scatter}");
        }
    }
}

#[test]
fn the_high_pass_bias_in_the_middle_of_a_map_is_a_twentieth() {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let map = white(400 * 250, 0.0, &mut random);
    let corrected = pattern_correlations(&map, 400);
    let uncorrected = map_correlations(&high_pass(&map, 400), 400);
    // Far from borders the bias is -0.05 (right) and -0.05667 (diagonal). It is 2/25 minus the overlap of two boxes,
    // divided by 24/25. At borders the bias is larger. A separate program computed -0.0506 and -0.0568 for this map size.
    // The measured bias scatters by a few ten-thousandths.
    assert!((uncorrected.right.value - corrected.right.value + 0.0506).abs() < 1e-3);
    assert!((uncorrected.diagonal.value - corrected.diagonal.value + 0.0568).abs() < 1e-3);
}

#[test]
fn a_true_correlation_is_detected() {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let noise = white(96 * 64, 0.0, &mut random);
    let smooth: Vec<f64> =
        (0..noise.len()).map(|p| noise[p] + if p % 96 > 0 { noise[p - 1] } else { 0.0 }).collect();
    let correlations = pattern_correlations(&smooth, 96);
    assert!((correlations.right.value - 0.5).abs() < 0.05, "{correlations:?}");
    assert!(correlations.lower.value.abs() < 5.0 * correlations.lower.error, "{correlations:?}");
}

/// Returns the built-in camera `name` with `width` x `height` pixels.
fn camera(name: &str, width: u32, height: u32) -> Camera {
    let mut camera = presets::builtin(name).unwrap();
    camera.sensor.geometry = Geometry::new(width, height).unwrap();
    camera
}

/// Records light that is a function of pixel and readout. The light is constant for `steps` readouts at a time.
fn record_light(
    camera: &Camera,
    readouts: usize,
    seed: u64,
    light: impl Fn(usize, usize) -> f64,
    steps: usize,
) -> MeasuredRecording {
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::new(camera, Seeds { camera: seed, shot: seed, sequence: 0 }).unwrap();
    let mut bits = vec![0; readouts * geometry.frame_bytes()];
    for (i, part) in bits.chunks_mut(steps * geometry.frame_bytes()).enumerate() {
        let samples: Vec<f32> = (0..geometry.pixels()).map(|p| light(p, i * steps) as f32).collect();
        simulator.fill(&samples, part).unwrap();
    }
    MeasuredRecording::from_frames(SpikeFramesRef::new(geometry, &bits).unwrap()).unwrap()
}

fn with_effect(camera: Camera, name: &str, key: &str, value: f64) -> Camera {
    camera.with_effect(find(name).unwrap().neutral().with_value(key, value).unwrap())
}

#[test]
fn no_motion_is_found_in_200_static_scenes() {
    let mut motions = Vec::new();
    for i in 0..200_u64 {
        let physical = camera("physical", 32, 24);
        let one = match i % 5 {
            0 => physical,
            1 => with_effect(physical, "row_noise", "sigma", 0.01),
            2 => with_effect(physical, "dead_pixels", "fraction", 0.02),
            3 => camera("scsim-code", 32, 24),
            _ => with_effect(physical, "vignetting", "strength", 0.2),
        };
        // The light is a static image with many rates. Some images flicker by 10 %, and some lamps drift by 2 %.
        let light = |p: usize, t: usize| {
            let picture = 0.05 + 0.3 * ((p * 7 + p / 32 * 13) % 41) as f64 / 41.0;
            let flicker = if i % 3 == 0 { 1.0 + 0.1 * (t as f64 / 20.0).sin() } else { 1.0 };
            let drift = if i % 4 == 1 { 1.0 + 0.02 * t as f64 / 1024.0 } else { 1.0 };
            picture * flicker * drift
        };
        if record_light(&one, 1024, i, light, 8).scene_motion().is_moving {
            motions.push(i);
        }
    }
    // Fewer than 1 % of the 200 recordings may be reported as moving, so at most one.
    assert!(motions.len() <= 1, "{motions:?}");
}

#[test]
fn identical_pixels_are_not_reported_as_motion() {
    // The phases of identical pixels are dependent. The rates of the two halves have only a few different values, and
    // neighbors have the same value.
    for (i, preset) in ["ideal", "neuspike", "spikingsim"].into_iter().enumerate() {
        let one = camera(preset, 96, 64);
        for level in [0.049, 0.3, 0.49, 0.51, 0.66, 0.9] {
            let motion = record_light(&one, 2000, i as u64, |_, _| level, 2000).scene_motion();
            assert!(!motion.is_moving, "{preset} at {level}: {motion:?}");
        }
    }
}

#[test]
fn a_moving_patch_and_a_panning_image_are_reported_as_motion() {
    let one = camera("physical", 64, 48);
    let patch = |p: usize, t: usize| {
        let (row, col) = (p / 64, p % 64);
        let at = 8 + t * 40 / 1024;
        if (20..28).contains(&row) && (at..at + 8).contains(&col) { 0.4 } else { 0.2 }
    };
    assert!(record_light(&one, 1024, 1, patch, 8).scene_motion().is_moving);
    // Waves with periods of about twelve pixels in both directions move by one pixel per 32 readouts.
    let pan = |p: usize, t: usize| {
        let (row, col) = ((p / 64) as f64, (p % 64) as f64 + t as f64 / 32.0);
        0.3 + 0.1 * (col / 2.0).sin() + 0.1 * (row / 2.0 + col / 5.0).sin()
    };
    assert!(record_light(&one, 1024, 1, pan, 8).scene_motion().is_moving);
    let still = |p: usize, _: usize| pan(p, 0);
    assert!(!record_light(&one, 1024, 1, still, 8).scene_motion().is_moving);
}

#[test]
fn pixels_that_fire_in_phase_are_no_flicker_and_flicker_is_no_firing_rate() {
    let harmonic = |rates: &[f64], in_phase: bool, flicker: f64| {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let mut charge: Vec<f64> =
            rates.iter().map(|_| if in_phase { 0.0 } else { uniform(&mut random) }).collect();
        let frames = (0..8192).map(|t| {
            let light = 1.0 + flicker * (std::f64::consts::TAU * 0.03125 * f64::from(t)).sin();
            let mut fires = |p: usize| {
                charge[p] += rates[p] * light;
                let fires = charge[p] >= 1.0;
                charge[p] -= f64::from(u8::from(fires));
                fires
            };
            (0..rates.len()).map(&mut fires).collect()
        });
        let stream = Stream::from_frames(32, 24, frames.collect());
        let statistics = stream.measure(&MeasureOptions::default(), &[]);
        let totals = &statistics.frames.as_ref().unwrap().totals;
        let lines = spectrum(totals, 2048).unwrap().lines(30.0);
        let rates = statistics.counts.unwrap().rate_by_time();
        (lines[0].frequency, lines[0].harmonic_of(&rates, 1.0 / 2048.0))
    };
    let alike: Vec<f64> = (0..768).map(|p| 0.1203 + 1e-5 * (p % 7) as f64).collect();
    let (frequency, line) = harmonic(&alike, true, 0.0);
    assert!(line.is_some(), "{frequency}");
    let many: Vec<f64> = (0..768).map(|p| 0.05 + 0.2 * (p * 31 % 768) as f64 / 768.0).collect();
    assert_eq!(harmonic(&many, false, 0.1), (0.03125, None));
    assert_eq!(harmonic(&alike, false, 0.1).0, 0.03125);
    assert_eq!(harmonic(&alike, false, 0.1).1, None);
}

#[test]
fn a_zero_statistic_is_reported_as_an_upper_limit() {
    let rates: Vec<f64> = (0..768).map(|p| 0.2 + 1e-4 * (p * 31 % 768) as f64 / 768.0).collect();
    let all = recording(&Stream::integrators(32, 24, 1024, &rates, 1)).reported_statistics().unwrap();
    let row = find_statistic(&all, "row-nonuniformity");
    assert!(row.value.is_none() && row.upper_limit.unwrap() < 1e-4, "{row:?}");
    let off = find_statistic(&all, "off-lattice");
    assert!(off.value.is_none() && off.upper_limit.unwrap() < 1e-4, "{off:?}");
}

#[test]
fn a_silent_pixel_is_dead_if_its_neighbors_make_silence_impossible() {
    // The light decreases toward a dark corner. One pixel in the lit area and one pixel in the dark corner are dead.
    let report_for = |readouts: usize| {
        let mut rates: Vec<f64> = (0..32 * 24).map(|p| 0.25 - 0.25 * (p % 32) as f64 / 31.0).collect();
        for p in (0..rates.len()).filter(|p| p % 32 >= 26) {
            rates[p] = 1e-5;
        }
        (rates[10 * 32 + 5], rates[10 * 32 + 30]) = (0.0, 0.0);
        let statistics =
            Stream::integrators(32, 24, readouts, &rates, 2).measure(&MeasureOptions::default(), &[]);
        summarize(&statistics).unwrap().defects.dead
    };
    assert_eq!(report_for(10), Vec::<usize>::new());
    assert_eq!(report_for(1000), vec![10 * 32 + 5]);
}
