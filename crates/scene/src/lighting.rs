//! Lighting presets in photometric units. The luminances of the presets differ by up to five orders of magnitude.
//!
//! Illuminances are in lux, luminances in cd/m2 and intensities in candela. A quantity with color is a vector in
//! linear sRGB. The luminance of this vector equals the quantity.

use glam::Vec3;

use spikelane::unstable::variant_names;

use super::random::Draws;

/// Range of a street lamp in meters. Points farther from the lamp receive no light.
pub(super) const LAMP_RANGE_M: f32 = 26.0;

/// A time of day and weather.
///
/// # Examples
/// ```
/// use spikelane_scene::Lighting;
/// for lighting in Lighting::ALL {
///     assert_eq!(Lighting::from_name(lighting.name()), Some(lighting));
/// }
/// assert_eq!(Lighting::from_name("noon"), Some(Lighting::Noon));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Lighting {
    /// High sun, blue sky and a few clouds.
    Noon,
    /// Low, warm sun and long shadows.
    LowSun,
    /// Sky that is completely covered by clouds.
    Overcast,
    /// Twilight after sunset. The lamps have just been switched on.
    Dusk,
    /// Night with street lamps, headlights, tail lights and lit windows.
    Night,
    /// Tunnel with lamps and a bright exit.
    Tunnel,
    /// Rain clouds and a wet road.
    Rain,
}

// In descending order of their light.
variant_names!(Lighting {
    Noon = "noon", LowSun = "low-sun", Overcast = "overcast", Rain = "rain", Tunnel = "tunnel", Dusk = "dusk",
    Night = "night",
});

impl Lighting {
    /// Returns the preset that `seed` selects.
    #[must_use]
    pub fn from_seed(seed: u64) -> Self {
        Self::ALL[Draws::new(seed, "scene").index_below(0, Self::ALL.len())]
    }

    /// Returns the preset with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|l| l.name() == name)
    }
}

/// All light sources of a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Unit vector that points to the sun or moon.
    pub sun_direction: Vec3,
    /// Illuminance by the sun or moon on a surface that faces the sun or moon.
    pub sun_illuminance: Vec3,
    /// Luminance of the sky at the zenith. `horizon_luminance` is the luminance near the horizon.
    pub zenith_luminance: Vec3,
    pub horizon_luminance: Vec3,
    /// Additional luminance of the sky near the horizon, around the direction of the sun.
    pub sun_glow: Vec3,
    /// Cloud cover, 0 to 1.
    pub cloud_cover: f32,
    /// Peak intensity of a street lamp.
    pub lamp_cd: f32,
    pub lamp_tint: Vec3,
    /// Peak intensity of a pair of headlights. The value is zero if headlights are off.
    pub headlight_cd: f32,
    /// Luminance of a lit window.
    pub window_cd_m2: f32,
    /// Illuminance on the road inside the tunnel.
    pub tunnel_lux: f32,
    /// Distance in meters at which haze reduces contrast by the factor 1/e.
    pub haze_length_m: f32,
    /// Amount of water on the road, 0 to 1.
    pub wetness: f32,
    /// Maximum luminance in the sharp part of the image. The rest of the light of a lamp is only in its glare.
    ///
    /// The limit is a few times white, so the lamps remain white. A lamp is up to 3,000 times brighter than white. With
    /// sixteen samples, the light of its edge pixels would then have errors of 150 times white.
    pub max_sharp_cd_m2: f32,
    /// Frequency in hertz and relative depth of the flicker of the lamps. `None` if the lamps do not flicker.
    pub flicker: Option<(f64, f32)>,
}

/// Ambient light. It consists of the light of the open sky, and of light that is reflected by ground and facades.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AmbientLight {
    /// Illuminance by the open sky on a horizontal surface.
    pub sky_lux: Vec3,
    /// Illuminance from directions in which the sky is hidden.
    pub non_sky_lux: Vec3,
    /// Horizontal unit vector that points to the sun or moon.
    pub horizontal_sun_direction: Vec3,
}

/// Returns the color (r, g, b), scaled to luminance 1.
fn tint(r: f32, g: f32, b: f32) -> Vec3 {
    let c = Vec3::new(r, g, b);
    c / luminance(c)
}

/// Returns the luminance of a linear sRGB color (IEC 61966-2-1).
pub(super) fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::from(spikelane::light::LUMINANCE_WEIGHTS))
}

impl Light {
    /// Returns the light of `preset`. The seed varies the light within the preset.
    pub(crate) fn from_seed(seed: u64, preset: Lighting, flicker_hz: Option<f64>) -> Self {
        let draws = Draws::new(seed, "light");
        // Roads run along the x axis. If a low sun did not shine along the street, the building fronts would block all
        // direct light.
        let along =
            draws.range(9, -0.75, 0.75) + if draws.chance(10, 0.5) { std::f64::consts::PI } else { 0.0 };
        let azimuth = if matches!(preset, Lighting::LowSun | Lighting::Dusk) {
            along
        } else {
            draws.range(0, 0.0, std::f64::consts::TAU)
        };
        let direction = |degrees: f64| {
            let (s, c) = libm::sincos(degrees.to_radians());
            let (sa, ca) = libm::sincos(azimuth);
            Vec3::new((c * ca) as f32, (c * sa) as f32, s as f32)
        };
        let vary = draws.range_f32(1, 0.85, 1.15);
        let base = Self {
            sun_direction: direction(draws.range(2, 42.0, 62.0)),
            sun_illuminance: tint(1.05, 1.0, 0.90) * 90_000.0 * vary,
            zenith_luminance: tint(0.45, 0.95, 2.1) * 2_600.0,
            horizon_luminance: tint(0.80, 1.0, 1.45) * 7_000.0,
            sun_glow: tint(1.0, 1.0, 0.9) * 2_500.0,
            cloud_cover: draws.range_f32(3, 0.1, 0.5),
            lamp_cd: 0.0,
            lamp_tint: if draws.chance(4, 0.5) { tint(1.0, 0.72, 0.38) } else { tint(1.0, 0.94, 0.82) },
            headlight_cd: 0.0,
            window_cd_m2: 0.0,
            tunnel_lux: 0.0,
            haze_length_m: draws.range_f32(5, 1_200.0, 2_500.0),
            wetness: 0.0,
            max_sharp_cd_m2: f32::INFINITY,
            flicker: flicker_hz.map(|hz| (hz, draws.range_f32(6, 0.35, 0.8))),
        };
        base.preset(preset, draws, direction(draws.range(7, 7.0, 16.0)), direction(35.0), vary)
    }

    fn preset(self, preset: Lighting, draws: Draws, low: Vec3, moon: Vec3, vary: f32) -> Self {
        match preset {
            Lighting::Noon => self,
            Lighting::LowSun => Self {
                sun_direction: low,
                sun_illuminance: tint(1.45, 0.92, 0.45) * 32_000.0 * vary,
                zenith_luminance: tint(0.55, 0.95, 1.9) * 1_300.0,
                horizon_luminance: tint(1.15, 0.98, 0.85) * 3_600.0,
                sun_glow: tint(1.5, 0.92, 0.40) * 9_000.0,
                haze_length_m: draws.range_f32(8, 500.0, 900.0),
                ..self
            },
            Lighting::Overcast => Self {
                sun_illuminance: Vec3::ZERO,
                zenith_luminance: tint(0.96, 1.0, 1.06) * 4_600.0 * vary,
                horizon_luminance: tint(0.97, 1.0, 1.04) * 2_600.0 * vary,
                sun_glow: Vec3::ZERO,
                cloud_cover: 1.0,
                haze_length_m: 900.0,
                ..self
            },
            Lighting::Rain => Self {
                sun_illuminance: Vec3::ZERO,
                zenith_luminance: tint(0.93, 1.0, 1.12) * 1_500.0 * vary,
                horizon_luminance: tint(0.95, 1.0, 1.08) * 1_000.0 * vary,
                sun_glow: Vec3::ZERO,
                cloud_cover: 1.0,
                headlight_cd: 16_000.0,
                window_cd_m2: 120.0,
                haze_length_m: 260.0,
                wetness: 1.0,
                max_sharp_cd_m2: 5_000.0,
                ..self
            },
            Lighting::Dusk => Self {
                sun_illuminance: Vec3::ZERO,
                sun_direction: low,
                zenith_luminance: tint(0.45, 0.85, 2.6) * 5.0 * vary,
                horizon_luminance: tint(1.0, 0.95, 1.25) * 14.0 * vary,
                sun_glow: tint(1.8, 0.85, 0.35) * 42.0,
                lamp_cd: 1_700.0,
                headlight_cd: 16_000.0,
                window_cd_m2: 28.0,
                haze_length_m: 900.0,
                max_sharp_cd_m2: 100.0,
                ..self
            },
            Lighting::Night => Self {
                sun_direction: moon,
                sun_illuminance: tint(0.9, 1.0, 1.15) * 0.15,
                zenith_luminance: tint(0.75, 0.95, 1.7) * 0.015,
                horizon_luminance: tint(1.3, 0.95, 0.6) * 0.10,
                sun_glow: Vec3::ZERO,
                lamp_cd: 1_700.0,
                headlight_cd: 16_000.0,
                window_cd_m2: 14.0,
                haze_length_m: 1_500.0,
                max_sharp_cd_m2: 16.0,
                ..self
            },
            Lighting::Tunnel => Self { tunnel_lux: 160.0, headlight_cd: 16_000.0, ..self },
        }
    }

    /// Returns the light of the lamps on mains phase `phase` (0 to 2) at time `t`, divided by their mean light.
    pub(crate) fn lamp_level(&self, t: f64, phase: u8) -> f32 {
        self.flicker.map_or(1.0, |(hz, depth)| {
            let angle = std::f64::consts::TAU * (hz * t + f64::from(phase) / 3.0);
            1.0 + depth * libm::cos(angle) as f32
        })
    }

    /// Returns the luminance of the sky in direction `direction`. The light of the sun's disk is not included.
    ///
    /// `sun_illuminance` already contains the light of the disk.
    pub(crate) fn sky_luminance(&self, direction: Vec3) -> Vec3 {
        let up = direction.z.max(0.0);
        let low = 1.0 - up;
        let low2 = low * low;
        let rise = 1.0 - low2 * low;
        let mut sky = self.horizon_luminance.lerp(self.zenith_luminance, rise);
        let near = direction.dot(self.sun_direction).max(0.0);
        let near2 = near * near;
        let near8 = near2 * near2 * near2 * near2;
        sky += self.sun_glow * (0.55 * near8 * near8 + 0.35 * near2 * (low2 * low2));
        // This term is the aureole around the sun.
        let near32 = near8 * near8 * near8 * near8;
        sky += self.sun_illuminance * (0.04 * near32 * near32 * near32);
        sky
    }

    /// Returns the ambient light.
    pub(crate) fn ambient_light(&self) -> AmbientLight {
        let sky_lux = self.sky_lux();
        // The equation is non_sky = albedo * (0.45 * sun * max(sin(elevation), 0.12) + 0.55 * sky), where sun and sky
        // are illuminances.
        let around = (self.sun_illuminance * (0.45 * self.sun_direction.z.max(0.12)) + sky_lux * 0.55)
            * Vec3::new(0.23, 0.215, 0.19);
        let sun_side = Vec3::new(self.sun_direction.x, self.sun_direction.y, 0.0).normalize_or_zero();
        AmbientLight { sky_lux, non_sky_lux: around, horizontal_sun_direction: sun_side }
    }

    /// Returns the illuminance by the open sky on a horizontal surface.
    pub(crate) fn sky_lux(&self) -> Vec3 {
        (self.zenith_luminance * 0.62 + self.horizon_luminance * 0.38 + self.sun_glow * 0.06)
            * std::f32::consts::PI
    }
}
