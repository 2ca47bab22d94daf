//! A frame: visibility, labels, then deferred shading.

use glam::Vec3;

use super::fragment;
use super::fragment::surface_key;
use super::frame::Frame;
use super::parallel;
use super::raster::{BAND_ROWS, Band, NOTHING, Pattern, project, visible_chunks};
use super::shade;
use crate::error::Result;
use crate::scene::lighting::luminance;
use crate::scene::shapes::material::Semantic;
use crate::scene::world::Scene;

/// Colour samples in a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum SamplesPerPixel {
    /// 2x2: four, the default.
    #[default]
    Four,
    /// 4x4: sixteen.
    Sixteen,
}

impl SamplesPerPixel {
    const fn count(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Sixteen => 16,
        }
    }
}

/// What the centres of the pixels see at one instant; row-major, top row first.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Labels {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The instant, in seconds from the start of the scene.
    pub t: f64,
    /// Depth along the optical axis in metres; infinite in the sky.
    pub depth_m: Vec<f32>,
    /// Track id of the vehicle, or 0.
    pub instance: Vec<u32>,
    /// A [`Semantic`] as its number.
    pub semantic: Vec<u8>,
    /// Number of the rigid part plus one (1 is the city), or 0 in the sky.
    pub part: Vec<u16>,
}

/// A rendered frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rendered {
    /// What the pixels' centres see.
    pub labels: Labels,
    /// Mean luminance over each pixel in cd/m2.
    pub light: Vec<f32>,
    /// The same in linear sRGB, for people to look at.
    pub rgb: Vec<[f32; 3]>,
}

/// Visible samples of all bands, and what was derived from the centres.
struct Seen {
    bands: Vec<Band>,
    labels: Labels,
    /// Per pixel: 0 nothing or in shade, 1 in the sun.
    sunny: Vec<u8>,
}

fn rows_of(band: usize, height: usize) -> usize {
    BAND_ROWS.min(height - band * BAND_ROWS)
}

fn see(frame: &Frame, pattern: &Pattern, shadows: bool, threads: usize) -> Seen {
    let i = frame.camera.intrinsics;
    let (width, height) = (i.width as usize, i.height as usize);
    let chunks = visible_chunks(frame);
    let batches = parallel::map(threads, chunks.len(), |k| project(frame, chunks[k].0, chunks[k].1));
    let count = height.div_ceil(BAND_ROWS);
    let parts = parallel::map(threads, count, |b| {
        let rows = rows_of(b, height);
        let band = Band::fill(&batches, pattern, width, b * BAND_ROWS, rows);
        let (labels, sunny) = centres(frame, &band, pattern, b, shadows);
        (band, labels, sunny)
    });
    let mut seen = Seen { bands: Vec::new(), labels: empty(width, height, frame.t), sunny: Vec::new() };
    for (band, labels, sunny) in parts {
        seen.bands.push(band);
        seen.sunny.extend(sunny);
        let all = &mut seen.labels;
        all.depth_m.extend(labels.depth_m);
        all.instance.extend(labels.instance);
        all.semantic.extend(labels.semantic);
        all.part.extend(labels.part);
    }
    seen
}

fn empty(width: usize, height: usize, t: f64) -> Labels {
    Labels {
        width,
        height,
        t,
        depth_m: Vec::new(),
        instance: Vec::new(),
        semantic: Vec::new(),
        part: Vec::new(),
    }
}

/// Labels, and whether the sun shines, at the pixel centres of a band.
fn centres(frame: &Frame, band: &Band, pattern: &Pattern, index: usize, shadows: bool) -> (Labels, Vec<u8>) {
    let i = frame.camera.intrinsics;
    let (width, height) = (i.width as usize, i.height as usize);
    let rows = rows_of(index, height);
    let mut labels = empty(width, rows, frame.t);
    for row in 0..rows {
        let y = (index * BAND_ROWS + row) as f32 + 0.5;
        for column in 0..width {
            let id = band.id(row, column, pattern.centre);
            if id == NOTHING {
                labels.depth_m.push(f32::INFINITY);
                labels.instance.push(0);
                labels.semantic.push(Semantic::Sky as u8);
                labels.part.push(0);
                continue;
            }
            let (semantic, vehicle) = fragment::identity(frame, id);
            labels.depth_m.push(fragment::depth(frame, id, column as f32 + 0.5, y));
            labels.instance.push(vehicle.map_or(0, |v| v + 1));
            labels.semantic.push(semantic as u8);
            labels.part.push(fragment::split(id).0 as u16 + 1);
        }
    }
    let sunny = if shadows { sunlight(frame, band, pattern, index, &labels) } else { vec![0; width * rows] };
    (labels, sunny)
}

/// Where the sun shines: a ray on every other pixel of a chessboard, and on the
/// rest wherever their neighbours disagree. A shadow a pixel wide meets the
/// first half, so none is lost.
fn sunlight(frame: &Frame, band: &Band, pattern: &Pattern, index: usize, labels: &Labels) -> Vec<u8> {
    let (width, rows) = (labels.width, labels.height);
    let mut sunny = vec![0u8; width * rows];
    let ray = |row: usize, column: usize, id: u32| {
        let (x, y) = (column as f32 + 0.5, (index * BAND_ROWS + row) as f32 + 0.5);
        u8::from(shade::sees_sun(
            frame,
            &fragment::bare(frame, id, x, y, labels.depth_m[row * width + column]),
        ))
    };
    for odd in [0, 1] {
        for row in 0..rows {
            for column in (0..width).filter(|c| (c + row) % 2 == odd) {
                let id = band.id(row, column, pattern.centre);
                if id == NOTHING {
                    continue;
                }
                let guess =
                    if odd == 1 { agreed(frame, band, pattern, (row, column, rows), &sunny) } else { None };
                sunny[row * width + column] = guess.unwrap_or_else(|| ray(row, column, id));
            }
        }
    }
    sunny
}

/// What the neighbours on the same surface agree on, if there are two or more.
fn agreed(
    frame: &Frame,
    band: &Band,
    pattern: &Pattern,
    (row, column, rows): (usize, usize, usize),
    sunny: &[u8],
) -> Option<u8> {
    let width = sunny.len() / rows;
    let id = band.id(row, column, pattern.centre);
    let key = surface_key(frame, id);
    let (mut known, mut sum) = (0u8, 0u8);
    for (r, c) in
        [(row.wrapping_sub(1), column), (row + 1, column), (row, column.wrapping_sub(1)), (row, column + 1)]
    {
        if r < rows && c < width {
            let other = band.id(r, c, pattern.centre);
            if other == id || (other != NOTHING && surface_key(frame, other) == key) {
                known += 1;
                sum += sunny[r * width + c];
            }
        }
    }
    (known >= 2 && (sum == 0 || sum == known)).then_some(u8::from(sum > 0))
}

impl Scene {
    /// Light and labels at `t`, on `threads` threads.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn render(&self, t: f64, samples: SamplesPerPixel, threads: usize) -> Result<Rendered> {
        self.check_time(t)?;
        Ok(rendered(&Frame::new(self, t), samples, threads))
    }

    /// The labels of pixel centres alone: several times faster than a render.
    ///
    /// # Errors
    /// When `t` lies outside the drive.
    pub fn labels(&self, t: f64, threads: usize) -> Result<Labels> {
        self.check_time(t)?;
        Ok(labels_of(&Frame::new(self, t), threads))
    }
}

/// Labels alone.
fn labels_of(frame: &Frame, threads: usize) -> Labels {
    see(frame, &Pattern::new(0), false, threads).labels
}

/// A whole frame.
fn rendered(frame: &Frame, samples: SamplesPerPixel, threads: usize) -> Rendered {
    let pattern = Pattern::new(samples.count());
    let shadows = frame.scene.light.sun.max_element() > 0.0;
    let seen = see(frame, &pattern, shadows, threads);
    let height = seen.labels.height;
    let bands = parallel::map(threads, height.div_ceil(BAND_ROWS), |b| shade_band(frame, &seen, &pattern, b));
    let rgb: Vec<[f32; 3]> = bands.into_iter().flatten().collect();
    let light = rgb.iter().map(|&c| luminance(c.into())).collect();
    Rendered { labels: seen.labels, light, rgb }
}

/// The samples of one pixel that show one surface.
#[derive(Clone, Copy)]
struct Group {
    key: (usize, u32),
    id: u32,
    /// Samples of the surface, and of the triangle that stands for it.
    count: f32,
    own: f32,
    /// Sum of the positions of the triangle's samples.
    at: (f32, f32),
}

fn shade_band(frame: &Frame, seen: &Seen, pattern: &Pattern, index: usize) -> Vec<[f32; 3]> {
    let (width, height) = (seen.labels.width, seen.labels.height);
    let mut out = Vec::with_capacity(width * BAND_ROWS);
    let mut groups: Vec<Group> = Vec::new();
    for row in 0..rows_of(index, height) {
        let y = index * BAND_ROWS + row;
        for x in 0..width {
            groups.clear();
            collect(frame, &seen.bands[index], pattern, (row, x, y), &mut groups);
            let mut sum = Vec3::ZERO;
            for g in &groups {
                let (gx, gy) = (g.at.0 / g.own, g.at.1 / g.own);
                sum += g.count
                    * if g.id == NOTHING {
                        shade::sky(frame, fragment::world_way(frame, gx, gy))
                    } else {
                        let f = fragment::at(frame, g.id, gx, gy);
                        shade::shade(frame, &f, sun_share(frame, seen, pattern, g, (x, y)))
                    };
            }
            out.push((sum / (pattern.rows() - 1) as f32).to_array());
        }
    }
    out
}

fn collect(
    frame: &Frame,
    band: &Band,
    pattern: &Pattern,
    (row, x, y): (usize, usize, usize),
    groups: &mut Vec<Group>,
) {
    for (k, &(dx, dy)) in pattern.offsets.iter().enumerate() {
        if k == pattern.centre {
            continue;
        }
        let id = band.id(row, x, k);
        let (px, py) = (x as f32 + dx, y as f32 + dy);
        // Most pixels show one triangle; asking for its surface can wait.
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
fn sun_share(frame: &Frame, seen: &Seen, pattern: &Pattern, g: &Group, (x, y): (usize, usize)) -> f32 {
    if frame.scene.light.sun.max_element() <= 0.0 {
        return 0.0;
    }
    let (width, height) = (seen.labels.width, seen.labels.height);
    let (mut sunny, mut known) = (0u32, 0u32);
    for ny in y.saturating_sub(1)..(y + 2).min(height) {
        for nx in x.saturating_sub(1)..(x + 2).min(width) {
            let band = &seen.bands[ny / BAND_ROWS];
            let id = band.id(ny % BAND_ROWS, nx, pattern.centre);
            if id != NOTHING && (id == g.id || surface_key(frame, id) == g.key) {
                known += 1;
                sunny += u32::from(seen.sunny[ny * width + nx]);
            }
        }
    }
    if known > 1 && (sunny == 0 || sunny == known) {
        return if sunny > 0 { 1.0 } else { 0.0 };
    }
    let ray = |x: f32, y: f32| {
        shade::sees_sun(frame, &fragment::bare(frame, g.id, x, y, fragment::depth(frame, g.id, x, y)))
    };
    if g.count < 2.0 {
        return f32::from(u8::from(ray(g.at.0 / g.own, g.at.1 / g.own)));
    }
    let spread = [(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)];
    let rays = spread.iter().filter(|&&(dx, dy)| ray(x as f32 + dx, y as f32 + dy)).count();
    rays as f32 * 0.25
}
