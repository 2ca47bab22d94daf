//! Draws for the fixed pattern. Every camera has one set of draws per pixel.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;

use crate::draws::hash::mix64;
use crate::draws::{RandomStream, Seeds};

/// The draws of one stream in the order of the pixels (row-major, top row first).
///
/// The generator reserves [`PatternRng::DRAWS_PER_PIXEL`] outputs for each pixel. [`PatternRng::pixel`] can therefore
/// jump to any pixel. The values of a pixel do not depend on which pixels are drawn before it.
///
/// # Examples
/// ```
/// use spikelane::{PatternRng, RandomStream, Seeds};
/// let seeds = Seeds { camera: 7, ..Seeds::default() };
/// let mut pattern = PatternRng::new(seeds, RandomStream::from_name("my_effect"));
/// let normals: Vec<f64> = pattern.normals().take(100).collect();
/// // The draws of pixel 42 do not depend on the draws of other pixels.
/// assert_eq!(pattern.pixel(42).normal(), normals[42]);
/// ```
#[derive(Clone, Debug)]
pub struct PatternRng {
    origin: Pcg64,
    rng: Pcg64,
}

impl PatternRng {
    /// Number of generator outputs that are reserved for each pixel.
    pub const DRAWS_PER_PIXEL: u64 = 4;

    /// Returns the draws of `stream` for the camera seed.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{PatternRng, RandomStream, Seeds};
    /// let normal = |camera| {
    ///     let seeds = Seeds { camera, ..Seeds::default() };
    ///     PatternRng::new(seeds, RandomStream::from_name("my_effect")).pixel(0).normal()
    /// };
    /// // Each camera has its own fixed pattern.
    /// assert_eq!(normal(1), normal(1));
    /// assert_ne!(normal(1), normal(2));
    /// ```
    #[must_use]
    pub fn new(seeds: Seeds, stream: RandomStream) -> Self {
        let state = u128::from(mix64(seeds.camera)) << 64 | u128::from(mix64(!seeds.camera));
        let origin = Pcg64::new(state, u128::from(stream.id()));
        Self { rng: origin.clone(), origin }
    }

    /// Returns the draws of `pixel`. They start at the position that the generator reserves for this pixel.
    pub fn pixel(&mut self, pixel: usize) -> PixelRng<'_> {
        self.rng = self.origin.clone();
        self.rng.advance(u128::from(Self::DRAWS_PER_PIXEL) * pixel as u128);
        PixelRng { rng: &mut self.rng }
    }

    /// Returns one standard normal value per pixel, starting with the first pixel.
    pub fn normals(&self) -> impl Iterator<Item = f64> + use<> {
        self.per_pixel(|d| d.normal())
    }

    /// Returns the values of [`PatternRng::normals`] if `wanted` is true. Otherwise returns zeros without drawing.
    pub fn normals_if(&self, wanted: bool) -> impl Iterator<Item = f64> + use<> {
        self.per_pixel(move |d| if wanted { d.normal() } else { 0.0 })
    }

    /// Returns one uniform value in (0, 1) per pixel, starting with the first pixel.
    pub fn uniforms(&self) -> impl Iterator<Item = f64> + use<> {
        self.per_pixel(|d| d.uniform())
    }

    /// Returns the result of one call of `draw` per pixel, starting with the first pixel.
    pub fn per_pixel<T, F>(&self, mut draw: F) -> impl Iterator<Item = T> + use<T, F>
    where
        F: FnMut(&mut PixelRng<'_>) -> T,
    {
        // Discarding the outputs of a pixel is faster than jumping to the next pixel.
        let mut place = self.origin.clone();
        std::iter::repeat_with(move || {
            let mut rng = place.clone();
            for _ in 0..Self::DRAWS_PER_PIXEL {
                place.next_u64();
            }
            draw(&mut PixelRng { rng: &mut rng })
        })
    }
}

/// The draws of one pixel.
///
/// # Examples
/// ```
/// use spikelane::{PatternRng, PixelRng, RandomStream, Seeds};
/// /// Draws a hot pixel with probability `share`.
/// fn is_hot(draws: &mut PixelRng<'_>, share: f64) -> bool {
///     draws.uniform() < share
/// }
/// let pattern = PatternRng::new(Seeds::default(), RandomStream::from_name("my_hot_pixels"));
/// let hot = pattern.per_pixel(|draws| is_hot(draws, 0.1)).take(10_000).filter(|hot| *hot).count();
/// // A tenth of 10,000 pixels, within five standard deviations of 30 pixels.
/// assert!((850..1150).contains(&hot));
/// ```
#[derive(Debug)]
pub struct PixelRng<'a> {
    rng: &'a mut Pcg64,
}

impl PixelRng<'_> {
    /// Returns a uniform value in the open interval (0, 1) from 53 random bits.
    pub fn uniform(&mut self) -> f64 {
        ((self.rng.next_u64() >> 11) as f64 + 0.5) * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns a standard normal value by the Box-Muller transform of two uniform values.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(camera: u64) -> PatternRng {
        let seeds = Seeds { camera, ..Seeds::default() };
        PatternRng::new(seeds, RandomStream::from_name("test"))
    }

    #[test]
    fn jumping_to_a_pixel_gives_its_place_in_the_table() {
        let table: Vec<_> = pattern(3).normals().take(100).collect();
        assert_eq!(pattern(3).pixel(71).normal().to_bits(), table[71].to_bits());
        assert_ne!(pattern(4).normals().next(), Some(table[0]));
    }

    #[test]
    fn normals_have_the_moments_of_a_normal() {
        // At n = 200,000 the standard errors are: mean 0.0022, variance 0.0032, kurtosis 0.011. Each bound is five
        // standard errors.
        let x: Vec<_> = pattern(1).normals().take(200_000).collect();
        let n = x.len() as f64;
        let moment = |k: i32| x.iter().map(|v| v.powi(k)).sum::<f64>() / n;
        assert!(moment(1).abs() < 0.011);
        assert!((moment(2) - 1.0).abs() < 0.016);
        assert!((moment(4) - 3.0).abs() < 0.11);
    }
}
