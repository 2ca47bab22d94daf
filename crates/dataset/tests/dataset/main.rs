//! Tests of datasets.

mod exporters;
mod generate;
mod ground_truth;
mod scene_drive;
mod scene_light;
mod spec;
mod untrusted;
