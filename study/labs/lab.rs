//! A random laboratory: a camera of known truth, lamps that are not what they are said to be, and one fault.

use spikelane::calibrate::{Level, Observed};
use spikelane::spikes::Geometry;

use super::calibrate_support::{Noise, Pixel, Random, level, pixels};

/// What is wrong in a laboratory, in the order in which they are drawn.
pub const FAULTS: [&str; 12] = [
    "nothing; lamps exact",
    "lamps within 0.1 %",
    "lamps within 1 %, as stated",
    "a third of the lamps off by up to 10 %",
    "one lamp mislabelled by 5 to 10 %",
    "no dark recording",
    "hot and dead pixels",
    "a stuck column",
    "pixels that blink from level to level",
    "a saturated level",
    "unequal lengths",
    "dark and two levels only",
];

/// Pixels of the sensors.
const WIDTH: u32 = 24;
const HEIGHT: u32 = 16;

pub struct Lab {
    pub fault: &'static str,
    pub noise: Noise,
    /// Levels as they are and as they are said to be, by rising light.
    pub levels: Vec<[f64; 2]>,
    pub observed: Observed,
}

impl Lab {
    /// The `index`-th laboratory: faults take turns, everything else is drawn by the index.
    pub fn new(index: u64) -> Self {
        let fault = FAULTS[index as usize % FAULTS.len()];
        let mut random = Random::new(0x1AB0_0000 + index);
        let noise = population(&mut random);
        let mut truth = pixels(&noise, (WIDTH * HEIGHT) as usize, 7_000 + index);
        spoil(fault, &mut truth, &mut random);
        let levels = lamps(fault, &mut random);
        let base = 2000 + (2000.0 * random.uniform()) as u32;
        let mut all: Vec<Level> = Vec::new();
        for (k, [light, stated]) in levels.iter().enumerate() {
            let longer = if fault == "unequal lengths" { 1 + (4.0 * random.uniform()) as u32 } else { 1 };
            // A tenth of the spikes of a dim level would be none at all.
            let readouts = (base * longer).max(if *light > 0.0 { (60.0 / light) as u32 } else { 0 });
            let mut shown = truth.clone();
            if fault.starts_with("pixels that blink") {
                for pixel in &mut shown[..20] {
                    pixel.gain *= 0.7 + 0.6 * random.uniform();
                }
            }
            let seed = index * 100 + k as u64;
            let mut one = level(&noise, &shown, *light, readouts, seed, *light < 0.12);
            one.light = *stated;
            one.name = format!("level_{k}.dat");
            all.push(one);
        }
        let observed = Observed {
            geometry: Geometry::new(WIDTH, HEIGHT).unwrap(),
            readout_hz: 20_000.0,
            levels: all,
            others: Vec::new(),
        };
        Self { fault, noise, levels, observed }
    }
}

/// Spreads and noise of a kind of camera.
fn population(random: &mut Random) -> Noise {
    let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
    let dark = between(0.003, 0.008);
    Noise {
        threshold_sd: between(0.005, 0.05),
        gain_sd: between(0.01, 0.07),
        dark,
        dark_sd: dark * between(0.15, 0.33),
        sigma_t: 5e-4 * 16.0_f64.powf(between(0.0, 1.0)),
        photons: between(2e4, 8e4),
        lost: 0.002,
    }
}

/// Makes defects.
fn spoil(fault: &str, truth: &mut [Pixel], random: &mut Random) {
    let dead = |p: &mut Pixel| (p.gain, p.dark) = (0.0, 0.0);
    match fault {
        "hot and dead pixels" => {
            truth[..15].iter_mut().for_each(|p| p.dark *= 5.0 + 20.0 * random.uniform());
            truth[15..20].iter_mut().for_each(dead);
        }
        "a stuck column" => truth.iter_mut().skip(3).step_by(WIDTH as usize).for_each(dead),
        _ => {}
    }
}

/// Levels as they are and as they are said to be.
fn lamps(fault: &str, random: &mut Random) -> Vec<[f64; 2]> {
    let lit = match fault {
        "dark and two levels only" => 2,
        _ => 4 + (8.0 * random.uniform()) as usize,
    };
    // One of each part of the range, so that none coincide.
    let step = 0.92 / lit as f64;
    let mut stated: Vec<f64> =
        (0..lit).map(|k| 0.02 + step * (k as f64 + 0.1 + 0.8 * random.uniform())).collect();
    if fault == "a saturated level" {
        stated.push(1.3);
    }
    let uncertainty = match fault {
        "nothing; lamps exact" => 0.0,
        "lamps within 0.1 %" => 0.001,
        _ => 0.01,
    };
    let mut levels: Vec<[f64; 2]> =
        stated.iter().map(|s| [s * (1.0 + uncertainty * random.normal()), *s]).collect();
    let off = match fault {
        _ if fault.starts_with("a third") => lit / 3,
        _ if fault.starts_with("one lamp") => 1,
        _ => 0,
    };
    let least = if fault.starts_with("one lamp") { 0.05 } else { 0.0 };
    for _ in 0..off {
        let k = ((random.uniform() * lit as f64) as usize).min(lit - 1);
        let by = least + (0.1 - least) * random.uniform();
        levels[k][0] = levels[k][1] * (1.0 + if random.uniform() < 0.5 { by } else { -by });
    }
    if fault != "no dark recording" {
        levels.insert(0, [0.0, 0.0]);
    }
    levels
}
