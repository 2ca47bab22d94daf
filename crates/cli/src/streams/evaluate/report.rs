//! The HTML report of scores, and the JSON beside it.

use serde_json::{Value, json};
use spikelane::Result;
use spikelane_measure::report::{Cell, RankedRow, Report, ReportState, Table, ranked_bars, without_error};

use super::args::Args;
use super::picture::Picture;
use super::scores::Score;
use crate::common::{ReportFiles, recorded_path, run_record};

/// Key, title and unit of each score. For the first four scores, larger values are better.
const SCORES: [(&str, &str, &str); 11] = [
    ("cpsnr_db", "CPSNR", "dB"),
    ("psnr_db", "PSNR", "dB"),
    ("ssim", "SSIM", ""),
    ("aligned_psnr_db", "PSNR after a fit of the light", "dB"),
    ("detail_slope", "detail, 1 is sharp", ""),
    ("high_pass_noise", "noise beside the reference", ""),
    ("outliers", "outlier pixels", ""),
    ("patch_noise", "noise of patches", ""),
    ("weak_texture_noise", "noise of weak texture", ""),
    ("difference_noise", "noise of differences", ""),
    ("snr_db", "signal-to-noise ratio", "dB"),
];

/// Number of scores at the start of [`SCORES`] with a best value.
const RANKED_SCORES: usize = 4;

/// The scored pictures of one stream.
pub(super) struct ScoredStream {
    pub name: String,
    pub pictures: Vec<Picture>,
}

/// Writes the report, if the user requested one.
pub(super) fn write(args: &Args, files: Option<&ReportFiles>, streams: &[ScoredStream]) -> Result<()> {
    let Some(files) = files else { return Ok(()) };
    let file = recorded_path(&args.file);
    let inputs = std::iter::once(&args.file).chain(&args.reference).filter(|path| path.is_file());
    let html = page(&file, streams).html(&run_record(inputs));
    let pictures = |s: &ScoredStream| s.pictures.iter().map(Picture::json).collect::<Vec<_>>();
    let all: Vec<Value> =
        streams.iter().map(|s| json!({ "stream": s.name, "pictures": pictures(s) })).collect();
    files.write(&html, &json!({ "file": file, "streams": all }))
}

/// Returns a score that is not only a bound.
fn score(picture: &Picture, key: &str) -> Option<f64> {
    picture.score(key).filter(|score| !score.is_bound).map(|score| score.value)
}

fn name(picture: &Picture) -> String {
    let method = picture.demosaicing.map(|method| format!(" {}", method.name()));
    picture.name.clone() + &method.unwrap_or_default()
}

/// Returns the name and the value of the picture with the largest score.
fn best(pictures: &[Picture], key: &str) -> Option<(String, f64)> {
    let known = pictures.iter().filter_map(|p| Some((name(p), score(p, key)?)));
    known.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn page(file: &str, streams: &[ScoredStream]) -> Report {
    let first = streams.first().map_or(&[][..], |s| &s.pictures);
    let primary = SCORES[..RANKED_SCORES].iter().find(|s| best(first, s.0).is_some());
    let leader = primary.and_then(|(key, title, unit)| Some((*title, *unit, best(first, key)?)));
    let verdict = match &leader {
        Some((title, unit, (name, value))) => {
            format!("{name} has the best {title}: {} {unit}", without_error(*value)).trim_end().to_owned()
                + "."
        }
        None => "The pictures have no reference: only estimates of their noise are available.".to_owned(),
    };
    let word = if leader.is_some() { "scored" } else { "no reference" };
    let mut report = Report::new(format!("Scores of {file}"), ReportState::Info, word, verdict);
    for (key, title, unit) in &SCORES[..RANKED_SCORES] {
        if let Some((name, value)) = best(first, key) {
            report.push_value(format!("best {title}: {name}"), value, unit);
        }
    }
    report.push_key("pictures", first.len().to_string(), "");
    for stream in streams {
        for (key, title, unit) in &SCORES {
            let rows: Vec<RankedRow> = stream
                .pictures
                .iter()
                .filter_map(|p| Some(RankedRow { name: name(p), values: vec![score(p, key)?] }))
                .collect();
            if rows.len() > 1 && ["cpsnr_db", "psnr_db", "ssim", "detail_slope", "patch_noise"].contains(key)
            {
                let title = format!("Scores of {}: {title}", stream.name);
                report.push(ranked_bars(
                    &title,
                    if unit.is_empty() { "score" } else { unit },
                    &["score"],
                    &rows,
                    None,
                    "",
                ));
            }
        }
        report.push_table(table(stream));
    }
    report
}

/// Returns the table of all scores of one stream. The best values are marked.
fn table(stream: &ScoredStream) -> Table {
    let is_known = |key: &str| stream.pictures.iter().any(|p| p.score(key).is_some());
    let shown: Vec<(usize, &(&str, &str, &str))> =
        SCORES.iter().enumerate().filter(|(_, s)| is_known(s.0)).collect();
    let titles: Vec<String> = shown
        .iter()
        .map(
            |(_, (_, title, unit))| {
                if unit.is_empty() { (*title).to_owned() } else { format!("{title}, {unit}") }
            },
        )
        .collect();
    let header: Vec<&str> = std::iter::once("picture").chain(titles.iter().map(String::as_str)).collect();
    let mut table = Table::new(format!("All scores, {}", stream.name), &header).open();
    for picture in &stream.pictures {
        let cell = |(i, (key, ..)): &(usize, &(&str, &str, &str))| {
            let leads = |x: f64| *i < RANKED_SCORES && best(&stream.pictures, key).is_some_and(|b| b.1 == x);
            match picture.score(key) {
                Some(Score { value, is_bound: true }) => Cell::number(value, format!(">{value}")),
                Some(Score { value, .. }) => Cell::value(value, "").best(leads(value)),
                None => Cell::from("-"),
            }
        };
        table.push_row(std::iter::once(Cell::from(name(picture))).chain(shown.iter().map(cell)));
    }
    table
}
