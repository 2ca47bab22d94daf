//! `spikelane dataset`.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::dataset::{
    self, DatasetOptions, Drives, Estimate, Images, Inputs, Progress, Report, Structure, Work,
};
use crate::formats::Layout;
use crate::light::{Fit, Insertion, Transfer};
use crate::report::with_known;
use crate::scene::Lighting;
use crate::simulate::ImageForm;
use crate::{Error, Kind, Result};
use clap::builder::PossibleValuesParser;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::cli::shared::camera::CameraArgs;
use crate::cli::shared::output::{Out, bytes_text};
use crate::cli::shared::progress::{Stop, stop_flag};
use crate::cli::shared::seeds::{SceneSeed, SeedArgs};
use crate::cli::shared::threads::ThreadArgs;

/// Between two JSON events.
const PERIOD: Duration = Duration::from_millis(500);

/// Make a dataset of random driving scenes, or of all videos and image folders below a folder
///
/// Every sequence gets noise of its own, a noisy and a clean stream, and a record with the digest
/// of every file. Interrupt it at any time; --resume verifies what is there and makes the rest.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder that becomes the dataset
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Convert every video and image folder below DIR instead of drawing scenes
    #[arg(long, value_name = "DIR")]
    pub from: Option<PathBuf>,
    /// Kind of data set: rhdd is 30 scenes of 500 images, tiny 2 scenes of 40, one readout per image
    #[arg(long, value_name = "NAME", default_value = "rhdd", conflicts_with = "from",
          value_parser = PossibleValuesParser::new(Drives::PRESETS))]
    pub kind: String,
    /// Number of scenes
    #[arg(long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub sequences: Option<u32>,
    /// Clear images of each
    #[arg(long, value_name = "M", conflicts_with = "from", help_heading = "Scenes")]
    pub images: Option<u32>,
    /// Readouts from one image to the next; the light follows every readout
    #[arg(hide_short_help = true, long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub readouts_per_image: Option<u32>,
    /// Images from one labelled image to the next; 0 for no labels
    #[arg(hide_short_help = true, long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub label_every: Option<u32>,
    /// Light of all scenes [default: drawn for each]
    #[arg(long, conflicts_with = "from", help_heading = "Scenes",
          value_parser = PossibleValuesParser::new(Lighting::ALL.map(Lighting::name)))]
    pub lighting: Option<String>,
    /// Frequency with which lamps flicker, in hertz
    #[arg(hide_short_help = true, long, value_name = "HZ", conflicts_with = "from", help_heading = "Scenes")]
    pub flicker_hz: Option<f64>,
    /// Vehicles in each scene
    #[arg(hide_short_help = true, long, value_name = "N", conflicts_with = "from", help_heading = "Scenes")]
    pub vehicles: Option<u32>,
    /// Speed that the camera's car wishes to drive, in km/h
    #[arg(
        hide_short_help = true,
        long,
        value_name = "KMH",
        conflicts_with = "from",
        help_heading = "Scenes"
    )]
    pub speed_kmh: Option<f64>,
    /// Luminance of full scale in cd/m2 [default: each scene's own white]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "CD_M2",
        conflicts_with = "from",
        help_heading = "Scenes"
    )]
    pub white: Option<f32>,
    /// Also keep the clear images as linear float arrays
    #[arg(hide_short_help = true, long, conflicts_with = "from", help_heading = "Scenes")]
    pub npy: bool,
    /// Also write depth and flow as KITTI's 16-bit PNGs
    #[arg(hide_short_help = true, long, conflicts_with = "from", help_heading = "Scenes")]
    pub kitti: bool,
    /// Also write the light of labelled images in colour as EXR, in cd/m2
    #[arg(hide_short_help = true, long, conflicts_with = "from", help_heading = "Scenes")]
    pub exr: bool,
    /// Readouts of every frame [default: as its times or its rate say, so that motion keeps its speed; 20 where the
    /// input says nothing, a millisecond at 20 kHz]
    #[arg(long, value_name = "N", requires = "from", help_heading = "Conversion",
          value_parser = clap::value_parser!(u64).range(1..))]
    pub readouts_per_frame: Option<u64>,
    /// Light between two frames: hold, linear, or flow (along an estimated motion); held frames make all pixels jump at
    /// once where the scene moved
    #[arg(
        hide_short_help = true,
        long,
        default_value = "linear",
        requires = "from",
        help_heading = "Conversion"
    )]
    pub insertion: Insertion,
    /// How frames are brought to the camera's size: resize, stretch or crop
    #[arg(
        hide_short_help = true,
        long,
        default_value = "resize",
        requires = "from",
        help_heading = "Conversion"
    )]
    pub fit: Fit,
    /// How stored values become light: linear, srgb, or an exponent
    #[arg(hide_short_help = true, long, requires = "from", help_heading = "Conversion")]
    pub transfer: Option<Transfer>,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub seeds: SeedArgs,
    #[command(flatten)]
    pub scene: SceneSeed,
    /// Keep the clear light of every N-th readout as images/READOUT [default: of scenes every image, of given inputs none]
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub images_every: Option<u64>,
    /// How clear images are stored: u8 (PNG, sRGB), u16 (PNG, linear) or f32 (npy, linear)
    #[arg(hide_short_help = true, long, value_name = "FORM", default_value = "u8")]
    pub images_as: ImageForm,
    /// Which loaders find their folders, and whose codes ground truth has: spikecv (255 is rate 1), or
    /// spike-zoo (255 is rate 0.6, for which the light is exposed)
    #[arg(long, default_value = "spikecv")]
    pub structure: Structure,
    /// Share of the sequences that are for testing
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.2)]
    pub test_share: f64,
    /// SPDX identifier under which you give the dataset on, such as CC-BY-4.0
    #[arg(hide_short_help = true, long, value_name = "SPDX")]
    pub licence: Option<String>,
    #[command(flatten)]
    pub threads: ThreadArgs,
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
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let options = args.options(out)?;
    let estimate = dataset::estimate(&options)?;
    if let Some(folder) = &args.from {
        let skipped = dataset::skipped(folder, &args.output)?;
        if let Some(text) = named(&skipped) {
            out.say(format_args!("warning: {}: {text}", folder.display()));
        }
    }
    if let Some(caveat) = Layout::Dat.caveat(options.camera.sensor.geometry) {
        out.say(format_args!("note: {caveat}"));
    }
    forecast(&estimate, args.dry_run, out)?;
    if args.dry_run {
        return Ok(());
    }
    let mut watcher = Watcher::new(out)?;
    let report = dataset::make(&options, &mut |p| watcher.step(p));
    watcher.bar.finish_and_clear();
    tell(&options, &report?, out)
}

/// A line about files that become no sequence.
fn named(skipped: &[PathBuf]) -> Option<String> {
    const LISTED: usize = 3;
    let listed: Vec<String> = skipped.iter().take(LISTED).map(|p| p.display().to_string()).collect();
    let (files, are) = if skipped.len() == 1 { ("file", "is") } else { ("files", "are") };
    let more = if skipped.len() > LISTED { ", ..." } else { "" };
    (!skipped.is_empty()).then(|| {
        format!(
            "{} {files} {are} left out, as neither video nor one of several pictures: {}{more}",
            skipped.len(),
            listed.join(", ")
        )
    })
}

/// What it will take: the result of a dry run, else said beforehand.
fn forecast(estimate: &Estimate, result: bool, out: &Out) -> Result<()> {
    let unknown = match estimate.unknown {
        0 => String::new(),
        n => format!(", and {n} of unknown length"),
    };
    let text = format!(
        "{} sequences to make: {} readouts, about {}{unknown}",
        estimate.sequences,
        estimate.readouts,
        bytes_text(estimate.bytes)
    );
    let event = json!({
        "event": "estimate", "sequences": estimate.sequences, "readouts": estimate.readouts,
        "bytes": estimate.bytes, "unknown": estimate.unknown,
    });
    if result {
        return out.result(&event, &format!("{text}\n"));
    }
    out.say(text);
    out.event(&event)
}

/// A bar over all sequences on a terminal, events when asked for JSON.
struct Watcher {
    out: Out,
    stop: Stop,
    bar: ProgressBar,
    said: Instant,
}

impl Watcher {
    fn new(out: &Out) -> Result<Self> {
        let bar = ProgressBar::new(1000);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {msg} {percent} %, {elapsed}, {eta} left")
        {
            bar.set_style(style);
        }
        Ok(Self { out: *out, stop: stop_flag()?, bar, said: Instant::now() })
    }

    fn step(&mut self, p: Progress<'_>) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::new(Kind::Interrupted, "stopped on request")
                .remedy("finished sequences are kept; go on with --resume"));
        }
        let inside = p.total.map_or(0.0, |n| p.readouts as f64 / n.max(1) as f64);
        self.bar.set_position(((p.index as f64 + inside) / p.of as f64 * 1000.0) as u64);
        let what = if p.verifying { "verify" } else { p.id };
        self.bar.set_message(format!("{what} {}/{}", p.index + 1, p.of));
        if self.said.elapsed() < PERIOD {
            return Ok(());
        }
        self.said = Instant::now();
        let about = json!({
            "event": "progress", "sequence": p.id, "index": p.index, "of": p.of, "readouts": p.readouts,
            "verifying": p.verifying,
        });
        self.out.event(&with_known(about, [("total", p.total.map(Into::into))]))
    }
}

fn tell(options: &DatasetOptions, report: &Report, out: &Out) -> Result<()> {
    let place = options.output.display();
    let text =
        format!("{place}: {} made, {} verified, {} set aside\n", report.made, report.verified, report.failed);
    let set_aside: Vec<_> =
        report.set_aside.iter().map(|(input, why)| json!({"input": input, "reason": why})).collect();
    let event = json!({
        "event": "done", "output": place.to_string(), "made": report.made, "verified": report.verified,
        "failed": report.failed, "set_aside": set_aside, "too_fast": report.too_fast, "needed_readout_hz": report.needed_readout_hz,
    });
    out.result(&event, &text)?;
    for (input, why) in &report.set_aside {
        out.say(format_args!("set aside  {input}: {why}"));
    }
    for note in &report.notes {
        out.say(format_args!("warning: {note}"));
    }
    if report.too_fast > 0 {
        out.say(format_args!(
            "warning: {} of the scenes made move by more than half a pixel from one readout to the next; \
             every readout was then drawn anew, which is slow but exact. From {} readouts a second \
             (--readout-hz) they would not, nor with a smaller picture or a lower --speed-kmh",
            report.too_fast, report.needed_readout_hz
        ));
    }
    if report.failed == 0 {
        return Ok(());
    }
    Err(Error::new(Kind::Input, options.output.join("manifest.jsonl").display())
        .found(format_args!("{} sequences set aside", report.failed))
        .expected("none")
        .remedy("the manifest says why; mend the inputs and go on with --resume"))
}

impl Args {
    fn options(&self, out: &Out) -> Result<DatasetOptions> {
        Ok(DatasetOptions {
            output: self.output.clone(),
            work: self.work(),
            camera: self.camera.camera()?,
            images: Images { every: self.images_every, form: self.images_as },
            seed: self.seeds.seed,
            scene_seed: self.scene.scene_seed,
            camera_seed: self.seeds.camera_seed(),
            structure: self.structure,
            test_share: self.test_share,
            licence: self.licence.clone(),
            threads: self.threads.number(out),
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
        let known = Drives::preset(&self.kind).unwrap_or_else(Drives::rhdd);
        Work::Drives(Drives {
            sequences: self.sequences.unwrap_or(known.sequences),
            images: self.images.unwrap_or(known.images),
            readouts_per_image: self.readouts_per_image.unwrap_or(known.readouts_per_image),
            label_every: self.label_every.unwrap_or(known.label_every),
            lighting: self.lighting.as_deref().and_then(Lighting::from_name),
            flicker_hz: self.flicker_hz,
            vehicles: self.vehicles,
            speed_kmh: self.speed_kmh,
            white_cd_m2: self.white,
            npy: self.npy,
            kitti: self.kitti,
            exr: self.exr,
            ..known
        })
    }
}
