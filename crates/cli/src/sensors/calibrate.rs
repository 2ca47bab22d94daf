//! `spikelane calibrate`: from recordings to a camera file.

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;

use serde_json::json;
use spikelane::error::{Error, Kind, Result};
use spikelane_calibrate::{
    CalibrateOptions, Calibration, Files as Written, RecordingSet, SneeOptions, calibrate, import_maps,
    observe, snee, write,
};
use spikelane_measure::Estimate;

use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::progress::Files;
use crate::shared::stream::warn_of_set;

/// Fit a camera to recordings of known light.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// The recording set (TOML), or published calibration maps D_light, Nd and Nl (.npz)
    recordings: PathBuf,
    /// Folder for camera.toml with its maps, calibration.json and report.html.
    #[arg(short, long, value_name = "DIR", default_value = "calibration")]
    output: PathBuf,
    /// Share of the first increment after a spike that the reset loses.
    #[arg(long, default_value_t = 0.002)]
    dead_time: f64,
    /// Relative standard deviation of the light levels [default: what the set states, else 0.01].
    #[arg(long, value_name = "SHARE")]
    light_uncertainty: Option<f64>,
    /// Refuse a set that gives the gain of a pixel less precisely than this (relative).
    #[arg(long)]
    precision: Option<f64>,
    /// Also run the SCSim paper's estimator, and say what it could not identify.
    #[arg(long)]
    snee: bool,
    /// With --snee: take the conversion rate from the dynamic range, not from the levels.
    #[arg(long, requires = "snee")]
    levels_unknown: bool,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// When the set is bad, or a file cannot be written.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    refuse_streams(&args.recordings)?;
    let imported = args.recordings.extension().is_some_and(|e| e == "npz");
    let own = ["camera.toml", "calibration.json", "report.html"];
    let maps: &[&str] = if imported { &["rate_dark.npy", "rate_light.npy", "recordings.toml"] } else { &[] };
    let files = own.iter().chain(maps).map(|name| args.output.join(name));
    // Held until the last file has its name.
    let _claim = outputs::claim(files, args.force)?;
    let set = if imported {
        let path = import_maps(&args.recordings, &args.output, args.force)?;
        out.say(format_args!(
            "{}: rates in the dark and under 335 lux, in {}",
            args.recordings.display(),
            path.display()
        ));
        RecordingSet::open(&path)?
    } else {
        RecordingSet::open(&args.recordings)?
    };
    warn_of_set(&set, out)?;
    let paper = SneeOptions { levels_known: !args.levels_unknown, ..SneeOptions::default() };
    if args.snee {
        paper.check()?;
    }
    let mut progress = Files::new(out);
    let observed = observe(&set, &mut |name, share| progress.step(name, share))?;
    drop(progress);
    let options = CalibrateOptions {
        lost_increment: args.dead_time,
        light_uncertainty: args.light_uncertainty,
        precision: args.precision,
        ..CalibrateOptions::default()
    };
    let mut calibration = calibrate(&observed, &options)?;
    if args.snee {
        calibration.paper = Some(snee(&observed, &paper)?);
    }
    let files = write(&calibration, &args.output, args.force)?;
    let mut result = calibration.to_json();
    result["event"] = json!("done");
    result["files"] = json!([&files.camera, &files.json, &files.report].map(|f| f.display().to_string()));
    out.result(&result, &text(&calibration, &files))
}

/// A stream alone says nothing of its light: what to type for a set.
fn refuse_streams(path: &Path) -> Result<()> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !path.is_dir() && !["dat", "npy", "h5", "hdf5"].contains(&&*ending) {
        return Ok(());
    }
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new(".")) };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    Err(Error::new(Kind::Usage, path.display())
        .found(if path.is_dir() { "a folder" } else { "one recording" })
        .expected("a recording set (.toml): the dark and flat fields of known light")
        .remedy(format_args!(
            "'spikelane record --template {}' lists the recordings there",
            folder.display()
        )))
}

fn text(calibration: &Calibration, files: &Written) -> String {
    let mut lines = found(calibration);
    lines.push(calibration.verdict());
    lines.extend(calibration.cautions().iter().map(|caution| format!("* {caution}")));
    lines.extend(calibration.notes.iter().cloned());
    if let Some(paper) = &calibration.paper {
        let edges = paper.edges();
        lines.push(format!(
            "The paper's estimator put {} thresholds on the lower edge of its box of +-{:.0} %, {} on the upper one and {} between ({} not solved): on an edge the split into C_S and V_S is the box, not a measurement.",
            edges.lower,
            100.0 * paper.box_width,
            edges.upper,
            edges.inside,
            edges.failed
        ));
    }
    lines.extend([&files.camera, &files.json, &files.report].map(|f| f.display().to_string()));
    lines.join("\n") + "\n"
}

/// The numbers found, a line each, and every lamp.
fn found(c: &Calibration) -> Vec<String> {
    let p = &c.population;
    let value = |e: Estimate, digits: usize| match e.error.is_finite() {
        true => format!("{:.digits$} +- {:.digits$}", e.value, e.error),
        false => format!("{:.digits$} (assumed)", e.value),
    };
    let mut lines = vec![
        format!(
            "gain                  {} thresholds a readout at full light, spread {}",
            value(p.mean_a, 5),
            value(p.sd_a, 5)
        ),
        format!(
            "dark rate             {} thresholds a readout, spread {}",
            value(p.mean_d, 6),
            value(p.sd_d, 6)
        ),
        format!("electrons a spike     {}", value(c.electrons, 0)),
        format!("threshold noise       {} of the threshold", value(c.sigma_t, 6)),
        format!(
            "defects               {} dead, {} hot, {} off their line, {} unknown",
            c.dead.len(),
            c.hot.len(),
            c.misfits.len(),
            c.unknown().len()
        ),
    ];
    for lamp in c.levels.iter().filter(|l| l.stated > 0.0) {
        let said = match (lamp.saturated, lamp.wrong) {
            (true, _) => "saturated: not told".to_owned(),
            (_, wrong) => format!(
                "found {:.5} ({:+.3} % +- {:.3} %){}",
                lamp.found(),
                100.0 * lamp.deviation.value / lamp.stated,
                100.0 * lamp.deviation.error / lamp.stated,
                if wrong { ", off" } else { "" }
            ),
        };
        lines.push(format!("light {:<15.5} {said}; {}", lamp.stated, lamp.file));
    }
    lines
}
