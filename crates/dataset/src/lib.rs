//! Many sequences: planned, made, verified, resumed, and described.
//!
//! A dataset is a folder. `manifest.jsonl` holds its options and one line per sequence;
//! `sequences/ID` holds a sequence with `record.json`, which lists every file with its digest.
//! A sequence is made in a hidden folder that is renamed when all its files are on the disk, and
//! counts as done only while every digest holds. `docs/reference/datasets.md` describes the folder for users.

mod asked;
mod card;
pub mod config;
mod drive;
mod entries;
mod frames;
mod from;
mod images;
mod labels;
mod manifest;
mod record;
mod run;
mod sequence;
pub mod shards;
mod stamp;
pub mod stats;
mod truth;
mod views;

pub use asked::{Cameras, DatasetOptions, Drives, Images, Inputs, Split, Splits, Structure, Work};
pub use drive::Drive;
pub use from::{Input, inputs, skipped};
pub use manifest::{Entry, Manifest, Status};
pub use record::Record;
pub use run::{Estimate, Progress, Report, estimate, make};
pub use spikelane::unstable::inputs::{InnerPath, PlainName};
pub use stamp::Stamp;
