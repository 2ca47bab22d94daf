//! Computes the light at all instants of a span. The number of renders of each tile depends on the motion in the tile.
//!
//! 1. Both ends of a span are rendered completely. Between the ends, each tile is rendered at the halves, quarters and
//!    so on of the span. These renders are the *base renders* of the tile.
//! 2. Between two base renders, a tile is *drawn* at instants with at most a quarter pixel of motion between them. Each
//!    drawn tile is warped from the two base renders. Pixels whose light cannot be warped reliably are rendered anew.
//! 3. Between two drawn instants, the light of a tile changes linearly.
//! 4. The lens is applied to every image.

use crate::ground_truth::flow::{Motions, ScenePoses};
use crate::ground_truth::keyframes::{KEYFRAMES_PER_FLICKER, MAX_KEYFRAME_MOTION_PX, SPEED_MARGIN};
use crate::ground_truth::reliability::unreliable_pixels;
use crate::ground_truth::warp::{blend_into, warp_run};
use crate::rendering::frame::SceneInstant;
use crate::rendering::rendered_frame::{Labels, SamplesPerPixel};
use crate::rendering::tiles::Tiles;
use crate::rendering::visible_triangles::TriangleSet;
use crate::world::Scene;
use spikelane::unstable::threads;

/// Maximum motion in a tile between two consecutive base renders of the tile, in pixels.
const MAX_BASE_MOTION_PX: f32 = 3.0;

/// A render of an instant at the end of a span or within it, in front of the lens. The light of tiles that were not
/// rendered is zero.
#[derive(Clone)]
pub struct SpanEnd {
    labels: Labels,
    light: Vec<f32>,
    /// Luminance that is only in the glare of the lens. The list is empty if there is no such luminance.
    glare: Vec<f32>,
    /// Triangles of the city that are visible.
    visible: TriangleSet,
}

/// The light at all instants of a span.
pub struct LightSpan {
    /// Luminance on the sensor in cd/m2 at all instants except the last, in row-major order.
    pub light: Vec<Vec<f32>>,
    /// The end of the span. It is the start of the next span.
    pub end: SpanEnd,
}

/// The interval between two consecutive base renders of a tile.
struct BaseInterval {
    tile: usize,
    start: usize,
    end: usize,
    /// Instants at which the tile is drawn, without the base renders.
    drawn: Vec<usize>,
    /// Whether each pixel of the tile must be rendered anew. The list is empty if no pixel must.
    unreliable: Vec<bool>,
}

/// The instants of a span, and the base renders of the tiles.
struct SpanRenderer<'a> {
    scene: &'a Scene,
    times: &'a [f64],
    samples: SamplesPerPixel,
    /// Luminance of white at the first instant.
    white: f32,
    /// Poses of the camera and of the visible vehicles.
    instants: Vec<ScenePoses>,
    tiles: Tiles,
    /// For each tile, the motion of its fastest point during the span in pixels.
    motion_px: Vec<f32>,
    base: Vec<Option<SpanEnd>>,
}

impl SpanEnd {
    /// Returns the luminance on the sensor in cd/m2.
    #[must_use]
    pub fn sensor_light(&self, scene: &Scene) -> Vec<f32> {
        let mut light = self.light.clone();
        scene.image_formation.apply(&mut light, &self.glare);
        light
    }
}

impl Scene {
    /// Renders an end of a span. `t` must be inside the drive.
    pub fn span_end(&self, t: f64, samples: SamplesPerPixel, threads: usize) -> SpanEnd {
        self.render_end(t, samples, &self.tiles(), threads)
    }

    fn render_end(&self, t: f64, samples: SamplesPerPixel, tiles: &Tiles, threads: usize) -> SpanEnd {
        let instant = SceneInstant::new(self, t);
        let (frame, hidden) = self.render_instant(&instant, samples, (tiles, None), threads);
        let visible = TriangleSet::from_bands(&hidden.bands, &self.city.mesh);
        // Warping needs only depths and parts. The other labels are removed to save memory.
        let labels = Labels { instance: Vec::new(), semantic: Vec::new(), ..frame.labels };
        SpanEnd { labels, light: frame.light, glare: hidden.glare(), visible }
    }

    /// Returns the luminance at `times`. All times must be inside the drive.
    ///
    /// `first` is the render at `times[0]`. `times` must contain at least two instants.
    pub fn render_span(
        &self,
        first: SpanEnd,
        times: &[f64],
        samples: SamplesPerPixel,
        threads: usize,
    ) -> LightSpan {
        let last = self.span_end(times[times.len() - 1], samples, threads);
        let renderer = SpanRenderer::new(self, first, last.clone(), times, samples, threads);
        LightSpan { light: renderer.render(threads), end: last }
    }
}

/// Maps `work` over `count` items. If there are at least as many items as threads, each thread works on whole items.
/// Otherwise all threads work on the parts of one item. The result is the same.
fn map_instants<T: Send>(threads: usize, count: usize, work: impl Fn(usize, usize) -> T + Sync) -> Vec<T> {
    let inner = if count >= threads { 1 } else { threads };
    threads::map_indexed(threads / inner, count, |i| work(i, inner))
}

impl<'a> SpanRenderer<'a> {
    /// Stores the renders at both ends of a span, and determines the motion in the tiles.
    fn new(
        scene: &'a Scene,
        first: SpanEnd,
        last: SpanEnd,
        times: &'a [f64],
        samples: SamplesPerPixel,
        threads: usize,
    ) -> Self {
        let n = times.len() - 1;
        let mut base: Vec<Option<SpanEnd>> = (0..=n).map(|_| None).collect();
        let tiles = scene.tiles();
        let middle = scene.visible_labels(times[n / 2], threads);
        let views = [(&first.labels, 0), (&middle, n / 2), (&last.labels, n)];
        let motion_px = tile_motions(scene, times, &tiles, &views);
        (base[0], base[n]) = (Some(first), Some(last));
        let white = scene.white_at(times[0], threads);
        Self { scene, times, samples, white, instants: Vec::new(), tiles, motion_px, base }
    }

    /// Returns the light of all instants except the last.
    fn render(mut self, threads: usize) -> Vec<Vec<f32>> {
        let n = self.times.len() - 1;
        let levels: Vec<usize> = self.motion_px.iter().map(|&px| self.base_level(px)).collect();
        self.render_base(&levels, threads);
        let views = self.base.iter().flatten().map(|image| &image.labels);
        let is_visible = self.scene.visible_vehicles(views);
        self.instants = threads::map_indexed(threads, n + 1, |k| {
            self.scene.poses_of_vehicles(self.times[k], |vehicle| is_visible[vehicle])
        });
        let intervals = self.intervals(&levels, threads);
        let mut visible = TriangleSet::default();
        self.base.iter().flatten().for_each(|image| visible.extend(&image.visible));
        let city = visible.by_chunk(&self.scene.city.mesh);
        let mut drawn_at: Vec<Vec<&BaseInterval>> = vec![Vec::new(); n + 1];
        for interval in &intervals {
            interval.drawn.iter().for_each(|&k| drawn_at[k].push(interval));
        }
        let mut images = map_instants(threads, n + 1, |k, inner| self.draw(k, &drawn_at[k], &city, inner));
        for interval in &intervals {
            let stops = [&interval.drawn[..], &[interval.end]].concat();
            let mut from = interval.start;
            for to in stops {
                self.interpolate_tile(interval.tile, from, to, &mut images);
                from = to;
            }
        }
        let glares = self.glares(&intervals);
        threads::map_indexed(threads, n, |k| {
            let mut light = images[k].clone();
            self.scene.image_formation.apply(&mut light, glares.get(k).map_or(&[], |glare| glare));
            light
        })
    }

    /// Returns the light of every instant that is only in the glare of the lens, or an empty list if there is no such
    /// light. The glare is wide, so this light is interpolated between the base renders.
    fn glares(&self, intervals: &[BaseInterval]) -> Vec<Vec<f32>> {
        if self.base.iter().flatten().all(|image| image.glare.is_empty()) {
            return Vec::new();
        }
        let (w, h) = self.size();
        let of_image = |image: &Option<SpanEnd>| match image {
            Some(image) if !image.glare.is_empty() => image.glare.clone(),
            _ => vec![0.0; w * h],
        };
        let mut glares: Vec<Vec<f32>> = self.base.iter().map(of_image).collect();
        for interval in intervals {
            self.interpolate_tile(interval.tile, interval.start, interval.end, &mut glares);
        }
        glares
    }

    /// Returns the level of the base renders of a tile with this motion. At level l, the base renders divide the span
    /// into 2^l parts.
    fn base_level(&self, motion_px: f32) -> usize {
        let n = self.times.len() - 1;
        let lasts_s = self.times[n] - self.times[0];
        let flicker = self.scene.light.flicker.map_or(0.0, |(hz, _)| KEYFRAMES_PER_FLICKER * hz * lasts_s);
        let parts = f64::from(motion_px / MAX_BASE_MOTION_PX).max(flicker);
        (0..n.ilog2() as usize + 1).find(|&l| (1u64 << l) as f64 >= parts).unwrap_or(n.ilog2() as usize + 1)
    }

    /// Returns the instants of the base renders of a level.
    fn base_instants(&self, level: usize) -> Vec<usize> {
        let n = self.times.len() - 1;
        let mut list: Vec<usize> = (0..=1usize << level).map(|i| (i * n) >> level).collect();
        list.dedup();
        list
    }

    /// Renders the base renders between both ends.
    fn render_base(&mut self, levels: &[usize], threads: usize) {
        let n = self.times.len() - 1;
        let deepest = levels.iter().copied().max().unwrap_or(0);
        let mut first_level = vec![usize::MAX; n + 1];
        for level in (0..=deepest).rev() {
            self.base_instants(level).into_iter().for_each(|k| first_level[k] = level);
        }
        let due: Vec<usize> = (1..n).filter(|&k| first_level[k] <= deepest).collect();
        let (w, h) = self.size();
        let rendered = map_instants(threads, due.len(), |i, inner| {
            let chosen = Tiles::from_fn(w, h, |tile| levels[tile] >= first_level[due[i]]);
            self.scene.render_end(self.times[due[i]], self.samples, &chosen, inner)
        });
        for (k, image) in due.into_iter().zip(rendered) {
            self.base[k] = Some(image);
        }
    }

    /// Returns the intervals between the base renders of all tiles.
    fn intervals(&self, levels: &[usize], threads: usize) -> Vec<BaseInterval> {
        let spans: Vec<(usize, usize, usize)> = (0..levels.len())
            .flat_map(|tile| {
                let list = self.base_instants(levels[tile]);
                list.windows(2).map(|w| (tile, w[0], w[1])).collect::<Vec<_>>()
            })
            .collect();
        let mut motions: std::collections::BTreeMap<(usize, usize), [Motions; 2]> = Default::default();
        for &(_, a, b) in &spans {
            motions.entry((a, b)).or_insert_with(|| [self.motions(a, b), self.motions(b, a)]);
        }
        threads::map_indexed(threads, spans.len(), |i| {
            let (tile, start, end) = spans[i];
            self.interval(tile, start, end, &motions[&(start, end)])
        })
    }

    fn interval(&self, tile: usize, start: usize, end: usize, motions: &[Motions; 2]) -> BaseInterval {
        let n = self.times.len() - 1;
        let share = ((self.times[end] - self.times[start]) / (self.times[n] - self.times[0])) as f32;
        let motion = self.motion_px[tile] * share;
        let parts = ((motion / MAX_KEYFRAME_MOTION_PX as f32).ceil() as usize).clamp(1, end - start);
        let drawn: Vec<usize> = (1..parts).map(|i| start + i * (end - start) / parts).collect();
        let mut unreliable = Vec::new();
        if let (false, Some(a), Some(b)) = (drawn.is_empty(), &self.base[start], &self.base[end]) {
            let views = [(&a.labels, &a.light[..], &motions[0]), (&b.labels, &b.light[..], &motions[1])];
            unreliable = unreliable_pixels(self.tiles.extent(tile), views, motion, self.white);
            if !unreliable.contains(&true) {
                unreliable.clear();
            }
        }
        BaseInterval { tile, start, end, drawn, unreliable }
    }

    /// Returns the image at instant `k`. It contains the base renders and the tiles that are drawn at this instant.
    fn draw(&self, k: usize, due: &[&BaseInterval], city: &[Vec<u32>], threads: usize) -> Vec<f32> {
        let (w, h) = self.size();
        let mut light = match &self.base[k] {
            Some(image) => image.light.clone(),
            None => vec![0.0; w * h],
        };
        let mut needed = Vec::new();
        for interval in due.iter().filter(|interval| !interval.unreliable.is_empty()) {
            needed.resize(w * h, false);
            let pixels = self.tiles.pixels(interval.tile);
            pixels.zip(&interval.unreliable).for_each(|(at, &unreliable)| needed[at] = unreliable);
        }
        if !needed.is_empty() {
            let chosen = Tiles::from_pixels(w, h, needed, usize::from(self.scene.has_sun()));
            let instant = SceneInstant::new(self.scene, self.times[k]);
            let pixels = self.scene.render_pixels(&instant, self.samples, (&chosen, city), threads);
            pixels.into_iter().for_each(|(at, rendered)| light[at] = rendered);
        }
        let mut motions = MotionCache::default();
        for interval in due {
            let motions = motions.get(self, (interval.start, k, interval.end));
            self.warp_tile(k, interval, motions, &mut light);
        }
        light
    }

    /// Warps the reliable pixels of a tile from the base renders before and after instant `k`.
    fn warp_tile(&self, k: usize, interval: &BaseInterval, motions: &[Motions; 2], light: &mut [f32]) {
        let (Some(early), Some(late)) = (&self.base[interval.start], &self.base[interval.end]) else {
            return;
        };
        let share = self.time_share(interval.start, k, interval.end);
        let (columns, rows) = self.tiles.extent(interval.tile);
        let (width, _) = self.size();
        let mut other = vec![0.0; columns.len()];
        for (i, row) in rows.enumerate() {
            let unreliable = interval.unreliable.get(i * columns.len()..(i + 1) * columns.len());
            for run in reliable_runs(unreliable, columns.len()) {
                let first = columns.start + run.start;
                let out = &mut light[row * width + first..][..run.len()];
                let other = &mut other[..run.len()];
                warp_run(&motions[0], &early.labels, &early.light, row, first, out);
                warp_run(&motions[1], &late.labels, &late.light, row, first, other);
                blend_into(out, other, share);
            }
        }
    }

    /// Interpolates the light of a tile linearly between the instants `from` and `to`.
    fn interpolate_tile(&self, tile: usize, from: usize, to: usize, images: &mut [Vec<f32>]) {
        let (columns, rows) = self.tiles.extent(tile);
        let (width, _) = self.size();
        let (before, after) = images.split_at_mut(from + 1);
        let (between, after) = after.split_at_mut(to - from - 1);
        for (i, image) in between.iter_mut().enumerate() {
            let share = self.time_share(from, from + 1 + i, to);
            for row in rows.clone() {
                let run = row * width + columns.start..row * width + columns.end;
                let out = &mut image[run.clone()];
                out.copy_from_slice(&before[from][run.clone()]);
                blend_into(out, &after[0][run], share);
            }
        }
    }

    fn motions(&self, from: usize, to: usize) -> Motions {
        self.scene.motions(&self.instants[from], &self.instants[to])
    }

    fn size(&self) -> (usize, usize) {
        let i = &self.scene.intrinsics;
        (i.width as usize, i.height as usize)
    }

    /// Returns the position of time `k` between times `a` and `b`. The result is 0 at `a` and 1 at `b`.
    fn time_share(&self, a: usize, k: usize, b: usize) -> f32 {
        ((self.times[k] - self.times[a]) / (self.times[b] - self.times[a])) as f32
    }
}

/// Motions from the instants before and after an instant to this instant. Many tiles have equal instants.
#[derive(Default)]
struct MotionCache(Vec<((usize, usize, usize), [Motions; 2])>);

impl MotionCache {
    /// Returns the motions from `a` and from `b` to `k`.
    fn get(&mut self, span: &SpanRenderer, (a, k, b): (usize, usize, usize)) -> &[Motions; 2] {
        let known = self.0.iter().position(|(key, _)| *key == (a, k, b));
        let index = known.unwrap_or_else(|| {
            self.0.push(((a, k, b), [span.motions(a, k), span.motions(b, k)]));
            self.0.len() - 1
        });
        &self.0[index].1
    }
}

/// Returns the index ranges of consecutive reliable pixels of a row.
fn reliable_runs(unreliable: Option<&[bool]>, width: usize) -> Vec<std::ops::Range<usize>> {
    let Some(unreliable) = unreliable else { return std::iter::once(0..width).collect() };
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for i in (0..width).filter(|&i| !unreliable[i]) {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end += 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

/// Returns the motion of the fastest point of each tile during the span, in pixels, with a margin. `views` are labels
/// and the indices of their instants.
fn tile_motions(scene: &Scene, times: &[f64], tiles: &Tiles, views: &[(&Labels, usize); 3]) -> Vec<f32> {
    let (across, count) = tiles.row_and_total_counts();
    let n = times.len() - 1;
    let mut own = vec![0.0f32; count];
    let mut moving = vec![0.0f32; count];
    for &(labels, at) in views {
        // The motion during half of the span is extrapolated to the whole span.
        let to = if at == n { n / 2 } else { (at + n.div_ceil(2)).min(n) };
        let factor = n as f32 / at.abs_diff(to) as f32;
        let motions = scene.motions(&scene.poses_at(times[at]), &scene.poses_at(times[to]));
        for tile in 0..count {
            let (all, world) = tile_motion(&motions, labels, tiles, tile);
            own[tile] = own[tile].max(all * factor);
            moving[tile] = moving[tile].max(world * factor);
        }
    }
    // A moving vehicle also moves its shadow, and both may enter from a neighboring tile. Therefore the motion of
    // vehicles in neighboring tiles counts as well.
    (0..count)
        .map(|tile| {
            let near = neighbor_tiles(tile, across, count).map(|t| moving[t]).fold(0.0f32, f32::max);
            own[tile].max(near) * SPEED_MARGIN as f32
        })
        .collect()
}

/// Returns the tile `tile` and its neighbors.
fn neighbor_tiles(tile: usize, across: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (tile % across, tile / across);
    (y.saturating_sub(1)..(y + 2).min(count / across))
        .flat_map(move |row| (x.saturating_sub(1)..(x + 2).min(across)).map(move |c| row * across + c))
}

/// Returns the motion of the fastest point of a tile, and of its fastest point that moves in world coordinates, in
/// pixels.
fn tile_motion(motions: &Motions, labels: &Labels, tiles: &Tiles, tile: usize) -> (f32, f32) {
    let (columns, rows) = tiles.extent(tile);
    let (mut all, mut moving) = (0.0f32, 0.0f32);
    for row in rows {
        for column in columns.clone() {
            let (dx, dy, _) = motions.displacement(labels, row, column);
            let px2 = dx * dx + dy * dy;
            all = all.max(px2);
            if labels.part[row * labels.width + column] > 1 {
                moving = moving.max(px2);
            }
        }
    }
    (all.sqrt(), moving.sqrt())
}
