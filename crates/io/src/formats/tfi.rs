//! TFI images of a stream.

use spikelane::error::Result;
use spikelane::reconstruct::{Tfi, tfi_with_open_pixels};

use super::StreamReader;

/// Number of readouts on each side of the center that are read first.
const FIRST_SEARCH_READOUTS: usize = 32;

impl StreamReader {
    /// Returns the image of [`tfi_with_open_pixels`] at readout `at`.
    ///
    /// The nearest readouts are read first. Further readouts are read only if a pixel has no complete interval there.
    ///
    /// # Examples
    /// ```
    /// use spikelane_io::formats::StreamReader;
    /// let reader = StreamReader::from_bytes("mine", vec![0, 9, 0, 9, 6], None, Some(spikelane::Geometry::new(8, 1)?))?;
    /// let image = reader.tfi(2, 20)?;
    /// assert_eq!((image.rates[0], image.missing_pixels), (1.0 / 2.0, 6));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`read_around`](Self::read_around), and as [`tfi_with_open_pixels`].
    pub fn tfi(&self, at: usize, search: usize) -> Result<Tfi> {
        let mut near = FIRST_SEARCH_READOUTS.min(search);
        loop {
            let (frames, center) = self.read_around(at, near)?;
            let image = tfi_with_open_pixels(frames.view(), center, near)?;
            // If every pixel has an interval, a longer search finds the same intervals.
            if near == search || image.missing_pixels == 0 {
                return Ok(image);
            }
            near = near.saturating_mul(4).min(search);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::{Geometry, SpikeFrames};

    /// Returns a stream of 400 readouts with 15x3 pixels, in which pixel `p` fires with the period `1 + 13 p mod longest`.
    fn reader(longest: usize) -> StreamReader {
        let geometry = Geometry::new(15, 3).unwrap();
        let bit = |t: usize, p: usize| u8::from((t + 7 * p).is_multiple_of(1 + 13 * p % longest));
        let dense: Vec<u8> = (0..400).flat_map(|t| (0..45).map(move |p| bit(t, p))).collect();
        let frames = SpikeFrames::from_dense(geometry, &dense).unwrap();
        StreamReader::from_bytes("test", frames.into_bytes(), None, Some(geometry)).unwrap()
    }

    #[test]
    fn the_image_is_that_of_the_whole_search() {
        for reader in [5, 29, 97, 397].map(reader) {
            for (at, search) in [(0, 1), (200, 20), (200, 33), (200, 150), (3, 150), (399, 150), (180, 1000)]
            {
                let (frames, center) = reader.read_around(at, search).unwrap();
                let whole = tfi_with_open_pixels(frames.view(), center, search).unwrap();
                assert_eq!(reader.tfi(at, search).unwrap(), whole, "readout {at}, search {search}");
            }
        }
    }
}
