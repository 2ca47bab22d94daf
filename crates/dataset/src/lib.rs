//! Plans, generates, verifies, resumes and describes datasets of many sequences.
//!
//! A dataset is a folder. The file `manifest.jsonl` in this folder contains the options and one line per sequence. The
//! folder `sequences/ID` contains the files of one sequence, and its `record.json` lists each file with its digest. A
//! sequence is generated in a hidden folder. After all files are on disk, the hidden folder is renamed. A sequence is
//! done only if every file matches its digest. `docs/reference/datasets.md` describes the folder for users.

pub mod config;
mod datasheet;
mod discover;
mod drive;
mod entries;
mod exporters;
mod exposure_note;
mod fingerprint;
mod generate;
mod ground_truth;
mod hidden_file;
mod images;
mod labels;
mod light_statistics;
mod manifest;
mod pack_schema;
mod reader;
mod record;
mod sequence;
pub mod shards;
mod spec;
pub mod statistics;
mod tar_index;

pub use discover::{Input, discover_inputs, skipped_files};
pub use drive::Drive;
pub use fingerprint::Fingerprint;
pub use generate::{DatasetEstimate, DatasetReport, SequenceFailure, SequenceProgress, estimate, generate};
pub use manifest::{Manifest, SequenceEntry, SequenceStatus};
pub use reader::{DatasetReader, SequenceFiles};
pub use record::SequenceRecord;
pub use spec::{
    Cameras, Content, DatasetLayout, DatasetOptions, InputContent, Pictures, ReferenceImageOptions,
    SceneContent, Split, Splits,
};
pub use spikelane::unstable::inputs::{Access, InnerPath, PlainName};
