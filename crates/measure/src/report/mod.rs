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

use std::fmt::{self, Display, Write as _};

const STYLE: &str = include_str!("page.css");

/// A table: heads and rows of equal length.
#[derive(Clone, Debug, Default)]
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
#[derive(Clone, Debug)]
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
    /// A plot or map as markup made by this module.
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

/// Text in which nothing is markup.
struct Escaped<T>(T);

impl<T: AsRef<str>> Display for Escaped<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.as_ref().chars().try_for_each(|c| match c {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\'' => f.write_str("&#x27;"),
            c => f.write_char(c),
        })
    }
}

/// Each item between an opening and a closing tag of the name `tag`.
fn tagged(tag: &str, items: &[String]) -> String {
    items.iter().map(|item| format!("<{tag}>{}</{tag}>", Escaped(item))).collect()
}

impl Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Heading { text } => writeln!(f, "<h2>{}</h2>", Escaped(text)),
            Self::Text { text } => writeln!(f, "<p>{}</p>", Escaped(text)),
            Self::List { items } => writeln!(f, "<ul>{}</ul>", tagged("li", items)),
            Self::Table(table) => {
                writeln!(f, "<table><tr>{}</tr>", tagged("th", &table.head))?;
                table.rows.iter().try_for_each(|row| writeln!(f, "<tr>{}</tr>", tagged("td", row)))?;
                writeln!(f, "</table>")
            }
            Self::Figure { markup, caption } => {
                writeln!(f, "<figure>{markup}<figcaption>{}</figcaption></figure>", Escaped(caption))
            }
        }
    }
}

/// The page of `parts` under `title`. Text is escaped; only figures are markup.
#[must_use]
pub fn page(title: &str, parts: &[Part]) -> String {
    let (title, version) = (Escaped(title), env!("CARGO_PKG_VERSION"));
    let body: String = parts.iter().map(ToString::to_string).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}<footer>spikelane {version}</footer>\n\
         </body>\n</html>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_cannot_inject_markup() {
        let html = page("<b>", &[Part::text("<script>"), Part::figure("<svg></svg>".to_owned(), "&")]);
        assert!(
            html.contains("&lt;script&gt;") && html.contains("<svg></svg>") && !html.contains("<script>")
        );
    }
}
