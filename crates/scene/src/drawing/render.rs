//! A frame: visibility, labels, then deferred shading.

use glam::Vec3;

use super::band::Band;
use super::fragment::{Facet, Latest, surface_key, world_way};
use super::frame::Frame;
use super::picture::{Labels, Rendered, SamplesPerPixel};
use super::raster::{NOTHING, Pattern};
use super::see::{Seen, rows_of, see};
use super::shade;
use super::tiles::{BAND_ROWS, Tiles};
use crate::lighting::luminance;
use crate::world::Scene;
use spikelane::error::Result;
use spikelane::unstable::threads;

impl Scene {
    /// Light and labels at `t`, on `threads` threads.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn render(&self, t: f64, samples: SamplesPerPixel, threads: usize) -> Result<Rendered> {
        self.check_time(t)?;
        Ok(self.rendered(t, samples, &self.tiles(), threads))
    }

    /// The labels of pixel centres alone: several times faster than a render.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn labels(&self, t: f64, threads: usize) -> Result<Labels> {
        self.check_time(t)?;
        Ok(see(&Frame::new(self, t), &Pattern::new(0), &self.tiles(), false, threads).labels)
    }

    /// All tiles of the picture.
    pub(crate) fn tiles(&self) -> Tiles {
        Tiles::all(self.intrinsics.width as usize, self.intrinsics.height as usize)
    }

    /// Light and labels at `t`, which lies within the drive, of some tiles; the others are black and sky.
    pub(crate) fn rendered(
        &self,
        t: f64,
        samples: SamplesPerPixel,
        tiles: &Tiles,
        threads: usize,
    ) -> Rendered {
        let frame = &Frame::new(self, t);
        let pattern = Pattern::new(samples.count());
        let shadows = self.light.sun.max_element() > 0.0;
        let seen = see(frame, &pattern, tiles, shadows, threads);
        let bands =
            threads::indexed(threads, seen.bands.len(), |b| shade_band(frame, &seen, &pattern, (b, tiles)));
        let rgb: Vec<[f32; 3]> = bands.into_iter().flatten().collect();
        let light = rgb.iter().map(|&c| luminance(c.into())).collect();
        Rendered { labels: seen.labels, light, rgb }
    }
}

/// The samples of one pixel that show one surface.
#[derive(Clone, Copy)]
pub(super) struct Group {
    key: (usize, u32),
    pub id: u32,
    /// Samples of the surface, and of the triangle that stands for it.
    count: f32,
    pub own: f32,
    /// Sum of the positions of the triangle's samples.
    pub at: (f32, f32),
}

pub(super) fn shade_band(
    frame: &Frame,
    seen: &Seen,
    pattern: &Pattern,
    (index, tiles): (usize, &Tiles),
) -> Vec<[f32; 3]> {
    let (width, height) = (seen.labels.width, seen.labels.height);
    let (rows, runs) = (rows_of(index, height), tiles.runs(index));
    let mut out = vec![[0.0; 3]; width * rows];
    let mut groups: Vec<Group> = Vec::new();
    let mut latest = Latest::default();
    for row in 0..rows {
        let y = index * BAND_ROWS + row;
        for x in runs.iter().flat_map(|run| run.0..run.1).filter(|&x| tiles.lights(x, y)) {
            groups.clear();
            collect(frame, &seen.bands[index], pattern, (row, x, y), &mut groups);
            let mut sum = Vec3::ZERO;
            for g in &groups {
                let (gx, gy) = (g.at.0 / g.own, g.at.1 / g.own);
                sum += g.count
                    * if g.id == NOTHING {
                        shade::sky(frame, world_way(frame, gx, gy))
                    } else {
                        let facet = latest.get(frame, g.id);
                        let sun = sun_share(frame, seen, pattern, (g, facet), (x, y));
                        shade::shade(frame, &facet.at(frame, gx, gy), sun)
                    };
            }
            out[row * width + x] = (sum / (pattern.rows() - 1) as f32).to_array();
        }
    }
    out
}

pub(super) fn collect(
    frame: &Frame,
    band: &Band,
    pattern: &Pattern,
    (row, x, y): (usize, usize, usize),
    groups: &mut Vec<Group>,
) {
    let first = band.id(row, x, 0);
    if (1..pattern.rows()).all(|k| k == pattern.centre || band.id(row, x, k) == first) {
        // Most pixels show one triangle.
        let key = if first == NOTHING { (usize::MAX, 0) } else { surface_key(frame, first) };
        let count = (pattern.rows() - 1) as f32;
        // The samples of a pixel stand about its middle.
        groups.push(Group {
            key,
            id: first,
            count,
            own: count,
            at: (count * (x as f32 + 0.5), count * (y as f32 + 0.5)),
        });
        return;
    }
    for (k, &(dx, dy)) in pattern.offsets.iter().enumerate() {
        if k == pattern.centre {
            continue;
        }
        let id = band.id(row, x, k);
        let (px, py) = (x as f32 + dx, y as f32 + dy);
        // Asking for a triangle's surface can wait.
        let known = groups.iter().position(|g| g.id == id).or_else(|| {
            let key = (id != NOTHING).then(|| surface_key(frame, id))?;
            groups.iter().position(|g| g.id != NOTHING && g.key == key)
        });
        if let Some(i) = known {
            let g = &mut groups[i];
            g.count += 1.0;
            if g.id == id {
                g.own += 1.0;
                g.at.0 += px;
                g.at.1 += py;
            }
        } else {
            let key = if id == NOTHING { (usize::MAX, 0) } else { surface_key(frame, id) };
            groups.push(Group { key, id, count: 1.0, own: 1.0, at: (px, py) });
        }
    }
}

/// The visible share of the sun: what the centres around agree on, or four rays.
pub(super) fn sun_share(
    frame: &Frame,
    seen: &Seen,
    pattern: &Pattern,
    (g, facet): (&Group, &Facet),
    (x, y): (usize, usize),
) -> f32 {
    if frame.scene.light.sun.max_element() <= 0.0 {
        return 0.0;
    }
    let (width, height) = (seen.labels.width, seen.labels.height);
    let (mut sunny, mut known) = (0u32, 0u32);
    for ny in y.saturating_sub(1)..(y + 2).min(height) {
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let ids = &seen.bands[ny / BAND_ROWS].line(ny % BAND_ROWS, pattern.centre)[columns.clone()];
        for (&id, &sun) in ids.iter().zip(&seen.sunny[ny * width..][columns]) {
            if id == g.id || (id != NOTHING && surface_key(frame, id) == g.key) {
                known += 1;
                sunny += u32::from(sun);
            }
        }
    }
    if known > 1 && (sunny == 0 || sunny == known) {
        return if sunny > 0 { 1.0 } else { 0.0 };
    }
    let ray = |x: f32, y: f32| shade::sees_sun(frame, &facet.bare(frame, x, y, facet.depth(frame, x, y)));
    if g.count < 2.0 {
        return f32::from(u8::from(ray(g.at.0 / g.own, g.at.1 / g.own)));
    }
    let spread = [(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)];
    let rays = spread.iter().filter(|&&(dx, dy)| ray(x as f32 + dx, y as f32 + dy)).count();
    rays as f32 * 0.25
}
