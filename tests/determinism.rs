//! Invariants of the design: each seed changes only its part of the result, noise is independent, and the division of a
//! run into calls does not change bits.

mod common_oracle;

use common_oracle::{camera_with, correlation, preset, seeds, simulate_packed, simulate_times, spread_light};
use proptest::prelude::*;
use spikelane::FrameRef;
use spikelane::SimulatorOptions;
use spikelane::spikes::{Geometry, bit};
use spikelane::unstable::plan::SimulatorState;
use spikelane::{Camera, Plan, Seeds, Simulator};

/// Returns the change of each pixel's stored charge during one readout. The change is the sum of a constant and the
/// shot noise.
fn noise(camera: &Camera, seeds: Seeds, readout: usize) -> Vec<f64> {
    let plan = Plan::new(camera, seeds).unwrap();
    let geometry = camera.sensor.geometry;
    let frame = vec![0.002f32; geometry.pixels()];
    let mut simulator = Simulator::from_plan(plan.clone());
    let mut bytes = vec![0; (readout + 1) * geometry.frame_bytes()];
    let (before, last) = bytes.split_at_mut(readout * geometry.frame_bytes());
    simulator.fill(&frame, before).unwrap();
    let start = common_oracle::charges(&plan, simulator.state());
    simulator.fill(&frame, last).unwrap();
    let end = common_oracle::charges(&plan, simulator.state());
    start.iter().zip(&end).map(|(a, b)| b - a).collect()
}

fn shot_camera() -> Camera {
    camera_with(512, 512, &[("shot_noise", &[("strength", 10.0)])])
}

/// With 262,144 pixels, the correlation of independent noise has a standard error of 0.002. The bound of 4.5 standard
/// errors is 0.0088.
///
/// If one pixel in a hundred had equal noise in both compared frames, the correlation would exceed 0.0088.
#[test]
fn sequences_workers_seeds_and_readouts_share_no_noise() {
    let camera = shot_camera();
    let base = Seeds { camera: 1, shot: 2, sequence: 3 };
    let first = noise(&camera, base, 0);
    let others = [
        ("next sequence", Seeds { sequence: 4, ..base }, 0),
        ("sequence of another worker", Seeds { sequence: 3 + (1 << 32), ..base }, 0),
        ("next shot seed", Seeds { shot: 3, ..base }, 0),
        ("shot seed and sequence swapped", Seeds { shot: 3, sequence: 2, ..base }, 0),
        ("next readout", base, 1),
        ("128 readouts later", base, 128),
    ];
    for (what, seeds, readout) in others {
        let r = correlation(&first, &noise(&camera, seeds, readout));
        assert!(r.abs() < 4.5 / 512.0, "{what}: {r}");
    }
    assert!(correlation(&first, &noise(&camera, base, 0)) > 0.999_999);
}

/// Correlates the noise of pixels within a frame, with a bound of 4.5 standard errors. The test compares the two pixels
/// of a 32-bit word, neighbors in different words, a pixel and the pixel below, and pixels that are a lane or a tile
/// apart.
#[test]
fn pixels_share_no_noise() {
    let frame = noise(&shot_camera(), seeds(4), 0);
    for lag in [1, 2, 32, 64, 512, 4096] {
        let r = correlation(&frame[lag..], &frame[..frame.len() - lag]);
        assert!(r.abs() < 4.6 / 512.0, "pixels {lag} apart: {r}");
    }
    let (even, odd): (Vec<_>, Vec<_>) = frame.chunks_exact(2).map(|c| (c[0], c[1])).unzip();
    let r = correlation(&even, &odd);
    assert!(r.abs() < 4.5 / (even.len() as f64).sqrt(), "two pixels of one word: {r}");
    // Noise of equal magnitude but random signs is uncorrelated. The squares of such noise are correlated.
    let square = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| (x - 0.002).powi(2)).collect() };
    let r = correlation(&square(&even), &square(&odd));
    assert!(r.abs() < 4.5 / (even.len() as f64).sqrt(), "magnitudes of one word: {r}");
}

/// Correlates the phase drifts of the two pixels of a word for 20,000 readouts.
///
/// A drift is the spike count of a pixel in a window of 1,000 readouts, minus the pixel's mean count. With 500 pairs
/// and 20 windows, the standard error of the correlation is 0.01.
#[test]
fn spikes_of_paired_pixels_drift_apart() {
    let camera = preset("scsim-code", 1000, 1);
    let light = spread_light(0.19, 0.05, 1000, 8);
    let times = simulate_times(&camera, seeds(3), &light, 500, 20_000);
    let residuals = |t: &Vec<u32>| -> Vec<f64> {
        let mut counts = [0.0; 20];
        t.iter().for_each(|&s| counts[s as usize / 1000] += 1.0);
        counts.map(|c| c - t.len() as f64 / 20.0).to_vec()
    };
    let side =
        |k: usize| -> Vec<f64> { times.pixels.iter().skip(k).step_by(2).flat_map(residuals).collect() };
    let r = correlation(&side(0), &side(1));
    assert!(r.abs() < 4.5 / 100.0, "{r}");
}

/// Compares maps of the mean rate in 2,000 readouts, and compares spike times.
///
/// A map has about 400 spikes per pixel. In the maps, the fixed pattern of 7 % is much stronger than the temporal
/// noise.
#[test]
fn the_camera_seed_alone_moves_the_fixed_pattern_and_the_shot_seed_alone_the_noise() {
    let camera = preset("scsim-code", 100, 100);
    let light = vec![0.2f32; 10_000];
    let run = |camera_seed, shot| {
        let seeds = Seeds { camera: camera_seed, shot, sequence: 0 };
        let times = simulate_times(&camera, seeds, &light, 200, 2000);
        let rates: Vec<f64> = times.rates().collect();
        (rates, times.pixels)
    };
    let (base, other_camera, other_shot) = (run(1, 1), run(2, 1), run(1, 2));
    let pattern = correlation(&base.0, &other_shot.0);
    assert!(pattern > 0.999, "the shot seed moved the fixed pattern: {pattern}");
    let pattern = correlation(&base.0, &other_camera.0);
    assert!(pattern.abs() < 4.5 / 100.0, "the camera seed left the fixed pattern: {pattern}");
    assert_ne!(base.1, other_shot.1, "the shot seed left the temporal noise");
    // The camera seed does not change the temporal draws. Without a fixed pattern, the bits for different camera seeds
    // are therefore equal.
    let base_camera =
        camera_with(100, 100, &[("shot_noise", &[("strength", 1.0)]), ("start_phase", &[("share", 1.0)])]);
    let bits = |camera_seed, shot| {
        simulate_packed(&base_camera, Seeds { camera: camera_seed, shot, sequence: 0 }, &light, 100)
    };
    assert!(bits(1, 1) == bits(2, 1) && bits(1, 1) != bits(1, 2));
}

/// Runs the plan in pieces with the given numbers of readouts. Optionally, the state is saved and restored after each
/// piece.
fn run_in_pieces(
    plan: &Plan,
    light: &[f32],
    pieces: &[usize],
    save: bool,
    threads: usize,
) -> (Vec<u8>, SimulatorState) {
    let geometry = plan.geometry();
    let new_simulator = || SimulatorOptions::new().threads(threads).build_from_plan(plan.clone()).unwrap();
    let mut simulator = new_simulator();
    let mut all = Vec::new();
    for &readouts in pieces {
        let mut bytes = vec![0x5a; readouts * geometry.frame_bytes()];
        simulator.fill(FrameRef::new(light), &mut bytes).unwrap();
        all.extend(bytes);
        if save {
            let saved = simulator.state().to_bytes();
            simulator = new_simulator();
            simulator.set_state(SimulatorState::from_bytes(&saved, &plan.initial_state()).unwrap()).unwrap();
        }
    }
    (all, simulator.state().clone())
}

fn any_camera() -> impl Strategy<Value = Camera> {
    let names = ["ideal", "physical", "scsim-code", "scsim-paper", "spikingsim", "spikecv-image"];
    let size = prop_oneof![(1u32..300, 1u32..4), (4090u32..4100, 1u32..3)];
    (0..names.len(), size).prop_map(move |(i, (w, h))| preset(names[i], w, h))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn batches_resume_points_and_threads_change_no_bit(
        camera in any_camera(),
        pieces in proptest::collection::vec(1usize..150, 1..5),
        save in any::<bool>(),
        threads in 1usize..4,
        shot in any::<u64>(),
        level in 0.0f32..1.3,
    ) {
        let max_light = if camera.name == "spikecv-image" { 2.0 } else { 1.5 };
        let plan = Plan::with_max_light(&camera, seeds(shot), max_light).unwrap();
        let light = spread_light(f64::from(level), 0.3, plan.geometry().pixels(), shot);
        let one_piece = run_in_pieces(&plan, &light, &[pieces.iter().sum()], false, 1);
        let cut = run_in_pieces(&plan, &light, &pieces, save, threads);
        prop_assert!(one_piece.0 == cut.0, "bits differ");
        prop_assert!(one_piece.1 == cut.1, "states differ");
    }

    #[test]
    fn strides_change_no_bit(camera in any_camera(), gap in 0usize..9, shot in any::<u64>()) {
        let geometry = camera.sensor.geometry;
        let plan = Plan::new(&camera, seeds(shot)).unwrap();
        let dense: Vec<u16> = spread_light(20_000.0, 0.5, geometry.pixels(), shot).iter().map(|v| *v as u16).collect();
        let stride = geometry.width() + gap;
        let mut wide = vec![u16::MAX; stride * geometry.height()];
        for (row, line) in dense.chunks(geometry.width()).zip(wide.chunks_mut(stride)) {
            line[..row.len()].copy_from_slice(row);
        }
        let run = |frame: FrameRef<'_>| {
            let mut bytes = vec![0; 40 * geometry.frame_bytes()];
            Simulator::from_plan(plan.clone()).fill(frame, &mut bytes).unwrap();
            bytes
        };
        let samples = spikelane::unstable::kernels::Samples::U16(&wide);
        prop_assert!(run(FrameRef::new(&dense)) == run(FrameRef::with_stride(samples, stride)));
    }

    /// Without a fixed pattern, the bits of a pixel depend only on its address. They do not depend on its neighbors, nor
    /// on lanes, vectors or tiles.
    #[test]
    fn neighbors_change_no_bit(width in 1usize..9000, level in 0.0f32..1.0, shot in any::<u64>()) {
        let effects: &[(&str, &[(&str, f64)])] = &[
            ("shot_noise", &[("strength", 1.0)]),
            ("thermal_noise", &[("sigma", 6e-3), ("noise_sampling", 1.0)]),
            ("start_phase", &[("share", 1.0)]),
        ];
        let wide = simulate_packed(&camera_with(9000, 1, effects), seeds(shot), &vec![level; 9000], 20);
        let narrow = simulate_packed(&camera_with(width as u32, 1, effects), seeds(shot), &vec![level; width], 20);
        let size = |w: usize| Geometry::new(w as u32, 1).unwrap().frame_bytes();
        for (a, b) in wide.chunks(size(9000)).zip(narrow.chunks(size(width))) {
            prop_assert!((0..width).all(|p| bit(a, p) == bit(b, p)));
        }
    }
}
