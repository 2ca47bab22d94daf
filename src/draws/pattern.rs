//! Draws for the fixed pattern: one set per pixel, made once per camera.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;

use crate::draws::hash::mix64;
use crate::draws::{Seeds, Stream};

/// Draws of one stream, in the order of the pixels (row-major, top row first).
///
/// Every pixel owns [`Pattern::STRIDE`] numbers of the generator, so
/// [`Pattern::at`] can jump to any pixel and a sub-range gives the same table.
#[derive(Clone, Debug)]
pub struct Pattern {
    origin: Pcg64,
    rng: Pcg64,
}

impl Pattern {
    /// Generator outputs reserved for each pixel.
    pub const STRIDE: u64 = 4;

    /// The pattern of `stream` for the camera seed.
    #[must_use]
    pub fn new(seeds: Seeds, stream: Stream) -> Self {
        let state = u128::from(mix64(seeds.camera)) << 64 | u128::from(mix64(!seeds.camera));
        let origin = Pcg64::new(state, u128::from(stream.id()));
        Self { rng: origin.clone(), origin }
    }

    /// The draws of `pixel`, which start at its own place in the generator.
    pub fn at(&mut self, pixel: usize) -> Draws<'_> {
        self.rng = self.origin.clone();
        self.rng.advance(u128::from(Self::STRIDE) * pixel as u128);
        Draws { rng: &mut self.rng }
    }

    /// One standard normal value per pixel, from the first pixel on.
    pub fn normals(&self) -> impl Iterator<Item = f64> + use<> {
        self.each(|d| d.normal())
    }

    /// [`Pattern::normals`], or zeros without the work when `wanted` is false.
    pub fn normals_if(&self, wanted: bool) -> impl Iterator<Item = f64> + use<> {
        self.each(move |d| if wanted { d.normal() } else { 0.0 })
    }

    /// One uniform value in (0, 1) per pixel, from the first pixel on.
    pub fn uniforms(&self) -> impl Iterator<Item = f64> + use<> {
        self.each(|d| d.uniform())
    }

    /// One value of `draw` per pixel, from the first pixel on.
    pub fn each<T, F>(&self, mut draw: F) -> impl Iterator<Item = T> + use<T, F>
    where
        F: FnMut(&mut Draws<'_>) -> T,
    {
        // Stepping over a pixel's numbers is cheaper than a jump to each.
        let mut place = self.origin.clone();
        std::iter::repeat_with(move || {
            let mut rng = place.clone();
            for _ in 0..Self::STRIDE {
                place.next_u64();
            }
            draw(&mut Draws { rng: &mut rng })
        })
    }
}

/// The draws of one pixel.
#[derive(Debug)]
pub struct Draws<'a> {
    rng: &'a mut Pcg64,
}

impl Draws<'_> {
    /// Uniform in the open interval (0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        ((self.rng.next_u64() >> 11) as f64 + 0.5) * (1.0 / (1u64 << 53) as f64)
    }

    /// Standard normal, by the transform of Box and Muller; two uniforms each.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(camera: u64) -> Pattern {
        let seeds = Seeds { camera, ..Seeds::default() };
        Pattern::new(seeds, Stream::named("test"))
    }

    #[test]
    fn jumping_to_a_pixel_gives_its_place_in_the_table() {
        let table: Vec<_> = pattern(3).normals().take(100).collect();
        assert_eq!(pattern(3).at(71).normal().to_bits(), table[71].to_bits());
        assert_ne!(pattern(4).normals().next(), Some(table[0]));
    }

    #[test]
    fn normals_have_the_moments_of_a_normal() {
        // Standard errors at n = 200,000: mean 0.0022, variance 0.0032, kurtosis 0.011; bounds are 5 of each.
        let x: Vec<_> = pattern(1).normals().take(200_000).collect();
        let n = x.len() as f64;
        let moment = |k: i32| x.iter().map(|v| v.powi(k)).sum::<f64>() / n;
        assert!(moment(1).abs() < 0.011);
        assert!((moment(2) - 1.0).abs() < 0.016);
        assert!((moment(4) - 3.0).abs() < 0.11);
    }
}
