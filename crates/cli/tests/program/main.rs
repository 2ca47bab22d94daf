//! Tests the program by running it as users do.

#[path = "../finite/mod.rs"]
mod finite;
#[path = "../program_support/mod.rs"]
mod program_support;

mod benchmark;
#[cfg(unix)]
mod benchmark_methods;
#[cfg(unix)]
mod cases;
#[cfg(unix)]
mod check;
mod color;
mod dataset;
mod defaults;
mod errors;
mod evaluate;
mod exposure;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod faults;
mod finite_numbers;
mod help;
#[cfg(unix)]
mod inputs;
mod inputs_and_outputs;
#[cfg(unix)]
mod interruption;
#[cfg(unix)]
mod names;
mod older_files;
#[cfg(unix)]
mod outputs;
mod pictures;
mod reports;
mod shards;
mod simulate;
mod standard_streams;
mod static_recordings;
mod streams;
#[cfg(unix)]
mod view;
