//! The program as its users run it.

#[path = "../finite/mod.rs"]
mod finite;
#[path = "../program_support/mod.rs"]
mod program_support;

mod dataset;
mod doors;
mod errors;
mod evaluate;
mod finite_numbers;
#[cfg(unix)]
mod inputs;
#[cfg(unix)]
mod outputs;
mod shards;
mod simulate;
#[cfg(unix)]
mod stopped;
mod streams;
