//! Code that several studies use.

pub mod lines;
pub mod provenance;
