//! The options of a dataset. The options and the name of a sequence determine all properties of the sequence.

mod cameras;
mod content;
mod options;
mod sequence_choices;
pub(super) mod serde_text;
mod splits;

pub use cameras::Cameras;
pub use content::{Content, DatasetLayout, InputContent, Pictures, ReferenceImageOptions, SceneContent};
pub(super) use content::{ground_truth_facts, path_name};
pub use options::DatasetOptions;
pub(super) use options::scene_options;
pub use splits::{Split, Splits};
