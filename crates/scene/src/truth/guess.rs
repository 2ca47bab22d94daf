//! Pixels of a tile that is due whose light needs no render.
//!
//! Where both renders around an instant, carried to it, agree, and where neither shows anything around the pixel
//! that differs from it, a render would say the same again. Edges of things and of shadows, leaves and fine
//! texture stay to be shaded: most of a picture is none of them.

use std::ops::Range;

use crate::drawing::tiles::Tiles;
use crate::truth::flow::Motions;
use crate::truth::span::Work;
use crate::truth::warp::{carry, mix};
use spikelane::unstable::threads;

/// Both sides of an instant differ by less than this part of white.
const AGREE: f32 = 1e-3;
/// Light around a pixel lies within this part of white.
const EVEN: f32 = 1.5e-2;
/// How far around, in pixels: as far as something may come from, and no farther than this.
const FARTHEST: usize = 2;

/// Light of a tile, and for which of its pixels it is as good as a render's.
pub(super) struct Guess {
    pub light: Vec<f32>,
    pub sure: Vec<bool>,
}

/// What was guessed of each tile that is due.
pub(super) struct Guesses(Vec<(usize, Option<Guess>)>);

impl Guesses {
    fn made(&self) -> impl Iterator<Item = (usize, &Guess)> {
        self.0.iter().filter_map(|(tile, guess)| Some((*tile, guess.as_ref()?)))
    }

    /// Asks for no light where a guess is sure.
    pub(super) fn leave_out(&self, tiles: &mut Tiles) {
        self.made().for_each(|(tile, guess)| tiles.leave_out(tile, &guess.sure));
    }

    /// Puts what is sure into a picture.
    pub(super) fn put(&self, tiles: &Tiles, light: &mut [f32]) {
        for (tile, guess) in self.made() {
            let pixels = tiles.pixels(tile);
            for ((at, guessed), _) in pixels.zip(&guess.light).zip(&guess.sure).filter(|(_, sure)| **sure) {
                light[at] = *guessed;
            }
        }
    }
}

impl Work<'_> {
    /// What the renders of the level before say of the tiles that are due at an instant of `level`.
    pub(super) fn guesses(&self, k: usize, level: usize, threads: usize) -> Guesses {
        let due: Vec<usize> = (0..self.paces.len()).filter(|&t| self.paces[t].rendered >= level).collect();
        let (a, b) = self.bracket(k, level - 1);
        let motions = [a, b].map(|from| (from, self.scene.motions(&self.instants[from], &self.instants[k])));
        let made = threads::indexed(threads, due.len(), |i| self.guess(due[i], k, &motions));
        Guesses(due.into_iter().zip(made).collect())
    }

    /// What the two renders with these motions to instant `k` say of a tile; none where it moves too far.
    fn guess(&self, tile: usize, k: usize, motions: &[(usize, Motions); 2]) -> Option<Guess> {
        let (a, b) = (motions[0].0, motions[1].0);
        let part = (self.times[b] - self.times[a]) / (self.times[self.times.len() - 1] - self.times[0]);
        // From the farther side; a pixel so far away reaches half a pixel farther, and so does this one.
        let far = self.share(a, k, b).max(self.share(b, k, a)) * part as f32 * self.paces[tile].px;
        let reach = (far.ceil() as usize).max(1);
        if reach > FARTHEST {
            return None;
        }
        let white = self.scene.light.white_cd_m2;
        let (width, height) = self.size();
        let (columns, rows) = self.tiles.extent(tile);
        let n = columns.len();
        let mut light = vec![0.0; n * rows.len()];
        let mut sure = vec![true; light.len()];
        let share = self.share(a, k, b);
        let sides = motions.each_ref().map(|(from, motions)| Some((self.images[*from].as_ref()?, motions)));
        let [Some(early), Some(late)] = sides else { return None };
        let mut other = vec![0.0; n];
        for (i, row) in rows.enumerate() {
            let (out, sure) = (&mut light[i * n..(i + 1) * n], &mut sure[i * n..(i + 1) * n]);
            for (image, _) in [early, late] {
                even(&image.light, (width, height), (row, columns.start), reach, EVEN * white, sure);
            }
            for run in runs(sure) {
                let (out, other) = (&mut out[run.clone()], &mut other[run.clone()]);
                for ((image, motions), into) in [early, late].into_iter().zip([&mut *out, &mut *other]) {
                    let Some(labels) = &image.labels else { return None };
                    carry(motions, labels, &image.light, row, columns.start + run.start, into);
                }
                for ((early, late), sure) in out.iter().zip(&*other).zip(&mut sure[run]) {
                    *sure = (early - late).abs() < AGREE * white;
                }
                mix(out, other, share);
            }
        }
        Some(Guess { light, sure })
    }
}

/// Where a list holds without a gap.
fn runs(list: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for i in (0..list.len()).filter(|&i| list[i]) {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end += 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

/// Keeps of a run of pixels those around which light lies within `most`.
fn even(
    light: &[f32],
    (width, height): (usize, usize),
    (row, first): (usize, usize),
    reach: usize,
    most: f32,
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
        let least = low[around.clone()].iter().fold(f32::MAX, |a, &b| if b < a { b } else { a });
        let greatest = high[around].iter().fold(f32::MIN, |a, &b| if b > a { b } else { a });
        *sure &= greatest - least < most;
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
        Scene::random(2, &options).unwrap()
    }

    /// A guess lies among light that is even around it, on both sides of the instant; only what came into view in
    /// between can differ by more than that. Sides that agree to a part of white are mostly right to less.
    #[test]
    fn what_is_sure_is_what_a_render_says() {
        for lighting in [Lighting::Noon, Lighting::Overcast, Lighting::Dusk] {
            let scene = scene(lighting);
            let times: Vec<f64> = (0..=32).map(|k| 0.02 + f64::from(k) * 1e-4).collect();
            let render = |t: f64| scene.render(t, SamplesPerPixel::Sixteen, 1).unwrap();
            let (first, last) = (render(times[0]), render(times[32]));
            let mut work = Work::new(&scene, first, &last, &times, SamplesPerPixel::Sixteen, 1);
            let (mut sure, mut pixels, mut sum, mut far) = (0, 0, 0.0, 0);
            for (level, at) in [(1, [16].as_slice()), (2, &[8, 24]), (3, &[4, 12, 20, 28])] {
                for &k in at {
                    let truth = render(times[k]).light;
                    for (tile, guess) in work.guesses(k, level, 1).made() {
                        pixels += guess.sure.len();
                        let guessed = work.tiles.pixels(tile).zip(&guess.light).zip(&guess.sure);
                        for ((at, light), _) in guessed.filter(|(_, sure)| **sure) {
                            let error = (light - truth[at]).abs() / scene.white_cd_m2();
                            (sure, sum) = (sure + 1, sum + error);
                            far += usize::from(error > EVEN);
                        }
                    }
                    work.images[k] = Some(work.image(k, level, 1));
                }
            }
            assert!(pixels > 10_000 && sure * 5 > pixels, "{sure} of {pixels}");
            assert!(sum / (sure as f32) < AGREE, "{} of white", sum / sure as f32);
            assert!(far * 1000 < sure, "{far} of {sure}");
        }
    }

    /// Pixels whose light is asked for do not depend on the others.
    #[test]
    fn what_is_left_out_changes_nothing_else() {
        let scene = scene(Lighting::LowSun);
        let whole = scene.rendered(0.03, SamplesPerPixel::Sixteen, &scene.tiles(), 1);
        let mut tiles = scene.tiles();
        for tile in 0..tiles.counts().1 {
            let n = tiles.pixels(tile).count();
            // Lone pixels, pairs, and gaps of many widths.
            let out: Vec<bool> = (0..n).map(|i| (i * i / 7 + tile) % 11 > 1).collect();
            tiles.leave_out(tile, &out);
        }
        let some = scene.rendered(0.03, SamplesPerPixel::Sixteen, &tiles, 2);
        assert_eq!(some.labels, whole.labels);
        let mut asked = 0;
        for (i, (a, b)) in some.light.iter().zip(&whole.light).enumerate() {
            if tiles.lights(i % 160, i / 160) {
                asked += 1;
                assert_eq!(a.to_bits(), b.to_bits(), "pixel {i}");
            }
        }
        assert!(asked > 1000 && asked < 8000, "{asked}");
    }
}
