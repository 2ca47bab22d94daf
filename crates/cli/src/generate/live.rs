//! Implements `spikelane live`.

use std::fs::File;
use std::io::{self, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use serde_json::json;
use spikelane::unstable::Count;
use spikelane::{Backend, Camera, Error, ErrorKind, Result, Seeds};
use spikelane_io::formats::{Codec, Layout};
use spikelane_io::live::{
    self, DeliveryRate, LiveSummary, OverflowPolicy, PipeSink, RingWriter, Sink, StopFlag, SystemClock,
};
use spikelane_io::simulate::{ReadAhead, ReadoutStream, RunOptions};
use spikelane_measure::report::insert_present;

use super::light::{BuiltinLight, LightArgs, print_new_notes};
use crate::common::{CameraArgs, Console, CountProgress, SeedArgs, ThreadArgs, stop_flag};

/// Number of readouts of light that never ends. It corresponds to a year at 35 kHz.
const ENDLESS_READOUTS: u64 = 1 << 40;

/// Time in seconds by which a readout is simulated before it is due.
const READ_AHEAD_SECONDS: f64 = 0.05;

/// Time between two checks whether a consumer has connected.
const CONSUMER_CHECK_INTERVAL: Duration = Duration::from_millis(20);

/// Help of flags whose default differs from the default in `simulate`. The defaults differ because a drive cannot be
/// drawn in real time, and because a live stream can be endless.
const INPUT_HELP: &str = "Read light from this file or folder";
const INPUT_LONG_HELP: &str = "\
Read light from this file or folder

The path is a folder of images, an image, a video, or an .npy, .npz or .y4m file. For '-', y4m or npy data is read from \
standard input. Without this argument, --builtin-light is required.";
const BUILTIN_LIGHT_HELP: &str = "Draw built-in light: chart or objects";
const BUILTIN_LIGHT_LONG_HELP: &str = "\
Draw built-in light: chart or objects

A driving scene (drive) cannot be drawn in real time: its readouts are late.";
const READOUTS_HELP: &str = "Stop after N readouts [default: end of input]";
const READOUTS_LONG_HELP: &str = "\
Stop after N readouts [default: end of input]

Without --readouts, only Ctrl-C ends the stream of a still image, the chart or the objects.";

/// Simulate in real time into a pipe, shared memory or a socket
///
/// The command is a virtual camera for consumers that are developed without hardware. An input, --builtin-light chart or
/// --builtin-light objects is required. Without --readouts, the stream of a still image, the chart or the objects has no
/// end: Ctrl-C ends the stream after a complete readout. At the end, the command reports the lateness of the readouts.
#[derive(clap::Args, Clone, Debug)]
#[command(
    mut_arg("input", |arg| arg.help(INPUT_HELP).long_help(INPUT_LONG_HELP)),
    mut_arg("builtin_light", |arg| {
        let arg = arg.help(BUILTIN_LIGHT_HELP).long_help(BUILTIN_LIGHT_LONG_HELP);
        arg.hide_short_help(false).hide_possible_values(true)
    }),
    mut_arg("readouts", |arg| arg.help(READOUTS_HELP).long_help(READOUTS_LONG_HELP)),
)]
pub(crate) struct Args {
    #[command(flatten)]
    pub light: LightArgs,
    /// Send to pipe[:PATH], shm:NAME or tcp:HOST:PORT
    ///
    /// pipe is standard output, pipe:PATH is a FIFO, shm:NAME is a ring of readouts in shared memory, and tcp:HOST:PORT
    /// waits for one consumer at this address.
    #[arg(long, value_name = "SINK")]
    pub sink: SinkAddress,
    /// Drop readouts if the consumer is slow [default]
    #[arg(long, conflicts_with = "block")]
    pub drop: bool,
    /// Wait for a slow consumer
    ///
    /// With --block, no readout is lost, but later readouts are late.
    #[arg(long)]
    pub block: bool,
    /// Deliver N readouts at a time
    ///
    /// N readouts are sent together when the last of the N readouts is due.
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..))]
    pub burst: u16,
    /// Set the duration of the buffered readouts in milliseconds
    ///
    /// The buffer contains readouts that the consumer has not read. If it is full, readouts are dropped or, with --block,
    /// the camera waits.
    #[arg(hide_short_help = true, long, value_name = "MS", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=600_000))]
    pub buffer_ms: u32,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub seeds: SeedArgs,
    /// Set the number of the sequence; sequences with the same seed have independent noise
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub sequence: u64,
    /// Set the layout of the readouts; the layout must have no header
    #[arg(hide_short_help = true, long, value_name = "LAYOUT", default_value = "dat", value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub to: String,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Set the instruction set of the kernels
    ///
    /// All sets give the same spikes.
    #[arg(hide_short_help = true, long, default_value = "auto",
          value_parser = PossibleValuesParser::new(["auto", "reference", "portable", "sse4.1", "avx2", "avx512"]))]
    pub backend: String,
}

/// The address of a sink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SinkAddress {
    Stdout,
    Fifo(PathBuf),
    Shm(String),
    Tcp(String),
}

impl std::str::FromStr for SinkAddress {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once(':') {
            None if text == "pipe" => Ok(Self::Stdout),
            Some(("pipe", path)) if !path.is_empty() => Ok(Self::Fifo(path.into())),
            Some(("shm", name)) if !name.is_empty() => Ok(Self::Shm(name.to_owned())),
            Some(("tcp", address)) if !address.is_empty() => Ok(Self::Tcp(address.to_owned())),
            _ => Err(Error::new(ErrorKind::Usage, "sink")
                .found(format_args!("`{text}`"))
                .expected("pipe, pipe:PATH, shm:NAME or tcp:HOST:PORT")),
        }
    }
}

impl std::fmt::Display for SinkAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Stdout => f.write_str("pipe"),
            Self::Fifo(path) => write!(f, "pipe:{}", path.display()),
            Self::Shm(name) => write!(f, "shm:{name}"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
        }
    }
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if out.json() && args.sink == SinkAddress::Stdout {
        return Err(Error::new(ErrorKind::Usage, "--json")
            .found("--sink pipe, which also writes to standard output")
            .expected("only one of these flags")
            .remedy("set --sink to pipe:PATH, the name of a FIFO"));
    }
    let camera = args.light.with_input_size(args.camera.camera()?)?;
    let layout = Layout::parse(&args.to)?;
    let codec = codec(layout, &camera)?;
    let flag = stop_flag()?;
    let light = without_end(&args.light)?.open(&camera)?;
    for warning in &light.warnings {
        out.print_message(format_args!("warning: {warning}"));
    }
    let backend = if args.backend == "auto" { Backend::best() } else { args.backend.parse()? };
    let job = RunOptions {
        readouts: light.readouts,
        max_light: args.light.max_light,
        layout,
        backend,
        threads: args.threads.thread_count(out),
        ..RunOptions::new(
            camera.clone(),
            Seeds { sequence: args.sequence, ..args.seeds.seeds() },
            light.timeline.clone(),
        )
    };
    let total =
        job.expected_readouts(light.source.frames()).or(job.readouts).filter(|&n| n != ENDLESS_READOUTS);
    let warnings = light.warnings;
    let mut source = ReadAhead::new(light.source, Arc::clone(&flag));
    let mut readouts = ReadoutStream::new(&job, &mut source)?;
    let stop = StopFlag::from_flag(Arc::clone(&flag));
    let Some(mut sink) = open_sink(args, &codec, &camera, &stop, out)? else { return Ok(()) };
    // The stop flag is not passed to the progress display. `live::run` checks it and still returns a report.
    let mut progress = CountProgress::new(out, Arc::new(AtomicBool::new(false)));
    let pace = delivery_rate(args, &camera);
    let mut watch = |done| progress.update(done, total);
    let report = live::run(&mut readouts, &codec, pace, &mut *sink, SystemClock::start, &stop, &mut watch)?;
    drop(progress);
    if let Some(fault) = readouts.exposure_fault() {
        out.print_message(format_args!("warning: {}", fault.warning(&args.sink)));
    }
    drop(readouts);
    print_new_notes(&source, &warnings, out);
    print_report(args, &job, &report, out)
}

fn delivery_rate(args: &Args, camera: &Camera) -> DeliveryRate {
    let readout_hz = camera.sensor.readout_hz;
    DeliveryRate {
        readout_hz,
        burst_readouts: args.burst.into(),
        readouts_ahead: (readout_hz * READ_AHEAD_SECONDS) as usize,
    }
}

fn codec(layout: Layout, camera: &Camera) -> Result<Codec> {
    if !layout.header(camera.sensor.geometry, 1)?.is_empty() {
        return Err(Error::new(ErrorKind::Usage, "--to")
            .found(layout)
            .expected("a layout without a header, such as dat or rows416")
            .remedy("choose a layout without a header, and convert the stream later"));
    }
    Codec::new(layout, camera.sensor.geometry)
}

/// Returns the light of the flags. Light that can be endless is made endless if the user sets no number of readouts.
fn without_end(light: &LightArgs) -> Result<LightArgs> {
    if light.input.is_none() && light.builtin_light.is_none() {
        return Err(Error::new(ErrorKind::Usage, "light")
            .found("none")
            .expected("an input, or --builtin-light chart or objects")
            .remedy("a driving scene cannot be drawn in real time: write a video of the scene with 'spikelane scene --video', and pass the video as the input"));
    }
    let mut light = light.clone();
    if light.readouts.is_none() && light.builtin_light != Some(BuiltinLight::Drive) && light.motion.is_none()
    {
        light.readouts = Some(ENDLESS_READOUTS);
    }
    Ok(light)
}

/// Opens the sink. Returns `None` if the user stopped the command while the sink waited for a consumer.
fn open_sink(
    args: &Args,
    codec: &Codec,
    camera: &Camera,
    stop: &StopFlag,
    out: &Console,
) -> Result<Option<Box<dyn Sink>>> {
    let readout_hz = camera.sensor.readout_hz;
    let policy = if args.block { OverflowPolicy::Block } else { OverflowPolicy::Drop };
    let room = (readout_hz * f64::from(args.buffer_ms) / 1000.0).ceil().max(1.0);
    let bursts = (room / f64::from(args.burst)).ceil() as usize;
    let pipe = |into: Box<dyn Write + Send>| -> Result<Option<Box<dyn Sink>>> {
        Ok(Some(Box::new(PipeSink::new(into, &args.sink.to_string(), bursts, policy, stop.clone())?)))
    };
    match &args.sink {
        SinkAddress::Stdout => pipe(Box::new(open_stdout()?)),
        SinkAddress::Fifo(path) => {
            out.print_message(format_args!("waiting for a reader of {}", path.display()));
            open_fifo(path, stop)?.map_or(Ok(None), |file| pipe(Box::new(file)))
        }
        SinkAddress::Tcp(address) => {
            accept_consumer(address, stop, out)?.map_or(Ok(None), |stream| pipe(Box::new(stream)))
        }
        SinkAddress::Shm(name) => {
            let path = shm_path(name)?;
            let ring = RingWriter::create(&path, codec, readout_hz, room as u64, policy, stop.clone());
            let ring = ring.map_err(|e| match e.kind() {
                ErrorKind::Exists => {
                    e.remedy("if another camera uses this name, choose another name; if the camera was killed, remove the file")
                }
                _ => e,
            })?;
            out.print_message(format_args!("a ring of {} in {}", Count(room, "readout"), path.display()));
            Ok(Some(Box::new(ring)))
        }
    }
}

/// Returns standard output as a file, because `std::io::Stdout` buffers lines.
fn open_stdout() -> Result<File> {
    #[cfg(unix)]
    let stdout = std::os::fd::AsFd::as_fd(&std::io::stdout()).try_clone_to_owned();
    #[cfg(windows)]
    let stdout = std::os::windows::io::AsHandle::as_handle(&std::io::stdout()).try_clone_to_owned();
    stdout.map(File::from).map_err(|e| Error::io("standard output", e))
}

/// Returns the path of the shared memory `name`.
fn shm_path(name: &str) -> Result<PathBuf> {
    if name.contains('/') {
        return Ok(name.into());
    }
    let folder = Path::new("/dev/shm");
    if folder.is_dir() {
        return Ok(folder.join(name));
    }
    Err(Error::new(ErrorKind::Usage, format_args!("shm:{name}"))
        .found("no /dev/shm on this system")
        .expected("a file system for shared memory")
        .remedy("use a path with a '/', of a file that both processes can map"))
}

/// Opens a FIFO. This system has no FIFOs, so the function returns an error.
#[cfg(not(unix))]
fn open_fifo(path: &Path, _: &StopFlag) -> Result<Option<File>> {
    Err(Error::new(ErrorKind::Usage, path.display())
        .found("a FIFO, which this system does not have")
        .expected("standard output, a socket or a ring")
        .remedy("set --sink to tcp:ADDRESS for a reader on this machine"))
}

/// Opens a FIFO as soon as a process reads it. Returns `None` if the user stopped the command before a process read the
/// FIFO.
#[cfg(unix)]
fn open_fifo(path: &Path, stop: &StopFlag) -> Result<Option<File>> {
    use rustix::fs::OFlags;
    use std::os::unix::fs::{FileTypeExt as _, OpenOptionsExt as _};
    let io = |e| Error::io(path.display(), e);
    let kind = std::fs::metadata(path).map_err(io)?.file_type();
    if !kind.is_fifo() {
        return Err(Error::new(ErrorKind::Usage, path.display())
            .found("no FIFO")
            .expected("a FIFO created by 'mkfifo'")
            .remedy("to write a file, use 'simulate'"));
    }
    let nonblocking = OFlags::NONBLOCK.bits() as i32;
    let try_open = || File::options().write(true).custom_flags(nonblocking).open(path);
    // The FIFO is opened in nonblocking mode and then set to blocking mode, because later writes must block as in other
    // pipes. Opening the FIFO again in blocking mode could wait forever if the reading process has ended.
    let blocking = |file: File| -> std::io::Result<File> {
        rustix::fs::fcntl_setfl(&file, rustix::fs::fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
        Ok(file)
    };
    while !stop.is_raised() {
        match try_open() {
            Ok(file) => return blocking(file).map(Some).map_err(io),
            Err(e) if e.raw_os_error() == Some(rustix::io::Errno::NXIO.raw_os_error()) => {
                std::thread::sleep(CONSUMER_CHECK_INTERVAL);
            }
            Err(e) => return Err(io(e)),
        }
    }
    Ok(None)
}

/// Waits for the first connection to a socket. Returns `None` if the user stopped the command before a connection.
fn accept_consumer(address: &str, stop: &StopFlag, out: &Console) -> Result<Option<std::net::TcpStream>> {
    let io = |e| Error::io(format_args!("tcp:{address}"), e);
    let listener = TcpListener::bind(address).map_err(io)?;
    listener.set_nonblocking(true).map_err(io)?;
    out.print_message(format_args!("waiting for a consumer at tcp:{}", listener.local_addr().map_err(io)?));
    while !stop.is_raised() {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true)).map_err(io)?;
                return Ok(Some(stream));
            }
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => std::thread::sleep(CONSUMER_CHECK_INTERVAL),
            Err(e) => return Err(io(e)),
        }
    }
    Ok(None)
}

fn print_report(args: &Args, job: &RunOptions, report: &LiveSummary, out: &Console) -> Result<()> {
    let seconds = report.elapsed.as_secs_f64();
    let ms = |d: Duration| d.as_secs_f64() * 1e3;
    let late = &report.lateness;
    let [median, p99, p99_9] = [0.5, 0.99, 0.999].map(|q| ms(late.quantile(q)));
    let rate = if seconds > 0.0 { Some(report.readouts as f64 / seconds) } else { None };
    let LiveSummary { readouts, delivered, dropped, consumer_left: left, .. } = report;
    let policy = if args.block { "block" } else { "drop" };
    let event = json!({
        "event": "live", "sink": args.sink.to_string(), "policy": policy, "readouts": readouts,
        "delivered": delivered, "dropped": dropped, "consumer_disconnected": left, "seconds": seconds,
        "backend": job.backend.name(), "threads": job.threads,
        "lateness_ms": { "median": median, "p99": p99, "p99_9": p99_9, "max": ms(late.max()) },
    });
    out.print_event(&insert_present(event, [("readouts_per_second", rate.map(Into::into))]))?;
    out.print_message(format_args!(
        "{} in {seconds:.2} s, {:.0} per second of {}: {delivered} delivered, {dropped} dropped by a slow consumer (--{policy}){}",
        Count(*readouts, "readout"),
        rate.unwrap_or(0.0),
        job.camera.sensor.readout_hz,
        if *left { "; the consumer disconnected" } else { "" },
    ));
    out.print_message(format_args!(
        "lateness of delivered readouts: median {median:.2} ms, 99 % within {p99:.2} ms, 99.9 % within {p99_9:.2} ms, maximum {:.2} ms",
        ms(late.max()),
    ));
    Ok(())
}
