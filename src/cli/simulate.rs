//! `spikelane simulate`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use serde_json::json;
use spikelane::formats::{Layout, Reader};
use spikelane::light::Frame;
use spikelane::sensor::FrontEnd;
use spikelane::simulate::{
    Ahead, CameraFacts, FrameRef, Looks, Outcome, Run, Sidecar, StreamFacts, Written, run_looking,
    save_camera,
};
use spikelane::{Backend, Camera, Error, Kind, Plan, Result, Seeds, Simulator, storage};

use super::camera::CameraArgs;
use super::images::{self, ImageArgs};
use super::light::{Light, LightArgs};
use super::output::{Out, bytes_text, command_line};
use super::picture;
use super::progress::{Progress, Stop, stop_flag};

/// Turn light into a spike stream
///
/// Writes STEM.dat (the stream), STEM.json (how it was made, and its digest) and STEM.png (a first
/// look); with --clean also STEM.clean.dat, the noise-free twin from the same start phase.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    #[command(flatten)]
    pub light: LightArgs,
    /// Where to write: STEM.dat, STEM.json, STEM.png
    #[arg(short, long, value_name = "STEM")]
    pub output: PathBuf,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Seed of the temporal noise and the start phase
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub seed: u64,
    /// Seed of the fixed pattern: which camera of the kind it is
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub camera_seed: u64,
    /// Number of the sequence; sequences of one seed share no noise
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub sequence: u64,
    /// Also write the noise-free twin
    #[arg(long)]
    pub clean: bool,
    #[command(flatten)]
    pub images: ImageArgs,
    /// How frames lie in the file
    #[arg(long, value_name = "LAYOUT", default_value = "dat",
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub layout: String,
    /// Threads [default: one per CPU]; the bits are the same for any number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Instructions to use; the bits are the same
    #[arg(long, default_value = "auto",
          value_parser = PossibleValuesParser::new(["auto", "reference", "portable", "avx2", "avx512"]))]
    pub backend: String,
    /// Say what would be written and how long it would take, and write nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Overwrite files of the same name
    #[arg(long)]
    pub force: bool,
}

/// The names that come out of a stem; it may hold dots, so endings are appended.
pub struct Names {
    pub noisy: PathBuf,
    pub clean: PathBuf,
    pub sidecar: PathBuf,
    pub picture: PathBuf,
    pub camera: PathBuf,
    pub images: PathBuf,
}

impl Names {
    pub fn new(stem: &Path, layout: Layout) -> Self {
        let name = |ending: &str| {
            let mut whole = stem.as_os_str().to_os_string();
            whole.push(ending);
            PathBuf::from(whole)
        };
        let data = layout.default_extension();
        Self {
            noisy: name(&format!(".{data}")),
            clean: name(&format!(".clean.{data}")),
            sidecar: name(".json"),
            picture: name(".png"),
            camera: name(".camera"),
            images: name(".images"),
        }
    }

    /// The files of a run with or without a clean twin.
    pub fn files(&self, clean: bool) -> Vec<&Path> {
        let all = [(&self.noisy, true), (&self.clean, clean), (&self.sidecar, true), (&self.picture, true)];
        all.into_iter().filter(|(_, wanted)| *wanted).map(|(path, _)| path.as_path()).collect()
    }

    fn refuse_existing(&self, clean: bool, images: bool) -> Result<()> {
        let images = images.then_some(self.images.as_path());
        let taken = self.files(clean).into_iter().chain(images).find(|path| path.symlink_metadata().is_ok());
        match taken {
            None => Ok(()),
            Some(path) => Err(Error::new(Kind::Exists, path.display())
                .found("a file of that name")
                .expected("a free name")
                .remedy("choose another --output, or allow overwriting with --force")),
        }
    }
}

pub fn run(args: &Args, out: &Out) -> Result<()> {
    let layout: Layout = args.layout.parse()?;
    let camera = args.camera.camera()?;
    let names = Names::new(&args.output, layout);
    if args.output.file_name().is_none() {
        return Err(Error::new(Kind::Usage, args.output.display())
            .found("no file name")
            .expected("a stem, such as out/run"));
    }
    if !args.dry_run && !args.force {
        names.refuse_existing(args.clean, args.images.images_every.is_some())?;
    }
    if args.images.images_every.is_some() {
        images::check(&names.images)?;
    }
    // From here on a request to stop is answered in order.
    let stop = stop_flag()?;
    let light = args.light.open(&camera)?;
    let job = job(args, &camera, &light, layout, &names)?;
    // Before anything is reserved: what the layout cannot hold, and what would not plan.
    layout.frame_bytes(camera.sensor.geometry)?;
    Plan::with_light(&camera, job.seeds, job.greatest_light.unwrap_or(1.0))?;
    if let Some(warning) = &light.warning {
        out.say(format_args!("warning: {warning}"));
    }
    let needed = needed_bytes(args, &job, &light, layout)?;
    let free = storage::free_space(&absolute(&names.noisy))?;
    out.event(&json!({
        "event": "start", "source": light.source.describe(), "light": light.source.front_end().to_string(), "camera": camera.name,
        "width": camera.sensor.geometry.width(), "height": camera.sensor.geometry.height(),
        "readouts": job.expected(light.source.frames()), "bytes": needed, "free_bytes": free,
        "backend": job.backend.name(), "threads": job.threads, "layout": layout.name(),
    }))?;
    if args.dry_run {
        return dry_run(args, &job, &light, needed, free, out);
    }
    if needed.is_some_and(|needed| needed > free) {
        return Err(Error::new(Kind::Space, names.noisy.display())
            .found(format_args!("{} free on the disk", bytes_text(free)))
            .expected(format_args!("{} for the streams", bytes_text(needed.unwrap_or(0))))
            .remedy("free some space, choose another disk, or give fewer --readouts"));
    }
    simulate(args, &job, light, stop, &names, out)
}

fn job(args: &Args, camera: &Camera, light: &Light, layout: Layout, names: &Names) -> Result<Run> {
    let seeds = Seeds { camera: args.camera_seed, shot: args.seed, sequence: args.sequence };
    let backend = if args.backend == "auto" { Backend::best() } else { Backend::parse(&args.backend)? };
    let cpus = std::thread::available_parallelism().map_or(1, usize::from);
    Ok(Run {
        readouts: light.readouts,
        greatest_light: args.light.greatest_light,
        layout,
        force: args.force,
        backend,
        threads: args.threads.map_or(cpus, usize::from),
        stale: if args.force { vec![names.sidecar.clone(), names.picture.clone()] } else { Vec::new() },
        ..Run::new(camera.clone(), seeds, light.timeline)
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
    let mut source = Ahead::new(light.source, stop)?;
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
        light: Some(spikelane::simulate::LightFacts {
            frames: outcome.frames,
            greatest_light: outcome.greatest_light,
            frames_beyond_greatest_light: outcome.too_bright,
            ..facts
        }),
        camera: Some(CameraFacts::new(&job.camera)?),
        command: command_line(),
        ..Sidecar::new(geometry, layout, outcome.readouts, facts_of(&outcome.noisy))
    };
    // Last, so that a sidecar always speaks of files that are there.
    sidecar.write(&names.sidecar, args.force)?;
    report((job, front_end), &outcome, &sidecar, names, seconds, out)
}

fn picture(args: &Args, job: &Run, outcome: &Outcome, layout: Layout, names: &Names) -> Result<()> {
    let geometry = Some(job.camera.sensor.geometry);
    let noisy = Reader::open(&outcome.noisy.path, Some(layout), geometry)?;
    let clean = outcome.clean.as_ref().map(|c| Reader::open(&c.path, Some(layout), geometry)).transpose()?;
    // No pixel fires more than once a readout, however bright.
    let full = job.camera.sensor.thresholds_at_full_scale.clamp(1e-6, 1.0) as f32;
    let sheet = picture::sheet(&outcome.glance, &noisy, clean.as_ref(), full)?;
    storage::write_small(&names.picture, &sheet, args.force)
}

fn report(
    (job, light): (&Run, FrontEnd),
    o: &Outcome,
    sidecar: &Sidecar,
    names: &Names,
    seconds: f64,
    out: &Out,
) -> Result<()> {
    let streams = 1 + u64::from(o.clean.is_some());
    let pixels = job.camera.sensor.geometry.pixels() as f64 * o.readouts as f64;
    // How fast the simulation is, not how slow the light.
    let waited = o.waited.as_secs_f64();
    let busy = (seconds - waited).max(1e-9);
    let speed = pixels * streams as f64 / busy / 1e9;
    let real_time = o.readouts as f64 / job.camera.sensor.readout_hz / busy;
    let line = |what: &str, w: &Written, rate: f64| {
        format!("{what}  {}  {}, mean rate {rate:.4}", w.path.display(), bytes_text(w.bytes))
    };
    // The first line: which curve was used is what a wrong brightness is most often due to.
    out.say(format_args!("{}; light: {light}", line("noisy  ", &o.noisy, sidecar.stream.mean_rate)));
    if let (Some(written), Some(facts)) = (&o.clean, &sidecar.clean) {
        out.say(line("clean  ", written, facts.mean_rate));
    }
    out.say(format_args!("sidecar  {}\npicture  {}", names.sidecar.display(), names.picture.display()));
    out.say(format_args!(
        "{} readouts of {} in {seconds:.2} s, {waited:.2} s of it waiting for light; otherwise \
         {speed:.2} Gpixel-readouts/s, {real_time:.2} x real time \
         ({}, {} {}, {streams} {}; {:.2} s of it to bring the files to the disk)",
        o.readouts,
        job.camera.sensor.geometry,
        job.backend,
        job.threads,
        if job.threads == 1 { "thread" } else { "threads" },
        if streams == 1 { "stream" } else { "streams" },
        o.synced.as_secs_f64(),
    ));
    if o.clean.is_none() && names.clean.exists() {
        let left = names.clean.display();
        out.say(format_args!(
            "note: {left} is of an earlier run and was left as it was; --clean makes a new one"
        ));
    }
    if sidecar.images.is_none() && names.images.exists() {
        let left = names.images.display();
        out.say(format_args!(
            "note: {left} is of an earlier run and was left as it was; --images-every makes new ones"
        ));
    }
    if let Some(wanted) = job.readouts.filter(|&n| n > o.readouts) {
        out.say(format_args!("note: the input ended after {} of {wanted} readouts", o.readouts));
    }
    if o.too_bright > 0 {
        out.say(format_args!(
            "note: {} of {} frames held light beyond {} full scales, which was cut (--greatest-light)",
            o.too_bright, o.frames, o.greatest_light
        ));
    }
    out.event(&json!({
        "event": "done", "readouts": o.readouts, "seconds": seconds,
        "simulation_seconds": o.simulated.as_secs_f64(), "sync_seconds": o.synced.as_secs_f64(),
        "light_seconds": waited,
        "gigapixel_readouts_per_second": speed, "times_real_time": real_time,
        "noisy": names.noisy.display().to_string(), "digest": o.noisy.digest,
        "clean": o.clean.as_ref().map(|c| c.path.display().to_string()),
        "clean_digest": o.clean.as_ref().map(|c| &c.digest),
        "sidecar": names.sidecar.display().to_string(), "picture": names.picture.display().to_string(),
        "frames": o.frames, "frames_beyond_greatest_light": o.too_bright,
    }))
}

/// Seconds per readout of one stream, from a fifth of a second of grey light.
fn probe(job: &Run) -> Result<f64> {
    let simulator = Simulator::new(&job.camera, job.seeds)?.with_backend(job.backend)?;
    let mut simulator = simulator.with_threads(job.threads)?;
    let geometry = job.camera.sensor.geometry;
    let light = vec![100; geometry.pixels()];
    let readouts = ((32 << 20) / geometry.frame_bytes()).clamp(1, 128);
    let mut packed = vec![0; readouts * geometry.frame_bytes()];
    let (start, mut done) = (Instant::now(), 0);
    while done == 0 || start.elapsed().as_secs_f64() < 0.2 {
        simulator.push(FrameRef::u8(&light, geometry), &mut packed)?;
        done += readouts;
    }
    Ok(start.elapsed().as_secs_f64() / done as f64)
}

fn dry_run(args: &Args, job: &Run, light: &Light, needed: Option<u64>, free: u64, out: &Out) -> Result<()> {
    let readouts = job.expected(light.source.frames()).or(job.readouts);
    let each = probe(job)?;
    let seconds = readouts.map(|n| n as f64 * each * f64::from(1 + u8::from(args.clean)));
    let event = json!({
        "event": "dry-run", "readouts": readouts, "bytes": needed, "seconds": seconds, "free_bytes": free,
        "seconds_per_readout": each,
    });
    let known = match (readouts, needed, seconds) {
        (Some(n), Some(bytes), Some(s)) => {
            let most = if job.expected(light.source.frames()).is_some() { "" } else { "at most " };
            format!("{most}{n} readouts, {}, about {s:.1} s without reading the light", bytes_text(bytes))
        }
        _ => format!(
            "as many readouts as the input lasts; {} and {:.1} s for each million",
            bytes_text(1_000_000 * job.camera.sensor.geometry.frame_bytes() as u64),
            each * 1e6
        ),
    };
    let about = format!("{}; light: {}", light.source.describe(), light.source.front_end());
    out.result(&event, &format!("{about}\n{known}; {} free on the disk\n", bytes_text(free)))
}
