//! Tests of scenes and their labels.

mod boxes;
mod flow;
mod lens;
mod render;
