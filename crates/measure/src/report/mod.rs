//! Reports: self-contained HTML pages with a verdict, key numbers, plots, tables and their origin.

mod date;
mod escape;
mod heat_map;
mod json;
mod markdown;
mod page;
mod plot;
mod ranked_bars;
mod rounding;
mod run_record;
mod table;

pub use date::{is_date, today};
pub use heat_map::{heat_map, png_image};
pub use json::insert_present;
pub use markdown::{markdown_code, markdown_text};
pub use page::{PageElement, Report, ReportState};
pub use plot::{Plot, PlotPoint};
pub use ranked_bars::{RankedRow, ranked_bars};
pub use rounding::{RoundedValue, with_error, with_interval, without_error};
pub use run_record::{InputRecord, RunRecord};
pub use table::{Cell, Table, row};
