//! Renders a frame. The steps are visibility, labels and deferred shading.

use glam::Vec3;

use super::band::Band;
use super::fragment::{Facet, FacetCache, surface_id, world_direction};
use super::frame::SceneInstant;
use super::raster::{NO_TRIANGLE, SamplePattern};
use super::rendered_frame::{Labels, RenderedFrame, SamplesPerPixel};
use super::shade;
use super::tiles::{BAND_ROWS, Tiles};
use super::visibility::{Visibility, band_rows, compute_visibility};
use crate::lighting::luminance;
use crate::world::Scene;
use spikelane::error::Result;
use spikelane::unstable::threads;

impl Scene {
    /// Renders light and labels at time `t` with `threads` threads.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::error::ErrorKind::Usage) if `t` is outside the drive.
    pub fn render(&self, t: f64, samples: SamplesPerPixel, threads: usize) -> Result<RenderedFrame> {
        self.check_time(t)?;
        let (mut frame, hidden) =
            self.render_instant(&SceneInstant::new(self, t), samples, (&self.tiles(), None), threads);
        self.image_formation.apply(&mut frame.light, &hidden.glare());
        for (color, excess) in frame.rgb.iter_mut().zip(&hidden.excess) {
            *color = (Vec3::from(*color) + Vec3::from(*excess)).to_array();
        }
        self.image_formation.apply_rgb(&mut frame.rgb);
        Ok(frame)
    }

    /// Returns the labels at the pixel centers. This function is several times faster than [`render`](Self::render).
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::error::ErrorKind::Usage) if `t` is outside the drive.
    pub fn labels(&self, t: f64, threads: usize) -> Result<Labels> {
        self.check_time(t)?;
        Ok(self.visible_labels(t, threads))
    }

    /// Returns the labels at the pixel centers. `t` must be inside the drive.
    pub(crate) fn visible_labels(&self, t: f64, threads: usize) -> Labels {
        compute_visibility(
            &SceneInstant::new(self, t),
            &SamplePattern::new(0),
            (&self.tiles(), None),
            (true, false),
            threads,
        )
        .labels
    }

    /// Returns whether the sun or the moon gives direct light.
    pub(crate) fn has_sun(&self) -> bool {
        self.light.sun_illuminance.max_element() > 0.0
    }

    /// Returns all tiles of the image.
    pub(crate) fn tiles(&self) -> Tiles {
        Tiles::all(self.intrinsics.width as usize, self.intrinsics.height as usize)
    }

    /// Renders light and labels of the tiles that `tiles` selects. `t` must be inside the drive.
    ///
    /// The light is the light in front of the lens. In tiles that `tiles` does not select, the light is zero and every
    /// label is the label of the sky.
    pub(crate) fn render_tiles(
        &self,
        t: f64,
        samples: SamplesPerPixel,
        tiles: &Tiles,
        threads: usize,
    ) -> RenderedFrame {
        self.render_instant(&SceneInstant::new(self, t), samples, (tiles, None), threads).0
    }

    /// Renders the light in front of the lens and the labels of the pixels that `tiles` selects. Also returns the visible
    /// triangles of the city.
    ///
    /// If `city` is given, only these triangles of each chunk of the city are drawn.
    pub(crate) fn render_instant(
        &self,
        frame: &SceneInstant,
        samples: SamplesPerPixel,
        (tiles, city): (&Tiles, Option<&[Vec<u32>]>),
        threads: usize,
    ) -> (RenderedFrame, HiddenData) {
        let pattern = SamplePattern::new(samples.count());
        let shadows = self.has_sun();
        let visibility = compute_visibility(frame, &pattern, (tiles, city), (true, shadows), threads);
        let bands = threads::map_indexed(threads, visibility.bands.len(), |b| {
            shade_band(frame, &visibility, &pattern, (b, tiles))
        });
        let (mut rgb, mut excess): (Vec<[f32; 3]>, Vec<[f32; 3]>) = (Vec::new(), Vec::new());
        for band in bands {
            rgb.extend(band.0);
            excess.extend(band.1);
        }
        let light = rgb.iter().map(|&c| luminance(c.into())).collect();
        let hidden = HiddenData { excess, bands: visibility.bands };
        (RenderedFrame { labels: visibility.labels, light, rgb }, hidden)
    }
}

impl Scene {
    /// Renders the luminance in front of the lens of the pixels whose light `tiles` needs. Returns the index and the
    /// luminance of each pixel. It is the luminance of [`render_instant`](Self::render_instant).
    ///
    /// Only the triangles `city` of each chunk of the city are drawn.
    pub(crate) fn render_pixels(
        &self,
        frame: &SceneInstant,
        samples: SamplesPerPixel,
        (tiles, city): (&Tiles, &[Vec<u32>]),
        threads: usize,
    ) -> Vec<(usize, f32)> {
        let pattern = SamplePattern::new(samples.count());
        let options = (false, self.has_sun());
        let visibility = compute_visibility(frame, &pattern, (tiles, Some(city)), options, threads);
        let bands = threads::map_indexed(threads, visibility.bands.len(), |b| {
            let mut pixels = Vec::new();
            shade_pixels(frame, &visibility, &pattern, (b, tiles), |at, color, _| {
                pixels.push((b * BAND_ROWS * visibility.labels.width + at, luminance(color)));
            });
            pixels
        });
        bands.concat()
    }
}

/// Results of a render that are not part of a [`RenderedFrame`].
pub(crate) struct HiddenData {
    /// Color of each pixel above the limit of the sharp image, in cd/m2. The list is empty if the light has no limit.
    pub excess: Vec<[f32; 3]>,
    pub bands: Vec<Band>,
}

impl HiddenData {
    /// Returns the luminance of each pixel that is only in the glare of the lens. The list is empty if there is no such
    /// luminance.
    pub(crate) fn glare(&self) -> Vec<f32> {
        if self.excess.iter().all(|excess| *excess == [0.0; 3]) {
            return Vec::new();
        }
        self.excess.iter().map(|&excess| luminance(excess.into())).collect()
    }
}

/// The samples of one pixel at which the same surface is visible.
#[derive(Clone, Copy)]
pub(super) struct SurfaceGroup {
    key: (usize, u32),
    pub id: u32,
    /// Number of samples in the group. The triangle `id` represents the surface of the group. `triangle_samples` is the
    /// number of samples at which the triangle `id` is visible.
    count: f32,
    pub triangle_samples: f32,
    /// Sum of the positions of the samples at which the triangle `id` is visible.
    pub position_sum: (f32, f32),
}

pub(super) fn shade_band(
    frame: &SceneInstant,
    visibility: &Visibility,
    pattern: &SamplePattern,
    (index, tiles): (usize, &Tiles),
) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let pixels = visibility.labels.width * band_rows(index, visibility.labels.height);
    let mut out = vec![[0.0; 3]; pixels];
    let has_limit = frame.scene.light.max_sharp_cd_m2.is_finite();
    let mut excess = if has_limit { vec![[0.0; 3]; pixels] } else { Vec::new() };
    shade_pixels(frame, visibility, pattern, (index, tiles), |at, color, above| {
        out[at] = color.to_array();
        if above != Vec3::ZERO {
            excess[at] = above.to_array();
        }
    });
    (out, excess)
}

/// Shades the pixels of a band whose light is needed. `output` receives the index of a pixel within the band, its color up
/// to the limit of the sharp image, and its color above this limit.
fn shade_pixels(
    frame: &SceneInstant,
    visibility: &Visibility,
    pattern: &SamplePattern,
    (index, tiles): (usize, &Tiles),
    mut output: impl FnMut(usize, Vec3, Vec3),
) {
    let (width, height) = (visibility.labels.width, visibility.labels.height);
    let (rows, runs) = (band_rows(index, height), tiles.band_runs(index));
    let limit = frame.scene.light.max_sharp_cd_m2;
    let mut groups: Vec<SurfaceGroup> = Vec::new();
    let mut latest = FacetCache::default();
    for row in 0..rows {
        let y = index * BAND_ROWS + row;
        for x in runs[row].iter().flat_map(|run| run.0..run.1).filter(|&x| tiles.needs_light(x, y)) {
            groups.clear();
            collect(frame, &visibility.bands[index], pattern, (row, x, y), &mut groups);
            let (mut sum, mut above) = (Vec3::ZERO, Vec3::ZERO);
            for g in &groups {
                let (gx, gy) = (g.position_sum.0 / g.triangle_samples, g.position_sum.1 / g.triangle_samples);
                let color = if g.id == NO_TRIANGLE {
                    shade::sky_luminance(frame, world_direction(frame, gx, gy))
                } else {
                    let facet = latest.get(frame, g.id);
                    let sun = sun_share(frame, visibility, pattern, (g, facet), (x, y));
                    shade::shade(frame, &facet.fragment_at(frame, gx, gy), sun)
                };
                let bright = luminance(color);
                if bright > limit {
                    sum += color * (g.count * limit / bright);
                    above += color * (g.count * (1.0 - limit / bright));
                } else {
                    sum += color * g.count;
                }
            }
            let count = (pattern.rows() - 1) as f32;
            output(row * width + x, sum / count, above / count);
        }
    }
}

pub(super) fn collect(
    frame: &SceneInstant,
    band: &Band,
    pattern: &SamplePattern,
    (row, x, y): (usize, usize, usize),
    groups: &mut Vec<SurfaceGroup>,
) {
    let first = band.triangle_id(row, x, 0);
    if (1..pattern.rows()).all(|k| k == pattern.center || band.triangle_id(row, x, k) == first) {
        // In most pixels, all samples show the same triangle.
        let key = if first == NO_TRIANGLE { (usize::MAX, 0) } else { surface_id(frame, first) };
        let count = (pattern.rows() - 1) as f32;
        // The mean position of the samples of a pixel is the center of the pixel.
        groups.push(SurfaceGroup {
            key,
            id: first,
            count,
            triangle_samples: count,
            position_sum: (count * (x as f32 + 0.5), count * (y as f32 + 0.5)),
        });
        return;
    }
    for (k, &(dx, dy)) in pattern.offsets.iter().enumerate() {
        if k == pattern.center {
            continue;
        }
        let id = band.triangle_id(row, x, k);
        let (px, py) = (x as f32 + dx, y as f32 + dy);
        // The surface is looked up only if no group has this triangle id.
        let known = groups.iter().position(|g| g.id == id).or_else(|| {
            let key = (id != NO_TRIANGLE).then(|| surface_id(frame, id))?;
            groups.iter().position(|g| g.id != NO_TRIANGLE && g.key == key)
        });
        if let Some(i) = known {
            let g = &mut groups[i];
            g.count += 1.0;
            if g.id == id {
                g.triangle_samples += 1.0;
                g.position_sum.0 += px;
                g.position_sum.1 += py;
            }
        } else {
            let key = if id == NO_TRIANGLE { (usize::MAX, 0) } else { surface_id(frame, id) };
            groups.push(SurfaceGroup { key, id, count: 1.0, triangle_samples: 1.0, position_sum: (px, py) });
        }
    }
}

/// Returns the fraction of the sun that is visible.
///
/// If all neighboring pixel centers on the same surface are sunlit, the fraction is 1. If all are in shadow, the
/// fraction is 0. In other cases, up to four rays toward the sun determine the fraction.
pub(super) fn sun_share(
    frame: &SceneInstant,
    visibility: &Visibility,
    pattern: &SamplePattern,
    (g, facet): (&SurfaceGroup, &Facet),
    (x, y): (usize, usize),
) -> f32 {
    if frame.scene.light.sun_illuminance.max_element() <= 0.0 {
        return 0.0;
    }
    let (width, height) = (visibility.labels.width, visibility.labels.height);
    let (mut sunny, mut known) = (0u32, 0u32);
    for ny in y.saturating_sub(1)..(y + 2).min(height) {
        let band = &visibility.bands[ny / BAND_ROWS];
        for nx in x.saturating_sub(1)..(x + 2).min(width) {
            let id = band.triangle_id(ny % BAND_ROWS, nx, pattern.center);
            let sun = visibility.is_sunlit[ny * width + nx];
            if id == g.id || (id != NO_TRIANGLE && surface_id(frame, id) == g.key) {
                known += 1;
                sunny += u32::from(sun);
            }
        }
    }
    if known > 1 && (sunny == 0 || sunny == known) {
        return if sunny > 0 { 1.0 } else { 0.0 };
    }
    let ray =
        |x: f32, y: f32| shade::sees_sun(frame, &facet.surface_point(frame, x, y, facet.depth(frame, x, y)));
    if g.count < 2.0 {
        return f32::from(u8::from(ray(
            g.position_sum.0 / g.triangle_samples,
            g.position_sum.1 / g.triangle_samples,
        )));
    }
    let spread = [(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)];
    let rays = spread.iter().filter(|&&(dx, dy)| ray(x as f32 + dx, y as f32 + dy)).count();
    rays as f32 * 0.25
}
