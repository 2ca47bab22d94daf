//! Meshes and their construction, and data structures that find triangles for rays and items for places.

pub(super) mod bvh;
mod cell_index;
pub(super) mod grid;
pub(super) mod lamp_shadows;
pub(super) mod loft;
pub(super) mod material;
pub(super) mod mesh;
pub(super) mod sun_shadows;
