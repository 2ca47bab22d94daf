//! Tests of the statistics of streams and of the errors of these statistics.

#[path = "../coverage_support/mod.rs"]
mod coverage_support;
#[path = "../measure_support/mod.rs"]
mod measure_support;

mod coverage;
mod maps;
mod naive_reference;
mod real_recordings;
mod report;
mod theory;
