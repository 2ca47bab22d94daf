//! Reports: self-contained HTML pages with plots and maps.

mod date;
mod html_image;
mod json;
mod plot;
mod ranked_bars;

pub use date::today;
pub use html_image::{heat_map, png_image};
pub use json::insert_present;
pub use plot::{Curve, ShadedBand, bar_plot, line_plot, line_plot_over_band, marked_line_plot};
pub use ranked_bars::{RankedRow, ranked_bar_plot};

use std::fmt::{self, Display, Write as _};

const STYLE: &str = include_str!("page.css");

/// A table. All rows have as many cells as the header.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Table {
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells of each row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Returns an empty table with the column names `head`.
    #[must_use]
    pub fn new(head: &[&str]) -> Self {
        Self { header: head.iter().map(|h| (*h).to_owned()).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn push_row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }
}

/// An element of a page.
#[derive(Clone, Debug)]
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
    /// A table.
    Table(Table),
    /// A plot or a map, as markup that this module generates.
    Figure {
        /// The SVG or HTML image element.
        markup: String,
        /// Description of the figure.
        caption: String,
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

    /// Returns a figure with its caption.
    #[must_use]
    pub fn figure(markup: String, caption: impl Into<String>) -> Self {
        Self::Figure { markup, caption: caption.into() }
    }
}

/// Text whose markup characters are escaped when the text is displayed.
struct EscapedText<T>(T);

impl<T: AsRef<str>> Display for EscapedText<T> {
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

/// Wraps each item in an HTML element. `tag` is the name of the element.
fn wrap_in_tag(tag: &str, items: &[String]) -> String {
    items.iter().map(|item| format!("<{tag}>{}</{tag}>", EscapedText(item))).collect()
}

impl Display for PageElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Heading { text } => writeln!(f, "<h2>{}</h2>", EscapedText(text)),
            Self::Text { text } => writeln!(f, "<p>{}</p>", EscapedText(text)),
            Self::List { items } => writeln!(f, "<ul>{}</ul>", wrap_in_tag("li", items)),
            Self::Table(table) => {
                writeln!(f, "<table><tr>{}</tr>", wrap_in_tag("th", &table.header))?;
                table.rows.iter().try_for_each(|row| writeln!(f, "<tr>{}</tr>", wrap_in_tag("td", row)))?;
                writeln!(f, "</table>")
            }
            Self::Figure { markup, caption } => {
                writeln!(f, "<figure>{markup}<figcaption>{}</figcaption></figure>", EscapedText(caption))
            }
        }
    }
}

/// Returns the HTML page of `parts` with the heading `title`. All text is escaped. Only figures contain markup.
#[must_use]
pub fn page(title: &str, parts: &[PageElement]) -> String {
    let (title, version) = (EscapedText(title), env!("CARGO_PKG_VERSION"));
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
        let html =
            page("<b>", &[PageElement::text("<script>"), PageElement::figure("<svg></svg>".to_owned(), "&")]);
        assert!(
            html.contains("&lt;script&gt;") && html.contains("<svg></svg>") && !html.contains("<script>")
        );
    }
}
