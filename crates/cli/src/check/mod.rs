//! Implements `spikelane check`, which compares a preset with the published code of the simulator that it describes.

mod bits;
mod frames;
mod peer;
mod statistics;

use std::path::PathBuf;

use clap::ValueEnum;
use serde_json::{Value, json};
use spikelane::unstable::Count;
use spikelane::{Camera, Error, ErrorKind, Geometry, Plan, Result, Seeds, SpikeFrames, presets};

use crate::common::{Console, CountProgress, stop_flag};
use frames::FrameFolder;
use peer::PeerRun;

/// Number of sensors of the preset whose statistics are compared with those of the other simulator.
const PRESET_RUNS: u64 = 20;

/// Largest value of `--seed`. NumPy accepts seeds of 32 bits, and each run has its own seed.
const MAX_SEED: i64 = u32::MAX as i64 - 100;

/// A simulator with a preset. The driver uses the same names as the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Peer {
    /// `video2spike_simulation` of Spike-Zoo
    Spikezoo,
    /// `video_to_spike` of SpikeCV
    Spikecv,
    /// `img_to_spike` of SpikeCV
    SpikecvImage,
    /// `get_spike` of SCSim
    Scsim,
}

impl Peer {
    /// Returns the name of the preset that describes the simulator.
    const fn preset(self) -> &'static str {
        match self {
            Self::Spikezoo => "spike-zoo",
            Self::Spikecv => "spikecv",
            Self::SpikecvImage => "spikecv-image",
            Self::Scsim => "scsim-code",
        }
    }

    /// Returns whether the driver reports the start charges.
    const fn has_start_charges(self) -> bool {
        matches!(self, Self::Spikezoo | Self::Spikecv)
    }
}

/// Check a preset against the published code of another simulator
///
/// The command runs the simulator's own converter from --code on your image or video, and the preset of the same name on the same
/// 8-bit images. It needs Python with NumPy, and opencv-python-headless or Pillow.
///
/// spikezoo, spikecv (its video converter) and spikecv-image have no noise. Their spikes are compared bit by bit: the preset
/// starts from the start charges that the other code draws. scsim draws noise, so statistics of several runs are compared.
/// If the streams differ, the exit code is 9.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Compare with spikezoo, spikecv, spikecv-image or scsim
    #[arg(value_name = "SIMULATOR", hide_possible_values = true)]
    simulator: Peer,
    /// Read light from this image, or from a folder, video or array with one image per readout
    input: PathBuf,
    /// Run the code in this checkout or installed package
    #[arg(long, value_name = "DIR")]
    code: PathBuf,
    /// Run this Python
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: PathBuf,
    /// Compare at most N readouts
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u16).range(20..=9999))]
    readouts: u16,
    /// Cut this size from the center [default: all; for scsim, at most 64x48]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    crop: Option<Geometry>,
    /// Set the code or value of full scale [default: the largest code, or 1.0]
    #[arg(long, value_name = "VALUE")]
    full_scale: Option<f64>,
    /// Use the part of a damaged image or video that can be decoded
    ///
    /// By default, damage is an error. With this flag, a warning describes the damage.
    #[arg(long)]
    accept_damage: bool,
    /// Run scsim N times
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=50))]
    runs: u8,
    /// Set the first seed of the code
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=MAX_SEED))]
    seed: u32,
}

fn parse_size(text: &str) -> Result<Geometry, String> {
    let wrong = || "expected WIDTHxHEIGHT in pixels, such as 96x64".to_owned();
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    let side = |side: &str| side.parse::<u32>().map_err(|_| wrong());
    Geometry::new(side(width)?, side(height)?).map_err(|error| error.to_string())
}

/// The result of a comparison: the conclusion, and the result as JSON and as text.
struct Verdict {
    conclusion: Conclusion,
    json: Value,
    text: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Conclusion {
    Equal,
    EqualWithinRounding,
    EqualOutsideTies,
    NoSignificantDifference,
    Different,
}

impl Conclusion {
    const fn text(self) -> &'static str {
        match self {
            Self::Equal => "equal",
            Self::EqualWithinRounding => "equal within rounding",
            Self::EqualOutsideTies => "equal outside ties",
            Self::NoSignificantDifference => "no significant difference",
            Self::Different => "different",
        }
    }
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let stop = stop_flag()?;
    let folder = tempfile::Builder::new().prefix("spikelane-check-").tempdir();
    let folder = folder.map_err(|e| Error::io("temporary folder", e))?;
    let frames = frames::write(args, folder.path())?;
    let mut camera = presets::builtin(args.simulator.preset())?;
    camera.sensor.geometry = frames.geometry;
    let job = peer::Job { args, folder: folder.path(), frames: &frames, stop: stop.clone() };
    let verdict = match args.simulator {
        Peer::Scsim => {
            let mut progress = CountProgress::with_unit(out, stop, "runs");
            let total = u64::from(args.runs);
            let mut runs = Vec::new();
            for run in 0..u32::from(args.runs) {
                progress.update(u64::from(run), Some(total))?;
                runs.push(job.run(args.seed + run)?);
            }
            drop(progress);
            let reference = (0..PRESET_RUNS)
                .map(|seed| simulate(&camera, Seeds { camera: seed, shot: seed, sequence: 0 }, &frames, None))
                .collect::<Result<Vec<_>>>()?;
            let light = frames.mean_light(&camera)?;
            let peer: Vec<SpikeFrames> = runs.iter().map(|run| run.spikes.clone()).collect();
            finish(args, &frames, &runs[0], statistics::compare(&peer, &reference, &light))
        }
        Peer::Spikezoo | Peer::Spikecv | Peer::SpikecvImage => {
            let run = job.run(args.seed)?;
            let own = simulate(&camera, Seeds::default(), &frames, run.start_charges.as_deref())?;
            let tolerance = if args.simulator == Peer::SpikecvImage {
                bits::Tolerance::Ties(frames.spikecv_image_ties()?)
            } else {
                let plan = Plan::new(&camera, Seeds::default())?;
                let exactness = bits::Exactness::new(args.simulator, plan.error_bounds());
                exactness.tolerance(frames.geometry.pixels(), &frames.charges(&camera)?)
            };
            finish(args, &frames, &run, bits::compare(&run.spikes, &own, &tolerance))
        }
    };
    out.print_result(&verdict.json, &verdict.text)?;
    if verdict.conclusion != Conclusion::Different {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Corrupt, format_args!("preset {}", args.simulator.preset()))
        .found("spikes that differ from those of the published code")
        .expected("the agreement that this comparison requires")
        .remedy("see the result above; compare the version of the code with the source in 'preset show'"))
}

/// Adds the facts about the runs to a verdict.
fn finish(args: &Args, frames: &FrameFolder, run: &PeerRun, verdict: Verdict) -> Verdict {
    let Verdict { conclusion, json: mut details, text } = verdict;
    let (preset, readouts, size) = (args.simulator.preset(), frames.readouts, frames.geometry);
    details["event"] = json!("check");
    details["preset"] = json!(preset);
    details["width"] = json!(size.width());
    details["height"] = json!(size.height());
    details["readouts"] = json!(readouts);
    details["agrees"] = json!(conclusion != Conclusion::Different);
    details["verdict"] = json!(conclusion.text());
    details["code"] = run.facts.clone();
    let fact = |key: &str| run.facts[key].as_str().unwrap_or("?").to_owned();
    let header = format!(
        "{} (SHA-256 {:.12}, NumPy {}) and preset {preset}, {size} pixels, {}\n",
        fact("source"),
        fact("sha256"),
        fact("numpy"),
        Count(readouts, "readout"),
    );
    let text = format!("{header}{text}verdict: {}\n", conclusion.text());
    Verdict { conclusion, json: details, text }
}

/// Simulates the frames, one per readout. `start_charges` are shares of the threshold.
fn simulate(
    camera: &Camera,
    seeds: Seeds,
    frames: &FrameFolder,
    start_charges: Option<&[f64]>,
) -> Result<SpikeFrames> {
    let mut simulator = spikelane::Simulator::new(camera, seeds)?;
    if let Some(shares) = start_charges {
        let state = simulator.plan().initial_state_with_charges(shares)?;
        simulator.set_state(state)?;
    }
    let mut spikes = SpikeFrames::zeros(frames.geometry, frames.readouts)?;
    let mut rest = spikes.as_bytes_mut();
    frames.for_each(camera, |frame, readouts| {
        let (now, later) = std::mem::take(&mut rest).split_at_mut(readouts * frames.geometry.frame_bytes());
        rest = later;
        simulator.fill(frame.samples().as_samples(), now)
    })?;
    Ok(spikes)
}
