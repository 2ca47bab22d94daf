//! The protocol of a recording set: its recordings, their light, and the readouts that are judged.

pub(super) mod extent;
pub(super) mod recorded_scene;
pub(super) mod recorded_set;
