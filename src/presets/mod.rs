//! Cited cameras and models, and camera files: TOML with units.

mod bytes;
mod distribution;
mod file;
mod light;
mod maps;
mod write;

pub use bytes::{from_bytes, from_bytes_with, key, to_bytes};
pub use distribution::Distribution;
pub use distribution::Range;
pub use file::{parse, parse_with};
pub use write::{Saved, to_toml};

use std::path::Path;

use crate::effects::{Camera, Catalogue};
use crate::error::{Error, Kind, Result};
use crate::inputs;
use crate::sensor::Sensor;

/// A built-in model: its name and the text of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// The file, as `spikelane preset show` prints it.
    pub text: &'static str,
}

macro_rules! presets {
    ($($name:literal),* $(,)?) => {
        /// Every built-in model.
        pub const ALL: &[Preset] = &[
            $(Preset { name: $name, text: include_str!(concat!("models/", $name, ".toml")) }),*
        ];
    };
}

presets![
    "ideal",
    "scsim-paper",
    "scsim-code",
    "physical",
    "vidar-measured",
    "vidar-lowlight",
    "spcs",
    "neuspike",
    "spikingsim",
    "spikecv",
    "spikecv-image",
    "spike-zoo",
];

/// A known camera's geometry and readout rate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Format {
    /// Name on the command line.
    pub name: &'static str,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Readouts per second.
    pub readout_hz: f64,
}

/// Known cameras.
pub const FORMATS: &[Format] = &[
    Format { name: "400x250-20k", size: (400, 250), readout_hz: 20_000.0 },
    Format { name: "400x250-40k", size: (400, 250), readout_hz: 40_000.0 },
    Format { name: "1000x1000-20k", size: (1000, 1000), readout_hz: 20_000.0 },
];

/// The 400x250 camera at 20 kHz.
///
/// # Errors
/// Never, in practice: the numbers are valid.
pub(crate) fn default_sensor() -> Result<Sensor> {
    Sensor::new(FORMATS[0].size.0, FORMATS[0].size.1, FORMATS[0].readout_hz)
}

/// The built-in model called `name`, at 400x250 and 20 kHz.
///
/// # Examples
/// ```
/// let camera = spikelane::presets::builtin("physical")?;
/// assert_eq!(camera.sensor.geometry.pixels(), 100_000);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// When there is none; the error lists those there are.
pub fn builtin(name: &str) -> Result<Camera> {
    let preset = ALL.iter().find(|p| p.name == name).ok_or_else(|| {
        let names: Vec<_> = ALL.iter().map(|p| p.name).collect();
        Error::new(Kind::Config, "preset")
            .found(format_args!("\"{name}\""))
            .expected(format_args!("one of {}, or a .toml file", names.join(", ")))
            .or_nearest(name, names)
    })?;
    parse(preset.text, None).map_err(|e| e.within(format_args!("preset {name}")))
}

/// A built-in model by name, or a camera file by path.
///
/// # Errors
/// When there is neither, or the file describes no camera.
pub fn load(name_or_path: &str) -> Result<Camera> {
    load_with(name_or_path, &Catalogue::new())
}

/// The same for a camera file that may have any of `effects`.
///
/// # Errors
/// As [`load`].
pub fn load_with(name_or_path: &str, effects: &Catalogue) -> Result<Camera> {
    let path = Path::new(name_or_path);
    if !name_or_path.ends_with(".toml") && !path.is_file() {
        return builtin(name_or_path);
    }
    effects.open(path)
}

impl Catalogue {
    /// Reads the camera file at `path`, which may have any of these effects, with the maps beside it.
    ///
    /// # Errors
    /// When it cannot be read, is no regular file or larger than 16 MiB, or describes no camera.
    pub fn open(&self, path: &Path) -> Result<Camera> {
        let text = inputs::read_text(path, "a camera file")?;
        let folder = path.parent().unwrap_or(Path::new("."));
        parse_with(&text, Some(folder), self).map_err(|e| e.within(path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_has_a_model_and_reads_back_from_its_own_text() {
        for preset in ALL {
            let camera = builtin(preset.name).unwrap();
            assert_eq!(camera.name, preset.name);
            let again = parse(&to_toml(&camera).unwrap().text, None).unwrap();
            assert_eq!(again, camera, "{}", preset.name);
            camera.model(crate::draws::Seeds::default()).unwrap();
        }
    }

    #[test]
    fn a_light_table_reads_back_from_what_is_written_of_it() {
        let texts = [
            "[light]\ntransfer = 2.2\nfull_scale = \"peak\"",
            "[light]\ntransfer = \"srgb\"\ngrey_codes = true\nluminance = [0.25, 0.5, 0.25]",
            "[light]\ntransfer = \"linear\"\nfull_scale = 256",
            "",
        ];
        for text in texts {
            let camera = parse(text, None).unwrap();
            let again = parse(&to_toml(&camera).unwrap().text, None).unwrap();
            assert_eq!(again.light, camera.light, "{text}");
        }
    }

    #[test]
    fn unknown_keys_wrong_units_and_impossible_values_are_refused() {
        let wrong = [
            "nmae = \"x\"",
            "[sensor]\ncapacitance = 4.348",
            "[sensor]\ncapacitance = \"4.348 V\"",
            "[sensor]\nwidth = 0",
            "[sensor]\nwidth = 12.5",
            "[effects.prnu]\nsigma = \"2 V\"",
            "[effects.prnu]\nsigmma = 0.02",
            "[effects.prnu]\nsigma = -1",
            "[effects.prnoo]\nsigma = 0.02",
            "[effects.thermal_noise]\nredraw = \"sometimes\"",
            "[effects.bias_voltage]\nsigma = 0.05",
            "[maps]\ngain = \"x.npy\"",
            "[light]\ntransfer = \"gamma\"",
            "[light]\ntransfer = 20",
            "[light]\nluminance = [0.3, 0.6]",
            "[light]\nluminance = [0.3, 0.6, 0.2]",
            "[light]\nluminance = [0.6, 0.6, -0.2]",
            "[light]\nluminance = [nan, 0.5, 0.5]",
            "[light]\ngrey_codes = 1",
            "[light]\nfull_scale = 0",
            "[light]\nfull_scale = inf",
            "[light]\nfull_scale = \"half\"",
            "[light]\ngamma = 2.2",
            "not toml",
        ];
        for text in wrong {
            let error = parse(text, None).unwrap_err();
            assert_eq!(error.kind(), Kind::Config, "{text}: {error}");
        }
    }
}
