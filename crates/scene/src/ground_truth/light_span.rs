//! Computes the light at all instants of a span. The number of renders of each tile depends on the motion in the tile.
//!
//! Both ends of a span are rendered completely. Between the ends, each tile is rendered at the halves, quarters,
//! eighths and so on of the span. The motion in the tile at both ends of the span determines the finest fraction of the
//! tile. The instants of a coarse fraction are also instants of every finer fraction. At an instant at which a slow
//! tile is rendered, all faster tiles are therefore rendered too. The image at any instant can be completed from
//! instants of coarser fractions alone.

use crate::ground_truth::flow::{Motions, ScenePoses};
use crate::ground_truth::keyframes::{KEYFRAMES_PER_FLICKER, SPEED_MARGIN};
use crate::ground_truth::warp::{blend_into, warp_run};
use crate::rendering::rendered_frame::{Labels, RenderedFrame, SamplesPerPixel};
use crate::rendering::tiles::Tiles;
use crate::world::Scene;
use spikelane::unstable::threads;

/// Maximum motion in a tile between two consecutive renders of the tile, in pixels.
const MAX_RENDER_MOTION_PX: f32 = 0.4;
/// Maximum motion in a tile between two consecutive instants at which the light of the tile is warped, in pixels.
///
/// Between these instants, the light is interpolated linearly.
const MAX_WARP_MOTION_PX: f32 = 0.1;

/// The light at all instants of a span.
pub struct LightSpan {
    /// Luminance in cd/m2 at all instants except the last, in row-major order.
    pub light: Vec<Vec<f32>>,
    /// The render of the last instant.
    pub last_frame: RenderedFrame,
}

/// The light at one instant, and the labels of the tiles that were rendered at this instant.
pub(super) struct InstantLight {
    pub light: Vec<f32>,
    pub labels: Option<Labels>,
}

/// Temporal resolution of a tile. At level n, the span is divided into 2^n parts.
#[derive(Clone, Copy, Default)]
pub(super) struct RenderRate {
    pub render_level: usize,
    warp_level: usize,
    /// Motion of the fastest point in the tile during the span, in pixels. The value includes the factor
    /// `SPEED_MARGIN`.
    pub motion_px: f32,
}

/// The instants of a span, the render rates of the tiles, and the images that are already computed.
pub(super) struct SpanRenderer<'a> {
    pub scene: &'a Scene,
    pub times: &'a [f64],
    samples: SamplesPerPixel,
    /// For each level n, the indices of the instants that divide the span into 2^n parts.
    levels: Vec<Vec<usize>>,
    pub instants: Vec<ScenePoses>,
    pub tiles: Tiles,
    pub render_rates: Vec<RenderRate>,
    pub images: Vec<Option<InstantLight>>,
}

impl Scene {
    /// Returns the luminance at `times`. All times must be inside the drive.
    ///
    /// `first` is the render at `times[0]`. `times` must contain at least two instants.
    pub fn render_span(
        &self,
        first: RenderedFrame,
        times: &[f64],
        samples: SamplesPerPixel,
        threads: usize,
    ) -> LightSpan {
        let n = times.len() - 1;
        let last = self.render_tiles(times[n], samples, &self.tiles(), threads);
        let mut work = SpanRenderer::new(self, first, &last, times, samples, threads);
        for level in 1..work.levels.len() {
            let new: Vec<usize> =
                work.levels[level].iter().copied().filter(|&k| work.images[k].is_none()).collect();
            // If there are at least as many instants as threads, each thread renders whole instants. Otherwise all
            // threads render the parts of one instant. The resulting light is the same.
            let inner = if new.len() >= threads { 1 } else { threads };
            let rendered = threads::map_indexed(threads / inner, new.len(), |i| {
                work.render_instant(new[i], level, inner)
            });
            for (k, image) in new.into_iter().zip(rendered) {
                work.images[k] = Some(image);
            }
        }
        let light = work.images.into_iter().take(n).flatten().map(|image| image.light).collect();
        LightSpan { light, last_frame: last }
    }
}

/// Returns one list of indices per level. The list of level n divides the range 0 to `n` into 1, 2, 4, ... parts. The
/// last level contains every index.
fn levels(n: usize) -> Vec<Vec<usize>> {
    let mut levels = Vec::new();
    for level in 0.. {
        let mut list: Vec<usize> = (0..=1usize << level).map(|i| (i * n) >> level).collect();
        list.dedup();
        let done = list.len() == n + 1;
        levels.push(list);
        if done {
            break;
        }
    }
    levels
}

impl<'a> SpanRenderer<'a> {
    /// Stores the renders at both ends of a span, and determines the render rates of the tiles.
    pub(super) fn new(
        scene: &'a Scene,
        first: RenderedFrame,
        last: &RenderedFrame,
        times: &'a [f64],
        samples: SamplesPerPixel,
        threads: usize,
    ) -> Self {
        let n = times.len() - 1;
        let mut work = Self {
            scene,
            times,
            samples,
            levels: levels(n),
            instants: threads::map_indexed(threads, n + 1, |k| scene.poses_at(times[k])),
            tiles: scene.tiles(),
            render_rates: Vec::new(),
            images: (0..=n).map(|_| None).collect(),
        };
        work.set_render_rates(&first.labels, &last.labels);
        work.images[0] = Some(InstantLight { light: first.light, labels: Some(first.labels) });
        work.images[n] = Some(InstantLight { light: last.light.clone(), labels: Some(last.labels.clone()) });
        work
    }

    /// Sets the render rate of every tile. The rate depends on the motion in the tile at both ends of the span.
    fn set_render_rates(&mut self, first: &Labels, last: &Labels) {
        let n = self.times.len() - 1;
        let (across, count) = self.tiles.row_and_total_counts();
        let ends = [(first, 0, n), (last, n, 0)].map(|(labels, from, to)| {
            let motions = self.scene.motions(&self.instants[from], &self.instants[to]);
            (0..count)
                .map(|tile| TileMotion::from_motions(&motions, labels, &self.tiles, tile))
                .collect::<Vec<_>>()
        });
        let lasts_s = self.times[n] - self.times[0];
        let flicker = self.scene.light.flicker.map_or(0.0, |(hz, _)| KEYFRAMES_PER_FLICKER * hz * lasts_s);
        let finest = self.levels.len() - 1;
        let level = |parts: f64| (0..finest).find(|&l| (1u64 << l) as f64 >= parts).unwrap_or(finest);
        self.render_rates = (0..count)
            .map(|tile| {
                let (first, last) = (&ends[0][tile], &ends[1][tile]);
                // A moving vehicle also moves its shadow, and both may enter from a neighboring tile. Therefore the
                // motion in neighboring tiles counts as well.
                let motion = neighbor_tiles(tile, across, count)
                    .flat_map(|t| [ends[0][t].world_motion_px, ends[1][t].world_motion_px])
                    .fold(0.0f32, f32::max);
                let px = first.motion_px.max(last.motion_px).max(motion) * SPEED_MARGIN as f32;
                let rendered = level(f64::from(px / MAX_RENDER_MOTION_PX).max(flicker));
                RenderRate {
                    render_level: rendered,
                    warp_level: level(f64::from(px / MAX_WARP_MOTION_PX)).max(rendered),
                    motion_px: px,
                }
            })
            .collect();
    }

    /// Computes the light at instant `k`. `level` is the first level that contains `k`.
    pub(super) fn render_instant(&self, k: usize, level: usize, threads: usize) -> InstantLight {
        let (w, h) = self.size();
        let guesses = self.predict_tiles(k, level, threads);
        let mut chosen = Tiles::from_fn(w, h, |tile| self.render_rates[tile].render_level >= level);
        guesses.skip_reliable(&mut chosen);
        let rendered =
            chosen.has_any().then(|| self.scene.render_tiles(self.times[k], self.samples, &chosen, threads));
        let (mut light, labels) = match rendered {
            // Warping needs only depths and parts. The other labels are removed to save memory.
            Some(RenderedFrame { light, labels, .. }) => {
                (light, Some(Labels { instance: Vec::new(), semantic: Vec::new(), ..labels }))
            }
            None => (vec![0.0; w * h], None),
        };
        guesses.copy_reliable(&self.tiles, &mut light);
        let others: Vec<usize> =
            (0..self.render_rates.len()).filter(|&t| self.render_rates[t].render_level < level).collect();
        let motions: Vec<_> = (0..level).map(|l| self.motions_around(k, l, &others, level)).collect();
        let rendered_tiles = threads::map_indexed(threads, others.len(), |i| {
            let pace = self.render_rates[others[i]];
            match (&motions[pace.render_level], pace.warp_level >= level) {
                (Some(motions), true) => self.warp_tile(others[i], k, motions),
                _ => self.interpolate_tile(others[i], k, pace.warp_level),
            }
        });
        for (tile, tile_light) in others.into_iter().zip(rendered_tiles) {
            let (columns, rows) = self.tiles.extent(tile);
            for (row, tile_row) in rows.zip(tile_light.chunks(columns.len())) {
                light[row * w + columns.start..row * w + columns.end].copy_from_slice(tile_row);
            }
        }
        InstantLight { light, labels }
    }

    /// Returns the last instant of `level` at or before `k`, and the next instant of `level`.
    pub(super) fn bracket(&self, k: usize, level: usize) -> (usize, usize) {
        let list = &self.levels[level];
        let after = list.partition_point(|&at| at <= k).min(list.len() - 1);
        (list[after - 1], list[after])
    }

    /// Returns the motions between instant `k` and the two adjacent instants of level `rendered`. Returns `None` if no
    /// tile in `tiles` has render level `rendered` and a warp level of at least `level`.
    fn motions_around(
        &self,
        k: usize,
        rendered: usize,
        tiles: &[usize],
        level: usize,
    ) -> Option<[(usize, Motions); 2]> {
        let carried = |&t: &usize| {
            self.render_rates[t].render_level == rendered && self.render_rates[t].warp_level >= level
        };
        tiles.iter().any(carried).then(|| {
            let (a, b) = self.bracket(k, rendered);
            [a, b].map(|from| (from, self.scene.motions(&self.instants[from], &self.instants[k])))
        })
    }

    /// Returns the light of a tile at instant `k`. The light is warped from the renders of the tile before and after
    /// `k`.
    fn warp_tile(&self, tile: usize, k: usize, motions: &[(usize, Motions); 2]) -> Vec<f32> {
        let share = self.time_share(motions[0].0, k, motions[1].0);
        let (columns, rows) = self.tiles.extent(tile);
        let mut out = vec![0.0; columns.len() * rows.len()];
        let mut late = vec![0.0; columns.len()];
        for (row, out) in rows.zip(out.chunks_mut(columns.len())) {
            for ((from, motions), into) in motions.iter().zip([&mut *out, &mut late[..]]) {
                let Some(InstantLight { light, labels: Some(labels) }) = &self.images[*from] else {
                    continue;
                };
                warp_run(motions, labels, light, row, columns.start, into);
            }
            blend_into(out, &late, share);
        }
        out
    }

    /// Returns the light of a tile at instant `k`, interpolated linearly between two instants of `level`.
    fn interpolate_tile(&self, tile: usize, k: usize, level: usize) -> Vec<f32> {
        let (a, b) = self.bracket(k, level);
        let share = self.time_share(a, k, b);
        let (columns, rows) = self.tiles.extent(tile);
        let mut out = Vec::with_capacity(columns.len() * rows.len());
        let (Some(early), Some(late)) = (&self.images[a], &self.images[b]) else { return out };
        let (width, _) = self.size();
        for row in rows {
            let run = row * width + columns.start..row * width + columns.end;
            let at = out.len();
            out.extend_from_slice(&early.light[run.clone()]);
            blend_into(&mut out[at..], &late.light[run], share);
        }
        out
    }

    pub(super) fn size(&self) -> (usize, usize) {
        let i = &self.scene.intrinsics;
        (i.width as usize, i.height as usize)
    }

    /// Returns the position of time `k` between times `a` and `b`. The result is 0 at `a` and 1 at `b`.
    pub(super) fn time_share(&self, a: usize, k: usize, b: usize) -> f32 {
        ((self.times[k] - self.times[a]) / (self.times[b] - self.times[a])) as f32
    }
}

/// Returns the tile `tile` and its neighbors.
fn neighbor_tiles(tile: usize, across: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (tile % across, tile / across);
    (y.saturating_sub(1)..(y + 2).min(count / across))
        .flat_map(move |row| (x.saturating_sub(1)..(x + 2).min(across)).map(move |c| row * across + c))
}

/// The motion in a tile, computed from the labels at one end of a span.
struct TileMotion {
    /// Motion of the fastest point during the span, in pixels. `world_motion_px` includes only points that move in
    /// world coordinates.
    motion_px: f32,
    world_motion_px: f32,
}

impl TileMotion {
    fn from_motions(motions: &Motions, labels: &Labels, tiles: &Tiles, tile: usize) -> Self {
        let (columns, rows) = tiles.extent(tile);
        let (mut all, mut motion) = (0.0f32, 0.0f32);
        for row in rows {
            for column in columns.clone() {
                let (dx, dy, _) = motions.displacement(labels, row, column);
                let px2 = dx * dx + dy * dy;
                all = all.max(px2);
                if labels.part[row * labels.width + column] > 1 {
                    motion = motion.max(px2);
                }
            }
        }
        Self { motion_px: all.sqrt(), world_motion_px: motion.sqrt() }
    }
}
