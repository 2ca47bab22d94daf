//! `spikelane diagnose`: what a camera has that its model lacks.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args as ClapArgs;
use serde_json::{Value, json};
use spikelane::error::Result;
use spikelane::presets;
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::diagnose::{
    DiagnoseOptions, Diagnosis, Extent, Fault, FirstLook, Nameable, Strengths, Verdict, diagnose_and_tell,
    strengths, write,
};
use spikelane_measure::report::today;

use crate::shared::output::{Out, command_line, recorded};
use crate::shared::outputs;
use crate::shared::progress::Files;
use crate::shared::stream::warn_of_set;

/// Find what the model of a camera lacks, name it, and add it.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// The recording set (TOML).
    recordings: PathBuf,
    /// The model to start from, a preset or camera file; without one the published model is calibrated.
    #[arg(long)]
    camera: Option<String>,
    /// A second set of the same scenes, which judges what the first one names.
    #[arg(long)]
    holdout: Option<PathBuf>,
    /// Seed of the simulations: the same seed gives the same diagnosis.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Judge all readouts of large recordings, however long that takes: as a rule only the first 35 million
    /// pixel-readouts of each are, but 1,250 readouts and five half periods of a square wave at least.
    #[arg(long)]
    everything: bool,
    /// Folder that keeps simulations, some megabytes a diagnosis: the same recordings, camera and seed again, after Ctrl-C
    /// for one, take them from there, and the numbers are the same. Each version of the program has its own.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Only print how strong each effect must be before this set can name it.
    #[arg(long)]
    nameable: bool,
    /// Folder for diagnosis.json, camera.toml and report.html.
    #[arg(short, long, value_name = "DIR", default_value = "diagnosis")]
    output: PathBuf,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

impl Args {
    /// What stays after a stop.
    pub(crate) fn kept(&self) -> String {
        match &self.cache {
            Some(folder) => format!(
                "no report was written; the simulations so far are in '{}': run the same command again to go on",
                folder.display()
            ),
            None => "nothing was written; with --cache DIR the simulations so far are kept".to_owned(),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// When a set is bad, or a file cannot be written.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let files = ["diagnosis.json", "report.html", "camera.toml"].map(|name| args.output.join(name));
    // Held until the last file has its name.
    let _claim = (!args.nameable).then(|| outputs::claim(&files, args.force)).transpose()?;
    let set = RecordingSet::open(&args.recordings)?;
    let holdout = args.holdout.as_deref().map(RecordingSet::open).transpose()?;
    [Some(&set), holdout.as_ref()].into_iter().flatten().try_for_each(|set| warn_of_set(set, out))?;
    let camera = args.camera.as_deref().map(presets::load).transpose()?;
    let extent = if args.everything { Extent::Everything } else { Extent::Enough };
    let start = Instant::now();
    let mut bar = Files::new(out);
    let line = bar.clone_of_bar();
    let mut progress = |what: &str, share: f64| bar.step(what, share);
    let options = DiagnoseOptions {
        camera: camera.as_ref(),
        seed: args.seed,
        extent,
        cache: args.cache.as_deref(),
        ..DiagnoseOptions::default()
    };
    if args.nameable {
        let found = strengths(&set, options, &mut progress)?;
        drop(bar);
        return out.result(&as_json(&found), &as_text(&found));
    }
    let mut first = |look: &FirstLook| {
        let seconds = start.elapsed().as_secs_f64();
        line.suspend(|| out.say(format_args!("first look ({seconds:.0} s): {}", look.sentence())));
        // A reader that went away is no reason to stop the work.
        let _ = out.event(
            &json!({"event": "first-look", "agrees": look.agrees, "likely": look.likely, "seconds": seconds}),
        );
    };
    let mut found = diagnose_and_tell(&set, holdout.as_ref(), options, &mut progress, &mut first)?;
    drop(bar);
    if let Some([had, made]) = found.cached {
        out.say(format_args!("simulations: {had} from the cache, {made} made"));
    }
    if let Some(about) = &mut found.about {
        about.set = Some(recorded(&args.recordings));
        about.command = Some(typed());
        if let Some(path) = &args.holdout {
            about.held_out += &format!(", {}", recorded(path));
        }
        about.date = Some(today());
    }
    let mut result = write(&found, &args.output, args.force)?;
    result["event"] = json!("done");
    out.result(&result, &told(&found, args))
}

/// What was typed, without the folder of the program.
fn typed() -> String {
    let words = command_line().into_iter().skip(1);
    std::iter::once("spikelane".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

fn as_json(found: &Strengths) -> Value {
    let row = |n: &Nameable| json!({"name": n.name, "parameter": n.key, "strength": n.strength, "nearest": n.nearest, "cosine": n.alike});
    let rows: Vec<Value> = found.nameable.iter().map(row).collect();
    let faults: Vec<String> = found.faults.iter().map(Fault::sentence).collect();
    json!({"event": "done", "nameable": rows, "not_testable": found.not_testable, "faults": faults, "notes": found.notes})
}

fn as_text(found: &Strengths) -> String {
    let mut text = String::new();
    found.faults.iter().for_each(|f| text += &format!("fault: {}\n", f.sentence()));
    for n in &found.nameable {
        let _ = writeln!(
            text,
            "{:<24} {} {:.3e}   most like {} ({:+.2})",
            n.name, n.key, n.strength, n.nearest, n.alike
        );
    }
    if !found.not_testable.is_empty() {
        let _ = writeln!(text, "not shown by this set, however strong: {}", found.not_testable.join(", "));
    }
    text += "With a second set as --holdout; without one every recording is cut in two, and strengths are 1.4 times these.\n";
    found.notes.iter().for_each(|n| text += &format!("{n}\n"));
    text
}

fn told(found: &Diagnosis, args: &Args) -> String {
    let verdict = match found.verdict {
        Verdict::Agrees => "agrees",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly explained",
        Verdict::Unknown => "unknown",
    };
    let mut text = format!("{verdict} ({:.1} s)\n", found.seconds);
    for fault in &found.faults {
        let _ = writeln!(text, "fault: {}", fault.sentence());
    }
    for effect in &found.effects {
        let ties = if effect.tied_with.is_empty() {
            String::new()
        } else {
            format!(", or {}", effect.tied_with.join(", "))
        };
        let _ = writeln!(text, "{}{}{ties}", if effect.resembles { "resembles " } else { "" }, effect.name);
        for p in &effect.parameters {
            let _ = writeln!(text, "  {} {:.5} ({:.5} to {:.5})", p.name, p.value, p.low, p.high);
        }
    }
    for m in &found.misfits {
        let _ = writeln!(
            text,
            "misfit {}: {:.5} ({:.5} to {:.5}), the model has {:.5}",
            m.parameter, m.fitted, m.low, m.high, m.model
        );
    }
    for u in &found.unknown {
        let _ = writeln!(text, "left: {} ({:+.1} standard deviations)", u.r#where, u.z);
    }
    for note in &found.notes {
        let _ = writeln!(text, "note: {note}");
    }
    let _ = writeln!(text, "{}", args.output.join("report.html").display());
    text
}
