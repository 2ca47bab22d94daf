//! Implements `spikelane benchmark list`.

use serde_json::json;

use crate::common::Console;
use spikelane::Result;
use spikelane_benchmark::suite::Suite;

/// List the suites, or the groups of one suite
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Describe this suite: a name, or the path of a suite file
    suite: Option<String>,
}

/// Runs the command.
///
/// # Errors
/// Those of [`Suite::load`].
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if let Some(name) = &args.suite {
        return describe(&Suite::load(name)?, out);
    }
    for name in Suite::builtin_names() {
        let suite = Suite::builtin(name)?;
        let (version, task) = (&suite.version, suite.task.name());
        let event = json!({
            "event": "suite", "name": name, "version": version, "task": task, "description": suite.description,
        });
        out.print_result(&event, &format!("{name:<15} {version}  {task:<15} {}\n", suite.description))?;
    }
    Ok(())
}

fn describe(suite: &Suite, out: &Console) -> Result<()> {
    let (name, version) = (&suite.name, &suite.version);
    let metrics: Vec<_> = suite.metrics.iter().map(|metric| metric.id()).collect();
    let mut text = format!("{name} {version}: {}\n", suite.description);
    text += &format!(
        "task {}, scene version {}\nmetrics {}\n",
        suite.task,
        suite.scene_version,
        metrics.join(" ")
    );
    let mut groups = Vec::new();
    for group in suite.groups(&suite.other_splits())? {
        let sequences = group.sequences();
        let note = if group.is_scored { "" } else { "  not scored; generate it with --split" };
        text += &format!(
            "{:<24} {sequences:>4} sequences of {} readouts{note}\n",
            group.name.as_str(),
            suite.readouts()
        );
        groups.push(json!({
            "group": group.name.as_str(), "sequences": sequences, "readouts": suite.readouts(), "is_scored": group.is_scored,
        }));
    }
    let event = json!({
        "event": "suite", "name": name.as_str(), "version": version, "task": suite.task.name(),
        "description": suite.description, "metrics": metrics, "scene_version": suite.scene_version, "groups": groups,
    });
    out.print_result(&event, &text)
}
