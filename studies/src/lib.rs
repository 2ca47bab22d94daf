//! Code that several studies use.

pub mod lines;
