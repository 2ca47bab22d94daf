//! What a set holds, free of files, as it is read.

use super::extent::{ReadoutSelection, RecordingPart, cut};
use super::recorded::RecordedScene;
use super::still::StaticScene;
use crate::{Recording, RecordingSet, Stimulus, StimulusPattern};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs;

/// Fewest readouts of a recording that can be judged.
const FEWEST: usize = 256;

/// Most pixels of a still scene that are simulated: some 20,000 tell temporal noise to a per cent.
pub(crate) const LARGEST: usize = 20_000;

/// Relative standard deviation of the light of a recording if neither the recording nor the set states one.
pub(in crate::diagnose) const DEFAULT_LIGHT_UNCERTAINTY: f64 = 0.01;

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
        .expected(format_args!("at least {FEWEST}{expected}"))
        .remedy(remedy)
}

/// The protocol of a recording set: size, rate and recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Width and height.
    pub geometry: Geometry,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The recordings.
    pub recordings: Vec<RecordedScene>,
    /// Whether rate maps replace the recordings.
    pub has_rate_maps: bool,
    /// First row and number of rows that are used, if a static scene has more than 20,000 pixels.
    pub row_band: Option<(usize, usize)>,
    /// Smallest and largest number of judged readouts, over the recordings that have more.
    pub judged_readouts: Option<[usize; 2]>,
}

impl Setup {
    /// Reads the protocol of `set`, or of a part of it. A square wave is cut at whole periods.
    ///
    /// # Errors
    /// If a file cannot be read, or a recording is too short.
    pub fn new(set: &RecordingSet, part: RecordingPart, extent: ReadoutSelection) -> Result<Self> {
        Self::behind(set, part, extent, &[])
    }

    /// The same without the first readouts of each recording, as many as `aside` says; none of those that it does not reach.
    ///
    /// # Errors
    /// As [`Setup::of`].
    pub(in crate::diagnose) fn behind(
        set: &RecordingSet,
        part: RecordingPart,
        extent: ReadoutSelection,
        aside: &[usize],
    ) -> Result<Self> {
        let geometry = set.geometry()?;
        let (mut scenes, mut first_readouts) = (Vec::new(), None::<[usize; 2]>);
        for (k, recording) in set.recordings.iter().enumerate() {
            let aside = aside.get(k).copied().unwrap_or(0);
            let reader = set.reader(recording)?;
            let most = extent.most(geometry, recording.light);
            // Both parts of a recording that is cut in the middle have as many.
            let all = if part == RecordingPart::Whole { most } else { most.saturating_mul(2) };
            if reader.readouts() > all {
                let [fewest, longest] = first_readouts.unwrap_or([all; 2]);
                first_readouts = Some([fewest.min(all), longest.max(all)]);
            }
            let (skip, readouts) = cut(reader.readouts().min(all), recording.light, part, aside);
            if readouts < FEWEST {
                return Err(too_short(&recording.file, readouts, part));
            }
            let still = match recording.light {
                Stimulus::Scene(StimulusPattern::StaticUnknown {}) => Some(StaticScene::of(&reader)?),
                _ => None,
            };
            let name = recording.file.clone();
            let sources = set.sources(recording);
            scenes.push(RecordedScene {
                name,
                // The light of a sum is that of its sources, because a meter has an error for each recording.
                light: if sources.is_sum() { Stimulus::Level(sources.light()) } else { recording.light },
                readouts,
                first_readout: skip,
                static_scene: still,
                light_uncertainty: recording
                    .light_uncertainty
                    .or(set.light_uncertainty)
                    .unwrap_or(DEFAULT_LIGHT_UNCERTAINTY),
                sources,
                light_offset: 0.0,
            });
        }
        let maps = scenes.is_empty() && set.rate_maps.len() >= 2;
        let readout_hz = set.readout_hz;
        let setup = Self {
            geometry,
            readout_hz,
            recordings: scenes,
            has_rate_maps: maps,
            row_band: None,
            judged_readouts: first_readouts,
        };
        setup.cut_to_band()
    }

    /// Whether the recordings have the same found light.
    pub(in crate::diagnose) fn has_light_of(&self, other: &Self) -> bool {
        self.recordings.iter().zip(&other.recordings).all(|(a, b)| a.light_offset == b.light_offset)
    }

    /// Sets the relative standard deviation of the light of each recording. The uncertainty of a source is that of the recording
    /// which has the source alone.
    pub(in crate::diagnose) fn set_light_uncertainties(&mut self, uncertainties: &[f64]) {
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

    /// Without some of its recordings.
    pub(in crate::diagnose) fn without(mut self, dropped: &[usize]) -> Self {
        let mut k = 0;
        self.recordings.retain(|_| {
            k += 1;
            !dropped.contains(&(k - 1))
        });
        self
    }

    /// Whether still scenes are all that there is.
    pub(in crate::diagnose) fn only_still(&self) -> bool {
        !self.recordings.is_empty() && self.recordings.iter().all(|s| s.static_scene.is_some())
    }

    /// A large still scene cut to the rows that hold most of its even surface.
    fn cut_to_band(mut self) -> Result<Self> {
        let (width, height) = (self.geometry.width(), self.geometry.height());
        // Rows in eights begin on whole bytes.
        let rows = (LARGEST / width / 8 * 8).max(8);
        let Some(still) = self.recordings.iter().find_map(|s| s.static_scene.as_ref()) else {
            return Ok(self);
        };
        if height <= rows {
            return Ok(self);
        }
        let starts = (0..=height - rows).step_by(8);
        let first = starts.max_by_key(|r| still.even_in(r * width..(r + rows) * width)).unwrap_or(0);
        self.geometry = Geometry::new(width as u32, rows as u32)?;
        self.row_band = Some((first, rows));
        for still in self.recordings.iter_mut().filter_map(|s| s.static_scene.as_mut()) {
            still.cut(first * width..(first + rows) * width);
        }
        Ok(self)
    }

    /// The bits of a recording, as far as they are looked at.
    pub(in crate::diagnose) fn read(&self, set: &RecordingSet, k: usize) -> Result<Vec<u8>> {
        self.part(set, &set.recordings[k], &self.recordings[k])
    }

    pub(in crate::diagnose) fn part(
        &self,
        set: &RecordingSet,
        recording: &Recording,
        scene: &RecordedScene,
    ) -> Result<Vec<u8>> {
        let reader = set.reader(recording)?;
        let whole = reader.geometry().frame_bytes();
        let mut bytes = inputs::zeroed_vec(reader.name(), scene.readouts * whole)?;
        reader.read_frames(scene.first_readout, &mut bytes)?;
        let Some((first, _)) = self.row_band else { return Ok(bytes) };
        let (from, own) = (first * self.geometry.width() / 8, self.geometry.frame_bytes());
        Ok(bytes.chunks_exact(whole).flat_map(|f| &f[from..from + own]).copied().collect())
    }
}
