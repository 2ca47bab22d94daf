//! Compares the scores of methods: tables with intervals, paired differences, curves and the worst outputs.

mod markdown;

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use spikelane::Geometry;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane_io::simulate::ImageFormat;
use spikelane_measure::report::{
    Cell, PageElement, Plot, PlotPoint, Report as HtmlReport, ReportState, RunRecord, Table, png_image,
};

use crate::aggregate::{Bootstrap, summarize_differences};
use crate::generated::{GeneratedGroup, GeneratedSequence, GeneratedSuite};
use crate::run;
use crate::score::{OVERALL, ScoreFile, ScoreInterval, SequenceScore, decode_image, reference_image};
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
    /// The comparison as an HTML page without links to other files.
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
/// With `data`, the page shows the worst outputs of each method beside their references. The page states the origin `run`.
///
/// # Errors
/// * [`ErrorKind::Usage`] if there is no method.
/// * [`ErrorKind::Config`] if two score files have different suites, metrics or sequences.
pub fn report(methods: &[ScoredMethod], data: Option<&GeneratedSuite>, run: &RunRecord) -> Result<Report> {
    let first = check_comparable(methods, data)?;
    let names = unique_names(methods);
    let metrics = listed_metrics(first)?;
    let primary = metrics[0];
    let differences = paired_differences(methods, &names, &metrics)?;
    let (state, word, verdict) = verdict(methods, &names, &differences, primary);
    let mut page =
        HtmlReport::new(format!("Benchmark {} {}", first.suite, first.version), state, word, verdict);
    for (method, name) in methods.iter().zip(&names).take(MAX_KEY_METHODS) {
        if let Some(score) = primary_score(&method.file, OVERALL, primary) {
            page.push_key(format!("{name}: {}", primary.name), score_cell(score).text(), primary.unit);
        }
    }
    page.push_key("sequences", first.sequences.len().to_string(), "");
    page.push_key("faulty outputs", methods.iter().map(|m| m.file.faults()).sum::<usize>().to_string(), "");
    page.extend(score_figure(methods, &names, primary));
    page.extend(cost_figure(methods, &names, primary));
    let curves = curve_points(first);
    for (curve, groups) in &curves {
        page.push(curve_figure(methods, &names, (curve, groups), primary));
    }
    if let Some(faults) = fault_list(methods, &names) {
        page.push(PageElement::heading("Faults"));
        page.push(PageElement::text(format!(
            "An output with a fault has the scores of {}.",
            first.trivial_answer
        )));
        page.push(faults);
    }
    let worst = worst_sequences(methods, primary);
    if let Some(data) = data {
        page.push(PageElement::heading("Worst outputs"));
        for (index, method) in methods.iter().enumerate() {
            for sequence in &worst[index] {
                page.extend(worst_figure(data, method, &names[index], sequence, primary)?);
            }
        }
    }
    page.push_table(score_table(methods, &names, &metrics));
    page.push_table(difference_table(&differences, &metrics, &names[0]));
    page.push_table(cost_table(methods, &names));
    for (curve, groups) in &curves {
        page.push_table(curve_table(methods, &names, (curve, groups), primary));
    }
    let mut suite = Table::new("Suite", &["property", "value"]);
    for (property, value) in
        [("suite", first.suite.as_str()), ("version", &first.version), ("digest", &first.digest)]
    {
        suite.push_row([property.to_owned(), value.to_owned()]);
    }
    page.push_table(suite);
    let html = page.html(run);
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

/// Number of methods whose primary score is a key number.
const MAX_KEY_METHODS: usize = 4;

/// Returns the cell of a score with its interval.
fn score_cell(score: ScoreInterval) -> Cell {
    match score.interval {
        Some([low, high]) if high > low => Cell::interval(score.value, low, high),
        _ => Cell::value(score.value, ""),
    }
}

/// Returns the point of a score with half of its interval as the error.
fn plot_point(x: f64, score: ScoreInterval) -> PlotPoint {
    PlotPoint::new(x, score.value, score.interval.map_or(0.0, |[low, high]| (high - low) / 2.0))
}

fn axis_label(metric: &Metric) -> String {
    format!("{} ({})", metric.name, metric.unit)
}

/// Returns how far a score is from the best possible score; smaller is better.
fn badness(metric: &Metric, score: f64) -> f64 {
    match metric.better {
        Better::Larger => -score,
        Better::Smaller => score,
        Better::CloserTo(target) => (score - target).abs(),
    }
}

/// Returns the index of the method with the best overall score of a metric.
fn best_method(methods: &[ScoredMethod], metric: &Metric) -> Option<usize> {
    let score = |m: &ScoredMethod| m.file.summary(OVERALL)?.metrics.get(metric.name).map(|s| s.pooled.value);
    let known = methods.iter().enumerate().filter_map(|(i, m)| Some((i, badness(metric, score(m)?))));
    known.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// Returns the state, the word and the sentence of the page.
fn verdict(
    methods: &[ScoredMethod],
    names: &[String],
    differences: &[Difference],
    primary: &Metric,
) -> (ReportState, &'static str, String) {
    let faults: usize = methods.iter().map(|m| m.file.faults()).sum();
    let note = if faults == 0 { String::new() } else { format!(" {faults} outputs have faults.") };
    let Some(best) = best_method(methods, primary) else {
        return (ReportState::Problem, "no scores", format!("No method has a score.{note}"));
    };
    let name = &names[best];
    if methods.len() == 1 {
        let state = if faults == 0 { ReportState::Info } else { ReportState::Caution };
        return (state, "one method", format!("{name} is the only method.{note}"));
    }
    // The first method is the baseline of all differences.
    let other = differences.iter().filter(|d| d.metric == primary.name);
    let excludes_zero = |d: &Difference| d.mean.interval.is_some_and(|[low, high]| low > 0.0 || high < 0.0);
    let is_decided = match best {
        0 => other.clone().count() > 0 && other.clone().all(excludes_zero),
        _ => other.clone().any(|d| d.method == *name && excludes_zero(d)),
    };
    let text = match (is_decided, best) {
        (true, 0) => format!(
            "{name} has the best {}, and the differences to all other methods are significant.",
            primary.name
        ),
        (true, _) => format!(
            "{name} has the best {}, and its difference to {} is significant.",
            primary.name, names[0]
        ),
        (false, _) => format!(
            "{name} has the best {}, but the choice of sequences can explain the difference.",
            primary.name
        ),
    };
    let state = if is_decided && faults == 0 { ReportState::Good } else { ReportState::Caution };
    (state, if is_decided { "decided" } else { "not decided" }, text + &note)
}

/// Returns the names of the methods as ticks, and the overall score of each method.
fn overall_scores(methods: &[ScoredMethod], primary: &Metric) -> Vec<(usize, ScoreInterval)> {
    let score = |(i, m): (usize, &ScoredMethod)| Some((i, primary_score(&m.file, OVERALL, primary)?));
    methods.iter().enumerate().filter_map(score).collect()
}

/// Plots the primary metric of every method with half of its interval as the error.
fn score_figure(methods: &[ScoredMethod], names: &[String], primary: &Metric) -> Option<PageElement> {
    let scores = overall_scores(methods, primary);
    let best = best_method(methods, primary)?;
    let points = scores.iter().map(|(i, s)| plot_point(*i as f64, *s)).collect();
    let ticks = names.iter().enumerate().map(|(i, n)| (i as f64, n.clone())).collect();
    let plot =
        Plot::new(format!("{} has the best {}", names[best], primary.name), "method", axis_label(primary))
            .points("all sequences", points)
            .named_ticks(ticks);
    Some(plot.figure("Bars are half the 95 % bootstrap interval over the sequences."))
}

/// Plots the primary metric over the outputs per second. Returns `None` if fewer than two methods have a cost.
fn cost_figure(methods: &[ScoredMethod], names: &[String], primary: &Metric) -> Option<PageElement> {
    let point = |(i, s): &(usize, ScoreInterval)| {
        let rate = methods[*i].file.cost?.outputs_per_second;
        (rate > 0.0).then(|| (*i, PlotPoint::new(rate, s.value, 0.0)))
    };
    let points: Vec<(usize, PlotPoint)> = overall_scores(methods, primary).iter().filter_map(point).collect();
    if points.len() < 2 {
        return None;
    }
    let fastest = points.iter().max_by(|a, b| a.1.x.total_cmp(&b.1.x)).map_or("", |p| &names[p.0]);
    let plot =
        Plot::new(format!("{fastest} is the fastest method"), "outputs per second", axis_label(primary))
            .log_x();
    let plot = points.iter().fold(plot, |plot, (i, p)| plot.points(names[*i].clone(), vec![*p]));
    Some(plot.figure("Speed depends on the machine; the table of costs names it."))
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

/// Returns a table with the header `first`, then each metric with its unit and the better direction.
fn metric_header(title: &str, first: &str, metrics: &[&Metric]) -> Table {
    let label = |metric: &&Metric| {
        let better = match metric.better {
            Better::Larger => "larger is better".to_owned(),
            Better::Smaller => "smaller is better".to_owned(),
            Better::CloserTo(target) => format!("closer to {target} is better"),
        };
        format!("{} ({}; {better})", metric.name, metric.unit)
    };
    let header: Vec<String> = std::iter::once(first.to_owned()).chain(metrics.iter().map(label)).collect();
    Table::new(title, &header.iter().map(String::as_str).collect::<Vec<_>>())
}

fn score_table(methods: &[ScoredMethod], names: &[String], metrics: &[&Metric]) -> Table {
    let mut table = metric_header("Scores", "method", metrics).open().with_note(
        "Scores of the scored splits, with 95 % bootstrap intervals over sequences. Scores of detections and tracks count all boxes together; other scores are means over sequences. The star marks the best method.",
    );
    for (i, (method, name)) in methods.iter().zip(names).enumerate() {
        let cell = |metric: &&Metric| {
            let summary = method.file.summary(OVERALL).and_then(|s| s.metrics.get(metric.name));
            let is_best = methods.len() > 1 && best_method(methods, metric) == Some(i);
            summary.map_or(Cell::from("-"), |summary| score_cell(summary.pooled).best(is_best))
        };
        table.push_row(std::iter::once(Cell::from(name)).chain(metrics.iter().map(cell)));
    }
    table
}

fn cost_table(methods: &[ScoredMethod], names: &[String]) -> Table {
    let header = [
        "method",
        "outputs per second",
        "latency 50 %, ms",
        "95 %, ms",
        "99 %, ms",
        "memory, MB",
        "faults",
        "processor",
    ];
    let mut table = Table::new("Cost", &header);
    for (method, name) in methods.iter().zip(names) {
        let cost = method.file.cost;
        let number = |value: Option<f64>| value.map_or(Cell::from("-"), |v| Cell::value(v, ""));
        let latency = |i: usize| number(cost.map(|c| 1e3 * c.latency_seconds[i]));
        let memory = cost.and_then(|c| c.memory_peak_bytes).map(|bytes| bytes as f64 / 1e6);
        let environment = &method.file.environment;
        table.push_row([
            Cell::from(name),
            number(cost.map(|c| c.outputs_per_second)),
            latency(0),
            latency(1),
            latency(2),
            number(memory),
            Cell::from(method.file.faults()),
            Cell::from(environment.processor.as_ref().unwrap_or(&environment.system)),
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

fn difference_table(differences: &[Difference], metrics: &[&Metric], baseline: &str) -> Table {
    let mut table = metric_header(&format!("Differences to {baseline}"), "method", metrics).with_note(
        "Mean differences over the same sequences. If an interval excludes 0, the methods differ beyond the choice of sequences.",
    );
    let mut names: Vec<&str> = differences.iter().map(|d| d.method.as_str()).collect();
    names.dedup();
    for name in names {
        let cell = |metric: &&Metric| {
            let found = differences.iter().find(|d| d.method == name && d.metric == metric.name);
            found.map_or(Cell::from("-"), |d| score_cell(d.mean))
        };
        table.push_row(std::iter::once(Cell::from(name)).chain(metrics.iter().map(cell)));
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
) -> PageElement {
    let numbers: Vec<f64> = groups.iter().map(|g| g.1).collect();
    let (low, high) =
        numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let is_named = groups.iter().any(|(text, ..)| text.parse::<f64>().is_err());
    let is_logarithmic = !is_named && low > 0.0 && high >= 8.0 * low;
    let mut plot = Plot::new(format!("{} along {curve}", primary.name), curve, axis_label(primary));
    if is_logarithmic {
        plot = plot.log_x();
    }
    if is_named {
        plot = plot.named_ticks(groups.iter().map(|(text, x, _)| (*x, text.clone())).collect());
    }
    for (method, name) in methods.iter().zip(names) {
        let point = |(_, x, group): &(String, f64, String)| {
            Some(plot_point(*x, primary_score(&method.file, group, primary)?))
        };
        let mut points: Vec<PlotPoint> = groups.iter().filter_map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        let line = points.iter().map(|p| (p.x, p.y)).collect();
        plot = plot.points_on_line(name.clone(), points, line);
    }
    plot.figure(format!(
        "{} of the same scenes at each value of {curve}. Bars are half the 95 % interval.",
        primary.name
    ))
}

fn curve_table(
    methods: &[ScoredMethod],
    names: &[String],
    (curve, groups): (&str, &CurveGroups),
    primary: &Metric,
) -> Table {
    let header: Vec<&str> = std::iter::once("value").chain(names.iter().map(String::as_str)).collect();
    let mut table = Table::new(format!("{} along {curve}", primary.name), &header);
    for (value, x, group) in groups {
        let cell = |method: &ScoredMethod| {
            primary_score(&method.file, group, primary).map_or(Cell::from("-"), score_cell)
        };
        table.push_row(std::iter::once(Cell::number(*x, value)).chain(methods.iter().map(cell)));
    }
    table
}

fn fault_list(methods: &[ScoredMethod], names: &[String]) -> Option<PageElement> {
    let faults = |(method, name): (&ScoredMethod, &String)| {
        let fault = |s: &SequenceScore| Some(format!("{name}, {}/{}: {}", s.group, s.id, s.fault.as_ref()?));
        method.file.sequences.iter().filter_map(fault).collect::<Vec<_>>()
    };
    let items: Vec<String> = methods.iter().zip(names).flat_map(faults).collect();
    (!items.is_empty()).then_some(PageElement::List { items })
}

/// Returns the group, the name and the score of the worst sequences of each method.
fn worst_sequences(methods: &[ScoredMethod], primary: &Metric) -> Vec<Vec<(String, String, f64)>> {
    methods
        .iter()
        .map(|method| {
            let mut all: Vec<_> = method
                .file
                .sequences
                .iter()
                .filter_map(|s| Some((s.group.to_string(), s.id.to_string(), *s.scores.get(primary.name)?)))
                .collect();
            all.sort_by(|a, b| badness(primary, b.2).total_cmp(&badness(primary, a.2)));
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
    let is_same =
        |(g, s): &(&GeneratedGroup, &GeneratedSequence)| g.name.as_str() == group && s.id.as_str() == id;
    let Some((group, sequence)) = data.scored().find(is_same) else { return Ok(None) };
    match data.suite.task {
        task @ (Task::Reconstruction | Task::Color) => {
            let geometry = Geometry::new(sequence.width, sequence.height)?;
            let png = |image: &[f32], label: &str| -> Result<String> {
                Ok(png_image(
                    &ImageFormat::U8.encode(image, geometry)?,
                    label,
                    geometry.width().clamp(100, 400),
                ))
            };
            let reference = png(&reference_image(data, group, sequence, geometry)?, "reference")?;
            let output = run::read_output(&method.folder, task, &group.name, sequence);
            let image = output.ok().flatten();
            let image = image.and_then(|(bytes, _)| decode_image(&bytes, geometry, task == Task::Color).ok());
            let image = image.map_or(Ok(String::new()), |image| png(&image, "output"))?;
            let note = if image.is_empty() { ", no valid output" } else { "" };
            let title = format!("{name}, {}/{id}: {} {score:.2} {}", group.name, primary.name, primary.unit);
            let caption = format!("Left: reference. Right: output{note}.");
            Ok(Some(PageElement::figure(title, reference + " " + &image, caption)))
        }
        Task::Flow | Task::Depth | Task::Detection | Task::Tracking => Ok(Some(PageElement::text(format!(
            "{name}, {}/{id}: {} {score:.3} {}",
            group.name, primary.name, primary.unit
        )))),
    }
}
