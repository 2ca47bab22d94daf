//! Flags and values of flags, with the same names and defaults in every command.

use std::fmt::Display;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use spikelane::sensor::Mosaic;
use spikelane::unstable::Count;
use spikelane::unstable::draws::Seeds;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::formats::Crop;
use spikelane_scene::Lighting;

use super::console::Console;
use super::stream::sidecar_beside;

/// Seeds of the temporal noise and of the camera's fixed pattern.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct SeedArgs {
    /// Set the seed of the temporal noise
    ///
    /// The seed also selects the start charge of every pixel.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub seed: u64,
    #[command(flatten)]
    camera: CameraSeed,
}

/// Seed of the camera's fixed pattern.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct CameraSeed {
    /// Set the seed of the fixed pattern
    ///
    /// The seed selects one individual camera of this kind.
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub camera_seed: u64,
}

/// Seed of the scene.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct SceneSeed {
    /// Set the seed of the scene
    ///
    /// The seed selects the city, the traffic and, without --lighting, the lighting.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub scene_seed: u64,
}

impl SeedArgs {
    pub(crate) const fn camera_seed(self) -> u64 {
        self.camera.camera_seed
    }

    pub(crate) const fn seeds(self) -> Seeds {
        Seeds { camera: self.camera.camera_seed, shot: self.seed, sequence: 0 }
    }
}

const RANDOM: &str = "random";

/// The lighting of a drawn scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightingArg {
    /// The scene seed selects the lighting.
    Random,
    /// The same lighting for every seed.
    Fixed(Lighting),
}

impl LightingArg {
    /// Returns the parser of the flag.
    pub(crate) fn parser() -> impl TypedValueParser<Value = Self> {
        let names = Lighting::ALL.map(Lighting::name).into_iter().chain([RANDOM]);
        PossibleValuesParser::new(names)
            .map(|name| Lighting::from_name(&name).map_or(Self::Random, Self::Fixed))
    }

    /// Returns the lighting, or `None` if the scene seed selects it.
    pub(crate) const fn fixed(self) -> Option<Lighting> {
        match self {
            Self::Random => None,
            Self::Fixed(lighting) => Some(lighting),
        }
    }
}

#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct ThreadArgs {
    /// Set the number of threads [default and maximum: one per CPU]
    ///
    /// The result does not depend on the number of threads.
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

impl ThreadArgs {
    /// Returns the number of threads to use. Prints a message if it is smaller than the number that the user requested.
    pub(crate) fn thread_count(self, out: &Console) -> usize {
        let cpus = std::thread::available_parallelism().map_or(1, usize::from);
        let requested = self.threads.map_or(cpus, usize::from);
        if requested > cpus {
            out.print_message(format_args!(
                "note: the program uses {} instead of {requested}, because this machine has {}",
                Count(cpus, "thread"),
                Count(cpus, "CPU"),
            ));
        }
        requested.min(cpus)
    }
}

/// A range of readouts: `A..B`, `A..` or `..B`. Readout B is not included.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReadoutRange {
    first: usize,
    end: Option<usize>,
}

impl ReadoutRange {
    pub(crate) fn resolve(self, readouts: usize) -> Range<usize> {
        self.first..self.end.unwrap_or(readouts)
    }
}

impl FromStr for ReadoutRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::new(ErrorKind::Usage, "readouts")
                .found(format_args!("`{text}`"))
                .expected("A..B, A.. or ..B with A less than B, such as 0..1000")
        };
        let (first, end) = text.split_once("..").ok_or_else(bad)?;
        let number = |s: &str| s.parse::<usize>().map_err(|_| bad());
        let first = if first.is_empty() { 0 } else { number(first)? };
        let end = if end.is_empty() { None } else { Some(number(end)?) };
        if end.is_some_and(|end| end <= first) {
            return Err(bad());
        }
        Ok(Self { first, end })
    }
}

/// A rectangle `x,y,width,height` in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CropArg(pub Crop);

impl FromStr for CropArg {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let numbers: Result<Vec<usize>, _> = text.split(',').map(|s| s.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[col, row, width, height]) => Ok(Self(Crop { row, col, width, height })),
            _ => Err(Error::new(ErrorKind::Usage, "crop")
                .found(format_args!("`{text}`"))
                .expected("x,y,width,height in pixels, such as 100,50,64,64")),
        }
    }
}

/// The value of `--mosaic` for a camera without color filters.
const NO_MOSAIC: &str = "none";

/// Parses the value of `--mosaic`. The value `none` is `None`.
pub(crate) fn parse_mosaic(text: &str) -> Result<Option<Mosaic>> {
    if text == NO_MOSAIC {
        return Ok(None);
    }
    let wrong = |e: Error| {
        Error::new(ErrorKind::Usage, "--mosaic")
            .found(e)
            .expected("a pattern such as RGGB or quad-RGGB, or none")
    };
    text.parse().map(Some).map_err(wrong)
}

/// Returns the note about a stream with undeclared color filters. `patterns` are the two possible Bayer patterns.
pub(crate) fn detection_note(stream: impl Display, patterns: &[Mosaic; 2], effect: &str) -> String {
    let [first, second] = patterns;
    format!(
        "note: {stream}: rows and columns alternate as in a color camera with the pattern {first} or {second}; {effect}; to name the pattern, set --mosaic"
    )
}

/// The color filters of the camera that recorded a stream.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct StreamMosaicArgs {
    /// Set the color filters of the camera, such as RGGB, or none [default: from the sidecar]
    ///
    /// The letters are the filters of the first rows and columns, row by row. quad-RGGB has blocks of 2x2 pixels, and
    /// RGBG/GWGW has one part per row.
    #[arg(hide_short_help = true, long, value_name = "PATTERN", help_heading = "Stream")]
    pub mosaic: Option<String>,
}

impl StreamMosaicArgs {
    /// Returns the mosaic of the stream at `path`: from the flag, else from the sidecar.
    pub(crate) fn of_stream(&self, path: &Path) -> Result<Option<Mosaic>> {
        match &self.mosaic {
            Some(text) => parse_mosaic(text),
            None => sidecar_beside(path)?.and_then(|(_, s)| s.mosaic).map(|facts| facts.mosaic()).transpose(),
        }
    }
}
