//! The result of a render, which consists of the light and the labels at the pixel centers.

/// Number of color samples per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum SamplesPerPixel {
    /// Four samples (2x2), the default.
    #[default]
    Four,
    /// Sixteen samples (4x4).
    Sixteen,
}

impl SamplesPerPixel {
    pub(super) const fn count(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Sixteen => 16,
        }
    }
}

/// Labels at the pixel centers at one instant, in row-major order from the top row.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Labels {
    /// Number of columns of the image.
    pub width: usize,
    /// Number of rows of the image.
    pub height: usize,
    /// Time in seconds from the start of the scene.
    pub t: f64,
    /// Depth along the optical axis in meters. The depth is infinite in the sky.
    pub depth_m: Vec<f32>,
    /// Track id of the vehicle, or 0 if the pixel shows no vehicle.
    pub instance: Vec<u32>,
    /// Number of the semantic class; see [`Semantic`](crate::Semantic).
    pub semantic: Vec<u8>,
    /// Number of the rigid part plus 1, or 0 in the sky. The city is part 0, so its value is 1.
    pub part: Vec<u16>,
}

/// A rendered frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RenderedFrame {
    /// Labels at the pixel centers.
    pub labels: Labels,
    /// Mean luminance of each pixel in cd/m2, as in the light of readouts. In rain, at dusk and at night, the luminance of
    /// lamps is limited to a few times white, and the rest of their light is only in the glare of the lens.
    pub light: Vec<f32>,
    /// Mean color of each pixel in linear sRGB, in cd/m2. The luminance of lamps is not limited. Without lamps, the luminance
    /// of this color is the value in `light`.
    pub rgb: Vec<[f32; 3]>,
}
