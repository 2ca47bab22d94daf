//! Builds a city. The city consists of the ground and its objects, with the sky visibility of each vertex.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use glam::Vec3;

use super::district::District;
use super::static_city::{City, SKY_SAMPLE_SPACING_M};
use super::{buildings, furniture, ground, trees};
use crate::drive::road::Road;
use crate::random::Draws;
use crate::shapes::bvh::{Bvh, MAX_TREE_BYTES};
use crate::shapes::mesh::{Mesh, UNKNOWN_SKY};
use spikelane::Result;
use spikelane::unstable::{Count, inputs};

impl City {
    /// Builds the city along the road, from arc length `start_s` to arc length `end_s`. `tunnel` is the range of arc
    /// length inside the tunnel.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the system cannot allocate the tree of the triangles.
    pub(crate) fn from_seed(seed: u64, start_s: f64, end_s: f64, tunnel: Option<(f64, f64)>) -> Result<Self> {
        let road = Road::from_seed(seed, start_s, end_s, tunnel.is_some());
        let draws = Draws::new(seed, "district");
        let district = [District::OldTown, District::OldTown, District::Downtown, District::Suburb]
            [draws.index_below(0, 4)];
        let mut city = Self {
            road,
            district,
            mesh: Mesh::default(),
            facades: Vec::new(),
            lamps: Vec::new(),
            tunnel,
            street_canyon: (0.0, 0.0),
            bvh: Bvh::new(std::iter::empty()),
            sky_visibility_bits: Vec::new(),
            sky_along: Vec::new(),
            start_s,
        };
        ground::build(&mut city, start_s, end_s);
        buildings::build(&mut city, seed, start_s, end_s);
        trees::build(&mut city, seed, start_s, end_s);
        furniture::build(&mut city, seed, start_s, end_s);
        city.mesh.end_chunk();
        let triangles = city.mesh.triangle_corners().count();
        inputs::check_memory(
            format_args!("a scene of {}", Count(triangles, "triangle")),
            MAX_TREE_BYTES * triangles,
        )?;
        city.bvh = Bvh::new(city.mesh.triangle_corners());
        city.compute_sky_visibility(end_s);
        Ok(city)
    }

    fn compute_sky_visibility(&mut self, end_s: f64) {
        let bvh = &self.bvh;
        self.mesh.bake_small(6.0, |p| sky_visibility(bvh, p, Vec3::Z));
        self.sky_visibility_bits =
            self.mesh.vertices.iter().map(|v| AtomicU32::new(v.sky.to_bits())).collect();
        let count = ((end_s - self.start_s) / SKY_SAMPLE_SPACING_M) as usize + 2;
        self.sky_along = (0..count)
            .map(|i| {
                let p = self.road.place(self.start_s + i as f64 * SKY_SAMPLE_SPACING_M, 0.0, 1.6);
                sky_visibility(&self.bvh, p, Vec3::Z)
            })
            .collect();
    }
}

impl City {
    /// Returns the fraction of the sky that is visible from a vertex, 0 to 1.
    ///
    /// The visibility of vertices of large objects is computed on first use, because only a few of these vertices are
    /// visible during a drive. If several threads compute the visibility of a vertex at the same time, all results are
    /// equal.
    pub(crate) fn sky_visibility_at(&self, vertex: usize) -> f32 {
        let known = f32::from_bits(self.sky_visibility_bits[vertex].load(Relaxed));
        if known != UNKNOWN_SKY {
            return known;
        }
        let v = &self.mesh.vertices[vertex];
        let sky = sky_visibility(&self.bvh, v.position, v.normal);
        self.sky_visibility_bits[vertex].store(sky.to_bits(), Relaxed);
        sky
    }
}

/// Returns the fraction of the cosine-weighted hemisphere around `normal` in which no object is within 60 m.
///
/// The ground blocks the rays below the horizon. `AmbientLight::non_sky_lux` contains the light from these directions.
fn sky_visibility(bvh: &Bvh, position: Vec3, normal: Vec3) -> f32 {
    const RAYS: u32 = 24;
    let (x, y) = normal.any_orthonormal_pair();
    let origin = position + normal * 0.06;
    let visible_rays = (0..RAYS)
        .filter(|&i| {
            // The rays follow a Fibonacci spiral across the cosine-weighted hemisphere.
            let r2 = (i as f32 + 0.5) / RAYS as f32;
            let angle = i as f32 * 2.399_963;
            let (r, z) = (r2.sqrt(), (1.0 - r2).sqrt());
            let direction = x * (r * libm::cosf(angle)) + y * (r * libm::sinf(angle)) + normal * z;
            !bvh.is_blocked(origin, direction, 0.0, 60.0)
        })
        .count();
    visible_rays as f32 / RAYS as f32
}

#[cfg(test)]
mod tests {
    use super::City;
    use crate::city::static_city::CURB_HEIGHT_M;

    #[test]
    fn nothing_floats_above_the_ground() {
        for (seed, tunnel) in [(1, None), (2, None), (3, Some((-90.0, 60.0)))] {
            let city = City::from_seed(seed, -100.0, 300.0, tunnel).unwrap();
            for chunk in &city.mesh.chunks {
                let low = city.mesh.vertices[chunk.vertices.start as usize..chunk.vertices.end as usize]
                    .iter()
                    .map(|v| v.position.z)
                    .fold(f32::MAX, f32::min);
                assert!(f64::from(low) <= CURB_HEIGHT_M + 0.02, "seed {seed}: something begins at {low} m");
            }
        }
    }

    #[test]
    fn every_vertex_sees_a_share_of_the_sky_and_the_same_again() {
        let city = City::from_seed(4, -100.0, 300.0, None).unwrap();
        for vertex in (0..city.mesh.vertices.len()).step_by(17) {
            let sky = city.sky_visibility_at(vertex);
            assert!((0.0..=1.0).contains(&sky) && city.sky_visibility_at(vertex) == sky, "{vertex}: {sky}");
        }
    }
}
