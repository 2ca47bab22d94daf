//! Many sequences: planned, made, verified, resumed, and described.
//!
//! A dataset is a folder. `manifest.jsonl` holds its options and one line per sequence;
//! `sequences/ID` holds a sequence with `record.json`, which lists every file with its digest.
//! A sequence is made in a hidden folder that is renamed when all its files are on the disk, and
//! counts as done only while every digest holds. `docs/reference/datasets.md` describes the folder for users.

mod card;
mod drive;
mod from;
mod images;
mod labels;
mod manifest;
mod options;
mod record;
mod run;
mod sequence;
mod structure;
mod truth;
mod work;

pub use drive::Drive;
pub use from::{Input, inputs, skipped};
pub use manifest::{Entry, Manifest, Status};
pub use options::{DatasetOptions, Estimate, Images};
pub use record::Record;
pub use run::{Progress, Report, estimate, make};
pub use work::{Drives, Inputs, Structure, Work};
