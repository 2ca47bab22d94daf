//! Determines the pixels whose light between two renders cannot be warped reliably.
//!
//! Warping moves the light around a pixel with one motion. If the motions around the pixel differ, the light is displaced
//! by up to this difference, and its error is the displacement times the gradient of the light. A shadow or a reflection
//! moves differently from the surface that shows it, so the two warped renders disagree.

use std::ops::Range;

use crate::ground_truth::flow::Motions;
use crate::ground_truth::warp::warp_run;
use crate::rendering::rendered_frame::Labels;

/// Maximum error of the light by different motions around a pixel, as a fraction of white.
const MAX_PARALLAX_ERROR: f32 = 4e-2;
/// Maximum difference between one render and the other render, warped to its instant: a fraction of white, and a fraction
/// of the contrast around the pixel. The lens removes most of the contrast that the interpolation of the warp loses.
const MAX_DIFFERENCE: f32 = 3e-2;
const MAX_CONTRAST_LOSS: f32 = 0.18;
/// Maximum distance in pixels at which light and motions around a pixel are compared.
const MAX_REACH_PX: usize = 3;

/// A rectangle of pixels.
struct Region {
    columns: Range<usize>,
    rows: Range<usize>,
}

/// Returns whether each pixel of a tile must be rendered anew between two renders.
///
/// `views` contains the labels, the light and the motion to the other instant of both renders. `motion_px` is the motion
/// of the tile between the renders.
pub(super) fn unreliable_pixels(
    (columns, rows): (Range<usize>, Range<usize>),
    views: [(&Labels, &[f32], &Motions); 2],
    motion_px: f32,
    white: f32,
) -> Vec<bool> {
    let reach = (motion_px.ceil() as usize).clamp(1, MAX_REACH_PX);
    let mut unreliable = vec![false; columns.len() * rows.len()];
    for (k, (labels, light, motions)) in views.into_iter().enumerate() {
        let around = Region {
            columns: columns.start.saturating_sub(reach)..(columns.end + reach).min(labels.width),
            rows: rows.start.saturating_sub(reach)..(rows.end + reach).min(labels.height),
        };
        let (dx, dy) = around.displacements(labels, motions);
        let spread = |values: &[f32]| around.spread(values, &columns, &rows, reach);
        let contrast = spread(&around.crop(light, labels.width));
        let parallax = spread(&dx).into_iter().zip(spread(&dy)).map(|(x, y)| x.max(y));
        for ((unreliable, parallax), contrast) in unreliable.iter_mut().zip(parallax).zip(&contrast) {
            *unreliable |= 0.5 * parallax * contrast > MAX_PARALLAX_ERROR * white;
        }
        let other = views[1 - k].1;
        let mut warped = vec![0.0; columns.len()];
        for (i, row) in rows.clone().enumerate() {
            warp_run(motions, labels, light, row, columns.start, &mut warped);
            let at = i * columns.len()..(i + 1) * columns.len();
            let actual = &other[row * labels.width + columns.start..][..columns.len()];
            let pixels = unreliable[at.clone()].iter_mut().zip(&contrast[at]);
            for ((unreliable, contrast), (x, y)) in pixels.zip(warped.iter().zip(actual)) {
                *unreliable |= (x - y).abs() > MAX_DIFFERENCE * white + MAX_CONTRAST_LOSS * contrast;
            }
        }
    }
    unreliable
}

impl Region {
    /// Returns the values of an image in this region.
    fn crop(&self, image: &[f32], width: usize) -> Vec<f32> {
        let row = |y: usize| &image[y * width + self.columns.start..y * width + self.columns.end];
        self.rows.clone().flat_map(|y| row(y).iter().copied()).collect()
    }

    /// Returns the horizontal and vertical displacements of the pixels in this region.
    fn displacements(&self, labels: &Labels, motions: &Motions) -> (Vec<f32>, Vec<f32>) {
        let n = self.columns.len();
        let (mut dx, mut dy) = (Vec::with_capacity(n * self.rows.len()), Vec::new());
        for row in self.rows.clone() {
            for column in self.columns.clone().step_by(4) {
                let (x, y) = motions.displacements4(labels, row, column);
                let count = (self.columns.end - column).min(4);
                dx.extend_from_slice(&x.to_array()[..count]);
                dy.extend_from_slice(&y.to_array()[..count]);
            }
        }
        (dx, dy)
    }

    /// Returns the difference between the largest and the smallest value within `reach` pixels of each pixel of a tile.
    /// `values` are the values of this region.
    fn spread(&self, values: &[f32], columns: &Range<usize>, rows: &Range<usize>, reach: usize) -> Vec<f32> {
        let n = self.columns.len();
        let mut out = Vec::with_capacity(columns.len() * rows.len());
        // The lists are padded, so that every window across has the same width.
        let (mut low, mut high) = (vec![0.0f32; n + 2 * reach], vec![0.0f32; n + 2 * reach]);
        for row in rows.clone() {
            let first = row.saturating_sub(reach).max(self.rows.start) - self.rows.start;
            let end = (row + reach + 1).min(self.rows.end) - self.rows.start;
            low.fill(f32::MAX);
            high.fill(f32::MIN);
            for line in values[first * n..end * n].chunks_exact(n) {
                let (low, high) = (&mut low[reach..reach + n], &mut high[reach..reach + n]);
                for ((low, high), &x) in low.iter_mut().zip(high).zip(line) {
                    *low = if x < *low { x } else { *low };
                    *high = if x > *high { x } else { *high };
                }
            }
            let offset = columns.start - self.columns.start;
            let at = out.len();
            let (mut least, mut most) = (vec![f32::MAX; columns.len()], vec![f32::MIN; columns.len()]);
            for k in 0..=2 * reach {
                let window = offset + k..offset + k + columns.len();
                for ((least, most), (&l, &h)) in
                    least.iter_mut().zip(&mut most).zip(low[window.clone()].iter().zip(&high[window]))
                {
                    *least = if l < *least { l } else { *least };
                    *most = if h > *most { h } else { *most };
                }
            }
            out.extend(most.iter().zip(&least).map(|(most, least)| most - least));
            debug_assert_eq!(out.len() - at, columns.len());
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::Region;

    #[test]
    fn spread_is_the_range_of_a_window() {
        let region = Region { columns: 2..9, rows: 1..6 };
        let value = |x: usize, y: usize| ((x * 31 + y * 17) % 23) as f32;
        let values: Vec<f32> = (1..6).flat_map(|y| (2..9).map(move |x| value(x, y))).collect();
        let spread = region.spread(&values, &(3..9), &(1..5), 2);
        for (i, actual) in spread.into_iter().enumerate() {
            let (x, y) = (3 + i % 6, 1 + i / 6);
            let window: Vec<f32> = (y.saturating_sub(2).max(1)..(y + 3).min(6))
                .flat_map(|y| (x.saturating_sub(2).max(2)..(x + 3).min(9)).map(move |x| value(x, y)))
                .collect();
            let range = window.iter().copied().fold(f32::MIN, f32::max)
                - window.iter().copied().fold(f32::MAX, f32::min);
            assert_eq!(actual, range, "pixel {x}, {y}");
        }
    }
}
