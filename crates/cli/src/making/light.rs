//! Flags that describe the light, and the source and timeline that they amount to.

use std::path::PathBuf;

use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use spikelane::{Camera, Error, Kind, Result};
use spikelane_io::light::open;
use spikelane_io::light::{
    Fit, InputOptions, Insertion, Pace, READOUTS_PER_FRAME, Rate, Source, Timeline, Transfer,
};
use spikelane_io::simulate::LightFacts;
use spikelane_scene::Lighting;

use crate::shared::camera::exact_rate;
use crate::shared::output::recorded;
use crate::shared::progress::stop_flag;

/// Light that needs no input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BuiltIn {
    /// A random driving scene.
    Drive,
    /// The moving test chart.
    Chart,
    /// Random flat objects over a backdrop.
    Objects,
}

#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct LightArgs {
    /// Folder of images, image, video, .npy, .npz, .y4m, or - for y4m or npy on standard input;
    /// a driving scene if left out
    pub input: Option<PathBuf>,
    /// Built-in light: a random driving scene, the moving test chart, or random objects over a backdrop
    /// [default: drive]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "SOURCE",
        conflicts_with = "input",
        help_heading = "Light"
    )]
    pub source: Option<BuiltIn>,
    /// Seed of the driving scene, or of the objects [default: 11]
    #[arg(hide_short_help = true, long, value_name = "N", conflicts_with = "input", help_heading = "Light")]
    pub scene_seed: Option<u64>,
    /// Lighting of the driving scene [default: drawn by its seed; noon for the default seed]
    #[arg(hide_short_help = true, long, conflicts_with = "input", help_heading = "Light",
          value_parser = PossibleValuesParser::new(Lighting::ALL.map(Lighting::name)))]
    pub lighting: Option<String>,
    /// The most readouts; by default the stream ends with the input
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), help_heading = "Light")]
    pub readouts: Option<u64>,
    /// Readouts that each frame of the input lasts [default: as its times or its rate say, so that motion keeps its
    /// speed; 20 where the input says nothing, a millisecond at 20 kHz]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..),
          conflicts_with = "source_hz", help_heading = "Light")]
    pub readouts_per_frame: Option<u64>,
    /// Frames of the input per second, such as 25 or 30000/1001 [default: what the input states]
    #[arg(hide_short_help = true, long, value_name = "HZ", help_heading = "Light")]
    pub source_hz: Option<Rate>,
    /// What the light does between two frames: hold, linear, or flow (along an estimated motion) [default: linear, as
    /// held frames make all pixels jump at once where the scene moved; hold for built-in light, drawn often enough]
    #[arg(long, value_name = "RULE", help_heading = "Light")]
    pub insertion: Option<Insertion>,
    /// How stored values become light: linear, srgb, or an exponent such as 2.2 [default: the camera's
    /// ([light] in its file), else srgb for images and video; linear for arrays and EXR]
    #[arg(hide_short_help = true, long, value_name = "FUNCTION", help_heading = "Light")]
    pub transfer: Option<Transfer>,
    /// Size of the camera: input takes that of the input's frames, which then stay as they are
    #[arg(hide_short_help = true, long, value_name = "input", value_parser = PossibleValuesParser::new(["input"]),
          conflicts_with_all = ["width", "height"], requires = "input", help_heading = "Light")]
    pub size: Option<String>,
    /// How frames are brought to the camera's size: resize, stretch or crop
    #[arg(
        hide_short_help = true,
        long,
        value_name = "HOW",
        default_value = "resize",
        help_heading = "Light"
    )]
    pub fit: Fit,
    /// Number in an array that is full scale [default: 255, 65535, true or 1.0; other integers need it]
    #[arg(hide_short_help = true, long, value_name = "NUMBER", help_heading = "Light")]
    pub scale: Option<f64>,
    /// Motion over a single image: pan=X,Y in pixels per second, zoom=FACTOR and rotate=DEGREES per second,
    /// joined by ':'
    #[arg(hide_short_help = true, long, value_name = "MOTION", help_heading = "Light")]
    pub motion: Option<String>,
    /// Brightest light in full scales; brighter light is cut to it [default: 1, or 2 for floats]
    #[arg(hide_short_help = true, long, value_name = "FULL_SCALES", help_heading = "Light")]
    pub greatest_light: Option<f64>,
}

/// Light that is ready to run.
pub(crate) struct Light {
    pub source: Box<dyn Source>,
    pub timeline: Timeline,
    pub readouts: Option<u64>,
    pub(super) rate: Option<Rate>,
    /// What the user should know about the light beforehand.
    pub warnings: Vec<String>,
}

impl LightArgs {
    /// What a run of this light is called where the user names a folder only.
    pub(crate) fn name(&self) -> String {
        let built_in = match self.source {
            Some(BuiltIn::Chart) => "chart",
            Some(BuiltIn::Objects) => "objects",
            Some(BuiltIn::Drive) | None => "drive",
        };
        let stem = self.input.as_deref().and_then(std::path::Path::file_stem);
        let stem = stem.map(|s| s.to_string_lossy().into_owned()).filter(|s| s != "-");
        stem.unwrap_or_else(|| if self.input.is_some() { "run" } else { built_in }.to_owned())
    }

    /// `camera` with the size of the input's frames, if that was asked for.
    pub(crate) fn sized(&self, mut camera: Camera) -> Result<Camera> {
        let Some(path) = self.input.as_ref().filter(|_| self.size.is_some()) else { return Ok(camera) };
        let no_size = |found: &str| {
            Error::new(Kind::Usage, "--size input")
                .found(found)
                .expected("an input whose frames have a size")
                .remedy("give --width and --height")
        };
        if path.as_os_str() == "-" {
            return Err(no_size("standard input, which can be read only once"));
        }
        let options = InputOptions { fit: Fit::Resize, ..self.options(&camera, None) };
        let source = open(path, &options)?;
        camera.sensor.geometry = source.stored().ok_or_else(|| no_size("light without a size of its own"))?;
        Ok(camera)
    }

    pub(crate) fn open(&self, camera: &Camera) -> Result<Light> {
        let readout = exact_rate(camera.sensor.readout_hz)?;
        if self.input.is_none() {
            return match self.source {
                Some(BuiltIn::Chart) => self.chart(camera, readout),
                Some(BuiltIn::Objects) => self.objects(camera, readout),
                Some(BuiltIn::Drive) | None => self.drive(camera, readout),
            };
        }
        if self.motion.is_some() {
            return self.moving(camera, readout);
        }
        let path = self.input.clone().unwrap_or_default();
        let mut options = self.options(camera, None);
        if path.as_os_str() == "-" {
            options.stop = Some(stop_flag()?);
        }
        let source = open(&path, &options).map_err(|e| match e.kind() {
            // Whose missing tool it is, is not in every such error.
            Kind::Tool if !e.to_string().contains(&*path.to_string_lossy()) => e.within(path.display()),
            _ => e,
        })?;
        let rate = self.source_hz.or(source.rate());
        let insertion = self.insertion.unwrap_or(Insertion::Linear);
        let mut warnings = self.notes(&*source, camera);
        let timeline = if self.readouts_per_frame.is_none() && source.frames() == Some(1) {
            Timeline::still()
        } else {
            let pace = Pace { readouts_per_frame: self.readouts_per_frame, source: self.source_hz };
            if pace.is_guessed(&*source) {
                warnings.push(format!(
                    "{} says no rate: each frame lasts {READOUTS_PER_FRAME} readouts (--readouts-per-frame or \
                     --source-hz change that)",
                    path.display()
                ));
            }
            pace.timeline(&*source, readout, insertion)?
        };
        if timeline == Timeline::still() && self.readouts.is_none() {
            return Err(Error::new(Kind::Usage, source.describe())
                .found("one frame and no number of readouts")
                .expected("how long it is held")
                .remedy("give --readouts or --readouts-per-frame"));
        }
        Ok(Light { source, timeline, readouts: self.readouts, rate, warnings })
    }

    /// What the source says, and how much of its frames the camera sees.
    fn notes(&self, source: &dyn Source, camera: &Camera) -> Vec<String> {
        let mut notes = source.notes();
        if let Some(stored) = source.stored() {
            notes.extend(self.fit.note(stored, camera.sensor.geometry));
        }
        if source.times().is_some() && (self.readouts_per_frame.is_some() || self.source_hz.is_some()) {
            notes.push(
                "the times that the input states for its frames are not used: --readouts-per-frame or \
                        --source-hz give others"
                    .to_owned(),
            );
        }
        notes
    }
}

impl Light {
    /// For the sidecar; what only the run can tell is filled in afterwards.
    pub(crate) fn facts(&self, args: &LightArgs, camera: &Camera) -> LightFacts {
        let of_source = LightFacts::of(&*self.source);
        let source = match &args.input {
            // A source begins with its path, and describes itself behind it.
            Some(path) => of_source.source.replacen(&path.display().to_string(), &recorded(path), 1),
            None => of_source.source.clone(),
        };
        let per_frame = (self.timeline != Timeline::still()).then(|| self.per_frame(args, camera));
        LightFacts {
            fit: args.fit.to_string(),
            motion: args.motion.clone(),
            insertion: self.timeline.insertion().to_string(),
            readouts_per_frame: per_frame,
            source_rate: self.rate.map(|r| r.to_string()),
            exposure_electrons: camera.sensor.thresholds_at_full_scale * camera.operating(0.0).electrons,
            source,
            ..of_source
        }
    }

    fn per_frame(&self, args: &LightArgs, camera: &Camera) -> String {
        match (args.readouts_per_frame, self.rate) {
            (Some(n), _) => n.to_string(),
            (None, Some(rate)) => format!("{}", camera.sensor.readout_hz / rate.hz()),
            (None, None) if self.source.times().is_some() => "as its times say".to_owned(),
            (None, None) => READOUTS_PER_FRAME.to_string(),
        }
    }
}
