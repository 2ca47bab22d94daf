//! Compares the scores of methods: tables with intervals, paired differences, curves and the worst outputs.

mod markdown;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use spikelane::Geometry;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane_io::simulate::ImageFormat;
use spikelane_measure::report::{Curve as PlotCurve, PageElement, Table, marked_line_plot, page, png_image};

use crate::aggregate::{Bootstrap, summarize_differences};
use crate::generated::{GeneratedGroup, GeneratedSequence, GeneratedSuite};
use crate::run;
use crate::score::{OVERALL, ScoreFile, ScoreInterval, decode_image, reference_image};
use crate::suite::Task;
use crate::{Better, Metric};

pub use markdown::markdown;

/// Number of sequences whose outputs the page shows for each method.
const WORST_SEQUENCES: usize = 3;

/// Longest name of a method in tables and legends, in characters.
const MAX_NAME_CHARS: usize = 20;

/// The scores of a method, and the folder of its outputs.
#[derive(Clone, Debug)]
pub struct ScoredMethod {
    /// The scores.
    pub file: ScoreFile,
    /// The folder that contains `score.json` and `outputs`.
    pub folder: PathBuf,
    /// The name in reports. With `None`, reports use the baseline or the command of the score file.
    pub label: Option<String>,
}

/// A comparison of methods.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Report {
    /// The comparison as JSON.
    pub json: Value,
    /// The comparison as an HTML page without scripts and without links to other files.
    pub html: String,
}

impl ScoredMethod {
    /// Reads a `score.json`.
    ///
    /// # Errors
    /// The errors of [`ScoreFile::read`].
    pub fn read(path: &Path) -> Result<Self> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        Ok(Self { file: ScoreFile::read(path)?, folder: folder.to_owned(), label: None })
    }

    /// Sets the name in reports.
    #[must_use]
    pub fn with_label(mut self, label: Option<String>) -> Self {
        self.label = label;
        self
    }
}

/// Compares methods that ran on the same suite.
///
/// With `data`, the page shows the worst outputs of each method beside their references.
///
/// # Errors
/// * [`ErrorKind::Usage`] if there is no method.
/// * [`ErrorKind::Config`] if two score files have different suites, metrics or sequences.
pub fn report(methods: &[ScoredMethod], data: Option<&GeneratedSuite>) -> Result<Report> {
    let first = check_comparable(methods, data)?;
    let names = unique_names(methods);
    let metrics = listed_metrics(first)?;
    let primary = metrics[0];
    let mut parts = vec![PageElement::text(format!(
        "Suite {} {}, digest {}. {} sequences. An output with a fault has the scores of {}.",
        first.suite,
        first.version,
        first.digest,
        first.sequences.len(),
        first.trivial_answer
    ))];
    parts.push(PageElement::heading("Scores"));
    parts.push(PageElement::text(
        "Scores of the scored splits, with 95 % bootstrap intervals over sequences. Scores of detections and tracks count all \
         boxes together; other scores are means over sequences.",
    ));
    parts.push(PageElement::Table(score_table(methods, &names, &metrics)));
    parts.push(PageElement::heading("Cost"));
    parts.push(PageElement::Table(cost_table(methods, &names)));
    let differences = paired_differences(methods, &names, &metrics)?;
    if !differences.is_empty() {
        parts.push(PageElement::heading("Paired differences"));
        parts.push(PageElement::text(format!(
            "Mean differences to {} over the same sequences. If an interval excludes 0, the methods differ beyond the choice \
             of sequences.",
            names[0]
        )));
        parts.push(PageElement::Table(difference_table(&differences, &metrics)));
    }
    let curves = curve_points(first);
    for (curve, groups) in &curves {
        parts.push(PageElement::heading(&format!("Curve {curve}")));
        parts.push(curve_figure(methods, &names, (curve, groups), primary)?);
        parts.push(PageElement::Table(curve_table(methods, &names, groups, primary)));
    }
    if let Some(faults) = fault_list(methods, &names) {
        parts.push(PageElement::heading("Faults"));
        parts.push(faults);
    }
    let worst = worst_sequences(methods, primary);
    if let Some(data) = data {
        parts.push(PageElement::heading("Worst outputs"));
        for (index, method) in methods.iter().enumerate() {
            for sequence in &worst[index] {
                parts.extend(worst_figure(data, method, &names[index], sequence, primary)?);
            }
        }
    }
    let html = page(&format!("Benchmark {} {}", first.suite, first.version), &parts);
    let methods_json: Vec<Value> = methods
        .iter()
        .zip(&names)
        .zip(&worst)
        .map(|((method, name), worst)| {
            json!({
                "name": name, "method": method.file.method, "faults": method.file.faults(), "cost": method.file.cost,
                "summaries": method.file.summaries, "environment": method.file.environment,
                "worst": worst.iter().map(|s| json!({ "group": s.0, "id": s.1, "score": s.2 })).collect::<Vec<_>>(),
            })
        })
        .collect();
    let differences_json: Vec<Value> = differences
        .iter()
        .map(|d| json!({ "method": d.method, "baseline": names[0], "metric": d.metric, "mean": d.mean }))
        .collect();
    let json = json!({
        "format_version": 1, "suite": first.suite, "version": first.version, "digest": first.digest,
        "metrics": first.metrics, "methods": methods_json, "differences": differences_json,
    });
    Ok(Report { json, html })
}

/// Checks that the score files belong to the same suite and sequences. Returns the first file.
fn check_comparable<'a>(methods: &'a [ScoredMethod], data: Option<&GeneratedSuite>) -> Result<&'a ScoreFile> {
    let Some(first) = methods.first().map(|method| &method.file) else {
        return Err(Error::new(ErrorKind::Usage, "report").found("no score file").expected("at least one"));
    };
    let refused = |file: &ScoreFile, found: String, expected: String| {
        Err(Error::new(ErrorKind::Config, format_args!("scores of {}", file.method.name()))
            .found(found)
            .expected(expected)
            .remedy("run all methods on the same generated suite"))
    };
    let suite = |file: &ScoreFile| format!("suite {} {} {}", file.suite, file.version, file.digest);
    let sequences = |file: &ScoreFile| -> Vec<_> {
        file.sequences.iter().map(|s| (s.group.clone(), s.id.clone(), s.stream_digest.clone())).collect()
    };
    for file in methods.iter().map(|method| &method.file) {
        if file.digest != first.digest || file.metrics != first.metrics {
            return refused(file, suite(file), suite(first));
        }
        if sequences(file) != sequences(first) {
            return refused(file, "other sequences".into(), format!("the sequences of {}", suite(first)));
        }
        if file.sequences.iter().any(|s| s.scores.values().any(|score| !score.is_finite())) {
            return refused(file, "a score that is not finite".into(), "finite scores".into());
        }
    }
    if let Some(data) = data.filter(|data| data.digest != first.digest) {
        let found = format!("suite {} {} {}", data.suite.name, data.suite.version, data.digest);
        return refused(first, found, suite(first));
    }
    Ok(first)
}

/// Returns short names of the methods. Equal names get numbers.
fn unique_names(methods: &[ScoredMethod]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for method in methods {
        let name = method.label.as_deref().unwrap_or_else(|| method.file.method.name());
        let short: String = match name.chars().count() > MAX_NAME_CHARS {
            true => name.chars().take(MAX_NAME_CHARS - 3).chain("...".chars()).collect(),
            false => name.to_owned(),
        };
        let mut unique = short.clone();
        for number in 2.. {
            if !names.contains(&unique) {
                break;
            }
            unique = format!("{short} {number}");
        }
        names.push(unique);
    }
    names
}

fn listed_metrics(file: &ScoreFile) -> Result<Vec<&'static Metric>> {
    let found = file.metrics.iter().map(|id| crate::suite::find_metric(id)).collect::<Result<Vec<_>>>()?;
    if found.is_empty() {
        return Err(Error::new(ErrorKind::Config, "score file")
            .found("no metric")
            .expected("at least one metric"));
    }
    Ok(found)
}

/// Returns the header `first`, then each metric with its unit and an arrow for the better direction.
fn metric_header(first: &str, metrics: &[&Metric]) -> Table {
    let label = |metric: &&Metric| {
        let better = match metric.better {
            Better::Larger => "larger is better".to_owned(),
            Better::Smaller => "smaller is better".to_owned(),
            Better::CloserTo(target) => format!("closer to {target} is better"),
        };
        format!("{} ({}; {better})", metric.name, metric.unit)
    };
    let header: Vec<String> = std::iter::once(first.to_owned()).chain(metrics.iter().map(label)).collect();
    Table::new(&header.iter().map(String::as_str).collect::<Vec<_>>())
}

fn score_table(methods: &[ScoredMethod], names: &[String], metrics: &[&Metric]) -> Table {
    let mut table = metric_header("method", metrics);
    for (method, name) in methods.iter().zip(names) {
        let cell = |metric: &&Metric| {
            let summary = method.file.summary(OVERALL).and_then(|s| s.metrics.get(metric.name));
            summary.map_or("-".to_owned(), |summary| summary.pooled.to_string())
        };
        table.push_row(std::iter::once(name.clone()).chain(metrics.iter().map(cell)));
    }
    table
}

fn cost_table(methods: &[ScoredMethod], names: &[String]) -> Table {
    let mut table = Table::new(&[
        "method",
        "outputs per second",
        "latency 50 %, ms",
        "95 %, ms",
        "99 %, ms",
        "memory, MB",
        "faults",
        "processor",
    ]);
    for (method, name) in methods.iter().zip(names) {
        let cost = method.file.cost;
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        let latency = |i: usize| number(cost.map(|c| 1e3 * c.latency_seconds[i]));
        let memory = cost.and_then(|c| c.memory_peak_bytes).map(|bytes| bytes as f64 / 1e6);
        let environment = &method.file.environment;
        table.push_row([
            name.clone(),
            number(cost.map(|c| c.outputs_per_second)),
            latency(0),
            latency(1),
            latency(2),
            number(memory),
            method.file.faults().to_string(),
            environment.processor.clone().unwrap_or_else(|| environment.system.clone()),
        ]);
    }
    table
}

/// The mean difference of a metric between a method and the first method.
struct Difference {
    method: String,
    metric: &'static str,
    mean: ScoreInterval,
}

/// Compares each further method with the first method on the sequences of the scored splits.
fn paired_differences(
    methods: &[ScoredMethod],
    names: &[String],
    metrics: &[&'static Metric],
) -> Result<Vec<Difference>> {
    let curve_groups: Vec<&str> =
        methods[0].file.points().map(|(_, summary)| summary.group.as_str()).collect();
    let scores = |file: &ScoreFile, metric: &Metric| -> Vec<Vec<f64>> {
        let in_splits = file.sequences.iter().filter(|s| !curve_groups.contains(&s.group.as_str()));
        in_splits.filter_map(|s| Some(vec![*s.scores.get(metric.name)?])).collect()
    };
    let mut all = Vec::new();
    for (method, name) in methods.iter().zip(names).skip(1) {
        for metric in metrics {
            let pair = [&method.file, &methods[0].file].map(|file| scores(file, metric));
            if pair[0].is_empty() {
                continue;
            }
            let summary = summarize_differences(&pair[0], &pair[1], Bootstrap::default())?;
            let mean = summary.sequence_mean.into();
            all.push(Difference { method: name.clone(), metric: metric.name, mean });
        }
    }
    Ok(all)
}

fn difference_table(differences: &[Difference], metrics: &[&Metric]) -> Table {
    let mut table = metric_header("method", metrics);
    let mut names: Vec<&str> = differences.iter().map(|d| d.method.as_str()).collect();
    names.dedup();
    for name in names {
        let cell = |metric: &&Metric| {
            let found = differences.iter().find(|d| d.method == name && d.metric == metric.name);
            found.map_or("-".to_owned(), |d| d.mean.to_string())
        };
        table.push_row(std::iter::once(name.to_owned()).chain(metrics.iter().map(cell)));
    }
    table
}

/// A value of a curve: its text, its number and its group.
type CurveGroups = Vec<(String, f64, String)>;

/// Returns the points of each curve in the order of the file.
fn curve_points(file: &ScoreFile) -> Vec<(String, CurveGroups)> {
    let mut curves: Vec<(String, CurveGroups)> = Vec::new();
    for (point, summary) in file.points() {
        let entry = (point.value.clone(), point.x, summary.group.clone());
        match curves.iter_mut().find(|(name, _)| name == point.curve.as_str()) {
            Some((_, groups)) => groups.push(entry),
            None => curves.push((point.curve.to_string(), vec![entry])),
        }
    }
    curves
}

fn primary_score(file: &ScoreFile, group: &str, primary: &Metric) -> Option<ScoreInterval> {
    Some(file.summary(group)?.metrics.get(primary.name)?.pooled)
}

/// Draws the primary metric of every method along a curve. The axis is logarithmic if the values span a factor of 8.
fn curve_figure(
    methods: &[ScoredMethod],
    names: &[String],
    (curve, groups): (&str, &CurveGroups),
    primary: &Metric,
) -> Result<PageElement> {
    let numbers: Vec<f64> = groups.iter().map(|g| g.1).collect();
    let (low, high) =
        numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let is_named = groups.iter().any(|(text, ..)| text.parse::<f64>().is_err());
    let is_logarithmic = !is_named && low > 0.0 && high >= 8.0 * low;
    let place = |x: f64| if is_logarithmic { x.log10() } else { x };
    let lines: Vec<PlotCurve<'_>> = methods
        .iter()
        .zip(names)
        .map(|(method, name)| {
            let mut points: Vec<(f64, f64)> = groups
                .iter()
                .filter_map(|(_, x, group)| {
                    Some((place(*x), primary_score(&method.file, group, primary)?.value))
                })
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            PlotCurve { name, points }
        })
        .collect();
    let axis = match (is_named, is_logarithmic) {
        (true, _) => format!("index of the value of {curve}"),
        (false, true) => format!("log10 of {curve}"),
        (false, false) => curve.to_owned(),
    };
    let vertical = format!("{} ({})", primary.name, primary.unit);
    let svg = marked_line_plot(curve, (&axis, &vertical), &lines, None)?;
    Ok(PageElement::figure(svg, format!("{} of the same scenes at each value of {curve}.", primary.name)))
}

fn curve_table(methods: &[ScoredMethod], names: &[String], groups: &CurveGroups, primary: &Metric) -> Table {
    let header: Vec<&str> = std::iter::once("value").chain(names.iter().map(String::as_str)).collect();
    let mut table = Table::new(&header);
    for (value, _, group) in groups {
        let cell = |method: &ScoredMethod| {
            primary_score(&method.file, group, primary).map_or("-".to_owned(), |score| score.to_string())
        };
        table.push_row(std::iter::once(value.clone()).chain(methods.iter().map(cell)));
    }
    table
}

fn fault_list(methods: &[ScoredMethod], names: &[String]) -> Option<PageElement> {
    let mut items = Vec::new();
    for (method, name) in methods.iter().zip(names) {
        for s in &method.file.sequences {
            if let Some(fault) = &s.fault {
                items.push(format!("{name}, {}/{}: {fault}", s.group, s.id));
            }
        }
    }
    (!items.is_empty()).then_some(PageElement::List { items })
}

/// Returns the group, the name and the score of the worst sequences of each method.
fn worst_sequences(methods: &[ScoredMethod], primary: &Metric) -> Vec<Vec<(String, String, f64)>> {
    let badness = |score: f64| match primary.better {
        Better::Larger => -score,
        Better::Smaller => score,
        Better::CloserTo(target) => (score - target).abs(),
    };
    methods
        .iter()
        .map(|method| {
            let mut all: Vec<_> = method
                .file
                .sequences
                .iter()
                .filter_map(|s| Some((s.group.to_string(), s.id.to_string(), *s.scores.get(primary.name)?)))
                .collect();
            all.sort_by(|a, b| badness(b.2).total_cmp(&badness(a.2)));
            all.truncate(WORST_SEQUENCES);
            all
        })
        .collect()
}

/// Shows an output beside its reference. Returns `None` for tasks without images.
fn worst_figure(
    data: &GeneratedSuite,
    method: &ScoredMethod,
    name: &str,
    (group, id, score): &(String, String, f64),
    primary: &Metric,
) -> Result<Option<PageElement>> {
    let found: BTreeMap<(&str, &str), (&GeneratedGroup, &GeneratedSequence)> =
        data.scored().map(|(g, s)| ((g.name.as_str(), s.id.as_str()), (g, s))).collect();
    let Some((group, sequence)) = found.get(&(group.as_str(), id.as_str())) else { return Ok(None) };
    match data.suite.task {
        Task::Reconstruction => {
            let geometry = Geometry::new(sequence.width, sequence.height)?;
            let png = |image: &[f32], label: &str| -> Result<String> {
                Ok(png_image(
                    &ImageFormat::U8.encode(image, geometry)?,
                    label,
                    geometry.width().clamp(100, 400),
                ))
            };
            let reference = png(&reference_image(data, group, sequence, geometry)?, "reference")?;
            let output = run::read_output(&method.folder, Task::Reconstruction, &group.name, sequence);
            let image = match output.ok().flatten().map(|(bytes, _)| decode_image(&bytes, geometry)) {
                Some(Ok(image)) => png(&image, "output")?,
                _ => String::new(),
            };
            let note = if image.is_empty() { ", no valid output" } else { "" };
            let caption = format!(
                "{name}, {}/{id}: {} {score:.2} {}. Left: reference. Right: output{note}.",
                group.name, primary.name, primary.unit
            );
            Ok(Some(PageElement::figure(reference + " " + &image, caption)))
        }
        Task::Flow | Task::Depth | Task::Detection | Task::Tracking => Ok(Some(PageElement::text(format!(
            "{name}, {}/{id}: {} {score:.3} {}",
            group.name, primary.name, primary.unit
        )))),
    }
}
