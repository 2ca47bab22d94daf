//! Options of a scene, and the limits that apply to every scene.

use super::drive::camera::Intrinsics;
use super::lighting::Lighting;
use super::optics::exposure::Exposure;
use super::optics::lens::Lens;
use spikelane::error::{Result, bail, error};
use spikelane::spikes::Geometry;

/// Maximum length of a drive in meters. A longer drive is rejected before the city is built.
const MAX_DRIVE_M: f64 = 5_000.0;

/// Minimum of the random speeds that are drawn from the seed, in km/h.
pub(super) const MIN_RANDOM_SPEED_KMH: f64 = 45.0;

/// Options of a scene. If an option is `None`, the seed determines the option.
///
/// # Examples
/// ```
/// use spikelane_scene::SceneOptions;
/// let options = SceneOptions::default().with_speed_kmh(Some(50.0)).with_vehicles(Some(0));
/// options.check()?;
/// let error = options.with_speed_kmh(Some(500.0)).check().unwrap_err();
/// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneOptions {
    /// Number of columns of the image.
    pub width: u32,
    /// Number of rows of the image.
    pub height: u32,
    /// Horizontal field of view in degrees, 5 to 150.
    pub fov_deg: Option<f64>,
    /// Lighting preset.
    pub lighting: Option<Lighting>,
    /// Duration of the drive in seconds, at most 120. Rendering an instant outside the drive is an error.
    pub duration_s: f64,
    /// Desired speed of the camera's car in km/h, 1 to 300. Traffic ahead can slow the car down.
    pub speed_kmh: Option<f64>,
    /// Number of vehicles, including parked vehicles but not the camera's car. Zero is permitted.
    pub vehicles: Option<u32>,
    /// Flicker frequency of the lamps in hertz. Lamps on mains power flicker at 100 or 120 Hz.
    pub flicker_hz: Option<f64>,
    /// Lens of the camera.
    pub lens: Option<Lens>,
    /// Exposure of the camera. The seed does not affect this option.
    pub exposure: Exposure,
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
    with_lens: lens: Option<Lens>,
    with_exposure: exposure: Exposure,
});

impl SceneOptions {
    /// Checks the options. No scene is built.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if an option is outside its range. If `speed_kmh` is `None`, the check uses the lowest
    /// speed that a seed can select. At a higher speed, [`Scene::from_seed`](super::Scene::from_seed) may still reject
    /// the drive as too long.
    pub fn check(&self) -> Result<()> {
        check_options(self, self.speed_kmh.unwrap_or(MIN_RANDOM_SPEED_KMH), self.fov_deg.unwrap_or(60.0))
            .map(drop)
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
            lens: None,
            exposure: Exposure::default(),
        }
    }
}

/// Checks the options. Returns the intrinsics of the scene's camera.
pub(super) fn check_options(options: &SceneOptions, speed_kmh: f64, fov_deg: f64) -> Result<Intrinsics> {
    Geometry::new(options.width, options.height)?;
    let within = |name: &str, value: f64, low: f64, high: f64, unit: &str, remedy: &str| {
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(error!(Usage, "{name}"; found "{value} {unit}"; expected "{low} to {high} {unit}";
            remedy "{remedy}"))
    };
    within(
        "field of view",
        fov_deg,
        5.0,
        150.0,
        "degrees",
        "a pinhole camera shows less than half of all directions",
    )?;
    within("speed", speed_kmh, 1.0, 300.0, "km/h", "set the speed in km/h")?;
    within(
        "scene duration",
        options.duration_s,
        1e-3,
        120.0,
        "s",
        "split a longer drive into several scenes",
    )?;
    if let Some(hz) = options.flicker_hz {
        within(
            "lamp flicker",
            hz,
            1.0,
            10_000.0,
            "Hz",
            "lamps flicker at twice the mains frequency, 100 or 120 Hz",
        )?;
    }
    let aspect = f64::from(options.width) / f64::from(options.height);
    within("width over height", aspect, 0.1, 10.0, "", "use a shape closer to a square")?;
    within(
        "image side",
        f64::from(options.width.max(options.height)),
        1.0,
        16_384.0,
        "pixels",
        "render a smaller image",
    )?;
    let distance = speed_kmh / 3.6 * options.duration_s;
    if distance > MAX_DRIVE_M {
        bail!(Usage, "drive"; found "{distance:.0} m"; expected "at most {MAX_DRIVE_M} m";
            remedy "shorten or slow down the drive, or split it into several scenes");
    }
    options.exposure.check()?;
    let half = 0.5 * f64::from(options.width);
    let intrinsics = Intrinsics {
        width: options.width,
        height: options.height,
        focal_px: half / libm::tan((0.5 * fov_deg).to_radians()),
        center_px: [half, 0.5 * f64::from(options.height)],
        distortion: 0.0,
    };
    let Some(lens) = options.lens else { return Ok(intrinsics) };
    lens.check()?;
    Ok(Intrinsics { distortion: lens.division_lambda(&intrinsics), ..intrinsics })
}
