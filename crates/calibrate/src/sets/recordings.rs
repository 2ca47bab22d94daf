//! Recording sets: which files hold a camera's recordings, and what stood in front of it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs;
use spikelane_io::formats::{Layout, Reader};

/// What the camera looked at. Light is a fraction of the light that gives one spike per readout.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Light {
    /// A uniform, constant level; 0 is the dark.
    Level(f64),
    /// Anything else.
    Scene(Pattern),
}

/// Light that is not one uniform level.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Pattern {
    /// Uniform light that steps between two levels, beginning high.
    Square {
        /// Level of the first half period.
        high: f64,
        /// Level of the second one.
        low: f64,
        /// Length of a half period in readouts.
        half_period: u32,
    },
    /// Squares of `cell` pixels, high where `row/cell + col/cell` is even.
    Checkerboard {
        /// Level of the even squares.
        high: f64,
        /// Level of the odd squares.
        low: f64,
        /// Side of a square in pixels.
        cell: u32,
    },
    /// A static scene of which nothing else is known.
    StaticUnknown {},
}

impl Light {
    /// The level of pixel `(row, col)` at `readout`; `None` in an unknown scene.
    #[must_use]
    pub fn at(self, row: usize, col: usize, readout: u64) -> Option<f64> {
        match self {
            Self::Level(level) => Some(level),
            Self::Scene(Pattern::Square { high, low, half_period }) => {
                let first = (readout / u64::from(half_period.max(1))).is_multiple_of(2);
                Some(if first { high } else { low })
            }
            Self::Scene(Pattern::Checkerboard { high, low, cell }) => {
                let cell = cell.max(1) as usize;
                Some(if (row / cell + col / cell).is_multiple_of(2) { high } else { low })
            }
            Self::Scene(Pattern::StaticUnknown {}) => None,
        }
    }

    /// The level, when it is one.
    #[must_use]
    pub fn level(self) -> Option<f64> {
        match self {
            Self::Level(level) => Some(level),
            Self::Scene(_) => None,
        }
    }

    /// The same light with every level times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Level(level) => Self::Level(level * factor),
            Self::Scene(Pattern::Square { high, low, half_period }) => {
                Self::Scene(Pattern::Square { high: high * factor, low: low * factor, half_period })
            }
            Self::Scene(Pattern::Checkerboard { high, low, cell }) => {
                Self::Scene(Pattern::Checkerboard { high: high * factor, low: low * factor, cell })
            }
            Self::Scene(Pattern::StaticUnknown {}) => self,
        }
    }

    fn check(self, file: &str) -> Result<()> {
        let (levels, length) = match self {
            Self::Level(level) => ([level, level], 1),
            Self::Scene(Pattern::Square { high, low, half_period }) => ([high, low], half_period),
            Self::Scene(Pattern::Checkerboard { high, low, cell }) => ([high, low], cell),
            Self::Scene(Pattern::StaticUnknown {}) => ([0.0, 0.0], 1),
        };
        if levels.iter().any(|l| !(0.0..=100.0).contains(l)) || length == 0 {
            return Err(Error::new(Kind::Config, format_args!("light of {file}"))
                .found(match self {
                    Self::Level(level) => level.to_string(),
                    Self::Scene(_) => {
                        format!("levels {} and {}, length {length}", levels[0], levels[1])
                    }
                })
                .expected("levels from 0 to 100 of the light that saturates, lengths above zero"));
        }
        Ok(())
    }
}

/// The light of a recording that nobody has told yet, as `spikelane record --template` writes it.
pub const UNTOLD: &str = "light = \"?\"";

/// A stream of the set.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Recording {
    /// Path relative to the set's file.
    pub file: String,
    /// What was in front of the camera.
    pub light: Light,
    /// Relative uncertainty of its light, when it differs from the set's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_uncertainty: Option<f64>,
    /// File layout, when it differs from the set's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
}

/// A map of per-pixel rates in place of a stream: `.npy`, f32 or f64, rows from the top.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RateMap {
    /// Path relative to the set's file.
    pub file: String,
    /// Uniform level of light; without one the brightest map sets the unit.
    pub light: f64,
    /// Relative uncertainty of its light, when it differs from the set's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_uncertainty: Option<f64>,
    /// Readouts that the rates come from, when known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts: Option<u32>,
}

/// The recordings of one camera.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RecordingSet {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Readouts per second.
    pub readout_hz: f64,
    /// Layout of the files; when absent that of the file's sidecar or array header, else `dat`. See [`Layout`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
    /// Relative uncertainty of the light levels, 0.01 when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_uncertainty: Option<f64>,
    /// The camera that was simulated, when no real one made these recordings: reports say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated: Option<String>,
    /// Streams.
    #[serde(default, rename = "recording")]
    pub recordings: Vec<Recording>,
    /// Rate maps.
    #[serde(default, rename = "rate_map", skip_serializing_if = "Vec::is_empty")]
    pub rate_maps: Vec<RateMap>,
    /// The folder that paths are relative to.
    #[serde(skip)]
    pub folder: PathBuf,
}

impl RecordingSet {
    /// Reads and checks a set's file.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be read, [`Kind::Config`] when it describes no set:
    /// unknown keys, impossible light, a level or a file given twice.
    pub fn open(path: &Path) -> Result<Self> {
        let text = inputs::read_text(path, "a set of recordings")?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Self::parse(&text, folder).map_err(|e| e.within(path.display()))
    }

    /// Reads and checks the text of a set's file.
    ///
    /// # Errors
    /// As [`RecordingSet::open`].
    pub fn parse(text: &str, folder: PathBuf) -> Result<Self> {
        if let Some(line) = text.lines().position(|l| l.trim() == UNTOLD) {
            return Err(Error::new(Kind::Config, format_args!("line {}", line + 1)).found(UNTOLD).expected(
                "the light of that recording: 0 with the cap on, else a share of what saturates, such as 0.3",
            ));
        }
        let mut set: Self = toml::from_str(text)
            .map_err(|e| Error::new(Kind::Config, "recording set").found(e.to_string().trim_end()))?;
        set.folder = folder;
        set.check()?;
        Ok(set)
    }

    /// The text of this set; [`RecordingSet::parse`] reads it back.
    ///
    /// # Errors
    /// Never, in practice: every value has a text.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::new(Kind::Config, "recording set").found(e))
    }

    /// Width and height.
    ///
    /// # Errors
    /// See [`Geometry::new`].
    pub fn geometry(&self) -> Result<Geometry> {
        Geometry::new(self.width, self.height)
    }

    /// The uniform levels, streams before maps, in the order of the file.
    pub fn levels(&self) -> impl Iterator<Item = (&str, f64)> {
        let streams = self.recordings.iter().filter_map(|r| Some((r.file.as_str(), r.light.level()?)));
        streams.chain(self.rate_maps.iter().map(|m| (m.file.as_str(), m.light)))
    }

    /// Opens the stream of `recording`.
    ///
    /// # Errors
    /// See [`Reader::open`].
    pub fn reader(&self, recording: &Recording) -> Result<Reader> {
        let name = recording.layout.as_ref().or(self.layout.as_ref());
        let layout = name.map(|n| Layout::parse(n)).transpose()?;
        Reader::open(&self.folder.join(&recording.file), layout, Some(self.geometry()?))
    }

    fn check(&self) -> Result<()> {
        self.geometry()?;
        if !(self.readout_hz.is_finite() && self.readout_hz > 0.0) {
            return Err(Error::new(Kind::Config, "readout_hz")
                .found(self.readout_hz)
                .expected("readouts per second, a positive number"));
        }
        for recording in &self.recordings {
            recording.light.check(&recording.file)?;
        }
        for map in &self.rate_maps {
            Light::Level(map.light).check(&map.file)?;
        }
        self.check_uncertainties()?;
        if self.recordings.is_empty() && self.rate_maps.is_empty() {
            return Err(Error::new(Kind::Config, "recording set")
                .found("no recordings")
                .expected("[[recording]] or [[rate_map]] entries"));
        }
        self.check_repeats()
    }

    fn check_uncertainties(&self) -> Result<()> {
        let own = self.recordings.iter().filter_map(|r| r.light_uncertainty);
        let maps = self.rate_maps.iter().filter_map(|m| m.light_uncertainty);
        match own.chain(maps).chain(self.light_uncertainty).find(|u| !(*u > 0.0 && *u < 1.0)) {
            None => Ok(()),
            Some(u) => Err(Error::new(Kind::Config, "light_uncertainty")
                .found(u)
                .expected("a relative standard deviation above 0 and below 1, such as 0.01")),
        }
    }

    fn check_repeats(&self) -> Result<()> {
        let files = self.recordings.iter().map(|r| &r.file).chain(self.rate_maps.iter().map(|m| &m.file));
        let mut files: Vec<&String> = files.collect();
        files.sort_unstable();
        if let Some(twice) = files.windows(2).find(|w| w[0] == w[1]) {
            return Err(Error::new(Kind::Config, "recording set")
                .found(format_args!("{} twice", twice[0]))
                .expected("every file once"));
        }
        let mut levels: Vec<(&str, f64)> = self.levels().collect();
        levels.sort_by(|a, b| a.1.total_cmp(&b.1));
        if let Some(twice) = levels.windows(2).find(|w| w[0].1 == w[1].1) {
            return Err(Error::new(Kind::Config, "recording set")
                .found(format_args!("light {} for {} and for {}", twice[0].1, twice[0].0, twice[1].0))
                .expected("every level once")
                .remedy("give a repeat the light it really had, or a set of its own"));
        }
        Ok(())
    }
}
