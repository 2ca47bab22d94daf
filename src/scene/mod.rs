//! Random high-speed driving scenes, drawn on the CPU, with exact labels.
//!
//! A [`Scene`] is a city, its traffic and its light, all from one seed. It is
//! a function of time: any instant of its duration can be asked for, in any
//! order, and the same seed gives the same bytes on any number of threads.
//!
//! ```
//! use spikelane::scene::{Lighting, Samples, Scene, SceneOptions};
//! let options = SceneOptions { width: 64, height: 40, lighting: Some(Lighting::Noon), ..SceneOptions::default() };
//! let scene = Scene::random(7, &options)?;
//! let frame = scene.render(0.5, Samples::Four, 1)?;
//! assert_eq!(frame.light.len(), 64 * 40);
//! # Ok::<(), spikelane::Error>(())
//! ```
//!
//! Distances are metres, times seconds, light is photometric (cd/m2). How it
//! is done, and what it leaves out, is in `docs/reference/scenes.md`.

mod boxes;
mod bvh;
mod camera;
mod city;
mod facade;
mod flow;
mod follow;
mod fragment;
mod frame;
mod grid;
mod keyframes;
pub mod labels;
mod lighting;
mod loft;
mod material;
mod mesh;
mod motion;
mod parallel;
mod random;
mod raster;
mod render;
mod road;
mod shade;
mod texture;
mod traffic;
mod vehicle;
mod warp;

pub use boxes::VehicleBox;
pub use camera::{Camera, Intrinsics, Pose};
pub use flow::Flow;
pub use glam::{DMat3, DVec3};
pub use keyframes::KeyPlan;
pub use lighting::Lighting;
pub use material::Semantic;
pub use render::{Labels, Rendered, Samples};
pub use vehicle::VehicleClass;
pub use warp::Warp;

use crate::error::{Error, Kind, Result};
use crate::spikes::Geometry;

use city::City;
use frame::Frame;
use grid::Grid;
use lighting::Light;
use motion::{Motion, Stance};
use random::Draws;
use traffic::{Demand, Traffic};

/// Road that exists behind the start and beyond the end of the drive.
const BEHIND_M: f64 = 120.0;
const AHEAD_M: f64 = 420.0;
/// Longer drives are refused before their city is built.
const LONGEST_M: f64 = 5_000.0;

/// The slowest speed that a seed chooses.
const SLOWEST_KMH: f64 = 45.0;

/// What a scene is asked to be; what is left open follows from the seed.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneOptions {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Horizontal field of view in degrees, 5 to 150.
    pub fov_deg: Option<f64>,
    /// The light.
    pub lighting: Option<Lighting>,
    /// How long the drive lasts in seconds, up to 120; instants outside are refused.
    pub duration_s: f64,
    /// Speed that the camera's car wishes to drive in km/h, 1 to 300; traffic
    /// ahead may hold it up.
    pub speed_kmh: Option<f64>,
    /// Vehicles in the scene besides the camera's, parked ones included; zero is allowed.
    pub vehicles: Option<u32>,
    /// Lamps flicker with this frequency in hertz (100 or 120 on the mains).
    pub flicker_hz: Option<f64>,
}

impl SceneOptions {
    /// Refuses what no seed could make a scene of, without building one.
    ///
    /// # Errors
    /// As [`Scene::random`]; a drive at the speed that a seed chooses may still be too long.
    pub fn check(&self) -> Result<()> {
        check(self, self.speed_kmh.unwrap_or(SLOWEST_KMH), self.fov_deg.unwrap_or(60.0)).map(drop)
    }
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            width: 400,
            height: 250,
            fov_deg: None,
            lighting: None,
            duration_s: 4.0,
            speed_kmh: None,
            vehicles: None,
            flicker_hz: None,
        }
    }
}

/// A seeded city with its traffic, its light, and a camera that drives through.
#[derive(Debug)]
pub struct Scene {
    seed: u64,
    lighting: Lighting,
    duration_s: f64,
    intrinsics: Intrinsics,
    span: (f64, f64),
    city: City,
    traffic: Traffic,
    mount: camera::Mount,
    light: Light,
    lamp_grid: Grid,
}

impl Scene {
    /// The scene of `seed`.
    ///
    /// # Errors
    /// When an option lies outside its range, or the drive is too long for one
    /// scene (several kilometres).
    pub fn random(seed: u64, options: &SceneOptions) -> Result<Self> {
        let draws = Draws::new(seed, "scene");
        let lighting = options.lighting.unwrap_or(Lighting::ALL[draws.pick(0, Lighting::ALL.len())]);
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
        let reach = shade::LAMP_REACH_M;
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
            light: Light::random(seed, lighting, options.flicker_hz),
            mount: camera::Mount::random(seed),
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

    /// Light and labels at `t`, on `threads` threads.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn render(&self, t: f64, samples: Samples, threads: usize) -> Result<Rendered> {
        self.check_time(t)?;
        Ok(render::render(&Frame::new(self, t), samples, threads))
    }

    /// The labels of pixel centres alone: several times faster than a render.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn labels(&self, t: f64, threads: usize) -> Result<Labels> {
        self.check_time(t)?;
        Ok(render::labels(&Frame::new(self, t), threads))
    }

    fn check_time(&self, t: f64) -> Result<()> {
        if (0.0..=self.duration_s).contains(&t) {
            return Ok(());
        }
        Err(Error::new(Kind::Usage, "scene time")
            .found(format_args!("{t} s"))
            .expected(format_args!("0 to {} s", self.duration_s))
            .remedy("ask for a longer duration when the scene is made"))
    }

    fn stance(&self, motion: &Motion, t: f64) -> Stance {
        motion::stance_of(&self.city.road, motion, t, self.span)
    }

    fn camera_unchecked(&self, t: f64) -> Camera {
        let stance = self.stance(&self.traffic.ego, t);
        Camera { intrinsics: self.intrinsics, pose: self.mount.pose(&stance, t), speed_mps: stance.speed }
    }
}

/// A sample of the visibility buffer names its part and triangle in 32 bits.
fn check_counts(city: &City, traffic: &Traffic) -> Result<()> {
    let triangles = city.mesh.triangles.len();
    let parts: usize = traffic.vehicles.iter().map(|v| 1 + traffic.shapes[v.shape].axles.len()).sum();
    let (most, most_parts) = (1 << raster::TRIANGLE_BITS, (1 << (32 - raster::TRIANGLE_BITS)) - 2);
    if triangles < most && parts < most_parts {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, "scene")
        .found(format_args!("{triangles} triangles, {parts} moving parts"))
        .expected(format_args!("fewer than {most} and {most_parts}"))
        .remedy("shorten the drive or slow it down; several scenes cover a longer one"))
}

fn check(options: &SceneOptions, speed_kmh: f64, fov_deg: f64) -> Result<Intrinsics> {
    Geometry::new(options.width, options.height)?;
    let within = |name: &str, value: f64, low: f64, high: f64, unit: &str, remedy: &str| {
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(Error::new(Kind::Usage, name)
            .found(format_args!("{value} {unit}"))
            .expected(format_args!("{low} to {high} {unit}"))
            .remedy(remedy))
    };
    within(
        "field of view",
        fov_deg,
        5.0,
        150.0,
        "degrees",
        "a pinhole sees less than half of all directions",
    )?;
    within("speed", speed_kmh, 1.0, 300.0, "km/h", "give the speed in km/h")?;
    within("scene duration", options.duration_s, 1e-3, 120.0, "s", "split a longer drive into scenes")?;
    if let Some(hz) = options.flicker_hz {
        within("lamp flicker", hz, 1.0, 10_000.0, "Hz", "lamps on the mains flicker at 100 or 120 Hz")?;
    }
    let aspect = f64::from(options.width) / f64::from(options.height);
    within("width over height", aspect, 0.1, 10.0, "", "use a less extreme shape")?;
    within(
        "image side",
        f64::from(options.width.max(options.height)),
        1.0,
        16_384.0,
        "pixels",
        "render at a smaller size",
    )?;
    let distance = speed_kmh / 3.6 * options.duration_s;
    if distance > LONGEST_M {
        return Err(Error::new(Kind::Usage, "drive")
            .found(format_args!("{distance:.0} m"))
            .expected(format_args!("up to {LONGEST_M} m"))
            .remedy("shorten the drive or slow it down; several scenes cover a longer one"));
    }
    let half = 0.5 * f64::from(options.width);
    Ok(Intrinsics {
        width: options.width,
        height: options.height,
        focal_px: half / libm::tan((0.5 * fov_deg).to_radians()),
        centre_px: [half, 0.5 * f64::from(options.height)],
    })
}
