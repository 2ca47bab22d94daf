//! Applies a lens to the light of an image: vignetting, blur, bloom and veiling glare.

use super::halo::{CoarseImage, gaussian_kernel};
use super::lens::Lens;

/// Radius of the core in pixels. A Gaussian with a standard deviation of 1 has 0.3 % of its weight outside.
const MIN_RADIUS: usize = 3;

/// A lens, prepared for images of one size.
#[derive(Debug)]
pub(crate) struct ImageFormation {
    lens: Lens,
    width: usize,
    /// Fraction of the light that reaches each pixel.
    transmission: Vec<f32>,
    kernel: Vec<f32>,
}

impl ImageFormation {
    pub(crate) fn new(lens: Lens, width: usize, height: usize) -> Self {
        let (cx, cy) = (0.5 * width as f32, 0.5 * height as f32);
        let transmission = (0..width * height).map(|i| {
            let (x, y) = ((i % width) as f32 + 0.5 - cx, (i / width) as f32 + 0.5 - cy);
            1.0 - lens.vignetting * (x * x + y * y) / (cx * cx + cy * cy)
        });
        let radius = MIN_RADIUS.max((3.0 * lens.blur_px).ceil() as usize);
        Self {
            lens,
            width,
            transmission: transmission.collect(),
            kernel: if lens.blur_px > 0.0 { gaussian_kernel(lens.blur_px, radius) } else { Vec::new() },
        }
    }

    /// Replaces the light that arrives at the lens by the light on the sensor. The image has the size of this lens, and
    /// outside the image its border is repeated. `glare` is light that adds only to the bloom and the veil. It may be empty.
    pub(crate) fn apply(&self, light: &mut [f32], glare: &[f32]) {
        if self.lens == Lens::IDEAL.with_corner_distortion(self.lens.corner_distortion) {
            return;
        }
        light.iter_mut().zip(&self.transmission).for_each(|(x, t)| *x *= t);
        let halo = (self.lens.bloom + self.lens.glare > 0.0).then(|| {
            let mut all = light.to_vec();
            all.iter_mut().zip(glare).for_each(|(light, glare)| *light += glare);
            CoarseImage::halo(&all, self.width, &self.lens)
        });
        if !self.kernel.is_empty() {
            self.blur(light);
        }
        let Some(halo) = halo else { return };
        let core = 1.0 - self.lens.bloom - self.lens.glare;
        let mut row_halo = vec![0.0; self.width];
        for (y, row) in light.chunks_mut(self.width).enumerate() {
            halo.enlarge_row(y, &mut row_halo);
            row.iter_mut().zip(&row_halo).for_each(|(x, halo)| *x = core * *x + halo);
        }
    }

    /// Applies the lens to each color of an image.
    pub(crate) fn apply_rgb(&self, rgb: &mut [[f32; 3]]) {
        for channel in 0..3 {
            let mut light: Vec<f32> = rgb.iter().map(|c| c[channel]).collect();
            self.apply(&mut light, &[]);
            rgb.iter_mut().zip(light).for_each(|(c, x)| c[channel] = x);
        }
    }

    fn blur(&self, light: &mut [f32]) {
        let (w, radius) = (self.width, self.kernel.len() / 2);
        let height = light.len() / w;
        let mut rows = vec![0.0; light.len()];
        let mut padded = vec![0.0; w + 2 * radius];
        for (row, out) in light.chunks_exact(w).zip(rows.chunks_exact_mut(w)) {
            padded[..radius].fill(row[0]);
            padded[radius..radius + w].copy_from_slice(row);
            padded[radius + w..].fill(row[w - 1]);
            for (k, weight) in self.kernel.iter().enumerate() {
                out.iter_mut().zip(&padded[k..]).for_each(|(out, x)| *out += weight * x);
            }
        }
        for (y, out) in light.chunks_exact_mut(w).enumerate() {
            out.fill(0.0);
            for (k, weight) in self.kernel.iter().enumerate() {
                let from = (y + k).saturating_sub(radius).min(height - 1) * w;
                out.iter_mut().zip(&rows[from..]).for_each(|(out, x)| *out += weight * x);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ImageFormation;
    use crate::optics::lens::Lens;

    const SIZE: (usize, usize) = (61, 45);

    fn formed(lens: Lens, light: impl Fn(usize, usize) -> f32) -> Vec<f32> {
        let (w, h) = SIZE;
        let mut image: Vec<f32> = (0..w * h).map(|i| light(i % w, i / w)).collect();
        ImageFormation::new(lens, w, h).apply(&mut image, &[]);
        image
    }

    #[test]
    fn uniform_light_stays_uniform_without_vignetting() {
        let image = formed(Lens::from_seed(3).with_vignetting(0.0), |_, _| 5.0);
        assert!(image.iter().all(|x| (x - 5.0).abs() < 1e-5));
    }

    #[test]
    fn corners_lose_the_stated_fraction_of_light() {
        let image = formed(Lens::IDEAL.with_vignetting(0.3), |_, _| 1.0);
        // The center of the corner pixel is half a pixel from the corner.
        assert!((image[0] - 0.7).abs() < 0.02 && (image[22 * 61 + 30] - 1.0).abs() < 1e-4, "{}", image[0]);
    }

    /// The Gaussian has 4.6 % of its weight beyond two standard deviations in one direction.
    #[test]
    fn a_point_becomes_a_core_with_a_bloom() {
        let lens = Lens::IDEAL.with_blur_px(0.5).with_bloom(0.02);
        let image = formed(lens, |x, y| f32::from(u8::from((x, y) == (30, 22))));
        let total: f32 = image.iter().sum();
        assert!((total - 1.0).abs() < 1e-3, "{total}");
        let at = |dx: usize| image[22 * 61 + 30 + dx];
        // Samples of the Gaussian at 0 and 1 pixel differ by the factor exp(2).
        assert!((at(0) / at(1) - 2f32.exp()).abs() < 0.05, "{} {}", at(0), at(1));
        // At a distance of 5 pixels, the core is below 1e-20. The bloom is about 4 pixels wide.
        assert!(at(5) > 1e-5 && at(5) < 1e-3, "{}", at(5));
    }

    #[test]
    fn an_ideal_lens_changes_no_bit() {
        let light = |x: usize, y: usize| (x * 7 + y * 13) as f32 * 0.37;
        let image = formed(Lens::IDEAL, light);
        assert!((0..61 * 45).all(|i| image[i] == light(i % 61, i / 61)));
    }
}
