//! Code that several studies use.

pub mod lines;
pub mod page;
pub mod provenance;
