//! What a scene is asked to be, and what no seed could make.

use super::drive::camera::Intrinsics;
use super::lighting::Lighting;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

/// Longer drives are refused before their city is built.
const LONGEST_M: f64 = 5_000.0;

/// The slowest speed that a seed chooses.
pub(super) const SLOWEST_KMH: f64 = 45.0;

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

spikelane::unstable::with_methods!(SceneOptions {
    with_width: width: u32,
    with_height: height: u32,
    with_fov_deg: fov_deg: Option<f64>,
    with_lighting: lighting: Option<Lighting>,
    with_duration_s: duration_s: f64,
    with_speed_kmh: speed_kmh: Option<f64>,
    with_vehicles: vehicles: Option<u32>,
    with_flicker_hz: flicker_hz: Option<f64>,
});

impl SceneOptions {
    /// Refuses what no seed could make a scene of, without building one.
    ///
    /// # Errors
    /// As [`Scene::random`](super::Scene::random); a drive at the speed that a seed chooses may still be too long.
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

/// Whether a scene of these options can be built; the camera that it would have.
pub(super) fn check(options: &SceneOptions, speed_kmh: f64, fov_deg: f64) -> Result<Intrinsics> {
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
