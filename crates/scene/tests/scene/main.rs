//! Scenes and their labels.

mod boxes;
mod flow;
mod render;
