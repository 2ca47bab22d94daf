//! Protection against untrusted inputs: names in files, counts in files, and the files themselves.
//!
//! Text from a file becomes a path only through [`PlainName`] or [`InnerPath`]. Files are opened only through
//! [`InputFile`], which accepts regular files and never waits for a pipe. An allocation whose size is a count from a file
//! uses [`zeroed_vec`] or [`reserved_vec`], or follows a call of [`check_memory`]. These functions return an error if the
//! memory is insufficient. An ordinary allocation would abort the process.

/// Largest size in memory of a decoded image, of a frame of an array or of a frame of a video: 512 MiB.
pub const MAX_PICTURE_BYTES: u64 = 512 << 20;

#[cfg(feature = "presets")]
mod digest;
mod input_file;
mod input_lines;
mod memory;
#[cfg(feature = "presets")]
mod names;

#[cfg(feature = "presets")]
pub use digest::deserialize_digest;
pub use input_file::{
    InputFile, InputReader, MAX_TEXT_BYTES, not_found_as_none, path_from_text, read_bytes, read_text,
    read_text_up_to, utf8_bytes,
};
pub use input_lines::InputLines;
pub use memory::{check_memory, reserved_vec, zeroed_vec};
#[cfg(feature = "presets")]
pub use names::{Access, InnerPath, PARTIAL_ENDING, PlainName, check_link};
