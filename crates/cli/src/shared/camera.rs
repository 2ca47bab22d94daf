//! Flags that describe a camera.

use spikelane::{Camera, Error, Geometry, Kind, Result, effects, presets};
use spikelane_io::light::Rate;

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct CameraArgs {
    /// Camera: the name of a preset ('spikelane preset list'), or a camera file (.toml)
    #[arg(long, value_name = "NAME|FILE", default_value = "physical", help_heading = "Camera")]
    pub camera: String,
    #[command(flatten)]
    pub changes: Changes,
}

#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct Changes {
    /// Size and readout rate of a known camera: 400x250-20k, 400x250-40k, 1000x1000-20k
    #[arg(hide_short_help = true, long, value_name = "NAME", help_heading = "Camera")]
    pub camera_format: Option<String>,
    /// Width in pixels [default: the camera's, 400]
    #[arg(long, value_name = "PIXELS", help_heading = "Camera")]
    pub width: Option<u32>,
    /// Height in pixels [default: the camera's, 250]
    #[arg(long, value_name = "PIXELS", help_heading = "Camera")]
    pub height: Option<u32>,
    /// Readouts per second [default: the camera's, 20000]
    #[arg(hide_short_help = true, long, value_name = "HZ", help_heading = "Camera")]
    pub readout_hz: Option<Rate>,
    /// Electrons per readout at full-scale light [default: one nominal threshold, unless the camera says]
    #[arg(hide_short_help = true, long, value_name = "ELECTRONS", help_heading = "Camera")]
    pub exposure: Option<f64>,
    /// Set a parameter of an effect, such as prnu.sigma=0.03; may be repeated. The effect's other parameters stay as the
    /// camera has them; with '--without NAME' they start from neutral
    #[arg(hide_short_help = true, long, value_name = "NAME.KEY=VALUE", help_heading = "Camera")]
    pub effect: Vec<String>,
    /// Leave an effect out; may be repeated
    #[arg(hide_short_help = true, long, value_name = "NAME", help_heading = "Camera")]
    pub without: Vec<String>,
}

impl CameraArgs {
    /// The camera that was named without a flag, or else with it.
    pub(crate) fn named(&self, name: Option<&str>) -> Result<Camera> {
        self.changes.apply(presets::load(name.unwrap_or(&self.camera))?)
    }

    pub(crate) fn camera(&self) -> Result<Camera> {
        self.changes.apply(presets::load(&self.camera)?)
    }
}

impl Changes {
    /// Whether nothing is changed.
    pub(crate) fn are_none(&self) -> bool {
        let sized = self.camera_format.is_some() || self.width.is_some() || self.height.is_some();
        let timed = self.readout_hz.is_some() || self.exposure.is_some();
        !sized && !timed && self.effect.is_empty() && self.without.is_empty()
    }

    pub(crate) fn apply(&self, mut camera: Camera) -> Result<Camera> {
        let sensor = &mut camera.sensor;
        let (mut width, mut height) = (sensor.geometry.width() as u32, sensor.geometry.height() as u32);
        if let Some(name) = &self.camera_format {
            let known = presets::FORMATS.iter().find(|f| f.name == name).ok_or_else(|| unknown(name))?;
            ((width, height), sensor.readout_hz) = (known.size, known.readout_hz);
        }
        sensor.geometry = Geometry::new(self.width.unwrap_or(width), self.height.unwrap_or(height))?;
        if let Some(rate) = self.readout_hz {
            sensor.readout_hz = rate.hz();
        }
        for name in &self.without {
            effects::find(name)?;
            camera = camera.without(name);
        }
        for text in &self.effect {
            camera = set_effect(camera, text)?;
        }
        if let Some(electrons) = self.exposure {
            camera.sensor.thresholds_at_full_scale = electrons / camera.operating(0.0).electrons;
            camera.sensor = camera.sensor.validated().map_err(|_| {
                Error::new(Kind::Usage, "--exposure").found(electrons).expected("electrons, zero or more")
            })?;
        }
        Ok(camera)
    }
}

fn unknown(name: &str) -> Error {
    let names: Vec<_> = presets::FORMATS.iter().map(|f| f.name).collect();
    Error::new(Kind::Usage, "--camera-format")
        .found(format_args!("`{name}`"))
        .expected(names.join(", "))
        .remedy("for any other camera give --width, --height and --readout-hz")
        .or_nearest(name, names)
}

fn set_effect(camera: Camera, text: &str) -> Result<Camera> {
    let parts = text.split_once('=').and_then(|(at, value)| Some((at.split_once('.')?, value)));
    let Some(((name, key), value)) = parts else {
        return Err(Error::new(Kind::Usage, "--effect")
            .found(format_args!("`{text}`"))
            .expected("NAME.KEY=VALUE, such as prnu.sigma=0.03 or 'dark_current.mean=0.5 pA'")
            .remedy("'spikelane effects' lists names, keys and units"));
    };
    let definition = effects::find(name)?;
    let effect = camera.effect(name).cloned().unwrap_or_else(|| definition.neutral());
    Ok(camera.with(effect.with_text(key, value).map_err(|e| e.within("--effect"))?))
}

/// A rate that was stored as a float, as the exact fraction that timelines need.
pub(crate) fn exact_rate(hz: f64) -> Result<Rate> {
    format!("{hz}").parse::<Rate>().map_err(|_| {
        Error::new(Kind::Config, "readout rate")
            .found(format_args!("{hz} Hz"))
            .expected("a rate with at most six decimal places")
    })
}
