//! Triangles with what the shading needs, in chunks that can be culled.

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::material::Material;

/// The sky visibility that stands for one that is not known yet.
pub(crate) const UNBAKED: f32 = -1.0;

/// Bits of a sample's number that name the triangle within its part.
pub(crate) const TRIANGLE_BITS: u32 = 20;

/// What one run of triangles is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surface {
    pub material: Material,
    /// Seen from both sides (leaves, signs); others are culled from behind.
    pub double_sided: bool,
}

/// Neighbouring triangles with a bounding sphere.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub vertices: Range<u32>,
    pub triangles: Range<u32>,
    pub centre: Vec3,
    pub radius: f32,
}

/// One point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    pub position: Vec3,
    /// Unit normal for shading.
    pub normal: Vec3,
    /// Texture coordinates, in metres unless the material says otherwise.
    pub uv: Vec2,
    /// Fraction of the hemisphere's light that arrives, 0 to 1.
    pub sky: f32,
}

/// An indexed triangle mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle, an index into `surfaces`.
    pub surface_of: Vec<u32>,
    pub surfaces: Vec<Surface>,
    pub chunks: Vec<Chunk>,
    open: (u32, u32),
}

impl Mesh {
    /// The three corners of triangle `index`.
    pub(crate) fn corners(&self, index: usize) -> [&Vertex; 3] {
        self.triangles[index].map(|v| &self.vertices[v as usize])
    }

    /// The surface of triangle `index`.
    pub(crate) fn surface(&self, index: usize) -> Surface {
        self.surfaces[self.surface_of[index] as usize]
    }

    /// All triangles as corner positions.
    pub(crate) fn soup(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|v| self.vertices[v as usize].position))
    }

    /// Starts a new surface; the following triangles belong to it.
    pub(crate) fn surface_begin(&mut self, material: Material) {
        let double_sided = material.double_sided();
        self.surfaces.push(Surface { material, double_sided });
    }

    /// Ends the chunk of everything added since the last call.
    pub(crate) fn chunk_end(&mut self) {
        let (v0, t0) = self.open;
        let (v1, t1) = (self.vertices.len() as u32, self.triangles.len() as u32);
        if t1 > t0 {
            let points = &self.vertices[v0 as usize..v1 as usize];
            let (low, high) = points
                .iter()
                .fold((Vec3::MAX, Vec3::MIN), |(l, h), v| (l.min(v.position), h.max(v.position)));
            let centre = (low + high) * 0.5;
            let radius = points.iter().map(|v| v.position.distance(centre)).fold(0.0, f32::max);
            self.chunks.push(Chunk { vertices: v0..v1, triangles: t0..t1, centre, radius });
        }
        self.open = (v1, t1);
    }

    /// Adds a vertex whose sky visibility is baked later.
    pub(crate) fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.vertex_lit(position, normal, uv, UNBAKED)
    }

    /// Adds a vertex with a known sky visibility.
    pub(crate) fn vertex_lit(&mut self, position: Vec3, normal: Vec3, uv: Vec2, sky: f32) -> u32 {
        self.vertices.push(Vertex { position, normal, uv, sky });
        (self.vertices.len() - 1) as u32
    }

    /// Adds a triangle of the current surface, counter-clockwise from outside.
    pub(crate) fn triangle(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
        self.surface_of.push((self.surfaces.len() - 1) as u32);
    }

    /// Two triangles over four corners in order around the quad.
    pub(crate) fn quad_of(&mut self, c: [u32; 4]) {
        self.triangle([c[0], c[1], c[2]]);
        self.triangle([c[0], c[2], c[3]]);
    }

    /// A flat quad, turned so that it faces along `outward`.
    pub(crate) fn quad(&mut self, p: [Vec3; 4], uv: [Vec2; 4], outward: Vec3) {
        let normal = (p[2] - p[0]).cross(p[3] - p[1]).normalize_or_zero();
        let flip = normal.dot(outward) < 0.0;
        let normal = if flip { -normal } else { normal };
        let at = [0, 1, 2, 3].map(|i| self.vertex(p[i], normal, uv[i]));
        self.quad_of(if flip { [at[3], at[2], at[1], at[0]] } else { at });
    }

    /// A box around `centre` with half extents along three orthogonal axes.
    /// Each face gets coordinates in metres; the bottom is left out.
    pub(crate) fn block(&mut self, centre: Vec3, axes: [Vec3; 3]) {
        let [a, b, c] = axes;
        for (n, u, v) in [(a, b, c), (-a, b, c), (b, a, c), (-b, a, c), (c, a, b)] {
            let (lu, lv) = (u.length(), v.length());
            let m = centre + n;
            self.quad(
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

    /// An upright tapered tube with `sides` sides and smooth normals, from
    /// `foot` to `head`, with its end open at the foot and closed at the head.
    pub(crate) fn tube(&mut self, foot: Vec3, head: Vec3, radii: (f32, f32), sides: usize) {
        let along = (head - foot).normalize_or_zero();
        let (x, y) = along.any_orthonormal_pair();
        let length = head.distance(foot);
        let first = self.vertices.len() as u32;
        for i in 0..=sides {
            let angle = std::f32::consts::TAU * i as f32 / sides as f32;
            let n = x * libm::cosf(angle) + y * libm::sinf(angle);
            let u = angle * radii.0;
            self.vertex(foot + n * radii.0, n, Vec2::new(u, 0.0));
            self.vertex(head + n * radii.1, n, Vec2::new(u, length));
        }
        for i in 0..sides as u32 {
            let a = first + 2 * i;
            self.quad_of([a, a + 2, a + 3, a + 1]);
        }
        let top = self.vertex(head, along, Vec2::ZERO);
        for i in 0..sides as u32 {
            let a = first + 2 * i + 1;
            self.triangle([a, a + 2, top]);
        }
    }

    /// Gives the open vertices of small things one visibility for all of each
    /// thing, `bake(a point 1 m above its foot)`, shared out by their tilt:
    /// rays for every corner of a pole would cost more than all houses.
    pub(crate) fn bake_small(&mut self, radius: f32, bake: impl Fn(Vec3) -> f32) {
        for chunk in self.chunks.iter().filter(|c| c.radius < radius) {
            let vertices = &mut self.vertices[chunk.vertices.start as usize..chunk.vertices.end as usize];
            let foot = vertices.iter().map(|v| v.position.z).fold(f32::MAX, f32::min);
            let sky = bake(chunk.centre.truncate().extend(foot + 1.0));
            for v in vertices.iter_mut().filter(|v| v.sky == UNBAKED) {
                v.sky = sky * (0.5 + 0.5 * v.normal.z);
            }
        }
    }

    /// Replaces every open sky visibility by `bake(position, normal)`.
    pub(crate) fn bake(&mut self, bake: impl Fn(Vec3, Vec3) -> f32) {
        for v in &mut self.vertices {
            if v.sky == UNBAKED {
                v.sky = bake(v.position, v.normal);
            }
        }
    }
}
