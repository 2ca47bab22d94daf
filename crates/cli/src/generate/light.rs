//! Flags that describe the light. The source and the timeline of the light are created from them.

use std::path::PathBuf;

use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use spikelane::{Camera, Error, ErrorKind, Result};
use spikelane_io::light::open;
use spikelane_io::light::{
    DEFAULT_READOUTS_PER_FRAME, FrameTiming, InputOptions, Interpolation, Rate, ResizeMode, Source, Timeline,
    Transfer,
};
use spikelane_io::simulate::LightFacts;
use spikelane_scene::Lighting;

use crate::common::camera::exact_rate;
use crate::common::console::recorded_path;
use crate::common::progress::stop_flag;

/// Built-in light, which needs no input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BuiltinLight {
    /// A random driving scene
    Drive,
    /// The moving test chart
    Chart,
    /// Random flat objects over a background
    Objects,
}

#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct LightArgs {
    /// Read light from this file or folder [default: draw a driving scene]
    ///
    /// Accepts a folder of images, an image, a video, .npy, .npz or .y4m. '-' reads y4m or npy from standard input.
    pub input: Option<PathBuf>,
    /// Use built-in light: drive, chart or objects [default: drive]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "LIGHT",
        conflicts_with = "input",
        help_heading = "Light"
    )]
    pub builtin_light: Option<BuiltinLight>,
    /// Set the seed of the driving scene or of the objects [default: 0]
    #[arg(hide_short_help = true, long, value_name = "N", conflicts_with = "input", help_heading = "Light")]
    pub scene_seed: Option<u64>,
    /// Set the lighting, such as dusk [default: noon]
    ///
    /// With --scene-seed the default is random.
    #[arg(hide_short_help = true, long, conflicts_with = "input", help_heading = "Light",
          value_parser = PossibleValuesParser::new(Lighting::ALL.map(Lighting::name)))]
    pub lighting: Option<String>,
    /// Stop after N readouts [default: at the end]
    ///
    /// Defaults of built-in light: 500 for drive, 4000 for chart and objects. A single image requires this flag
    /// or --readouts-per-frame.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), help_heading = "Light")]
    pub readouts: Option<u64>,
    /// Show each frame for N readouts [default: 20]
    ///
    /// By default, the times or the rate of the input determine it. Without them it is 20 readouts, one
    /// millisecond at 20 kHz.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..),
          conflicts_with = "input_fps", help_heading = "Light")]
    pub readouts_per_frame: Option<u64>,
    /// Set the frames per second of the input [default: from the input]
    ///
    /// Examples: 25, 30000/1001. Built-in light is drawn at 2500 (drive) or 1000.
    #[arg(hide_short_help = true, long, value_name = "HZ", help_heading = "Light")]
    pub input_fps: Option<Rate>,
    /// Interpolate frames: hold, linear or flow [default: linear]
    ///
    /// flow follows an estimated motion. hold changes all pixels at once. The default of built-in light is hold.
    #[arg(long, value_name = "MODE", help_heading = "Light")]
    pub interpolation: Option<Interpolation>,
    /// Convert codes to light: linear, srgb, pq, hlg or an exponent such as 2.2
    ///
    /// Default: [light] of the camera file, else what the input states, else srgb for images and video, and linear for
    /// arrays and float images.
    #[arg(hide_short_help = true, long, value_name = "TRANSFER", help_heading = "Light")]
    pub transfer: Option<Transfer>,
    /// Set the camera's size to the input's size
    #[arg(hide_short_help = true, long, conflicts_with_all = ["width", "height"], requires = "input",
          help_heading = "Light")]
    pub size_from_input: bool,
    /// Fit frames to the camera's size: cover, stretch or crop
    #[arg(
        hide_short_help = true,
        long,
        value_name = "MODE",
        default_value = "cover",
        help_heading = "Light"
    )]
    pub resize_mode: ResizeMode,
    /// Set the code or value of full scale [default: the largest code, or 1.0]
    ///
    /// Example: 4095 for 12-bit codes in 16-bit pictures.
    #[arg(hide_short_help = true, long, value_name = "VALUE", help_heading = "Light")]
    pub full_scale: Option<f64>,
    /// Move over an image, such as pan=120,0:zoom=1.2:rotate=30
    ///
    /// pan is in pixels per second, zoom a factor per second, and rotate in degrees per second.
    #[arg(hide_short_help = true, long, value_name = "MOTION", help_heading = "Light")]
    pub motion: Option<String>,
    /// Clip light above this many full scales [default: 1, or 2 for floats]
    #[arg(hide_short_help = true, long, value_name = "FULL_SCALES", help_heading = "Light")]
    pub max_light: Option<f64>,
}

/// Light that is ready for the simulation.
pub(crate) struct RunLight {
    pub source: Box<dyn Source>,
    pub timeline: Timeline,
    pub readouts: Option<u64>,
    pub(super) frame_rate: Option<Rate>,
    /// Warnings to print before the simulation.
    pub warnings: Vec<String>,
}

impl LightArgs {
    /// Returns the file stem for the outputs of this light. It is used if the user specifies only an output folder.
    pub(crate) fn stem_name(&self) -> String {
        let built_in = match self.builtin_light {
            Some(BuiltinLight::Chart) => "chart",
            Some(BuiltinLight::Objects) => "objects",
            Some(BuiltinLight::Drive) | None => "drive",
        };
        let stem = self.input.as_deref().and_then(std::path::Path::file_stem);
        let stem = stem.map(|s| s.to_string_lossy().into_owned()).filter(|s| s != "-");
        stem.unwrap_or_else(|| if self.input.is_some() { "run" } else { built_in }.to_owned())
    }

    /// Returns `camera` with the size of the input's frames if the user requested this size.
    pub(crate) fn with_input_size(&self, mut camera: Camera) -> Result<Camera> {
        let Some(path) = self.input.as_ref().filter(|_| self.size_from_input) else { return Ok(camera) };
        let no_size = |found: &str| {
            Error::new(ErrorKind::Usage, "--size-from-input")
                .found(found)
                .expected("an input whose frames have a size")
                .remedy("set --width and --height")
        };
        if path.as_os_str() == "-" {
            return Err(no_size("standard input, which can be read only once"));
        }
        let options = InputOptions { resize_mode: ResizeMode::Cover, ..self.input_options(&camera, None) };
        let source = open(path, &options)?;
        camera.sensor.geometry = source.stored_geometry().ok_or_else(|| no_size("light without a size"))?;
        Ok(camera)
    }

    pub(crate) fn open(&self, camera: &Camera) -> Result<RunLight> {
        let readout = exact_rate(camera.sensor.readout_hz)?;
        if self.input.is_none() {
            return match self.builtin_light {
                Some(BuiltinLight::Chart) => self.chart_light(camera, readout),
                Some(BuiltinLight::Objects) => self.objects_light(camera, readout),
                Some(BuiltinLight::Drive) | None => self.drive_light(camera, readout),
            };
        }
        if self.motion.is_some() {
            return self.moving_image_light(camera, readout);
        }
        let path = self.input.clone().unwrap_or_default();
        let mut options = self.input_options(camera, None);
        if path.as_os_str() == "-" {
            options.stop = Some(stop_flag()?);
        }
        let source = open(&path, &options).map_err(|e| match e.kind() {
            // Some errors about a missing tool do not contain the name of the file that requires the tool.
            ErrorKind::Tool if !e.to_string().contains(&*path.to_string_lossy()) => {
                e.with_context(path.display())
            }
            _ => e,
        })?;
        let rate = self.input_fps.or(source.rate());
        let interpolation = self.interpolation.unwrap_or(Interpolation::Linear);
        let mut warnings = self.light_notes(&*source, camera);
        let timeline = if self.readouts_per_frame.is_none() && source.frames() == Some(1) {
            Timeline::first_frame()
        } else {
            let pace =
                FrameTiming { readouts_per_frame: self.readouts_per_frame, frame_rate: self.input_fps };
            if pace.is_guessed(&*source) {
                warnings.push(format!(
                    "{} states no frame rate: each frame lasts {DEFAULT_READOUTS_PER_FRAME} readouts; to change this, set --readouts-per-frame or --input-fps",
                    path.display()
                ));
            }
            pace.timeline(&*source, readout, interpolation)?
        };
        if timeline == Timeline::first_frame() && self.readouts.is_none() {
            return Err(Error::new(ErrorKind::Usage, source.describe())
                .found("one frame and no number of readouts")
                .expected("the duration of the frame")
                .remedy("set --readouts or --readouts-per-frame"));
        }
        Ok(RunLight { source, timeline, readouts: self.readouts, frame_rate: rate, warnings })
    }

    /// Returns the notes of the source. If frames are cropped to the size of the camera, a note about the crop is added.
    fn light_notes(&self, source: &dyn Source, camera: &Camera) -> Vec<String> {
        let mut notes = source.notes();
        if let Some(stored) = source.stored_geometry() {
            notes.extend(self.resize_mode.crop_note(stored, camera.sensor.geometry));
        }
        if source.frame_times().is_some() && (self.readouts_per_frame.is_some() || self.input_fps.is_some()) {
            notes.push(
                "the frame times of the input are not used, because --readouts-per-frame or --input-fps is set"
                    .to_owned(),
            );
        }
        notes
    }
}

impl RunLight {
    /// Returns the facts about the light for the sidecar. The simulation adds the facts that are known only at its end.
    pub(crate) fn facts(&self, args: &LightArgs, camera: &Camera) -> LightFacts {
        let of_source = LightFacts::from_source(&*self.source);
        let source = match &args.input {
            // The description of a source begins with the path, so the path is replaced by its recorded form.
            Some(path) => of_source.source.replacen(&path.display().to_string(), &recorded_path(path), 1),
            None => of_source.source.clone(),
        };
        let per_frame =
            (self.timeline != Timeline::first_frame()).then(|| self.readouts_per_frame_text(args, camera));
        LightFacts {
            resize_mode: args.resize_mode.to_string(),
            motion: args.motion.clone(),
            interpolation: self.timeline.interpolation().to_string(),
            readouts_per_frame: per_frame,
            source_rate: self.frame_rate.map(|r| r.to_string()),
            exposure_electrons: camera.sensor.thresholds_at_full_scale
                * camera.operating_point(0.0).electrons,
            source,
            ..of_source
        }
    }

    fn readouts_per_frame_text(&self, args: &LightArgs, camera: &Camera) -> String {
        match (args.readouts_per_frame, self.frame_rate) {
            (Some(n), _) => n.to_string(),
            (None, Some(rate)) => format!("{}", camera.sensor.readout_hz / rate.hz()),
            (None, None) if self.source.frame_times().is_some() => "from its times".to_owned(),
            (None, None) => DEFAULT_READOUTS_PER_FRAME.to_string(),
        }
    }
}
