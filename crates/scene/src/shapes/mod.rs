//! Meshes, the functions that build meshes, and the data structures that find the triangles on a ray or the items at a
//! position.

pub(super) mod bvh;
mod cell_index;
pub(super) mod grid;
pub(super) mod lamp_shadows;
pub(super) mod loft;
pub(super) mod material;
pub(super) mod mesh;
pub(super) mod sun_shadows;
mod triangle;
