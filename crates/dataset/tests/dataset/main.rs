//! Data sets.

mod asked;
mod make;
mod strangers;
mod truth;
mod views;
mod scene_drive;
mod scene_light;
