//! The protocol of a recording set, without its files.

use crate::recordings::extent::{ReadoutSelection, RecordingPart, select_readouts};
use crate::recordings::recorded_scene::{RecordedScene, StaticScene};
use crate::thresholds::{MAX_STATIC_PIXELS, MIN_PERIODS, MIN_READOUTS};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs;
use spikelane_calibrate::{DEFAULT_LIGHT_UNCERTAINTY, Recording, RecordingSet, Stimulus, StimulusPattern};

/// Returns the error of a recording with too few readouts.
fn too_short(file: &str, readouts: usize, part: RecordingPart) -> Error {
    let (expected, remedy) = match part {
        RecordingPart::Whole => ("", "record longer".to_owned()),
        _ => (
            " in each half of a recording",
            format!(
                "record longer, or set {} to a second recording set, which avoids the split",
                Setting("holdout")
            ),
        ),
    };
    Error::new(ErrorKind::Input, file)
        .found(format_args!("{readouts} readouts"))
        .expected(format_args!("at least {MIN_READOUTS}{expected}"))
        .remedy(remedy)
}

/// The protocol of a recording set: size, rate and recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Width and height in pixels.
    pub geometry: Geometry,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The recordings.
    pub recordings: Vec<RecordedScene>,
    /// Whether the set contains measured rate maps instead of recordings.
    pub has_rate_maps: bool,
    /// First row and number of rows that are used. It is set if a static scene has more than 20,000 pixels.
    pub row_band: Option<(usize, usize)>,
    /// Smallest and largest limit of the number of compared readouts. Only recordings that are longer than their
    /// limit count. `None` if no recording is longer.
    pub judged_readouts: Option<[usize; 2]>,
}

impl Setup {
    /// Reads the protocol of a part of `set`. A square wave is divided at whole periods.
    ///
    /// # Errors
    /// If a file cannot be read, or a recording is too short.
    pub fn new(set: &RecordingSet, part: RecordingPart, extent: ReadoutSelection) -> Result<Self> {
        Self::behind(set, part, extent, &[])
    }

    /// Reads the protocol without the first readouts of each recording. `aside` contains the number of excluded
    /// readouts of each recording. A missing element counts as 0.
    ///
    /// # Errors
    /// See [`Setup::new`].
    pub(crate) fn behind(
        set: &RecordingSet,
        part: RecordingPart,
        extent: ReadoutSelection,
        aside: &[usize],
    ) -> Result<Self> {
        let geometry = set.geometry()?;
        let (mut scenes, mut judged_readouts) = (Vec::new(), None::<[usize; 2]>);
        for (k, recording) in set.recordings.iter().enumerate() {
            let aside = aside.get(k).copied().unwrap_or(0);
            let reader = set.reader(recording)?;
            let limit = extent.max_readouts(geometry, recording.light);
            // Each half of a divided recording may have this number of readouts.
            let max_readouts = if part == RecordingPart::Whole { limit } else { limit.saturating_mul(2) };
            if reader.readouts() > max_readouts {
                let [fewest, longest] = judged_readouts.unwrap_or([max_readouts; 2]);
                judged_readouts = Some([fewest.min(max_readouts), longest.max(max_readouts)]);
            }
            let (first_readout, readouts) =
                select_readouts(reader.readouts().min(max_readouts), recording.light, part, aside);
            if readouts < MIN_READOUTS {
                return Err(too_short(&recording.file, readouts, part));
            }
            let static_scene = match recording.light {
                Stimulus::Scene(StimulusPattern::StaticUnknown {}) => {
                    Some(StaticScene::read(&reader, reader.readouts().min(max_readouts))?)
                }
                _ => None,
            };
            let name = recording.file.clone();
            let sources = set.sources(recording);
            scenes.push(RecordedScene {
                name,
                // A recording with several sources has the sum of their light. The stated light of the sum is not
                // used, because a meter has another error in each recording.
                light: if sources.is_sum() { Stimulus::Level(sources.light()) } else { recording.light },
                readouts,
                first_readout,
                static_scene,
                light_uncertainty: recording
                    .light_uncertainty
                    .or(set.light_uncertainty)
                    .unwrap_or(DEFAULT_LIGHT_UNCERTAINTY),
                sources,
                light_offset: 0.0,
            });
        }
        let has_rate_maps = scenes.is_empty() && set.rate_maps.len() >= 2;
        let readout_hz = set.readout_hz;
        let setup =
            Self { geometry, readout_hz, recordings: scenes, has_rate_maps, row_band: None, judged_readouts };
        setup.cut_to_band()
    }

    /// Returns whether the recordings of both setups have the same found light.
    pub(crate) fn has_light_of(&self, other: &Self) -> bool {
        self.recordings.iter().zip(&other.recordings).all(|(a, b)| a.light_offset == b.light_offset)
    }

    /// Sets the relative standard deviation of the light of each recording. The uncertainty of a source becomes
    /// that of the recording in which the source is alone.
    pub(crate) fn set_light_uncertainties(&mut self, uncertainties: &[f64]) {
        let mut of_sources = Vec::new();
        for (recording, uncertainty) in self.recordings.iter_mut().zip(uncertainties) {
            recording.light_uncertainty = *uncertainty;
            of_sources.extend(recording.sources.single().map(|s| (s.name.clone(), *uncertainty)));
        }
        for source in self.recordings.iter_mut().flat_map(|r| r.sources.sources.iter_mut()) {
            if let Some((_, uncertainty)) = of_sources.iter().find(|(name, _)| *name == source.name) {
                source.uncertainty = *uncertainty;
            }
        }
    }

    /// Returns the setup without the recordings with the indices `dropped`.
    pub(crate) fn without(mut self, dropped: &[usize]) -> Self {
        let mut k = 0;
        self.recordings.retain(|_| {
            k += 1;
            !dropped.contains(&(k - 1))
        });
        self
    }

    /// Returns the lowest frequency, in hertz, at which the recordings distinguish an oscillation from a drift. The
    /// longest recording contains two periods of it. The search for lines in spectra starts at the same frequency.
    pub(crate) fn lowest_line_hz(&self) -> f64 {
        let longest = self.recordings.iter().map(|s| s.readouts).max().unwrap_or(1);
        MIN_PERIODS * self.readout_hz / longest as f64
    }

    /// Returns whether all recordings show static scenes.
    pub(crate) fn only_still(&self) -> bool {
        !self.recordings.is_empty() && self.recordings.iter().all(|s| s.static_scene.is_some())
    }

    /// Reduces the recordings to some rows if a static scene is large. The rows are those with the most uniform
    /// pixels.
    fn cut_to_band(mut self) -> Result<Self> {
        let (width, height) = (self.geometry.width(), self.geometry.height());
        // A band of a multiple of eight rows starts at a whole byte.
        let rows = (MAX_STATIC_PIXELS / width / 8 * 8).max(8);
        let Some(static_scene) = self.recordings.iter().find_map(|s| s.static_scene.as_ref()) else {
            return Ok(self);
        };
        if height <= rows {
            return Ok(self);
        }
        let starts = (0..=height - rows).step_by(8);
        let first =
            starts.max_by_key(|r| static_scene.uniform_in(r * width..(r + rows) * width)).unwrap_or(0);
        self.geometry = Geometry::new(width as u32, rows as u32)?;
        self.row_band = Some((first, rows));
        for static_scene in self.recordings.iter_mut().filter_map(|s| s.static_scene.as_mut()) {
            static_scene.cut(first * width..(first + rows) * width);
        }
        Ok(self)
    }

    /// Reads the bits of recording `k` that are compared with the model.
    pub(crate) fn read(&self, set: &RecordingSet, k: usize) -> Result<Vec<u8>> {
        self.part(set, &set.recordings[k], &self.recordings[k])
    }

    /// Reads the bits of `recording` that are compared with the model. `scene` describes the recording.
    pub(crate) fn part(
        &self,
        set: &RecordingSet,
        recording: &Recording,
        scene: &RecordedScene,
    ) -> Result<Vec<u8>> {
        let reader = set.reader(recording)?;
        let frame_bytes = reader.geometry().frame_bytes();
        let mut bytes = inputs::zeroed_vec(reader.name(), scene.readouts * frame_bytes)?;
        reader.read_frames(scene.first_readout, &mut bytes)?;
        let Some((first, _)) = self.row_band else { return Ok(bytes) };
        let (from, band_bytes) = (first * self.geometry.width() / 8, self.geometry.frame_bytes());
        Ok(bytes.chunks_exact(frame_bytes).flat_map(|f| &f[from..from + band_bytes]).copied().collect())
    }
}

/// Checks that a set contains enough recordings for a diagnosis.
///
/// # Errors
/// If the set has too few levels or pixels. A set with rate maps or a static scene is sufficient if `with_camera`
/// is set.
pub(crate) fn check_sufficient(setup: &Setup, with_camera: bool) -> Result<()> {
    let has_one_kind = setup.has_rate_maps || setup.recordings.iter().any(|s| s.static_scene.is_some());
    // Rate maps or a static scene are sufficient to test a given camera.
    if with_camera && has_one_kind {
        return Ok(());
    }
    let levels: Vec<f64> = setup.recordings.iter().filter_map(RecordedScene::level).collect();
    let lit = levels.iter().filter(|l| **l > 0.0).count();
    if levels.len() >= 3 && lit >= 2 && setup.geometry.width() >= 8 && setup.geometry.height() >= 8 {
        return Ok(());
    }
    let error = Error::new(ErrorKind::Input, "recording set");
    if has_one_kind {
        let found = if setup.has_rate_maps { "rate maps" } else { "a static scene of unknown light" };
        return Err(error
            .found(format_args!("{found} and no camera"))
            .expected("a camera to compare with, because a calibration needs recordings of known light")
            .remedy(format_args!(
                "set {} to a preset or a camera file, or add a dark recording and flat fields of known light to the set",
                Setting("camera")
            )));
    }
    Err(error
        .found(format_args!("{} uniform levels, of which {lit} are lit, at {}", levels.len(), setup.geometry))
        .expected("a dark level and at least two lit levels, at least 8x8 pixels")
        .remedy("record a dark recording, flat fields at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation, steps and a checkerboard"))
}

/// Checks that two sets follow the same protocol.
///
/// # Errors
/// If the protocols differ. The error names the first difference.
pub(crate) fn same_protocol(a: &Setup, b: &Setup) -> Result<()> {
    let names = |x: &RecordedScene| x.sources.sources.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    let key = |s: &Setup, k: usize| s.recordings.get(k).map(|x| (x.light, names(x), x.readouts));
    let size = |s: &Setup| format!("{} at {} readouts per second", s.geometry, s.readout_hz);
    let other = (0..a.recordings.len().max(b.recordings.len())).find(|k| key(a, *k) != key(b, *k));
    let description = |s: &Setup| match other {
        _ if size(a) != size(b) => size(s),
        Some(k) => s.recordings.get(k).map_or_else(
            || format!("{} recordings", s.recordings.len()),
            |x| {
                let mut lights = vec![x.light_description()];
                lights.extend(names(x));
                format!("{} ({}) with {} readouts", x.file_name(), lights.join(", "), x.readouts)
            },
        ),
        None => String::new(),
    };
    if other.is_none() && size(a) == size(b) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, "held-out recordings").found(description(b)).expected(format_args!(
        "the same scenes in the same order and of the same length as in the first set: {}",
        description(a)
    )))
}
