//! The wide parts of the spot that a lens makes of a point of light.
//!
//! Both parts are smooth, so they are computed on coarse grids: the bloom on cells of 4 x 4 pixels, and the veil on cells
//! of 16 x 16 pixels.

use super::lens::Lens;

/// Side of a cell, in cells of the next finer grid.
const CELL: usize = 4;
/// Standard deviations of the bloom and of the veil, in cells of their grids.
const BLOOM_SIGMA_CELLS: f32 = 1.0;
const VEIL_SIGMA_CELLS: f32 = 1.5;
/// Fraction of the veil that is uniform over the image. Reflections between the surfaces of the lens cause this part.
const UNIFORM_SHARE: f32 = 0.4;

/// An image on a coarse grid.
pub(super) struct CoarseImage {
    width: usize,
    height: usize,
    cells: Vec<f32>,
}

impl CoarseImage {
    /// Returns the sum of bloom and veil on the grid of the bloom.
    pub(super) fn halo(light: &[f32], width: usize, lens: &Lens) -> Self {
        let mut bloom = Self::reduce(light, width);
        let mut veil = Self::reduce(&bloom.cells, bloom.width);
        let mean = bloom.cells.iter().sum::<f32>() / bloom.cells.len() as f32;
        bloom.blur(BLOOM_SIGMA_CELLS);
        veil.blur(VEIL_SIGMA_CELLS);
        let (near, far) = (lens.glare * (1.0 - UNIFORM_SHARE), lens.glare * UNIFORM_SHARE * mean);
        let mut row = vec![0.0; bloom.width];
        for (y, cells) in bloom.cells.chunks_mut(bloom.width).enumerate() {
            veil.enlarge_row(y, &mut row);
            for (cell, veil) in cells.iter_mut().zip(&row) {
                *cell = lens.bloom * *cell + near * veil + far;
            }
        }
        bloom
    }

    /// Returns the means of cells.
    fn reduce(fine: &[f32], fine_width: usize) -> Self {
        let fine_height = fine.len() / fine_width;
        let (width, height) = (fine_width.div_ceil(CELL), fine_height.div_ceil(CELL));
        let mut cells = Vec::with_capacity(width * height);
        let mut sums = vec![0.0f32; fine_width];
        for rows in fine.chunks(CELL * fine_width) {
            sums.fill(0.0);
            for row in rows.chunks_exact(fine_width) {
                sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
            }
            let count = (rows.len() / fine_width) as f32;
            cells.extend(sums.chunks(CELL).map(|c| c.iter().sum::<f32>() / (count * c.len() as f32)));
        }
        Self { width, height, cells }
    }

    /// Convolves with a Gaussian. Outside the grid, the cells of its border are repeated.
    fn blur(&mut self, sigma: f32) {
        let kernel = gaussian_kernel(sigma, (3.0 * sigma).ceil() as usize);
        let radius = kernel.len() / 2;
        let at = |i: usize, k: usize, n: usize| (i + k).saturating_sub(radius).min(n - 1);
        let sum = |cell: &dyn Fn(usize) -> f32| -> f32 {
            kernel.iter().enumerate().map(|(k, weight)| weight * cell(k)).sum()
        };
        let (w, h) = (self.width, self.height);
        let across: Vec<f32> =
            (0..w * h).map(|i| sum(&|k| self.cells[i / w * w + at(i % w, k, w)])).collect();
        self.cells = (0..w * h).map(|i| sum(&|k| across[at(i / w, k, h) * w + i % w])).collect();
    }

    /// Interpolates row `y` of the next finer grid, linearly between the centers of the cells.
    pub(super) fn enlarge_row(&self, y: usize, out: &mut [f32]) {
        let place = |i: usize, n: usize| {
            let x = (i as f32 + 0.5) / CELL as f32 - 0.5;
            let low = x.max(0.0) as usize;
            let low = low.min(n - 1);
            (low, (low + 1).min(n - 1), (x - low as f32).max(0.0))
        };
        let (top, bottom, part) = place(y, self.height);
        let (above, below) = (&self.cells[top * self.width..], &self.cells[bottom * self.width..]);
        let column = |k: usize| above[k] + (below[k] - above[k]) * part;
        for (k, out) in out.chunks_mut(CELL).enumerate() {
            let (before, here, after) =
                (column(k.saturating_sub(1)), column(k), column((k + 1).min(self.width - 1)));
            for (i, out) in out.iter_mut().enumerate() {
                let offset = (i as f32 + 0.5) / CELL as f32 - 0.5;
                let other = if offset < 0.0 { before } else { after };
                *out = here + (other - here) * offset.abs();
            }
        }
    }
}

/// Returns the samples of a Gaussian at the integers from -`radius` to `radius`, scaled to the sum 1.
pub(super) fn gaussian_kernel(sigma: f32, radius: usize) -> Vec<f32> {
    let weight = |k: usize| {
        let x = k as f32 - radius as f32;
        libm::expf(-0.5 * (x / sigma) * (x / sigma))
    };
    let sum: f32 = (0..=2 * radius).map(weight).sum();
    (0..=2 * radius).map(|k| weight(k) / sum).collect()
}
