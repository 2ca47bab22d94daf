//! Reports: one HTML file that needs nothing else, with plots and maps inside.

mod day;
mod json;
mod map;
mod plot;
mod ranked;

pub use day::today;
pub use json::with_known;
pub use map::{heat_map, picture};
pub use plot::{Band, Curve, bars, curves, curves_over, marked};
pub use ranked::{Row, ranked};

use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;

use spikelane::error::{Error, Kind, Result};

const TEMPLATE: &str = include_str!("page.html");

/// A table: heads and rows of equal length.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Table {
    /// What the columns are.
    pub head: Vec<String>,
    /// Cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table with these columns.
    #[must_use]
    pub fn new(head: &[&str]) -> Self {
        Self { head: head.iter().map(|h| (*h).to_owned()).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }
}

/// A part of a page.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "part", rename_all = "lowercase")]
pub enum Part {
    /// A heading.
    Heading {
        /// Its words.
        text: String,
    },
    /// A paragraph.
    Text {
        /// Its words.
        text: String,
    },
    /// Sentences, one below the other.
    List {
        /// The sentences.
        items: Vec<String>,
    },
    /// A table.
    Table(Table),
    /// A plot or map as markup made by this room.
    Figure {
        /// SVG or an image element.
        markup: String,
        /// What it shows.
        caption: String,
    },
}

impl Part {
    /// A heading.
    #[must_use]
    pub fn heading(text: &str) -> Self {
        Self::Heading { text: text.to_owned() }
    }

    /// A paragraph.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text { text: text.into() }
    }

    /// A figure with its caption.
    #[must_use]
    pub fn figure(markup: String, caption: impl Into<String>) -> Self {
        Self::Figure { markup, caption: caption.into() }
    }
}

/// The page of `parts` under `title`. Text is escaped; only figures are markup.
///
/// # Errors
/// Never, in practice: the template is fixed.
pub fn page(title: &str, parts: &[Part]) -> Result<String> {
    let wrong = |e: minijinja::Error| Error::new(Kind::Config, "report template").found(e);
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template("page.html", TEMPLATE).map_err(wrong)?;
    let template = environment.get_template("page.html").map_err(wrong)?;
    template.render(context! { title, parts, version => env!("CARGO_PKG_VERSION") }).map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_cannot_inject_markup() {
        let html =
            page("<b>", &[Part::text("<script>"), Part::figure("<svg></svg>".to_owned(), "&")]).unwrap();
        assert!(
            html.contains("&lt;script&gt;") && html.contains("<svg></svg>") && !html.contains("<script>")
        );
    }
}
