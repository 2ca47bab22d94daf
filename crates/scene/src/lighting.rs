//! The presets of light, in photometric units, over five decades.
//!
//! Illuminances are in lux, luminances in cd/m2, intensities in candela; each
//! colour is linear sRGB whose luminance is the quantity.

use glam::Vec3;

use super::random::Draws;

/// Lamps further away than this light nothing.
pub(super) const LAMP_REACH_M: f32 = 26.0;

/// A time of day and weather.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Lighting {
    /// High sun, blue sky, a few clouds.
    Noon,
    /// A low warm sun with long shadows.
    LowSun,
    /// A closed cover of cloud.
    Overcast,
    /// After sunset, lamps just lit.
    Dusk,
    /// Street lamps, head and tail lights, lit windows.
    Night,
    /// A lamp-lit tunnel with a bright exit.
    Tunnel,
    /// Rain clouds over a wet road.
    Rain,
}

impl Lighting {
    /// Every preset, from bright to dark where they can be ordered.
    pub const ALL: [Self; 7] =
        [Self::Noon, Self::LowSun, Self::Overcast, Self::Rain, Self::Tunnel, Self::Dusk, Self::Night];

    /// The name in lower case, with a hyphen.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Noon => "noon",
            Self::LowSun => "low-sun",
            Self::Overcast => "overcast",
            Self::Dusk => "dusk",
            Self::Night => "night",
            Self::Tunnel => "tunnel",
            Self::Rain => "rain",
        }
    }

    /// The one that a scene of this seed has when nobody chooses.
    #[must_use]
    pub fn drawn(seed: u64) -> Self {
        Self::ALL[Draws::new(seed, "scene").pick(0, Self::ALL.len())]
    }

    /// The preset called `name`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|l| l.name() == name)
    }
}

/// Everything that shines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Unit vector towards sun or moon.
    pub sun_way: Vec3,
    /// Its illuminance on a surface that faces it.
    pub sun: Vec3,
    /// Luminance of the sky above and near the horizon.
    pub zenith: Vec3,
    pub horizon: Vec3,
    /// Extra luminance around the sun's azimuth near the horizon.
    pub glow: Vec3,
    /// Cover of clouds, 0 to 1.
    pub clouds: f32,
    /// Peak intensity of a street lamp.
    pub lamp_cd: f32,
    pub lamp_tint: Vec3,
    /// Peak intensity of a pair of headlights; zero when they are off.
    pub headlight_cd: f32,
    /// Luminance of a lit window.
    pub window_cd_m2: f32,
    /// Illuminance on the road inside the tunnel.
    pub tunnel_lux: f32,
    /// Distance in which contrast falls to 1/e.
    pub haze_m: f32,
    /// Water on the road, 0 to 1.
    pub wet: f32,
    /// The luminance that a camera would call white.
    pub white_cd_m2: f32,
    /// Frequency of the lamps' flicker and its depth, if they flicker.
    pub flicker: Option<(f64, f32)>,
}

/// What lights every surface, whatever it is: the open sky, and what ground and fronts throw back.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Surround {
    /// Illuminance of the open sky on a horizontal surface.
    pub sky_lux: Vec3,
    /// Illuminance from where no sky is seen.
    pub around: Vec3,
    /// Level unit vector towards sun or moon.
    pub sun_side: Vec3,
}

/// A colour scaled to luminance 1.
fn tint(r: f32, g: f32, b: f32) -> Vec3 {
    let c = Vec3::new(r, g, b);
    c / luminance(c)
}

/// Luminance of linear sRGB (IEC 61966-2-1).
pub(super) fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

impl Light {
    /// The light of `preset`, varied by the seed.
    pub(crate) fn random(seed: u64, preset: Lighting, flicker_hz: Option<f64>) -> Self {
        let draws = Draws::new(seed, "light");
        // Roads run along x: a sun that is low shines along the street, or no
        // ray of it would reach the ground.
        let along =
            draws.range(9, -0.75, 0.75) + if draws.chance(10, 0.5) { std::f64::consts::PI } else { 0.0 };
        let azimuth = if matches!(preset, Lighting::LowSun | Lighting::Dusk) {
            along
        } else {
            draws.range(0, 0.0, std::f64::consts::TAU)
        };
        let way = |degrees: f64| {
            let (s, c) = libm::sincos(degrees.to_radians());
            let (sa, ca) = libm::sincos(azimuth);
            Vec3::new((c * ca) as f32, (c * sa) as f32, s as f32)
        };
        let vary = draws.range_f32(1, 0.85, 1.15);
        let base = Self {
            sun_way: way(draws.range(2, 42.0, 62.0)),
            sun: tint(1.05, 1.0, 0.90) * 90_000.0 * vary,
            zenith: tint(0.45, 0.95, 2.1) * 2_600.0,
            horizon: tint(0.80, 1.0, 1.45) * 7_000.0,
            glow: tint(1.0, 1.0, 0.9) * 2_500.0,
            clouds: draws.range_f32(3, 0.1, 0.5),
            lamp_cd: 0.0,
            lamp_tint: if draws.chance(4, 0.5) { tint(1.0, 0.72, 0.38) } else { tint(1.0, 0.94, 0.82) },
            headlight_cd: 0.0,
            window_cd_m2: 0.0,
            tunnel_lux: 0.0,
            haze_m: draws.range_f32(5, 1_200.0, 2_500.0),
            wet: 0.0,
            white_cd_m2: 20_000.0,
            flicker: flicker_hz.map(|hz| (hz, draws.range_f32(6, 0.35, 0.8))),
        };
        base.preset(preset, draws, way(draws.range(7, 7.0, 16.0)), way(35.0), vary)
    }

    fn preset(self, preset: Lighting, draws: Draws, low: Vec3, moon: Vec3, vary: f32) -> Self {
        match preset {
            Lighting::Noon => self,
            Lighting::LowSun => Self {
                sun_way: low,
                sun: tint(1.45, 0.92, 0.45) * 32_000.0 * vary,
                zenith: tint(0.55, 0.95, 1.9) * 1_300.0,
                horizon: tint(1.15, 0.98, 0.85) * 3_600.0,
                glow: tint(1.5, 0.92, 0.40) * 9_000.0,
                haze_m: draws.range_f32(8, 500.0, 900.0),
                white_cd_m2: 8_500.0,
                ..self
            },
            Lighting::Overcast => Self {
                sun: Vec3::ZERO,
                zenith: tint(0.96, 1.0, 1.06) * 4_600.0 * vary,
                horizon: tint(0.97, 1.0, 1.04) * 2_600.0 * vary,
                glow: Vec3::ZERO,
                clouds: 1.0,
                haze_m: 900.0,
                white_cd_m2: 3_600.0,
                ..self
            },
            Lighting::Rain => Self {
                sun: Vec3::ZERO,
                zenith: tint(0.93, 1.0, 1.12) * 1_500.0 * vary,
                horizon: tint(0.95, 1.0, 1.08) * 1_000.0 * vary,
                glow: Vec3::ZERO,
                clouds: 1.0,
                headlight_cd: 16_000.0,
                window_cd_m2: 120.0,
                haze_m: 260.0,
                wet: 1.0,
                white_cd_m2: 1_250.0,
                ..self
            },
            Lighting::Dusk => Self {
                sun: Vec3::ZERO,
                sun_way: low,
                zenith: tint(0.45, 0.85, 2.6) * 5.0 * vary,
                horizon: tint(1.0, 0.95, 1.25) * 14.0 * vary,
                glow: tint(1.8, 0.85, 0.35) * 42.0,
                lamp_cd: 1_700.0,
                headlight_cd: 16_000.0,
                window_cd_m2: 28.0,
                haze_m: 900.0,
                white_cd_m2: 17.0,
                ..self
            },
            Lighting::Night => Self {
                sun_way: moon,
                sun: tint(0.9, 1.0, 1.15) * 0.15,
                zenith: tint(0.75, 0.95, 1.7) * 0.015,
                horizon: tint(1.3, 0.95, 0.6) * 0.10,
                glow: Vec3::ZERO,
                lamp_cd: 1_700.0,
                headlight_cd: 16_000.0,
                window_cd_m2: 14.0,
                haze_m: 1_500.0,
                white_cd_m2: 4.5,
                ..self
            },
            Lighting::Tunnel => Self { tunnel_lux: 160.0, headlight_cd: 16_000.0, white_cd_m2: 70.0, ..self },
        }
    }

    /// Share of the lamps' mean light at `t`, for a mains phase of 0 to 2.
    pub(crate) fn lamp_level(&self, t: f64, phase: u8) -> f32 {
        self.flicker.map_or(1.0, |(hz, depth)| {
            let angle = std::f64::consts::TAU * (hz * t + f64::from(phase) / 3.0);
            1.0 + depth * libm::cos(angle) as f32
        })
    }

    /// Luminance of the sky in a direction; the sun's disc is left out, since
    /// its light is summed as an illuminance.
    pub(crate) fn sky(&self, way: Vec3) -> Vec3 {
        let up = way.z.max(0.0);
        let rise = 1.0 - (1.0 - up) * (1.0 - up) * (1.0 - up);
        let mut sky = self.horizon.lerp(self.zenith, rise);
        let near = way.dot(self.sun_way).max(0.0);
        let near2 = near * near;
        let near8 = near2 * near2 * near2 * near2;
        sky += self.glow * (0.55 * near8 * near8 + 0.35 * near2 * (1.0 - up).powi(4));
        // The aureole of a sun that shines.
        let near32 = near8 * near8 * near8 * near8;
        sky += self.sun * (0.04 * near32 * near32 * near32);
        sky
    }

    /// The light that comes from all sides.
    pub(crate) fn surround(&self) -> Surround {
        let sky_lux = self.sky_lux();
        // Ground and fronts are lit a quarter as brightly as they could be.
        let around =
            (self.sun * (0.45 * self.sun_way.z.max(0.12)) + sky_lux * 0.55) * Vec3::new(0.23, 0.215, 0.19);
        let sun_side = Vec3::new(self.sun_way.x, self.sun_way.y, 0.0).normalize_or_zero();
        Surround { sky_lux, around, sun_side }
    }

    /// Illuminance of the open sky on a horizontal surface.
    pub(crate) fn sky_lux(&self) -> Vec3 {
        (self.zenith * 0.62 + self.horizon * 0.38 + self.glow * 0.06) * std::f32::consts::PI
    }
}
