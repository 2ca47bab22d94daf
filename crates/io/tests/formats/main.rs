//! Tests of stream layouts and files.

mod files;
mod layout_guesses;
mod layouts;
mod npz;
mod real_recordings;
mod storage;
