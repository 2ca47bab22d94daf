//! The light of neighbouring readouts, each tile of the picture rendered as often as it moves.
//!
//! The ends of a span are rendered whole. Between them a tile is rendered at the
//! halves, quarters, eighths... of the span, as finely as the motion that both
//! ends show in it asks for. Such instants are nested: where a slow tile is
//! rendered, every faster one is too, so that a picture of any instant is whole
//! once those of the coarser instants are.

use crate::drawing::picture::{Labels, Rendered, SamplesPerPixel};
use crate::drawing::tiles::Tiles;
use crate::truth::flow::{Instant, Motions};
use crate::truth::keyframes::PER_FLICKER;
use crate::truth::warp::{carry, mix};
use crate::world::Scene;
use spikelane::unstable::threads;

/// Motion in a tile between two instants at which it is rendered, in pixels.
const RENDERED_PX: f32 = 0.4;
/// Motion in a tile between two instants whose light is carried; from one to the next it goes in a straight line.
const CARRIED_PX: f32 = 0.1;
/// The fastest pixel at the ends is measured; in between a point may gain this share.
const RESERVE: f32 = 1.15;

/// What a span is made of.
pub struct Span {
    /// Luminance in cd/m2 at all its instants but the last.
    pub light: Vec<Vec<f32>>,
    /// The render of its last instant.
    pub last: Rendered,
}

/// The light of an instant, and labels of the tiles that were rendered for it.
pub(super) struct Image {
    pub light: Vec<f32>,
    pub labels: Option<Labels>,
}

/// How finely a tile is rendered and carried: at the span's 2^level parts.
#[derive(Clone, Copy, Default)]
pub(super) struct Pace {
    pub rendered: usize,
    carried: usize,
    /// Pixels that its fastest point moves by over the span.
    pub px: f32,
}

/// Instants of a span, and at which of them what is done.
pub(super) struct Work<'a> {
    pub scene: &'a Scene,
    pub times: &'a [f64],
    samples: SamplesPerPixel,
    /// Indices of the instants that divide the span into 2^level parts.
    levels: Vec<Vec<usize>>,
    pub instants: Vec<Instant>,
    pub tiles: Tiles,
    pub paces: Vec<Pace>,
    pub images: Vec<Option<Image>>,
}

impl Scene {
    /// Luminance at `times`, which lie within the drive; `first` is the render of the first of them, and at
    /// least one follows.
    pub fn span(&self, first: Rendered, times: &[f64], samples: SamplesPerPixel, threads: usize) -> Span {
        let n = times.len() - 1;
        let last = self.rendered(times[n], samples, &self.tiles(), threads);
        let mut work = Work::new(self, first, &last, times, samples, threads);
        for level in 1..work.levels.len() {
            let new: Vec<usize> =
                work.levels[level].iter().copied().filter(|&k| work.images[k].is_none()).collect();
            // Many instants are shared out whole, a few in parts; the light is the same.
            let inner = if new.len() >= threads { 1 } else { threads };
            let made = threads::indexed(threads / inner, new.len(), |i| work.image(new[i], level, inner));
            for (k, image) in new.into_iter().zip(made) {
                work.images[k] = Some(image);
            }
        }
        let light = work.images.into_iter().take(n).flatten().map(|image| image.light).collect();
        Span { light, last }
    }
}

/// Indices from 0 to `n` that divide it into 1, 2, 4... parts, until each is an instant of its own.
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

impl<'a> Work<'a> {
    /// Both ends of a span, and what is to be done between them.
    pub(super) fn new(
        scene: &'a Scene,
        first: Rendered,
        last: &Rendered,
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
            instants: threads::indexed(threads, n + 1, |k| scene.instant(times[k])),
            tiles: scene.tiles(),
            paces: Vec::new(),
            images: (0..=n).map(|_| None).collect(),
        };
        work.pace(&first.labels, &last.labels);
        work.images[0] = Some(Image { light: first.light, labels: Some(first.labels) });
        work.images[n] = Some(Image { light: last.light.clone(), labels: Some(last.labels.clone()) });
        work
    }

    /// Decides the pace of every tile from the motion at both ends.
    fn pace(&mut self, first: &Labels, last: &Labels) {
        let n = self.times.len() - 1;
        let (across, count) = self.tiles.counts();
        let ends = [(first, 0, n), (last, n, 0)].map(|(labels, from, to)| {
            let motions = self.scene.motions(&self.instants[from], &self.instants[to]);
            (0..count).map(|tile| Seen::of(&motions, labels, &self.tiles, tile)).collect::<Vec<_>>()
        });
        let lasts_s = self.times[n] - self.times[0];
        let flicker = self.scene.light.flicker.map_or(0.0, |(hz, _)| PER_FLICKER * hz * lasts_s);
        let finest = self.levels.len() - 1;
        let level = |parts: f64| (0..finest).find(|&l| (1u64 << l) as f64 >= parts).unwrap_or(finest);
        self.paces = (0..count)
            .map(|tile| {
                let (first, last) = (&ends[0][tile], &ends[1][tile]);
                // What moves by itself takes its shadow along, and may come from a neighbour.
                let moving = beside(tile, across, count)
                    .flat_map(|t| [ends[0][t].moving_px, ends[1][t].moving_px])
                    .fold(0.0f32, f32::max);
                let px = first.px.max(last.px).max(moving) * RESERVE;
                let rendered = level(f64::from(px / RENDERED_PX).max(flicker));
                Pace { rendered, carried: level(f64::from(px / CARRIED_PX)).max(rendered), px }
            })
            .collect();
    }

    /// The light of instant `k`, which `level` is the first to have.
    pub(super) fn image(&self, k: usize, level: usize, threads: usize) -> Image {
        let (w, h) = self.size();
        let guesses = self.guesses(k, level, threads);
        let mut chosen = Tiles::chosen(w, h, |tile| self.paces[tile].rendered >= level);
        guesses.leave_out(&mut chosen);
        let rendered =
            chosen.any().then(|| self.scene.rendered(self.times[k], self.samples, &chosen, threads));
        let (mut light, labels) = match rendered {
            // Where a point moves takes its depth and its part; the other labels would be kept for nothing.
            Some(Rendered { light, labels, .. }) => {
                (light, Some(Labels { instance: Vec::new(), semantic: Vec::new(), ..labels }))
            }
            None => (vec![0.0; w * h], None),
        };
        guesses.put(&self.tiles, &mut light);
        let others: Vec<usize> = (0..self.paces.len()).filter(|&t| self.paces[t].rendered < level).collect();
        let motions: Vec<_> = (0..level).map(|l| self.around(k, l, &others, level)).collect();
        let made = threads::indexed(threads, others.len(), |i| {
            let pace = self.paces[others[i]];
            match (&motions[pace.rendered], pace.carried >= level) {
                (Some(motions), true) => self.carried(others[i], k, motions),
                _ => self.straight(others[i], k, pace.carried),
            }
        });
        for (tile, made) in others.into_iter().zip(made) {
            let (columns, rows) = self.tiles.extent(tile);
            for (row, made) in rows.zip(made.chunks(columns.len())) {
                light[row * w + columns.start..row * w + columns.end].copy_from_slice(made);
            }
        }
        Image { light, labels }
    }

    /// The instants of a level before and after `k`.
    pub(super) fn bracket(&self, k: usize, level: usize) -> (usize, usize) {
        let list = &self.levels[level];
        let after = list.partition_point(|&at| at <= k).min(list.len() - 1);
        (list[after - 1], list[after])
    }

    /// Motions from both renders of `rendered`'s level to `k`, if any tile is carried by them.
    fn around(
        &self,
        k: usize,
        rendered: usize,
        tiles: &[usize],
        level: usize,
    ) -> Option<[(usize, Motions); 2]> {
        let carried = |&t: &usize| self.paces[t].rendered == rendered && self.paces[t].carried >= level;
        tiles.iter().any(carried).then(|| {
            let (a, b) = self.bracket(k, rendered);
            [a, b].map(|from| (from, self.scene.motions(&self.instants[from], &self.instants[k])))
        })
    }

    /// A tile's light carried from both of its renders around instant `k`.
    fn carried(&self, tile: usize, k: usize, motions: &[(usize, Motions); 2]) -> Vec<f32> {
        let share = self.share(motions[0].0, k, motions[1].0);
        let (columns, rows) = self.tiles.extent(tile);
        let mut out = vec![0.0; columns.len() * rows.len()];
        let mut late = vec![0.0; columns.len()];
        for (row, out) in rows.zip(out.chunks_mut(columns.len())) {
            for ((from, motions), into) in motions.iter().zip([&mut *out, &mut late[..]]) {
                let Some(Image { light, labels: Some(labels) }) = &self.images[*from] else { continue };
                carry(motions, labels, light, row, columns.start, into);
            }
            mix(out, &late, share);
        }
        out
    }

    /// A tile's light in a straight line between two instants.
    fn straight(&self, tile: usize, k: usize, level: usize) -> Vec<f32> {
        let (a, b) = self.bracket(k, level);
        let share = self.share(a, k, b);
        let (columns, rows) = self.tiles.extent(tile);
        let mut out = Vec::with_capacity(columns.len() * rows.len());
        let (Some(early), Some(late)) = (&self.images[a], &self.images[b]) else { return out };
        let (width, _) = self.size();
        for row in rows {
            let run = row * width + columns.start..row * width + columns.end;
            let at = out.len();
            out.extend_from_slice(&early.light[run.clone()]);
            mix(&mut out[at..], &late.light[run], share);
        }
        out
    }

    pub(super) fn size(&self) -> (usize, usize) {
        let i = &self.scene.intrinsics;
        (i.width as usize, i.height as usize)
    }

    /// Where `k` lies between `a` and `b` in time.
    pub(super) fn share(&self, a: usize, k: usize, b: usize) -> f32 {
        ((self.times[k] - self.times[a]) / (self.times[b] - self.times[a])) as f32
    }
}

/// A tile and its neighbours.
fn beside(tile: usize, across: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (tile % across, tile / across);
    (y.saturating_sub(1)..(y + 2).min(count / across))
        .flat_map(move |row| (x.saturating_sub(1)..(x + 2).min(across)).map(move |c| row * across + c))
}

/// What an end of a span shows of a tile.
struct Seen {
    /// Pixels that its fastest point moves by over the span, and the fastest that moves in the world.
    px: f32,
    moving_px: f32,
}

impl Seen {
    fn of(motions: &Motions, labels: &Labels, tiles: &Tiles, tile: usize) -> Self {
        let (columns, rows) = tiles.extent(tile);
        let (mut all, mut moving) = (0.0f32, 0.0f32);
        for row in rows {
            for column in columns.clone() {
                let (dx, dy, _) = motions.at(labels, row, column);
                let px2 = dx * dx + dy * dy;
                all = all.max(px2);
                if labels.part[row * labels.width + column] > 1 {
                    moving = moving.max(px2);
                }
            }
        }
        Self { px: all.sqrt(), moving_px: moving.sqrt() }
    }
}
