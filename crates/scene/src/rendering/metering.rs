//! Meters the luminance of white during a drive.

use glam::Vec3;

use spikelane::error::Result;
use spikelane::unstable::threads;

use super::frame::SceneInstant;
use super::rendered_frame::SamplesPerPixel;
use super::tiles::Tiles;
use crate::drive::camera::{Intrinsics, PinholeCamera};
use crate::lighting::luminance;
use crate::optics::exposure::{Exposure, ExposureCurve, METER_INTERVAL_S, white_of};
use crate::world::Scene;

/// Width of a metered image in pixels.
const METER_WIDTH: u32 = 80;

impl Scene {
    /// Returns the luminance of white at time `t` in cd/m2, with `threads` threads.
    ///
    /// A luminance divided by the luminance of white is linear light, usually between 0 and 1. The light of highlights
    /// and of lamps exceeds 1. The first call meters the whole drive, once per 50 ms. White before the start of the drive
    /// equals white at its start.
    ///
    /// # Errors
    /// [`Usage`](spikelane::ErrorKind::Usage) if `t` is outside the drive.
    pub fn white_cd_m2(&self, t: f64, threads: usize) -> Result<f32> {
        self.check_time(t)?;
        Ok(self.white_at(t, threads))
    }

    /// Returns the luminance of white at time `t`, which must be inside the drive.
    pub(crate) fn white_at(&self, t: f64, threads: usize) -> f32 {
        match self.exposure {
            Exposure::Fixed(white) => white,
            Exposure::Automatic | Exposure::Locked => {
                self.exposure_curve.get_or_init(|| self.meter_drive(threads)).at(t)
            }
        }
    }

    /// Meters the drive, and follows the metered white with a lag.
    fn meter_drive(&self, threads: usize) -> ExposureCurve {
        let steps = match self.exposure {
            Exposure::Automatic => (self.duration_s / METER_INTERVAL_S) as usize,
            Exposure::Locked | Exposure::Fixed(_) => 0,
        };
        let interval_s = self.duration_s / steps.max(1) as f64;
        let metered = threads::map_indexed(threads, steps + 1, |k| {
            libm::log(f64::from(self.metered_white((k as f64 * interval_s).min(self.duration_s))))
        });
        ExposureCurve::from_metered(&metered, interval_s)
    }

    /// Returns the white that the camera meters at time `t`.
    fn metered_white(&self, t: f64) -> f32 {
        let camera = self.camera_unchecked(t);
        let full = camera.intrinsics;
        let scale = (f64::from(METER_WIDTH) / f64::from(full.width)).min(1.0);
        let side = |n: u32| ((f64::from(n) * scale).round() as u32).max(1);
        let intrinsics = Intrinsics {
            width: side(full.width),
            height: side(full.height),
            focal_px: full.focal_px * scale,
            center_px: full.center_px.map(|c| c * scale),
            ..full
        };
        let camera = PinholeCamera { intrinsics, ..camera };
        let tiles = Tiles::all(intrinsics.width as usize, intrinsics.height as usize);
        let frame = SceneInstant::with_camera(self, camera, t);
        let (rendered, _) = self.render_instant(&frame, SamplesPerPixel::Four, (&tiles, None), 1);
        let mut light: Vec<f32> = rendered.rgb.iter().map(|&c| luminance(Vec3::from(c))).collect();
        white_of(&mut light)
    }
}
