//! Triangle meshes with the attributes that shading needs. A mesh is divided into chunks that can be culled.

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::material::Material;

/// Placeholder for a sky visibility that is not computed yet.
pub(crate) const UNKNOWN_SKY: f32 = -1.0;

/// Number of bits of a sample's id that contain the number of the triangle within its part.
pub(crate) const TRIANGLE_BITS: u32 = 20;

/// Material of consecutive triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surface {
    pub material: Material,
    /// Whether both sides are visible, as for leaves and signs. The back of other surfaces is not drawn.
    pub is_double_sided: bool,
}

/// Neighboring triangles and their bounding sphere.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub vertices: Range<u32>,
    pub triangles: Range<u32>,
    pub center: Vec3,
    pub radius: f32,
}

/// One point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    pub position: Vec3,
    /// Unit normal for shading.
    pub normal: Vec3,
    /// Texture coordinates. The unit is meters unless the material defines another unit.
    pub uv: Vec2,
    /// Sky visibility, which is the fraction of the hemisphere that is not blocked, 0 to 1.
    pub sky: f32,
}

/// An indexed triangle mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle, an index into `surfaces`.
    pub surface_of: Vec<u32>,
    pub surfaces: Vec<Surface>,
    pub chunks: Vec<Chunk>,
    open_chunk: (u32, u32),
}

impl Mesh {
    /// Returns the three corners of triangle `index`.
    pub(crate) fn corners(&self, index: usize) -> [&Vertex; 3] {
        self.triangles[index].map(|v| &self.vertices[v as usize])
    }

    /// Returns the surface of triangle `index`.
    pub(crate) fn surface_at(&self, index: usize) -> Surface {
        self.surfaces[self.surface_of[index] as usize]
    }

    /// Returns the corner positions of all triangles.
    pub(crate) fn triangle_corners(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|v| self.vertices[v as usize].position))
    }

    /// Starts a new surface. All triangles added after this call belong to the new surface.
    pub(crate) fn begin_surface(&mut self, material: Material) {
        let double_sided = material.is_double_sided();
        self.surfaces.push(Surface { material, is_double_sided: double_sided });
    }

    /// Closes the current chunk. The chunk contains all triangles added since the last call of this function.
    pub(crate) fn end_chunk(&mut self) {
        let (v0, t0) = self.open_chunk;
        let (v1, t1) = (self.vertices.len() as u32, self.triangles.len() as u32);
        if t1 > t0 {
            let points = &self.vertices[v0 as usize..v1 as usize];
            let (low, high) = points
                .iter()
                .fold((Vec3::MAX, Vec3::MIN), |(l, h), v| (l.min(v.position), h.max(v.position)));
            let center = (low + high) * 0.5;
            let radius = points.iter().map(|v| v.position.distance(center)).fold(0.0, f32::max);
            self.chunks.push(Chunk { vertices: v0..v1, triangles: t0..t1, center, radius });
        }
        self.open_chunk = (v1, t1);
    }

    /// Adds a vertex whose sky visibility is computed later.
    pub(crate) fn add_vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.add_lit_vertex(position, normal, uv, UNKNOWN_SKY)
    }

    /// Adds a vertex with a known sky visibility.
    pub(crate) fn add_lit_vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2, sky: f32) -> u32 {
        self.vertices.push(Vertex { position, normal, uv, sky });
        (self.vertices.len() - 1) as u32
    }

    /// Adds a triangle to the current surface. Seen from outside, the corners must be in counterclockwise order.
    pub(crate) fn add_triangle(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
        self.surface_of.push((self.surfaces.len() - 1) as u32);
    }

    /// Adds the two triangles of a quad. The four corners must be in order around the quad.
    pub(crate) fn add_quad_of(&mut self, c: [u32; 4]) {
        self.add_triangle([c[0], c[1], c[2]]);
        self.add_triangle([c[0], c[2], c[3]]);
    }

    /// Adds a flat quad. The quad is oriented so that its front faces in the direction `outward`.
    pub(crate) fn add_quad(&mut self, p: [Vec3; 4], uv: [Vec2; 4], outward: Vec3) {
        let normal = (p[2] - p[0]).cross(p[3] - p[1]).normalize_or_zero();
        let flip = normal.dot(outward) < 0.0;
        let normal = if flip { -normal } else { normal };
        let at = [0, 1, 2, 3].map(|i| self.add_vertex(p[i], normal, uv[i]));
        self.add_quad_of(if flip { [at[3], at[2], at[1], at[0]] } else { at });
    }

    /// Adds a box. The center is `center`, and `axes` contains three orthogonal vectors whose lengths are half of the
    /// sides.
    ///
    /// The texture coordinates of each face are in meters. The box has no bottom face.
    pub(crate) fn add_box(&mut self, center: Vec3, axes: [Vec3; 3]) {
        let [a, b, c] = axes;
        for (n, u, v) in [(a, b, c), (-a, b, c), (b, a, c), (-b, a, c), (c, a, b)] {
            let (lu, lv) = (u.length(), v.length());
            let m = center + n;
            self.add_quad(
                [m - u - v, m + u - v, m + u + v, m - u + v],
                [
                    Vec2::ZERO,
                    Vec2::new(2.0 * lu, 0.0),
                    Vec2::new(2.0 * lu, 2.0 * lv),
                    Vec2::new(0.0, 2.0 * lv),
                ],
                n,
            );
        }
    }

    /// Adds an upright tapered tube between `foot` and `head` with `sides` sides and smooth normals.
    ///
    /// The tube is open at the foot and closed at the head.
    pub(crate) fn add_tube(&mut self, foot: Vec3, head: Vec3, radii: (f32, f32), sides: usize) {
        let along = (head - foot).normalize_or_zero();
        let (x, y) = along.any_orthonormal_pair();
        let length = head.distance(foot);
        let first = self.vertices.len() as u32;
        for i in 0..=sides {
            let angle = std::f32::consts::TAU * i as f32 / sides as f32;
            let n = x * libm::cosf(angle) + y * libm::sinf(angle);
            let u = angle * radii.0;
            self.add_vertex(foot + n * radii.0, n, Vec2::new(u, 0.0));
            self.add_vertex(head + n * radii.1, n, Vec2::new(u, length));
        }
        for i in 0..sides as u32 {
            let a = first + 2 * i;
            self.add_quad_of([a, a + 2, a + 3, a + 1]);
        }
        let top = self.add_vertex(head, along, Vec2::ZERO);
        for i in 0..sides as u32 {
            let a = first + 2 * i + 1;
            self.add_triangle([a, a + 2, top]);
        }
    }

    /// Sets the sky visibility of all vertices in small chunks. Each chunk has one visibility, which is scaled by the
    /// tilt of each vertex.
    ///
    /// A chunk is small if its radius is less than `radius`. The visibility of the chunk is `bake(p)`, where p is the
    /// point 1 m above the foot of the chunk. A vertex whose visibility is already known is unchanged. If rays were
    /// traced for every vertex of small objects such as poles, the computation would take longer than for all
    /// buildings.
    pub(crate) fn bake_small(&mut self, radius: f32, bake: impl Fn(Vec3) -> f32) {
        for chunk in self.chunks.iter().filter(|c| c.radius < radius) {
            let vertices = &mut self.vertices[chunk.vertices.start as usize..chunk.vertices.end as usize];
            let foot = vertices.iter().map(|v| v.position.z).fold(f32::MAX, f32::min);
            let sky = bake(chunk.center.truncate().extend(foot + 1.0));
            for v in vertices.iter_mut().filter(|v| v.sky == UNKNOWN_SKY) {
                v.sky = sky * (0.5 + 0.5 * v.normal.z);
            }
        }
    }

    /// Replaces every unknown sky visibility with `bake(position, normal)`.
    pub(crate) fn bake(&mut self, bake: impl Fn(Vec3, Vec3) -> f32) {
        for v in &mut self.vertices {
            if v.sky == UNKNOWN_SKY {
                v.sky = bake(v.position, v.normal);
            }
        }
    }
}
