//! Simulates the readouts of a hidden sensor.

use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus as Generator;
use rand_distr::{Distribution, Poisson};

use super::physics::{Physics, Sensor, generator, normal};
use super::{READOUT_HZ, Scene};

/// Relative standard deviation of the light of the lamp.
pub const LAMP_DEVIATION: f64 = 1e-3;

/// Draws a Poisson-distributed number of electrons. Above a mean of 400 the function rounds a normal draw instead, whose
/// distribution differs by at most 1e-3.
fn electrons(rng: &mut Generator, mean: f64) -> f64 {
    match mean {
        ..=0.0 => 0.0,
        ..400.0 => Poisson::new(mean).unwrap().sample(rng),
        _ => (mean + mean.sqrt() * normal(rng)).round(),
    }
}

struct Streams {
    light: Generator,
    threshold: Generator,
    comparator: Generator,
    dark: Generator,
    slow: Generator,
    rows: Generator,
    flips: Generator,
    frames: Generator,
    switching: Generator,
    bursts: Generator,
    coins: Generator,
}

impl Streams {
    fn new(seed: u64, number: u64) -> Self {
        let generator_for = |purpose| generator(seed, purpose, number + 1);
        Self {
            light: generator_for("electrons"),
            threshold: generator_for("noise"),
            comparator: generator_for("comparator"),
            dark: generator_for("dark electrons"),
            slow: generator_for("slow"),
            rows: generator_for("row noise"),
            flips: generator_for("flips"),
            frames: generator_for("frames"),
            switching: generator_for("telegraph"),
            bursts: generator_for("bursts"),
            coins: generator_for("coins"),
        }
    }
}

struct Pixels {
    /// Number of electrons that are missing to the threshold.
    missing_electrons: Vec<f64>,
    fired: Vec<bool>,
    threshold_rise: Vec<f64>,
    threshold_wander: Vec<f64>,
    stored_light: Vec<f64>,
    is_switched: Vec<bool>,
    /// Surplus electrons that have not arrived in the pixel yet.
    pending_electrons: Vec<f64>,
    remembered_light: Vec<f64>,
    /// Whether each pixel fired at the previous readout.
    echo: Vec<bool>,
}

/// Simulates one recording. `number` seeds its temporal noise and the deviation of its lamp.
pub fn record(sensor: &Sensor, scene: Scene, readouts: usize, number: u64) -> Vec<u8> {
    let lamp = 1.0 + LAMP_DEVIATION * normal(&mut generator(sensor.seed, "lamp", number + 1));
    record_exact(sensor, scene.scale(lamp), readouts, number)
}

/// Simulates one recording of exactly this light. `number` seeds its temporal noise.
pub fn record_exact(sensor: &Sensor, scene: Scene, readouts: usize, number: u64) -> Vec<u8> {
    let p = &sensor.physics;
    let (width, height) = (sensor.width, sensor.height);
    let n = width * height;
    let mut streams = Streams::new(sensor.seed, number);
    let mut start = generator(sensor.seed, "start", number + 1);
    let mut pixels = Pixels {
        missing_electrons: (0..n).map(|i| sensor.threshold[i] * (1.0 - start.random::<f64>())).collect(),
        fired: vec![false; n],
        threshold_rise: vec![0.0; n],
        threshold_wander: (0..n)
            .map(|_| if p.slow.0 > 0.0 { p.slow.0 * normal(&mut streams.slow) } else { 0.0 })
            .collect(),
        stored_light: vec![0.0; n],
        is_switched: (0..n).map(|i| sensor.switching[i] && streams.switching.random::<bool>()).collect(),
        pending_electrons: vec![0.0; n],
        remembered_light: vec![0.0; n],
        echo: vec![false; n],
    };
    let levels = |t: usize| -> Vec<f64> {
        let scene_light: Vec<f64> = (0..n).map(|i| scene.at(i / width, i % width, t)).collect();
        with_crosstalk(&scene_light, width, p.crosstalk)
    };
    let hold = if let Scene::Square { half_period, .. } = scene { half_period } else { usize::MAX };
    let mut light = levels(0);
    let stride = n.div_ceil(8);
    let mut out = Vec::with_capacity(readouts * stride);
    let mut before = vec![false; n];
    let mut burst = 0.0;
    let mut t = 0;
    while out.len() < readouts * stride {
        if t > 0 && t % hold == 0 {
            light = levels(t);
        }
        burst *= 0.9;
        if p.burst.0 > 0.0 && streams.bursts.random::<f64>() < p.burst.0 {
            burst = p.burst.1;
        }
        let frame = readout(sensor, &light, t, readouts, burst, &mut pixels, &mut streams);
        t += 1;
        if p.dropped > 0.0 && streams.frames.random::<f64>() < p.dropped {
            continue;
        }
        let again = p.repeated > 0.0 && t > 1 && streams.frames.random::<f64>() < p.repeated;
        let shown = if again { before.clone() } else { frame };
        pack(&shown, width, height, &mut out);
        before = shown;
    }
    out
}

/// Moves the share `share` of every pixel's light to its four neighbors. Light that would leave the sensor stays in the
/// pixel.
fn with_crosstalk(light: &[f64], width: usize, share: f64) -> Vec<f64> {
    if share == 0.0 {
        return light.to_vec();
    }
    let height = light.len() / width;
    let of_pixel = |i: usize| {
        let mut sum = light[i];
        neighbors(i, width, height, |j| sum += 0.25 * share * (light[j] - light[i]));
        sum
    };
    (0..light.len()).map(of_pixel).collect()
}

fn neighbors(i: usize, width: usize, height: usize, mut each: impl FnMut(usize)) {
    let (row, col) = (i / width, i % width);
    if row > 0 {
        each(i - width);
    }
    if row + 1 < height {
        each(i + width);
    }
    if col > 0 {
        each(i - 1);
    }
    if col + 1 < width {
        each(i + 1);
    }
}

/// Appends the bits of a frame in file order, with the bottom row first.
fn pack(frame: &[bool], width: usize, height: usize, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + frame.len().div_ceil(8), 0);
    for (i, _) in frame.iter().enumerate().filter(|(_, fired)| **fired) {
        let at = (height - 1 - i / width) * width + i % width;
        out[start + at / 8] |= 1 << (at % 8);
    }
}

fn readout(
    sensor: &Sensor,
    light: &[f64],
    t: usize,
    readouts: usize,
    burst: f64,
    pixels: &mut Pixels,
    streams: &mut Streams,
) -> Vec<bool> {
    let p = &sensor.physics;
    let n = light.len();
    let seconds = t as f64 / READOUT_HZ;
    let flicker = 1.0 + p.flicker.0 * (std::f64::consts::TAU * p.flicker.1 * seconds + p.flicker.2).sin();
    let drift = 1.0 + p.drift * t as f64 / readouts as f64;
    let lamp = flicker * drift;
    let active = pixels.fired.iter().filter(|f| **f).count() as f64 / n as f64;
    let wake = 1.0 + p.wake.0 * (-(t as f64) / p.wake.1).exp();
    let parity = if t.is_multiple_of(2) { p.parity } else { -p.parity };
    let common = (1.0 - p.droop * active) * (1.0 + parity) * (1.0 - burst) * wake;
    let rows: Vec<f64> = (0..sensor.height)
        .map(|_| if p.row_noise > 0.0 { p.row_noise * normal(&mut streams.rows) } else { 0.0 })
        .collect();
    let mut kick = vec![0.0; if p.coupling == 0.0 { 0 } else { n }];
    for i in 0..kick.len() {
        neighbors(i, sensor.width, sensor.height, |j| {
            kick[i] += if pixels.fired[j] { p.coupling * sensor.threshold[i] } else { 0.0 };
        });
    }
    pixels.echo.copy_from_slice(&pixels.fired);
    let mut frame = vec![false; n];
    for i in 0..n {
        let mean = arriving_electrons(sensor, light[i] * lamp, i, pixels);
        let lit = electrons(&mut streams.light, mean);
        let (dark, dark_mean) = dark_electrons(sensor, i, pixels, streams);
        let mut gathered = lit + dark;
        if p.settle > 0.0 {
            // The reservoir releases the same share of its content at every readout.
            pixels.pending_electrons[i] += gathered - mean - dark_mean;
            let stays = (-1.0 / p.settle).exp() * pixels.pending_electrons[i];
            gathered = mean + dark_mean + pixels.pending_electrons[i] - stays;
            pixels.pending_electrons[i] = stays;
        }
        if pixels.fired[i] {
            gathered *= 1.0 - p.dead_time;
        }
        if let Some(charge) = kick.get(i) {
            gathered += charge;
        }
        let base_threshold = sensor.threshold[i];
        if p.leak > 0.0 {
            gathered -= p.leak * (base_threshold - pixels.missing_electrons[i]).max(0.0);
        }
        pixels.missing_electrons[i] =
            (pixels.missing_electrons[i] - gathered).max(base_threshold * (1.0 - p.clamp));
        frame[i] = fires(sensor, i, common * (1.0 + rows[i / sensor.width]), pixels, streams);
    }
    reported_bits(p, sensor, frame, pixels, streams)
}

/// Returns the mean number of electrons that the light causes in this readout.
fn arriving_electrons(sensor: &Sensor, light: f64, i: usize, pixels: &mut Pixels) -> f64 {
    let p = &sensor.physics;
    let bent = light * (1.0 + p.quadratic * light);
    let now = p.electrons * sensor.gain[i] * bent;
    if p.lag.0 == 0.0 {
        return now;
    }
    // A store contains the delayed part and releases it exponentially.
    let late = pixels.stored_light[i] / p.lag.1;
    pixels.stored_light[i] += p.lag.0 * now - late;
    (1.0 - p.lag.0) * now + late
}

/// Returns the number of electrons of the dark current in this readout, and the mean of this number.
fn dark_electrons(sensor: &Sensor, i: usize, pixels: &mut Pixels, streams: &mut Streams) -> (f64, f64) {
    let p = &sensor.physics;
    let mut mean = sensor.dark[i];
    if sensor.switching[i] {
        if streams.switching.random::<f64>() < p.telegraph.2 {
            pixels.is_switched[i] = !pixels.is_switched[i];
        }
        mean *= if pixels.is_switched[i] { 1.0 + p.telegraph.0 } else { 1.0 - p.telegraph.0 };
    }
    if p.dark_memory.0 > 0.0 {
        let spike = if pixels.fired[i] { 1.0 } else { 0.0 };
        pixels.remembered_light[i] += (spike - pixels.remembered_light[i]) / p.dark_memory.1;
        mean *= 1.0 + p.dark_memory.0 * pixels.remembered_light[i];
    }
    if p.dark_shot == 0.0 {
        return (mean, mean);
    }
    (mean + p.dark_shot.sqrt() * (electrons(&mut streams.dark, mean) - mean), mean)
}

/// Returns whether the pixel fires. Noise is drawn only if it can change the result.
fn fires(sensor: &Sensor, i: usize, common: f64, pixels: &mut Pixels, streams: &mut Streams) -> bool {
    let p = &sensor.physics;
    let base_threshold = sensor.threshold[i];
    if p.slow.0 > 0.0 {
        let retention = (-1.0 / p.slow.1).exp();
        pixels.threshold_wander[i] = retention * pixels.threshold_wander[i]
            + p.slow.0 * (1.0 - retention * retention).sqrt() * normal(&mut streams.slow);
    }
    if p.adaptation.0 > 0.0 {
        pixels.threshold_rise[i] *= p.adaptation.1;
    }
    let offset =
        base_threshold * (common * (1.0 + pixels.threshold_wander[i] + pixels.threshold_rise[i]) - 1.0);
    let sigma = p.electrons * p.threshold_noise * sensor.noise[i];
    let silent = p.electrons * p.comparator;
    let (widest, middle, rows) = p.jitter;
    let away = ((i / sensor.width) as f64 - middle) / rows;
    let width = base_threshold * widest * (-away * away / 2.0).exp();
    let reach = 6.5 * sigma.hypot(silent) + width;
    let gap = pixels.missing_electrons[i] + offset;
    pixels.fired[i] = false;
    if gap > reach {
        return false;
    }
    let noise = sigma * normal(&mut streams.threshold);
    let unseen = if silent > 0.0 { silent * normal(&mut streams.comparator) } else { 0.0 };
    let short = gap + noise + unseen;
    let mut gap = gap;
    if short.abs() < width {
        // The charge is set to the threshold, and a random bit decides whether the pixel fires.
        pixels.missing_electrons[i] -= short;
        gap -= short;
        if streams.coins.random::<bool>() {
            return false;
        }
    } else if short > 0.0 {
        return false;
    }
    pixels.fired[i] = true;
    let remainder = -(gap + noise) * (1.0 - p.lost_remainder);
    pixels.missing_electrons[i] = base_threshold - remainder;
    pixels.threshold_rise[i] += p.adaptation.0;
    true
}

/// Returns the bits that the sensor transmits.
fn reported_bits(
    p: &Physics,
    sensor: &Sensor,
    mut frame: Vec<bool>,
    pixels: &Pixels,
    streams: &mut Streams,
) -> Vec<bool> {
    let flips = p.missed > 0.0 || p.spurious > 0.0;
    if let Some((row, share)) = p.stuck_row {
        for col in 0..sensor.width {
            let i = row % sensor.height * sensor.width + col;
            if streams.flips.random::<f64>() < share {
                frame[i] = false;
            }
        }
    }
    if p.after_pulse > 0.0 {
        for i in 0..frame.len() {
            frame[i] |= pixels.echo[i] && streams.flips.random::<f64>() < p.after_pulse;
        }
    }
    if flips {
        for fired in &mut frame {
            let u = streams.flips.random::<f64>();
            *fired = if *fired { u >= p.missed } else { u < p.spurious };
        }
    }
    frame
}
