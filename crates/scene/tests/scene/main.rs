//! Tests of scenes and their labels.

mod boxes;
mod exposure;
mod flow;
mod lens;
mod render;
