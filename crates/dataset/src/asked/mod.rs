//! What a dataset is asked to be, and what follows from it for each sequence by its name.

mod cameras;
mod choices;
mod options;
mod splits;
pub(super) mod texts;
mod work;

pub use cameras::Cameras;
pub use options::DatasetOptions;
pub(super) use options::scene_options;
pub use splits::{Split, Splits};
pub(super) use work::ground_truth;
pub use work::{Drives, Images, Inputs, Structure, Work};
