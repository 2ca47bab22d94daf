//! Plans of recordings, and simulation of the planned recordings.

use spikelane::SimulatorOptions;
use std::path::{Path, PathBuf};

use super::recording_set::{Recording, RecordingSet, Stimulus, StimulusPattern};
use crate::formulas::fit::RateWeighting;
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Channel;
use spikelane::simulate::ExposureFault;
use spikelane::unstable::draws::hash::mix64;
use spikelane::unstable::draws::pattern_rng::PatternRng;
use spikelane::unstable::draws::{RandomStream, Seeds};
use spikelane::unstable::inputs;
use spikelane::unstable::plan::Plan;
use spikelane::unstable::threads;
use spikelane_io::formats::{Layout, StreamWriter};
use spikelane_io::simulate::{CameraFacts, LightFacts, MosaicFacts, Sidecar, StreamFacts};

/// Number of readouts that one call of the simulator produces.
pub(crate) const BATCH_READOUTS: usize = 496;

/// A plan of recordings: the light of each recording, and the common length.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Sensor};
/// use spikelane_calibrate::Protocol;
/// let plan = Protocol::gray_levels(1000);
/// assert_eq!(plan.recordings.len(), 25);
/// // 25 recordings of 1,000 readouts of 12,500 bytes.
/// let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0)?);
/// assert_eq!(plan.recording_bytes(&camera), 25 * 1000 * 12_500);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Protocol {
    /// File stem and light of each recording. Light 1 is the full scale of the camera.
    pub recordings: Vec<(String, Stimulus)>,
    /// Number of readouts of each recording.
    pub readouts: u32,
    /// File stems of recordings with the names of the sources that are on. Other recordings have a lamp of their own.
    pub sources: Vec<(String, Vec<String>)>,
    /// Relative standard deviation of the light of every source and lamp of simulated recordings. The recording set states
    /// the planned light and this uncertainty. If 0, the light is exact.
    pub lamp_error: f64,
}

/// The recordings that [`Protocol::record`] wrote.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedSet {
    /// Path of the recording set.
    pub path: PathBuf,
    /// File stem and fault of the recordings whose pixels are mostly saturated.
    pub exposure_faults: Vec<(String, ExposureFault)>,
}

/// Light of the two sources of each pair of [`Protocol::additive`]. The bright sum is below saturation with lamps that are
/// off by 5 %. The light of the first three pairs is low enough to show the noise of intervals.
const SOURCE_PAIRS: [[f64; 2]; 4] = [[0.028, 0.022], [0.11, 0.08], [0.27, 0.21], [0.46, 0.38]];

impl Protocol {
    /// Returns the recommended plan: dark, flats, steps and a checkerboard. Together these identify most effects.
    ///
    /// Five flats are at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation. Four more flats are near 1/2, 2/3 and 3/4 spikes per
    /// readout, because an incomplete reset is visible at these rates.
    #[must_use]
    pub fn recommended(readouts: u32) -> Self {
        let flat = |l: f64| (format!("flat_{:04}", (l * 1e4).round() as u32), Stimulus::Level(l));
        let mut recordings = vec![("dark".to_owned(), Stimulus::Level(0.0))];
        recordings.extend([0.03, 0.1, 0.3, 0.49, 0.51, 0.6, 0.66, 0.74, 0.9].map(flat));
        let square = StimulusPattern::Square { high: 0.8, low: 0.03, half_period: 500 };
        let board = StimulusPattern::Checkerboard { high: 0.8, low: 0.03, cell: 8 };
        recordings.push(("steps".to_owned(), Stimulus::Scene(square)));
        recordings.push(("checker".to_owned(), Stimulus::Scene(board)));
        Self { recordings, readouts, sources: Vec::new(), lamp_error: 0.0 }
    }

    /// Returns a plan with the 25 gray levels of the SCSim paper: 0, 10, ..., 240 on a scale of 0 to 255.
    #[must_use]
    pub fn gray_levels(readouts: u32) -> Self {
        let gray = |k: u32| (format!("gray_{:03}", 10 * k), Stimulus::Level(f64::from(10 * k) / 255.0));
        let recordings = (0..25).map(gray).collect();
        Self { recordings, readouts, sources: Vec::new(), lamp_error: 0.0 }
    }

    /// Returns a plan that needs no known light: dark, and four pairs of sources, each source alone and both together.
    ///
    /// The sources may be lamps or apertures. Their light adds up, so the sums show the response of the camera.
    ///
    /// # Examples
    /// ```
    /// use spikelane_calibrate::Protocol;
    /// let plan = Protocol::additive(1000);
    /// assert_eq!(plan.recordings.len(), 13);
    /// assert_eq!(plan.sources[2], ("a1_b1".to_owned(), vec!["a1".to_owned(), "b1".to_owned()]));
    /// ```
    #[must_use]
    pub fn additive(readouts: u32) -> Self {
        let mut recordings = vec![("dark".to_owned(), Stimulus::Level(0.0))];
        let mut sources = Vec::new();
        for ([a, b], pair) in SOURCE_PAIRS.into_iter().zip(1..) {
            let names = [format!("a{pair}"), format!("b{pair}")];
            for (name, light) in names.iter().zip([a, b]) {
                recordings.push((name.clone(), Stimulus::Level(light)));
                sources.push((name.clone(), vec![name.clone()]));
            }
            recordings.push((names.join("_"), Stimulus::Level(a + b)));
            sources.push((names.join("_"), names.to_vec()));
        }
        Self { recordings, readouts, sources, lamp_error: 0.0 }
    }

    /// Returns the sources of the recording `stem`.
    fn sources_of(&self, stem: &str) -> &[String] {
        self.sources.iter().find(|(own, _)| own == stem).map_or(&[], |(_, names)| names)
    }

    /// Returns the light of each recording as it is simulated. `set` states the planned light.
    ///
    /// The deviations are drawn in the order of the recordings, one for each source or lamp. Each choice of seeds has its own
    /// deviations.
    fn simulated_lights(&self, set: &RecordingSet, seeds: Seeds) -> Vec<Stimulus> {
        let seed =
            [seeds.camera, seeds.shot, seeds.sequence].into_iter().fold(0, |all, own| mix64(all ^ own));
        let seeds = Seeds { camera: seed, ..seeds };
        let mut normals = PatternRng::new(seeds, RandomStream::from_name("lamps")).normals();
        let factors: Vec<f64> =
            self.recordings.iter().map(|_| 1.0 + self.lamp_error * normals.next().unwrap_or(0.0)).collect();
        let alone = |name: &str| set.recordings.iter().position(|r| r.sources == [name]);
        let light_of = |((stem, light), own): (&(String, Stimulus), &f64)| match self.sources_of(stem) {
            [] => light.scale(*own),
            names => {
                let sources = names.iter().filter_map(|name| alone(name));
                let light = |k: usize| self.recordings[k].1.level().unwrap_or(0.0) * factors[k];
                Stimulus::Level(sources.map(light).sum())
            }
        };
        self.recordings.iter().zip(&factors).map(light_of).collect()
    }

    /// Returns the total size of the recordings of `camera` in bytes.
    #[must_use]
    pub fn recording_bytes(&self, camera: &Camera) -> u64 {
        let frame = camera.sensor.geometry.frame_bytes() as u64;
        frame * u64::from(self.readouts) * self.recordings.len() as u64
    }

    /// Simulates every recording with `camera` and writes the recordings into `folder`.
    ///
    /// Each recording is a `.dat` stream with a sidecar. The recording set is the file `recordings.toml`. In this file,
    /// light 1 causes one spike per readout. Each recording has its own sequence number, so the noise differs between
    /// recordings.
    ///
    /// # Errors
    /// * If the camera cannot be simulated, or if the plan is empty or contains an unknown scene.
    /// * If a source is in no recording alone, or if `lamp_error` is not a number from 0 to below 1.
    /// * If a file exists and `force` is false, or if a file cannot be written.
    pub fn record(
        &self,
        camera: &Camera,
        seeds: Seeds,
        folder: &Path,
        force: bool,
        progress: super::measure_levels::ProgressCallback<'_>,
    ) -> Result<RecordedSet> {
        if self.readouts == 0 || self.recordings.is_empty() {
            return Err(Error::new(ErrorKind::Usage, "recordings")
                .found("none")
                .expected("at least one readout and level"));
        }
        if !(0.0..1.0).contains(&self.lamp_error) {
            return Err(Error::new(ErrorKind::Usage, "lamp error")
                .found(self.lamp_error)
                .expected("a relative standard deviation from 0 to below 1, such as 0.03"));
        }
        let set = self.recording_set(camera, folder);
        set.check_sources()?;
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
        let total = self.recordings.len() as f64;
        let lights = self.simulated_lights(&set, seeds);
        let mut exposure_faults = Vec::new();
        for (i, ((stem, _), light)) in self.recordings.iter().zip(lights).enumerate() {
            let seeds = Seeds { sequence: seeds.sequence + i as u64, ..seeds };
            let mut report_share = |share: f64| progress(stem, (i as f64 + share) / total);
            let fault = self.record_one_stream(
                camera,
                seeds,
                light,
                &folder.join(format!("{stem}.dat")),
                force,
                &mut report_share,
            )?;
            // Recordings without light have no spikes in many cameras.
            if let Some(fault @ ExposureFault::Saturated { .. }) = fault {
                exposure_faults.push((stem.clone(), fault));
            }
        }
        let path = folder.join("recordings.toml");
        spikelane_io::storage::write_small(&path, set.to_toml()?.as_bytes(), force)?;
        Ok(RecordedSet { path, exposure_faults })
    }

    /// Returns the recording set of this plan. In the set, light 1 causes one spike per readout.
    fn recording_set(&self, camera: &Camera, folder: &Path) -> RecordingSet {
        let geometry = camera.sensor.geometry;
        let recording = |(stem, light): &(String, Stimulus)| Recording {
            file: format!("{stem}.dat"),
            light: light.scale(camera.sensor.thresholds_at_full_scale),
            light_uncertainty: None,
            sources: self.sources_of(stem).to_vec(),
            layout: None,
        };
        RecordingSet {
            width: geometry.width() as u32,
            height: geometry.height() as u32,
            readout_hz: camera.sensor.readout_hz,
            layout: None,
            light_uncertainty: (self.lamp_error > 0.0).then_some(self.lamp_error),
            source_repeatability: None,
            mosaic: None,
            simulated_camera: Some(camera.name.clone()),
            camera: None,
            recordings: self.recordings.iter().map(recording).collect(),
            rate_maps: Vec::new(),
            folder: folder.to_path_buf(),
        }
    }

    fn record_one_stream(
        &self,
        camera: &Camera,
        seeds: Seeds,
        light: Stimulus,
        path: &Path,
        force: bool,
        report_share: &mut dyn FnMut(f64),
    ) -> Result<Option<ExposureFault>> {
        let geometry = camera.sensor.geometry;
        // The lamp is white, so the light of a pixel behind a filter is its light for white.
        let mosaic = camera.window_mosaic();
        let white = |row: usize, col: usize| {
            mosaic.as_ref().map_or(1.0, |mosaic| mosaic.channels()[mosaic.channel_at(row, col)].white())
        };
        let frame = |readout: u64| {
            let at = |p: usize| {
                let (row, col) = (p / geometry.width(), p % geometry.width());
                light.level_at(row, col, readout).map(|l| (l * white(row, col)) as f32)
            };
            (0..geometry.pixels()).map(at).collect::<Option<Vec<f32>>>()
        };
        let max_level = match light {
            Stimulus::Level(level) => level,
            Stimulus::Scene(
                StimulusPattern::Square { high, low, .. } | StimulusPattern::Checkerboard { high, low, .. },
            ) => high.max(low),
            Stimulus::Scene(StimulusPattern::StaticUnknown {}) => {
                return Err(Error::new(ErrorKind::Usage, path.display())
                    .found("an unknown scene")
                    .expected("light that can be simulated"));
            }
        };
        let brightest = mosaic.iter().flat_map(|m| m.channels()).map(Channel::white).fold(1.0, f64::max);
        let max_light = (max_level * brightest).max(1.0);
        let plan = Plan::with_max_light(camera, seeds, max_light)?;
        let mut simulator = SimulatorOptions::new().threads(threads::thread_count()).build_from_plan(plan)?;
        let mut writer = StreamWriter::create(path, Layout::Dat, geometry, u64::from(self.readouts), force)?;
        let hold = match light {
            Stimulus::Scene(StimulusPattern::Square { half_period, .. }) => u64::from(half_period),
            _ => u64::MAX,
        };
        let mut buffer = inputs::zeroed_vec("simulated readouts", BATCH_READOUTS * geometry.frame_bytes())?;
        let (mut at, end) = (0, u64::from(self.readouts));
        let mut samples = frame(0).unwrap_or_default();
        while at < end {
            if at > 0 && at % hold == 0 {
                samples = frame(at).unwrap_or_default();
            }
            let now = (BATCH_READOUTS as u64).min(end - at).min(hold - at % hold) as usize;
            let out = &mut buffer[..now * geometry.frame_bytes()];
            simulator.fill(&samples, out)?;
            writer.write_frames(at, out)?;
            at += now as u64;
            report_share(at as f64 / end as f64);
        }
        if force {
            // The old sidecar must not describe the new stream. It is therefore deleted before the new stream receives its
            // final name.
            spikelane_io::storage::remove_stale(&path.with_extension("json"))?;
        }
        let written = writer.finish()?;
        let facts = StreamFacts::new(&written, geometry, end);
        let sidecar = Sidecar {
            readout_hz: Some(camera.sensor.readout_hz),
            seeds: Some(Sidecar::seed_facts(seeds)),
            camera: Some(CameraFacts::new(camera)?),
            mosaic: mosaic.as_ref().map(MosaicFacts::new),
            light: Some(LightFacts {
                source: format!("{light}, in full scales"),
                transfer: "linear".to_owned(),
                interpolation: "hold".to_owned(),
                exposure_electrons: camera.operating_point(0.0).electrons
                    * camera.sensor.thresholds_at_full_scale,
                max_light,
                ..LightFacts::default()
            }),
            ..Sidecar::new(geometry, Layout::Dat, end, facts)
        };
        sidecar.write(&path.with_extension("json"), force)?;
        Ok(simulator.exposure_fault())
    }
}

/// Predicted standard errors for an average pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Precision {
    /// Number of readouts per level.
    pub readouts: u32,
    /// Relative standard error of the gain `a` of a pixel.
    pub gain_error: f64,
    /// Relative standard error of the dark rate `d` of a pixel. Infinite for a camera without dark current.
    pub dark_rate_error: f64,
}

/// Predicts the standard errors of the gain `a` and the dark rate `d` of an average pixel.
///
/// Each uniform level of the plan is recorded for `readouts` readouts. The errors are computed from the Fisher information
/// of rates from spike times, with the noise of the camera. Returns `None` if the levels cannot separate `a` from `d`.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Sensor, effects};
/// use spikelane_calibrate::{Protocol, predict_precision};
/// let noise = effects::find("shot_noise")?.typical();
/// let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0)?).with_effect(noise);
/// let error = |readouts| {
///     let precision = predict_precision(&Protocol::recommended(readouts), &camera, readouts);
///     precision.expect("the levels separate gain and dark rate").gain_error
/// };
/// // Longer recordings have smaller errors.
/// assert!(error(20_000) < error(2_000));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[must_use]
pub fn predict_precision(protocol: &Protocol, camera: &Camera, readouts: u32) -> Option<Precision> {
    let zero = camera.operating_point(0.0);
    let d = zero.from_dark;
    let at = camera.operating_point(d + 1.0);
    let a = 1.0 / at.light;
    let mut points = Vec::new();
    for light in protocol.recordings.iter().filter_map(|(_, l)| l.level()) {
        let x = a * light + d;
        let here = camera.operating_point(x);
        let moment = |e: &spikelane::effects::Effect| e.moments(&here).map_or(0.0, |m| m.phase_variance);
        let mut s: f64 = camera.effects().iter().map(moment).sum();
        if let Some(noise) = camera.effect("thermal_noise").filter(|e| e.moments(&here).is_none()) {
            let sigma = noise.get("sigma").unwrap_or(0.0) / here.swing_v;
            s += sigma * sigma * crate::formulas::selection::firing_draw_variance(x / sigma.max(1e-12));
        }
        let intervals = x * f64::from(readouts);
        if x > 0.0 && x < super::light_unit::SATURATION_RATE && intervals >= 2.0 {
            let weights = RateWeighting { threshold_variance: s, light_variance: 0.0, dark_variance: 0.0 };
            points.push((light, x, weights.variance(x, intervals, 0.0)));
        }
    }
    let fit = crate::formulas::fit::fit_line(&points)?;
    Some(Precision { readouts, gain_error: fit.var_a.sqrt() / a, dark_rate_error: fit.var_d.sqrt() / d })
}
