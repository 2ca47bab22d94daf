//! The samples of one frame of linear light.

/// The linear light of one frame as one value per pixel, row-major, top row first.
///
/// # Examples
/// ```
/// use spikelane::simulate::Samples;
/// use spikelane::{Camera, Seeds, Sensor, Simulator};
/// let camera = Camera::ideal(Sensor::new(8, 1, 20_000.0)?);
/// // The same light, 2/5 of full scale, in three types of samples.
/// for samples in [Samples::U8(&[102; 8]), Samples::U16(&[26214; 8]), Samples::F32(&[0.4; 8])] {
///     assert_eq!(samples.len(), 8);
///     assert_eq!(Simulator::new(&camera, Seeds::default())?.run(samples, 6)?.spikes(), 2 * 8);
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Samples<'a> {
    /// 255 is full scale.
    U8(&'a [u8]),
    /// 65535 is full scale.
    U16(&'a [u16]),
    /// 1.0 is full scale. Values are finite and not negative.
    F32(&'a [f32]),
}

impl Samples<'_> {
    /// Returns the number of pixels.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(s) => s.len(),
            Self::U16(s) => s.len(),
            Self::F32(s) => s.len(),
        }
    }

    /// Returns whether a sample can exceed full scale.
    pub(crate) fn is_unbounded(&self) -> bool {
        matches!(self, Self::F32(_))
    }

    /// Returns whether there are no pixels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
