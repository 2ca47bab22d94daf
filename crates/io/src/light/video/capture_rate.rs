//! The rate at which the camera captured the frames of a slow-motion video.
//!
//! A slow-motion video is often stored for playback at a lower rate. Android states the rate of capture in the tag
//! `com.android.capture.fps`, and Sony in the XML of its cameras. Apple and GoPro store the times of capture.

use spikelane::error::Setting;
use spikelane::light::Rate;

/// The rate of capture that a video states, and its rate of playback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CaptureRate {
    capture_hz: f64,
    playback_hz: f64,
}

impl CaptureRate {
    /// Rates that differ by less than this factor are equal, because cameras vary their rate.
    const EQUAL_RATIO: f64 = 1.1;

    /// Returns the rates if they differ.
    pub(super) fn new(capture_hz: f64, playback_hz: f64) -> Option<Self> {
        let is_rate = |hz: f64| hz.is_finite() && hz > 0.0;
        let ratio = capture_hz / playback_hz;
        let differ = !(1.0 / Self::EQUAL_RATIO..=Self::EQUAL_RATIO).contains(&ratio);
        (is_rate(capture_hz) && is_rate(playback_hz) && differ).then_some(Self { capture_hz, playback_hz })
    }

    /// Returns whether the rate of capture is the rate of the frames. A time lapse keeps its rate of playback.
    pub(super) fn is_used(self) -> bool {
        self.capture_hz > self.playback_hz
    }

    /// Returns the rate of capture. 119.88 is an NTSC rate.
    pub(super) fn rate(self) -> Option<Rate> {
        self.capture_hz.to_string().parse().ok()
    }

    /// Returns the times of capture for times of playback in nanoseconds.
    pub(super) fn capture_times(self, times: &[u64]) -> Vec<u64> {
        times.iter().map(|t| (*t as f64 * self.playback_hz / self.capture_hz).round() as u64).collect()
    }

    /// Returns a note that names the rate that is used.
    pub(super) fn note(self) -> String {
        let (capture, playback) = (rounded(self.capture_hz), rounded(self.playback_hz));
        let setting = Setting("input_fps");
        if self.is_used() {
            format!(
                "slow motion: the frames last 1/{capture} s, as they were captured, and not 1/{playback} s, as they are played; for another rate, set {setting}"
            )
        } else {
            format!(
                "time lapse: the frames were captured at {capture} per second and last 1/{playback} s, as they are played; for the time of capture, set {setting} to {capture}"
            )
        }
    }
}

/// Returns a rate with up to two decimal places.
fn rounded(hz: f64) -> String {
    let text = format!("{hz:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_capture_is_used_for_slow_motion() {
        let slow = CaptureRate::new(240.0, 30_000.0 / 1001.0).unwrap();
        assert!(slow.is_used() && slow.rate() == Rate::new(240, 1).ok());
        assert_eq!(CaptureRate::new(119.88, 25.0).unwrap().rate(), Rate::new(120_000, 1001).ok());
        let note = slow.note();
        assert!(note.contains("1/240 s") && note.contains("1/29.97 s"), "{note}");
        let eighth = CaptureRate::new(240.0, 30.0).unwrap();
        assert_eq!(eighth.capture_times(&[0, 33_333_333, 100_000_000]), [0, 4_166_667, 12_500_000]);
        let lapse = CaptureRate::new(0.5, 30.0).unwrap();
        assert!(!lapse.is_used() && lapse.note().contains("to 0.5"));
        for (capture, playback) in
            [(239.9, 240.0), (240.0, 239.4), (0.0, 30.0), (f64::NAN, 30.0), (240.0, 0.0)]
        {
            assert_eq!(CaptureRate::new(capture, playback), None, "{capture} {playback}");
        }
    }
}
