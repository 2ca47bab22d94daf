//! Which instants to render so that the rest can be warped.

use spikelane::error::{Error, Kind, Result};

use crate::world::Scene;

/// Motion in the image between key frames stays below this.
const BOUND_PX: f64 = 0.5;
/// The fastest pixel is measured this often; in between it may gain this share.
const ANCHOR_S: f64 = 0.01;
const RESERVE: f64 = 1.15;
/// Even a scene that stands still gets a key frame this often: lights change.
const LONGEST_S: f64 = 5e-3;
/// Key frames in one period of flickering lamps; linear light between them is
/// then off by 1/2 (pi/24)^2, less than 1 % of the flicker.
pub(super) const PER_FLICKER: f64 = 24.0;

/// Readouts of an interval and the key frames among them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct KeyPlan {
    /// Instants of the readouts, `t0 + k / readout_hz`.
    pub readouts: Vec<f64>,
    /// Ascending indices into `readouts`; the first and the last readout are key frames.
    pub keys: Vec<usize>,
    /// The fastest motion in the image, in pixels a readout.
    pub max_px_per_readout: f64,
}

impl KeyPlan {
    /// True when even neighbouring readouts differ by more than half a pixel
    /// somewhere: then every readout is a key frame, and the camera is too slow
    /// for the scene.
    #[must_use]
    pub fn too_fast(&self) -> bool {
        self.max_px_per_readout > BOUND_PX
    }

    /// Readouts a second from which on neighbours differ by half a pixel at most, where `readout_hz` was planned for.
    #[must_use]
    pub fn needed_hz(&self, readout_hz: f64) -> f64 {
        (self.max_px_per_readout / BOUND_PX * readout_hz).ceil()
    }
}

impl Scene {
    /// Plans key frames over `[t0, t1]` for a camera of `readout_hz`, so that
    /// between two of them no visible point moves by more than half a pixel.
    ///
    /// # Errors
    /// When the interval is empty or leaves the drive, or the rate is not
    /// between 1 Hz and 10 MHz.
    pub fn keyframes(&self, t0: f64, t1: f64, readout_hz: f64, threads: usize) -> Result<KeyPlan> {
        self.check_time(t0)?;
        self.check_time(t1)?;
        if t1 < t0 || !(1.0..=1e7).contains(&readout_hz) {
            return Err(Error::new(Kind::Usage, "key frames")
                .found(format_args!("{t0} to {t1} s at {readout_hz} Hz"))
                .expected("an interval forward in time, 1 to 10,000,000 Hz")
                .remedy("give the start before the end"));
        }
        let count = ((t1 - t0) * readout_hz + 1e-6) as usize + 1;
        let readouts: Vec<f64> = (0..count).map(|k| (t0 + k as f64 / readout_hz).min(t1)).collect();
        let anchors = ((t1 - t0) / ANCHOR_S).ceil().max(1.0) as usize;
        let at = |i: usize| t0 + (t1 - t0) * i as f64 / anchors as f64;
        let speeds: Vec<f64> =
            (0..=anchors).map(|i| self.fastest_px_s(at(i), threads)).collect::<Result<_>>()?;
        let mut longest = LONGEST_S;
        if let Some((hz, _)) = self.light.flicker {
            longest = longest.min(1.0 / (PER_FLICKER * hz));
        }
        let mut keys = vec![0];
        let mut k = 0;
        while k + 1 < count {
            let anchor = ((readouts[k] - t0) / (t1 - t0) * anchors as f64) as usize;
            // A step may reach into the next stretch.
            let speed =
                speeds[anchor.min(anchors)..=(anchor + 2).min(anchors)].iter().fold(0.0f64, |a, &b| a.max(b));
            let step = (BOUND_PX / (speed * RESERVE).max(1e-9)).min(longest) * readout_hz;
            k = (k + (step as usize).max(1)).min(count - 1);
            keys.push(k);
        }
        let max_px_per_readout = speeds.iter().fold(0.0f64, |a, &b| a.max(b)) / readout_hz;
        Ok(KeyPlan { readouts, keys, max_px_per_readout })
    }

    /// Speed of the fastest visible point in the image at `t`, in pixels a second.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn fastest_px_s(&self, t: f64, threads: usize) -> Result<f64> {
        const STEP_S: f64 = 2e-5;
        let labels = self.labels(t, threads)?;
        let step = if t + STEP_S > self.duration_s { -STEP_S } else { STEP_S };
        let motions = self.motions(&self.instant(t), &self.instant(t + step));
        let mut fastest = 0.0f32;
        for row in 0..labels.height {
            for column in 0..labels.width {
                let (dx, dy, _) = motions.at(&labels, row, column);
                fastest = fastest.max(dx * dx + dy * dy);
            }
        }
        Ok(f64::from(fastest.sqrt()) / STEP_S)
    }
}
