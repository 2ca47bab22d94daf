//! Planning recordings, and writing synthetic ones.

use std::path::{Path, PathBuf};

use super::recordings::{Light, Pattern, Recording, RecordingSet};
use crate::formulas::fit::Weighting;
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane::unstable::plan::Plan;
use spikelane::unstable::threads;
use spikelane_io::formats::{Layout, StreamWriter};
use spikelane_io::simulate::{CameraFacts, FrameRef, LightFacts, Sidecar, Simulator, StreamFacts, Written};

/// Frames simulated at a time.
const BATCH: usize = 496;

/// Recordings to make: what stands in front of the camera, and for how long.
#[derive(Clone, Debug, PartialEq)]
pub struct Protocol {
    /// File stem and light of each recording, in full scales.
    pub recordings: Vec<(String, Light)>,
    /// Readouts of each.
    pub readouts: u32,
}

impl Protocol {
    /// Dark, flats, steps and a checkerboard: what identifies most. Flats at 0.03, 0.1, 0.3,
    /// 0.6 and 0.9 of saturation, and near rates of 1/2, 2/3 and 3/4, where an incomplete reset shows.
    #[must_use]
    pub fn recommended(readouts: u32) -> Self {
        let flat = |l: f64| (format!("flat_{:04}", (l * 1e4).round() as u32), Light::Level(l));
        let mut recordings = vec![("dark".to_owned(), Light::Level(0.0))];
        recordings.extend([0.03, 0.1, 0.3, 0.49, 0.51, 0.6, 0.66, 0.74, 0.9].map(flat));
        let square = Pattern::Square { high: 0.8, low: 0.03, half_period: 500 };
        let board = Pattern::Checkerboard { high: 0.8, low: 0.03, cell: 8 };
        recordings.push(("steps".to_owned(), Light::Scene(square)));
        recordings.push(("checker".to_owned(), Light::Scene(board)));
        Self { recordings, readouts }
    }

    /// The paper's 25 grey levels, 0, 10, ... 240 of 255.
    #[must_use]
    pub fn grey_levels(readouts: u32) -> Self {
        let grey = |k: u32| (format!("grey_{:03}", 10 * k), Light::Level(f64::from(10 * k) / 255.0));
        Self { recordings: (0..25).map(grey).collect(), readouts }
    }

    /// Bytes that the recordings of `camera` will take.
    #[must_use]
    pub fn bytes(&self, camera: &Camera) -> u64 {
        let frame = camera.sensor.geometry.frame_bytes() as u64;
        frame * u64::from(self.readouts) * self.recordings.len() as u64
    }

    /// Simulates every recording of `camera` into `folder`, as `.dat` with a sidecar each, and `recordings.toml`; returns that
    /// file's path. That file gives light as a set does, in the light of one spike per readout. Each recording has a sequence number of its own, so that their noise differs.
    ///
    /// # Errors
    /// When the camera cannot be planned, a file exists and `force` is not set, or the disk is full.
    pub fn record(
        &self,
        camera: &Camera,
        seeds: Seeds,
        folder: &Path,
        force: bool,
        progress: super::observe::Progress<'_>,
    ) -> Result<PathBuf> {
        if self.readouts == 0 || self.recordings.is_empty() {
            return Err(Error::new(Kind::Usage, "recordings")
                .found("none")
                .expected("at least one readout and level"));
        }
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
        let total = self.recordings.len() as f64;
        for (i, (stem, light)) in self.recordings.iter().enumerate() {
            let seeds = Seeds { sequence: seeds.sequence + i as u64, ..seeds };
            let mut tell = |share: f64| progress(stem, (i as f64 + share) / total);
            self.one(camera, seeds, *light, &folder.join(format!("{stem}.dat")), force, &mut tell)?;
        }
        let geometry = camera.sensor.geometry;
        let recording = |(stem, light): &(String, Light)| Recording {
            file: format!("{stem}.dat"),
            light: light.scaled(camera.sensor.thresholds_at_full_scale),
            light_uncertainty: None,
            layout: None,
        };
        let set = RecordingSet {
            width: geometry.width() as u32,
            height: geometry.height() as u32,
            readout_hz: camera.sensor.readout_hz,
            layout: None,
            light_uncertainty: None,
            simulated: Some(camera.name.clone()),
            recordings: self.recordings.iter().map(recording).collect(),
            rate_maps: Vec::new(),
            folder: folder.to_path_buf(),
        };
        let path = folder.join("recordings.toml");
        spikelane_io::storage::write_small(&path, set.to_toml()?.as_bytes(), force)?;
        Ok(path)
    }

    fn one(
        &self,
        camera: &Camera,
        seeds: Seeds,
        light: Light,
        path: &Path,
        force: bool,
        tell: &mut dyn FnMut(f64),
    ) -> Result<()> {
        let geometry = camera.sensor.geometry;
        let frame = |readout: u64| {
            let at =
                |p: usize| light.at(p / geometry.width(), p % geometry.width(), readout).map(|l| l as f32);
            (0..geometry.pixels()).map(at).collect::<Option<Vec<f32>>>()
        };
        let greatest = match light {
            Light::Level(level) => level,
            Light::Scene(Pattern::Square { high, low, .. } | Pattern::Checkerboard { high, low, .. }) => {
                high.max(low)
            }
            Light::Scene(Pattern::StaticUnknown {}) => {
                return Err(Error::new(Kind::Usage, path.display())
                    .found("an unknown scene")
                    .expected("light that can be simulated"));
            }
        };
        let plan = Plan::with_light(camera, seeds, greatest.max(1.0))?;
        let mut simulator = Simulator::of_plan(plan).with_threads(threads::count())?;
        let mut writer = StreamWriter::create(path, Layout::Dat, geometry, u64::from(self.readouts), force)?;
        let hold = match light {
            Light::Scene(Pattern::Square { half_period, .. }) => u64::from(half_period),
            _ => u64::MAX,
        };
        let mut buffer = inputs::zeroed("simulated readouts", BATCH * geometry.frame_bytes())?;
        let mut fired = 0;
        let (mut at, end) = (0, u64::from(self.readouts));
        let mut samples = frame(0).unwrap_or_default();
        while at < end {
            if at > 0 && at % hold == 0 {
                samples = frame(at).unwrap_or_default();
            }
            let now = (BATCH as u64).min(end - at).min(hold - at % hold) as usize;
            let out = &mut buffer[..now * geometry.frame_bytes()];
            simulator.push(FrameRef::f32(&samples, geometry), out)?;
            fired += spikes::count(out);
            writer.write_frames(at, out)?;
            at += now as u64;
            tell(at as f64 / end as f64);
        }
        if force {
            // What speaks of the old stream goes before the new one gets its name.
            spikelane_io::storage::remove_old(&path.with_extension("json"))?;
        }
        let done = writer.finish()?;
        let written = Written { spikes: fired, path: done.path, bytes: done.bytes, digest: done.digest };
        let facts = StreamFacts::new(&written, geometry, end);
        let sidecar = Sidecar {
            readout_hz: Some(camera.sensor.readout_hz),
            seeds: Some(Sidecar::seed_facts(seeds)),
            camera: Some(CameraFacts::new(camera)?),
            light: Some(LightFacts {
                source: format!("{light:?}, in full scales"),
                transfer: "linear".to_owned(),
                insertion: "hold".to_owned(),
                exposure_electrons: camera.operating(0.0).electrons * camera.sensor.thresholds_at_full_scale,
                greatest_light: greatest.max(1.0),
                ..LightFacts::default()
            }),
            ..Sidecar::new(geometry, Layout::Dat, end, facts)
        };
        sidecar.write(&path.with_extension("json"), force)
    }
}

/// Standard errors that recordings will give.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Precision {
    /// Readouts a level.
    pub readouts: u32,
    /// Relative standard error of a pixel's gain `a`.
    pub gain: f64,
    /// Relative standard error of a pixel's dark rate `d`; infinite of a camera without dark current.
    pub dark: f64,
}

/// What a mean pixel's `a` and `d` will be known to, after `readouts` at each uniform level of the
/// protocol: the Fisher information of its rates by time under the camera's own noise.
///
/// `None` when the levels do not tell `a` from `d`.
#[must_use]
pub fn predict(protocol: &Protocol, camera: &Camera, readouts: u32) -> Option<Precision> {
    let zero = camera.operating(0.0);
    let d = zero.from_dark;
    let at = camera.operating(d + 1.0);
    let a = 1.0 / at.light;
    let mut points = Vec::new();
    for light in protocol.recordings.iter().filter_map(|(_, l)| l.level()) {
        let x = a * light + d;
        let here = camera.operating(x);
        let moment = |e: &spikelane::effects::Effect| e.moments(&here).map_or(0.0, |m| m.phase_variance);
        let mut s: f64 = camera.effects().iter().map(moment).sum();
        if let Some(noise) = camera.effect("thermal_noise").filter(|e| e.moments(&here).is_none()) {
            let sigma = noise.get("sigma").unwrap_or(0.0) / here.swing_v;
            s += sigma * sigma * crate::formulas::selection::nu(x / sigma.max(1e-12));
        }
        let intervals = x * f64::from(readouts);
        if x > 0.0 && x < super::check::SATURATED && intervals >= 2.0 {
            let weights = Weighting { threshold: s, light: 0.0, dark: 0.0 };
            points.push((light, x, weights.variance(x, intervals, 0.0)));
        }
    }
    let fit = crate::formulas::fit::fit_line(&points)?;
    Some(Precision { readouts, gain: fit.var_a.sqrt() / a, dark: fit.var_d.sqrt() / d })
}
