//! Everything that stands still, as data.

use std::sync::atomic::AtomicU32;

use glam::{Vec2, Vec3};

use super::district::District;
use super::facade::Facade;
use crate::drive::road::Road;
use crate::shapes::bvh::Bvh;
use crate::shapes::mesh::Mesh;

/// Height of the pavement above the road.
pub(crate) const KERB_M: f64 = 0.14;

/// A street lamp's light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamp {
    /// The middle of its glowing face.
    pub position: Vec3,
    /// Which phase of the mains feeds it, 0 to 2.
    pub phase: u8,
    /// Its own share of the nominal light, near 1.
    pub strength: f32,
}

/// Everything that stands still.
#[derive(Debug)]
pub(crate) struct City {
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
    /// Bits of the sky visibility of every vertex, as far as it was asked for.
    pub(super) baked: Vec<AtomicU32>,
    /// Sky visibility along the middle of the road, every `SKY_STEP_M` from its start.
    pub(super) sky_along: Vec<f32>,
    pub(super) start_s: f64,
}

/// Distance between the places of `sky_along`.
pub(super) const SKY_STEP_M: f64 = 4.0;

impl City {
    /// Where a lot must not build: the tunnel's stretch and a little more.
    pub(super) fn in_tunnel(&self, s: f64, margin: f64) -> bool {
        self.tunnel.is_some_and(|(a, b)| s > a - margin && s < b + margin)
    }

    /// How deep inside the tunnel a place is: 0 outside, 1 from 3 m inside.
    pub(crate) fn tunnel_share(&self, s: f64) -> f32 {
        self.tunnel.map_or(0.0, |(a, b)| (((s - a).min(b - s) / 3.0).clamp(0.0, 1.0)) as f32)
    }

    /// Share of the sky that a vehicle on the road sees at `s`.
    pub(crate) fn sky_at(&self, s: f64) -> f32 {
        let x = ((s - self.start_s) / SKY_STEP_M).clamp(0.0, (self.sky_along.len() - 2) as f64);
        let (i, t) = (x as usize, (x - x.floor()) as f32);
        self.sky_along[i] * (1.0 - t) + self.sky_along[i + 1] * t
    }
}

/// Texture corners of a rectangle from the origin to (u, v), in order around it.
pub(super) fn uv_rect(u: f32, v: f32) -> [Vec2; 4] {
    [Vec2::ZERO, Vec2::new(u, 0.0), Vec2::new(u, v), Vec2::new(0.0, v)]
}
