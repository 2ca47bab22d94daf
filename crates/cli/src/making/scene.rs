//! `spikelane scene`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use serde_json::json;
use spikelane::{Error, Kind, Result};
use spikelane_io::storage;
use spikelane_scene::{Lighting, Rendered, SamplesPerPixel, Scene, SceneOptions, labels};

use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::progress::{Progress, stop_flag};
use crate::shared::seeds::SceneSeed;
use crate::shared::threads::ThreadArgs;
use crate::shared::video::{Pictures, Video};

/// The files of a frame.
const KINDS: [&str; 8] = [
    "light.png",
    "depth.png",
    "flow.png",
    "semantic.png",
    "instance.png",
    "boxes.png",
    "boxes.json",
    "boxes.txt",
];

/// The name of a file of frame `i`.
fn name(i: u32, kind: &str) -> String {
    format!("{i:04}.{kind}")
}

/// Draw a random driving scene and its labels as pictures
///
/// Writes NNNN.light.png, .depth.png, .flow.png, .semantic.png, .instance.png,
/// .boxes.png, .boxes.json (COCO) and .boxes.txt (KITTI) for every frame.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder to write to; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub seeds: SceneSeed,
    /// Light [default: drawn by the seed]
    #[arg(long, value_parser = PossibleValuesParser::new(Lighting::ALL.map(Lighting::name)))]
    pub lighting: Option<String>,
    /// Number of frames
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Frames per second
    #[arg(long, value_name = "HZ", default_value_t = 25.0)]
    pub rate: f64,
    /// Width in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 400)]
    pub width: u32,
    /// Height in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 250)]
    pub height: u32,
    /// Colour samples of a pixel: 4 or 16
    #[arg(long, default_value = "4", value_parser = PossibleValuesParser::new(["4", "16"]))]
    pub samples: String,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Also make DIR/scene.mp4 of the light, with ffmpeg
    #[arg(long)]
    pub video: bool,
    /// Overwrite files of the same name
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
///
/// # Errors
/// When the scene is impossible, a file exists, or ffmpeg is missing.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    if !(args.rate.is_finite() && args.rate > 0.0) {
        return Err(Error::new(Kind::Usage, "frame rate").found(args.rate).expected("a positive number"));
    }
    let threads = args.threads.number(out);
    let options = SceneOptions {
        width: args.width,
        height: args.height,
        lighting: args.lighting.as_deref().and_then(Lighting::from_name),
        duration_s: f64::from(args.frames) / args.rate,
        ..SceneOptions::default()
    };
    let scene = Scene::random(args.seeds.scene_seed, &options)?;
    let _claim = outputs::claim_folder(&args.output)?;
    for i in 0..args.frames {
        storage::refuse_existing(
            &args.output,
            &KINDS.map(|kind| name(i, kind)).each_ref().map(|n| &**n),
            args.force,
        )?;
    }
    let mut video = if args.video {
        let path = args.output.join("scene.mp4");
        Some(Video::start(&path, Pictures::Png, args.rate, args.force)?)
    } else {
        None
    };
    let samples = if args.samples == "16" { SamplesPerPixel::Sixteen } else { SamplesPerPixel::Four };
    let mut progress = Progress::of(out, stop_flag()?, "frames");
    for i in 0..args.frames {
        progress.step(i.into(), Some(args.frames.into()))?;
        let t = f64::from(i) / args.rate;
        let frame = scene.render(t, samples, threads)?;
        let light = pictures(args, &scene, &frame, i, threads)?;
        if let Some(video) = &mut video {
            video.push(&light).map_err(|e| progress.cause(e))?;
        }
    }
    if let Some(video) = video {
        video.finish()?;
    }
    drop(progress);
    let event = json!({
        "event": "done", "output": args.output.display().to_string(), "frames": args.frames,
        "scene_seed": scene.seed(), "lighting": scene.lighting().name(), "vehicles": scene.vehicles(),
        "white_cd_m2": scene.white_cd_m2(),
    });
    let text = format!(
        "{}: {} frame(s) of scene {}, {}, {} vehicles, white at {} cd/m2\n",
        args.output.display(),
        args.frames,
        scene.seed(),
        scene.lighting().name(),
        scene.vehicles(),
        scene.white_cd_m2()
    );
    out.result(&event, &text)
}

/// Writes everything about one frame; returns the picture of its light.
fn pictures(args: &Args, scene: &Scene, frame: &Rendered, i: u32, threads: usize) -> Result<Vec<u8>> {
    let write =
        |kind: &str, bytes: &[u8]| storage::write_small(&args.output.join(name(i, kind)), bytes, args.force);
    let light = labels::light_picture(frame, scene.white_cd_m2())?;
    write("light.png", &light)?;
    write("depth.png", &labels::depth_picture(&frame.labels)?)?;
    write("semantic.png", &labels::semantic_picture(&frame.labels)?)?;
    write("instance.png", &labels::instance_picture(&frame.labels)?)?;
    // The last frame has no next one within the drive, except by half a frame.
    let later = scene.labels((frame.labels.t + 1.0 / args.rate).min(scene.duration_s()), threads)?;
    let flow = scene.flow(&frame.labels, &later, threads)?;
    write("flow.png", &labels::flow_picture(&flow, 0.05 * args.width as f32)?)?;
    let boxes = scene.boxes(&frame.labels)?;
    write("boxes.png", &labels::boxes_picture(frame, scene.white_cd_m2(), &boxes)?)?;
    let mut coco = labels::Coco::default();
    coco.add(&name(i, "light.png"), u64::from(i), &frame.labels, &boxes);
    write("boxes.json", coco.json().to_string().as_bytes())?;
    write("boxes.txt", labels::kitti_text(&boxes, 1).as_bytes())?;
    Ok(light)
}
