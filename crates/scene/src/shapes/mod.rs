//! Meshes, how they are made, and where rays and places find them.

pub(super) mod bvh;
mod columns;
pub(super) mod grid;
pub(super) mod lampward;
pub(super) mod loft;
pub(super) mod material;
pub(super) mod mesh;
pub(super) mod sunward;
