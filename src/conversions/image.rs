//! Feature `image`: conversion of grayscale images to frames of light, and of reconstructions to images.

use image::{GrayImage, ImageBuffer, Luma};

use crate::error::Result;
use crate::light::{Frame, OwnedSamples};
use crate::spikes::Geometry;

macro_rules! frame_from_image {
    ($($variant:ident $sample:ty),*) => {$(
        impl TryFrom<ImageBuffer<Luma<$sample>, Vec<$sample>>> for Frame {
            type Error = crate::error::Error;

            /// Uses the samples as linear light and applies no tone curve.
            ///
            /// Image files of cameras and screens usually contain sRGB codes. Convert these codes to linear light
            /// first, for example with [`crate::light::Transfer`].
            ///
            /// # Errors
            /// Returns the errors of [`Geometry::new`] and [`Frame::new`].
            fn try_from(image: ImageBuffer<Luma<$sample>, Vec<$sample>>) -> Result<Self> {
                let geometry = Geometry::new(image.width(), image.height())?;
                Frame::new(geometry, OwnedSamples::$variant(image.into_raw()))
            }
        }
    )*};
}

frame_from_image!(U8 u8, U16 u16, F32 f32);

/// Returns an 8-bit image of `values` from 0 to 1, such as a reconstruction of [`crate::reconstruct`].
///
/// A value `v` has the 8-bit code `255 v`, rounded to nearest. Values below 0 have the code 0, and values above 1 have
/// the code 255. Returns `None` if `values` has fewer elements than `geometry` has pixels.
///
/// # Examples
/// ```
/// use spikelane::light::Frame;
/// use spikelane::{Camera, Seeds, Sensor, Simulator, gray_image, reconstruct};
/// let image = image::GrayImage::from_pixel(32, 24, image::Luma([51]));
/// let frame = Frame::try_from(image)?;
/// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
/// let spikes = simulator.run(&frame, 101)?;
/// let rates = reconstruct::tfp(spikes.view(), 50, 50)?;
/// let picture = gray_image(spikes.geometry(), &rates).expect("one value per pixel");
/// assert!((i32::from(picture.get_pixel(5, 5).0[0]) - 51).abs() <= 1);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[must_use]
pub fn gray_image(geometry: Geometry, values: &[f32]) -> Option<GrayImage> {
    let samples = values.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
    let side = |n: usize| u32::try_from(n).ok();
    GrayImage::from_raw(side(geometry.width())?, side(geometry.height())?, samples)
}
