//! The data of the static part of a scene.

use std::sync::atomic::AtomicU32;

use glam::{Vec2, Vec3};

use super::district::District;
use super::facade::Facade;
use crate::drive::road::Road;
use crate::shapes::bvh::Bvh;
use crate::shapes::mesh::Mesh;

/// Height of the sidewalk above the road, in meters.
pub(crate) const CURB_HEIGHT_M: f64 = 0.14;

/// The light source of a street lamp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamp {
    /// Center of the luminous face of the lamp.
    pub position: Vec3,
    /// Mains phase to which the lamp is connected, 0 to 2.
    pub phase: u8,
    /// Luminous intensity of this lamp divided by the luminous intensity of the nominal lamp. The value is near 1.
    pub strength: f32,
}

/// The static part of a scene.
#[derive(Debug)]
pub(crate) struct City {
    pub road: Road,
    pub district: District,
    pub mesh: Mesh,
    pub facades: Vec<Facade>,
    pub lamps: Vec<Lamp>,
    /// The range of arc length inside the tunnel. `None` if there is no tunnel.
    pub tunnel: Option<(f64, f64)>,
    /// Mean height of the facades, and distance of the facades from the center of the road. The computation of
    /// reflections uses both numbers.
    pub street_canyon: (f32, f32),
    pub bvh: Bvh,
    /// Sky visibility of every vertex as the bits of an `f32`. The value is `UNKNOWN_SKY` until the visibility is
    /// computed.
    pub(super) sky_visibility_bits: Vec<AtomicU32>,
    /// Sky visibility along the center of the road. Samples start at `start_s` and are `SKY_SAMPLE_SPACING_M` apart.
    pub(super) sky_along: Vec<f32>,
    pub(super) start_s: f64,
}

/// Distance between the samples of `sky_along`, in meters.
pub(super) const SKY_SAMPLE_SPACING_M: f64 = 4.0;

/// Radius of a disk with about the area of a portal, in meters.
const PORTAL_RADIUS_M: f64 = 5.0;

impl City {
    /// Returns whether `s` is inside the tunnel or closer than `margin` to the tunnel. Lots in this range must stay
    /// empty.
    pub(super) fn in_tunnel(&self, s: f64, margin: f64) -> bool {
        self.tunnel.is_some_and(|(a, b)| s > a - margin && s < b + margin)
    }

    /// Returns a number between 0 and 1 that increases with the distance of `s` from the nearest tunnel end. The number
    /// is 0 outside the tunnel, and 1 at 3 m or more from both ends.
    pub(crate) fn tunnel_share(&self, s: f64) -> f32 {
        self.tunnel.map_or(0.0, |(a, b)| (((s - a).min(b - s) / 3.0).clamp(0.0, 1.0)) as f32)
    }

    /// Returns the illuminance inside the tunnel by the street in front of a portal, divided by the illuminance by the
    /// street outside. The result is 0 outside the tunnel.
    ///
    /// The portal is a bright disk of radius R, and a wall at the distance x from the disk sees half of it at most: the
    /// fraction is (1 - x / sqrt(x^2 + R^2)) / 2.
    pub(crate) fn portal_share(&self, s: f64) -> f32 {
        let share = |x: f64| 0.5 * (1.0 - x / libm::hypot(x, PORTAL_RADIUS_M));
        let inside = self.tunnel.filter(|&(a, b)| s > a && s < b);
        inside.map_or(0.0, |(a, b)| (share(s - a) + share(b - s)) as f32)
    }

    /// Returns the fraction of the sky that is visible from a vehicle on the road at `s`.
    pub(crate) fn sky_at(&self, s: f64) -> f32 {
        let x = ((s - self.start_s) / SKY_SAMPLE_SPACING_M).clamp(0.0, (self.sky_along.len() - 2) as f64);
        let (i, t) = (x as usize, (x - x.floor()) as f32);
        self.sky_along[i] * (1.0 - t) + self.sky_along[i + 1] * t
    }
}

/// Returns the texture coordinates of the four corners of a rectangle from the origin to (u, v), in order around the
/// rectangle.
pub(super) fn uv_rect(u: f32, v: f32) -> [Vec2; 4] {
    [Vec2::ZERO, Vec2::new(u, 0.0), Vec2::new(u, v), Vec2::new(0.0, v)]
}
