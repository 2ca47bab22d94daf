//! What strangers send: names inside files, counts inside files, and the files themselves.
//!
//! A text from a file becomes a path only as a [`PlainName`] or an [`InnerPath`]. A file is opened only by
//! [`InputFile`], which accepts regular files and never waits for a pipe. A count becomes memory only by
//! [`zeroed`] or [`buffer`], which return an error where an allocation would abort the process.

mod file;
mod lines;
mod memory;
mod names;

pub(crate) use file::{InputFile, MAX_TEXT_BYTES, if_found, read_bytes, read_text};
pub(crate) use lines::Lines;
pub(crate) use memory::{buffer, zeroed};
pub(crate) use names::Access;
pub use names::{InnerPath, PlainName};
