//! The shape of the pixels of an image or a video.

use spikelane::spikes::Geometry;

/// The width of a pixel divided by its height, as a file states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::light) struct PixelAspect {
    width: f64,
    height: f64,
}

impl PixelAspect {
    /// The shape of the pixels of a camera.
    pub(in crate::light) const SQUARE: Self = Self { width: 1.0, height: 1.0 };

    /// The largest ratio of the sides of a pixel. Anamorphic film has the ratio 2, and fields of video have 2.2.
    const MAX_RATIO: f64 = 4.0;

    /// Returns the shape of pixels with sides of these lengths in any unit. Lengths without a meaning, such as 0, give
    /// square pixels.
    pub(in crate::light) fn new(width: f64, height: f64) -> Self {
        let ratio = width / height;
        let is_valid = (1.0 / Self::MAX_RATIO..=Self::MAX_RATIO).contains(&ratio);
        if is_valid { Self { width, height } } else { Self::SQUARE }
    }

    /// Returns the size of an image with square pixels. One side keeps its number of pixels, and the other side becomes
    /// longer.
    pub(in crate::light) fn displayed_size(self, stored: Geometry) -> Geometry {
        let scaled = |pixels: usize, factor: f64| ((pixels as f64 * factor).round() as u32).max(1);
        let wide = scaled(stored.width(), (self.width / self.height).max(1.0));
        let high = scaled(stored.height(), (self.height / self.width).max(1.0));
        // If the longer side exceeds the largest size, the pixels stay as they are.
        Geometry::new(wide, high).unwrap_or(stored)
    }

    /// Returns a note for pixels that become square, or `None` if the size of the image does not change.
    pub(in crate::light) fn used_note(self, stored: Geometry) -> Option<String> {
        let displayed = self.displayed_size(stored);
        (displayed != stored).then(|| {
            format!("the pixel aspect ratio {self} is used: frames of {stored} become frames of {displayed}")
        })
    }

    /// Returns a note for pixels that are read as square although the file states another shape, or `None` if the size
    /// of the image would not change.
    pub(in crate::light) fn unused_note(self, stored: Geometry) -> Option<String> {
        let displayed = self.displayed_size(stored);
        (displayed != stored).then(|| {
            format!(
                "the pixel aspect ratio {self} is not used; if the pixels are not square, scale the image to {displayed}"
            )
        })
    }
}

impl std::fmt::Display for PixelAspect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longer_side_of_a_pixel_determines_the_displayed_size() {
        let displayed = |width, height| {
            PixelAspect::new(width, height).displayed_size(Geometry::new(720, 576).unwrap()).to_string()
        };
        assert_eq!(displayed(2.0, 1.0), "1440x576");
        assert_eq!(displayed(1.0, 2.0), "720x1152");
        // PAL: 720 * 16 / 15.
        assert_eq!(displayed(16.0, 15.0), "768x576");
        for (width, height) in
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 1.0), (1000.0, 1.0), (f64::NAN, 1.0)]
        {
            assert_eq!(displayed(width, height), "720x576", "{width}:{height}");
        }
    }
}
