//! The other simulators' rules, written out in f64 as their programs have them, against the presets.

mod common_oracle;

use common_oracle::{Estimate, Independent, Times, planned, preset, seeds, spread_light};
use spikelane::pixel::Noise;

/// SpikingSIM: 250 clocks of 0.2 us a readout, hard reset at the clock that reaches 2 V, uniform
/// "diffuse" noise at about every 25th clock, and one voxel in N(140, 50) forced to 1, counted along time as the
/// program's (H, W, T) array lies; or, when not `regular`, as many at random places.
fn spikingsim(light: &[f32], warm: usize, readouts: usize, seed: u64, regular: bool) -> Times {
    let mut noise = Independent::new(seed);
    let mut pixels: Vec<Vec<u32>> = light
        .iter()
        .map(|&g| {
            let (mut volts, mut times) = (2.0 * noise.uniform(), Vec::new());
            let mut next = noise.poisson(25.0);
            for t in 0..warm + readouts {
                let mut fired = false;
                for _ in 0..250 {
                    next -= 1.0;
                    let diffuse = if next <= 0.0 { 0.001 * (noise.uniform() - 0.5) } else { 0.0 };
                    if next <= 0.0 {
                        next = noise.poisson(25.0);
                    }
                    volts += (f64::from(g) + diffuse) * 7.94e-3;
                    if volts >= 2.0 {
                        volts = 0.0;
                        fired = true;
                    }
                }
                if fired && t >= warm {
                    times.push((t - warm) as u32);
                }
            }
            times
        })
        .collect();
    for times in &mut pixels {
        let mut at = 0.0;
        let mut forced = Vec::new();
        loop {
            at += if regular {
                (140.0 + 50.0 * noise.normal()).max(1.0)
            } else {
                1.0 + (-140.0 * (1.0 - noise.uniform()).ln()).floor()
            };
            if at >= readouts as f64 {
                break;
            }
            forced.push(at as u32);
        }
        times.extend(forced);
        times.sort_unstable();
        times.dedup();
    }
    Times { readouts, pixels }
}

/// Share of outliers of every pixel.
fn outliers(times: &Times) -> Estimate {
    let one = |t: &Vec<u32>| Times { readouts: times.readouts, pixels: vec![t.clone()] }.outliers();
    Estimate::of(times.pixels.iter().map(one))
}

/// The preset in the same light, on ten copies of every pixel.
fn folded(light: &[f32]) -> Times {
    planned(&preset("spikingsim", 1500, 10), seeds(1), &light.repeat(10), 20, 600)
}

/// The clocks take 250 additions a readout, so 1,500 pixels x 600 readouts; the preset runs over
/// ten times as many. 4.5 joint errors, which is 5 % of D(1), 7 % of D(8), 10 % of D(32) and 15 % of the outliers.
#[test]
fn the_folded_increment_has_the_statistics_of_spikingsims_clocks() {
    let light = spread_light(0.19, 0.05, 1500, 1);
    let clocks = spikingsim(&light, 20, 600, 2, false);
    let folded = folded(&light);
    let (a, b) = (clocks.rate(), folded.rate());
    eprintln!("rate: clocks {a}, folded {b}");
    assert!(a.sigmas(b, 0.0).abs() < 4.5, "{a} {b}");
    for n in [1, 8, 32] {
        let (a, b) = (clocks.d(n), folded.d(n));
        eprintln!("D({n}): clocks {a}, folded {b}");
        assert!(a.sigmas(b, 0.0).abs() < 4.5, "D({n}): {a} {b}");
    }
    let (a, b) = (outliers(&clocks), outliers(&folded));
    eprintln!("outliers: clocks {a}, folded {b}");
    assert!(a.sigmas(b, 0.0).abs() < 4.5, "{a} {b}");
}

/// The program places its false spikes along time at N(140, 50) readouts, more evenly than chance.
/// The preset's are independent. The rate and D(1) do not know; the outliers
/// and D(8) do by a sixth, and D(32), which spans 160 readouts, is twice as large. The preset says so; its false spikes are the only difference.
#[test]
fn evenly_spaced_false_spikes_lower_the_long_lags_only() {
    let light = spread_light(0.19, 0.05, 1500, 1);
    let even = spikingsim(&light, 20, 600, 3, true);
    let folded = folded(&light);
    eprintln!("outliers: evenly spaced {:.4}, folded {:.4}", even.outliers(), folded.outliers());
    let ratio = |n| {
        let (a, b) = (even.d(n), folded.d(n));
        eprintln!("D({n}): evenly spaced {a}, folded {b}");
        b.mean / a.mean
    };
    assert!((even.rate().mean / folded.rate().mean - 1.0).abs() < 0.01);
    assert!((even.outliers() / folded.outliers() - 1.0).abs() < 0.25);
    assert!((ratio(1) - 1.0).abs() < 0.1);
    assert!((ratio(8) - 1.0).abs() < 0.35);
    assert!((1.5..2.5).contains(&ratio(32)));
}

/// SpikeCV's image converter: membrane += 0.5 grey/255, a spike sets it to 0. It fires at
/// every ceil(1/x)-th readout exactly; how much of the mean rate that loses
/// depends on the spread of the rates: 9.4 % for 5 % about 0.195 (8.7 % was published for a wall).
#[test]
fn spikecvs_image_converter_quantises_rates_and_loses_light() {
    let light = spread_light(0.39, 0.05, 20_000, 4);
    let found = planned(&preset("spikecv-image", 400, 50), seeds(1), &light, 0, 1000);
    for (times, &x) in found.pixels.iter().zip(&light) {
        let period = (1.0 / (0.5 * f64::from(x))).ceil() as u32;
        assert!(times.windows(2).all(|w| w[1] - w[0] == period), "{x}");
    }
    let ideal = light.iter().map(|&x| 0.5 * f64::from(x)).sum::<f64>() / 20_000.0;
    let lost = found.rate().mean / ideal - 1.0;
    let expected =
        light.iter().map(|&x| 1.0 / (2.0 / f64::from(x)).ceil()).sum::<f64>() / 20_000.0 / ideal - 1.0;
    eprintln!("mean rate {lost:+.4}, by the rule {expected:+.4}");
    // The recording ends within an interval: at most a spike of 190, 0.5 %.
    assert!((lost - expected).abs() < 0.005, "{lost} {expected}");
}

/// The noise-free video converters fire at grey/divisor per readout, exactly to one spike.
#[test]
fn the_noise_free_converters_divide_the_grey_level_as_stated() {
    let levels: Vec<f32> = (0..=255).map(|g| g as f32 / 255.0).collect();
    for (name, divisor) in [("spcs", 256.0), ("spikecv", 5.0 * 255.0), ("spike-zoo", 2.0 * 255.0)] {
        let found = planned(&preset(name, 256, 1), seeds(1), &levels, 0, 10_000);
        for (g, times) in found.pixels.iter().enumerate() {
            let expected = g as f64 / divisor * 10_000.0;
            assert!(
                (times.len() as f64 - expected).abs() <= 1.01,
                "{name}, grey {g}: {} {expected}",
                times.len()
            );
        }
    }
}
