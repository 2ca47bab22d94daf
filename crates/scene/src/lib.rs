//! Random high-speed driving scenes, drawn on the CPU, with exact labels.
//!
//! A [`Scene`] is a city, its traffic and its light, all from one seed. It is
//! a function of time: any instant of its duration can be asked for, in any
//! order, and the same seed gives the same bytes on any number of threads.
//!
//! ```
//! use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions};
//! let options = SceneOptions::default().with_width(64).with_height(40).with_lighting(Some(Lighting::Noon));
//! let scene = Scene::random(7, &options)?;
//! let frame = scene.render(0.5, SamplesPerPixel::Four, 1)?;
//! assert_eq!(frame.light.len(), 64 * 40);
//! # Ok::<(), spikelane::Error>(())
//! ```
//!
//! Distances are metres, times seconds, light is photometric (cd/m2). How it
//! is done, and what it leaves out, is in `docs/reference/scenes.md`.

mod city;
mod drawing;
mod drive;
pub mod labels;
mod lighting;
mod options;
mod random;
mod shapes;
mod truth;
mod world;

pub use drawing::picture::{Labels, Rendered, SamplesPerPixel};
pub use drive::camera::{Camera, Intrinsics, Pose};
pub use drive::vehicle::VehicleClass;
pub use glam::{DMat3, DVec3};
pub use lighting::Lighting;
pub use options::SceneOptions;
pub use shapes::material::Semantic;
pub use truth::boxes::VehicleBox;
pub use truth::flow::Flow;
pub use truth::keyframes::KeyPlan;
pub use truth::warp::Warp;
pub use world::Scene;
