//! At its neutral value, no effect changes a bit. At other values, each effect changes the mean and the variances as it
//! predicts.

use crate::common_oracle::{
    Estimate, SpikeTimes, charges, oracle, preset, seeds, sensor, simulate_packed, simulate_times,
};
use spikelane::effects::{self, Definition, Effect, Moments};
use spikelane::{Camera, Plan, Simulator};

/// Returns the light of 130 pixels: dark, dim, medium, full scale and brighter.
fn mixed_light() -> Vec<f32> {
    (0..130).map(|p| [0.0, 0.002, 0.05, 0.3, 0.95, 1.0, 1.4][p % 7] * (1.0 + p as f32 / 2000.0)).collect()
}

#[test]
fn every_effect_at_its_neutral_value_equals_its_absence_bit_for_bit() {
    let ideal = Camera::ideal(sensor(26, 5));
    let mut cameras = vec![ideal.clone()];
    cameras.extend(["physical", "scsim-code", "scsim-paper", "spikecv-image"].map(|n| preset(n, 26, 5)));
    // Each effect is also tested alone with a clamp, so every pair of effects that use the same rule occurs.
    let clamp = || effects::find("saturation_clamp").unwrap().typical();
    cameras.extend(effects::ALL.iter().map(|d| ideal.clone().with_effect(clamp()).with_effect(d.typical())));
    for camera in cameras {
        for definition in effects::ALL {
            let without = camera.clone().without_effect(definition.name);
            let neutral = camera.clone().with_effect(definition.neutral());
            let light = mixed_light();
            // With a hard reset and without a clamp, planning fails for light above full scale. It must fail with and
            // without the effect.
            let max_light = f64::from(light.iter().copied().fold(0.0, f32::max));
            let plans = [&without, &neutral].map(|c| Plan::with_max_light(c, seeds(1), max_light).is_ok());
            assert_eq!(plans[0], plans[1], "{} on {}", definition.name, camera.name);
            if plans[0] {
                let [a, b] = [&without, &neutral].map(|c| simulate_packed(c, seeds(1), &light, 150));
                let names: Vec<_> = without.effects().iter().map(Effect::name).collect();
                assert!(a == b, "{} beside {names:?}", definition.name);
            }
        }
    }
}

/// Width and height of the sensor for measurements of a fixed pattern. The closed form of `vignetting` assumes their
/// ratio.
const WIDTH: u32 = 200;
const HEIGHT: u32 = 125;

/// Returns a camera at the rate `rate`. Light and dark current each add half of the charge. The rate therefore depends
/// on effects on the light and on effects on the dark current.
fn base(rate: f64) -> Camera {
    let camera = Camera::ideal(sensor(WIDTH, HEIGHT));
    let circuit = effects::Circuit::nominal(&camera.sensor);
    let dark = rate / 2.0 / circuit.thresholds_per_readout(1.0);
    let dark = effects::find("dark_current").unwrap().neutral().with_value("mean", dark).unwrap();
    camera.with_effect(effects::find("start_phase").unwrap().typical()).with_effect(dark)
}

/// Number of readouts during which a drift lasts. The measurement of a drift has the same number of readouts.
const DRIFT_READOUTS: f64 = 1000.0;

/// Returns `definition` with parameters that differ from neutral by `strength` times the typical difference. Choices stay
/// neutral.
fn at_strength(definition: &'static Definition, strength: f64) -> Effect {
    definition.params.iter().fold(definition.neutral(), |effect, param| match param.kind {
        effects::definition::ParamKind::Number { low, high, .. } if param.neutral.is_finite() => {
            // For rare pixels, the strength scales the share of the pixels and not the factor.
            let scale = if param.key == "factor" { 1.0 } else { strength };
            let typical = if param.key == "duration" { DRIFT_READOUTS } else { param.typical };
            let neutral = if param.key == "duration" { DRIFT_READOUTS } else { param.neutral };
            let value = neutral + scale * (typical - neutral);
            effect.with_value(param.key, value.clamp(low, high)).unwrap()
        }
        effects::definition::ParamKind::Number { .. } => {
            effect.with_value(param.key, param.typical + 0.5).unwrap()
        }
        effects::definition::ParamKind::Choice(_) => effect,
    })
}

/// Returns the base camera without the effect, the base camera with the effect, and the light at which the base camera
/// has `rate`.
fn pair(definition: &'static Definition, strength: f64, rate: f64) -> (Camera, Camera, f64) {
    let without = match definition.name {
        // The effect `dark_current` would replace the dark current of the base camera. The dark current is therefore
        // removed, and light alone gives `rate`.
        "dark_current" => base(rate).without_effect("dark_current"),
        "start_phase" => base(rate).without_effect("start_phase"),
        _ => base(rate),
    };
    let light = without.operating_point(rate).light;
    (without.clone(), without.with_effect(at_strength(definition, strength)), light)
}

/// Returns the mean charge per readout of every pixel by the exact law, divided by the pixel's threshold. The result is
/// clamped to 0 to 1.
fn exact_rates(camera: &Camera, light: f64) -> Vec<f64> {
    let model = camera.model(seeds(0)).unwrap();
    let law = |p: usize| model.law(p);
    let ideal = |p: usize| ((law(p).gain * light + law(p).dark) / law(p).threshold).clamp(0.0, 1.0);
    (0..model.circuit.pixels()).map(ideal).collect()
}

/// Returns the rate of every pixel of the plan: the number of spikes plus the change of the stored charge, divided by
/// the number of readouts.
///
/// The change of the stored charge adds a fraction of a spike. For effects that lose charge or flip bits, set
/// `whole_spikes` to count only spikes.
fn plan_rates(camera: &Camera, light: f64, [warm, readouts]: [usize; 2], whole_spikes: bool) -> Vec<f64> {
    let plan = Plan::new(camera, seeds(0)).unwrap();
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::from_plan(plan.clone());
    let mut bytes = vec![0; readouts.max(warm) * geometry.frame_bytes()];
    let frame = vec![light as f32; geometry.pixels()];
    let frame_bytes = geometry.frame_bytes();
    let first = &mut bytes[..warm * frame_bytes];
    simulator.fill(spikelane::FrameRef::new(&frame), first).unwrap();
    let before = charges(&plan, simulator.state());
    bytes.truncate(readouts * frame_bytes);
    simulator.fill(spikelane::FrameRef::new(&frame), &mut bytes).unwrap();
    let after = charges(&plan, simulator.state());
    let times = crate::common_oracle::unpack(&bytes, geometry);
    let counts = times.pixels.iter().map(|t| t.len() as f64);
    let change = |p: usize| if whole_spikes { 0.0 } else { after[p] - before[p] };
    counts.enumerate().map(|(p, n)| (n + change(p)) / readouts as f64).collect()
}

fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len() as f64
}

fn relative_variance(v: &[f64]) -> f64 {
    let m = mean(v);
    v.iter().map(|x| (x / m - 1.0).powi(2)).sum::<f64>() / v.len() as f64
}

/// Mean rates of cameras without the tested effect. They are stored because several tests use the same camera.
type KnownRates = std::collections::BTreeMap<String, f64>;

/// Compares the fixed pattern of 25,000 pixels with the prediction.
///
/// If the rates have the spread `s`, their mean has the standard error `s / 158`. Their variance has a standard error
/// of 0.9 % for a Gaussian pattern and 4 % for a log-normal pattern. If an effect changes a fraction `f` of the pixels,
/// the relative error is `1/sqrt(25,000 f)`. A prediction contains only the lowest order in the strength. The test
/// therefore also allows a relative error of twice the predicted relative spread. At rate 0.95, only weak strengths
/// stay below saturation.
fn check_pattern(known: &mut KnownRates, definition: &'static Definition, strength: f64, rate: f64) {
    let (without, with, light) = pair(definition, strength, rate);
    let effect = with.effect(definition.name).unwrap();
    let predicted = effect.moments(&without.operating_point(rate)).unwrap();
    let spread = predicted.spatial_variance.max(0.0).sqrt();
    let flips = match definition.name {
        "missed_spikes" | "false_spikes" | "dead_time" | "saturation_clamp" => true,
        // With these effects, a spike does not subtract exactly one threshold of charge.
        "leak" | "adaptation" | "supply_droop" | "spike_coupling" => true,
        _ => false,
    };
    // A typical flicker has a period of 200 readouts, so the number of readouts is a multiple of 200.
    let readouts = ((10.0 / rate) as usize + 200).next_multiple_of(200);
    let spans = match definition.name {
        "gain_drift" => [0, DRIFT_READOUTS as usize],
        "adaptation" | "image_lag" => [1000, readouts],
        _ => [0, readouts],
    };
    let readouts = spans[1];
    let predicted_rates = plan_rates(&with, light, spans, flips);
    let key = format!("{:?} {rate} {spans:?} {flips}", without.effects());
    let before = known.entry(key).or_insert_with(|| mean(&plan_rates(&without, light, spans, flips)));
    let added = mean(&predicted_rates) - *before;
    let rare = match definition.name {
        "hot_pixels" | "dead_pixels" => 5.0 / (25_000.0 * effect.values()[0]).sqrt(),
        "dark_tail" => 0.2,
        "vignetting" => 0.03,
        "column_pattern" | "row_pattern" | "smooth_prnu" => 5.0 * (2.0 / cells(definition)).sqrt(),
        _ => 0.05,
    };
    // Independent flips of bits have a Poisson scatter.
    let scatter = (predicted.rate.abs() / (25_000.0 * readouts as f64)).sqrt();
    let second_order = 2.0 * spread + 2.0 * predicted.rate.abs() / rate;
    // Standard error of the mean rate of all pixels due to temporal noise.
    let phase_error = (predicted.phase_variance / (rate * readouts as f64 * 25_000.0)).sqrt() * rate;
    let pattern = spread * rate / cells(definition).sqrt();
    let tolerance =
        predicted.rate.abs() * (rare + second_order) + 5.0 * (pattern + scatter + phase_error) + 4e-6;
    assert!(
        (added - predicted.rate).abs() < tolerance,
        "{} x {strength} at {rate}: rate {added:+.3e}, predicted {:+.3e}, tolerance {tolerance:.1e}",
        definition.name,
        predicted.rate
    );
    if flips {
        return;
    }
    let exact = exact_rates(&with, light);
    let bound = predicted.spatial_variance * (rare + second_order) + 1e-7;
    // The rates of the plan also contain temporal noise, because the run is finite.
    let temporal = 1.5 * predicted.phase_variance / (rate * readouts as f64);
    for (side, rates, noise) in [("plan", &predicted_rates, temporal), ("oracle", &exact, 0.0)] {
        let variance = relative_variance(rates);
        let bound = bound + noise;
        assert!(
            (variance - predicted.spatial_variance).abs() < bound,
            "{} x {strength} at {rate}: {side}'s spatial variance {variance:.3e}, predicted {:.3e}, tolerance {bound:.1e}",
            definition.name,
            predicted.spatial_variance
        );
    }
}

/// Returns the number of independent values in the pattern. After a blur with standard deviation `s`, about `4 pi s^2`
/// pixels count as one value.
fn cells(definition: &Definition) -> f64 {
    match definition.name {
        "column_pattern" => f64::from(WIDTH),
        "row_pattern" => f64::from(HEIGHT),
        "smooth_prnu" => f64::from(WIDTH * HEIGHT) / (4.0 * std::f64::consts::PI * 9.0),
        _ => f64::from(WIDTH * HEIGHT),
    }
}

/// Returns whether plans with this effect have dynamics. The test camera has a dark current, because telegraph noise
/// requires one.
fn has_dynamics(definition: &'static Definition) -> bool {
    let dark = effects::find("dark_current").unwrap().typical();
    let camera = Camera::ideal(sensor(4, 4)).with_effect(dark).with_effect(definition.typical());
    Plan::with_max_light(&camera, seeds(0), 0.5).unwrap().dynamics().is_some()
}

/// Returns strengths at which even the brightest of 25,000 pixels stays below saturation.
fn strengths(definition: &'static Definition, rate: f64) -> &'static [f64] {
    match (definition.name, rate > 0.9) {
        // `effects_dynamics.rs` compares these effects in more detail, so one strength is sufficient here.
        (_, bright) if has_dynamics(definition) => {
            if bright {
                &[0.5]
            } else {
                &[1.0]
            }
        }
        ("hot_pixels", true) => &[],
        ("dark_tail", true) => &[0.05],
        ("bias_voltage", true) => &[0.1, 0.2],
        (_, true) => &[0.25, 0.5],
        ("start_phase" | "bias_voltage" | "vignetting" | "dark_tail", _) => &[0.25, 0.5],
        _ => &[0.5, 1.0, 2.0],
    }
}

#[test]
fn rates_and_spreads_are_the_predicted_ones_at_dim_middle_and_bright_light() {
    let mut known = KnownRates::new();
    for definition in effects::ALL {
        // `effects_dynamics.rs` compares dropped and repeated readouts bit by bit.
        if matches!(definition.name, "dropped_readouts" | "repeated_readouts") {
            continue;
        }
        for rate in [0.01, 0.3, 0.95] {
            for &strength in strengths(definition, rate) {
                let (without, with, _) = pair(definition, strength, rate);
                let effect = with.effect(definition.name).unwrap();
                if effect.moments(&without.operating_point(rate)).is_some() {
                    check_pattern(&mut known, definition, strength, rate);
                }
            }
        }
    }
}

/// Returns the increase of `D(n)` per interval between two lags `n`, multiplied by the squared rate.
fn growth(times: &SpikeTimes, lags: [usize; 2]) -> Estimate {
    let rate = times.rate().mean;
    let scale = rate * rate / (lags[1] - lags[0]) as f64;
    let (low, high) = (times.interval_sum_variance(lags[0]), times.interval_sum_variance(lags[1]));
    Estimate { mean: (high.mean - low.mean) * scale, error: high.error.hypot(low.error) * scale, ..high }
}

/// Compares the predicted phase variance with the growth of `D(n)`.
///
/// The strengths are so large that the phase variance exceeds the variance of the quantization. `D(n)` is linear in the
/// phase variance. The measurement uses 300 pixels whose light differs by 5 %, for 20,000 readouts. The test allows 4.5
/// standard errors, computed from the scatter between pixels, plus 5 % for higher orders that the prediction lacks. The
/// printed errors are 2 to 5 % of `D(n)`.
#[test]
fn phase_variances_are_the_predicted_ones() {
    let cases: [(&str, &[(&str, f64)]); 7] = [
        ("telegraph_dark", &[("amplitude", 0.1), ("fraction", 1.0), ("rate", 0.05)]),
        ("shot_noise", &[("strength", 20.0)]),
        ("shot_noise", &[("strength", 1.0), ("counts", 1.0), ("photons_at_full_scale", 1000.0)]),
        ("dark_shot_noise", &[("strength", 40.0)]),
        ("thermal_noise", &[("sigma", 0.02), ("temperature", 293.0)]),
        ("missed_spikes", &[("probability", 0.02)]),
        ("false_spikes", &[("probability", 1e-4)]),
    ];
    for (name, values) in cases {
        for rate in [0.01, 0.3, 0.9] {
            let effect = effects::find(name).unwrap().neutral();
            let effect = values.iter().fold(effect, |e, (k, v)| e.with_value(k, *v).unwrap());
            let without = crate::common_oracle::with_size(base(rate), 300, 1);
            let predicted: Moments = effect.moments(&without.operating_point(rate)).unwrap();
            let camera = without.clone().with_effect(effect);
            let light = crate::common_oracle::spread_light(without.operating_point(rate).light, 0.05, 300, 3);
            let lags = if rate < 0.1 { [4, 40] } else { [40, 400] };
            let measured = growth(&simulate_times(&camera, seeds(1), &light, 100, 20_000), lags);
            let truth = growth(&oracle(&camera.model(seeds(1)).unwrap(), &light, 100, 20_000, 2), lags);
            eprintln!(
                "{name} at {rate}: predicted {:.3e}, plan {:.3e} +- {:.0e}, oracle {:.3e}",
                predicted.phase_variance, measured.mean, measured.error, truth.mean
            );
            // The mean interval is estimated from the same stream, which reduces variances. With N intervals in a
            // stream, the measured variance of the sum of n intervals is 1 - n/N of the true variance. The growth
            // between the lags `low` and `high` is 1 - (low + high)/N of the true growth.
            let share = 1.0 - (lags[0] + lags[1]) as f64 / (20_000.0 * rate);
            let pinned = predicted.phase_variance * share;
            for side in [measured, truth] {
                let bound = 4.5 * side.error + 0.05 * pinned;
                assert!((side.mean - pinned).abs() < bound, "{name} at {rate}: {side}, {predicted:?}");
            }
        }
    }
}

/// If there is no closed form, the exact law is the prediction.
#[test]
fn effects_without_a_closed_form_follow_the_exact_law() {
    let partial = |share: f64| {
        effects::find("partial_reset").unwrap().neutral().with_value("lost_remainder", share).unwrap()
    };
    let redrawn = |sigma: f64| {
        let noise = effects::find("thermal_noise").unwrap().neutral();
        noise.with_value("sigma", sigma).unwrap().with_value("noise_sampling", 1.0).unwrap()
    };
    for effect in [partial(0.05), partial(0.5), partial(1.0), redrawn(0.001), redrawn(0.01), redrawn(0.04)] {
        for rate in [0.01, 0.3, 0.95] {
            let without = crate::common_oracle::with_size(base(rate), 200, 1);
            assert!(effect.moments(&without.operating_point(rate)).is_none());
            let light = crate::common_oracle::spread_light(without.operating_point(rate).light, 0.03, 200, 3);
            let light: Vec<f32> = light.into_iter().map(|l| l.min(0.52)).collect();
            // The plan accepts light up to full scale because of the clamp. The charge never reaches this clamp.
            let clamp = effects::find("saturation_clamp")
                .unwrap()
                .neutral()
                .with_value("largest_charge", 3.0)
                .unwrap();
            let camera = without.with_effect(effect.clone()).with_effect(clamp);
            let simulated_rate = simulate_times(&camera, seeds(1), &light, 200, 10_000).rate();
            let truth = oracle(&camera.model(seeds(1)).unwrap(), &light, 200, 10_000, 2).rate();
            // Plan and law have equal light. Each pixel's counts differ by less than one spike in 10,000 readouts. For
            // 200 pixels, this is a difference of 1e-5 in the mean rate. Noise that changes the rate adds a scatter
            // below 2e-5.
            eprintln!(
                "{} {:?} at {rate}: plan {:.6}, oracle {:.6}",
                effect.name(),
                effect.values(),
                simulated_rate.mean,
                truth.mean
            );
            assert!(
                (simulated_rate.mean - truth.mean).abs() < 6e-5,
                "{} at {rate}: {simulated_rate} {truth}",
                effect.name()
            );
        }
    }
}
