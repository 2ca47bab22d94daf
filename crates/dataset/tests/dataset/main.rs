//! Data sets.

mod asked;
mod make;
mod scene_drive;
mod scene_light;
mod strangers;
mod truth;
mod views;
