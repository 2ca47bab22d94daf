//! Scenes and their labels.

#[cfg(feature = "scene")]
mod boxes;
#[cfg(feature = "scene")]
mod flow;
mod light;
#[cfg(feature = "scene")]
mod render;
