//! Tests of correlated shot noise and readout jitter. Plan and exact law are compared with closed forms.

use crate::common_oracle::{
    Estimate, IndependentNoise, SpikeTimes, camera_with, charges, oracle, seeds, simulate_times, unpack,
};
use spikelane::pixel::NoiseSource;
use spikelane::{Camera, Plan, Simulator};

const LIGHT: f64 = 0.25;
const TIME_CONSTANT: f64 = 12.0;
const WARMUP_READOUTS: usize = 200;

/// Returns a camera with correlated shot noise of `strength` and random start phases.
fn correlated_camera(width: u32, strength: f64) -> Camera {
    camera_with(
        width,
        1,
        &[
            ("start_phase", &[("share", 1.0)]),
            ("shot_noise", &[("strength", strength)]),
            ("correlated_shot_noise", &[("time_constant", TIME_CONSTANT)]),
        ],
    )
}

/// Returns the variance of the total charge of `m` readouts, divided by the variance of the quanta of one readout.
///
/// The noise is `n[t] = a n[t-1] + (1 - a) w[t]`, where `w[t]` is the noise of the quanta of readout `t` with unit
/// variance. Noise values that are `k` readouts apart have the covariance `(1 - a)/(1 + a) a^k`. The result is the sum of the
/// covariances of all pairs of the `m` readouts.
fn closed_form(m: usize) -> f64 {
    let a = (-1.0 / TIME_CONSTANT).exp();
    m as f64 - 2.0 * a * (1.0 - a.powi(m as i32)) / (1.0 - a * a)
}

/// Returns the variance between pixels of the charge that `m` readouts add, in thresholds squared. The added charge is
/// the number of spikes plus the change of the stored charge.
fn sum_variance(camera: &Camera, m: usize) -> f64 {
    let plan = Plan::new(camera, seeds(1)).unwrap();
    let geometry = camera.sensor.geometry;
    let frame = vec![LIGHT as f32; geometry.pixels()];
    let mut simulator = Simulator::from_plan(plan.clone());
    let mut run = |readouts: usize| {
        let mut bytes = vec![0; readouts * geometry.frame_bytes()];
        simulator.fill(&frame, &mut bytes).unwrap();
        (unpack(&bytes, geometry), charges(&plan, simulator.state()))
    };
    let (_, before) = run(WARMUP_READOUTS);
    let (times, after) = run(m);
    variance((0..geometry.pixels()).map(|p| times.pixels[p].len() as f64 + after[p] - before[p]))
}

fn variance(values: impl Iterator<Item = f64>) -> f64 {
    let all = Estimate::from_values(values);
    all.error * all.error * all.pixels as f64
}

/// With 20,000 pixels, a variance has a standard error of 1 %. The test allows five standard errors.
///
/// Pending noise is released in whole steps. For one readout, this rounding adds 1/12 step squared to a variance of
/// about 91 steps squared. For many readouts, it adds nothing.
#[test]
fn short_sums_of_settling_quanta_have_less_noise_and_long_ones_all_of_it() {
    let camera = correlated_camera(20_000, 1.0);
    let quanta = LIGHT / camera.model(seeds(1)).unwrap().electrons();
    for m in [1, 3, 12, 60, 400] {
        let (actual, expected) = (sum_variance(&camera, m) / quanta, closed_form(m));
        eprintln!("{m} readouts: {actual:.4}, closed form {expected:.4}, without settling {m}");
        assert!((actual / expected - 1.0).abs() < 0.05, "{m} readouts: {actual} instead of {expected}");
    }
}

#[test]
fn the_exact_law_settles_as_the_closed_form_says() {
    let camera = correlated_camera(4000, 1.0);
    let model = camera.model(seeds(1)).unwrap();
    let quanta = LIGHT / model.electrons();
    for m in [1, 12, 60] {
        let sampled = variance((0..4000).map(|p| {
            let (law, mut noise) = (model.law(p), IndependentNoise::new(p as u64));
            let mut state = law.initial_state(noise.uniform(), &mut noise);
            (0..WARMUP_READOUTS).for_each(|_| _ = law.step(&mut state, LIGHT, &mut noise));
            let before = state.charge;
            let spikes = (0..m).filter(|_| law.step(&mut state, LIGHT, &mut noise)).count();
            spikes as f64 + state.charge - before
        })) / quanta;
        // With 4,000 pixels, the standard error is 2.2 %. The test allows five standard errors.
        assert!(
            (sampled / closed_form(m) - 1.0).abs() < 0.11,
            "{m} readouts: {sampled} instead of {}",
            closed_form(m)
        );
    }
}

/// Small counts of quanta have the same correlation as large counts. A threshold is 100 photons, and a readout adds 25
/// photons.
#[test]
fn counted_quanta_settle_too() {
    let few: &[(&str, f64)] = &[("strength", 1.0), ("counts", 1.0), ("photons_at_full_scale", 100.0)];
    let camera = camera_with(
        20_000,
        1,
        &[
            ("start_phase", &[("share", 1.0)]),
            ("shot_noise", few),
            ("correlated_shot_noise", &[("time_constant", TIME_CONSTANT)]),
        ],
    );
    for m in [1, 12, 60] {
        let (actual, expected) = (sum_variance(&camera, m) / (LIGHT / 100.0), closed_form(m));
        assert!((actual / expected - 1.0).abs() < 0.05, "{m} readouts: {actual} instead of {expected}");
    }
}

/// If the mean interval is an integer, the charge equals the threshold exactly at some readout.
///
/// If the charge is within the jitter width of the threshold, jitter sets the charge to the threshold. The spike is
/// then at this readout or at the next readout, each with probability 1/2. An interval is therefore one readout shorter
/// with probability 1/4, and one readout longer with probability 1/4. The variance of the duration between two spikes
/// is 1/2 readout squared, regardless of the number of intervals between the spikes.
#[test]
fn jitter_moves_a_quarter_of_whole_intervals_each_way_and_no_more_at_long_lags() {
    // All pixels start without charge, so the charge of each pixel equals its threshold exactly at some readout.
    let camera = jitter_camera(0.02, 300, 0.0);
    let light = vec![0.2; 300];
    let model = camera.model(seeds(1)).unwrap();
    for (side, times) in [
        ("plan", simulate_times(&camera, seeds(1), &light, 300, 4000)),
        ("law", oracle(&model, &light, 300, 4000, 5)),
    ] {
        let [early, late] = [4, 6].map(|length| share(&times, length));
        eprintln!(
            "{side}: early {early}, late {late}, D(1) {}, D(20) {}",
            times.interval_sum_variance(1),
            times.interval_sum_variance(20)
        );
        for share in [early, late] {
            assert!((share.mean - 0.25).abs() < 5.0 * share.error, "{side}: {share}");
        }
        for lag in [1, 20] {
            let d = times.interval_sum_variance(lag);
            assert!((d.mean - 0.5).abs() < 5.0 * d.error + 0.01, "{side}: D({lag}) {d}");
        }
    }
}

/// At rates near 1/5, intervals are almost integers. Noise then moves the charge of a pixel into and out of the range
/// around the threshold in which jitter acts.
#[test]
fn undecided_pixels_of_a_plan_follow_the_exact_law() {
    let camera = jitter_camera(0.008, 1000, 1.0)
        .with_effect(spikelane::effects::find("shot_noise").unwrap().typical())
        .with_effect(spikelane::effects::find("correlated_shot_noise").unwrap().typical());
    // Light from 0.19 to 0.21 gives intervals of 4.76 to 5.26 readouts.
    let light: Vec<f32> = (0..1000).map(|p| 0.19 + 0.02 * p as f32 / 1000.0).collect();
    let model = camera.model(seeds(1)).unwrap();
    let sides = [simulate_times(&camera, seeds(1), &light, 300, 3000), oracle(&model, &light, 300, 3000, 5)];
    for length in [4, 5, 6] {
        let [plan, law] = sides.each_ref().map(|times| share(times, length));
        let difference = Estimate::from_values((0..1000).map(|p| {
            interval_share(&sides[0].pixels[p], length) - interval_share(&sides[1].pixels[p], length)
        }));
        eprintln!("intervals of {length}: plan {plan}, law {law}");
        assert!(
            difference.mean.abs() < 5.0 * difference.error,
            "intervals of {length}: plan {plan}, law {law}"
        );
    }
    let [plan, law] = sides.each_ref().map(SpikeTimes::rate);
    assert!((plan.mean - law.mean).abs() < 2e-5, "{plan} {law}");
}

/// Returns pixels with jitter of width `width`. The start charges are uniform between 0 and `share` thresholds.
fn jitter_camera(width: f64, pixels: u32, share: f64) -> Camera {
    camera_with(pixels, 1, &[("start_phase", &[("share", share)]), ("readout_jitter", &[("width", width)])])
}

fn share(times: &SpikeTimes, length: u32) -> Estimate {
    Estimate::from_values(times.pixels.iter().map(|t| interval_share(t, length)))
}

fn interval_share(times: &[u32], length: u32) -> f64 {
    let matching = times.windows(2).filter(|w| w[1] - w[0] == length).count();
    matching as f64 / (times.len() - 1) as f64
}
