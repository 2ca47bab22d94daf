//! What a pixel did in a recording.

/// Blocks of time whose counts are compared.
pub(in crate::diagnose) const BLOCKS: usize = 8;

/// Lags of the phase variance, in intervals.
pub(in crate::diagnose) const LAGS: [usize; 3] = [1, 4, 16];

/// What a pixel did.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::diagnose) struct PixelScan {
    pub count: u32,
    /// Readout of the first spike; zero without one.
    pub first: u32,
    /// Spikes per readout: by time from three spikes on, by count below.
    pub rate: f64,
    pub blocks: [u32; BLOCKS],
    /// Phase variance at [`LAGS`] less its quantization, in thresholds squared; sums over terms.
    pub variance: [f64; LAGS.len()],
    pub terms: [f64; LAGS.len()],
    /// Covariance of intervals one and two apart, in thresholds squared; sums.
    pub covariance: [f64; 2],
    /// Spikes from [`SETTLED`](super::stretches::SETTLED) readouts after every fall of the light to its next rise.
    pub after_falls: u32,
    /// Intervals off the pixel's lattice: shorter, longer.
    pub off_lattice: [u32; 2],
}
