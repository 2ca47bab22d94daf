//! Implements `spikelane scene`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use serde_json::json;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::storage;
use spikelane_scene::{Exposure, Lens, RenderedFrame, SamplesPerPixel, Scene, SceneOptions, labels};

use crate::common::{
    Console, CountProgress, FrameEncoding, LightingArg, SceneSeed, ThreadArgs, VideoWriter, claim_folder,
    stop_flag,
};

/// Suffixes of the files that are written for each frame.
const FILE_KINDS: [&str; 8] = [
    "light.png",
    "depth.png",
    "flow.png",
    "semantic.png",
    "instance.png",
    "boxes.png",
    "boxes.json",
    "boxes.txt",
];

/// Returns the file name of frame `i` with the suffix `kind`.
fn file_name(i: u32, kind: &str) -> String {
    format!("{i:04}.{kind}")
}

/// Draw a random driving scene with its labels as images
///
/// For every frame NNNN, the command writes NNNN.light.png, NNNN.depth.png, NNNN.flow.png, NNNN.semantic.png,
/// NNNN.instance.png, NNNN.boxes.png, NNNN.boxes.json (COCO) and NNNN.boxes.txt (KITTI).
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Write the images to this folder
    ///
    /// The folder is created if necessary.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub seeds: SceneSeed,
    /// Set the lighting, such as dusk
    ///
    /// The lighting is noon, low-sun, overcast, rain, tunnel, dusk, night, or random, which the scene seed selects.
    #[arg(long, value_name = "NAME", hide_possible_values = true, default_value = "random", value_parser = LightingArg::parser())]
    pub lighting: LightingArg,
    /// Draw without blur, glare, vignetting and distortion
    #[arg(long)]
    pub ideal_lens: bool,
    /// Keep the exposure as it is at the start
    #[arg(long)]
    pub lock_exposure: bool,
    /// Set the number of frames
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Set the frames per second
    #[arg(long, value_name = "HZ", default_value_t = 25.0)]
    pub fps: f64,
    /// Set the width in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 400)]
    pub width: u32,
    /// Set the height in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 250)]
    pub height: u32,
    /// Set the color samples per pixel: 4 or 16
    #[arg(long, default_value = "4", hide_possible_values = true, value_parser = PossibleValuesParser::new(["4", "16"]))]
    pub samples: String,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Also write the light as DIR/scene.mp4, with ffmpeg
    #[arg(long)]
    pub video: bool,
    /// Overwrite existing files
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
///
/// # Errors
/// If the options of the scene are invalid, if a file exists, or if ffmpeg is missing.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if !(args.fps.is_finite() && args.fps > 0.0) {
        return Err(Error::new(ErrorKind::Usage, "frame rate").found(args.fps).expected("a positive number"));
    }
    let threads = args.threads.thread_count(out);
    let options = SceneOptions {
        width: args.width,
        height: args.height,
        lighting: args.lighting.fixed(),
        duration_s: f64::from(args.frames) / args.fps,
        lens: args.ideal_lens.then_some(Lens::IDEAL),
        exposure: if args.lock_exposure { Exposure::Locked } else { Exposure::Automatic },
        ..SceneOptions::default()
    };
    let scene = Scene::from_seed(args.seeds.scene_seed, &options)?;
    let _claim = claim_folder(&args.output)?;
    for i in 0..args.frames {
        storage::refuse_existing(
            &args.output,
            &FILE_KINDS.map(|kind| file_name(i, kind)).each_ref().map(|n| &**n),
            args.force,
        )?;
    }
    let mut video = if args.video {
        let path = args.output.join("scene.mp4");
        Some(VideoWriter::start(&path, FrameEncoding::Png, args.fps, args.force)?)
    } else {
        None
    };
    let samples = if args.samples == "16" { SamplesPerPixel::Sixteen } else { SamplesPerPixel::Four };
    let mut progress = CountProgress::with_unit(out, stop_flag()?, "frames");
    for i in 0..args.frames {
        progress.update(i.into(), Some(args.frames.into()))?;
        let t = f64::from(i) / args.fps;
        let frame = scene.render(t, samples, threads)?;
        let light = write_frame(args, &scene, &frame, i, threads)?;
        if let Some(video) = &mut video {
            video.push(&light).map_err(|e| progress.error_or_interrupt(e))?;
        }
    }
    if let Some(video) = video {
        video.finish()?;
    }
    drop(progress);
    let white = scene.white_cd_m2(0.0, threads)?;
    let event = json!({
        "event": "done", "output": args.output.display().to_string(), "frames": args.frames,
        "scene_seed": scene.seed(), "lighting": scene.lighting().name(), "vehicles": scene.vehicles(),
        "white_cd_m2": white,
    });
    let text = format!(
        "{}: {} of scene {}, {}, {}, white at {white:.4} cd/m2\n",
        args.output.display(),
        Count(args.frames, "frame"),
        scene.seed(),
        scene.lighting().name(),
        Count(scene.vehicles(), "vehicle"),
    );
    out.print_result(&event, &text)
}

/// Writes all files of frame `i`. Returns the image of its light.
fn write_frame(args: &Args, scene: &Scene, frame: &RenderedFrame, i: u32, threads: usize) -> Result<Vec<u8>> {
    let write = |kind: &str, bytes: &[u8]| {
        storage::write_small(&args.output.join(file_name(i, kind)), bytes, args.force)
    };
    let white = scene.white_cd_m2(frame.labels.t, threads)?;
    let light = labels::light_preview(frame, white)?;
    write("light.png", &light)?;
    write("depth.png", &labels::depth_preview(&frame.labels)?)?;
    write("semantic.png", &labels::semantic_preview(&frame.labels)?)?;
    write("instance.png", &labels::instance_preview(&frame.labels)?)?;
    // The flow of the last frame ends at the end of the drive. No frame is written for this instant.
    let later = scene.labels((frame.labels.t + 1.0 / args.fps).min(scene.duration_s()), threads)?;
    let flow = scene.flow(&frame.labels, &later, threads)?;
    write("flow.png", &labels::flow_preview(&flow, 0.05 * args.width as f32)?)?;
    let boxes = scene.boxes(&frame.labels)?;
    write("boxes.png", &labels::boxes_preview(frame, white, &boxes)?)?;
    let mut coco = labels::CocoAnnotations::default();
    coco.add(&file_name(i, "light.png"), u64::from(i), &frame.labels, &boxes);
    write("boxes.json", coco.to_json().to_string().as_bytes())?;
    write("boxes.txt", labels::kitti_box_file(&boxes, 1).as_bytes())?;
    Ok(light)
}
