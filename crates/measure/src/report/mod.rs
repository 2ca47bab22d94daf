//! Reports: self-contained HTML pages with a verdict, key numbers, plots, tables and their origin.

mod heat_map;
mod page;
mod plot;
mod ranked_bars;
mod rounding;
mod run_record;
mod table;
mod text;

pub use heat_map::{heat_map, png_image};
pub use page::{PageElement, Report, ReportState};
pub use plot::{Plot, PlotPoint};
pub use ranked_bars::{RankedRow, ranked_bars};
pub use rounding::{RoundedValue, with_error, with_interval, without_error};
pub use run_record::{InputRecord, RunRecord, is_date, today};
pub use table::{Cell, Table, row};
pub use text::{markdown_code, markdown_text};

use serde_json::Value;

/// Returns `object` with the entries of `further` whose value is `Some`.
///
/// A value that is `None` has no key, because programs that read the JSON expect a number at every key. `serde_json`
/// would write `null` for a number that is not finite.
#[must_use]
pub fn insert_present<const N: usize>(mut object: Value, entries: [(&str, Option<Value>); N]) -> Value {
    for (key, value) in entries {
        if let Some(value) = value {
            object[key] = value;
        }
    }
    object
}
