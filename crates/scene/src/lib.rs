//! Renders random high-speed driving scenes on the CPU and computes exact labels.
//!
//! A seed determines the city, the traffic and the light of a [`Scene`]. Every instant of the drive can be rendered,
//! in any order. The same seed gives the same bytes for any number of threads.
//!
//! ```
//! use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions};
//! let options = SceneOptions::default().with_width(64).with_height(40).with_lighting(Some(Lighting::Noon));
//! let scene = Scene::from_seed(7, &options)?;
//! let frame = scene.render(0.5, SamplesPerPixel::Four, 1)?;
//! assert_eq!(frame.light.len(), 64 * 40);
//! # Ok::<(), spikelane::Error>(())
//! ```
//!
//! Distances are in meters, times in seconds, and light is photometric (cd/m2). `docs/reference/scenes.md` describes
//! the method and its limits.

/// Version of the scenes. Scenes of different versions have different bytes for the same seed.
pub const SCENE_VERSION: u32 = 3;

mod city;
mod drive;
mod ground_truth;
pub mod labels;
mod lighting;
mod optics;
mod options;
mod random;
mod rendering;
mod shapes;
mod world;

pub use drive::camera::{Intrinsics, PinholeCamera, Pose};
pub use drive::vehicle_model::VehicleClass;
pub use glam::{DMat3, DVec3};
pub use ground_truth::boxes::VehicleBox;
pub use ground_truth::flow::Flow;
pub use ground_truth::keyframes::KeyframePlan;
pub use ground_truth::light_span::{LightSpan, SpanEnd};
pub use ground_truth::warp::Warp;
pub use lighting::Lighting;
pub use optics::exposure::Exposure;
pub use optics::lens::Lens;
pub use options::SceneOptions;
pub use rendering::rendered_frame::{Labels, RenderedFrame, SamplesPerPixel};
pub use shapes::material::Semantic;
pub use world::Scene;
