//! Layouts and files of streams.

mod files;
mod layouts;
mod npz;
mod readings;
mod real;
mod storage;
