//! Implements `spikelane diagnose`, which finds effects that a camera model is missing.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args as ClapArgs;
use serde_json::{Value, json};
use spikelane::error::Result;
use spikelane::presets;
use spikelane_calibrate::RecordingSet;
use spikelane_diagnose::{
    Detectability, DetectabilityReport, DiagnoseOptions, Diagnosis, Fault, PreliminaryResult,
    ReadoutSelection, Verdict, detectability, diagnose_with_preliminary, write_diagnosis,
};
use spikelane_measure::report::{today, with_interval, without_error};

use crate::common::{Console, FileProgress, claim_files, recorded_command, recorded_path, run_record};
use crate::sensors::static_recording::StaticRecordingArgs;

/// Find, name and add the effects that a camera model is missing
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// Read this recording set (.toml) or static recording
    recordings: PathBuf,
    /// Start from this camera [default: calibrate the set]
    ///
    /// By default the published model is calibrated on the recording set.
    #[arg(long, value_name = "NAME|FILE")]
    camera: Option<String>,
    /// Test the effects on this second recording set or recording
    ///
    /// It must show the same scenes as the first set. By default, effects are fitted to the first half of every recording
    /// and tested on the second half.
    #[arg(long, value_name = "FILE")]
    holdout: Option<PathBuf>,
    #[command(flatten)]
    stream: StaticRecordingArgs,
    /// Set the seed of the simulations
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Use all readouts of large recordings
    ///
    /// By default, only the first 35 million pixel-readouts of each recording are used, but at least 1,250 readouts and
    /// five half periods of a square wave.
    #[arg(long)]
    all_readouts: bool,
    /// Store simulations in this folder, for resuming
    ///
    /// A run with the same recordings, camera, seed, kind of machine and program version reads the simulations from this
    /// folder and returns the same numbers. A diagnosis stores a few megabytes.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// End with the best result so far after this time
    ///
    /// The reports then list the open questions. Reading and writing take some seconds more.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, conflicts_with = "detectability")]
    time_limit: Option<Duration>,
    /// Only print the detectable strength of each effect
    #[arg(long)]
    detectability: bool,
    /// Write reports to this folder
    ///
    /// The files are diagnosis.json, camera.toml and report.html.
    #[arg(short, long, value_name = "DIR", default_value = "diagnosis")]
    output: PathBuf,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

impl Args {
    /// Returns the remedy of an interrupted diagnosis. It describes the remaining files.
    pub(crate) fn interrupt_message(&self) -> String {
        match &self.cache {
            Some(folder) => format!(
                "no report was written; the finished simulations are in '{}': to continue, run the same command again",
                folder.display()
            ),
            None => {
                "nothing was written; with --cache DIR, an interrupted diagnosis can be resumed".to_owned()
            }
        }
    }
}

/// Runs the command.
///
/// # Errors
/// If a set is invalid, or if a file cannot be written.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let files = ["diagnosis.json", "report.html", "camera.toml"].map(|name| args.output.join(name));
    // The claim lasts until the last file has its final name.
    let _claim = (!args.detectability).then(|| claim_files(&files, args.force)).transpose()?;
    let camera = args.camera.as_deref().map(presets::load).transpose()?;
    let open = |path: &PathBuf| args.stream.open(path, camera.as_ref(), out);
    let set = open(&args.recordings)?;
    let holdout = args.holdout.as_ref().map(open).transpose()?;
    let extent = if args.all_readouts { ReadoutSelection::All } else { ReadoutSelection::Leading };
    let start = Instant::now();
    let mut bar = FileProgress::new(out);
    let line = bar.clone_bar();
    let mut progress = |what: &str, share: f64| bar.update(what, share);
    let options = DiagnoseOptions {
        camera: camera.as_ref(),
        seed: args.seed,
        readout_selection: extent,
        cache: args.cache.as_deref(),
        time_limit: args.time_limit,
        ..DiagnoseOptions::default()
    };
    if args.detectability {
        let report = detectability(&set, options, &mut progress)?;
        drop(bar);
        return out.print_result(&detectability_json(&report), &detectability_text(&report));
    }
    let mut first = |look: &PreliminaryResult| {
        let seconds = start.elapsed().as_secs_f64();
        line.suspend(|| {
            out.print_message(format_args!("first result ({seconds:.0} s): {}", look.sentence()))
        });
        // If standard output cannot be written, the work still continues.
        let _ = out.print_event(
            &json!({"event": "preliminary", "is_consistent": look.is_consistent, "likely_effects": look.likely_effects, "seconds": seconds}),
        );
    };
    let mut diagnosis =
        diagnose_with_preliminary(&set, holdout.as_ref(), options, &mut progress, &mut first)?;
    drop(bar);
    if let Some([had, simulated]) = diagnosis.cache_counts {
        out.print_message(format_args!("simulations: {had} from the cache, {simulated} new"));
    }
    if let Some(provenance) = &mut diagnosis.provenance {
        provenance.set_file = Some(recorded_path(&args.recordings));
        provenance.command = Some(recorded_command());
        if let Some(path) = &args.holdout {
            provenance.held_out += &format!(", {}", recorded_path(path));
        }
        provenance.date = Some(today());
    }
    let second_set = holdout.iter().flat_map(RecordingSet::input_files);
    let sets = std::iter::once(&args.recordings).chain(&args.holdout).cloned();
    let run = run_record(sets.chain(set.input_files()).chain(second_set));
    let mut result = write_diagnosis(&diagnosis, &args.output, &run, args.force)?;
    result["event"] = json!("done");
    out.print_result(&result, &diagnosis_text(&diagnosis, args))
}

fn parse_seconds(text: &str) -> std::result::Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.filter(|limit| !limit.is_zero()).ok_or_else(|| "expected a positive number of seconds".to_owned())
}

fn detectability_json(report: &DetectabilityReport) -> Value {
    let row = |n: &Detectability| json!({"name": n.name, "parameter": n.parameter, "strength": n.strength, "nearest_candidate": n.nearest_candidate, "cosine": n.cosine});
    let rows: Vec<Value> = report.detectabilities.iter().map(row).collect();
    let faults: Vec<String> = report.faults.iter().map(Fault::sentence).collect();
    json!({"event": "done", "detectability": rows, "undetectable": report.undetectable, "faults": faults, "notes": report.notes})
}

fn detectability_text(report: &DetectabilityReport) -> String {
    let mut text = String::new();
    report.faults.iter().for_each(|f| text += &format!("fault: {}\n", f.sentence()));
    for n in &report.detectabilities {
        let _ = writeln!(
            text,
            "{:<24} {} {:.3e}   most similar: {} ({:+.2})",
            n.name, n.parameter, n.strength, n.nearest_candidate, n.cosine
        );
    }
    if !report.undetectable.is_empty() {
        let _ = writeln!(text, "not detectable with this set: {}", report.undetectable.join(", "));
    }
    text += "The strengths are valid with --holdout and a second recording set. Without --holdout, every recording is split into two halves, and the detectable strengths are 1.4 times as large.\n";
    report.notes.iter().for_each(|n| text += &format!("{n}\n"));
    text
}

fn diagnosis_text(diagnosis: &Diagnosis, args: &Args) -> String {
    let verdict = match diagnosis.verdict {
        Verdict::Agrees => "agrees",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly explained",
        Verdict::Unknown => "unknown",
        Verdict::Undecided => "undecided",
    };
    let mut text = format!("{verdict} ({:.1} s)\n", diagnosis.seconds);
    for question in &diagnosis.undecided {
        let _ = writeln!(text, "not decided within the time limit: {question}");
    }
    for fault in &diagnosis.faults {
        let _ = writeln!(text, "fault: {}", fault.sentence());
    }
    for effect in &diagnosis.effects {
        let ties = if effect.ambiguous_with.is_empty() {
            String::new()
        } else {
            format!(", or {}", effect.ambiguous_with.join(", "))
        };
        let _ =
            writeln!(text, "{}{}{ties}", if effect.is_tentative { "resembles " } else { "" }, effect.name);
        for p in &effect.parameters {
            let _ = writeln!(text, "  {} {}", p.name, with_interval(p.value, p.low, p.high));
        }
    }
    for m in &diagnosis.parameter_mismatches {
        let ties = if m.ambiguous_with.is_empty() {
            String::new()
        } else {
            format!(", or {}", m.ambiguous_with.join(", "))
        };
        let resembles = if m.is_tentative { "resembles " } else { "" };
        let _ = writeln!(
            text,
            "{resembles}mismatch {}{ties}: {}, the model has {}",
            m.parameter,
            with_interval(m.fitted_value, m.low, m.high),
            without_error(m.model_value)
        );
    }
    for u in &diagnosis.unexplained {
        let _ = writeln!(text, "unexplained: {} ({:+.1} standard deviations)", u.r#where, u.z);
    }
    let limited = diagnosis.limits.iter().filter(|l| l.limit.is_some()).count();
    if limited > 0 {
        let all = diagnosis.limits.len();
        let _ = writeln!(
            text,
            "limits: {limited} of {all} other effects are below their limits in the report, with 95 % confidence"
        );
    }
    if !diagnosis.undetectable.is_empty() {
        let _ = writeln!(text, "not detectable with this set: {}", diagnosis.undetectable.join(", "));
    }
    for note in &diagnosis.notes {
        let _ = writeln!(text, "note: {note}");
    }
    let _ = writeln!(text, "{}", args.output.join("report.html").display());
    text
}
