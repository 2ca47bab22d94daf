//! Statistics of streams and their errors.

#[cfg(all(feature = "files", feature = "threads"))]
#[path = "../coverage_support/mod.rs"]
mod coverage_support;
#[path = "../measure_support/mod.rs"]
mod measure_support;

#[cfg(all(feature = "files", feature = "threads"))]
mod coverage;
mod exact;
mod maps;
mod real;
#[cfg(all(feature = "files", feature = "threads"))]
mod said;
mod theory;
