//! Implements `spikelane benchmark report`.

use std::path::PathBuf;

use serde_json::json;

use crate::common::{Console, append_ending, claim_files, replace_between_markers, run_record};
use crate::speed::report::source_commit;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_benchmark::report::{self, ScoredMethod};
use spikelane_io::storage;

/// Compare the scores of methods as an HTML page and as JSON
///
/// The differences are those to the first method. All score files must belong to the same generated suite.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Compare these score.json files
    #[arg(required = true, value_name = "SCORE")]
    scores: Vec<PathBuf>,
    /// Write STEM.html and STEM.json
    #[arg(short, long, value_name = "STEM")]
    output: PathBuf,
    /// Show the worst outputs beside the references of the generated suite in this folder
    #[arg(long, value_name = "DIR")]
    suite: Option<PathBuf>,
    /// Set the names of the methods, in the order of the score files (repeatable)
    #[arg(long, value_name = "NAME")]
    label: Vec<String>,
    /// Also write the tables into this Markdown page
    ///
    /// The tables replace the text between the lines `<!-- benchmark SUITE: begin -->` and `<!-- benchmark SUITE: end -->`
    /// of the page, where SUITE is the name of the suite.
    #[arg(long, value_name = "PAGE")]
    markdown: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// Those of [`report::report`], and [`ErrorKind::Input`] if the page of `--markdown` lacks the marker lines.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let path = |ending: &str| append_ending(&args.output, ending);
    let (html, json_path) = (path(".html"), path(".json"));
    let _claim = claim_files([&html, &json_path], args.force)?;
    if !args.label.is_empty() && args.label.len() != args.scores.len() {
        return Err(Error::new(ErrorKind::Usage, "--label")
            .found(Count(args.label.len(), "name"))
            .expected(format_args!("{}, one for each score file", args.scores.len())));
    }
    let labels = args.label.iter().cloned().map(Some).chain(std::iter::repeat(None));
    let read = |(path, label): (&PathBuf, _)| Ok(ScoredMethod::read(path)?.with_label(label));
    let methods = args.scores.iter().zip(labels).map(read).collect::<Result<Vec<_>>>()?;
    let data = args.suite.as_ref().map(|folder| GeneratedSuite::open(folder)).transpose()?;
    let made = report::report(&methods, data.as_ref(), &run_record(&args.scores))?;
    let text = serde_json::to_vec_pretty(&made.json)
        .map_err(|e| Error::new(ErrorKind::Config, json_path.display()).found(e))?;
    storage::write_small(&html, made.html.as_bytes(), args.force)?;
    storage::write_small(&json_path, &text, args.force)?;
    if let Some(page) = &args.markdown {
        let marker = |end: &str| format!("<!-- benchmark {}: {end} -->\n", methods[0].file.suite);
        let tables = report::markdown(&methods, &source_commit())?;
        replace_between_markers(page, (&marker("begin"), &marker("end")), &tables)?;
    }
    let files = [html.display().to_string(), json_path.display().to_string()];
    let event = json!({"event": "report", "files": files, "methods": methods.len()});
    out.print_result(&event, &format!("{}, {}: {}\n", files[0], files[1], Count(methods.len(), "method")))
}
