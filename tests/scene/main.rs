//! Scenes and their labels.

#[cfg(feature = "scene")]
mod boxes;
mod drive;
#[cfg(feature = "scene")]
mod flow;
mod light;
#[cfg(feature = "scene")]
mod render;
