//! A scene, which consists of a city, traffic and light. One seed determines the whole scene.

use std::sync::OnceLock;

use glam::Vec3;

use super::city::City;
use super::drive::camera::{Intrinsics, Mount, PinholeCamera};
use super::drive::traffic::{Traffic, TrafficOptions};
use super::drive::traffic_vehicle::Vehicle;
use super::drive::vehicle_motion::{VehicleMotion, VehicleState, vehicle_state};
use super::lighting::{LAMP_RANGE_M, Light, Lighting};
use super::optics::exposure::{Exposure, ExposureCurve};
use super::optics::image_formation::ImageFormation;
use super::optics::lens::Lens;
use super::options::{MIN_RANDOM_SPEED_KMH, SceneOptions, check_options};
use super::random::Draws;
use super::shapes::grid::Grid;
use super::shapes::lamp_shadows::{LampShadows, POST_RADIUS_M};
use super::shapes::mesh::TRIANGLE_BITS;
use super::shapes::sun_shadows::SunShadows;
use spikelane::error::{Result, error};
use spikelane::unstable::Count;

/// Length of the road behind the start of the drive, in meters. `ROAD_AHEAD_M` is the length of the road beyond the
/// end of the drive.
const ROAD_BEHIND_M: f64 = 120.0;
const ROAD_AHEAD_M: f64 = 420.0;
/// A random city with traffic and light, and a camera that drives through the city.
///
/// # Examples
/// ```
/// use spikelane_scene::{Lighting, Scene, SceneOptions};
/// let options = SceneOptions::default().with_lighting(Some(Lighting::Dusk)).with_duration_s(1.0);
/// let scene = Scene::from_seed(7, &options)?;
/// assert_eq!((scene.lighting(), scene.duration_s()), (Lighting::Dusk, 1.0));
/// assert_eq!(scene.camera(2.0).unwrap_err().parts().expected, "0 to 1 s");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
pub struct Scene {
    pub(super) seed: u64,
    pub(super) lighting: Lighting,
    pub(super) duration_s: f64,
    pub(super) intrinsics: Intrinsics,
    pub(super) road_span: (f64, f64),
    pub(super) city: City,
    pub(super) traffic: Traffic,
    /// Arc length and distance from the center line of every vehicle at the start of the drive. Parked vehicles stay
    /// there.
    pub(super) parked_places: Vec<(f64, f64)>,
    pub(super) mount: Mount,
    pub(super) light: Light,
    pub(super) lamp_grid: Grid,
    lens: Lens,
    pub(super) image_formation: ImageFormation,
    pub(super) exposure: Exposure,
    /// White during the drive. It is computed at the first query.
    pub(super) exposure_curve: OnceLock<ExposureCurve>,
    /// Shadows of the sun or moon. They are computed at the first shadow query.
    sun_shadows: OnceLock<SunShadows>,
    /// Shadows of each lamp. They are computed at the first query for the lamp.
    lamp_shadows: Vec<OnceLock<LampShadows>>,
}

impl Scene {
    /// Builds the scene that `seed` determines.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if an option is outside its range, or if the drive is longer than 5 km.
    /// * [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the system cannot allocate the memory of the scene.
    pub fn from_seed(seed: u64, options: &SceneOptions) -> Result<Self> {
        let draws = Draws::new(seed, "scene");
        let lighting = options.lighting.unwrap_or_else(|| Lighting::from_seed(seed));
        let speed_kmh = options.speed_kmh.unwrap_or_else(|| draws.range(1, MIN_RANDOM_SPEED_KMH, 100.0));
        let fov_deg = options.fov_deg.unwrap_or_else(|| draws.range(2, 58.0, 80.0));
        let lens = options.lens.unwrap_or_else(|| Lens::from_seed(seed));
        let options = &options.clone().with_lens(Some(lens));
        let intrinsics = check_options(options, speed_kmh, fov_deg)?;
        let ego_mps = speed_kmh / 3.6;
        let span = (-ROAD_BEHIND_M, ego_mps * options.duration_s + ROAD_AHEAD_M);
        // The portal of the tunnel is at half of the distance of the drive. Most drives leave the tunnel, and some enter it.
        let portal = (0.5 * ego_mps * options.duration_s).max(12.0);
        let enters = draws.chance(3, 0.35);
        let tunnel = (lighting == Lighting::Tunnel).then_some(if enters {
            (portal, span.1 - 4.0)
        } else {
            (span.0 + 4.0, portal)
        });
        let city = City::from_seed(seed, span.0, span.1, tunnel)?;
        let demand = TrafficOptions {
            ego_mps,
            duration_s: options.duration_s,
            cars: options.vehicles,
            span,
            tunnel: tunnel.is_some(),
        };
        let traffic = Traffic::from_seed(seed, &city.road, &demand);
        check_counts(&city, &traffic)?;
        let place = |v: &Vehicle| match &v.motion {
            VehicleMotion::Parked { at, .. } => city.road.locate(at.x as f32, at.y as f32),
            VehicleMotion::Lane { .. } => v.motion.lane_place(0.0).unwrap_or_default(),
        };
        let parked_places = traffic.vehicles.iter().map(place).collect();
        let reach = LAMP_RANGE_M;
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
            road_span: span,
            lamp_grid: Grid::new(8.0, &lamps),
            sun_shadows: OnceLock::new(),
            lamp_shadows: lamps.iter().map(|_| OnceLock::new()).collect(),
            light: Light::from_seed(seed, lighting, options.flicker_hz),
            mount: Mount::from_seed(seed),
            parked_places,
            lens,
            image_formation: ImageFormation::new(lens, options.width as usize, options.height as usize),
            exposure: options.exposure,
            exposure_curve: OnceLock::new(),
            city,
            traffic,
        })
    }

    /// Returns the seed that determines the scene.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// Returns the lighting preset of the options. If the options contain no preset, returns the preset that the seed
    /// selects.
    #[must_use]
    pub const fn lighting(&self) -> Lighting {
        self.lighting
    }

    /// Returns the duration of the drive in seconds. Valid times are 0 to this duration.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the lens of the options. If the options contain no lens, returns the lens that the seed selects.
    #[must_use]
    pub const fn lens(&self) -> Lens {
        self.lens
    }

    /// Returns the scene with a lens that does not distort. The blur and the other properties of the lens remain.
    ///
    /// The labels of this scene are the labels of a pinhole camera.
    #[must_use]
    pub fn without_distortion(mut self) -> Self {
        self.lens = self.lens.without_distortion();
        self.intrinsics.distortion = 0.0;
        self
    }

    /// Returns the number of vehicles, not including the camera's car. Track ids are 1 to this number.
    #[must_use]
    pub fn vehicles(&self) -> u32 {
        self.traffic.vehicles.len() as u32
    }

    /// Returns the pose and the intrinsics of the camera at time `t` in seconds.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `t` is outside the drive.
    pub fn camera(&self, t: f64) -> Result<PinholeCamera> {
        self.check_time(t)?;
        Ok(self.camera_unchecked(t))
    }

    pub(super) fn check_time(&self, t: f64) -> Result<()> {
        if (0.0..=self.duration_s).contains(&t) {
            return Ok(());
        }
        Err(error!(Usage, "scene time"; found "{t} s"; expected "0 to {} s", self.duration_s;
            remedy "create the scene with a longer duration"))
    }

    /// Returns for each of four points whether the city occludes lamp number `lamp`.
    pub(super) fn are_hidden_from_lamp(&self, lamp: u16, points: [Vec3; 4]) -> [bool; 4] {
        let position = self.city.lamps[usize::from(lamp)].position;
        let build_shadows = || LampShadows::new(self.city.bvh.triangles(), position, LAMP_RANGE_M);
        let are_blocked = self.lamp_shadows[usize::from(lamp)].get_or_init(build_shadows).are_blocked(points);
        [0, 1, 2, 3].map(|i| {
            are_blocked[i].unwrap_or_else(|| {
                let to = position - points[i];
                self.city.bvh.is_blocked(points[i], to.normalize_or_zero(), 0.0, to.length() - POST_RADIUS_M)
            })
        })
    }

    /// Returns the shadows of the city in the light of the sun or moon.
    pub(super) fn sun_shadows(&self) -> &SunShadows {
        self.sun_shadows
            .get_or_init(|| SunShadows::new(self.city.mesh.triangle_corners(), self.light.sun_direction))
    }

    pub(super) fn vehicle_state(&self, motion: &VehicleMotion, t: f64) -> VehicleState {
        vehicle_state(&self.city.road, motion, t, self.road_span)
    }

    pub(super) fn camera_unchecked(&self, t: f64) -> PinholeCamera {
        let stance = self.vehicle_state(&self.traffic.ego, t);
        PinholeCamera {
            intrinsics: self.intrinsics,
            pose: self.mount.pose(&stance, t),
            speed_mps: stance.speed,
        }
    }
}

/// Checks that 32 bits are sufficient for the part number and the triangle number of every sample in the visibility
/// buffer.
fn check_counts(city: &City, traffic: &Traffic) -> Result<()> {
    let triangles = city.mesh.triangles.len();
    let parts: usize = traffic.vehicles.iter().map(|v| 1 + traffic.shapes[v.shape].axles.len()).sum();
    let (max_triangles, most_parts) = (1 << TRIANGLE_BITS, (1 << (32 - TRIANGLE_BITS)) - 2);
    if triangles < max_triangles && parts < most_parts {
        return Ok(());
    }
    Err(error!(Usage, "scene"; found "{}, {}", Count(triangles, "triangle"), Count(parts, "moving part");
        expected "fewer than {max_triangles} and {most_parts}";
        remedy "shorten or slow down the drive, or split it into several scenes"))
}
