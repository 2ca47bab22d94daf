//! What is seen where: visible triangles, labels of the pixels' centres, and where the sun shines.

use super::band::Band;
use super::fragment::{Latest, surface_key};
use super::frame::Frame;
use super::picture::Labels;
use super::raster::{NOTHING, Pattern, project, visible_chunks};
use super::shade;
use super::tiles::{BAND_ROWS, Tiles};
use crate::shapes::material::Semantic;
use spikelane::unstable::threads;

/// Visible samples of all bands, and what was derived from the centres.
pub(super) struct Seen {
    pub bands: Vec<Band>,
    pub labels: Labels,
    /// Per pixel: 0 nothing or in shade, 1 in the sun.
    pub sunny: Vec<u8>,
}

pub(super) fn rows_of(band: usize, height: usize) -> usize {
    BAND_ROWS.min(height - band * BAND_ROWS)
}

/// Pixels of tiles that are not drawn show nothing.
pub(super) fn see(frame: &Frame, pattern: &Pattern, tiles: &Tiles, shadows: bool, threads: usize) -> Seen {
    let i = frame.camera.intrinsics;
    let (width, height) = (i.width as usize, i.height as usize);
    let chunks = visible_chunks(frame, tiles);
    let batches =
        threads::indexed(threads, chunks.len(), |k| project(frame, chunks[k].0, chunks[k].1, tiles));
    let count = height.div_ceil(BAND_ROWS);
    let parts = threads::indexed(threads, count, |b| {
        let (rows, runs) = (rows_of(b, height), tiles.runs(b));
        let band = Band::fill(&batches, pattern, &runs, width, b * BAND_ROWS, rows);
        let (labels, sunny) = centres(frame, &band, pattern, (b, tiles), shadows);
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

/// Labels where there is nothing but sky.
fn sky(width: usize, rows: usize, t: f64) -> Labels {
    let n = width * rows;
    Labels {
        depth_m: vec![f32::INFINITY; n],
        instance: vec![0; n],
        semantic: vec![Semantic::Sky as u8; n],
        part: vec![0; n],
        ..empty(width, rows, t)
    }
}

/// Labels, and whether the sun shines, at the pixel centres of a band's runs.
pub(super) fn centres(
    frame: &Frame,
    band: &Band,
    pattern: &Pattern,
    (index, tiles): (usize, &Tiles),
    shadows: bool,
) -> (Labels, Vec<u8>) {
    let i = frame.camera.intrinsics;
    let (width, height) = (i.width as usize, i.height as usize);
    let (rows, runs) = (rows_of(index, height), tiles.runs(index));
    let mut labels = sky(width, rows, frame.t);
    let mut latest = Latest::default();
    for row in 0..rows {
        let y = (index * BAND_ROWS + row) as f32 + 0.5;
        for column in runs.iter().flat_map(|run| run.0..run.1) {
            let id = band.id(row, column, pattern.centre);
            if id == NOTHING {
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

/// Where the sun shines: a ray on every other pixel of a chessboard, and on the
/// rest wherever their neighbours disagree. A shadow a pixel wide meets the
/// first half, so none is lost.
fn sunlight(
    frame: &Frame,
    band: &Band,
    pattern: &Pattern,
    (index, tiles): (usize, &Tiles),
    labels: &Labels,
) -> Vec<u8> {
    let (width, rows) = (labels.width, labels.height);
    let (runs, near) = (tiles.runs(index), tiles.near_light(index));
    let mut sunny = vec![0u8; width * rows];
    let mut latest = Latest::default();
    let mut ray = |row: usize, column: usize, id: u32| {
        let (x, y) = (column as f32 + 0.5, (index * BAND_ROWS + row) as f32 + 0.5);
        let bare = latest.get(frame, id).bare(frame, x, y, labels.depth_m[row * width + column]);
        u8::from(shade::sees_sun(frame, &bare))
    };
    for odd in [0, 1] {
        for row in 0..rows {
            for column in runs.iter().flat_map(|run| run.0..run.1).filter(|c| (c + row) % 2 == odd) {
                let id = band.id(row, column, pattern.centre);
                if id == NOTHING || !near[row * width + column] {
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
