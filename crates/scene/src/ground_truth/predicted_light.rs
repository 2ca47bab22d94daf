//! Predicts the light of pixels that need no render.
//!
//! The renders before and after an instant are both warped to the instant. A prediction is reliable under two
//! conditions. The two warped renders must agree, and the light around the pixel must be uniform in both renders.
//! Pixels at edges of objects and shadows, in leaves and in fine texture are rendered. Such pixels are only a small
//! part of an image.

use std::ops::Range;

use crate::ground_truth::flow::Motions;
use crate::ground_truth::light_span::SpanRenderer;
use crate::ground_truth::warp::{blend_into, warp_run};
use crate::rendering::tiles::Tiles;
use spikelane::unstable::threads;

/// Maximum difference between the two warped renders, as a fraction of the white luminance.
const MAX_SIDE_DIFFERENCE: f32 = 1e-3;
/// Maximum difference between the brightest and the darkest pixel around a pixel, as a fraction of the white
/// luminance.
const MAX_LOCAL_CONTRAST: f32 = 1.5e-2;
/// Maximum radius of the examined area around a pixel, in pixels. If the motion in a tile exceeds this radius, the
/// tile is not predicted.
const MAX_REACH_PX: usize = 2;

/// Predicted light of a tile, and the pixels whose prediction is as accurate as a render.
pub(super) struct PredictedLight {
    pub light: Vec<f32>,
    pub is_reliable: Vec<bool>,
}

/// Predictions of the tiles that must be rendered at an instant.
pub(super) struct TilePredictions(Vec<(usize, Option<PredictedLight>)>);

impl TilePredictions {
    fn predictions(&self) -> impl Iterator<Item = (usize, &PredictedLight)> {
        self.0.iter().filter_map(|(tile, guess)| Some((*tile, guess.as_ref()?)))
    }

    /// Marks the light of all reliable pixels as not needed, so that the render skips these pixels.
    pub(super) fn skip_reliable(&self, tiles: &mut Tiles) {
        self.predictions().for_each(|(tile, guess)| tiles.skip_light(tile, &guess.is_reliable));
    }

    /// Copies the predicted light of all reliable pixels to an image.
    pub(super) fn copy_reliable(&self, tiles: &Tiles, light: &mut [f32]) {
        for (tile, guess) in self.predictions() {
            let pixels = tiles.pixels(tile);
            for ((at, guessed), _) in
                pixels.zip(&guess.light).zip(&guess.is_reliable).filter(|(_, sure)| **sure)
            {
                light[at] = *guessed;
            }
        }
    }
}

impl SpanRenderer<'_> {
    /// Predicts the tiles that must be rendered at instant `k` of `level`. The predictions use the renders of the
    /// previous level.
    pub(super) fn predict_tiles(&self, k: usize, level: usize, threads: usize) -> TilePredictions {
        let due: Vec<usize> =
            (0..self.render_rates.len()).filter(|&t| self.render_rates[t].render_level >= level).collect();
        let (a, b) = self.bracket(k, level - 1);
        let motions = [a, b].map(|from| (from, self.scene.motions(&self.instants[from], &self.instants[k])));
        let predictions =
            threads::map_indexed(threads, due.len(), |i| self.predict_tile(due[i], k, &motions));
        TilePredictions(due.into_iter().zip(predictions).collect())
    }

    /// Predicts a tile at instant `k` from two renders. `motions` contains the motion between each render and `k`.
    ///
    /// Returns `None` if the motion in the tile is too large.
    fn predict_tile(&self, tile: usize, k: usize, motions: &[(usize, Motions); 2]) -> Option<PredictedLight> {
        let (a, b) = (motions[0].0, motions[1].0);
        let part = (self.times[b] - self.times[a]) / (self.times[self.times.len() - 1] - self.times[0]);
        // `far` is the motion between instant `k` and the render that is farther in time. In both renders, the point
        // that a pixel shows was at most `reach` pixels away from the pixel.
        let far = self.time_share(a, k, b).max(self.time_share(b, k, a))
            * part as f32
            * self.render_rates[tile].motion_px;
        let reach = (far.ceil() as usize).max(1);
        if reach > MAX_REACH_PX {
            return None;
        }
        let white = self.scene.light.white_cd_m2;
        let (width, height) = self.size();
        let (columns, rows) = self.tiles.extent(tile);
        let n = columns.len();
        let mut light = vec![0.0; n * rows.len()];
        let mut sure = vec![true; light.len()];
        let share = self.time_share(a, k, b);
        let sides = motions.each_ref().map(|(from, motions)| Some((self.images[*from].as_ref()?, motions)));
        let [Some(early), Some(late)] = sides else { return None };
        let mut other = vec![0.0; n];
        for (i, row) in rows.enumerate() {
            let (out, sure) = (&mut light[i * n..(i + 1) * n], &mut sure[i * n..(i + 1) * n]);
            for (image, _) in [early, late] {
                keep_uniform(
                    &image.light,
                    (width, height),
                    (row, columns.start),
                    reach,
                    MAX_LOCAL_CONTRAST * white,
                    sure,
                );
            }
            for run in true_runs(sure) {
                let (out, other) = (&mut out[run.clone()], &mut other[run.clone()]);
                for ((image, motions), into) in [early, late].into_iter().zip([&mut *out, &mut *other]) {
                    let Some(labels) = &image.labels else { return None };
                    warp_run(motions, labels, &image.light, row, columns.start + run.start, into);
                }
                for ((early, late), sure) in out.iter().zip(&*other).zip(&mut sure[run]) {
                    *sure = (early - late).abs() < MAX_SIDE_DIFFERENCE * white;
                }
                blend_into(out, other, share);
            }
        }
        Some(PredictedLight { light, is_reliable: sure })
    }
}

/// Returns the index ranges of consecutive true values.
fn true_runs(list: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for i in (0..list.len()).filter(|&i| list[i]) {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end += 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

/// Clears `sure` for some pixels of a run. The light within `reach` pixels of each of these pixels varies by at least
/// `max_range`.
fn keep_uniform(
    light: &[f32],
    (width, height): (usize, usize),
    (row, first): (usize, usize),
    reach: usize,
    max_range: f32,
    sure: &mut [bool],
) {
    let (left, right) = (first.saturating_sub(reach), (first + sure.len() + reach).min(width));
    let mut low = vec![f32::MAX; right - left];
    let mut high = vec![f32::MIN; right - left];
    for y in row.saturating_sub(reach)..(row + reach + 1).min(height) {
        for ((low, high), &x) in
            low.iter_mut().zip(&mut high).zip(&light[y * width + left..y * width + right])
        {
            *low = if x < *low { x } else { *low };
            *high = if x > *high { x } else { *high };
        }
    }
    for (i, sure) in sure.iter_mut().enumerate() {
        let x = first + i - left;
        let around = x.saturating_sub(reach)..(x + reach + 1).min(low.len());
        let darkest = low[around.clone()].iter().fold(f32::MAX, |a, &b| if b < a { b } else { a });
        let brightest = high[around].iter().fold(f32::MIN, |a, &b| if b > a { b } else { a });
        *sure &= brightest - darkest < max_range;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Lighting, SamplesPerPixel, Scene, SceneOptions};

    fn scene(lighting: Lighting) -> Scene {
        let options = SceneOptions {
            width: 160,
            height: 100,
            lighting: Some(lighting),
            duration_s: 0.1,
            speed_kmh: Some(60.0),
            ..SceneOptions::default()
        };
        Scene::from_seed(2, &options).unwrap()
    }

    /// Reliable predictions are in areas of uniform light in both renders.
    ///
    /// Errors larger than `MAX_LOCAL_CONTRAST` occur only if an object became visible between the two renders. The mean
    /// error is smaller than `MAX_SIDE_DIFFERENCE`.
    #[test]
    fn reliable_predictions_equal_a_render() {
        for lighting in [Lighting::Noon, Lighting::Overcast, Lighting::Dusk] {
            let scene = scene(lighting);
            let times: Vec<f64> = (0..=32).map(|k| 0.02 + f64::from(k) * 1e-4).collect();
            let render = |t: f64| scene.render(t, SamplesPerPixel::Sixteen, 1).unwrap();
            let (first, last) = (render(times[0]), render(times[32]));
            let mut work = SpanRenderer::new(&scene, first, &last, &times, SamplesPerPixel::Sixteen, 1);
            let (mut sure, mut pixels, mut sum, mut far) = (0, 0, 0.0, 0);
            for (level, at) in [(1, [16].as_slice()), (2, &[8, 24]), (3, &[4, 12, 20, 28])] {
                for &k in at {
                    let truth = render(times[k]).light;
                    for (tile, guess) in work.predict_tiles(k, level, 1).predictions() {
                        pixels += guess.is_reliable.len();
                        let guessed = work.tiles.pixels(tile).zip(&guess.light).zip(&guess.is_reliable);
                        for ((at, light), _) in guessed.filter(|(_, sure)| **sure) {
                            let error = (light - truth[at]).abs() / scene.white_cd_m2();
                            (sure, sum) = (sure + 1, sum + error);
                            far += usize::from(error > MAX_LOCAL_CONTRAST);
                        }
                    }
                    work.images[k] = Some(work.render_instant(k, level, 1));
                }
            }
            assert!(pixels > 10_000 && sure * 5 > pixels, "{sure} of {pixels}");
            assert!(sum / (sure as f32) < MAX_SIDE_DIFFERENCE, "{} of white", sum / sure as f32);
            assert!(far * 1000 < sure, "{far} of {sure}");
        }
    }

    /// The light of the rendered pixels must not depend on the pixels that are skipped.
    #[test]
    fn skipped_pixels_do_not_change_other_pixels() {
        let scene = scene(Lighting::LowSun);
        let full = scene.render_tiles(0.03, SamplesPerPixel::Sixteen, &scene.tiles(), 1);
        let mut tiles = scene.tiles();
        for tile in 0..tiles.row_and_total_counts().1 {
            let n = tiles.pixels(tile).count();
            // The skipped pixels form single pixels, pairs, and gaps of many widths.
            let out: Vec<bool> = (0..n).map(|i| (i * i / 7 + tile) % 11 > 1).collect();
            tiles.skip_light(tile, &out);
        }
        let some = scene.render_tiles(0.03, SamplesPerPixel::Sixteen, &tiles, 2);
        assert_eq!(some.labels, full.labels);
        let mut checked = 0;
        for (i, (a, b)) in some.light.iter().zip(&full.light).enumerate() {
            if tiles.needs_light(i % 160, i / 160) {
                checked += 1;
                assert_eq!(a.to_bits(), b.to_bits(), "pixel {i}");
            }
        }
        assert!(checked > 1000 && checked < 8000, "{checked}");
    }
}
