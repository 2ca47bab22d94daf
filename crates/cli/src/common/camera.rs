//! Flags that select and change a camera.

use spikelane::{Camera, Error, ErrorKind, Geometry, Result, effects, presets};
use spikelane_io::light::Rate;

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct CameraArgs {
    /// Use a preset or camera file
    ///
    /// 'spikelane preset list' lists the presets. 'spikelane preset show' prints a camera file.
    #[arg(long, value_name = "NAME|FILE", default_value = "physical", help_heading = "Camera")]
    pub camera: String,
    #[command(flatten)]
    pub changes: CameraChanges,
}

#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct CameraChanges {
    /// Set the image size and the readout rate: 400x250-20k, 400x250-40k or 1000x1000-20k
    ///
    /// By default, those of the camera are used.
    #[arg(hide_short_help = true, long, value_name = "NAME", help_heading = "Camera")]
    pub camera_format: Option<String>,
    /// Set width in pixels [default: from the camera]
    #[arg(long, value_name = "PIXELS", help_heading = "Camera")]
    pub width: Option<u32>,
    /// Set height in pixels [default: from the camera]
    #[arg(long, value_name = "PIXELS", help_heading = "Camera")]
    pub height: Option<u32>,
    /// Set the readout rate in Hz [default: from the camera]
    #[arg(hide_short_help = true, long, value_name = "HZ", help_heading = "Camera")]
    pub readout_hz: Option<Rate>,
    /// Set the electrons per pixel and readout in full-scale light [default: from the camera]
    ///
    /// If the camera file states no exposure, full-scale light adds one nominal threshold per readout.
    #[arg(hide_short_help = true, long, value_name = "ELECTRONS", help_heading = "Camera")]
    pub exposure: Option<f64>,
    /// Set the color filters, such as RGGB, BGGR or quad-RGGB, or none [default: from the camera]
    ///
    /// The letters are the filters of the first rows and columns, row by row. The table [sensor.mosaic] of a camera file
    /// also sets the spectral response.
    #[arg(hide_short_help = true, long, value_name = "PATTERN", help_heading = "Camera")]
    pub mosaic: Option<String>,
    /// Set a parameter of an effect, such as prnu.sigma=0.03 (repeatable)
    ///
    /// Other parameters keep the value of the camera, or have their neutral value if --disable-effect disables the
    /// effect. 'spikelane effects' lists the names, keys and units.
    #[arg(hide_short_help = true, long, value_name = "NAME.KEY=VALUE", help_heading = "Camera")]
    pub effect: Vec<String>,
    /// Disable this effect of the camera, such as leak (repeatable)
    #[arg(hide_short_help = true, long, value_name = "NAME", help_heading = "Camera")]
    pub disable_effect: Vec<String>,
}

impl CameraArgs {
    /// Loads the camera `name`, or the camera of `--camera` if `name` is `None`. Applies the flags that change the
    /// camera, such as `--width`.
    pub(crate) fn camera_or(&self, name: Option<&str>) -> Result<Camera> {
        self.changes.apply(presets::load(name.unwrap_or(&self.camera))?)
    }

    pub(crate) fn camera(&self) -> Result<Camera> {
        self.changes.apply(presets::load(&self.camera)?)
    }
}

impl CameraChanges {
    /// Whether no flag that changes the camera is set.
    pub(crate) fn is_empty(&self) -> bool {
        let sized = self.camera_format.is_some() || self.width.is_some() || self.height.is_some();
        let timed = self.readout_hz.is_some() || self.exposure.is_some();
        !sized && !timed && self.mosaic.is_none() && self.effect.is_empty() && self.disable_effect.is_empty()
    }

    pub(crate) fn apply(&self, mut camera: Camera) -> Result<Camera> {
        let sensor = &mut camera.sensor;
        let (mut width, mut height) = (sensor.geometry.width() as u32, sensor.geometry.height() as u32);
        if let Some(name) = &self.camera_format {
            let known = presets::SENSOR_FORMATS
                .iter()
                .find(|f| f.name == name)
                .ok_or_else(|| unknown_effect_error(name))?;
            ((width, height), sensor.readout_hz) = (known.size, known.readout_hz);
        }
        sensor.geometry = Geometry::new(self.width.unwrap_or(width), self.height.unwrap_or(height))?;
        if let Some(rate) = self.readout_hz {
            sensor.readout_hz = rate.hz();
        }
        if let Some(text) = &self.mosaic {
            camera.mosaic = super::flags::parse_mosaic(text)?;
        }
        for name in &self.disable_effect {
            effects::find(name)?;
            camera = camera.without_effect(name);
        }
        for text in &self.effect {
            camera = set_effect(camera, text)?;
        }
        if let Some(electrons) = self.exposure {
            camera.sensor.thresholds_at_full_scale = electrons / camera.operating_point(0.0).electrons;
            camera.sensor = camera.sensor.validate().map_err(|_| {
                Error::new(ErrorKind::Usage, "--exposure")
                    .found(electrons)
                    .expected("electrons, zero or more")
            })?;
        }
        Ok(camera)
    }
}

fn unknown_effect_error(name: &str) -> Error {
    let names: Vec<_> = presets::SENSOR_FORMATS.iter().map(|f| f.name).collect();
    Error::new(ErrorKind::Usage, "--camera-format")
        .found(format_args!("`{name}`"))
        .expected(names.join(", "))
        .remedy("for any other camera set --width, --height and --readout-hz")
        .with_suggestion(name, names)
}

fn set_effect(camera: Camera, text: &str) -> Result<Camera> {
    let parts = text.split_once('=').and_then(|(at, value)| Some((at.split_once('.')?, value)));
    let Some(((name, key), value)) = parts else {
        return Err(Error::new(ErrorKind::Usage, "--effect")
            .found(format_args!("`{text}`"))
            .expected("NAME.KEY=VALUE, such as prnu.sigma=0.03 or 'dark_current.mean=0.5 pA'")
            .remedy("'spikelane effects' lists names, keys and units"));
    };
    let definition = effects::find(name)?;
    let effect = camera.effect(name).cloned().unwrap_or_else(|| definition.neutral());
    Ok(camera.with_effect(effect.with_text(key, value).map_err(|e| e.with_context("--effect"))?))
}

/// Converts a readout rate that is stored as a float to the exact fraction that timelines need.
pub(crate) fn exact_rate(hz: f64) -> Result<Rate> {
    format!("{hz}").parse::<Rate>().map_err(|_| {
        Error::new(ErrorKind::Config, "readout rate")
            .found(format_args!("{hz} Hz"))
            .expected("a rate with at most six decimal places")
    })
}
