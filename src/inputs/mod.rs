//! What strangers send: names inside files, counts inside files, and the files themselves.
//!
//! A text from a file becomes a path only as a [`PlainName`] or an [`InnerPath`]. A file is opened only by
//! [`InputFile`], which accepts regular files and never waits for a pipe. A count becomes memory only by
//! [`zeroed`] or [`buffer`], or after [`check_memory`], which return an error where an allocation would abort the process.

/// The most that one decoded picture, or one frame of an array or a video, may take in memory: 512 MiB.
pub const MAX_PICTURE_BYTES: u64 = 512 << 20;

mod file;
mod lines;
mod memory;
#[cfg(feature = "presets")]
mod names;

pub use file::{Cursor, InputFile, MAX_TEXT_BYTES, if_found, read_bytes, read_text, read_text_up_to};
pub use lines::Lines;
pub use memory::{buffer, check_memory, zeroed};
#[cfg(feature = "presets")]
pub use names::{Access, InnerPath, PlainName, check_link};
