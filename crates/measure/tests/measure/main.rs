//! Statistics of streams and their errors.

#[path = "../coverage_support/mod.rs"]
mod coverage_support;
#[path = "../measure_support/mod.rs"]
mod measure_support;

mod coverage;
mod exact;
mod maps;
mod real;
mod said;
mod theory;
