//! Implements `spikelane simulate`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::{Backend, Camera, Error, ErrorKind, Plan, Result, Seeds};
use spikelane_io::formats::{Layout, OpenOptions, StreamSummary};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{
    CameraFacts, LightFacts, LightTap, MosaicFacts, ReadAhead, RunObserver, RunOptions, RunSummary, Sidecar,
    StreamFacts, run as run_source, save_camera,
};
use spikelane_io::storage;
use spikelane_measure::report::insert_present;

use super::forecast;
use super::images;
use super::images::ImageArgs;
use super::light::{LightArgs, RunLight, print_new_notes};
use super::summary;
use crate::common::{
    CameraArgs, Console, CountProgress, OutputNames, OutputStem, SeedArgs, StopSignal, ThreadArgs,
    command_line, contact_sheet, stop_flag,
};

/// Simulate a spike stream from light
///
/// The command writes STEM.dat (the stream), STEM.json (the sidecar with settings and digest) and STEM.png (a preview).
/// With --clean, the command also writes STEM.clean.dat, the stream of the same camera without noise, with the same
/// start charges.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    #[command(flatten)]
    pub light: LightArgs,
    /// Write STEM.dat, STEM.json and STEM.png
    ///
    /// STEM is the common start of the file names, a folder (out/), or the name of the stream (run.dat, run.npy).
    #[arg(short, long, value_name = "STEM")]
    pub output: PathBuf,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub seeds: SeedArgs,
    /// Set the number of the sequence; sequences with the same seed have independent noise
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub sequence: u64,
    /// Also write STEM.clean.dat, without noise
    #[arg(long)]
    pub clean: bool,
    #[command(flatten)]
    pub images: ImageArgs,
    /// Set the layout of the stream file [default: npy-bytes for .npy outputs, else dat]
    #[arg(hide_short_help = true, long, value_name = "LAYOUT", value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub to: Option<String>,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Set the instruction set of the kernels
    ///
    /// All sets give the same spikes.
    #[arg(hide_short_help = true, long, default_value = "auto",
          value_parser = PossibleValuesParser::new(["auto", "reference", "portable", "sse4.1", "avx2", "avx512"]))]
    pub backend: String,
    /// Only estimate the output size and the run time
    #[arg(long)]
    pub dry_run: bool,
    /// Overwrite existing files
    #[arg(long)]
    pub force: bool,
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let to = args.to.as_deref().map(Layout::parse).transpose()?;
    let stem = OutputStem::new(&args.output, to, &args.light.stem_name())?;
    let (layout, names) = (stem.layout, OutputNames::new(&stem));
    let camera = args.light.with_input_size(args.camera.camera()?)?;
    // The claim lasts until the last file has its final name.
    let claim = || names.claim(args.clean, args.images.images_every.is_some(), args.force);
    let _claim = (!args.dry_run).then(claim).transpose()?;
    if args.images.images_every.is_some() {
        images::check_replaceable(&names.images)?;
    }
    // From here on, signals set the stop flag instead of ending the process.
    let stop = stop_flag()?;
    let light = args.light.open(&camera)?;
    let job = run_options(args, &camera, &light, (layout, &names), out)?;
    job.check_duration(light.source.frames())?;
    // Layout and plan are checked before disk space is reserved.
    layout.frame_bytes(camera.sensor.geometry)?;
    Plan::with_max_light(&camera, job.seeds, job.max_light.unwrap_or(1.0))?;
    for warning in &light.warnings {
        out.print_message(format_args!("warning: {warning}"));
    }
    let needed = required_bytes(args, &job, &light, layout)?;
    let free = storage::free_space(&absolute_path(&names.stream))?;
    let event = json!({
        "event": "start", "source": light.source.describe(), "light": LightFacts::summary(&*light.source), "camera": camera.name,
        "width": camera.sensor.geometry.width(), "height": camera.sensor.geometry.height(),
        "free_bytes": free, "backend": job.backend.name(), "threads": job.threads, "layout": layout.name(),
    });
    let expected = job.expected_readouts(light.source.frames());
    out.print_event(&insert_present(
        event,
        [("readouts", expected.map(Into::into)), ("bytes", needed.map(Into::into))],
    ))?;
    if args.dry_run {
        return forecast::print_forecast(args.clean, &job, light, free, out);
    }
    if let (Some(needed), Some(free)) = (needed, free)
        && needed > free
    {
        return Err(Error::new(ErrorKind::Space, names.stream.display())
            .found(format_args!("{} free on the disk", DecimalBytes(free)))
            .expected(format_args!("{} for the streams", DecimalBytes(needed)))
            .remedy("free some space, choose another disk, or reduce --readouts"));
    }
    run_simulation(args, &job, light, stop, &names, out)
}

fn run_options(
    args: &Args,
    camera: &Camera,
    light: &RunLight,
    (layout, names): (Layout, &OutputNames),
    out: &Console,
) -> Result<RunOptions> {
    let seeds = Seeds { sequence: args.sequence, ..args.seeds.seeds() };
    let backend = if args.backend == "auto" { Backend::best() } else { args.backend.parse()? };
    Ok(RunOptions {
        readouts: light.readouts,
        max_light: args.light.max_light,
        layout,
        force: args.force,
        backend,
        threads: args.threads.thread_count(out),
        stale_files: if args.force { vec![names.sidecar.clone(), names.picture.clone()] } else { Vec::new() },
        ..RunOptions::new(camera.clone(), seeds, light.timeline.clone())
    })
}

fn absolute_path(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

fn required_bytes(args: &Args, job: &RunOptions, light: &RunLight, layout: Layout) -> Result<Option<u64>> {
    let Some(readouts) = job.expected_readouts(light.source.frames()).or(job.readouts) else {
        return Ok(None);
    };
    let one = layout.file_bytes(job.camera.sensor.geometry, readouts)?;
    Ok(Some(one.saturating_mul(1 + u64::from(args.clean))))
}

fn run_simulation(
    args: &Args,
    job: &RunOptions,
    light: RunLight,
    stop: StopSignal,
    names: &OutputNames,
    out: &Console,
) -> Result<()> {
    let facts = light.facts(&args.light, &job.camera);
    let light_summary = LightFacts::summary(&*light.source);
    let (layout, clean) = (job.layout, args.clean.then_some(names.clean_stream.as_path()));
    let mut progress = CountProgress::new(out, stop.clone());
    let warnings = light.warnings;
    let mut source = ReadAhead::new(light.source, stop);
    let start = Instant::now();
    let mut watch = |done, total| progress.update(done, total);
    let mut images = images::ImageFolder::create(args.images, &names.images)?;
    let mut keep = |readout: u64, light: &Frame| images.as_mut().map_or(Ok(()), |i| i.write(readout, light));
    let light_tap = args.images.images_every.map(|every| LightTap { every, on_light: &mut keep });
    let observer = RunObserver { light_tap, progress: Some(&mut watch) };
    let ran = run_source(job, &mut source, &names.stream, clean, observer);
    let outcome = ran.map_err(|e| progress.error_or_interrupt(e))?;
    drop(progress);
    print_new_notes(&source, &warnings, out);
    let seconds = start.elapsed().as_secs_f64();
    if job.camera.maps != spikelane::effects::Maps::default() {
        save_camera(&job.camera, &names.camera, args.force)?;
    }
    write_picture(args, job, &outcome, layout, names)?;
    let images = images.map(images::ImageFolder::finish).transpose()?;
    let geometry = job.camera.sensor.geometry;
    let facts_of = |written: &StreamSummary| StreamFacts::new(written, geometry, outcome.readouts);
    let sidecar = Sidecar {
        readout_hz: Some(job.camera.sensor.readout_hz),
        images,
        clean: outcome.clean.as_ref().map(facts_of),
        seeds: Some(Sidecar::seed_facts(job.seeds)),
        light: Some(LightFacts {
            frames: outcome.frames,
            max_light: outcome.max_light,
            frames_above_max_light: outcome.frames_above_max_light,
            ..facts
        }),
        camera: Some(CameraFacts::new(&job.camera)?),
        mosaic: job.camera.window_mosaic().as_ref().map(MosaicFacts::new),
        command: command_line(),
        ..Sidecar::new(geometry, layout, outcome.readouts, facts_of(&outcome.noisy))
    };
    if let Some(caveat) = layout.caveat(geometry) {
        out.print_message(format_args!("note: {}: {caveat}", names.stream.display()));
    }
    // The sidecar is written last, because it must never describe files that do not exist.
    sidecar.write(&names.sidecar, args.force)?;
    summary::RunReport {
        options: job,
        light: light_summary,
        outcome: &outcome,
        sidecar: &sidecar,
        names,
        seconds,
    }
    .print(out)
}

fn write_picture(
    args: &Args,
    job: &RunOptions,
    outcome: &RunSummary,
    layout: Layout,
    names: &OutputNames,
) -> Result<()> {
    let geometry = Some(job.camera.sensor.geometry);
    let written = OpenOptions { layout: Some(layout), geometry, ..OpenOptions::default() };
    let noisy = written.open_written(&outcome.noisy.path)?;
    let clean = outcome.clean.as_ref().map(|c| written.open_written(&c.path)).transpose()?;
    // The rate is limited to 1, because a pixel fires at most once per readout.
    let full = job.camera.sensor.thresholds_at_full_scale.clamp(1e-6, 1.0) as f32;
    let mosaic = job.camera.window_mosaic();
    let sheet = contact_sheet(&outcome.light_sample, &noisy, clean.as_ref(), full, mosaic.as_ref())?;
    storage::write_small(&names.picture, &sheet, args.force)
}
