//! The scene: its city, its traffic and its light, all from one seed.

use std::sync::OnceLock;

use glam::Vec3;

use super::city::City;
use super::drive::camera::{Camera, Intrinsics, Mount};
use super::drive::motion::{Motion, Stance, stance_of};
use super::drive::traffic::{Demand, Traffic};
use super::lighting::{LAMP_REACH_M, Light, Lighting};
use super::options::{SLOWEST_KMH, SceneOptions, check};
use super::random::Draws;
use super::shapes::grid::Grid;
use super::shapes::lampward::{Lampward, POST_M};
use super::shapes::mesh::TRIANGLE_BITS;
use super::shapes::sunward::Sunward;
use spikelane::error::{Error, Kind, Result};

/// Road that exists behind the start and beyond the end of the drive.
const BEHIND_M: f64 = 120.0;
const AHEAD_M: f64 = 420.0;
/// A seeded city with its traffic, its light, and a camera that drives through.
#[derive(Debug)]
pub struct Scene {
    pub(super) seed: u64,
    pub(super) lighting: Lighting,
    pub(super) duration_s: f64,
    pub(super) intrinsics: Intrinsics,
    pub(super) span: (f64, f64),
    pub(super) city: City,
    pub(super) traffic: Traffic,
    pub(super) mount: Mount,
    pub(super) light: Light,
    pub(super) lamp_grid: Grid,
    /// Made when a shadow is first asked for.
    sunward: OnceLock<Sunward>,
    /// Of each lamp, made when its shadows are first asked for.
    lampward: Vec<OnceLock<Lampward>>,
}

impl Scene {
    /// The scene of `seed`.
    ///
    /// # Errors
    /// When an option lies outside its range, or the drive is too long for one
    /// scene (several kilometres).
    pub fn random(seed: u64, options: &SceneOptions) -> Result<Self> {
        let draws = Draws::new(seed, "scene");
        let lighting = options.lighting.unwrap_or_else(|| Lighting::drawn(seed));
        let speed_kmh = options.speed_kmh.unwrap_or_else(|| draws.range(1, SLOWEST_KMH, 100.0));
        let fov_deg = options.fov_deg.unwrap_or_else(|| draws.range(2, 58.0, 80.0));
        let intrinsics = check(options, speed_kmh, fov_deg)?;
        let ego_mps = speed_kmh / 3.6;
        let span = (-BEHIND_M, ego_mps * options.duration_s + AHEAD_M);
        // The camera leaves the tunnel half way through.
        let exit = (0.5 * ego_mps * options.duration_s).max(12.0);
        let tunnel = (lighting == Lighting::Tunnel).then_some((span.0 + 4.0, exit));
        let city = City::random(seed, span.0, span.1, tunnel);
        let demand = Demand {
            ego_mps,
            duration_s: options.duration_s,
            cars: options.vehicles,
            span,
            tunnel: tunnel.is_some(),
        };
        let traffic = Traffic::random(seed, &city.road, &demand);
        check_counts(&city, &traffic)?;
        let reach = LAMP_REACH_M;
        let lamps: Vec<_> = city
            .lamps
            .iter()
            .enumerate()
            .map(|(i, l)| (l.position.truncate() - reach, l.position.truncate() + reach, i as u16))
            .collect();
        Ok(Self {
            seed,
            lighting,
            duration_s: options.duration_s,
            intrinsics,
            span,
            lamp_grid: Grid::new(8.0, &lamps),
            sunward: OnceLock::new(),
            lampward: lamps.iter().map(|_| OnceLock::new()).collect(),
            light: Light::random(seed, lighting, options.flicker_hz),
            mount: Mount::random(seed),
            city,
            traffic,
        })
    }

    /// The seed that everything follows from.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// The light, asked for or drawn.
    #[must_use]
    pub const fn lighting(&self) -> Lighting {
        self.lighting
    }

    /// Instants from 0 to this many seconds exist.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The luminance in cd/m2 that a well-exposed camera would call white:
    /// divide by it for linear light in 0..1. Highlights, lamps, and the
    /// daylight at a tunnel's end lie above.
    #[must_use]
    pub const fn white_cd_m2(&self) -> f32 {
        self.light.white_cd_m2
    }

    /// Vehicles in the scene, the camera's own not counted; track ids run from 1 to this.
    #[must_use]
    pub fn vehicles(&self) -> u32 {
        self.traffic.vehicles.len() as u32
    }

    /// Pose and intrinsics at `t`.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn camera(&self, t: f64) -> Result<Camera> {
        self.check_time(t)?;
        Ok(self.camera_unchecked(t))
    }

    pub(super) fn check_time(&self, t: f64) -> Result<()> {
        if (0.0..=self.duration_s).contains(&t) {
            return Ok(());
        }
        Err(Error::new(Kind::Usage, "scene time")
            .found(format_args!("{t} s"))
            .expected(format_args!("0 to {} s", self.duration_s))
            .remedy("ask for a longer duration when the scene is made"))
    }

    /// Whether the city stands between a point and the lamp of this number.
    pub(super) fn hides_lamp(&self, lamp: u16, from: Vec3) -> bool {
        let position = self.city.lamps[usize::from(lamp)].position;
        let made = || Lampward::new(self.city.bvh.triangles(), position, LAMP_REACH_M);
        let found = self.lampward[usize::from(lamp)].get_or_init(made).blocked(from);
        found.unwrap_or_else(|| {
            let to = position - from;
            self.city.bvh.blocked(from, to.normalize_or_zero(), 0.0, to.length() - POST_M)
        })
    }

    /// What stands between places of the city and its sun or moon.
    pub(super) fn sunward(&self) -> &Sunward {
        self.sunward.get_or_init(|| Sunward::new(self.city.mesh.soup(), self.light.sun_way))
    }

    pub(super) fn stance(&self, motion: &Motion, t: f64) -> Stance {
        stance_of(&self.city.road, motion, t, self.span)
    }

    pub(super) fn camera_unchecked(&self, t: f64) -> Camera {
        let stance = self.stance(&self.traffic.ego, t);
        Camera { intrinsics: self.intrinsics, pose: self.mount.pose(&stance, t), speed_mps: stance.speed }
    }
}

/// A sample of the visibility buffer names its part and triangle in 32 bits.
fn check_counts(city: &City, traffic: &Traffic) -> Result<()> {
    let triangles = city.mesh.triangles.len();
    let parts: usize = traffic.vehicles.iter().map(|v| 1 + traffic.shapes[v.shape].axles.len()).sum();
    let (most, most_parts) = (1 << TRIANGLE_BITS, (1 << (32 - TRIANGLE_BITS)) - 2);
    if triangles < most && parts < most_parts {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, "scene")
        .found(format_args!("{triangles} triangles, {parts} moving parts"))
        .expected(format_args!("fewer than {most} and {most_parts}"))
        .remedy("shorten the drive or slow it down; several scenes cover a longer one"))
}
