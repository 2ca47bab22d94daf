//! The page of a report.

use std::fmt::{self, Display};

use super::rounding::{with_error, without_error};
use super::run_record::RunRecord;
use super::table::Table;
use super::text::EscapedText;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The state of a verdict. A page shows the state as a color, a symbol and a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportState {
    /// The result can be used.
    Good,
    /// The result can be used with care.
    Caution,
    /// The result cannot be used, or a fault was found.
    Problem,
    /// The page describes and does not judge.
    Info,
}

impl ReportState {
    fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Caution => "caution",
            Self::Problem => "problem",
            Self::Info => "info",
        }
    }

    fn symbol(self) -> char {
        match self {
            Self::Good => '✓',
            Self::Caution => '⚠',
            Self::Problem => '✗',
            Self::Info => 'ℹ',
        }
    }
}

/// An element of a page between the key numbers and the tables.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum PageElement {
    /// A heading.
    Heading {
        /// The text.
        text: String,
    },
    /// A paragraph.
    Text {
        /// The text.
        text: String,
    },
    /// A list of sentences, one per line.
    List {
        /// The sentences.
        items: Vec<String>,
    },
    /// A plot or a map, as markup that this module generates.
    Figure {
        /// The statement that the figure shows.
        title: String,
        /// The SVG or HTML elements.
        markup: String,
        /// Description of the figure.
        caption: String,
        /// Whether the figure takes the whole width of the page.
        is_wide: bool,
    },
}

impl PageElement {
    /// Returns a heading.
    #[must_use]
    pub fn heading(text: &str) -> Self {
        Self::Heading { text: text.to_owned() }
    }

    /// Returns a paragraph.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text { text: text.into() }
    }

    /// Returns a figure with its title and caption. `markup` must be markup of this module.
    #[must_use]
    pub fn figure(title: impl Into<String>, markup: String, caption: impl Into<String>) -> Self {
        Self::Figure { title: title.into(), markup, caption: caption.into(), is_wide: false }
    }

    /// Gives a figure the whole width of the page.
    #[must_use]
    pub fn wide(self) -> Self {
        match self {
            Self::Figure { title, markup, caption, .. } => {
                Self::Figure { title, markup, caption, is_wide: true }
            }
            other => other,
        }
    }

    fn is_figure(&self) -> bool {
        matches!(self, Self::Figure { .. })
    }
}

impl Display for PageElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Heading { text } => writeln!(f, "<h2>{}</h2>", EscapedText(text)),
            Self::Text { text } => writeln!(f, "<p>{}</p>", EscapedText(text)),
            Self::List { items } if items.is_empty() => Ok(()),
            Self::List { items } => {
                f.write_str("<ul>")?;
                items.iter().try_for_each(|item| write!(f, "<li>{}</li>", EscapedText(item)))?;
                writeln!(f, "</ul>")
            }
            Self::Figure { title, markup, caption, is_wide } => {
                let class = if *is_wide { " class=\"wide\"" } else { "" };
                let (title, caption) = (EscapedText(title), EscapedText(caption));
                writeln!(
                    f,
                    "<figure{class}><h3>{title}</h3>{markup}<figcaption>{caption}</figcaption></figure>"
                )
            }
        }
    }
}

/// A number at the top of a page.
#[derive(Clone, Debug)]
struct KeyNumber {
    label: String,
    text: String,
    unit: String,
}

/// A report. The page has the same order for every report: verdict, key numbers, plots, tables, origin.
///
/// # Examples
/// ```
/// use spikelane_measure::report::{Report, ReportState, RunRecord, Table};
/// let mut report = Report::new("Measurement", ReportState::Good, "static", "The scene does not move.");
/// report.push_estimate("mean rate", 0.0996, 0.0004, "spikes per readout");
/// let mut table = Table::new("All statistics", &["name", "value"]);
/// table.push_row(["readouts", "300"]);
/// report.push_table(table);
/// let html = report.html(&RunRecord::now("spikelane measure a.dat"));
/// assert!(html.contains("0.09960 ± 0.00040"));
/// ```
#[derive(Clone, Debug)]
pub struct Report {
    title: String,
    state: ReportState,
    word: String,
    verdict: String,
    key_numbers: Vec<KeyNumber>,
    elements: Vec<PageElement>,
    tables: Vec<Table>,
}

impl Report {
    /// Returns a report with its verdict. `word` names the state in a word or two, and `verdict` is one sentence.
    #[must_use]
    pub fn new(
        title: impl Into<String>,
        state: ReportState,
        word: impl Into<String>,
        verdict: impl Into<String>,
    ) -> Self {
        Self {
            title: title.into(),
            state,
            word: word.into(),
            verdict: verdict.into(),
            key_numbers: Vec::new(),
            elements: Vec::new(),
            tables: Vec::new(),
        }
    }

    /// Adds a key number with its standard error. See [`with_error`].
    pub fn push_estimate(&mut self, label: impl Into<String>, value: f64, error: f64, unit: &str) {
        self.push_key(label, with_error(value, error).to_string(), unit);
    }

    /// Adds a key number without an error.
    pub fn push_value(&mut self, label: impl Into<String>, value: f64, unit: &str) {
        self.push_key(label, without_error(value), unit);
    }

    /// Adds a key number as text.
    pub fn push_key(&mut self, label: impl Into<String>, text: impl Into<String>, unit: &str) {
        self.key_numbers.push(KeyNumber { label: label.into(), text: text.into(), unit: unit.to_owned() });
    }

    /// Adds an element between the key numbers and the tables.
    pub fn push(&mut self, element: PageElement) {
        self.elements.push(element);
    }

    /// Adds elements between the key numbers and the tables.
    pub fn extend(&mut self, elements: impl IntoIterator<Item = PageElement>) {
        self.elements.extend(elements);
    }

    /// Adds a list of sentences below a heading. An empty list is omitted.
    pub fn push_list(&mut self, heading: &str, items: Vec<String>) {
        if !items.is_empty() {
            self.extend([PageElement::heading(heading), PageElement::List { items }]);
        }
    }

    /// Adds a table. A table without rows is omitted.
    pub fn push_table(&mut self, table: Table) {
        if !table.rows.is_empty() {
            self.tables.push(table);
        }
    }

    /// Returns the HTML page. All text is escaped. Only figures contain markup.
    #[must_use]
    pub fn html(&self, run: &RunRecord) -> String {
        let (title, state) = (EscapedText(&self.title), self.state);
        let (class, symbol) = (state.class(), state.symbol());
        let (word, verdict) = (EscapedText(&self.word), EscapedText(&self.verdict));
        let keys: String = self.key_numbers.iter().map(ToString::to_string).collect();
        let keys = if keys.is_empty() { keys } else { format!("<dl class=\"keys\">{keys}</dl>\n") };
        let tables: String = self.tables.iter().map(ToString::to_string).collect();
        let tables = if tables.is_empty() { tables } else { format!("<h2>Tables</h2>\n{tables}") };
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n\
             <section class=\"verdict {class}\"><p><strong class=\"{class}\">{symbol} {word}</strong> {verdict}</p></section>\n\
             {keys}{}{tables}{}<script>\n{SCRIPT}</script>\n</body>\n</html>\n",
            self.body(),
            origin(run)
        )
    }

    /// Returns the elements. Successive figures share a grid.
    fn body(&self) -> String {
        let runs = self.elements.chunk_by(|a, b| a.is_figure() && b.is_figure());
        let html = |run: &[PageElement]| {
            let all: String = run.iter().map(ToString::to_string).collect();
            if run[0].is_figure() { format!("<div class=\"figures\">\n{all}</div>\n") } else { all }
        };
        runs.map(html).collect()
    }
}

impl Display for KeyNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (label, text, unit) =
            (EscapedText(&self.label), EscapedText(&self.text), EscapedText(&self.unit));
        write!(f, "<div><dt>{label}</dt><dd><b>{text}</b> <span>{unit}</span></dd></div>")
    }
}

/// Returns the section about the command, the input files and the program.
fn origin(run: &RunRecord) -> String {
    let mut html = String::new();
    if !run.files.is_empty() {
        let mut table = Table::new("Input files", &["file", "digest"]);
        run.files.iter().for_each(|f| {
            table.push_row([f.name.as_str(), f.digest.as_deref().unwrap_or("not a regular file")])
        });
        html += &table.to_string();
    }
    let version = env!("CARGO_PKG_VERSION");
    let date =
        if run.date.is_empty() { String::new() } else { format!(", {} (UTC)", EscapedText(&run.date)) };
    let command = if run.command.is_empty() {
        String::new()
    } else {
        format!("<p>Command: <code>{}</code></p>", EscapedText(&run.command))
    };
    format!("<h2>Origin</h2>\n{html}{command}<footer>spikelane {version}{date}</footer>\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Plot;

    const HOSTILE: &str = "<img src=x onerror=alert(1)>";

    fn hostile_page() -> String {
        let mut report = Report::new(HOSTILE, ReportState::Caution, HOSTILE, HOSTILE);
        report.push_key(HOSTILE, HOSTILE, HOSTILE);
        report.push(PageElement::heading(HOSTILE));
        report.push(PageElement::text(HOSTILE));
        report.push(PageElement::List { items: vec![HOSTILE.to_owned()] });
        report.push(Plot::new(HOSTILE, HOSTILE, HOSTILE).line(HOSTILE, vec![(0.0, 1.0)]).figure(HOSTILE));
        let mut table = Table::new(HOSTILE, &[HOSTILE]).with_note(HOSTILE);
        table.push_row([HOSTILE]);
        report.push_table(table);
        report.html(&RunRecord::now(HOSTILE).with_file(std::path::Path::new("none"), HOSTILE))
    }

    #[test]
    fn names_of_files_cannot_inject_markup() {
        let html = hostile_page();
        assert!(html.contains("&lt;img src=x onerror") && !html.contains("<img src=x"));
    }

    #[test]
    fn the_verdict_precedes_numbers_plots_tables_and_origin() {
        let html = hostile_page();
        let places: Vec<_> =
            ["verdict caution", "class=\"keys\"", "<figure", "<table", "<h2>Origin", "<footer"]
                .map(|part| html.find(part).expect(part))
                .to_vec();
        assert!(places.is_sorted(), "{places:?}");
    }

    #[test]
    fn a_state_has_a_symbol_and_a_word_beside_its_color() {
        let html = Report::new("t", ReportState::Problem, "faulty", "s").html(&RunRecord::default());
        assert!(html.contains("✗ faulty"));
    }

    #[test]
    fn a_page_refers_to_no_other_file() {
        let html = hostile_page();
        assert!(!html.contains("http") && !html.contains("src=\"") && !html.contains("@import"));
    }

    #[test]
    fn every_table_can_be_copied() {
        let html = hostile_page();
        assert_eq!(html.matches("<table").count(), html.matches("class=\"csv\"").count());
    }
}
