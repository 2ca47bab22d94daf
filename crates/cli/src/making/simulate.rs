//! `spikelane simulate`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::{Backend, Camera, Error, Kind, Plan, Result, Seeds};
use spikelane_io::formats::{Layout, Opening};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{
    Ahead, CameraFacts, Looks, Outcome, Run, Sidecar, StreamFacts, Written, run_looking, save_camera,
};
use spikelane_io::storage;
use spikelane_measure::report::with_known;

use super::closing;
use super::forecast;
use super::images;
use super::images::ImageArgs;
use super::light::{Light, LightArgs};
use super::names::Names;
use crate::shared::camera::CameraArgs;
use crate::shared::output::{Out, command_line};
use crate::shared::picture;
use crate::shared::progress::{Progress, Stop, stop_flag};
use crate::shared::seeds::SeedArgs;
use crate::shared::stem::Stem;
use crate::shared::threads::ThreadArgs;

/// Turn light into a spike stream
///
/// Writes STEM.dat (the stream), STEM.json (how it was made, and its digest) and STEM.png (a first
/// look); with --clean also STEM.clean.dat, the noise-free twin from the same start phase.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    #[command(flatten)]
    pub light: LightArgs,
    /// Where to write: STEM.dat, STEM.json, STEM.png; a folder (out/) or the stream's own name (run.dat) will do
    #[arg(short, long, value_name = "STEM")]
    pub output: PathBuf,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub seeds: SeedArgs,
    /// Number of the sequence; sequences of one seed share no noise
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub sequence: u64,
    /// Also write the noise-free twin
    #[arg(long)]
    pub clean: bool,
    #[command(flatten)]
    pub images: ImageArgs,
    /// Layout to write [default: npy-bytes for an output that ends in .npy, else dat]
    #[arg(hide_short_help = true, long, value_name = "LAYOUT", value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub to: Option<String>,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Instructions to use; the bits are the same
    #[arg(hide_short_help = true, long, default_value = "auto",
          value_parser = PossibleValuesParser::new(["auto", "reference", "portable", "sse4.1", "avx2", "avx512"]))]
    pub backend: String,
    /// Say what would be written and how long it would take, and write nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Overwrite files of the same name
    #[arg(long)]
    pub force: bool,
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let to = args.to.as_deref().map(Layout::parse).transpose()?;
    let stem = Stem::new(&args.output, to, &args.light.name())?;
    let (layout, names) = (stem.layout, Names::new(&stem));
    let camera = args.light.sized(args.camera.camera()?)?;
    // Held until the last file has its name.
    let claim = || names.claim(args.clean, args.images.images_every.is_some(), args.force);
    let _claim = (!args.dry_run).then(claim).transpose()?;
    if args.images.images_every.is_some() {
        images::check(&names.images)?;
    }
    // From here on a request to stop is answered in order.
    let stop = stop_flag()?;
    let light = args.light.open(&camera)?;
    let job = job(args, &camera, &light, (layout, &names), out)?;
    // Before anything is reserved: what the layout cannot hold, and what would not plan.
    layout.frame_bytes(camera.sensor.geometry)?;
    Plan::with_light(&camera, job.seeds, job.greatest_light.unwrap_or(1.0))?;
    for warning in &light.warnings {
        out.say(format_args!("warning: {warning}"));
    }
    let needed = needed_bytes(args, &job, &light, layout)?;
    let free = storage::free_space(&absolute(&names.noisy))?;
    let about = json!({
        "event": "start", "source": light.source.describe(), "light": light.source.front_end().to_string(), "camera": camera.name,
        "width": camera.sensor.geometry.width(), "height": camera.sensor.geometry.height(),
        "free_bytes": free, "backend": job.backend.name(), "threads": job.threads, "layout": layout.name(),
    });
    let expected = job.expected(light.source.frames());
    out.event(&with_known(
        about,
        [("readouts", expected.map(Into::into)), ("bytes", needed.map(Into::into))],
    ))?;
    if args.dry_run {
        return forecast::forecast(args.clean, &job, light, free, out);
    }
    if let (Some(needed), Some(free)) = (needed, free)
        && needed > free
    {
        return Err(Error::new(Kind::Space, names.noisy.display())
            .found(format_args!("{} free on the disk", DecimalBytes(free)))
            .expected(format_args!("{} for the streams", DecimalBytes(needed)))
            .remedy("free some space, choose another disk, or give fewer --readouts"));
    }
    simulate(args, &job, light, stop, &names, out)
}

fn job(
    args: &Args,
    camera: &Camera,
    light: &Light,
    (layout, names): (Layout, &Names),
    out: &Out,
) -> Result<Run> {
    let seeds = Seeds { sequence: args.sequence, ..args.seeds.seeds() };
    let backend = if args.backend == "auto" { Backend::best() } else { Backend::parse(&args.backend)? };
    Ok(Run {
        readouts: light.readouts,
        greatest_light: args.light.greatest_light,
        layout,
        force: args.force,
        backend,
        threads: args.threads.number(out),
        stale: if args.force { vec![names.sidecar.clone(), names.picture.clone()] } else { Vec::new() },
        ..Run::new(camera.clone(), seeds, light.timeline.clone())
    })
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

fn needed_bytes(args: &Args, job: &Run, light: &Light, layout: Layout) -> Result<Option<u64>> {
    let Some(readouts) = job.expected(light.source.frames()).or(job.readouts) else { return Ok(None) };
    let one = layout.file_bytes(job.camera.sensor.geometry, readouts)?;
    Ok(Some(one.saturating_mul(1 + u64::from(args.clean))))
}

fn simulate(args: &Args, job: &Run, light: Light, stop: Stop, names: &Names, out: &Out) -> Result<()> {
    let facts = light.facts(&args.light, &job.camera);
    let front_end = light.source.front_end();
    let (layout, clean) = (job.layout, args.clean.then_some(names.clean.as_path()));
    let mut progress = Progress::new(out, stop.clone());
    let mut source = Ahead::new(light.source, stop);
    let start = Instant::now();
    let mut watch = |done, total| progress.step(done, total);
    let mut images = images::Folder::begin(args.images, &names.images)?;
    let mut keep = |readout: u64, light: &Frame| images.as_mut().map_or(Ok(()), |i| i.keep(readout, light));
    let looks = args.images.images_every.map(|every| Looks { every, keep: &mut keep });
    let ran = run_looking(job, &mut source, &names.noisy, clean, looks, &mut watch);
    let outcome = ran.map_err(|e| progress.cause(e))?;
    drop(progress);
    let seconds = start.elapsed().as_secs_f64();
    if job.camera.maps != spikelane::effects::Maps::default() {
        save_camera(&job.camera, &names.camera, args.force)?;
    }
    picture(args, job, &outcome, layout, names)?;
    let images = images.map(images::Folder::finish).transpose()?;
    let geometry = job.camera.sensor.geometry;
    let facts_of = |written: &Written| StreamFacts::new(written, geometry, outcome.readouts);
    let sidecar = Sidecar {
        readout_hz: Some(job.camera.sensor.readout_hz),
        images,
        clean: outcome.clean.as_ref().map(facts_of),
        seeds: Some(Sidecar::seed_facts(job.seeds)),
        light: Some(spikelane_io::simulate::LightFacts {
            frames: outcome.frames,
            greatest_light: outcome.greatest_light,
            frames_beyond_greatest_light: outcome.too_bright,
            ..facts
        }),
        camera: Some(CameraFacts::new(&job.camera)?),
        command: command_line(),
        ..Sidecar::new(geometry, layout, outcome.readouts, facts_of(&outcome.noisy))
    };
    if let Some(caveat) = layout.caveat(geometry) {
        out.say(format_args!("note: {}: {caveat}", names.noisy.display()));
    }
    // Last, so that a sidecar always speaks of files that are there.
    sidecar.write(&names.sidecar, args.force)?;
    closing::Closing { job, light: front_end, outcome: &outcome, sidecar: &sidecar, names, seconds }.tell(out)
}

fn picture(args: &Args, job: &Run, outcome: &Outcome, layout: Layout, names: &Names) -> Result<()> {
    let geometry = Some(job.camera.sensor.geometry);
    let written = Opening { layout: Some(layout), geometry, ..Opening::default() };
    let noisy = written.open_written(&outcome.noisy.path)?;
    let clean = outcome.clean.as_ref().map(|c| written.open_written(&c.path)).transpose()?;
    // No pixel fires more than once a readout, however bright.
    let full = job.camera.sensor.thresholds_at_full_scale.clamp(1e-6, 1.0) as f32;
    let sheet = picture::sheet(&outcome.glance, &noisy, clean.as_ref(), full)?;
    storage::write_small(&names.picture, &sheet, args.force)
}
