//! Measures whether simulated readouts are saturated or silent.

use crate::count::Count;
use crate::error::{Error, error};
use crate::spikes::Geometry;

/// Number of consecutive readouts in which a saturated pixel fires.
///
/// A pixel that fires at the rate `r` skips one readout in `1 / (1 - r)`. A pixel below the rate 31/32 = 0.97 therefore
/// skips at least one of 32 readouts, whatever its phase.
const BLOCK_READOUTS: u64 = 32;

/// Number of readouts from the start of a block to the start of the next block. The meter ignores the readouts between
/// two blocks.
const BLOCK_INTERVAL: u64 = 256;

/// Number of packed bytes that are read together.
const PIECE_BYTES: usize = 64;

/// Number of pieces of a frame that the meter reads at least, if the frame has so many.
const MIN_PIECES: usize = 64;

/// Largest share of saturated pixel readouts of a recording with a suitable exposure.
///
/// Above one half, the median pixel is saturated: the typical light of the scene, and not a highlight, is above the
/// range of the camera.
const MAX_SATURATED_SHARE: f64 = 0.5;

/// Light that is outside the range of the simulated camera. See [`Simulator::exposure_fault`](super::Simulator).
///
/// # Examples
/// ```
/// use spikelane::simulate::ExposureFault;
/// use spikelane::{Camera, Seeds, Sensor, Simulator};
/// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
/// simulator.run(&[255u8, 255, 255, 255, 255, 255, 51, 0], 100)?;
/// assert_eq!(simulator.exposure_fault(), Some(ExposureFault::Saturated { share: 0.75 }));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ExposureFault {
    /// More than half of the pixel readouts are saturated.
    Saturated {
        /// The saturated share of the pixel readouts, from 0 to 1.
        share: f64,
    },
    /// No pixel has fired.
    Silent {
        /// Number of readouts without a spike.
        readouts: u64,
    },
}

impl ExposureFault {
    /// Returns a warning about the recording `subject`, in the form of an error.
    ///
    /// # Examples
    /// ```
    /// use spikelane::simulate::ExposureFault;
    /// use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0)?), Seeds::default())?;
    /// simulator.run(&[0u8; 8], 100)?;
    /// let fault = simulator.exposure_fault().expect("no pixel fires in the dark");
    /// assert!(fault.warning("run.dat").to_string().starts_with("run.dat: found no spike in 100 readouts"));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn warning(self, subject: impl std::fmt::Display) -> Error {
        let warning = error!(Input, "{subject}");
        match self {
            Self::Saturated { share } => warning
                .found(format_args!("{:.0} % of the pixel readouts saturated: these pixels fire in every readout", 100.0 * share))
                .expected(format_args!("at most {:.0} %", 100.0 * MAX_SATURATED_SHARE))
                .remedy("reduce the light, or the exposure or dark current of the camera; if the light is in codes, state the code of full scale"),
            Self::Silent { readouts } => warning
                .found(format_args!("no spike in {}", Count(readouts, "readout")))
                .expected("at least one spike")
                .remedy("increase the light, the exposure of the camera or the number of readouts; if the light is in codes, state the code of full scale"),
        }
    }
}

/// Counts saturated pixels in packed readouts.
///
/// The meter reads an eighth of the readouts. Of a frame of more than 4096 bytes, it reads a sample of evenly
/// distributed pieces. Its cost is below 1 % of the cost of the kernels.
#[derive(Clone, Debug, Default)]
pub(super) struct ExposureMeter {
    /// Number of readouts.
    readouts: u64,
    has_spikes: bool,
    /// The pixels of the pieces that fired in every readout of the block so far.
    always: Vec<u8>,
    /// Number of saturated and of all pixels of the complete blocks.
    saturated: u64,
    measured: u64,
}

impl ExposureMeter {
    /// Adds packed readouts.
    pub(super) fn add(&mut self, geometry: Geometry, packed: &[u8]) {
        self.has_spikes = self.has_spikes || packed.iter().any(|&byte| byte != 0);
        for frame in packed.chunks_exact(geometry.frame_bytes()) {
            let position = self.readouts % BLOCK_INTERVAL;
            self.readouts += 1;
            if position == 0 {
                self.always.clear();
                pieces(frame).for_each(|piece| self.always.extend_from_slice(piece));
            } else if position < BLOCK_READOUTS {
                for (always, piece) in self.always.chunks_mut(PIECE_BYTES).zip(pieces(frame)) {
                    always.iter_mut().zip(piece).for_each(|(always, bits)| *always &= bits);
                }
            }
            if position == BLOCK_READOUTS - 1 {
                self.saturated += crate::spikes::count_spikes(&self.always);
                self.measured += (8 * self.always.len()).min(geometry.pixels()) as u64;
            }
        }
    }

    /// Returns the fault of all readouts so far. Before the end of the first block, the result is `None`.
    pub(super) fn fault(&self) -> Option<ExposureFault> {
        if self.measured == 0 {
            return None;
        }
        if !self.has_spikes {
            return Some(ExposureFault::Silent { readouts: self.readouts });
        }
        let share = self.saturated as f64 / self.measured as f64;
        (share > MAX_SATURATED_SHARE).then_some(ExposureFault::Saturated { share })
    }
}

/// Returns the pieces of a frame that are read: all pieces, or one of each `stride` consecutive pieces.
///
/// The position among these pieces is hashed. With equal positions, all pieces could be in the same columns.
fn pieces(frame: &[u8]) -> impl Iterator<Item = &[u8]> {
    let stride = (frame.len() / (PIECE_BYTES * MIN_PIECES)).max(1);
    frame.chunks(stride * PIECE_BYTES).enumerate().filter_map(move |(i, group)| {
        let position = (i.wrapping_mul(0x9E37_79B1) >> 16) % stride;
        group.chunks(PIECE_BYTES).nth(position)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the fault of `readouts` readouts of pixels that fire at their own rates, from random phases.
    fn fault(rates: &[f64], width: u32, readouts: u64) -> Option<ExposureFault> {
        let geometry = Geometry::new(width, rates.len() as u32 / width).unwrap();
        let mut meter = ExposureMeter::default();
        for readout in 0..readouts {
            let mut frame = vec![0; geometry.frame_bytes()];
            for (p, rate) in rates.iter().enumerate() {
                let phase = (p as f64 * 0.618_034).fract();
                let spikes = |t: u64| (rate * t as f64 + phase).floor();
                frame[p / 8] |= u8::from(spikes(readout + 1) > spikes(readout)) << (p % 8);
            }
            meter.add(geometry, &frame);
        }
        meter.fault()
    }

    #[test]
    fn bright_light_below_the_limit_of_the_camera_is_not_saturated() {
        assert_eq!(fault(&[0.96; 64], 8, 300), None);
        assert_eq!(fault(&[1.0; 64], 8, 300), Some(ExposureFault::Saturated { share: 1.0 }));
    }

    #[test]
    fn half_of_the_pixels_may_be_saturated() {
        let rates = |saturated: usize| -> Vec<f64> {
            (0..100).map(|p| if p < saturated { 1.0 } else { 0.5 }).collect()
        };
        assert_eq!(fault(&rates(50), 10, 300), None);
        assert_eq!(fault(&rates(66), 10, 300), Some(ExposureFault::Saturated { share: 0.66 }));
    }

    #[test]
    fn a_recording_without_a_spike_is_silent() {
        assert_eq!(fault(&[0.0; 8], 8, 40), Some(ExposureFault::Silent { readouts: 40 }));
        let mut one_spike = vec![0.0; 8];
        one_spike[3] = 0.026;
        assert_eq!(fault(&one_spike, 8, 40), None);
    }

    #[test]
    fn a_few_readouts_show_no_fault() {
        for rate in [0.0, 1.0] {
            assert_eq!(fault(&[rate; 8], 8, BLOCK_READOUTS - 1), None);
        }
    }

    #[test]
    fn the_pieces_of_a_large_frame_cover_all_its_columns_and_rows() {
        // 2048 x 1024 pixels are 64 pieces of a side of 256 bytes, whose stride is a multiple of the row.
        let (row, rows) = (256, 1024);
        let frame: Vec<u8> = (0..row * rows).map(|i| (i % row / PIECE_BYTES) as u8).collect();
        let columns: Vec<u8> = pieces(&frame).map(|piece| piece[0]).collect();
        assert_eq!(columns.len(), MIN_PIECES);
        for column in 0..4 {
            let count = columns.iter().filter(|&&c| c == column).count();
            assert!((6..=26).contains(&count), "{count} of 16 pieces in column {column}");
        }
        let by_row: Vec<u8> = (0..row * rows).map(|i| (i / row * 4 / rows) as u8).collect();
        for quarter in 0..4 {
            assert_eq!(pieces(&by_row).filter(|piece| piece[0] == quarter).count(), 16);
        }
    }
}
