//! Every effect: nothing at its neutral value, and what it predicts for an observer otherwise.

use crate::common_oracle::{Estimate, Times, charges, oracle, packed, planned, preset, seeds, sensor};
use spikelane::effects::{self, Definition, Effect, Moments};
use spikelane::{Camera, Plan, Simulator};

/// Light of 130 pixels: dark, dim, middle, full scale and beyond.
fn mixed_light() -> Vec<f32> {
    (0..130).map(|p| [0.0, 0.002, 0.05, 0.3, 0.95, 1.0, 1.4][p % 7] * (1.0 + p as f32 / 2000.0)).collect()
}

#[test]
fn every_effect_at_its_neutral_value_equals_its_absence_bit_for_bit() {
    let ideal = Camera::ideal(sensor(26, 5));
    let mut cameras = vec![ideal.clone()];
    cameras.extend(["physical", "scsim-code", "scsim-paper", "spikecv-image"].map(|n| preset(n, 26, 5)));
    // Each effect alone at its typical value: pairs of effects that share a rule meet here.
    let clamp = || effects::find("saturation_clamp").unwrap().typical();
    cameras.extend(effects::ALL.iter().map(|d| ideal.clone().with(clamp()).with(d.typical())));
    for camera in cameras {
        for definition in effects::ALL {
            let without = camera.clone().without(definition.name);
            let neutral = camera.clone().with(definition.neutral());
            let light = mixed_light();
            // Hard reset without a clamp has no plan beyond full scale, with or without the effect.
            let most = f64::from(light.iter().copied().fold(0.0, f32::max));
            let plans = [&without, &neutral].map(|c| Plan::with_light(c, seeds(1), most).is_ok());
            assert_eq!(plans[0], plans[1], "{} on {}", definition.name, camera.name);
            if plans[0] {
                let [a, b] = [&without, &neutral].map(|c| packed(c, seeds(1), &light, 150));
                let names: Vec<_> = without.effects().iter().map(Effect::name).collect();
                assert!(a == b, "{} beside {names:?}", definition.name);
            }
        }
    }
}

/// Pixels of the fixed-pattern measurements: of the shape that vignetting's closed form is for.
const WIDTH: u32 = 200;
const HEIGHT: u32 = 125;

/// Half of the charge is light, half dark current, so that effects of either show.
fn base(rate: f64) -> Camera {
    let camera = Camera::ideal(sensor(WIDTH, HEIGHT));
    let circuit = effects::Circuit::nominal(&camera.sensor);
    let dark = rate / 2.0 / circuit.thresholds_of_pa(1.0);
    let dark = effects::find("dark_current").unwrap().neutral().with("mean", dark).unwrap();
    camera.with(effects::find("start_phase").unwrap().typical()).with(dark)
}

/// Readouts of the measurement of a drift, which is that long.
const DRIFT: f64 = 1000.0;

/// `definition` at `strength` times its typical distance from neutral; choices stay neutral.
fn at_strength(definition: &'static Definition, strength: f64) -> Effect {
    definition.params.iter().fold(definition.neutral(), |effect, param| match param.form {
        effects::definition::Form::Number { low, high, .. } if param.neutral.is_finite() => {
            // A rare pixel's factor stays; its share is the strength.
            let scale = if param.key == "factor" { 1.0 } else { strength };
            let typical = if param.key == "duration" { DRIFT } else { param.typical };
            let neutral = if param.key == "duration" { DRIFT } else { param.neutral };
            let value = neutral + scale * (typical - neutral);
            effect.with(param.key, value.clamp(low, high)).unwrap()
        }
        effects::definition::Form::Number { .. } => effect.with(param.key, param.typical + 0.5).unwrap(),
        effects::definition::Form::Choice(_) => effect,
    })
}

/// The base camera in the light that makes `rate`, with and without the effect.
fn pair(definition: &'static Definition, strength: f64, rate: f64) -> (Camera, Camera, f64) {
    let without = match definition.name {
        // The effect replaces the base's own; its light then makes the whole rate.
        "dark_current" => base(rate).without("dark_current"),
        "start_phase" => base(rate).without("start_phase"),
        _ => base(rate),
    };
    let light = without.operating(rate).light;
    (without.clone(), without.with(at_strength(definition, strength)), light)
}

/// Mean charge per readout of every pixel over its threshold, by the exact law, at most one.
fn exact_rates(camera: &Camera, light: f64) -> Vec<f64> {
    let model = camera.model(seeds(0)).unwrap();
    let law = |p: usize| model.law(p);
    let ideal = |p: usize| ((law(p).gain * light + law(p).dark) / law(p).threshold).clamp(0.0, 1.0);
    (0..model.circuit.pixels()).map(ideal).collect()
}

/// Rate of every pixel by the plan: spikes plus the change of stored charge, per readout, so that
/// no spike is cut in half; effects that lose charge or flip bits count spikes alone.
fn plan_rates(camera: &Camera, light: f64, [warm, readouts]: [usize; 2], whole_spikes: bool) -> Vec<f64> {
    let plan = Plan::new(camera, seeds(0)).unwrap();
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::of_plan(plan.clone());
    let mut bytes = vec![0; readouts.max(warm) * geometry.frame_bytes()];
    let frame = vec![light as f32; geometry.pixels()];
    let frame_bytes = geometry.frame_bytes();
    let first = &mut bytes[..warm * frame_bytes];
    simulator.push(spikelane::simulate::FrameRef::f32(&frame, geometry), first).unwrap();
    let before = charges(&plan, simulator.state());
    bytes.truncate(readouts * frame_bytes);
    simulator.push(spikelane::simulate::FrameRef::f32(&frame, geometry), &mut bytes).unwrap();
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

/// Mean rates of cameras without the effect that were measured already.
type Known = std::collections::BTreeMap<String, f64>;

/// The fixed pattern of 25,000 pixels: the mean of a spread `s` is known to `s / 158`, its variance to
/// 0.9 % (Gaussian; a rare fraction `f` of pixels to `1/sqrt(25,000 f)`, a log-normal to 4 %).
/// Predictions are of lowest order, so a relative error of twice the predicted relative spread
/// is allowed on top; at rate 0.95 only weak strengths stay below saturation.
fn check_pattern(known: &mut Known, definition: &'static Definition, strength: f64, rate: f64) {
    let (without, with, light) = pair(definition, strength, rate);
    let effect = with.effect(definition.name).unwrap();
    let predicted = effect.moments(&without.operating(rate)).unwrap();
    let spread = predicted.spatial_variance.max(0.0).sqrt();
    let flips = match definition.name {
        "missed_spikes" | "false_spikes" | "dead_time" | "saturation_clamp" => true,
        // The charge of a spike is no longer one threshold.
        "leak" | "adaptation" | "supply_droop" | "spike_coupling" => true,
        _ => false,
    };
    // Whole swings of the typical flicker, 200 readouts each.
    let readouts = ((10.0 / rate) as usize + 200).next_multiple_of(200);
    let spans = match definition.name {
        "gain_drift" => [0, DRIFT as usize],
        "adaptation" | "image_lag" => [1000, readouts],
        _ => [0, readouts],
    };
    let readouts = spans[1];
    let found = plan_rates(&with, light, spans, flips);
    let key = format!("{:?} {rate} {spans:?} {flips}", without.effects());
    let before = known.entry(key).or_insert_with(|| mean(&plan_rates(&without, light, spans, flips)));
    let added = mean(&found) - *before;
    let rare = match definition.name {
        "hot_pixels" | "dead_pixels" => 5.0 / (25_000.0 * effect.values()[0]).sqrt(),
        "dark_tail" => 0.2,
        "vignetting" => 0.03,
        "column_pattern" | "row_pattern" | "smooth_prnu" => 5.0 * (2.0 / cells(definition)).sqrt(),
        _ => 0.05,
    };
    // Independent flips scatter the count by its own root.
    let scatter = (predicted.rate.abs() / (25_000.0 * readouts as f64)).sqrt();
    let second_order = 2.0 * spread + 2.0 * predicted.rate.abs() / rate;
    // Noise of the pixels' own: the relative variance of a count, over all pixels.
    let own = (predicted.phase_variance / (rate * readouts as f64 * 25_000.0)).sqrt() * rate;
    let pattern = spread * rate / cells(definition).sqrt();
    let tolerance = predicted.rate.abs() * (rare + second_order) + 5.0 * (pattern + scatter + own) + 4e-6;
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
    // The plan's rates also hold the temporal noise of a finite run.
    let temporal = 1.5 * predicted.phase_variance / (rate * readouts as f64);
    for (side, rates, noise) in [("plan", &found, temporal), ("oracle", &exact, 0.0)] {
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

/// Independent values of the pattern over the sensor; a blur of deviation `s` correlates `4 pi s^2` pixels.
fn cells(definition: &Definition) -> f64 {
    match definition.name {
        "column_pattern" => f64::from(WIDTH),
        "row_pattern" => f64::from(HEIGHT),
        "smooth_prnu" => f64::from(WIDTH * HEIGHT) / (4.0 * std::f64::consts::PI * 9.0),
        _ => f64::from(WIDTH * HEIGHT),
    }
}

/// Whether plans with this effect leave the common bodies; dark current is what telegraph noise needs to show.
fn is_further(definition: &'static Definition) -> bool {
    let dark = effects::find("dark_current").unwrap().typical();
    let camera = Camera::ideal(sensor(4, 4)).with(dark).with(definition.typical());
    Plan::with_light(&camera, seeds(0), 0.5).unwrap().moving().is_some()
}

/// Strengths that keep the brightest pixels of 25,000 below saturation.
fn strengths(definition: &'static Definition, rate: f64) -> &'static [f64] {
    match (definition.name, rate > 0.9) {
        // One strength of those that `effects_further.rs` compares bit by bit or with the exact law.
        (_, bright) if is_further(definition) => {
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
    let mut known = Known::new();
    for definition in effects::ALL {
        // Whole readouts that go wrong are compared bit by bit in `effects_further.rs`.
        if matches!(definition.name, "dropped_readouts" | "repeated_readouts") {
            continue;
        }
        for rate in [0.01, 0.3, 0.95] {
            for &strength in strengths(definition, rate) {
                let (without, with, _) = pair(definition, strength, rate);
                let effect = with.effect(definition.name).unwrap();
                if effect.moments(&without.operating(rate)).is_some() {
                    check_pattern(&mut known, definition, strength, rate);
                }
            }
        }
    }
}

/// Growth of `D` per interval between `low` and `high`, times the squared rate, of 300 pixels alike but for
/// 5 % of light, on both sides.
fn growth(times: &Times, lags: [usize; 2]) -> Estimate {
    let rate = times.rate().mean;
    let scale = rate * rate / (lags[1] - lags[0]) as f64;
    let (low, high) = (times.d(lags[0]), times.d(lags[1]));
    Estimate { mean: (high.mean - low.mean) * scale, error: high.error.hypot(low.error) * scale, ..high }
}

/// The phase variance as the growth of `D(n)`. Strengths are raised so that it stands out of the
/// quantisation; D is linear in them. 300 pixels x 20,000 readouts. 4.5 standard errors over the
/// pixels and 5 % for the missing higher orders; printed errors are 2 to 5 % of the value.
#[test]
fn phase_variances_are_the_predicted_ones() {
    let cases: [(&str, &[(&str, f64)]); 7] = [
        ("telegraph_dark", &[("amplitude", 0.1), ("pixels", 1.0), ("rate", 0.05)]),
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
            let effect = values.iter().fold(effect, |e, (k, v)| e.with(k, *v).unwrap());
            let without = crate::common_oracle::sized(base(rate), 300, 1);
            let predicted: Moments = effect.moments(&without.operating(rate)).unwrap();
            let camera = without.clone().with(effect);
            let light = crate::common_oracle::spread_light(without.operating(rate).light, 0.05, 300, 3);
            let lags = if rate < 0.1 { [4, 40] } else { [40, 400] };
            let found = growth(&planned(&camera, seeds(1), &light, 100, 20_000), lags);
            let truth = growth(&oracle(&camera.model(seeds(1)).unwrap(), &light, 100, 20_000, 2), lags);
            eprintln!(
                "{name} at {rate}: predicted {:.3e}, plan {:.3e} +- {:.0e}, oracle {:.3e}",
                predicted.phase_variance, found.mean, found.error, truth.mean
            );
            // The mean interval is the stream's own, so the sum of n intervals out of N keeps
            // 1 - n/N of its variance, and the growth between two lags 1 - (low + high)/N.
            let kept = 1.0 - (lags[0] + lags[1]) as f64 / (20_000.0 * rate);
            let pinned = predicted.phase_variance * kept;
            for side in [found, truth] {
                let bound = 4.5 * side.error + 0.05 * pinned;
                assert!((side.mean - pinned).abs() < bound, "{name} at {rate}: {side}, {predicted:?}");
            }
        }
    }
}

/// Where no closed form exists the exact law is the prediction.
#[test]
fn effects_without_a_closed_form_follow_the_exact_law() {
    let partial =
        |share: f64| effects::find("partial_reset").unwrap().neutral().with("lost_remainder", share).unwrap();
    let redrawn = |sigma: f64| {
        let noise = effects::find("thermal_noise").unwrap().neutral();
        noise.with("sigma", sigma).unwrap().with("redraw", 1.0).unwrap()
    };
    for effect in [partial(0.05), partial(0.5), partial(1.0), redrawn(0.001), redrawn(0.01), redrawn(0.04)] {
        for rate in [0.01, 0.3, 0.95] {
            let without = crate::common_oracle::sized(base(rate), 200, 1);
            assert!(effect.moments(&without.operating(rate)).is_none());
            let light = crate::common_oracle::spread_light(without.operating(rate).light, 0.03, 200, 3);
            let light: Vec<f32> = light.into_iter().map(|l| l.min(0.52)).collect();
            // A bound that is never reached lets the plan take light up to full scale.
            let clamp =
                effects::find("saturation_clamp").unwrap().neutral().with("largest_charge", 3.0).unwrap();
            let camera = without.with(effect.clone()).with(clamp);
            let found = planned(&camera, seeds(1), &light, 200, 10_000).rate();
            let truth = oracle(&camera.model(seeds(1)).unwrap(), &light, 200, 10_000, 2).rate();
            // The same light on both sides: per pixel less than a spike of 10,000 readouts, over 200
            // pixels 1e-5; noise that moves the rate adds its own scatter, below 2e-5.
            eprintln!(
                "{} {:?} at {rate}: plan {:.6}, oracle {:.6}",
                effect.name(),
                effect.values(),
                found.mean,
                truth.mean
            );
            assert!((found.mean - truth.mean).abs() < 6e-5, "{} at {rate}: {found} {truth}", effect.name());
        }
    }
}
