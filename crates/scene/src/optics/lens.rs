//! Properties of a lens.

use spikelane::error::{Result, error};

use crate::drive::camera::Intrinsics;
use crate::random::Draws;

/// A lens.
///
/// A point of light becomes a spot with three parts: a Gaussian core, a bloom of about 10 pixels, and a veil over the
/// image.
///
/// # Examples
/// ```
/// use spikelane_scene::Lens;
/// let lens = Lens::from_seed(7);
/// assert!((0.45..=0.6).contains(&lens.blur_px));
/// assert_eq!(Lens::IDEAL.with_vignetting(0.2).vignetting, 0.2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Lens {
    /// Standard deviation of the core in pixels, 0 to 3.
    pub blur_px: f32,
    /// Fraction of the light in the bloom, 0 to 0.5.
    pub bloom: f32,
    /// Fraction of the light in the veil, 0 to 0.5.
    pub glare: f32,
    /// Fraction of the light that is lost in the corners of the image, 0 to 0.9. The loss grows with the square of the
    /// distance from the center.
    pub vignetting: f32,
    /// Relative displacement of the corners of the image by distortion, -0.3 to 0. Negative values are barrel
    /// distortion.
    pub corner_distortion: f32,
}

spikelane::unstable::with_methods!(Lens {
    with_blur_px: blur_px: f32,
    with_bloom: bloom: f32,
    with_glare: glare: f32,
    with_vignetting: vignetting: f32,
    with_corner_distortion: corner_distortion: f32,
});

impl Lens {
    /// A lens without any effect on the image.
    pub const IDEAL: Self =
        Self { blur_px: 0.0, bloom: 0.0, glare: 0.0, vignetting: 0.0, corner_distortion: 0.0 };

    /// Returns the lens that `seed` determines.
    ///
    /// The ranges are those of lenses for machine vision: a blur of about a pixel in total, a veiling glare of 1 to 3 %,
    /// corners that are 10 to 35 % darker, and a barrel distortion of 1 to 4 %.
    #[must_use]
    pub fn from_seed(seed: u64) -> Self {
        let draws = Draws::new(seed, "lens");
        Self {
            blur_px: draws.range_f32(0, 0.45, 0.6),
            bloom: draws.range_f32(1, 0.008, 0.02),
            glare: draws.range_f32(2, 0.008, 0.02),
            vignetting: draws.range_f32(3, 0.1, 0.35),
            corner_distortion: draws.range_f32(4, -0.04, -0.01),
        }
    }

    /// Returns the lens without distortion.
    #[must_use]
    pub fn without_distortion(self) -> Self {
        Self { corner_distortion: 0.0, ..self }
    }

    pub(crate) fn check(&self) -> Result<()> {
        let ranges = [
            ("lens blur", self.blur_px, 0.0, 3.0),
            ("lens bloom", self.bloom, 0.0, 0.5),
            ("lens glare", self.glare, 0.0, 0.5),
            ("lens vignetting", self.vignetting, 0.0, 0.9),
            ("lens distortion", self.corner_distortion, -0.3, 0.0),
        ];
        match ranges.into_iter().find(|(_, value, low, high)| !(*low..=*high).contains(value)) {
            None => Ok(()),
            Some((name, value, low, high)) => Err(error!(Usage, "{name}"; found "{value}";
                expected "{low} to {high}"; remedy "use a value in this range")),
        }
    }

    /// Returns the parameter of the division model for a camera without distortion.
    ///
    /// The corner has the radius R without distortion and r = R (1 + c) with distortion. The model states R = r / (1 +
    /// lambda r^2), so lambda = c / r^2.
    pub(crate) fn division_lambda(&self, intrinsics: &Intrinsics) -> f64 {
        if self.corner_distortion == 0.0 {
            return 0.0;
        }
        let corner = libm::hypot(intrinsics.center_px[0], intrinsics.center_px[1]) / intrinsics.focal_px;
        let change = f64::from(self.corner_distortion);
        change / (corner * (1.0 + change)).powi(2)
    }
}
