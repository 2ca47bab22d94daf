//! Built-in camera models with their sources, and camera files: TOML with units.

mod bytes;
mod distribution;
mod file;
mod light;
mod maps;
mod mosaic;
mod write;

pub use bytes::{fingerprint, from_bytes, to_bytes};
pub use distribution::{CameraDistribution, ParamRange};
pub use file::from_toml;
pub use write::{CameraFiles, to_toml};

use std::path::Path;

use crate::effects::{Camera, Catalog};
use crate::error::{Result, error};
use crate::inputs;
use crate::sensor::Sensor;

/// A built-in model: its name and the text of its file.
///
/// # Examples
/// ```
/// use spikelane::presets;
/// for preset in presets::ALL {
///     let camera = presets::from_toml(preset.text, None)?;
///     assert_eq!(camera.name, preset.name);
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// The camera file, as `spikelane preset show` prints it.
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

/// The geometry and readout rate of a known camera.
///
/// # Examples
/// ```
/// use spikelane::{Sensor, presets};
/// let fast = presets::SENSOR_FORMATS.iter().find(|format| format.readout_hz > 30_000.0).expect("a fast camera");
/// let (width, height) = fast.size;
/// assert_eq!(fast.name, "400x250-40k");
/// assert_eq!(Sensor::new(width, height, fast.readout_hz)?.period_s(), 25e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SensorFormat {
    /// Name on the command line.
    pub name: &'static str,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Readouts per second.
    pub readout_hz: f64,
}

/// Formats of known cameras.
pub const SENSOR_FORMATS: &[SensorFormat] = &[
    SensorFormat { name: "400x250-20k", size: (400, 250), readout_hz: 20_000.0 },
    SensorFormat { name: "400x250-40k", size: (400, 250), readout_hz: 40_000.0 },
    SensorFormat { name: "1000x1000-20k", size: (1000, 1000), readout_hz: 20_000.0 },
];

/// Returns a sensor of 400x250 pixels at 20 kHz.
///
/// # Errors
/// The numbers are valid, so no error occurs.
pub(crate) fn default_sensor() -> Result<Sensor> {
    Sensor::new(SENSOR_FORMATS[0].size.0, SENSOR_FORMATS[0].size.1, SENSOR_FORMATS[0].readout_hz)
}

/// Returns the built-in model called `name`, for a sensor of 400x250 pixels at 20 kHz.
///
/// # Examples
/// ```
/// let camera = spikelane::presets::builtin("physical")?;
/// assert_eq!(camera.sensor.geometry.pixels(), 100_000);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if there is no such model. The error lists all models.
pub fn builtin(name: &str) -> Result<Camera> {
    let preset = ALL.iter().find(|p| p.name == name).ok_or_else(|| {
        let names: Vec<_> = ALL.iter().map(|p| p.name).collect();
        error!(Config, "preset"; found "\"{name}\""; expected "one of {}, or a .toml file", names.join(", "))
            .with_suggestion(name, names)
    })?;
    from_toml(preset.text, None).map_err(|e| e.with_context(format_args!("preset {name}")))
}

/// Returns the built-in model with this name, or reads the camera file at this path. The camera may only have effects
/// of this library.
///
/// # Examples
/// ```
/// let camera = spikelane::presets::load("scsim-paper")?;
/// assert!(camera.effect("thermal_noise").is_some());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if there is neither a model nor a file with this name, or if the file does not describe
/// a valid camera.
pub fn load(name_or_path: &str) -> Result<Camera> {
    Catalog::new().load(name_or_path)
}

impl Catalog {
    /// Returns the built-in model with this name, or reads the camera file at this path. The camera may have any effect
    /// of this catalog.
    ///
    /// # Errors
    /// Returns the errors of [`load`].
    pub fn load(&self, name_or_path: &str) -> Result<Camera> {
        let path = Path::new(name_or_path);
        if !name_or_path.ends_with(".toml") && !path.is_file() {
            return builtin(name_or_path);
        }
        self.load_camera(path)
    }

    /// Reads the camera file at `path`. Its maps are in the folder of this file.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Io`](crate::ErrorKind::Io) if the file cannot be read or is not a regular file. Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if
    /// the file is larger than 16 MiB or does not describe a valid camera.
    pub fn load_camera(&self, path: &Path) -> Result<Camera> {
        let text = inputs::read_text(path, "a camera file")?;
        let folder = path.parent().unwrap_or(Path::new("."));
        self.camera_from_toml(&text, Some(folder)).map_err(|e| e.with_context(path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn every_preset_has_a_model_and_reads_back_from_its_own_text() {
        for preset in ALL {
            let camera = builtin(preset.name).unwrap();
            assert_eq!(camera.name, preset.name);
            let again = from_toml(&to_toml(&camera).unwrap().text, None).unwrap();
            assert_eq!(again, camera, "{}", preset.name);
            camera.model(crate::draws::Seeds::default()).unwrap();
        }
    }

    #[test]
    fn a_written_light_table_reads_back() {
        let texts = [
            "[light]\ntransfer = 2.2\nfull_scale = \"peak\"",
            "[light]\ntransfer = \"srgb\"\ngray_codes = true\nluminance = [0.25, 0.5, 0.25]",
            "[light]\ntransfer = \"linear\"\nfull_scale = 256",
            "",
        ];
        for text in texts {
            let camera = from_toml(text, None).unwrap();
            let again = from_toml(&to_toml(&camera).unwrap().text, None).unwrap();
            assert_eq!(again.front_end, camera.front_end, "{text}");
        }
    }

    #[test]
    fn a_written_mosaic_reads_back() {
        let text = "
            [sensor.mosaic]
            pattern = \"quad-RGBW\"
            response = { R = [0.8, 0.15, 0.05], W = [0.3, 0.4, 0.3] }
            gain = { W = 2.5, B = 0.7 }
            infrared = { R = 0.1 }
            ";
        let camera = from_toml(text, None).unwrap();
        let mosaic = camera.mosaic.clone().unwrap();
        let white: Vec<f64> = mosaic.channels().iter().map(|c| (c.white() * 1e9).round() / 1e9).collect();
        assert_eq!((mosaic.to_string().as_str(), &white[..]), ("quad-RGBW", &[1.1, 1.0, 0.7, 2.5][..]));
        assert_eq!(from_toml(&to_toml(&camera).unwrap().text, None).unwrap(), camera);
        assert_eq!(camera.clean_twin().mosaic, camera.mosaic);
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
            "[light]\ngray_codes = 1",
            "[light]\nfull_scale = 0",
            "[light]\nfull_scale = inf",
            "[light]\nfull_scale = \"half\"",
            "[light]\ngamma = 2.2",
            "[sensor.mosaic]",
            "[sensor.mosaic]\npattern = \"RGB\"",
            "[sensor.mosaic]\npattern = \"CYYM\"",
            "[sensor.mosaic]\npattern = \"RGGB\"\ngain = { red = 0.5 }",
            "[sensor.mosaic]\npattern = \"RGGB\"\ngain = { W = 0.5 }",
            "[sensor.mosaic]\npattern = \"RGGB\"\ninfrared = { R = -0.5 }",
            "[sensor.mosaic]\npattern = \"RGGB\"\nresponse = { R = [1, 0] }",
            "[sensor.mosaic]\npattern = \"RGGB\"\nfilter = 1",
            "not toml",
        ];
        for text in wrong {
            let error = from_toml(text, None).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Config, "{text}: {error}");
        }
    }
}
