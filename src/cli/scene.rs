//! `spikelane scene`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use clap::builder::PossibleValuesParser;
use spikelane::scene::{Lighting, Rendered, Samples, Scene, SceneOptions, labels};
use spikelane::{Error, Kind, Result, storage};

/// Draw a random driving scene and its labels as pictures
///
/// Writes NNNN.light.png, .depth.png, .flow.png, .semantic.png, .instance.png and .boxes.json for every frame.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    /// Folder to write to; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Seed of the scene
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
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
    /// Threads [default: one per CPU]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
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
pub fn run(args: &Args) -> Result<()> {
    if !(args.rate.is_finite() && args.rate > 0.0) {
        return Err(Error::new(Kind::Usage, "frame rate").found(args.rate).expected("a positive number"));
    }
    let cpus = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = args.threads.map_or(cpus, usize::from);
    let options = SceneOptions {
        width: args.width,
        height: args.height,
        lighting: args.lighting.as_deref().and_then(Lighting::from_name),
        duration_s: f64::from(args.frames) / args.rate,
        ..SceneOptions::default()
    };
    let scene = Scene::random(args.seed, &options)?;
    std::fs::create_dir_all(&args.output).map_err(|e| Error::io(args.output.display(), e))?;
    let mut video = if args.video { Some(Video::start(&args.output, args)?) } else { None };
    let samples = if args.samples == "16" { Samples::Sixteen } else { Samples::Four };
    for i in 0..args.frames {
        let t = f64::from(i) / args.rate;
        let frame = scene.render(t, samples, threads)?;
        let light = pictures(args, &scene, &frame, i, threads)?;
        if let Some(video) = &mut video {
            video.push(&light)?;
        }
    }
    if let Some(video) = video {
        video.finish()?;
    }
    println!(
        "{}: {} frame(s) of scene {}, {}, {} vehicles, white at {} cd/m2",
        args.output.display(),
        args.frames,
        scene.seed(),
        scene.lighting().name(),
        scene.vehicles(),
        scene.white_cd_m2()
    );
    Ok(())
}

/// Writes everything about one frame; returns the picture of its light.
fn pictures(args: &Args, scene: &Scene, frame: &Rendered, i: u32, threads: usize) -> Result<Vec<u8>> {
    let write = |kind: &str, bytes: &[u8]| {
        storage::write_small(&args.output.join(format!("{i:04}.{kind}")), bytes, args.force)
    };
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
    let mut coco = labels::Coco::default();
    coco.add(&format!("{i:04}.light.png"), u64::from(i), &frame.labels, &boxes);
    write("boxes.json", coco.json().to_string().as_bytes())?;
    write("boxes.txt", labels::kitti_text(&boxes, 1).as_bytes())?;
    Ok(light)
}

/// The user's ffmpeg, fed with pictures.
struct Video {
    child: Child,
    hidden: PathBuf,
    path: PathBuf,
}

impl Video {
    fn start(folder: &Path, args: &Args) -> Result<Self> {
        let (path, hidden) = (folder.join("scene.mp4"), folder.join(".scene.partial.mp4"));
        if path.exists() && !args.force {
            return Err(Error::new(Kind::Exists, path.display())
                .found("a file")
                .remedy("allow overwriting (--force)"));
        }
        let child = Command::new("ffmpeg")
            .args([
                "-v",
                "error",
                "-y",
                "-f",
                "image2pipe",
                "-c:v",
                "png",
                "-framerate",
                &args.rate.to_string(),
            ])
            .args(["-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"])
            .arg(&hidden)
            .stdin(Stdio::piped())
            .spawn()
            .map_err(|e| {
                Error::new(Kind::Tool, "ffmpeg").found(e).remedy("install it, or leave --video out")
            })?;
        Ok(Self { child, hidden, path })
    }

    fn push(&mut self, png: &[u8]) -> Result<()> {
        let pipe =
            self.child.stdin.as_mut().ok_or_else(|| Error::new(Kind::Tool, "ffmpeg").found("no pipe"))?;
        pipe.write_all(png).map_err(|e| Error::new(Kind::Tool, "ffmpeg").found(e))
    }

    fn finish(mut self) -> Result<()> {
        drop(self.child.stdin.take());
        let status = self.child.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        if !status.success() {
            return Err(Error::new(Kind::Tool, "ffmpeg").found(status).expected("success"));
        }
        std::fs::rename(&self.hidden, &self.path).map_err(|e| Error::io(self.path.display(), e))
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // Over already when all went well.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.hidden);
    }
}
