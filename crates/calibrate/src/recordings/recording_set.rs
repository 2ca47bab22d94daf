//! Recording sets. A set lists the recordings of one camera, and the light of each recording.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::color_filters::ColorFilters;
use super::light_unit::{LevelRate, check_light_unit};
use super::recorded_camera::RecordedCamera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Mosaic;
use spikelane::spikes::{Geometry, count_spikes};
use spikelane::unstable::error::toml_fault;
use spikelane::unstable::inputs;
use spikelane_io::formats::{Layout, StreamReader};
use spikelane_io::simulate::Sidecar;

/// The light in front of the camera. Light 1 causes one spike per readout.
///
/// # Examples
/// ```
/// use spikelane_calibrate::{Stimulus, StimulusPattern};
/// let board = Stimulus::Scene(StimulusPattern::Checkerboard { high: 0.8, low: 0.1, cell: 8 });
/// assert_eq!(board.level_at(0, 0, 0), Some(0.8));
/// assert_eq!(board.level_at(0, 8, 0), Some(0.1));
/// assert_eq!(Stimulus::Level(0.3).level_at(5, 5, 100), Some(0.3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Stimulus {
    /// A uniform, constant level. Level 0 is dark.
    Level(f64),
    /// Any other light.
    Scene(StimulusPattern),
}

/// Light that is not one uniform, constant level.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum StimulusPattern {
    /// Uniform light that alternates between two levels. The first half period has the high level.
    Square {
        /// Level of the first half of each period.
        high: f64,
        /// Level of the second half of each period.
        low: f64,
        /// Duration of half a period in readouts.
        half_period: u32,
    },
    /// A checkerboard with squares of `cell` x `cell` pixels. A pixel has the high level if `row / cell + col / cell` is
    /// even.
    Checkerboard {
        /// Level of the even squares.
        high: f64,
        /// Level of the odd squares.
        low: f64,
        /// Side of a square in pixels.
        cell: u32,
    },
    /// A static scene whose light is unknown.
    StaticUnknown {},
}

/// Writes the light in units of full scale, such as `0.3` or `0.5 and 0.1 in turns of 20 readouts`.
impl fmt::Display for Stimulus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Level(level) => level.fmt(f),
            Self::Scene(StimulusPattern::Square { high, low, half_period }) => {
                write!(f, "{high} and {low} in turns of {half_period} readouts")
            }
            Self::Scene(StimulusPattern::Checkerboard { high, low, cell }) => {
                write!(f, "{high} and {low} in squares of {cell} pixels")
            }
            Self::Scene(StimulusPattern::StaticUnknown {}) => f.write_str("an unknown scene"),
        }
    }
}

impl Stimulus {
    /// Returns the level of pixel `(row, col)` at `readout`, or `None` for an unknown scene.
    #[must_use]
    pub fn level_at(self, row: usize, col: usize, readout: u64) -> Option<f64> {
        match self {
            Self::Level(level) => Some(level),
            Self::Scene(StimulusPattern::Square { high, low, half_period }) => {
                let first = (readout / u64::from(half_period.max(1))).is_multiple_of(2);
                Some(if first { high } else { low })
            }
            Self::Scene(StimulusPattern::Checkerboard { high, low, cell }) => {
                let cell = cell.max(1) as usize;
                Some(if (row / cell + col / cell).is_multiple_of(2) { high } else { low })
            }
            Self::Scene(StimulusPattern::StaticUnknown {}) => None,
        }
    }

    /// Returns the uniform level, or `None` for any other light.
    #[must_use]
    pub fn level(self) -> Option<f64> {
        match self {
            Self::Level(level) => Some(level),
            Self::Scene(_) => None,
        }
    }

    /// Returns this light with every level multiplied by `factor`.
    #[must_use]
    pub fn scale(self, factor: f64) -> Self {
        match self {
            Self::Level(level) => Self::Level(level * factor),
            Self::Scene(StimulusPattern::Square { high, low, half_period }) => {
                Self::Scene(StimulusPattern::Square { high: high * factor, low: low * factor, half_period })
            }
            Self::Scene(StimulusPattern::Checkerboard { high, low, cell }) => {
                Self::Scene(StimulusPattern::Checkerboard { high: high * factor, low: low * factor, cell })
            }
            Self::Scene(StimulusPattern::StaticUnknown {}) => self,
        }
    }

    /// Returns an error if a level is not a number from 0 to `max_level`, or if a length is 0.
    fn check(self, file: &str) -> Result<()> {
        let (levels, length) = match self {
            Self::Level(level) => ([level, level], 1),
            Self::Scene(StimulusPattern::Square { high, low, half_period }) => ([high, low], half_period),
            Self::Scene(StimulusPattern::Checkerboard { high, low, cell }) => ([high, low], cell),
            Self::Scene(StimulusPattern::StaticUnknown {}) => ([0.0, 0.0], 1),
        };
        let is_usable = |l: &f64| *l == 0.0 || (MIN_LIT_LEVEL..=MAX_LEVEL).contains(l);
        if !levels.iter().all(is_usable) || length == 0 {
            return Err(Error::new(ErrorKind::Config, format_args!("light of {file}"))
                .found(match self {
                    Self::Level(level) if level.abs() < MIN_LIT_LEVEL => format!("{level:e}"),
                    Self::Level(level) => level.to_string(),
                    Self::Scene(_) => {
                        format!("levels {} and {}, length {length}", levels[0], levels[1])
                    }
                })
                .expected(format_args!(
                    "level 0, or a level from {MIN_LIT_LEVEL:e} to {MAX_LEVEL} in units of saturation, and a length above zero"
                ))
                .remedy("state the light as a fraction of saturation, such as 0.3; in the dark, state 0"));
        }
        Ok(())
    }
}

/// Number of readouts from which [`mean_rate_at_start`] computes a rate.
const START_READOUTS: usize = 1000;

/// Returns the mean rate of all pixels in the first readouts of a recording, in spikes per readout.
pub(super) fn mean_rate_at_start(reader: &StreamReader) -> Result<f64> {
    let readouts = reader.readouts().min(START_READOUTS);
    let mut frames = reader.frames(0..readouts)?;
    let mut spikes = 0;
    while let Some(frame) = frames.next_frame() {
        spikes += count_spikes(frame?);
    }
    Ok(spikes as f64 / (readouts * reader.geometry().pixels()) as f64)
}

/// Relative standard deviation of a light level without a stated uncertainty. It is typical of a laboratory light meter.
pub const DEFAULT_LIGHT_UNCERTAINTY: f64 = 0.01;

/// Gains that [`RecordingSet::check_light_unit`] attributes to the camera. Percent, gray values and lux are outside.
const PLAUSIBLE_GAINS: Range<f64> = 0.1..10.0;

/// Returns the number of the line that states the light of `file` in the text of a set.
fn light_line(text: &str, file: &str) -> Option<usize> {
    let value = |line: &str, key: &str| {
        let (found, value) = line.split_once('=')?;
        (found.trim() == key).then(|| value.trim().trim_matches(['"', '\'']).to_owned())
    };
    let (mut is_entry, mut light) = (false, None);
    for (line, number) in text.lines().zip(1..) {
        if line.trim_start().starts_with("[[") {
            (is_entry, light) = (false, None);
        }
        is_entry |= value(line, "file").is_some_and(|f| f == file);
        light = light.or(value(line, "light").map(|_| number));
        if is_entry && light.is_some() {
            return light;
        }
    }
    None
}

/// The lowest light that is not darkness. At this light, a camera with 20,000 readouts per second emits about two spikes
/// per pixel and day.
const MIN_LIT_LEVEL: f64 = 1e-9;

/// The highest light of a recording. Light in lux is below it, so that a later check finds the factor to saturation.
const MAX_LEVEL: f64 = 1e6;

/// The line that `spikelane record --template` writes in place of an unknown light.
pub const UNSPECIFIED_LIGHT: &str = "light = \"?\"";

/// A recorded stream of the set.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Recording {
    /// Path of the stream, relative to the file of the set.
    pub file: String,
    /// The light in front of the camera.
    pub light: Stimulus,
    /// Relative standard deviation of the light of this recording. If absent, the value of the set applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_uncertainty: Option<f64>,
    /// Names of the sources of light that were on. The light of the recording is the sum of their light. If empty, the
    /// recording has a lamp of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<String>,
    /// File layout of this recording. If absent, the layout of the set applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
}

/// A map of per-pixel rates that replaces a stream. It is an `.npy` array of f32 or f64 in spikes per readout, with the
/// top row first.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RateMap {
    /// Path of the map, relative to the file of the set.
    pub file: String,
    /// Uniform light level. Light 1 causes one spike per readout.
    pub light: f64,
    /// Relative standard deviation of the light of this map. If absent, the value of the set applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_uncertainty: Option<f64>,
    /// Number of readouts from which the rates were measured. `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts: Option<u32>,
}

/// The recordings of one camera.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RecordingSet {
    /// Number of pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Readouts per second.
    pub readout_hz: f64,
    /// Layout of the files. If absent, the sidecar or the array header of each file determines it. A file without either
    /// has the layout `dat`. See [`Layout`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
    /// Relative standard deviation of the light levels. If absent, it is 0.01.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_uncertainty: Option<f64>,
    /// Relative standard deviation of the light of sources from one recording to another. If absent, it is 0.0001.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_repeatability: Option<f64>,
    /// Pattern of the color filters, such as `RGGB`, or `none`. If absent, the sidecars of the recordings state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mosaic: Option<String>,
    /// Name of the simulated camera, if the recordings were simulated. Reports mention this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated_camera: Option<String>,
    /// Description of the camera. Reports print it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<RecordedCamera>,
    /// Recorded streams.
    #[serde(default, rename = "recording")]
    pub recordings: Vec<Recording>,
    /// Rate maps.
    #[serde(default, rename = "rate_map", skip_serializing_if = "Vec::is_empty")]
    pub rate_maps: Vec<RateMap>,
    /// Folder to which the paths of the set are relative.
    #[serde(skip)]
    pub folder: PathBuf,
}

impl RecordingSet {
    /// Returns the paths of the recordings and rate maps.
    #[must_use]
    pub fn input_files(&self) -> Vec<PathBuf> {
        let files = self.recordings.iter().map(|r| &r.file).chain(self.rate_maps.iter().map(|m| &m.file));
        files.map(|file| self.folder.join(file)).collect()
    }

    /// Reads and checks the file of a set.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if the file cannot be read.
    /// * [`ErrorKind::Config`] if the file does not describe a set. Examples are unknown keys, impossible light, and a
    ///   level or a file that occurs twice.
    pub fn open(path: &Path) -> Result<Self> {
        let text = inputs::read_text(path, "a set of recordings")?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Self::parse(&text, folder).map_err(|e| e.with_context(path.display()))
    }

    /// Reads and checks the text of a set. Paths are relative to `folder`.
    ///
    /// # Examples
    /// ```
    /// use spikelane_calibrate::{RecordingSet, Stimulus, UNSPECIFIED_LIGHT};
    /// let text = "width = 400\nheight = 250\nreadout_hz = 20000\n[[recording]]\nfile = \"dark.dat\"\nlight = 0.0\n";
    /// let set = RecordingSet::parse(text, "recordings".into())?;
    /// assert_eq!((set.recordings[0].file.as_str(), set.recordings[0].light), ("dark.dat", Stimulus::Level(0.0)));
    ///
    /// // The template contains a placeholder for each light level.
    /// let template = text.replace("light = 0.0", UNSPECIFIED_LIGHT);
    /// let error = RecordingSet::parse(&template, "recordings".into()).unwrap_err();
    /// assert_eq!(error.subject(), "line 6");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the text does not describe a set. See [`RecordingSet::open`].
    pub fn parse(text: &str, folder: PathBuf) -> Result<Self> {
        if let Some(line) = text.lines().position(|l| l.trim() == UNSPECIFIED_LIGHT) {
            return Err(Error::new(ErrorKind::Config, format_args!("line {}", line + 1)).found(UNSPECIFIED_LIGHT).expected(
                "the light of this recording: 0 in the dark, otherwise a fraction of saturation, such as 0.3",
            ));
        }
        let mut set: Self = toml::from_str(text).map_err(|e| {
            let error = Error::new(ErrorKind::Config, "recording set").found(toml_fault(&e));
            // A path of Windows in double quotes.
            if e.message().contains("escape") { error.remedy("separate folders with '/'") } else { error }
        })?;
        set.folder = folder;
        set.check_light(Some(text))?;
        set.check()?;
        set.separate_folders_with_slashes();
        Ok(set)
    }

    /// Replaces the backslashes in paths of Windows.
    fn separate_folders_with_slashes(&mut self) {
        let files = self.recordings.iter_mut().map(|r| &mut r.file);
        for file in files.chain(self.rate_maps.iter_mut().map(|m| &mut m.file)) {
            if inputs::path_from_text(&self.folder, file) != self.folder.join(&file) {
                *file = file.replace('\\', "/");
            }
        }
    }

    /// Returns the set of one recording of a static scene under unknown light.
    ///
    /// `stream` is the open file at `path`. The set has its size and layout, and `readout_hz` readouts per second. The
    /// path of the set is relative to the current folder, like `path`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane_calibrate::{RecordingSet, Stimulus, StimulusPattern};
    /// use spikelane_io::formats::{Layout, StreamReader};
    /// let geometry = Geometry::new(8, 8)?;
    /// let stream = StreamReader::from_bytes("one.dat", vec![0; 80], Some(Layout::Dat), Some(geometry))?;
    /// let set = RecordingSet::from_static_recording("one.dat".as_ref(), &stream, 20_000.0)?;
    /// assert_eq!((set.width, set.height, set.recordings.len()), (8, 8, 1));
    /// assert_eq!(set.recordings[0].light, Stimulus::Scene(StimulusPattern::StaticUnknown {}));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// * [`ErrorKind::Config`] if `readout_hz` is not a positive number.
    /// * [`ErrorKind::Input`] if `path` is not UTF-8. The file of a set is text and cannot contain such a path.
    pub fn from_static_recording(path: &Path, stream: &StreamReader, readout_hz: f64) -> Result<Self> {
        let file = path.to_str().ok_or_else(|| {
            Error::new(ErrorKind::Input, path.display())
                .found("a path that is not UTF-8")
                .expected("a path in UTF-8")
                .remedy("rename the file or the folder")
        })?;
        let recording = Recording {
            file: file.to_owned(),
            light: Stimulus::Scene(StimulusPattern::StaticUnknown {}),
            light_uncertainty: None,
            sources: Vec::new(),
            layout: Some(stream.layout().name().to_owned()),
        };
        let set = Self {
            width: stream.geometry().width() as u32,
            height: stream.geometry().height() as u32,
            readout_hz,
            layout: None,
            light_uncertainty: None,
            source_repeatability: None,
            mosaic: None,
            simulated_camera: None,
            camera: None,
            recordings: vec![recording],
            rate_maps: Vec::new(),
            folder: PathBuf::new(),
        };
        set.check()?;
        Ok(set)
    }

    /// Returns the text of this set. [`RecordingSet::parse`] can read this text.
    ///
    /// # Errors
    /// None in practice, because every value can be written.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::new(ErrorKind::Config, "recording set").found(e))
    }

    /// Returns the width and height of the sensor.
    ///
    /// # Errors
    /// See [`Geometry::new`].
    pub fn geometry(&self) -> Result<Geometry> {
        Geometry::new(self.width, self.height)
    }

    /// Returns the color filters: from the set, else from the sidecars of its recordings.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if a pattern is invalid, or if two sidecars state different filters.
    pub fn color_filters(&self) -> Result<ColorFilters> {
        if let Some(text) = &self.mosaic {
            return ColorFilters::parse(text).map_err(|e| e.with_context("mosaic of the recording set"));
        }
        let mut found: Option<(&str, Mosaic)> = None;
        for recording in &self.recordings {
            // A stream without a readable sidecar states nothing.
            let sidecar = Sidecar::read_beside(&self.folder.join(&recording.file)).ok().flatten();
            let Some(facts) = sidecar.and_then(|(_, sidecar)| sidecar.mosaic) else { continue };
            let mosaic = facts.mosaic().map_err(|e| e.with_context(&recording.file))?;
            match &found {
                Some((first, other)) if *other != mosaic => {
                    return Err(Error::new(ErrorKind::Config, format_args!("mosaic of {}", recording.file))
                        .found(format_args!("{mosaic}, and {other} in the sidecar of {first}"))
                        .expected("the same color filters in all sidecars of a set")
                        .remedy("set mosaic in the file of the set"));
                }
                Some(_) => {}
                None => found = Some((&recording.file, mosaic)),
            }
        }
        Ok(found.map_or(ColorFilters::Unknown, |(_, mosaic)| ColorFilters::Mosaic(mosaic)))
    }

    /// Returns file and light of each uniform level. Streams precede maps, and both are in the order of the set's file.
    pub fn levels(&self) -> impl Iterator<Item = (&str, f64)> {
        let streams = self.recordings.iter().filter_map(|r| Some((r.file.as_str(), r.light.level()?)));
        streams.chain(self.rate_maps.iter().map(|m| (m.file.as_str(), m.light)))
    }

    /// Opens the stream of `recording`.
    ///
    /// # Errors
    /// See [`StreamReader::open`].
    pub fn reader(&self, recording: &Recording) -> Result<StreamReader> {
        let name = recording.layout.as_ref().or(self.layout.as_ref());
        let layout = name.map(|n| Layout::parse(n)).transpose()?;
        StreamReader::open(&self.folder.join(&recording.file), layout, Some(self.geometry()?))
    }

    /// Checks the unit of the light by the rates at the start of each uniform recording. The error states the factor that
    /// converts the levels.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if the rates differ from the light by more than a factor of ten, or if a stream cannot be
    /// read.
    pub fn check_light_unit(&self) -> Result<()> {
        let mut levels = Vec::new();
        for recording in &self.recordings {
            let Some(light) = recording.light.level() else { continue };
            let rate = mean_rate_at_start(&self.reader(recording)?)?;
            levels.push(LevelRate { name: &recording.file, light, rate });
        }
        levels.sort_by(|a, b| a.light.total_cmp(&b.light));
        check_light_unit(&levels, PLAUSIBLE_GAINS)
    }

    fn check(&self) -> Result<()> {
        self.geometry()?;
        if !(self.readout_hz.is_finite() && self.readout_hz > 0.0) {
            return Err(Error::new(ErrorKind::Config, "readout_hz")
                .found(self.readout_hz)
                .expected("readouts per second, a positive number"));
        }
        self.camera.as_ref().map_or(Ok(()), RecordedCamera::check)?;
        self.check_light(None)?;
        self.mosaic.as_deref().map(ColorFilters::parse).transpose()?;
        self.check_uncertainties()?;
        if self.recordings.is_empty() && self.rate_maps.is_empty() {
            return Err(Error::new(ErrorKind::Config, "recording set")
                .found("no recordings")
                .expected("[[recording]] or [[rate_map]] entries"));
        }
        self.check_duplicates()?;
        self.check_sources()
    }

    /// Checks the light of all files. If `text` is the text of this set, an error names the line of the light.
    fn check_light(&self, text: Option<&str>) -> Result<()> {
        let recordings = self.recordings.iter().map(|r| (r.light, &r.file));
        let maps = self.rate_maps.iter().map(|m| (Stimulus::Level(m.light), &m.file));
        for (light, file) in recordings.chain(maps) {
            light.check(file).map_err(|e| match text.and_then(|text| light_line(text, file)) {
                Some(line) => e.with_context(format_args!("line {line}")),
                None => e,
            })?;
        }
        Ok(())
    }

    fn check_uncertainties(&self) -> Result<()> {
        let uncertainties = self.recordings.iter().filter_map(|r| r.light_uncertainty);
        let maps = self.rate_maps.iter().filter_map(|m| m.light_uncertainty);
        match uncertainties.chain(maps).chain(self.light_uncertainty).find(|u| !(*u > 0.0 && *u < 1.0)) {
            None => Ok(()),
            Some(u) => Err(Error::new(ErrorKind::Config, "light_uncertainty")
                .found(u)
                .expected("a relative standard deviation above 0 and below 1, such as 0.01")),
        }
    }

    fn check_duplicates(&self) -> Result<()> {
        let files = self.recordings.iter().map(|r| &r.file).chain(self.rate_maps.iter().map(|m| &m.file));
        let mut files: Vec<&String> = files.collect();
        files.sort_unstable();
        if let Some(twice) = files.windows(2).find(|w| w[0] == w[1]) {
            return Err(Error::new(ErrorKind::Config, "recording set")
                .found(format_args!("{} twice", twice[0]))
                .expected("each file once"));
        }
        let mut levels: Vec<(&str, f64)> = self.levels().collect();
        levels.sort_by(|a, b| a.1.total_cmp(&b.1));
        if let Some(twice) = levels.windows(2).find(|w| w[0].1 == w[1].1) {
            return Err(Error::new(ErrorKind::Config, "recording set")
                .found(format_args!("light {} for {} and for {}", twice[0].1, twice[0].0, twice[1].0))
                .expected("each level once")
                .remedy("set a repeated recording to its actual light, or put it into another set"));
        }
        Ok(())
    }
}
