//! The city: a grammar that turns a road and a seed into everything that stands still.
//!
//! Road, kerbs and pavements first; the blocks between junctions are cut into
//! lots, each lot gets a house, a garden or a gap; trees, lamps, signs and
//! traffic lights stand on the pavement. Every base is at the height of the
//! ground it stands on.

mod buildings;
mod furniture;
mod ground;
mod trees;

use glam::{Vec2, Vec3};

use super::bvh::Bvh;
use super::facade::Facade;
use super::mesh::Mesh;
use super::random::Draws;
use super::road::Road;

/// Height of the pavement above the road.
pub(super) const KERB_M: f64 = 0.14;

/// A street lamp's light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamp {
    /// The middle of its glowing face.
    pub position: Vec3,
    /// Which phase of the mains feeds it, 0 to 2.
    pub phase: u8,
    /// Its own share of the nominal light, near 1.
    pub strength: f32,
}

/// The character of a district.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum District {
    /// Closed fronts of brick and plaster with pitched roofs.
    Old,
    /// Tall concrete and glass.
    Downtown,
    /// Detached houses in gardens.
    Suburb,
}

/// Everything that stands still.
#[derive(Debug)]
pub(super) struct City {
    pub road: Road,
    pub district: District,
    pub mesh: Mesh,
    pub facades: Vec<Facade>,
    pub lamps: Vec<Lamp>,
    /// The stretch of road inside the tunnel, if there is one.
    pub tunnel: Option<(f64, f64)>,
    /// Mean height of the fronts and their distance from the middle of the
    /// road: what a reflection sees.
    pub canyon: (f32, f32),
    pub bvh: Bvh,
    /// Sky visibility along the middle of the road, every `SKY_STEP_M` from its start.
    sky_along: Vec<f32>,
    start_s: f64,
}

const SKY_STEP_M: f64 = 4.0;

impl City {
    /// Builds the city along `[start_s, end_s]`; `tunnel` covers that stretch of it.
    pub fn random(seed: u64, start_s: f64, end_s: f64, tunnel: Option<(f64, f64)>) -> Self {
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

    /// Where a lot must not build: the tunnel's stretch and a little more.
    fn in_tunnel(&self, s: f64, margin: f64) -> bool {
        self.tunnel.is_some_and(|(a, b)| s > a - margin && s < b + margin)
    }

    /// How deep inside the tunnel a place is: 0 outside, 1 from 3 m inside.
    pub fn tunnel_share(&self, s: f64) -> f32 {
        self.tunnel.map_or(0.0, |(a, b)| (((s - a).min(b - s) / 3.0).clamp(0.0, 1.0)) as f32)
    }

    /// Share of the sky that a vehicle on the road sees at `s`.
    pub fn sky_at(&self, s: f64) -> f32 {
        let x = ((s - self.start_s) / SKY_STEP_M).clamp(0.0, (self.sky_along.len() - 2) as f64);
        let (i, t) = (x as usize, (x - x.floor()) as f32);
        self.sky_along[i] * (1.0 - t) + self.sky_along[i + 1] * t
    }

    fn bake(&mut self, end_s: f64) {
        let bvh = &self.bvh;
        self.mesh.bake_small(6.0, |p| sky_visibility(bvh, p, Vec3::Z));
        self.mesh.bake(|p, n| sky_visibility(bvh, p, n));
        let count = ((end_s - self.start_s) / SKY_STEP_M) as usize + 2;
        self.sky_along = (0..count)
            .map(|i| {
                let p = self.road.place(self.start_s + i as f64 * SKY_STEP_M, 0.0, 1.6);
                sky_visibility(&self.bvh, p, Vec3::Z)
            })
            .collect();
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

/// Texture corners of a rectangle from the origin to (u, v), in order around it.
fn uv_rect(u: f32, v: f32) -> [Vec2; 4] {
    [Vec2::ZERO, Vec2::new(u, 0.0), Vec2::new(u, v), Vec2::new(0.0, v)]
}

#[cfg(test)]
mod tests {
    use super::{City, KERB_M};

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
    fn sky_is_baked_for_every_vertex() {
        let city = City::random(4, -100.0, 300.0, None);
        assert!(city.mesh.vertices.iter().all(|v| (0.0..=1.0).contains(&v.sky)));
    }
}
