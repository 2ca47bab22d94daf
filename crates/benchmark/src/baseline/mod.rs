//! Baselines of the tasks with labels.
//!
//! A trivial baseline ignores the spikes, so a method that scores worse has no value. [`block_matching`] is the only
//! baseline here that reads images. No baseline detects or tracks: in a moving camera, a detector that needs no training
//! finds motion but no classes.
//!
//! | task | trivial baseline | baseline that reads images |
//! |---|---|---|
//! | flow | [`zero_flow`] | [`block_matching::flow_between_images`], [`block_matching::flow_between_readouts`] |
//! | depth | [`constant_depth`] of [`mean_depth`] | none |
//! | detection, tracking | [`no_detections`], [`no_tracks`] | none |

pub mod block_matching;
mod trivial;

pub use trivial::{constant_depth, mean_depth, no_detections, no_tracks, zero_flow};
