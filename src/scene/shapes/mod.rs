//! Meshes, how they are made, and where rays and places find them.

pub(super) mod bvh;
pub(super) mod grid;
pub(super) mod loft;
pub(super) mod material;
pub(super) mod mesh;
pub(super) mod sunward;
