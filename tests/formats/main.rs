//! Layouts and files of streams.
#![cfg(feature = "files")]

mod files;
mod layouts;
mod npz;
mod readings;
mod real;
mod storage;
