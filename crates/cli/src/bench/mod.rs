//! `spikelane bench`: how fast this machine is, in about a minute.

mod cameras;
mod memory;
mod processes;
mod report;
mod scalar;
mod scene_error;
mod scenes;
mod short;
mod stream;
mod timing;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use spikelane::{Backend, Error, Kind, Result};

use cameras::{Noise, frames};
use memory::Lit;
use report::{Fact, Machine, Report};

/// Frames that together are larger than any cache: 100 MB and more.
const FROM_MEMORY: usize = 1024;

/// Measure the speed of this machine: kernels, files, and what follows
#[derive(Args, Clone, Debug)]
pub(crate) struct BenchArgs {
    /// About how long it may take
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS")]
    pub seconds: f64,
    /// A few seconds, with a file of a tenth the size and no whole processes; the figures are rough
    #[arg(long)]
    pub quick: bool,
    /// Where the files of the measurement are made (and removed)
    #[arg(long, default_value = ".", value_name = "DIRECTORY")]
    pub directory: PathBuf,
    /// Another build of this program, whose whole processes run in turns with those of this one
    #[arg(long, value_name = "PROGRAM", conflicts_with = "quick")]
    pub beside: Option<PathBuf>,
    /// Write a page with the tables, keeping what stands behind its marker
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// Instead compare the light of driving scenes with true renders of the same instants; minutes, not timed
    #[arg(long, conflicts_with_all = ["seconds", "quick", "directory", "beside"])]
    pub scene_error: bool,
}

/// Measures, and prints the tables, or with `json` one JSON object.
///
/// # Errors
/// When a file cannot be made, or the arguments make no sense.
pub(crate) fn run(args: &BenchArgs, json: bool) -> Result<()> {
    if !(args.seconds > 0.0 && args.seconds <= 86_400.0) {
        return Err(Error::new(Kind::Usage, "--seconds")
            .found(args.seconds)
            .expected("a number above 0, up to a day"));
    }
    if args.scene_error {
        return scene_errors(args, json);
    }
    let report = measure(args)?;
    if let Some(path) = &args.markdown {
        report.write_page(path)?;
    }
    if json {
        println!("{}", report.json());
    } else {
        print!("{}", report.text());
    }
    Ok(())
}

/// The table of light against true renders, printed and put into the page.
fn scene_errors(args: &BenchArgs, json: bool) -> Result<()> {
    let rows = scene_error::measure(std::thread::available_parallelism().map_or(1, usize::from))?;
    let text = scene_error::text(&rows);
    if let Some(path) = &args.markdown {
        report::put_between(path, report::SCENE_ERROR, &text)?;
    }
    if json {
        println!(
            "{}",
            serde_json::json!({"scene_error": rows.iter().map(scene_error::Row::json).collect::<Vec<_>>()})
        );
    } else {
        print!("{text}");
    }
    Ok(())
}

fn measure(args: &BenchArgs) -> Result<Report> {
    let seconds = if args.quick { args.seconds.min(6.0) } else { args.seconds };
    // Some ninety cases share the time, beside what they need to be set up.
    let budget = Duration::from_secs_f64(seconds / 110.0);
    let mut report = Report { machine: Machine::here(), ..Report::default() };
    report.rows.push(memory::scalar(budget));
    kernels(budget, &mut report)?;
    rarer(budget, &mut report)?;
    bandwidth(budget, &mut report)?;
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    for threads in threads_up_to(all) {
        report.rows.push(memory::simulator(Noise::Full, threads, budget)?);
    }
    let readouts = if args.quick { 4000 } else { 40_000 };
    for threads in [1, all] {
        report.rows.push(stream::to_file(&args.directory, threads, readouts, &mut report.facts)?);
        if all == 1 {
            break;
        }
    }
    report.facts.extend(short::pushes(budget)?);
    report.facts.extend(short::crops(budget)?);
    report.facts.extend(stream::downstream(&args.directory, readouts / 10, budget)?);
    report.scenes = scenes::measure(all, budget)?;
    report.stages = scenes::stages(budget)?;
    if !args.quick {
        report.processes = processes::measure(&args.directory, args.beside.as_deref())?;
    }
    Ok(report)
}

/// Every backend and noise set, one thread; the frames stay in the second or third level of cache.
fn kernels(budget: Duration, report: &mut Report) -> Result<()> {
    for noise in Noise::ALL {
        let light = frames(noise, 128);
        for backend in Backend::ALL.into_iter().skip(1) {
            if !backend.available() {
                eprintln!("skipped backend {backend}: this CPU lacks its instructions");
                continue;
            }
            // Without quanta that draw whole steps, light that changes tells nothing new.
            let few = noise == Noise::FewElectrons;
            for lit in Lit::ALL.into_iter().filter(|lit| *lit == Lit::Held || !few) {
                report.rows.push(memory::kernel(backend, noise, &light, lit, budget)?);
            }
        }
    }
    Ok(())
}

/// What is rare beside full noise, whole sensors at a time, since some of it couples neighbours.
fn rarer(budget: Duration, report: &mut Report) -> Result<()> {
    for noise in Noise::RARER {
        report.rows.push(memory::simulator(noise, 1, budget)?);
    }
    Ok(())
}

/// The ideal camera on frames from memory, beside what one core reads at most.
fn bandwidth(budget: Duration, report: &mut Report) -> Result<()> {
    let light = frames(Noise::Ideal, FROM_MEMORY);
    let mut row = memory::kernel(Backend::best(), Noise::Ideal, &light, Lit::New, budget * 2)?;
    row.light = "new frame, memory";
    drop(light);
    let read = timing::read_bandwidth(budget * 2);
    let mut add = |name: &str, value, unit| report.facts.push(Fact { name: name.to_owned(), value, unit });
    add("reading memory, one core", read / 1e9, "GB/s");
    add(
        "of which the ideal camera reaches with a new u8 frame at every readout",
        1e11 * row.speed / read,
        "%",
    );
    report.rows.push(row);
    Ok(())
}

/// One, two, four, ... and all.
fn threads_up_to(all: usize) -> Vec<usize> {
    let mut counts: Vec<_> =
        std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|n| *n < all).collect();
    counts.push(all);
    counts
}
