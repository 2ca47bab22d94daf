//! A random laboratory. It has a camera with known parameters, lamps whose light differs from the stated light, and one
//! fault.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use spikelane::spikes::Geometry;
use spikelane_calibrate::{LightLevel, Observations};

use super::calibrate_support::{LightCourse, Noise, Pixel, Random, level_from_times, pixels, traces};

/// The faults. Laboratory `i` has the fault `i` modulo the number of faults.
pub(crate) const FAULTS: [&str; 20] = [
    "nothing; lamps exact",
    "lamps within 0.1 %",
    "lamps within 1 %, as stated",
    "a third of the lamps off by up to 10 %",
    "one lamp mislabeled by 5 to 10 %",
    "no dark recording",
    "hot and dead pixels",
    "a stuck column",
    "pixels that blink from level to level",
    "a saturated level",
    "unequal lengths",
    "dark and one or two levels only",
    "dark and 29 levels",
    "lamps that drift by 1 % within a recording",
    "a response that bends alike in all pixels",
    "false spikes, 5e-6 to 5e-5 per readout",
    "light that falls off by 20 to 60 %",
    "a mosaic of two to four gains",
    "pixels that blink within a recording",
    "noise drawn at resets",
];

/// Width of the sensors in pixels.
const WIDTH: u32 = 24;
/// Height of the sensors in pixels.
const HEIGHT: u32 = 16;

/// One recording: its true light, its stated light, its number of readouts and its pixels.
pub(crate) struct Shot {
    pub light: f64,
    pub stated: f64,
    pub readouts: u32,
    pixels: Vec<Pixel>,
    light_course: LightCourse<'static>,
    seed: u64,
}

pub(crate) struct Laboratory {
    pub fault: &'static str,
    pub noise: Noise,
    pub truth: Vec<Pixel>,
    /// The recordings in ascending order of stated light.
    pub shots: Vec<Shot>,
}

impl Laboratory {
    /// Creates the laboratory `index`. The index determines the fault and seeds all random numbers.
    pub(crate) fn new(index: u64) -> Self {
        let fault = FAULTS[index as usize % FAULTS.len()];
        let mut random = Random::new(0x1AB0_0000 + index);
        let mut noise = population(&mut random);
        noise.is_redrawn = fault != "noise drawn at resets";
        if fault.starts_with("false spikes") {
            noise.false_spikes = 5e-6 * 10.0_f64.powf(random.uniform());
        }
        let mut truth = pixels(&noise, (WIDTH * HEIGHT) as usize, 7_000 + index);
        add_defects(fault, &mut truth, &mut random);
        let levels = lamp_levels(fault, &mut random);
        let base = 2000 + (2000.0 * random.uniform()) as u32;
        let bend = if fault.starts_with("a response") { 0.01 + 0.03 * random.uniform() } else { 0.0 };
        let mut shots = Vec::new();
        for (k, [light, stated]) in levels.into_iter().enumerate() {
            let longer = if fault == "unequal lengths" { 1 + (4.0 * random.uniform()) as u32 } else { 1 };
            // A dim recording is long enough for 60 spikes of an average pixel, so that slow pixels fire too.
            let readouts = (base * longer).max(if light > 0.0 { (60.0 / light) as u32 } else { 0 });
            let mut shown = truth.clone();
            if fault.starts_with("pixels that blink") {
                for pixel in &mut shown[..20] {
                    pixel.gain *= 0.7 + 0.6 * random.uniform();
                }
            }
            let drifts = fault.starts_with("lamps that drift") && light > 0.0;
            let either_way = |random: &mut Random| if random.uniform() < 0.5 { 0.01 } else { -0.01 };
            let rise = if drifts { either_way(&mut random) } else { 0.0 };
            let lit = LightCourse { light: light * (1.0 - bend * light), rise, sums: None };
            let seed = index * 100 + k as u64;
            shots.push(Shot { light, stated, readouts, pixels: shown, light_course: lit, seed });
        }
        Self { fault, noise, truth, shots }
    }

    /// Returns the pixels without defects.
    pub(crate) fn defect_free_pixels(&self) -> impl Iterator<Item = &Pixel> + Clone {
        let (noise, dead) = (self.noise, |p: &&Pixel| p.gain > 0.0);
        self.truth.iter().filter(dead).filter(move |p| p.dark < noise.dark + 6.0 * noise.dark_sd)
    }

    /// Measures the recordings in memory, without files.
    pub(crate) fn observations(&self) -> Observations {
        let one = |(k, shot): (usize, &Shot)| {
            let times = traces(&self.noise, &shot.pixels, shot.light_course, shot.readouts, shot.seed);
            // Intervals are measured only in dim light.
            let mut level = level_from_times(
                &times,
                shot.light_course.light,
                shot.readouts,
                shot.light_course.light < 0.12,
            );
            (level.light, level.name) = (shot.stated, file(k));
            level
        };
        let levels: Vec<LightLevel> = self.shots.iter().enumerate().map(one).collect();
        Observations {
            geometry: Geometry::new(WIDTH, HEIGHT).unwrap(),
            readout_hz: 20_000.0,
            levels,
            other_recordings: Vec::new(),
            filters: spikelane_calibrate::ColorFilters::Unknown,
            camera: None,
        }
    }

    /// Writes the recordings as files with the top row first. Returns the path of their recording set. The number of
    /// pixels is a multiple of 8, so each readout has a whole number of bytes.
    pub(crate) fn write(&self, folder: &Path) -> PathBuf {
        let pixels = (WIDTH * HEIGHT) as usize;
        let mut set =
            format!("width = {WIDTH}\nheight = {HEIGHT}\nreadout_hz = 20000.0\nlayout = \"dat-top\"\n");
        for (k, shot) in self.shots.iter().enumerate() {
            let mut bytes = vec![0_u8; pixels / 8 * shot.readouts as usize];
            let times = traces(&self.noise, &shot.pixels, shot.light_course, shot.readouts, shot.seed);
            for (p, times) in times.iter().enumerate() {
                for t in times {
                    bytes[pixels / 8 * *t as usize + p / 8] |= 1 << (p % 8);
                }
            }
            std::fs::write(folder.join(file(k)), bytes).unwrap();
            write!(set, "[[recording]]\nfile = \"{}\"\nlight = {:?}\n", file(k), shot.stated).unwrap();
        }
        let path = folder.join("set.toml");
        std::fs::write(&path, set).unwrap();
        path
    }
}

fn file(k: usize) -> String {
    format!("level_{k}.dat")
}

/// Draws the spreads and the noise of a camera.
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
        dead_time_fraction: 0.002,
        is_redrawn: true,
        dark_electrons: f64::INFINITY,
        false_spikes: 0.0,
    }
}

/// Adds the pixel defects that belong to `fault`.
fn add_defects(fault: &str, truth: &mut [Pixel], random: &mut Random) {
    let dead = |p: &mut Pixel| (p.gain, p.dark) = (0.0, 0.0);
    match fault {
        "hot and dead pixels" => {
            truth[..15].iter_mut().for_each(|p| p.dark *= 5.0 + 20.0 * random.uniform());
            truth[15..20].iter_mut().for_each(dead);
        }
        "a stuck column" => truth.iter_mut().skip(3).step_by(WIDTH as usize).for_each(dead),
        "light that falls off by 20 to 60 %" => {
            let falloff = 0.2 + 0.4 * random.uniform();
            let at = |p: usize, count: u32| (2 * p as u32 + 1) as f64 / f64::from(count) - 1.0;
            let square = |p: usize| {
                let (row, column) = (p / WIDTH as usize, p % WIDTH as usize);
                0.5 * (at(row, HEIGHT).powi(2) + at(column, WIDTH).powi(2))
            };
            set_light(truth, |p| 1.0 - falloff * square(p));
        }
        "a mosaic of two to four gains" => {
            let gains: [f64; 4] = std::array::from_fn(|_| 0.4 + 0.6 * random.uniform());
            let gains = if random.uniform() < 0.5 { gains } else { [gains[0], gains[0], gains[1], gains[1]] };
            set_light(truth, |p| gains[2 * (p / WIDTH as usize % 2) + p % WIDTH as usize % 2]);
        }
        "pixels that blink within a recording" => {
            truth[..20].iter_mut().for_each(|p| p.blink = 0.02 + 0.5 * random.uniform());
        }
        _ => {}
    }
}

/// Sets the relative light on each pixel. The mean over the pixels is 1.
fn set_light(truth: &mut [Pixel], light: impl Fn(usize) -> f64) {
    let mean = (0..truth.len()).map(&light).sum::<f64>() / truth.len() as f64;
    truth.iter_mut().enumerate().for_each(|(p, pixel)| pixel.light = light(p) / mean);
}

/// Returns the number of lit levels, 2 to 29. Its logarithm is uniformly distributed, so 2 to 4 levels are as likely as 8
/// to 16 levels.
fn lit_levels(fault: &str, random: &mut Random) -> usize {
    let drawn = (2.0 * 15.0_f64.powf(random.uniform())) as usize;
    match fault {
        "dark and one or two levels only" => 1 + (2.0 * random.uniform()) as usize,
        "dark and 29 levels" => 29,
        // With two lamps, it is impossible to decide which lamp is wrong.
        _ if fault.starts_with("a third") || fault.starts_with("one lamp") => drawn.max(3),
        _ => drawn,
    }
}

/// Returns the true light and the stated light of each level.
fn lamp_levels(fault: &str, random: &mut Random) -> Vec<[f64; 2]> {
    let lit = lit_levels(fault, random);
    // The range is divided into equal parts, and each part contains one level. All levels therefore differ.
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
    let min_error = if fault.starts_with("one lamp") { 0.05 } else { 0.0 };
    for _ in 0..off {
        let k = ((random.uniform() * lit as f64) as usize).min(lit - 1);
        let by = min_error + (0.1 - min_error) * random.uniform();
        levels[k][0] = levels[k][1] * (1.0 + if random.uniform() < 0.5 { by } else { -by });
    }
    if fault != "no dark recording" {
        levels.insert(0, [0.0, 0.0]);
    }
    levels
}
