//! Recordings of which only the rates are known: a static scene, or maps of rates.

use super::recorded::Scene;
use super::recorded_set::Setup;
use crate::calibrate::{RecordingSet, observe};
use crate::diagnose::recording::pixel::PixelScan;
use crate::diagnose::recording::scan::{Look, Scan, scan};
use crate::diagnose::sensors::simulate::Sample;
use crate::diagnose::statistics::all::Vector;
use crate::diagnose::statistics::maps::{self, Map};
use crate::draws::Seeds;
use crate::effects::{Camera, find};
use crate::error::{Error, Kind, Result};
use crate::formats::Reader;
use crate::measure::select_smooth;
use crate::plan::Plan;
use crate::simulate::{FrameRef, Simulator};
use crate::spikes::Packed;

/// Readouts before the recording, in which models that start in step lose it.
const LEAD: usize = 200;

/// Radius of the neighbourhood whose mean stands for the scene.
const SURFACE: usize = 2;

/// Fewest even, static pixels.
const FEWEST: usize = 500;

/// A static scene as its own rates show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Still {
    /// Rate of every pixel, in spikes per readout.
    rates: Vec<f64>,
    /// Means of the pixels around each: the scene without the pixels' own pattern.
    surface: Vec<f64>,
    /// Pixels in even surroundings whose halves agree.
    even: Vec<usize>,
    /// Mean rate of those.
    pub(in crate::diagnose) mean: f64,
    /// Highest rate.
    pub(in crate::diagnose) brightest: f64,
}

impl Still {
    /// # Errors
    /// When the recording cannot be read or has too few even, static pixels.
    pub(in crate::diagnose) fn of(reader: &Reader) -> Result<Self> {
        let geometry = reader.geometry();
        let mut bytes = vec![0; reader.readouts() * geometry.frame_bytes()];
        reader.read_frames(0, &mut bytes)?;
        let scan = scan(Packed::new(geometry, &bytes)?, Look::default());
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
        let surface = crate::measure::box_means(&rates, geometry.width(), SURFACE);
        Ok(Self { rates, surface, even, mean, brightest })
    }

    /// Even pixels within a range of pixels.
    pub(in crate::diagnose) fn even_in(&self, pixels: std::ops::Range<usize>) -> usize {
        self.even.iter().filter(|p| pixels.contains(p)).count()
    }

    /// Keeps a range of pixels.
    pub(in crate::diagnose) fn cut(&mut self, pixels: std::ops::Range<usize>) {
        self.rates = self.rates[pixels.clone()].to_vec();
        self.surface = self.surface[pixels.clone()].to_vec();
        self.even.retain(|p| pixels.contains(p));
        self.even.iter_mut().for_each(|p| *p -= pixels.start);
        self.mean = self.even.iter().map(|p| self.rates[*p]).sum::<f64>() / self.even.len().max(1) as f64;
        self.brightest = self.rates.iter().copied().fold(0.0, f64::max);
    }

    /// Leaves only the even pixels in a scan.
    pub(in crate::diagnose) fn keep(&self, scan: &mut Scan) {
        let width = scan.geometry.width();
        scan.contrast = self.contrast(scan, width);
        scan.pixels = self.even.iter().map(|p| scan.pixels[*p]).collect();
    }

    /// Robust deviation of a pixel's rate from that of the one to its right, relative: on an even
    /// surface the camera's own pattern.
    fn contrast(&self, scan: &Scan, width: usize) -> f64 {
        let pairs = self.even.windows(2).filter(|w| w[1] == w[0] + 1 && w[1] % width != 0);
        let rate = |p: usize| scan.pixels[p].rate;
        let mut steps: Vec<f64> = pairs.map(|w| (rate(w[1]) - rate(w[0])).abs()).collect();
        if steps.is_empty() { 0.0 } else { 1.4826 * crate::measure::median(&mut steps) / self.mean }
    }

    /// The model in front of the scene's surface: the measured rates without what pixels side by side differ by.
    pub(in crate::diagnose) fn simulate(&self, camera: Camera, seeds: Seeds, scene: &Scene) -> Result<Scan> {
        let geometry = camera.sensor.geometry;
        // Nobody knows where in their cycle the pixels were when the recording began.
        let camera = camera.with(find("start_phase")?.neutral().with("share", 1.0)?);
        let light = |rate: &f64| {
            let light = camera.operating(*rate).light;
            if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
        };
        let samples: Vec<f32> = self.surface.iter().map(light).collect();
        let mut simulator = Simulator::of_plan(Plan::with_light(&camera, seeds, 1.0)?);
        let mut bits = vec![0; LEAD * geometry.frame_bytes()];
        simulator.push(FrameRef::f32(&samples, geometry), &mut bits)?;
        bits.resize(scene.readouts * geometry.frame_bytes(), 0);
        simulator.push(FrameRef::f32(&samples, geometry), &mut bits)?;
        let mut found = scan(Packed::new(geometry, &bits)?, Look { dim: scene.dim(), ..Look::default() });
        self.keep(&mut found);
        Ok(found)
    }
}

/// Statistics of measured rate maps: the darkest and the brightest of them.
pub(in crate::diagnose) fn measured_maps(setup: &Setup, set: &RecordingSet) -> Result<Vec<f64>> {
    let observed = observe(set, &mut |_, _| {})?;
    let (Some(dark), Some(bright)) = (observed.levels.first(), observed.levels.last()) else {
        return Err(Error::new(Kind::Input, "rate maps")
            .found("none")
            .expected("one in the dark and one lit"));
    };
    let step = bright.light - dark.light;
    let gain: Vec<f64> = bright.rate.iter().zip(&dark.rate).map(|(b, d)| (b - d) / step).collect();
    Ok(of_lines(&gain, &dark.rate, setup).values)
}

/// Statistics of the maps that a camera's fixed pattern gives.
pub(in crate::diagnose) fn simulated_maps(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vector> {
    let mut camera = sample.camera.clone();
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let model = camera.model(Seeds { camera: seed, shot: 0, sequence: 0 })?;
    let laws = (0..setup.geometry.pixels()).map(|p| model.law(p));
    let (gain, dark): (Vec<f64>, Vec<f64>) =
        laws.map(|l| (l.gain / l.threshold, l.dark / l.threshold)).unzip();
    Ok(of_lines(&gain, &dark, setup))
}

fn of_lines(gain: &[f64], dark: &[f64], setup: &Setup) -> Vector {
    let mut v = Vector { statistics: Vec::new(), values: Vec::new() };
    maps::of_lines(&mut v, &Map::new(gain), &Map::new(dark), setup.geometry.width());
    v
}
