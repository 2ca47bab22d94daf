//! `spikelane dataset`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::builder::PossibleValuesParser;
use indicatif::{ProgressBar, ProgressStyle};
use spikelane::dataset::{self, Drives, Inputs, Layout, Options, Progress, Report, Work};
use spikelane::light::{Fit, Insertion, Transfer};
use spikelane::scene::{Lighting, Samples};
use spikelane::{Camera, Error, Geometry, Kind, Result, presets};

/// Make a dataset of random driving scenes, or of all videos and image folders below a folder
///
/// Every sequence gets noise of its own, a noisy and a clean stream, and a record with the digest
/// of every file. Interrupt it at any time; --resume verifies what is there and makes the rest.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    /// Folder that becomes the dataset
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Convert every video and image folder below DIR instead of drawing scenes
    #[arg(long, value_name = "DIR")]
    pub from: Option<PathBuf>,
    /// A known dataset: rhdd is 30 scenes of 500 images, one readout per image, the default
    #[arg(long, default_value = "rhdd", value_parser = PossibleValuesParser::new(["rhdd"]), conflicts_with = "from")]
    pub preset: String,
    /// Number of scenes
    #[arg(long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub sequences: Option<u32>,
    /// Clear images of each
    #[arg(long, value_name = "M", conflicts_with = "from", help_heading = "Scenes")]
    pub images: Option<u32>,
    /// Readouts from one image to the next; the light follows every readout
    #[arg(long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub readouts_per_image: Option<u32>,
    /// Images from one labelled image to the next; 0 for no labels
    #[arg(long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub label_every: Option<u32>,
    /// Light of all scenes [default: drawn for each]
    #[arg(long, conflicts_with = "from", help_heading = "Scenes",
          value_parser = PossibleValuesParser::new(Lighting::ALL.map(Lighting::name)))]
    pub lighting: Option<String>,
    /// Frequency with which lamps flicker, in hertz
    #[arg(long, value_name = "HZ", conflicts_with = "from", help_heading = "Scenes")]
    pub flicker_hz: Option<f64>,
    /// Vehicles in each scene
    #[arg(long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub vehicles: Option<u32>,
    /// Speed that the camera's car wishes to drive, in km/h
    #[arg(long, value_name = "KMH", conflicts_with = "from", help_heading = "Scenes")]
    pub speed_kmh: Option<f64>,
    /// Luminance of full scale in cd/m2 [default: each scene's own white]
    #[arg(long, value_name = "CD_M2", conflicts_with = "from", help_heading = "Scenes")]
    pub white: Option<f32>,
    /// Also keep the clear images as linear float arrays
    #[arg(long, conflicts_with = "from", help_heading = "Scenes")]
    pub npy: bool,
    /// Readouts of every frame
    #[arg(long, value_name = "N", default_value_t = 20, requires = "from", help_heading = "Conversion",
          value_parser = clap::value_parser!(u64).range(1..))]
    pub readouts_per_frame: u64,
    /// Light between two frames: hold or linear
    #[arg(long, default_value = "linear", requires = "from", help_heading = "Conversion")]
    pub insertion: Insertion,
    /// How frames are brought to the camera's size: resize, stretch or crop
    #[arg(long, default_value = "resize", requires = "from", help_heading = "Conversion")]
    pub fit: Fit,
    /// How stored values become light: linear, srgb, or an exponent
    #[arg(long, requires = "from", help_heading = "Conversion")]
    pub transfer: Option<Transfer>,
    /// Camera model: a preset, or a camera file (.toml)
    #[arg(long, value_name = "NAME|FILE", default_value = "physical", help_heading = "Camera")]
    pub preset_model: String,
    /// Size and readout rate of a known camera
    #[arg(long, value_name = "NAME", help_heading = "Camera")]
    pub camera: Option<String>,
    /// Width in pixels
    #[arg(long, value_name = "PIXELS", help_heading = "Camera")]
    pub width: Option<u32>,
    /// Height in pixels
    #[arg(long, value_name = "PIXELS", help_heading = "Camera")]
    pub height: Option<u32>,
    /// Electrons per readout at full scale [default: the model's]
    #[arg(long, value_name = "ELECTRONS", help_heading = "Camera")]
    pub exposure: Option<f64>,
    /// Seed of scenes, split and noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Seed of the fixed pattern that all sequences share
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub camera_seed: u64,
    /// Which loaders find their folders: spikecv or spike-zoo
    #[arg(long, default_value = "spikecv")]
    pub layout: Layout,
    /// Share of the sequences that are for testing
    #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
    pub test_share: f64,
    /// SPDX identifier under which you give the dataset on, such as CC-BY-4.0
    #[arg(long, value_name = "SPDX")]
    pub licence: Option<String>,
    /// Threads [default: one per CPU]; the bytes are the same for any number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Go on with a dataset that was begun
    #[arg(long)]
    pub resume: bool,
    /// Say what it would take, and write nothing
    #[arg(long)]
    pub dry_run: bool,
}

/// Runs the command.
///
/// # Errors
/// As [`dataset::make`]; [`Kind::Input`] at the end when sequences were set aside.
pub fn run(args: &Args) -> Result<()> {
    let options = args.options()?;
    let estimate = dataset::estimate(&options)?;
    eprintln!(
        "{} sequences to make: {} readouts, about {:.2} GB{}",
        estimate.sequences,
        estimate.readouts,
        estimate.bytes as f64 / 1e9,
        if estimate.unknown > 0 {
            format!(", and {} of unknown length", estimate.unknown)
        } else {
            String::new()
        }
    );
    if args.dry_run {
        return Ok(());
    }
    let stop = stop_flag()?;
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {msg} {percent} %, {elapsed}, {eta} left") {
        bar.set_style(style);
    }
    let mut watch = |p: Progress<'_>| {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(Kind::Interrupted, "stopped on request")
                .remedy("finished sequences are kept; go on with --resume"));
        }
        let inside = p.total.map_or(0.0, |n| p.readouts as f64 / n.max(1) as f64);
        bar.set_position(((p.index as f64 + inside) / p.of as f64 * 1000.0) as u64);
        bar.set_message(format!("{} {}/{}", if p.verifying { "verify" } else { p.id }, p.index + 1, p.of));
        Ok(())
    };
    let report = dataset::make(&options, &mut watch);
    bar.finish_and_clear();
    tell(&options, &report?)
}

fn tell(options: &Options, report: &Report) -> Result<()> {
    println!(
        "{}: {} made, {} verified, {} set aside",
        options.output.display(),
        report.made,
        report.verified,
        report.failed
    );
    if report.failed == 0 {
        return Ok(());
    }
    Err(Error::new(Kind::Input, options.output.join("manifest.jsonl").display())
        .found(format_args!("{} sequences set aside", report.failed))
        .expected("none")
        .remedy("the manifest says why; mend the inputs and go on with --resume"))
}

fn stop_flag() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed))
        .map_err(|e| Error::new(Kind::Io, "signal handler").found(e))?;
    Ok(stop)
}

impl Args {
    fn options(&self) -> Result<Options> {
        let cpus = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Ok(Options {
            output: self.output.clone(),
            work: self.work(),
            camera: self.model()?,
            seed: self.seed,
            camera_seed: self.camera_seed,
            layout: self.layout,
            test_share: self.test_share,
            licence: self.licence.clone(),
            threads: self.threads.map_or(cpus, usize::from),
            resume: self.resume,
        })
    }

    fn work(&self) -> Work {
        if let Some(folder) = &self.from {
            return Work::Inputs(Inputs {
                folder: folder.clone(),
                readouts_per_frame: self.readouts_per_frame,
                insertion: self.insertion,
                fit: self.fit,
                transfer: self.transfer,
            });
        }
        let rhdd = Drives::rhdd();
        Work::Drives(Drives {
            sequences: self.sequences.unwrap_or(rhdd.sequences),
            images: self.images.unwrap_or(rhdd.images),
            readouts_per_image: self.readouts_per_image.unwrap_or(rhdd.readouts_per_image),
            label_every: self.label_every.unwrap_or(rhdd.label_every),
            lighting: self.lighting.as_deref().and_then(Lighting::from_name),
            flicker_hz: self.flicker_hz,
            vehicles: self.vehicles,
            speed_kmh: self.speed_kmh,
            white_cd_m2: self.white,
            samples: Samples::Four,
            npy: self.npy,
        })
    }

    fn model(&self) -> Result<Camera> {
        let mut camera = presets::load(&self.preset_model)?;
        let size = camera.sensor.geometry;
        let (mut width, mut height) = (size.width() as u32, size.height() as u32);
        if let Some(name) = &self.camera {
            let known = presets::FORMATS.iter().find(|f| f.name == name).ok_or_else(|| {
                let names: Vec<_> = presets::FORMATS.iter().map(|f| f.name).collect();
                Error::new(Kind::Usage, "camera").found(name).expected(names.join(", "))
            })?;
            ((width, height), camera.sensor.readout_hz) = (known.size, known.readout_hz);
        }
        camera.sensor.geometry = Geometry::new(self.width.unwrap_or(width), self.height.unwrap_or(height))?;
        if let Some(electrons) = self.exposure {
            camera.sensor.thresholds_at_full_scale = electrons / camera.operating(0.0).electrons;
        }
        camera.sensor.validated()?;
        Ok(camera)
    }
}
