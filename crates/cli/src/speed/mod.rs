//! Implements `spikelane speed`. It benchmarks this machine in about a minute.

mod cameras;
mod in_memory;
mod processes;
pub(crate) mod report;
mod scalar;
mod scene_error;
mod scenes;
mod short_calls;
mod stream;
mod timing;

use crate::common::replace_between_markers;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use spikelane::{Backend, Error, ErrorKind, Result};

use cameras::{NoiseSet, test_frames};
use in_memory::LightMode;
use report::{BenchmarkFigure, Machine, SpeedReport, SpeedRow};

/// Number of frames that together exceed every CPU cache. They occupy 100 MB or more.
const MEMORY_FRAMES: usize = 1024;

/// Number of runs that write a new file, for each number of threads.
const FILE_RUNS: usize = 3;

/// Benchmark kernels, file I/O and commands on this machine
#[derive(Args, Clone, Debug)]
pub(crate) struct SpeedArgs {
    /// Set the approximate run time in s
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS")]
    pub seconds: f64,
    /// Run for a few seconds, with less precise results
    ///
    /// With --quick, the test file is ten times smaller, and no commands are run.
    #[arg(long)]
    pub quick: bool,
    /// Create temporary files in this folder
    #[arg(long, default_value = ".", value_name = "DIR")]
    pub work_dir: PathBuf,
    /// Also run the commands with this other build
    ///
    /// Runs of the other build alternate with runs of this build.
    #[arg(long, value_name = "PROGRAM", conflicts_with = "quick")]
    pub baseline: Option<PathBuf>,
    /// Write the tables to this Markdown file
    ///
    /// If the file exists, the text after its line "<!-- kept: ... -->" is preserved.
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// Only measure the light error of driving scenes
    ///
    /// The command compares their light with separate renders of the same instants. It takes minutes and measures no
    /// speed.
    #[arg(long, conflicts_with_all = ["seconds", "quick", "work_dir", "baseline"])]
    pub scene_error: bool,
}

/// Runs the benchmarks and prints the tables. If `json` is true, it prints one JSON object instead.
///
/// # Errors
/// If a file cannot be written, or if the arguments are invalid.
pub(crate) fn run(args: &SpeedArgs, json: bool) -> Result<()> {
    if !(args.seconds > 0.0 && args.seconds <= 86_400.0) {
        return Err(Error::new(ErrorKind::Usage, "--seconds")
            .found(args.seconds)
            .expected("a number above 0, up to a day"));
    }
    if args.scene_error {
        return run_scene_error(args, json);
    }
    let report = run_benchmarks(args)?;
    if let Some(path) = &args.markdown {
        report.write_page(path)?;
    }
    if json {
        println!("{}", report.json());
    } else {
        print!("{}", report.markdown());
    }
    Ok(())
}

/// Prints the light errors of driving scenes, compared with true renders. Also writes the table of errors to the page
/// of `--markdown`.
fn run_scene_error(args: &SpeedArgs, json: bool) -> Result<()> {
    let rows = scene_error::scene_error_table(std::thread::available_parallelism().map_or(1, usize::from))?;
    let text = scene_error::markdown(&rows);
    if let Some(path) = &args.markdown {
        replace_between_markers(path, report::SCENE_ERROR_MARKERS, &text)?;
    }
    if json {
        println!(
            "{}",
            serde_json::json!({"scene_error": rows.iter().map(scene_error::ErrorRow::json).collect::<Vec<_>>()})
        );
    } else {
        print!("{text}");
    }
    Ok(())
}

fn run_benchmarks(args: &SpeedArgs) -> Result<SpeedReport> {
    let seconds = if args.quick { args.seconds.min(6.0) } else { args.seconds };
    // About ninety cases share the time.
    let budget = Duration::from_secs_f64(seconds / 90.0);
    let mut report = SpeedReport { machine: Machine::current(), ..SpeedReport::default() };
    report.rows.push(in_memory::benchmark_scalar(budget));
    benchmark_kernels(budget, &mut report)?;
    benchmark_rare_effects(budget, &mut report)?;
    benchmark_bandwidth(budget, &mut report)?;
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    for threads in thread_counts(all) {
        report.rows.push(in_memory::benchmark_simulator(NoiseSet::AllNoise, threads, budget)?);
    }
    let readouts = if args.quick { 4000 } else { 40_000 };
    report.rows.extend(benchmark_files(&args.work_dir, all, readouts)?);
    report.figures.extend(short_calls::benchmark_short_calls(budget)?);
    report.figures.extend(short_calls::benchmark_crops(budget)?);
    report.figures.extend(stream::benchmark_readers(&args.work_dir, readouts / 10, budget)?);
    report.scenes = scenes::benchmark_scenes(all, budget)?;
    report.stages = scenes::benchmark_stages(budget)?;
    if !args.quick {
        report.processes = processes::benchmark_processes(&args.work_dir, args.baseline.as_deref())?;
    }
    Ok(report)
}

/// Benchmarks every backend and noise set on one thread. The frames fit into the second or third level of the CPU cache.
fn benchmark_kernels(budget: Duration, report: &mut SpeedReport) -> Result<()> {
    for noise in NoiseSet::ALL {
        let light = test_frames(noise, 128);
        for backend in Backend::ALL.into_iter().skip(1) {
            if !backend.is_available() {
                eprintln!("skipped backend {backend}: this CPU lacks its instructions");
                continue;
            }
            // The camera with few electrons draws whole quanta. It is measured only in static light, and changing light
            // is measured with the other noise sets.
            let few = noise == NoiseSet::FewElectrons;
            for lit in LightMode::ALL.into_iter().filter(|lit| *lit == LightMode::Static || !few) {
                report.rows.push(in_memory::benchmark_kernel(backend, noise, &light, lit, budget)?);
            }
        }
    }
    Ok(())
}

/// Benchmarks rare effects in addition to all noise. The benchmark uses whole sensors, because some of these effects
/// couple neighboring pixels.
fn benchmark_rare_effects(budget: Duration, report: &mut SpeedReport) -> Result<()> {
    for noise in NoiseSet::RARE_EFFECTS {
        report.rows.push(in_memory::benchmark_simulator(noise, 1, budget)?);
    }
    Ok(())
}

/// Benchmarks the ideal camera with frames that exceed the CPU caches, and the read bandwidth of one core.
fn benchmark_bandwidth(budget: Duration, report: &mut SpeedReport) -> Result<()> {
    let light = test_frames(NoiseSet::Ideal, MEMORY_FRAMES);
    let mut row = in_memory::benchmark_kernel(
        Backend::best(),
        NoiseSet::Ideal,
        &light,
        LightMode::FrameEveryReadout,
        budget * 2,
    )?;
    (row.work, row.light) = ("kernel, frames from memory", "new frame");
    drop(light);
    let read = timing::read_bandwidth(budget * 2);
    let mut add =
        |name: &str, value, unit| report.figures.push(BenchmarkFigure { name: name.to_owned(), value, unit });
    add("read bandwidth of memory, one core", read / 1e9, "GB/s");
    add(
        "share of the read bandwidth that an ideal camera reaches with a new u8 frame per readout",
        1e11 * row.speed / read,
        "%",
    );
    report.rows.push(row);
    Ok(())
}

/// Benchmarks new files with one thread and with `all` threads.
///
/// The runs alternate, and the fastest run of each number of threads is reported. The first run is slower, because the
/// system has not yet used the memory of its pages.
fn benchmark_files(folder: &Path, all: usize, readouts: usize) -> Result<Vec<SpeedRow>> {
    let mut counts = vec![1, all];
    counts.dedup();
    let run = |threads: &usize| stream::benchmark_simulate(folder, *threads, readouts);
    let mut best = counts.iter().map(run).collect::<Result<Vec<SpeedRow>>>()?;
    for _ in 1..FILE_RUNS {
        for (best, threads) in best.iter_mut().zip(&counts) {
            let row = run(threads)?;
            best.speed = best.speed.max(row.speed);
        }
    }
    Ok(best)
}

/// Returns the powers of two below `all`, followed by `all`.
fn thread_counts(all: usize) -> Vec<usize> {
    let mut counts: Vec<_> =
        std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|n| *n < all).collect();
    counts.push(all);
    counts
}
