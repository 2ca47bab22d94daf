//! The keys of a suite file.

use serde::Deserialize;
use toml::{Table, Value};

use spikelane::error::Result;
use spikelane::presets;
use spikelane::unstable::error::toml_fault;
use spikelane::unstable::inputs::{PlainName, deserialize_digest};

use super::curve::{Curve, CurveValue, Quantity};
use super::{SCORED_SPLIT, Suite, SuiteSplit, Task, config_error, dataset_options};
use crate::Metric;

/// Version of the file format.
const FORMAT_VERSION: u32 = 1;

/// Maximum numbers of curves, and of values of a curve.
const MAX_CURVES: usize = 16;
const MAX_CURVE_VALUES: usize = 32;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SuiteFile {
    format_version: u32,
    name: PlainName,
    version: String,
    description: String,
    scene_version: u32,
    release: String,
    task: Task,
    metrics: Vec<String>,
    #[serde(default, deserialize_with = "deserialize_digest")]
    digest: Option<String>,
    sealed: Option<String>,
    dataset: Table,
    splits: Vec<SplitTable>,
    #[serde(default)]
    curves: Vec<CurveTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SplitTable {
    name: PlainName,
    seed: Seed,
    sequences: u32,
    /// Only a revealed suite has several scored splits.
    #[serde(default)]
    scored: Option<bool>,
}

/// A seed as a TOML integer. A seed above the range of TOML integers is text.
#[derive(Deserialize)]
#[serde(untagged)]
enum Seed {
    Number(u64),
    Text(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CurveTable {
    name: PlainName,
    quantity: Quantity,
    values: Vec<Value>,
    sequences: u32,
}

/// Parses a suite file. The caller checks the groups.
pub(super) fn parse(text: &str) -> Result<Suite> {
    let file: SuiteFile = toml::from_str(text).map_err(|e| config_error("suite").found(toml_fault(&e)))?;
    if file.format_version != FORMAT_VERSION {
        return Err(config_error("suite")
            .found(format_args!("version {} of the format", file.format_version))
            .expected(FORMAT_VERSION)
            .remedy(format_args!("use spikelane {}", file.release)));
    }
    check_version(&file.version)?;
    let metrics = file.metrics.iter().map(|id| find_metric(id)).collect::<Result<Vec<_>>>()?;
    if metrics.is_empty() {
        return Err(config_error("metrics").found("none").expected("at least one metric"));
    }
    if let Some(foreign) = metrics.iter().find(|metric| !file.task.has_metric(metric)) {
        return Err(config_error("metrics")
            .found(format_args!("`{}`", foreign.id()))
            .expected(format_args!("metrics of the task {}", file.task)));
    }
    let splits = file.splits.into_iter().map(SplitTable::into_split).collect::<Result<Vec<_>>>()?;
    let Some(scored) = splits.iter().find(|split| split.is_scored) else {
        return Err(config_error("splits")
            .found("no scored split")
            .expected(format_args!("a split with the name {SCORED_SPLIT}")));
    };
    let most = scored.sequences;
    let curves = file.curves.into_iter().map(|table| table.into_curve(most)).collect::<Result<Vec<_>>>()?;
    if curves.len() > MAX_CURVES {
        return Err(config_error("curves")
            .found(curves.len())
            .expected(format_args!("at most {MAX_CURVES}")));
    }
    let mut dataset = file.dataset;
    check_camera(dataset.get("camera"))?;
    dataset.insert("format_version".to_owned(), Value::Integer(1));
    for key in ["seed", "scene_seed", "camera_seed", "splits", "inputs"] {
        if dataset.contains_key(key) {
            return Err(config_error("dataset")
                .found(format_args!("the key {key}"))
                .expected("scenes, camera, images; the splits of the suite state the seeds"));
        }
    }
    Ok(Suite {
        name: file.name,
        version: file.version,
        description: file.description,
        scene_version: file.scene_version,
        release: file.release,
        task: file.task,
        metrics,
        splits,
        curves,
        digest: file.digest,
        sealed: file.sealed,
        text: text.to_owned(),
        options: dataset_options(dataset)?,
    })
}

/// Checks that the camera is a preset, the distribution of training cameras, or a table. A suite must not depend on
/// other files.
pub(crate) fn check_camera(camera: Option<&Value>) -> Result<()> {
    let is_known = |name: &str| name == "distribution" || presets::builtin(name).is_ok();
    let is_contained = match camera {
        None => true,
        Some(Value::String(name)) => is_known(name),
        Some(Value::Table(table)) => {
            !table.contains_key("file")
                && !table.contains_key("maps")
                && table.get("preset").is_none_or(|name| name.as_str().is_some_and(is_known))
        }
        Some(_) => false,
    };
    if is_contained {
        return Ok(());
    }
    Err(config_error("camera of the suite")
        .found("a camera file, a map or a list")
        .expected("the name of a preset, \"distribution\", or a table without files"))
}

/// Returns the metric with the identifier `name/version`.
pub(crate) fn find_metric(id: &str) -> Result<&'static Metric> {
    let (name, version) = id.split_once('/').unwrap_or((id, ""));
    let metric = Metric::find(name).ok_or_else(|| {
        config_error("metrics")
            .found(format_args!("`{id}`"))
            .expected("a metric of this program, such as psnr/1")
            .with_suggestion(name, crate::METRICS.iter().map(|m| m.name))
    })?;
    if version.parse() == Ok(metric.version) {
        return Ok(metric);
    }
    Err(config_error("metrics").found(format_args!("`{id}`")).expected(format_args!("`{}`", metric.id())))
}

fn check_version(text: &str) -> Result<()> {
    let parts: Vec<_> = text.split('.').map(|part| part.parse::<u32>().is_ok()).collect();
    if parts == [true; 3] {
        return Ok(());
    }
    Err(config_error("version").found(format_args!("`{text}`")).expected("three numbers, such as 0.1.0"))
}

impl SplitTable {
    fn into_split(self) -> Result<SuiteSplit> {
        let seed = match self.seed {
            Seed::Number(n) => n,
            Seed::Text(text) => text.parse().map_err(|_| {
                config_error(format_args!("seed of split {}", self.name))
                    .found(format_args!("`{text}`"))
                    .expected("a whole number from 0 to 18446744073709551615")
            })?,
        };
        let is_scored = self.scored.unwrap_or(self.name.as_str() == SCORED_SPLIT);
        Ok(SuiteSplit { name: self.name, seed, sequences: self.sequences, is_scored })
    }
}

impl CurveTable {
    fn into_curve(self, most: u32) -> Result<Curve> {
        let subject = format!("curve {}", self.name);
        if self.sequences == 0 || self.sequences > most {
            return Err(config_error(subject)
                .found(format_args!("{} sequences", self.sequences))
                .expected(format_args!("1 to {most}, the number of sequences of the scored split")));
        }
        if self.values.len() < 2 || self.values.len() > MAX_CURVE_VALUES {
            return Err(config_error(subject)
                .found(format_args!("{} values", self.values.len()))
                .expected(format_args!("2 to {MAX_CURVE_VALUES}")));
        }
        let mut values = Vec::new();
        for (index, value) in self.values.iter().enumerate() {
            let number = value.as_float().or_else(|| value.as_integer().map(|n| n as f64));
            let read = match (self.quantity.is_numeric(), number, value.as_str()) {
                (true, Some(x), _) if x.is_finite() => CurveValue { label: x.to_string(), x },
                (false, _, Some(text)) => CurveValue { label: text.to_owned(), x: index as f64 },
                _ => {
                    let kind = if self.quantity.is_numeric() { "numbers" } else { "names" };
                    return Err(config_error(subject).found(value).expected(kind));
                }
            };
            values.push(read);
        }
        Ok(Curve { name: self.name, quantity: self.quantity, values, sequences: self.sequences })
    }
}
