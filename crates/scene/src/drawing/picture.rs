//! What a render gives: light, and labels of the pixels' centres.

/// Colour samples in a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum SamplesPerPixel {
    /// 2x2: four, the default.
    #[default]
    Four,
    /// 4x4: sixteen.
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

/// What the centres of the pixels see at one instant; row-major, top row first.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Labels {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The instant, in seconds from the start of the scene.
    pub t: f64,
    /// Depth along the optical axis in metres; infinite in the sky.
    pub depth_m: Vec<f32>,
    /// Track id of the vehicle, or 0.
    pub instance: Vec<u32>,
    /// A [`Semantic`](crate::Semantic) as its number.
    pub semantic: Vec<u8>,
    /// Number of the rigid part plus one (1 is the city), or 0 in the sky.
    pub part: Vec<u16>,
}

/// A rendered frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rendered {
    /// What the pixels' centres see.
    pub labels: Labels,
    /// Mean luminance over each pixel in cd/m2.
    pub light: Vec<f32>,
    /// The same in linear sRGB, for people to look at.
    pub rgb: Vec<[f32; 3]>,
}
