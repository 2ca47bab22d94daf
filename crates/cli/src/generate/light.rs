//! Flags that describe the light. The source and the timeline of the light are created from them.

use std::path::PathBuf;

use clap::ValueEnum;
use spikelane::{Camera, Error, ErrorKind, Result};
use spikelane_io::light::open;
use spikelane_io::light::{
    DEFAULT_READOUTS_PER_FRAME, FrameTiming, InputOptions, Interpolation, MosaicSource, Rate, ResizeMode,
    Source, Timeline, Transfer,
};
use spikelane_io::simulate::LightFacts;

use crate::common::{Console, LightingArg, exact_rate, recorded_path, stop_flag};

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
    /// Read light from a path [default: driving scene]
    ///
    /// The path is a folder of images, an image, a video, or an .npy, .npz or .y4m file. For '-', y4m or npy data is
    /// read from standard input.
    pub input: Option<PathBuf>,
    /// Draw built-in light: drive (a driving scene), chart or objects [default: drive]
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
    /// Set the lighting of the driving scene, such as dusk [default: noon]
    ///
    /// The lighting is noon, low-sun, overcast, rain, tunnel, dusk, night, or random, which the scene seed selects.
    #[arg(hide_short_help = true, long, value_name = "NAME", conflicts_with = "input", help_heading = "Light",
          hide_possible_values = true, value_parser = LightingArg::parser())]
    pub lighting: Option<LightingArg>,
    /// Draw the driving scene without blur, glare, vignetting and distortion
    #[arg(hide_short_help = true, long, conflicts_with = "input", help_heading = "Light")]
    pub ideal_lens: bool,
    /// Keep the exposure of the driving scene as it is at its start
    #[arg(hide_short_help = true, long, conflicts_with = "input", help_heading = "Light")]
    pub lock_exposure: bool,
    /// Stop after N readouts [default: end of input]
    ///
    /// The default for built-in light is 500 for drive and 4000 for chart and objects. A single image requires --readouts
    /// or --readouts-per-frame.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), help_heading = "Light")]
    pub readouts: Option<u64>,
    /// Set readouts per frame [default: by input or 20]
    ///
    /// By default, the times or the rate of the frames determine this number. Without both, it is 20, which is 1 ms at
    /// 20 kHz.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..),
          conflicts_with = "input_fps", help_heading = "Light")]
    pub readouts_per_frame: Option<u64>,
    /// Set the frames per second of the input, such as 25 or 30000/1001 [default: from the input]
    ///
    /// By default, the drive is drawn after each quarter pixel of motion, and chart and objects 1000 times per second.
    #[arg(hide_short_help = true, long, value_name = "HZ", help_heading = "Light")]
    pub input_fps: Option<Rate>,
    /// Interpolate frames: hold, linear or flow
    ///
    /// The default is linear for an input and the drive, and hold for chart and objects. hold keeps each frame until the
    /// next one, linear changes each pixel linearly, and flow moves the light along an estimated motion.
    #[arg(long, value_name = "MODE", help_heading = "Light")]
    pub interpolation: Option<Interpolation>,
    /// Set the transfer function from codes to light: linear, srgb, pq, hlg or an exponent such as 2.2
    ///
    /// The section [light] of the camera file sets the default. Without it, the default is what the input states, else
    /// srgb for images and video, and linear for arrays and float images.
    #[arg(hide_short_help = true, long, value_name = "TRANSFER", help_heading = "Light")]
    pub transfer: Option<Transfer>,
    /// Set width and height of the camera to the size of the input
    #[arg(hide_short_help = true, long, conflicts_with_all = ["width", "height"], requires = "input",
          help_heading = "Light")]
    pub size_from_input: bool,
    /// Fit frames to the size of the camera: cover, stretch or crop
    ///
    /// cover scales the largest part with the aspect ratio of the camera, stretch scales the whole frame, and crop cuts
    /// out the center without scaling.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "MODE",
        default_value = "cover",
        help_heading = "Light"
    )]
    pub resize_mode: ResizeMode,
    /// Set the code or value that is full-scale light [default: the largest code, or 1.0, by type]
    ///
    /// The default is 255 for uint8, 65535 for uint16, true for bool and 1.0 for float arrays. Arrays of other types
    /// require --full-scale.
    #[arg(hide_short_help = true, long, value_name = "VALUE", help_heading = "Light")]
    pub full_scale: Option<f64>,
    /// Read any folder of images as a video
    #[arg(hide_short_help = true, long, requires = "input", help_heading = "Light")]
    pub video: bool,
    /// Use the part of a damaged image or video that can be decoded
    ///
    /// By default, damage is an error. With this flag, a warning describes the damage.
    #[arg(hide_short_help = true, long, requires = "input", help_heading = "Light")]
    pub accept_damage: bool,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(hide_short_help = true, long, requires = "input", help_heading = "Light")]
    pub follow_links: bool,
    /// Move the camera over an image, such as pan=120,0:zoom=1.2:rotate=30 [default: no motion]
    ///
    /// pan is in pixels, zoom is a factor, and rotate is in degrees, each per second.
    #[arg(hide_short_help = true, long, value_name = "MOTION", help_heading = "Light")]
    pub motion: Option<String>,
    /// Clip light above this multiple of full scale [default: 1, or 2 for float inputs]
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
                Some(BuiltinLight::Chart) => self.chart_light(camera, readout)?.with_mosaic(camera),
                Some(BuiltinLight::Objects) => self.objects_light(camera, readout)?.with_mosaic(camera),
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
            // Some errors about a missing tool do not contain the name of the input file that requires the tool.
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
                    "{} states no frame rate: each frame lasts {DEFAULT_READOUTS_PER_FRAME} readouts; to change the duration, set --readouts-per-frame or --input-fps",
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

/// Prints the notes of a source that are not in `printed`, such as damage that the source found while it was read.
pub(crate) fn print_new_notes(source: &dyn Source, printed: &[String], out: &Console) {
    for note in source.notes().iter().filter(|note| !printed.contains(note)) {
        out.print_message(format_args!("warning: {note}"));
    }
}

impl RunLight {
    /// Passes the drawn light through the color filters of `camera`.
    fn with_mosaic(self, camera: &Camera) -> Result<Self> {
        let Some(mosaic) = camera.window_mosaic() else { return Ok(self) };
        let source = MosaicSource::new(self.source, mosaic)?;
        let warnings = self.warnings.into_iter().chain(source.notes()).collect();
        Ok(Self { source: Box::new(source), warnings, ..self })
    }

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
            resize_mode: self.source.stored_geometry().map(|_| args.resize_mode.to_string()),
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
            (None, None) if self.timeline.has_frame_times() => "by motion".to_owned(),
            (None, None) => DEFAULT_READOUTS_PER_FRAME.to_string(),
        }
    }
}
