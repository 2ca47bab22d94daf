//! Recordings of which only the rates are known: a static scene, or maps of rates.

use super::lines::Lines;
use super::maps;
use super::scan::{PixelScan, Scan, scan};
use super::setup::{Sample, Scene, Setup};
use super::vector::Vector;
use crate::calibrate::{RecordingSet, observe};
use crate::draws::Seeds;
use crate::effects::{Camera, Maps};
use crate::error::{Error, Kind, Result};
use crate::formats::Reader;
use crate::measure::select_smooth;
use crate::plan::Plan;
use crate::simulate::{FrameRef, Simulator};
use crate::spikes::Packed;

/// Readouts before the recording, in which models that start in step lose it.
const LEAD: usize = 200;

/// Fewest even, static pixels.
const FEWEST: usize = 500;

/// A static scene as its own rates show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Still {
    /// Rate of every pixel, in spikes per readout.
    rates: Vec<f64>,
    /// Pixels in even surroundings whose halves agree.
    even: Vec<usize>,
    /// Mean rate of those.
    pub(super) mean: f64,
    /// Highest rate.
    pub(super) brightest: f64,
}

impl Still {
    /// # Errors
    /// When the recording cannot be read or has too few even, static pixels.
    pub(super) fn of(reader: &Reader) -> Result<Self> {
        let geometry = reader.geometry();
        let mut bytes = vec![0; reader.readouts() * geometry.frame_bytes()];
        reader.read_frames(0, &mut bytes)?;
        let scan = scan(Packed::new(geometry, &bytes)?, false, false);
        let rates: Vec<f64> = scan.pixels.iter().map(|p| p.rate).collect();
        let half = |p: &PixelScan, late: bool| -> u32 {
            let (a, b) = p.blocks.split_at(p.blocks.len() / 2);
            if late { b.iter().sum() } else { a.iter().sum() }
        };
        let steady = |p: &usize| half(&scan.pixels[*p], false).abs_diff(half(&scan.pixels[*p], true)) <= 2;
        // Within 6 % over 11x11 pixels: less than any edge, more than the pixels' own spread.
        let even = select_smooth(&rates, geometry.width(), &(0.05..0.45), 5, 0.06);
        let even: Vec<usize> = even.into_iter().filter(steady).collect();
        if even.len() < FEWEST {
            return Err(Error::new(Kind::Input, reader.name())
                .found(format_args!("{} even, static pixels", even.len()))
                .expected(format_args!("{FEWEST} or more"))
                .remedy("record a scene with an even surface, without motion"));
        }
        let mean = even.iter().map(|p| rates[*p]).sum::<f64>() / even.len() as f64;
        let brightest = rates.iter().copied().fold(0.0, f64::max);
        Ok(Self { rates, even, mean, brightest })
    }

    /// Leaves only the even pixels in a scan.
    pub(super) fn keep(&self, scan: &mut Scan) {
        scan.pixels = self.even.iter().map(|p| scan.pixels[*p]).collect();
    }

    /// The model's temporal noise at the measured rates, which hold the camera's own fixed pattern.
    pub(super) fn simulate(&self, camera: Camera, seeds: Seeds, scene: &Scene) -> Result<Scan> {
        let geometry = camera.sensor.geometry;
        let flat = without_pattern(camera)?;
        let light = |rate: &f64| {
            let light = flat.operating(*rate).light;
            if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
        };
        let samples: Vec<f32> = self.rates.iter().map(light).collect();
        let mut simulator = Simulator::of_plan(Plan::with_light(&flat, seeds, 1.0)?);
        let mut bits = vec![0; LEAD * geometry.frame_bytes()];
        simulator.push(FrameRef::f32(&samples, geometry), &mut bits)?;
        bits.resize(scene.readouts * geometry.frame_bytes(), 0);
        simulator.push(FrameRef::f32(&samples, geometry), &mut bits)?;
        let mut found = scan(Packed::new(geometry, &bits)?, scene.dim(), false);
        self.keep(&mut found);
        Ok(found)
    }
}

fn without_pattern(camera: Camera) -> Result<Camera> {
    let mut flat = camera;
    flat.maps = Maps::default();
    let spreads = [
        "capacitor_mismatch",
        "prnu",
        "vignetting",
        "dark_tail",
        "hot_pixels",
        "dead_pixels",
        "column_pattern",
        "row_pattern",
        "smooth_prnu",
        "edge_columns",
        "gain_dark_correlation",
    ];
    for spread in spreads {
        flat = flat.without(spread);
    }
    for name in ["bias_voltage", "dark_current"] {
        if let Some(effect) = flat.effect(name).cloned() {
            flat = flat.with(effect.with("sigma", 0.0)?);
        }
    }
    Ok(flat)
}

/// Statistics of measured rate maps: the darkest and the brightest of them.
pub(super) fn measured_maps(setup: &Setup, set: &RecordingSet) -> Result<Vec<f64>> {
    let observed = observe(set, &mut |_, _| {})?;
    let (Some(dark), Some(bright)) = (observed.levels.first(), observed.levels.last()) else {
        return Err(Error::new(Kind::Input, "rate maps")
            .found("none")
            .expected("one in the dark and one lit"));
    };
    let step = bright.light - dark.light;
    let gain = bright.rate.iter().zip(&dark.rate).map(|(b, d)| (b - d) / step).collect();
    let lines = Lines { gain, dark: dark.rate.clone(), residuals: Vec::new() };
    Ok(of_lines(&lines, setup).values)
}

/// Statistics of the maps that a camera's fixed pattern gives.
pub(super) fn simulated_maps(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vector> {
    let mut camera = sample.camera.clone();
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let model = camera.model(Seeds { camera: seed, shot: 0, sequence: 0 })?;
    let laws = (0..setup.geometry.pixels()).map(|p| model.law(p));
    let (gain, dark) = laws.map(|l| (l.gain / l.threshold, l.dark / l.threshold)).unzip();
    Ok(of_lines(&Lines { gain, dark, residuals: Vec::new() }, setup))
}

fn of_lines(lines: &Lines, setup: &Setup) -> Vector {
    let mut v = Vector { statistics: Vec::new(), values: Vec::new() };
    maps::of_lines(&mut v, lines, setup.geometry.width());
    v
}
