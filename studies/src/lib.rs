//! What several studies share.

pub mod lines;
