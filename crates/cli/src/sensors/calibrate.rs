//! Implements `spikelane calibrate`, which fits a camera file to recordings.

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;

use serde_json::json;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane_calibrate::{
    CalibrateOptions, Calibration, CalibrationFiles, RecordingSet, SneeOptions, calibrate, estimate_snee,
    import_maps, measure_levels,
};
use spikelane_measure::Estimate;
use spikelane_measure::report::{with_error, without_error};

use crate::common::{Console, FileProgress, claim_files, parse_mosaic, print_set_warnings, run_record};
use crate::sensors::static_recording::template_remedy;

/// Fit a camera to recordings of known light
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// Read a recording set (.toml) or calibration maps (.npz)
    ///
    /// The maps are the arrays D_light and Nd of SpikeNeRF and RSIR, with one value per pixel.
    recordings: PathBuf,
    /// Write camera.toml and reports to this folder
    ///
    /// The files are camera.toml with its maps, calibration.json and report.html.
    #[arg(short, long, value_name = "DIR", default_value = "calibration")]
    output: PathBuf,
    /// After a spike, remove this share of the charge of the next readout
    ///
    /// A pixel loses this charge in the dead time of its reset.
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.002)]
    dead_time_fraction: f64,
    /// Set the relative error of levels [default: from the set, else 0.01]
    ///
    /// The error is the standard deviation of the stated light, divided by this light.
    #[arg(long, value_name = "SHARE")]
    light_uncertainty: Option<f64>,
    /// Limit the relative error of pixel gains [default: none]
    ///
    /// The relative error is the median standard error of the pixel gains, divided by the mean gain.
    #[arg(long, value_name = "SHARE")]
    max_gain_error: Option<f64>,
    /// Also run SNEE, the estimator of the SCSim paper
    ///
    /// The result lists the parameters that SNEE could not identify.
    #[arg(long)]
    snee: bool,
    /// With --snee, ignore the stated levels
    ///
    /// SNEE then estimates the conversion rate from the dynamic range.
    #[arg(long, requires = "snee")]
    unknown_levels: bool,
    /// Set the color filters, such as RGGB, or none [default: from the set, else detected]
    ///
    /// The set states the filters in its key mosaic or in the sidecars of its recordings. The letters are the filters of the
    /// first rows and columns, row by row. quad-RGGB has blocks of 2x2 pixels, and RGBG/GWGW has one part per row.
    #[arg(hide_short_help = true, long, value_name = "PATTERN")]
    mosaic: Option<String>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// If the recording set is invalid, or if a file cannot be written.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    check_not_stream(&args.recordings)?;
    let imported = args.recordings.extension().is_some_and(|e| e == "npz");
    let output_names = ["camera.toml", "calibration.json", "report.html"];
    let maps: &[&str] = if imported { &["rate_dark.npy", "rate_light.npy", "recordings.toml"] } else { &[] };
    let files = output_names.iter().chain(maps).map(|name| args.output.join(name));
    // The claim lasts until the last file has its final name.
    let _claim = claim_files(files, args.force)?;
    let mut set = if imported {
        let path = import_maps(&args.recordings, &args.output, args.force)?;
        out.print_message(format_args!(
            "{}: dark rates and rates under 335 lux, in {}",
            args.recordings.display(),
            path.display()
        ));
        RecordingSet::open(&path)?
    } else {
        RecordingSet::open(&args.recordings)?
    };
    if let Some(text) = &args.mosaic {
        parse_mosaic(text)?;
        set.mosaic = Some(text.clone());
    }
    print_set_warnings(&set, out)?;
    let paper = SneeOptions { has_known_levels: !args.unknown_levels, ..SneeOptions::default() };
    if args.snee {
        paper.check()?;
    }
    let mut progress = FileProgress::new(out);
    let observed = measure_levels(&set, &mut |name, share| progress.update(name, share))?;
    drop(progress);
    let options = CalibrateOptions {
        dead_time_fraction: args.dead_time_fraction,
        light_uncertainty: args.light_uncertainty,
        max_gain_error: args.max_gain_error,
        ..CalibrateOptions::default()
    };
    let mut calibration = calibrate(&observed, &options)?;
    if args.snee {
        calibration.snee = Some(estimate_snee(&observed, &paper)?);
    }
    let run = run_record(std::iter::once(args.recordings.clone()).chain(set.input_files()));
    let files = calibration.write(&args.output, &run, args.force)?;
    let mut result = calibration.to_json();
    result["event"] = json!("done");
    result["files"] =
        json!([&files.camera, &files.calibration_json, &files.report].map(|f| f.display().to_string()));
    out.print_result(&result, &result_text(&calibration, &files))
}

/// Returns an error if `path` is a stream instead of a recording set, because the light of a stream is unknown. The
/// error recommends `spikelane record --template`, which writes a recording set.
fn check_not_stream(path: &Path) -> Result<()> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !path.is_dir() && !["dat", "npy", "h5", "hdf5"].contains(&&*ending) {
        return Ok(());
    }
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new(".")) };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    Err(Error::new(ErrorKind::Usage, path.display())
        .found(if path.is_dir() { "a folder" } else { "one recording" })
        .expected("a recording set (.toml): dark and flat fields of known light")
        .remedy(template_remedy(folder)))
}

fn result_text(calibration: &Calibration, files: &CalibrationFiles) -> String {
    let mut lines = result_lines(calibration);
    lines.push(calibration.verdict());
    lines.extend(calibration.cautions().iter().map(|caution| format!("* {caution}")));
    lines.extend(calibration.notes.iter().cloned());
    if let Some(paper) = &calibration.snee {
        let edges = paper.edge_counts();
        lines.push(format!(
            "The paper's estimator placed {} at the lower limit of +-{:.0} %, {} at the upper limit and {} between the limits ({} without a solution). At a limit, the split of a threshold into C_S and V_S is not a measurement.",
            Count(edges.at_lower_edge, "threshold"),
            100.0 * paper.box_half_width,
            Count(edges.at_upper_edge, "threshold"),
            Count(edges.between_edges, "threshold"),
            Count(edges.unsolved, "pixel"),
        ));
    }
    lines.extend([&files.camera, &files.calibration_json, &files.report].map(|f| f.display().to_string()));
    lines.join("\n") + "\n"
}

/// Returns one line for each fitted number and each lamp.
fn result_lines(c: &Calibration) -> Vec<String> {
    let p = &c.population;
    let value = |e: Estimate| match e.error.is_finite() {
        true => format!("{:#}", with_error(e.value, e.error)),
        false => format!("{} (assumed)", without_error(e.value)),
    };
    let percent = |value: f64, error: f64| {
        let rounded = with_error(100.0 * value, 100.0 * error);
        let sign = if value > 0.0 { "+" } else { "" };
        format!("{sign}{} % +- {} %", rounded.value_column(), rounded.error_column())
    };
    let mut lines = vec![
        format!(
            "gain                  {} thresholds per readout at full light, spread {}",
            value(p.mean_a),
            value(p.sd_a)
        ),
        format!("dark rate             {} thresholds per readout, spread {}", value(p.mean_d), value(p.sd_d)),
        format!("electrons             {} per threshold", value(c.electrons_per_threshold)),
        format!("threshold noise       {} of the threshold", value(c.sigma_t)),
        format!(
            "defects               {} dead, {} hot, {} nonlinear, {} unknown",
            c.dead_pixels.len(),
            c.hot_pixels.len(),
            c.poor_fit_pixels.len(),
            c.unfitted_pixels().len()
        ),
    ];
    for channel in &c.channels {
        lines.push(format!(
            "channel {:<13} light {}, gain {}, spread {}",
            channel.name,
            value(channel.light),
            value(channel.population.mean_a),
            value(channel.population.sd_a)
        ));
    }
    for lamp in c.lamps.iter().filter(|l| l.stated_light > 0.0) {
        let verdict = match (lamp.is_saturated, lamp.is_outlier) {
            (true, _) => "saturated: not estimated".to_owned(),
            (_, wrong) => format!(
                "estimated {} ({}, pull {:+.1}){}",
                with_error(lamp.found_light(), lamp.deviation.error).value_column(),
                percent(lamp.deviation.value / lamp.stated_light, lamp.deviation.error / lamp.stated_light),
                lamp.pull().unwrap_or(0.0),
                if wrong { ", lamp off" } else { "" }
            ),
        };
        lines.push(format!("light {:<15.5} {verdict}; {}", lamp.stated_light, lamp.file));
    }
    if let Some(additivity) = &c.additivity {
        for sum in &additivity.sums {
            lines.push(format!(
                "sum {:<17} {} more than its sources; {}",
                sum.sources.join(" + "),
                percent(sum.residual.value, sum.residual.error),
                sum.file
            ));
        }
        lines.push(format!(
            "additivity            the response deviates from a line by {} at full light",
            percent(additivity.curvature.value, additivity.curvature.error)
        ));
    }
    lines
}
