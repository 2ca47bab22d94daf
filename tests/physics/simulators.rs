//! The other simulators' rules, written out in f64 as their programs have them, against the presets.

use crate::common_oracle::{Estimate, Independent, Times, planned, preset, seeds, spread_light};
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

/// Readouts at which `img_to_spike()` fires for `grey`, in the precision that its pictures have: f64 where codes are bytes.
macro_rules! readouts_of {
    ($float:ty, $grey:expr, $readouts:expr) => {{
        let (mut mem, mut times): ($float, Vec<u32>) = (0.0, Vec::new());
        for t in 0..$readouts {
            mem += $grey as $float / 255.0 * 0.5;
            if mem >= 1.0 {
                mem = 0.0;
                times.push(t);
            }
        }
        times
    }};
}

/// In f32 the program's loop fires at all 15 greys of which a number of steps is the threshold, as the preset does. In f64, which
/// it computes in when codes are bytes, its sums fall short of 1 by an ulp or two at nine of them, and these fire a readout late;
/// the preset does not follow it there.
#[test]
fn every_grey_fires_at_the_readouts_of_spikecvs_image_converter() {
    let levels: Vec<f32> = (0..=255).map(|g| g as f32 / 255.0).collect();
    let found = planned(&preset("spikecv-image", 256, 1), seeds(1), &levels, 0, 1100);
    let mut late = Vec::new();
    for (grey, times) in found.pixels.iter().enumerate() {
        assert_eq!(times, &readouts_of!(f32, grey, 1100), "grey {grey}");
        if times != &readouts_of!(f64, grey, 1100) {
            late.push(grey);
        }
    }
    assert_eq!(late, [1, 2, 3, 5, 6, 17, 34, 51, 85]);
    assert_eq!(found.pixels[170][..3], [2, 5, 8]);
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

/// Mean rate of each level under the preset, over pixels side by side.
fn rates_of(name: &str, levels: &[f64], pixels: usize, readouts: usize) -> Vec<f64> {
    let camera = preset(name, (pixels * levels.len()) as u32, 1);
    let light: Vec<f32> = levels.iter().flat_map(|&level| vec![level as f32; pixels]).collect();
    let found = planned(&camera, seeds(1), &light, 20, readouts);
    let rate =
        |times: &[Vec<u32>]| times.iter().map(Vec::len).sum::<usize>() as f64 / (pixels * readouts) as f64;
    found.pixels.chunks(pixels).map(rate).collect()
}

/// The light that the front end of the preset makes of a gray code, in full scales; `peak` is the brightest code of the
/// picture. `spikelane-io` tests that pictures become this light.
fn level(name: &str, code: f64, peak: f64) -> f64 {
    match name {
        "spikingsim" => code / peak,
        _ => code / 255.0,
    }
}

/// Pillow's convert('L').
fn pillow([r, g, b]: [u8; 3]) -> f64 {
    f64::from((19595 * u32::from(r) + 38470 * u32::from(g) + 7471 * u32::from(b) + 32768) >> 16)
}

/// OpenCV's cvtColor(COLOR_BGR2GRAY) of 8 bits.
fn opencv([r, g, b]: [u8; 3]) -> f64 {
    f64::from((9798 * u32::from(r) + 19235 * u32::from(g) + 3735 * u32::from(b) + 16384) >> 15)
}

/// Rate of `pixels` integrators that gain `grey` a readout and give back `threshold` at a spike.
fn soft_reset(grey: f64, threshold: f64, pixels: usize, readouts: usize, noise: &mut Independent) -> f64 {
    let mut spikes = 0;
    for _ in 0..pixels {
        let mut integral = threshold * noise.uniform();
        for _ in 0..readouts {
            integral += grey;
            if integral >= threshold {
                integral -= threshold;
                spikes += 1;
            }
        }
    }
    spikes as f64 / (pixels * readouts) as f64
}

/// img_to_spike(): mem += 0.5 img / 255, a spike at 1 empties it.
fn hard_reset(img: f64, readouts: usize) -> f64 {
    let (mut mem, mut spikes) = (0.0, 0);
    for _ in 0..readouts {
        mem += 0.5 * (img / 255.0);
        if mem >= 1.0 {
            mem = 0.0;
            spikes += 1;
        }
    }
    f64::from(spikes) / readouts as f64
}

/// Which of SCSim's rules: its code's, its paper's, or with neither fixed pattern nor threshold noise (NeuSpike).
#[derive(Clone, Copy, PartialEq)]
enum Scsim {
    Code,
    Paper,
    NeuSpike,
}

/// get_spike() of SCSim's v2s.py over `pixels` pixels of one grey.
fn scsim(grey: f64, which: Scsim, pixels: usize, readouts: usize, noise: &mut Independent) -> f64 {
    let spread = if which == Scsim::NeuSpike { 0.0 } else { 1.0 };
    // NeuSpike has no bias and SCSim's nominal swing; its full scale is one threshold too.
    let bias = -0.0076 * spread;
    let (sigma, delay) = match which {
        Scsim::Code => (0.00636, 0.998),
        Scsim::Paper => (0.964e-3, 1.0),
        Scsim::NeuSpike => (0.0, 1.0),
    };
    let mean_gain = if which == Scsim::Paper { 1.0128 } else { 1.0 };
    let mut spikes = 0;
    for _ in 0..pixels {
        let dark = 0.4442 + 0.1731 * spread * noise.normal();
        let capacitance = 4.348 + 0.0128 * spread * noise.normal();
        let swing = 1.1 + bias + 0.0497 * spread * noise.normal();
        let gain = mean_gain * (1.0 + 0.0584 / 1.0128 * spread * noise.normal());
        let (mut charge, mut fired) = (noise.uniform(), false);
        let photons = (5e4 * grey / 255.0).floor();
        for _ in 0..readouts {
            let shot = if grey > 0.0 { noise.poisson(photons) / photons } else { 0.0 };
            let current = dark + shot * 20.0 * 4.348 * (1.1 + bias) * grey * gain / 255.0;
            charge += 0.05 * current * if fired { delay } else { 1.0 };
            let threshold = capacitance * (swing + sigma * noise.normal());
            fired = charge >= threshold;
            if fired {
                charge -= threshold;
                spikes += 1;
            }
        }
    }
    spikes as f64 / (pixels * readouts) as f64
}

/// The gray code that the original program makes of a color.
fn code(name: &str, color: [u8; 3]) -> f64 {
    match name {
        "spcs" | "scsim-code" | "scsim-paper" => pillow(color),
        "spikecv-image" => color.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0,
        _ => opencv(color),
    }
}

/// The original's rate for a gray code in a picture whose brightest gray code is `peak`.
fn original(name: &str, code: f64, peak: f64, noise: &mut Independent) -> f64 {
    match name {
        "spcs" => soft_reset(code, 256.0, 1, 100_000, noise),
        "spikecv" => soft_reset(code / 255.0, 5.0, 1, 100_000, noise),
        "spike-zoo" => soft_reset(code / 255.0, 2.0, 1, 100_000, noise),
        "spikecv-image" => hard_reset(code, 100_000),
        "scsim-code" => scsim(code, Scsim::Code, 4000, 400, noise),
        "scsim-paper" => scsim(code, Scsim::Paper, 4000, 400, noise),
        "neuspike" => scsim(code, Scsim::NeuSpike, 100, 2000, noise),
        "spikingsim" => spikingsim(&[(code / peak) as f32; 40], 20, 2000, 7, true).rate().mean,
        other => panic!("no rule for {other}"),
    }
}

/// The light of a color fires at the rate of the program of the preset's name.
///
/// Without a fixed pattern a patch's rate is known to a spike a pixel in 1,500 readouts, at worst where all start empty
/// (SPCS, 0.4 % at the darkest). SCSim's fixed pattern spreads rates by 7.4 %, so 0.17 % of the 1,920 pixels of a patch
/// and 0.12 % of the rule's 4,000: 1 % is 4.9 errors of the difference. sRGB undone in error
/// is off by a factor of up to 5, BT.709 weights by 10 % and more in the colours here.
#[test]
fn comparison_presets_fire_at_the_rates_of_their_originals_on_gray_and_color_light() {
    let grey = [40, 77, 128, 160, 201, 230].map(|code| [code; 3]);
    let colour = [[201, 40, 30], [30, 150, 60], [60, 70, 220], [230, 210, 90], [90, 30, 120], [12, 160, 170]];
    let names = [
        "spcs",
        "spikecv",
        "spike-zoo",
        "spikecv-image",
        "scsim-code",
        "scsim-paper",
        "neuspike",
        "spikingsim",
    ];
    let mut noise = Independent::new(11);
    for colours in [grey, colour] {
        let peak = colours.iter().map(|&c| opencv(c)).fold(0.0, f64::max);
        for name in names {
            let (pixels, readouts) = if name.starts_with("scsim") { (1920, 600) } else { (192, 1500) };
            let codes = colours.map(|c| code(name, c));
            let found = rates_of(name, &codes.map(|c| level(name, c, peak)), pixels, readouts);
            for ((&c, code), rate) in colours.iter().zip(codes).zip(found) {
                let wanted = original(name, code, peak, &mut noise);
                eprintln!(
                    "{name} {c:?}: {rate:.5}, original {wanted:.5}, {:+.3} %",
                    100.0 * (rate / wanted - 1.0)
                );
                assert!((rate / wanted - 1.0).abs() < 0.01, "{name} {c:?}: {rate} {wanted}");
            }
        }
    }
}
