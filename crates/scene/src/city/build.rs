//! How a city is built: the ground, what stands on it, and the sky that each place of it sees.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use glam::Vec3;

use super::district::District;
use super::standing::{City, SKY_STEP_M};
use super::{buildings, furniture, ground, trees};
use crate::drive::road::Road;
use crate::random::Draws;
use crate::shapes::bvh::Bvh;
use crate::shapes::mesh::{Mesh, UNBAKED};

impl City {
    /// Builds the city along `[start_s, end_s]`; `tunnel` covers that stretch of it.
    pub(crate) fn random(seed: u64, start_s: f64, end_s: f64, tunnel: Option<(f64, f64)>) -> Self {
        let road = Road::random(seed, start_s, end_s, tunnel.is_some());
        let draws = Draws::new(seed, "district");
        let district = [District::Old, District::Old, District::Downtown, District::Suburb][draws.pick(0, 4)];
        let mut city = Self {
            road,
            district,
            mesh: Mesh::default(),
            facades: Vec::new(),
            lamps: Vec::new(),
            tunnel,
            canyon: (0.0, 0.0),
            bvh: Bvh::new(std::iter::empty()),
            baked: Vec::new(),
            sky_along: Vec::new(),
            start_s,
        };
        ground::build(&mut city, start_s, end_s);
        buildings::build(&mut city, seed, start_s, end_s);
        trees::build(&mut city, seed, start_s, end_s);
        furniture::build(&mut city, seed, start_s, end_s);
        city.mesh.chunk_end();
        city.bvh = Bvh::new(city.mesh.soup());
        city.bake(end_s);
        city
    }

    fn bake(&mut self, end_s: f64) {
        let bvh = &self.bvh;
        self.mesh.bake_small(6.0, |p| sky_visibility(bvh, p, Vec3::Z));
        self.baked = self.mesh.vertices.iter().map(|v| AtomicU32::new(v.sky.to_bits())).collect();
        let count = ((end_s - self.start_s) / SKY_STEP_M) as usize + 2;
        self.sky_along = (0..count)
            .map(|i| {
                let p = self.road.place(self.start_s + i as f64 * SKY_STEP_M, 0.0, 1.6);
                sky_visibility(&self.bvh, p, Vec3::Z)
            })
            .collect();
    }
}

impl City {
    /// Share of the sky that a vertex sees. The rays of a large thing's vertex are shot when it is first seen:
    /// a drive passes few of them. Threads that do so at once find the same.
    pub(crate) fn sky(&self, vertex: usize) -> f32 {
        let known = f32::from_bits(self.baked[vertex].load(Relaxed));
        if known != UNBAKED {
            return known;
        }
        let v = &self.mesh.vertices[vertex];
        let sky = sky_visibility(&self.bvh, v.position, v.normal);
        self.baked[vertex].store(sky.to_bits(), Relaxed);
        sky
    }
}

/// Share of the cosine-weighted hemisphere about `normal` from which light arrives.
///
/// Rays below the horizon count as seen: the ground there is lit too, and its
/// own darkness is the bounce light's business.
fn sky_visibility(bvh: &Bvh, position: Vec3, normal: Vec3) -> f32 {
    const RAYS: u32 = 24;
    let (x, y) = normal.any_orthonormal_pair();
    let origin = position + normal * 0.06;
    let seen = (0..RAYS)
        .filter(|&i| {
            // A Fibonacci spiral over the cosine-weighted hemisphere.
            let r2 = (i as f32 + 0.5) / RAYS as f32;
            let angle = i as f32 * 2.399_963;
            let (r, z) = (r2.sqrt(), (1.0 - r2).sqrt());
            let direction = x * (r * libm::cosf(angle)) + y * (r * libm::sinf(angle)) + normal * z;
            !bvh.blocked(origin, direction, 0.0, 60.0)
        })
        .count();
    seen as f32 / RAYS as f32
}

#[cfg(test)]
mod tests {
    use super::City;
    use crate::city::standing::KERB_M;

    #[test]
    fn nothing_floats_above_the_ground() {
        for (seed, tunnel) in [(1, None), (2, None), (3, Some((-90.0, 60.0)))] {
            let city = City::random(seed, -100.0, 300.0, tunnel);
            for chunk in &city.mesh.chunks {
                let low = city.mesh.vertices[chunk.vertices.start as usize..chunk.vertices.end as usize]
                    .iter()
                    .map(|v| v.position.z)
                    .fold(f32::MAX, f32::min);
                assert!(f64::from(low) <= KERB_M + 0.02, "seed {seed}: something begins at {low} m");
            }
        }
    }

    #[test]
    fn every_vertex_sees_a_share_of_the_sky_and_the_same_again() {
        let city = City::random(4, -100.0, 300.0, None);
        for vertex in (0..city.mesh.vertices.len()).step_by(17) {
            let sky = city.sky(vertex);
            assert!((0.0..=1.0).contains(&sky) && city.sky(vertex) == sky, "{vertex}: {sky}");
        }
    }
}
