//! Sums of the values and of the products of values in the square patches of an image.

use std::ops::Sub;

use nalgebra::{DMatrix, DMatrixView, DVector};
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::dispatch;

/// Number of patches per matrix product. Their values occupy at most 512 KiB.
const BATCH_PATCHES: usize = 1024;

/// An image from which its mean was subtracted. Products of large numbers would lose significant digits.
pub(crate) struct CenteredImage {
    values: Vec<f64>,
    geometry: Geometry,
}

impl CenteredImage {
    pub(crate) fn new(image: &[f32], geometry: Geometry) -> Self {
        let mean = image.iter().map(|v| f64::from(*v)).sum::<f64>() / image.len() as f64;
        Self { values: image.iter().map(|v| f64::from(*v) - mean).collect(), geometry }
    }
}

/// The first and second moments of a set of patches. A patch is a vector of `side * side` values, row by row.
pub(crate) struct PatchMoments {
    patches: usize,
    sums: DVector<f64>,
    products: DMatrix<f64>,
}

impl PatchMoments {
    /// Returns the moments of the patches that begin at the pixels `places`.
    pub(crate) fn of_places(image: &CenteredImage, places: &[usize], side: usize) -> Self {
        let (width, pixels) = (image.geometry.width(), side * side);
        let mut values = Vec::with_capacity(pixels * BATCH_PATCHES);
        let (mut sums, mut products) = (DVector::zeros(pixels), DMatrix::zeros(pixels, pixels));
        for part in places.chunks(BATCH_PATCHES) {
            values.clear();
            for row in part.iter().flat_map(|place| (0..side).map(move |y| place + y * width)) {
                values.extend_from_slice(&image.values[row..][..side]);
            }
            let patches = DMatrixView::from_slice(&values, pixels, part.len());
            let transposed = DMatrixView::from_slice_with_strides(&values, part.len(), pixels, pixels, 1);
            sums += patches.column_sum();
            products.gemm(1.0, &patches, &transposed, 1.0);
        }
        Self { patches: places.len(), sums, products }
    }

    /// Returns the moments of the patches that begin at every pixel. The image has at least `side` rows and columns.
    ///
    /// The sum of the products of two pixels of all patches is a sum over a region of the image `I(q) I(q + d)`. The
    /// displacement `d` between the two pixels has few different values, and the regions of a displacement overlap.
    pub(crate) fn of_every_patch(image: &CenteredImage, side: usize) -> Self {
        let (values, geometry, pixels) = (&image.values, image.geometry, side * side);
        let (mut sums, mut products) = (DVector::zeros(pixels), DMatrix::zeros(pixels, pixels));
        let ones = vec![1.0; values.len()];
        dispatch(
            #[inline(always)]
            || {
                region_sums([values, &ones], geometry, side, (0, 0), |at, _, sum| sums[at] = sum);
                for down in 0..side {
                    let first = if down == 0 { 0 } else { 1 - side as isize };
                    for right in first..side as isize {
                        region_sums([values, values], geometry, side, (down, right), |one, other, sum| {
                            (products[(one, other)], products[(other, one)]) = (sum, sum);
                        });
                    }
                }
            },
        );
        let starts = (geometry.width() + 1 - side) * (geometry.height() + 1 - side);
        Self { patches: starts, sums, products }
    }

    /// Returns the covariance of the values of a patch. The set has at least two patches.
    pub(crate) fn covariance(&self) -> DMatrix<f64> {
        let n = self.patches as f64;
        let mut products = self.products.clone();
        products.ger(-1.0 / n, &self.sums, &self.sums, 1.0);
        products / (n - 1.0)
    }
}

impl Sub<PatchMoments> for &PatchMoments {
    type Output = PatchMoments;

    /// Returns the moments of the patches that are not in the subset `other`.
    fn sub(self, other: PatchMoments) -> PatchMoments {
        PatchMoments {
            patches: self.patches - other.patches,
            sums: &self.sums - other.sums,
            products: &self.products - other.products,
        }
    }
}

/// Calls `take` with two pixels of a patch and with the sum of `a(q) b(q + displacement)` over all patches, where `q` is
/// the position of the first pixel. The pixels are numbered row by row. All pairs of pixels with the displacement
/// `(down, right)` are visited.
#[inline(always)]
fn region_sums(
    [a, b]: [&[f64]; 2],
    geometry: Geometry,
    side: usize,
    (down, right): (usize, isize),
    mut take: impl FnMut(usize, usize, f64),
) {
    let (width, columns, rows) =
        (geometry.width(), geometry.width() + 1 - side, geometry.height() + 1 - side);
    // The columns of a patch that the first pixel of a pair can have.
    let (left, end) = (right.min(0).unsigned_abs(), side - right.max(0).unsigned_abs());
    // The sum of each row of a region, for each column at which a region begins.
    let mut row_sums = vec![Vec::with_capacity(geometry.height()); end - left];
    for y in 0..geometry.height() - down {
        let one = &a[y * width + left..][..columns + end - left - 1];
        let other = &b[(y + down) * width + left.wrapping_add_signed(right)..][..one.len()];
        let mut sum = dot_product(&one[..columns], &other[..columns]);
        for (x, row_sums) in row_sums.iter_mut().enumerate() {
            if x > 0 {
                sum += one[x + columns - 1] * other[x + columns - 1] - one[x - 1] * other[x - 1];
            }
            row_sums.push(sum);
        }
    }
    for (x, row_sums) in (left..end).zip(row_sums) {
        let mut sum: f64 = row_sums[..rows].iter().sum();
        for y in 0..side - down {
            if y > 0 {
                sum += row_sums[y + rows - 1] - row_sums[y - 1];
            }
            take(y * side + x, (y + down) * side + x.wrapping_add_signed(right), sum);
        }
    }
}

/// Returns the sum of the products. Eight partial sums let the compiler use vectors.
#[inline(always)]
fn dot_product(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    const SIDE: usize = 7;

    fn image(width: u32, height: u32) -> CenteredImage {
        let geometry = Geometry::new(width, height).unwrap();
        let pattern = PatternRng::new(Seeds::default(), RandomStream::from_name("covariance"));
        let normals = pattern.normals().take(geometry.pixels()).enumerate();
        let values: Vec<f32> = normals.map(|(p, x)| (5.0 + x + (p % 7) as f64) as f32).collect();
        CenteredImage::new(&values, geometry)
    }

    fn places(image: &CenteredImage) -> Vec<usize> {
        let (width, height) = (image.geometry.width(), image.geometry.height());
        (0..=height - SIDE).flat_map(|y| (0..=width - SIDE).map(move |x| y * width + x)).collect()
    }

    /// The values are below 10, and a sum of `n` products of two such values has a rounding error of at most
    /// `100 n^2 2^-53`. The covariance divides the sum by `n`. For 12,000 patches, the bound is 1.4e-10.
    fn assert_same(one: DMatrix<f64>, other: DMatrix<f64>) {
        let largest = (one - other).abs().max();
        assert!(largest < 1.4e-10, "{largest}");
    }

    #[test]
    fn every_patch_has_the_covariance_of_the_patches_one_by_one() {
        for (width, height) in [(150, 90), (8, 40), (7, 60), (61, 7)] {
            let image = image(width, height);
            let places = places(&image);
            let (n, pixels) = (places.len() as f64, SIDE * SIDE);
            let width = width as usize;
            let value = |place: usize, k: usize| image.values[place + k / SIDE * width + k % SIDE];
            let means: Vec<f64> =
                (0..pixels).map(|k| places.iter().map(|p| value(*p, k)).sum::<f64>() / n).collect();
            let expected = DMatrix::from_fn(pixels, pixels, |i, j| {
                let product = |p: &usize| (value(*p, i) - means[i]) * (value(*p, j) - means[j]);
                places.iter().map(product).sum::<f64>() / (n - 1.0)
            });
            assert_same(PatchMoments::of_every_patch(&image, SIDE).covariance(), expected.clone());
            assert_same(PatchMoments::of_places(&image, &places, SIDE).covariance(), expected);
        }
    }

    #[test]
    fn the_rest_of_the_patches_has_its_own_covariance() {
        let image = image(120, 60);
        let (some, rest): (Vec<usize>, Vec<usize>) =
            places(&image).into_iter().partition(|place| place % 3 == 1);
        let all = PatchMoments::of_every_patch(&image, SIDE);
        let difference = &all - PatchMoments::of_places(&image, &some, SIDE);
        assert_same(difference.covariance(), PatchMoments::of_places(&image, &rest, SIDE).covariance());
    }
}
