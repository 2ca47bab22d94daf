//! Quanta that settle, and pixels that are undecided: against closed forms on both sides, plan and exact law.

use crate::common_oracle::{
    Estimate, Independent, Times, camera_with, charges, oracle, planned, seeds, unpack,
};
use spikelane::pixel::Noise;
use spikelane::simulate::FrameRef;
use spikelane::{Camera, Plan, Simulator};

const LIGHT: f64 = 0.25;
const TIME_CONSTANT: f64 = 12.0;
const WARM: usize = 200;

/// Shot noise of `strength` that settles, at phases of its own.
fn settling(width: u32, strength: f64) -> Camera {
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

/// Variance of what `m` readouts gather, in variances of one readout's quanta: with `n[t] = a n[t-1] + (1 - a) w[t]` the
/// covariance of readouts `k` apart is `(1 - a)/(1 + a) a^k`, whose double sum this is.
fn closed_form(m: usize) -> f64 {
    let a = (-1.0 / TIME_CONSTANT).exp();
    m as f64 - 2.0 * a * (1.0 - a.powi(m as i32)) / (1.0 - a * a)
}

/// Variance over the pixels of what they gather in `m` readouts, in thresholds squared: spikes and the change of the charge.
fn gathered(camera: &Camera, m: usize) -> f64 {
    let plan = Plan::new(camera, seeds(1)).unwrap();
    let geometry = camera.sensor.geometry;
    let frame = vec![LIGHT as f32; geometry.pixels()];
    let mut simulator = Simulator::of_plan(plan.clone());
    let mut run = |readouts: usize| {
        let mut bytes = vec![0; readouts * geometry.frame_bytes()];
        simulator.push(FrameRef::f32(&frame, geometry), &mut bytes).unwrap();
        (unpack(&bytes, geometry), charges(&plan, simulator.state()))
    };
    let (_, before) = run(WARM);
    let (times, after) = run(m);
    variance((0..geometry.pixels()).map(|p| times.pixels[p].len() as f64 + after[p] - before[p]))
}

fn variance(values: impl Iterator<Item = f64>) -> f64 {
    let all = Estimate::of(values);
    all.error * all.error * all.pixels as f64
}

/// 20,000 pixels know a variance to 1 %; five of these. What is released in whole steps adds a twelfth of a step squared to
/// the 91 steps squared of one readout, and nothing to many.
#[test]
fn short_sums_of_settling_quanta_have_less_noise_and_long_ones_all_of_it() {
    let camera = settling(20_000, 1.0);
    let quanta = LIGHT / camera.model(seeds(1)).unwrap().electrons();
    for m in [1, 3, 12, 60, 400] {
        let (found, expected) = (gathered(&camera, m) / quanta, closed_form(m));
        eprintln!("{m} readouts: {found:.4}, closed form {expected:.4}, without settling {m}");
        assert!((found / expected - 1.0).abs() < 0.05, "{m} readouts: {found} instead of {expected}");
    }
}

#[test]
fn the_exact_law_settles_as_the_closed_form_says() {
    let camera = settling(4000, 1.0);
    let model = camera.model(seeds(1)).unwrap();
    let quanta = LIGHT / model.electrons();
    for m in [1, 12, 60] {
        let found = variance((0..4000).map(|p| {
            let (law, mut noise) = (model.law(p), Independent::new(p as u64));
            let mut state = law.start(noise.uniform(), &mut noise);
            (0..WARM).for_each(|_| _ = law.step(&mut state, LIGHT, &mut noise));
            let before = state.charge;
            let spikes = (0..m).filter(|_| law.step(&mut state, LIGHT, &mut noise)).count();
            spikes as f64 + state.charge - before
        })) / quanta;
        // 4,000 pixels: 2.2 %.
        assert!(
            (found / closed_form(m) - 1.0).abs() < 0.11,
            "{m} readouts: {found} instead of {}",
            closed_form(m)
        );
    }
}

/// Counted quanta (few of them) settle as many do: 500 photons a threshold, 5 to 125 of them a readout.
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
        let (found, expected) = (gathered(&camera, m) / (LIGHT / 100.0), closed_form(m));
        assert!((found / expected - 1.0).abs() < 0.05, "{m} readouts: {found} instead of {expected}");
    }
}

/// A pixel whose mean interval is a whole number comes back to its threshold at the same instant: it is drawn there, and every spike
/// comes then or a readout later, by chance. So an interval is a readout short with a chance of a quarter and long with the same,
/// and the variance of a time between spikes is a half at any lag, in readouts squared.
#[test]
fn a_pixel_of_whole_intervals_is_early_and_late_by_a_quarter_each_and_no_more_at_long_lags() {
    // All are empty at first, so that each comes to its threshold.
    let camera = undecided(0.02, 300, 0.0);
    let light = vec![0.2; 300];
    let model = camera.model(seeds(1)).unwrap();
    for (side, times) in [
        ("plan", planned(&camera, seeds(1), &light, 300, 4000)),
        ("law", oracle(&model, &light, 300, 4000, 5)),
    ] {
        let [early, late] = [4, 6].map(|length| share(&times, length));
        eprintln!("{side}: early {early}, late {late}, D(1) {}, D(20) {}", times.d(1), times.d(20));
        for of in [early, late] {
            assert!((of.mean - 0.25).abs() < 5.0 * of.error, "{side}: {of}");
        }
        for lag in [1, 20] {
            let d = times.d(lag);
            assert!((d.mean - 0.5).abs() < 5.0 * d.error + 0.01, "{side}: D({lag}) {d}");
        }
    }
}

/// Noise carries pixels near whole intervals in and out of the width; rates about a fifth.
#[test]
fn undecided_pixels_of_a_plan_follow_the_exact_law() {
    let camera = undecided(0.008, 1000, 1.0)
        .with(spikelane::effects::find("shot_noise").unwrap().typical())
        .with(spikelane::effects::find("correlated_shot_noise").unwrap().typical());
    // From 0.19 to 0.21: intervals of 4.76 to 5.26.
    let light: Vec<f32> = (0..1000).map(|p| 0.19 + 0.02 * p as f32 / 1000.0).collect();
    let model = camera.model(seeds(1)).unwrap();
    let sides = [planned(&camera, seeds(1), &light, 300, 3000), oracle(&model, &light, 300, 3000, 5)];
    for length in [4, 5, 6] {
        let [plan, law] = sides.each_ref().map(|times| share(times, length));
        let apart = Estimate::of(
            (0..1000).map(|p| share_of(&sides[0].pixels[p], length) - share_of(&sides[1].pixels[p], length)),
        );
        eprintln!("intervals of {length}: plan {plan}, law {law}");
        assert!(apart.mean.abs() < 5.0 * apart.error, "intervals of {length}: plan {plan}, law {law}");
    }
    let [plan, law] = sides.each_ref().map(Times::rate);
    assert!((plan.mean - law.mean).abs() < 2e-5, "{plan} {law}");
}

/// Pixels that start anywhere in a share of their thresholds.
fn undecided(width: f64, pixels: u32, share: f64) -> Camera {
    camera_with(pixels, 1, &[("start_phase", &[("share", share)]), ("readout_jitter", &[("width", width)])])
}

fn share(times: &Times, length: u32) -> Estimate {
    Estimate::of(times.pixels.iter().map(|t| share_of(t, length)))
}

fn share_of(times: &[u32], length: u32) -> f64 {
    let of = times.windows(2).filter(|w| w[1] - w[0] == length).count();
    of as f64 / (times.len() - 1) as f64
}
