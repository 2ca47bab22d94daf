//! Selects the instants that are drawn. Between them, light changes linearly.

use spikelane::error::{Result, bail};

use crate::world::Scene;

/// Maximum motion in the image between consecutive keyframes, in pixels.
pub(super) const MAX_KEYFRAME_MOTION_PX: f64 = 0.25;
/// Maximum motion in the image between consecutive readouts, in pixels. Faster motion is visible as jumps of the light.
const MAX_READOUT_MOTION_PX: f64 = 0.5;
/// The speed of the fastest visible point is sampled at this interval, in seconds. `SPEED_MARGIN` is a factor that
/// covers an increase of the speed between two samples, in addition to the next samples.
const SPEED_SAMPLE_S: f64 = 0.01;
pub(super) const SPEED_MARGIN: f64 = 1.15;
/// Maximum time between consecutive keyframes in seconds. The limit also applies if nothing moves, because the light
/// changes.
const MAX_KEYFRAME_INTERVAL_S: f64 = 5e-3;
/// Number of keyframes in one flicker period of the lamps.
///
/// Light between keyframes is interpolated linearly. The interpolation error is at most (pi/24)^2 / 2 of the flicker
/// amplitude, which is less than 1 %.
pub(super) const KEYFRAMES_PER_FLICKER: f64 = 24.0;

/// The readouts in a time interval, and the readouts that are keyframes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct KeyframePlan {
    /// Instant of each readout in seconds. Readout k is at `t0 + k / readout_hz`.
    pub readouts: Vec<f64>,
    /// Indices of the keyframes in `readouts`, in ascending order. The first and the last readout are keyframes.
    pub keyframes: Vec<usize>,
    /// Highest speed of a visible point in the image, in pixels per readout.
    pub max_px_per_readout: f64,
}

impl KeyframePlan {
    /// Returns whether some visible point moves by more than half a pixel between two consecutive readouts.
    ///
    /// If the result is true, the readout rate is too low for the scene. Every readout in the fast part of the interval
    /// is then a keyframe.
    #[must_use]
    pub fn is_too_fast(&self) -> bool {
        self.max_px_per_readout > MAX_READOUT_MOTION_PX
    }

    /// Returns the lowest readout rate in Hz at which no visible point moves by more than half a pixel between
    /// consecutive readouts.
    ///
    /// `readout_hz` must be the rate with which the plan was created.
    #[must_use]
    pub fn required_readout_hz(&self, readout_hz: f64) -> f64 {
        (self.max_px_per_readout / MAX_READOUT_MOTION_PX * readout_hz).ceil()
    }
}

impl Scene {
    /// Plans keyframes in the time interval `[t0, t1]` for a camera with the readout rate `readout_hz`.
    ///
    /// Between two keyframes no visible point moves by more than a quarter pixel, unless every readout is a keyframe.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `t1` is less than `t0`, if the interval exceeds the drive, or if the rate is not
    /// between 1 Hz and 10 MHz.
    pub fn plan_keyframes(&self, t0: f64, t1: f64, readout_hz: f64, threads: usize) -> Result<KeyframePlan> {
        self.check_time(t0)?;
        self.check_time(t1)?;
        if t1 < t0 || !(1.0..=1e7).contains(&readout_hz) {
            bail!(Usage, "key frames"; found "{t0} to {t1} s at {readout_hz} Hz";
                expected "a start before the end, and 1 to 10,000,000 Hz";
                remedy "correct the times or the readout rate");
        }
        let count = ((t1 - t0) * readout_hz + 1e-6) as usize + 1;
        let readouts: Vec<f64> = (0..count).map(|k| (t0 + k as f64 / readout_hz).min(t1)).collect();
        let anchors = ((t1 - t0) / SPEED_SAMPLE_S).ceil().max(1.0) as usize;
        let at = |i: usize| t0 + (t1 - t0) * i as f64 / anchors as f64;
        let speeds: Vec<f64> =
            (0..=anchors).map(|i| self.max_speed_px_per_s(at(i), threads)).collect::<Result<_>>()?;
        let mut max_interval_s = MAX_KEYFRAME_INTERVAL_S;
        if let Some((hz, _)) = self.light.flicker {
            max_interval_s = max_interval_s.min(1.0 / (KEYFRAMES_PER_FLICKER * hz));
        }
        let mut keys = vec![0];
        let mut k = 0;
        while k + 1 < count {
            let anchor = ((readouts[k] - t0) / (t1 - t0) * anchors as f64) as usize;
            // A step may end after the next speed sample, so the maximum of three consecutive samples is used.
            let speed =
                speeds[anchor.min(anchors)..=(anchor + 2).min(anchors)].iter().fold(0.0f64, |a, &b| a.max(b));
            let step =
                (MAX_KEYFRAME_MOTION_PX / (speed * SPEED_MARGIN).max(1e-9)).min(max_interval_s) * readout_hz;
            k = (k + (step as usize).max(1)).min(count - 1);
            keys.push(k);
        }
        let max_px_per_readout = speeds.iter().fold(0.0f64, |a, &b| a.max(b)) / readout_hz;
        Ok(KeyframePlan { readouts, keyframes: keys, max_px_per_readout })
    }

    /// Returns the speed of the fastest visible point in the image at time `t`, in pixels per second.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `t` is outside the drive.
    pub fn max_speed_px_per_s(&self, t: f64, threads: usize) -> Result<f64> {
        const STEP_S: f64 = 2e-5;
        let labels = self.labels(t, threads)?;
        let step = if t + STEP_S > self.duration_s { -STEP_S } else { STEP_S };
        let motions = self.motions(&self.poses_at(t), &self.poses_at(t + step));
        let mut fastest = 0.0f32;
        for row in 0..labels.height {
            for column in 0..labels.width {
                let (dx, dy, _) = motions.displacement(&labels, row, column);
                fastest = fastest.max(dx * dx + dy * dy);
            }
        }
        Ok(f64::from(fastest.sqrt()) / STEP_S)
    }
}
