//! Computes the visible triangles, the labels at the pixel centers, and the direct sunlight.

use super::band::Band;
use super::fragment::{FacetCache, surface_id};
use super::frame::SceneInstant;
use super::raster::{NO_TRIANGLE, SamplePattern, project, project_triangles, visible_chunks};
use super::rendered_frame::Labels;
use super::shade;
use super::tiles::{BAND_ROWS, Tiles};
use crate::shapes::material::Semantic;
use spikelane::unstable::threads;

/// Visible samples of all bands, and the labels and the sunlight at the pixel centers.
pub(super) struct Visibility {
    pub bands: Vec<Band>,
    pub labels: Labels,
    /// For each pixel, 1 in direct sunlight, and 0 in shadow or if no triangle is visible.
    pub is_sunlit: Vec<u8>,
}

pub(super) fn band_rows(band: usize, height: usize) -> usize {
    BAND_ROWS.min(height - band * BAND_ROWS)
}

/// Computes the visible samples. If `shadows` is true, also computes the sunlight. If `needs_labels` is false, the labels
/// are empty.
///
/// Pixels that are not drawn contain no triangle. If `city` is given, only these triangles of each chunk of the city are
/// drawn.
pub(super) fn compute_visibility(
    frame: &SceneInstant,
    pattern: &SamplePattern,
    (tiles, city): (&Tiles, Option<&[Vec<u32>]>),
    (needs_labels, shadows): (bool, bool),
    threads: usize,
) -> Visibility {
    let i = frame.camera.intrinsics;
    let (width, height) = (i.width as usize, i.height as usize);
    let chunks = visible_chunks(frame, tiles);
    let batches = threads::map_indexed(threads, chunks.len(), |k| match (chunks[k], city) {
        ((0, chunk), Some(city)) => project_triangles(frame, 0, &city[chunk], tiles),
        ((part, chunk), _) => project(frame, part, chunk, tiles),
    });
    let count = height.div_ceil(BAND_ROWS);
    let parts = threads::map_indexed(threads, count, |b| {
        let band = Band::fill(&batches, pattern, tiles.band_runs(b), width, b * BAND_ROWS);
        if needs_labels || (shadows && tiles.band_runs(b).iter().any(|runs| !runs.is_empty())) {
            let (labels, sunny) = center_labels(frame, &band, pattern, (b, tiles), shadows);
            return (band, labels, sunny);
        }
        let rows = band_rows(b, height);
        (band, empty_labels(width, rows, frame.t), vec![0; width * rows])
    });
    let mut visibility =
        Visibility { bands: Vec::new(), labels: empty_labels(width, height, frame.t), is_sunlit: Vec::new() };
    for (band, labels, sunny) in parts {
        visibility.bands.push(band);
        visibility.is_sunlit.extend(sunny);
        if !needs_labels {
            continue;
        }
        let all = &mut visibility.labels;
        all.depth_m.extend(labels.depth_m);
        all.instance.extend(labels.instance);
        all.semantic.extend(labels.semantic);
        all.part.extend(labels.part);
    }
    visibility
}

fn empty_labels(width: usize, height: usize, t: f64) -> Labels {
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

/// Returns labels in which every pixel shows the sky.
fn sky_labels(width: usize, rows: usize, t: f64) -> Labels {
    let n = width * rows;
    Labels {
        depth_m: vec![f32::INFINITY; n],
        instance: vec![0; n],
        semantic: vec![Semantic::Sky as u8; n],
        part: vec![0; n],
        ..empty_labels(width, rows, t)
    }
}

/// Returns the labels and the sunlight at the pixel centers of a band. Only the drawn pixels are computed.
pub(super) fn center_labels(
    frame: &SceneInstant,
    band: &Band,
    pattern: &SamplePattern,
    (index, tiles): (usize, &Tiles),
    shadows: bool,
) -> (Labels, Vec<u8>) {
    let i = frame.camera.intrinsics;
    let (width, height) = (i.width as usize, i.height as usize);
    let (rows, runs) = (band_rows(index, height), tiles.band_runs(index));
    let mut labels = sky_labels(width, rows, frame.t);
    let mut latest = FacetCache::default();
    for row in 0..rows {
        let y = (index * BAND_ROWS + row) as f32 + 0.5;
        for column in runs[row].iter().flat_map(|run| run.0..run.1) {
            let id = band.triangle_id(row, column, pattern.center);
            if id == NO_TRIANGLE {
                continue;
            }
            let at = row * width + column;
            let facet = latest.get(frame, id);
            let (semantic, vehicle) = facet.identity(frame);
            labels.depth_m[at] = facet.depth(frame, column as f32 + 0.5, y);
            labels.instance[at] = vehicle.map_or(0, |v| v + 1);
            labels.semantic[at] = semantic as u8;
            labels.part[at] = facet.part as u16 + 1;
        }
    }
    let sunny =
        if shadows { sunlight(frame, band, pattern, (index, tiles), &labels) } else { vec![0; width * rows] };
    (labels, sunny)
}

/// Returns which pixels are in direct sunlight.
///
/// The pixels form a checkerboard pattern. Every pixel on an even square is tested with a ray. A pixel on an odd square
/// is tested with a ray only if its neighbors differ. A shadow that is one pixel wide crosses pixels on even squares,
/// so every shadow of this width is detected.
fn sunlight(
    frame: &SceneInstant,
    band: &Band,
    pattern: &SamplePattern,
    (index, tiles): (usize, &Tiles),
    labels: &Labels,
) -> Vec<u8> {
    let (width, rows) = (labels.width, labels.height);
    let runs = tiles.band_runs(index);
    let mut sunny = vec![0u8; width * rows];
    let mut latest = FacetCache::default();
    let mut ray = |row: usize, column: usize, id: u32| {
        let (x, y) = (column as f32 + 0.5, (index * BAND_ROWS + row) as f32 + 0.5);
        let bare = latest.get(frame, id).surface_point(frame, x, y, labels.depth_m[row * width + column]);
        u8::from(shade::sees_sun(frame, &bare))
    };
    for odd in [0, 1] {
        for row in 0..rows {
            for column in runs[row].iter().flat_map(|run| run.0..run.1).filter(|c| (c + row) % 2 == odd) {
                let id = band.triangle_id(row, column, pattern.center);
                if id == NO_TRIANGLE {
                    continue;
                }
                let guess = if odd == 1 {
                    neighbor_consensus(frame, band, pattern, (row, column, rows), &sunny)
                } else {
                    None
                };
                sunny[row * width + column] = guess.unwrap_or_else(|| ray(row, column, id));
            }
        }
    }
    sunny
}

/// Returns whether the neighbors on the same surface are all sunlit (1) or all in shadow (0). Returns `None` if they
/// differ, or if fewer than two neighbors are on the same surface.
fn neighbor_consensus(
    frame: &SceneInstant,
    band: &Band,
    pattern: &SamplePattern,
    (row, column, rows): (usize, usize, usize),
    sunny: &[u8],
) -> Option<u8> {
    let width = sunny.len() / rows;
    let id = band.triangle_id(row, column, pattern.center);
    let key = surface_id(frame, id);
    let (mut known, mut sum) = (0u8, 0u8);
    for (r, c) in
        [(row.wrapping_sub(1), column), (row + 1, column), (row, column.wrapping_sub(1)), (row, column + 1)]
    {
        if r < rows && c < width {
            let other = band.triangle_id(r, c, pattern.center);
            if other == id || (other != NO_TRIANGLE && surface_id(frame, other) == key) {
                known += 1;
                sum += sunny[r * width + c];
            }
        }
    }
    (known >= 2 && (sum == 0 || sum == known)).then_some(u8::from(sum > 0))
}
