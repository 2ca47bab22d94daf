//! Tables of a report.

use std::fmt::{self, Display};

use super::rounding::{with_error, with_interval, without_error};
use super::text::EscapedText;
use crate::Estimate;

/// A cell of a table: its text, and the numbers behind the text.
///
/// The numbers have all digits. The page uses them to sort the rows and to copy the table as CSV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    text: String,
    value: Option<f64>,
    error: Option<f64>,
    is_best: bool,
}

impl Cell {
    /// Returns the cell of a value and its standard error. See [`with_error`]. `unit` follows the number, and is empty for
    /// a number without a unit.
    #[must_use]
    pub fn estimate(value: f64, error: f64, unit: &str) -> Self {
        let text = with_unit(&with_error(value, error).to_string(), unit);
        let error = Some(error).filter(|e| e.is_finite());
        Self { text, value: Some(value).filter(|v| v.is_finite()), error, is_best: false }
    }

    /// Returns the cell of a value and its interval. See [`with_interval`].
    #[must_use]
    pub fn interval(value: f64, low: f64, high: f64) -> Self {
        Self::number(value, with_interval(value, low, high))
    }

    /// Returns the cell of a value without an error, with four significant digits.
    #[must_use]
    pub fn value(value: f64, unit: &str) -> Self {
        Self::number(value, with_unit(&without_error(value), unit))
    }

    /// Returns a cell with the text `text` for the number `value`.
    #[must_use]
    pub fn number(value: f64, text: impl Into<String>) -> Self {
        Self { text: text.into(), value: Some(value).filter(|v| v.is_finite()), error: None, is_best: false }
    }

    /// Marks the cell as the best of its column if `is_best`.
    #[must_use]
    pub fn best(self, is_best: bool) -> Self {
        Self { is_best, ..self }
    }

    /// Returns the text of the cell.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }
}

fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() { number.to_owned() } else { format!("{number} {unit}") }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self { text, ..Self::default() }
    }
}

impl From<&String> for Cell {
    fn from(text: &String) -> Self {
        text.clone().into()
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::number(count as f64, count.to_string())
    }
}

impl Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("<td")?;
        if let Some(value) = self.value {
            write!(f, " class=\"n\" data-v=\"{value}\"")?;
        }
        if let Some(error) = self.error {
            write!(f, " data-e=\"{error}\"")?;
        }
        let text = EscapedText(&self.text);
        if self.is_best { write!(f, "><b>{text} ★</b></td>") } else { write!(f, ">{text}</td>") }
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::value(value, "")
    }
}

impl From<Estimate> for Cell {
    fn from(e: Estimate) -> Self {
        Self::estimate(e.value, e.error, "")
    }
}

/// Returns the array of the cells of a row: [`Cell::from`] of each value.
#[macro_export]
macro_rules! row {
    ($($value:expr),+ $(,)?) => { [$($crate::report::Cell::from($value)),+] };
}
pub use row;

/// A table. All rows have as many cells as the header.
///
/// A page shows the table folded, sorts it by a click on a column name, and copies it as CSV.
///
/// # Examples
/// ```
/// use spikelane_measure::report::{Cell, Table, row};
/// let lamps = [("a.dat", 0.31), ("b.dat", 0.28)];
/// let table = Table::new("Light", &["recording", "light", "deviation"])
///     .with_rows(lamps.map(|(file, light)| row![file, light, Cell::value(100.0 * (light - 0.3), "%")]));
/// assert_eq!(table.rows[1][1].text(), "0.28");
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Table {
    /// The title, which stays visible while the table is folded.
    pub title: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells of each row.
    pub rows: Vec<Vec<Cell>>,
    /// Whether the page shows the table unfolded.
    pub is_open: bool,
    /// A text above the rows; may be empty.
    pub note: String,
}

impl Table {
    /// Returns an empty table with the column names `header`.
    #[must_use]
    pub fn new(title: impl Into<String>, header: &[&str]) -> Self {
        let header = header.iter().map(|h| (*h).to_owned()).collect();
        Self { title: title.into(), header, ..Self::default() }
    }

    /// Adds a row.
    pub fn push_row(&mut self, cells: impl IntoIterator<Item = impl Into<Cell>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Adds rows. [`row!`] makes a row of values of different types.
    #[must_use]
    pub fn with_rows<R: IntoIterator<Item = Cell>>(mut self, rows: impl IntoIterator<Item = R>) -> Self {
        rows.into_iter().for_each(|row| self.push_row(row));
        self
    }

    /// Unfolds the table.
    #[must_use]
    pub fn open(self) -> Self {
        Self { is_open: true, ..self }
    }

    /// Sets the text above the rows.
    #[must_use]
    pub fn with_note(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }
}

impl Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = match self.rows.len() {
            1 => "1 row".to_owned(),
            n => format!("{n} rows"),
        };
        let open = if self.is_open { " open" } else { "" };
        write!(f, "<details{open}><summary>{} <small>{rows}</small></summary>", EscapedText(&self.title))?;
        if !self.note.is_empty() {
            write!(f, "<p>{}</p>", EscapedText(&self.note))?;
        }
        let is_number =
            |column: usize| self.rows.iter().any(|r| r.get(column).is_some_and(|c| c.value.is_some()));
        writeln!(f, "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr>")?;
        for (i, name) in self.header.iter().enumerate() {
            let class = if is_number(i) { " class=\"n\"" } else { "" };
            write!(f, "<th scope=\"col\"{class}>{}</th>", EscapedText(name))?;
        }
        writeln!(f, "</tr></thead><tbody>")?;
        for row in &self.rows {
            f.write_str("<tr>")?;
            row.iter().try_for_each(|cell| write!(f, "{cell}"))?;
            writeln!(f, "</tr>")?;
        }
        writeln!(
            f,
            "</tbody></table></div><button type=\"button\" class=\"csv\" hidden>Copy as CSV</button></details>"
        )
    }
}
