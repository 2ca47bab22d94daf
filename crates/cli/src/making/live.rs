//! `spikelane live`.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use serde_json::json;
use spikelane::{Backend, Camera, Error, Kind, Result, Seeds};
use spikelane_io::formats::{Codec, Layout};
use spikelane_io::live::{self, Pace, Pipe, Policy, Report, Ring, Sink, Stop, SystemClock};
use spikelane_io::simulate::{Ahead, Readouts, Run};
use spikelane_measure::report::with_known;

use super::light::{BuiltIn, LightArgs};
use crate::shared::camera::CameraArgs;
use crate::shared::output::Out;
use crate::shared::progress::{Progress, stop_flag};
use crate::shared::seeds::SeedArgs;
use crate::shared::threads::ThreadArgs;

/// Readouts of light that has no end of its own: a year at 35 kHz.
const ENDLESS: u64 = 1 << 40;

/// Seconds of readouts that are simulated before they are due.
const AHEAD_S: f64 = 0.05;

/// Between two looks whether a consumer has come.
const LOOK: Duration = Duration::from_millis(20);

/// Be a camera: hand out readouts at its pace
///
/// As 'simulate', but in real time and into a pipe, shared memory or a socket, for consumers that are developed
/// without hardware. A still picture, the chart and objects have no end; Ctrl-C ends them well. At the end it says how late
/// readouts were.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    #[command(flatten)]
    pub light: LightArgs,
    /// Where readouts go: pipe (standard output), pipe:PATH (a FIFO), shm:NAME (a ring in shared memory), or
    /// tcp:HOST:PORT (waits there for one consumer)
    #[arg(long, value_name = "SINK")]
    pub sink: Where,
    /// Lose readouts that the consumer has no room for, as a camera does [default]
    #[arg(long, conflicts_with = "block")]
    pub drop: bool,
    /// Wait for the consumer: nothing is lost, and what follows is late
    #[arg(long)]
    pub block: bool,
    /// Readouts that are handed over together, when the last of them is due
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..))]
    pub burst: u16,
    /// Room for readouts that the consumer has not taken yet: before a pipe, or as slots of the ring
    #[arg(hide_short_help = true, long, value_name = "MILLISECONDS", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=600_000))]
    pub buffer_ms: u32,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub seeds: SeedArgs,
    /// Number of the sequence; sequences of one seed share no noise
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 0, help_heading = "Seeds")]
    pub sequence: u64,
    /// How a readout's bytes lie; layouts with a header (.npy) have no place in a stream without an end
    #[arg(hide_short_help = true, long, value_name = "LAYOUT", default_value = "dat", value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub to: String,
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Instructions to use; the bits are the same
    #[arg(hide_short_help = true, long, default_value = "auto",
          value_parser = PossibleValuesParser::new(["auto", "reference", "portable", "sse4.1", "avx2", "avx512"]))]
    pub backend: String,
}

/// A sink by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Where {
    Stdout,
    Fifo(PathBuf),
    Shm(String),
    Tcp(String),
}

impl std::str::FromStr for Where {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once(':') {
            None if text == "pipe" => Ok(Self::Stdout),
            Some(("pipe", path)) if !path.is_empty() => Ok(Self::Fifo(path.into())),
            Some(("shm", name)) if !name.is_empty() => Ok(Self::Shm(name.to_owned())),
            Some(("tcp", address)) if !address.is_empty() => Ok(Self::Tcp(address.to_owned())),
            _ => Err(Error::new(Kind::Usage, "sink")
                .found(format_args!("`{text}`"))
                .expected("pipe, pipe:PATH, shm:NAME or tcp:HOST:PORT")),
        }
    }
}

impl std::fmt::Display for Where {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Stdout => f.write_str("pipe"),
            Self::Fifo(path) => write!(f, "pipe:{}", path.display()),
            Self::Shm(name) => write!(f, "shm:{name}"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
        }
    }
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    if out.json() && args.sink == Where::Stdout {
        return Err(Error::new(Kind::Usage, "--json")
            .found("--sink pipe, whose readouts go to standard output too")
            .expected("one of them")
            .remedy("give --sink pipe:PATH, the name of a FIFO"));
    }
    let camera = args.light.sized(args.camera.camera()?)?;
    let layout = Layout::parse(&args.to)?;
    let codec = codec(layout, &camera)?;
    let flag = stop_flag()?;
    let light = endless(&args.light)?.open(&camera)?;
    for warning in &light.warnings {
        out.say(format_args!("warning: {warning}"));
    }
    let backend = if args.backend == "auto" { Backend::best() } else { Backend::parse(&args.backend)? };
    let job = Run {
        readouts: light.readouts,
        greatest_light: args.light.greatest_light,
        layout,
        backend,
        threads: args.threads.number(out),
        ..Run::new(
            camera.clone(),
            Seeds { sequence: args.sequence, ..args.seeds.seeds() },
            light.timeline.clone(),
        )
    };
    let total = job.expected(light.source.frames()).or(job.readouts).filter(|&n| n != ENDLESS);
    let mut source = Ahead::new(light.source, Arc::clone(&flag));
    let mut readouts = Readouts::new(&job, &mut source)?;
    let stop = Stop::of(Arc::clone(&flag));
    let Some(mut sink) = sink(args, &codec, &camera, &stop, out)? else { return Ok(()) };
    // The request to stop is answered by `live::run`, with a report.
    let mut progress = Progress::new(out, Arc::new(AtomicBool::new(false)));
    let pace = pace(args, &camera);
    let mut watch = |done| progress.step(done, total);
    let report = live::run(&mut readouts, &codec, pace, &mut *sink, SystemClock::start, &stop, &mut watch)?;
    drop(progress);
    tell(args, &job, &report, out)
}

fn pace(args: &Args, camera: &Camera) -> Pace {
    let readout_hz = camera.sensor.readout_hz;
    Pace { readout_hz, burst: args.burst.into(), ahead: (readout_hz * AHEAD_S) as usize }
}

fn codec(layout: Layout, camera: &Camera) -> Result<Codec> {
    if !layout.header(camera.sensor.geometry, 1)?.is_empty() {
        return Err(Error::new(Kind::Usage, "--to")
            .found(layout)
            .expected("a layout without a header, such as dat or rows416")
            .remedy("let the consumer write the .npy file"));
    }
    Codec::new(layout, camera.sensor.geometry)
}

/// The light, without an end where it needs none.
fn endless(light: &LightArgs) -> Result<LightArgs> {
    if light.input.is_none() && light.source.is_none() {
        return Err(Error::new(Kind::Usage, "light")
            .found("none")
            .expected("an input, or --source chart or objects")
            .remedy(
                "the driving scene takes longer to draw than a camera waits: simulate it into a video first",
            ));
    }
    let mut light = light.clone();
    if light.readouts.is_none() && light.source != Some(BuiltIn::Drive) && light.motion.is_none() {
        light.readouts = Some(ENDLESS);
    }
    Ok(light)
}

/// The sink; `None` when the user stopped waiting for a consumer.
fn sink(
    args: &Args,
    codec: &Codec,
    camera: &Camera,
    stop: &Stop,
    out: &Out,
) -> Result<Option<Box<dyn Sink>>> {
    let readout_hz = camera.sensor.readout_hz;
    let policy = if args.block { Policy::Block } else { Policy::Drop };
    let room = (readout_hz * f64::from(args.buffer_ms) / 1000.0).ceil().max(1.0);
    let bursts = (room / f64::from(args.burst)).ceil() as usize;
    let pipe = |into: Box<dyn Write + Send>| -> Result<Option<Box<dyn Sink>>> {
        Ok(Some(Box::new(Pipe::new(into, &args.sink.to_string(), bursts, policy, stop.clone())?)))
    };
    match &args.sink {
        Where::Stdout => pipe(Box::new(stdout()?)),
        Where::Fifo(path) => {
            out.say(format_args!("waiting for a reader of {}", path.display()));
            fifo(path, stop)?.map_or(Ok(None), |file| pipe(Box::new(file)))
        }
        Where::Tcp(address) => tcp(address, stop, out)?.map_or(Ok(None), |stream| pipe(Box::new(stream))),
        Where::Shm(name) => {
            let path = shm(name)?;
            let ring = Ring::create(&path, codec, readout_hz, room as u64, policy, stop.clone());
            let ring = ring.map_err(|e| match e.kind() {
                Kind::Exists => e.remedy("another camera has that name; or one was killed: remove the file"),
                _ => e,
            })?;
            out.say(format_args!("a ring of {room} readouts in {}", path.display()));
            Ok(Some(Box::new(ring)))
        }
    }
}

/// Standard output without the buffer that looks for ends of lines.
fn stdout() -> Result<File> {
    #[cfg(unix)]
    let own = std::os::fd::AsFd::as_fd(&std::io::stdout()).try_clone_to_owned();
    #[cfg(windows)]
    let own = std::os::windows::io::AsHandle::as_handle(&std::io::stdout()).try_clone_to_owned();
    own.map(File::from).map_err(|e| Error::io("standard output", e))
}

/// Where shared memory of this name is a file.
fn shm(name: &str) -> Result<PathBuf> {
    if name.contains('/') {
        return Ok(name.into());
    }
    let folder = Path::new("/dev/shm");
    if folder.is_dir() {
        return Ok(folder.join(name));
    }
    Err(Error::new(Kind::Usage, format_args!("shm:{name}"))
        .found("no /dev/shm on this system")
        .expected("a place for shared memory")
        .remedy("give a path with a '/', of a file that both processes can map"))
}

/// A FIFO, once somebody reads it.
#[cfg(not(unix))]
fn fifo(path: &Path, _: &Stop) -> Result<Option<File>> {
    Err(Error::new(Kind::Usage, path.display())
        .found("a FIFO, which this system does not have")
        .expected("standard output, a socket or a ring")
        .remedy("give 'tcp:ADDRESS' to a reader on this machine"))
}

/// A FIFO, once somebody reads it.
#[cfg(unix)]
fn fifo(path: &Path, stop: &Stop) -> Result<Option<File>> {
    use rustix::fs::OFlags;
    use std::os::unix::fs::{FileTypeExt as _, OpenOptionsExt as _};
    let io = |e| Error::io(path.display(), e);
    let kind = std::fs::metadata(path).map_err(io)?.file_type();
    if !kind.is_fifo() {
        return Err(Error::new(Kind::Usage, path.display())
            .found("no FIFO")
            .expected("one that 'mkfifo' made")
            .remedy("for a file use 'simulate'"));
    }
    let nonblocking = OFlags::NONBLOCK.bits() as i32;
    let try_open = || File::options().write(true).custom_flags(nonblocking).open(path);
    // Writes wait, as they do to other pipes. Opening the name again would wait without end if the reader left.
    let waiting = |file: File| -> std::io::Result<File> {
        rustix::fs::fcntl_setfl(&file, rustix::fs::fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
        Ok(file)
    };
    while !stop.is_raised() {
        match try_open() {
            Ok(file) => return waiting(file).map(Some).map_err(io),
            Err(e) if e.raw_os_error() == Some(rustix::io::Errno::NXIO.raw_os_error()) => {
                std::thread::sleep(LOOK);
            }
            Err(e) => return Err(io(e)),
        }
    }
    Ok(None)
}

/// A socket, once somebody has connected.
fn tcp(address: &str, stop: &Stop, out: &Out) -> Result<Option<std::net::TcpStream>> {
    let io = |e| Error::io(format_args!("tcp:{address}"), e);
    let listener = TcpListener::bind(address).map_err(io)?;
    listener.set_nonblocking(true).map_err(io)?;
    out.say(format_args!("waiting for a consumer at tcp:{}", listener.local_addr().map_err(io)?));
    while !stop.is_raised() {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true)).map_err(io)?;
                return Ok(Some(stream));
            }
            Err(e) if e.kind() == ErrorKind::WouldBlock => std::thread::sleep(LOOK),
            Err(e) => return Err(io(e)),
        }
    }
    Ok(None)
}

fn tell(args: &Args, job: &Run, report: &Report, out: &Out) -> Result<()> {
    let seconds = report.elapsed.as_secs_f64();
    let ms = |d: Duration| d.as_secs_f64() * 1e3;
    let late = &report.lateness;
    let [median, p99, p99_9] = [0.5, 0.99, 0.999].map(|q| ms(late.quantile(q)));
    let rate = if seconds > 0.0 { Some(report.readouts as f64 / seconds) } else { None };
    let Report { readouts, delivered, dropped, left, .. } = report;
    let policy = if args.block { "block" } else { "drop" };
    let event = json!({
        "event": "live", "sink": args.sink.to_string(), "policy": policy, "readouts": readouts,
        "delivered": delivered, "dropped": dropped, "consumer_left": left, "seconds": seconds,
        "backend": job.backend.name(), "threads": job.threads,
        "lateness_ms": { "median": median, "p99": p99, "p99_9": p99_9, "max": ms(late.max()) },
    });
    out.event(&with_known(event, [("readouts_per_second", rate.map(Into::into))]))?;
    out.say(format_args!(
        "{readouts} readouts in {seconds:.2} s, {:.0} a second of {}: {delivered} delivered, {dropped} dropped by a \
         slow consumer (--{policy}){}",
        rate.unwrap_or(0.0),
        job.camera.sensor.readout_hz,
        if *left { "; the consumer left" } else { "" },
    ));
    out.say(format_args!(
        "lateness of delivered readouts: median {median:.2} ms, 99 % within {p99:.2} ms, 99.9 % within {p99_9:.2} ms, \
         greatest {:.2} ms",
        ms(late.max()),
    ));
    Ok(())
}
