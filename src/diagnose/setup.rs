//! What a set holds, free of files; reading it, and simulating it.

use std::borrow::Cow;

use rayon::prelude::*;

use super::extent::{Extent, Part, cut};
use super::located::{Located, places};
use super::pinned::{Pinned, put_in, replaced};
use super::recorded::Scene;
use super::scan::{Scan, scan};
use super::still::{self, Still};
use super::vector::{Statistic, Vector, vector};
use crate::calibrate::{Light, Recording, RecordingSet, Scene as Pattern};
use crate::draws::Seeds;
use crate::effects::{Camera, Model};
use crate::error::{Error, Kind, Result};
use crate::pixel::Op;
use crate::plan::Plan;
use crate::simulate::{FrameRef, Simulator};
use crate::spikes::{Geometry, Packed};

/// Fewest readouts of a recording that can be judged.
const FEWEST: usize = 256;

/// Most pixels of a still scene that are simulated: some 20,000 tell temporal noise to a per cent.
pub const LARGEST: usize = 20_000;

/// All recordings of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Width and height.
    pub geometry: Geometry,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The recordings.
    pub scenes: Vec<Scene>,
    /// Whether rate maps stand in place of recordings.
    pub maps: bool,
    /// First row and rows that are looked at, where a still scene is larger than 20,000 pixels.
    pub band: Option<(usize, usize)>,
    /// Fewest and most readouts that are judged of the recordings that have more.
    pub first_readouts: Option<[usize; 2]>,
}

/// A camera and how far each scene's light is off: factors near one.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub camera: Camera,
    pub lamps: Vec<f64>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
}

/// A measured set: its vector of statistics and the scans that it comes from.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub scans: Vec<Scan>,
    pub values: Vec<f64>,
    pub located: Located,
}

impl Setup {
    /// What `set` holds, or a part of it; cuts lie on whole periods of a square wave.
    ///
    /// # Errors
    /// When a file cannot be read, or a recording is too short to judge.
    pub fn of(set: &RecordingSet, part: Part, extent: Extent) -> Result<Self> {
        let geometry = set.geometry()?;
        let (mut scenes, mut first_readouts) = (Vec::new(), None::<[usize; 2]>);
        for recording in &set.recordings {
            let reader = set.reader(recording)?;
            let most = extent.most(geometry, recording.light);
            // Both parts of a recording that is cut in the middle have as many.
            let all = if part == Part::Whole { most } else { most.saturating_mul(2) };
            if reader.readouts() > all {
                let [fewest, longest] = first_readouts.unwrap_or([all; 2]);
                first_readouts = Some([fewest.min(all), longest.max(all)]);
            }
            let (skip, readouts) = cut(reader.readouts().min(all), recording.light, part);
            if readouts < FEWEST {
                return Err(Error::new(Kind::Input, &recording.file)
                    .found(format_args!("{readouts} readouts"))
                    .expected(format_args!("{FEWEST} or more in each part of a recording"))
                    .remedy(
                        "record longer, or give a second set with --holdout so that this one is not split",
                    ));
            }
            let still = match recording.light {
                Light::Scene(Pattern::StaticUnknown {}) => Some(Still::of(&reader)?),
                _ => None,
            };
            let name = recording.file.clone();
            scenes.push(Scene { name, light: recording.light, readouts, skip, still });
        }
        let maps = scenes.is_empty() && set.rate_maps.len() >= 2;
        let setup = Self { geometry, readout_hz: set.readout_hz, scenes, maps, band: None, first_readouts };
        setup.cut_to_band()
    }

    /// Whether still scenes are all that there is.
    pub(super) fn only_still(&self) -> bool {
        !self.scenes.is_empty() && self.scenes.iter().all(|s| s.still.is_some())
    }

    /// A large still scene cut to the rows that hold most of its even surface.
    fn cut_to_band(mut self) -> Result<Self> {
        let (width, height) = (self.geometry.width(), self.geometry.height());
        // Rows in eights begin on whole bytes.
        let rows = (LARGEST / width / 8 * 8).max(8);
        let Some(still) = self.scenes.iter().find_map(|s| s.still.as_ref()) else { return Ok(self) };
        if height <= rows {
            return Ok(self);
        }
        let starts = (0..=height - rows).step_by(8);
        let first = starts.max_by_key(|r| still.even_in(r * width..(r + rows) * width)).unwrap_or(0);
        self.geometry = Geometry::new(width as u32, rows as u32)?;
        self.band = Some((first, rows));
        for still in self.scenes.iter_mut().filter_map(|s| s.still.as_mut()) {
            still.cut(first * width..(first + rows) * width);
        }
        Ok(self)
    }

    /// Reads and measures the recordings.
    pub(super) fn measure(&self, set: &RecordingSet) -> Result<Measured> {
        if self.maps {
            let values = still::measured_maps(self, set)?;
            return Ok(Measured { scans: Vec::new(), values, located: Located::default() });
        }
        let (mut scans, mut located) = (Vec::new(), Vec::new());
        for (scene, recording) in self.scenes.iter().zip(&set.recordings) {
            let bytes = self.part(set, recording, scene)?;
            let mut found = scan_of(self.geometry, &bytes, scene)?;
            if let Some(still) = &scene.still {
                still.keep(&mut found);
            }
            located.push(places(Packed::new(self.geometry, &bytes)?, &found, scene));
            scans.push(found);
        }
        let values = vector(self, &scans).values;
        Ok(Measured { scans, values, located: Located(located) })
    }

    /// The bits of a recording, as far as they are looked at.
    pub(super) fn read(&self, set: &RecordingSet, k: usize) -> Result<Vec<u8>> {
        self.part(set, &set.recordings[k], &self.scenes[k])
    }

    fn part(&self, set: &RecordingSet, recording: &Recording, scene: &Scene) -> Result<Vec<u8>> {
        let reader = set.reader(recording)?;
        let whole = reader.geometry().frame_bytes();
        let mut bytes = vec![0; scene.readouts * whole];
        reader.read_frames(scene.skip, &mut bytes)?;
        let Some((first, _)) = self.band else { return Ok(bytes) };
        let (from, own) = (first * self.geometry.width() / 8, self.geometry.frame_bytes());
        Ok(bytes.chunks_exact(whole).flat_map(|f| &f[from..from + own]).copied().collect())
    }

    /// The entries of the vector.
    pub(super) fn statistics(&self, sample: &Sample, seed: u64) -> Result<Vec<Statistic>> {
        Ok(self.vector(sample, seed)?.statistics)
    }

    fn vector(&self, sample: &Sample, seed: u64) -> Result<Vector> {
        if self.maps {
            return still::simulated_maps(self, sample, seed);
        }
        Ok(vector(self, &self.simulate(sample, seed)?))
    }

    /// Scans of the set as `sample` would give it.
    pub(super) fn simulate(&self, sample: &Sample, seed: u64) -> Result<Vec<Scan>> {
        let scenes = (0..self.scenes.len()).into_par_iter();
        if self.only_still() {
            return scenes.map(|k| self.scene(sample, k, seed)).collect();
        }
        let model = self.model(sample, seed)?;
        let scene = |k: usize| match self.scenes[k].still {
            Some(_) => self.scene(sample, k, seed),
            None => scan_of(self.geometry, &self.bits_of(&model, sample, k, seed)?, &self.scenes[k]),
        };
        scenes.map(scene).collect()
    }

    pub(super) fn values(&self, sample: &Sample, seed: u64) -> Result<Vec<f64>> {
        Ok(self.vector(sample, seed)?.values)
    }

    /// One recording of the simulated set.
    pub(super) fn scene(&self, sample: &Sample, k: usize, seed: u64) -> Result<Scan> {
        let scene = &self.scenes[k];
        if let Some(still) = &scene.still {
            return still.simulate(self.sized(&sample.camera), seeds(seed, k), scene);
        }
        scan_of(self.geometry, &self.bits(sample, k, seed)?, scene)
    }

    /// The camera at this set's size and rate.
    fn sized(&self, camera: &Camera) -> Camera {
        let mut camera = camera.clone();
        camera.sensor.geometry = self.geometry;
        camera.sensor.readout_hz = self.readout_hz;
        camera
    }

    /// The camera with its fixed pattern drawn: the same for all recordings, and a good part of the work of planning one.
    fn model(&self, sample: &Sample, seed: u64) -> Result<Model> {
        self.sized(&sample.camera).model(seeds(seed, 0))
    }

    /// The bits of one recording of the simulated set.
    pub(super) fn bits(&self, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
        self.bits_of(&self.model(sample, seed)?, sample, k, seed)
    }

    fn bits_of(&self, model: &Model, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
        let scene = &self.scenes[k];
        let lamp = sample.lamps[k];
        let mut model = in_any_phase(model, seed, k);
        let events = sample.pinned.places(k);
        if model.ops.iter().any(|op| replaced(op, &events)) {
            model.to_mut().ops.retain(|op| !replaced(op, &events));
        }
        let plan = Plan::of_model(&model, seeds(seed, k), (scene.greatest() * lamp).max(0.01))?;
        let mut simulator = Simulator::of_plan(plan);
        let (bytes, width) = (self.geometry.frame_bytes(), self.geometry.width());
        let total = scene.skip + scene.readouts + events[0].map_or(0, <[usize]>::len);
        let mut out = vec![0; total * bytes];
        let hold = match scene.light {
            Light::Scene(Pattern::Square { half_period, .. }) => half_period as usize,
            _ => total,
        };
        let (mut filled, mut at) = (0, 0);
        while filled < total {
            // A camera that drops readouts does not stop the light: edges then come early in the file.
            let now = (hold - at % hold).min(total - filled);
            let level = |p: usize| scene.light.at(p / width, p % width, at as u64).unwrap_or(0.0);
            let samples: Vec<f32> = (0..self.geometry.pixels()).map(|p| (lamp * level(p)) as f32).collect();
            let frame = FrameRef::f32(&samples, self.geometry);
            filled += simulator.expose(frame, now, &mut out[filled * bytes..])?;
            at += now;
        }
        put_in(&mut out, bytes, &events, scene.skip);
        out.drain(..scene.skip * bytes);
        Ok(out)
    }
}

/// A recording begins anywhere in a flicker's swing: with one phase for all, slow flicker would have to move a
/// square wave's response as it does at that phase.
fn in_any_phase(model: &Model, seed: u64, k: usize) -> Cow<'_, Model> {
    let is_flicker = |op: &Op| matches!(op, Op::Flicker { depth, .. } if *depth != 0.0);
    if !model.ops.iter().any(is_flicker) {
        return Cow::Borrowed(model);
    }
    // Fractions of the golden ratio's and of the plastic number's multiples spread evenly.
    let phase = (0.618_034 * (seed % 1_000_003) as f64 + 0.754_878 * k as f64).fract();
    let mut turned = model.clone();
    for op in &mut turned.ops {
        if let Op::Flicker { phase_turns, .. } = op {
            *phase_turns = phase;
        }
    }
    Cow::Owned(turned)
}

fn seeds(seed: u64, k: usize) -> Seeds {
    Seeds { camera: seed, shot: seed ^ 0x5EED, sequence: k as u64 }
}

fn scan_of(geometry: Geometry, bytes: &[u8], scene: &Scene) -> Result<Scan> {
    Ok(scan(Packed::new(geometry, bytes)?, scene.look()))
}
