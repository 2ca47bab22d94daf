//! Statistics of color cameras. Pixels are compared only with pixels that have the same filter.
//!
//! The pixels of one cell of the pattern form a regular grid with one filter. Each grid is summarized like a separate
//! sensor.

use super::estimate::median;
use super::summary::{Defects, Summary, summarize, summarize_without};
use super::{Counts, Statistics};
use serde_json::{Value, json};
use spikelane::error::Result;
use spikelane::sensor::Mosaic;
use spikelane::spikes::Geometry;

/// Smallest ratio of the differences of adjacent pixels to the differences of pixels at distance two in a mosaic.
///
/// In an image without a mosaic, the difference grows with the distance, and the ratio is at most 1.
const MIN_DIFFERENCE_RATIO: f64 = 1.5;

/// Smallest number of rows and columns in which a pattern is detected.
const MIN_PATTERN_SIDE: usize = 16;

/// Summary of the pixels of one cell of a mosaic.
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct CellSummary {
    /// Letter of the channel.
    pub channel: char,
    /// Row of the cell in the pattern.
    pub row: usize,
    /// Column of the cell in the pattern.
    pub col: usize,
    /// Number of pixels.
    pub pixels: usize,
    /// Summary of these pixels, as if they were a sensor. Indices of defects are pixels of the whole sensor.
    pub summary: Summary,
}

impl CellSummary {
    /// Returns the cell as JSON. A value that was not determined has no key.
    pub(super) fn to_json(&self) -> Value {
        let d = &self.summary.defects;
        let mut cell = json!({
            "channel": self.channel, "row": self.row, "col": self.col, "pixels": self.pixels,
            "dead_pixels": d.dead.len(), "stuck_pixels": d.stuck.len(),
            "hot_pixels": d.hot.len(), "weak_pixels": d.weak.len(),
        });
        let values = [
            ("mean_rate", self.summary.mean_rate),
            ("nonuniformity", self.summary.nonuniformity),
            ("local_nonuniformity", self.summary.local_nonuniformity),
        ];
        for (key, estimate) in values.into_iter().filter(|(_, e)| e.value.is_finite()) {
            cell[key] = json!(estimate.value);
        }
        cell
    }
}

/// Returns the counts of the pixels in every `rows`-th row and every `cols`-th column, from pixel `(row, col)`. Coincidences of
/// neighbors are omitted, because the pixels are not neighbors.
fn cell_counts(
    counts: &Counts,
    width: usize,
    [row, col]: [usize; 2],
    [rows, cols]: [usize; 2],
) -> Option<Counts> {
    let height = counts.count.len() / width;
    let size = [width.saturating_sub(col).div_ceil(cols), height.saturating_sub(row).div_ceil(rows)];
    let geometry = Geometry::new(size[0] as u32, size[1] as u32).ok()?;
    let pick = |map: &[u32]| -> Vec<u32> {
        (row..height)
            .step_by(rows)
            .flat_map(|r| (col..width).step_by(cols).map(move |c| r * width + c))
            .map(|p| map[p])
            .collect()
    };
    Some(Counts {
        geometry,
        rows: 0..geometry.height(),
        readouts: counts.readouts,
        count: pick(&counts.count),
        first_spike: pick(&counts.first_spike),
        last_spike: pick(&counts.last_spike),
        coincidences: std::array::from_fn(|_| vec![0; geometry.pixels()]),
    })
}

/// Summarizes the pixels of each cell of `mosaic`. Cells outside the sensor are omitted.
///
/// # Errors
/// As [`summarize`].
pub fn summarize_cells(statistics: &Statistics, mosaic: &Mosaic) -> Result<Vec<CellSummary>> {
    // An error about missing counts comes from the summary of all pixels.
    let Some(counts) =
        statistics.counts.as_ref().filter(|_| statistics.rows == (0..statistics.geometry.height()))
    else {
        return summarize(statistics).map(|_| Vec::new());
    };
    let (width, (rows, cols)) = (statistics.geometry.width(), mosaic.period());
    let mut cells = Vec::new();
    for (row, col) in (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col))) {
        let Some(counts) = cell_counts(counts, width, [row, col], [rows, cols]) else { continue };
        let cell_width = counts.geometry.width();
        let part = Statistics {
            geometry: counts.geometry,
            rows: counts.rows.clone(),
            readouts: statistics.readouts,
            counts: Some(counts),
            intervals: None,
            frames: None,
            counts_before_split: None,
        };
        let mut summary = summarize(&part)?;
        let d = &mut summary.defects;
        for p in [&mut d.dead, &mut d.stuck, &mut d.hot, &mut d.weak].into_iter().flatten() {
            *p = (row + *p / cell_width * rows) * width + col + *p % cell_width * cols;
        }
        let pixels = part.counts.map_or(0, |counts| counts.count.len());
        cells.push(CellSummary { channel: mosaic.name_at(row, col), row, col, pixels, summary });
    }
    Ok(cells)
}

/// Summarizes the statistics of all rows of a color camera. Defects are the defects of [`summarize_cells`], which
/// compares only pixels with equal filters.
///
/// # Errors
/// As [`summarize`].
pub fn summarize_mosaic(statistics: &Statistics, mosaic: &Mosaic) -> Result<Summary> {
    let mut all = Defects::default();
    for cell in summarize_cells(statistics, mosaic)? {
        let d = cell.summary.defects;
        let pairs = [
            (&mut all.dead, d.dead),
            (&mut all.stuck, d.stuck),
            (&mut all.hot, d.hot),
            (&mut all.weak, d.weak),
        ];
        pairs.into_iter().for_each(|(all, found)| all.extend(found));
    }
    [&mut all.dead, &mut all.stuck, &mut all.hot, &mut all.weak].into_iter().for_each(|p| p.sort_unstable());
    summarize_without(statistics, all)
}

/// Detects a pattern of 2x2 filters in the counts of a stream. Returns the two possible Bayer patterns, or `None` if the
/// counts have no such pattern.
///
/// In a mosaic, adjacent pixels differ more than pixels at distance two, in rows and in columns, because the latter have
/// the same filter. Each difference is a median over the sensor. The two green pixels of a block differ less than the
/// red and the blue pixel. Rates do not show which of the other two pixels is red. A gray scene in front of a camera
/// with equal channels has no detectable pattern.
///
/// # Examples
/// ```
/// use spikelane_measure::detect_mosaic;
/// // Rates of an orange wall: red 40, green 20 and blue 5.
/// let counts: Vec<u32> = (0..32 * 32)
///     .map(|p| match (p / 32 % 2, p % 2) {
///         (0, 0) => 40,
///         (1, 1) => 5,
///         _ => 20,
///     })
///     .collect();
/// let patterns = detect_mosaic(&counts, 32).expect("a pattern");
/// assert_eq!(patterns.map(|mosaic| mosaic.to_string()), ["RGGB", "BGGR"]);
/// assert!(detect_mosaic(&[20; 32 * 32], 32).is_none());
/// ```
#[must_use]
pub fn detect_mosaic(counts: &[u32], width: usize) -> Option<[Mosaic; 2]> {
    let height = counts.len() / width.max(1);
    if width < MIN_PATTERN_SIDE || height < MIN_PATTERN_SIDE {
        return None;
    }
    let difference = |p: usize, q: usize| f64::from(counts[p].abs_diff(counts[q]));
    // The median over all pixels that have another pixel `down` rows below and `right` columns to the right.
    let typical = |down: usize, right: usize| {
        let pixels = (0..height - down).flat_map(|r| (0..width - right).map(move |c| r * width + c));
        median(&mut pixels.map(|p| difference(p, p + down * width + right)).collect::<Vec<f64>>())
    };
    let alternates = |near: f64, far: f64| near > 1.0 && near > MIN_DIFFERENCE_RATIO * far;
    if !alternates(typical(0, 1), typical(0, 2)) || !alternates(typical(1, 0), typical(2, 0)) {
        return None;
    }
    let blocks =
        || (0..height - 1).step_by(2).flat_map(|r| (0..width - 1).step_by(2).map(move |c| r * width + c));
    let main = median(&mut blocks().map(|p| difference(p, p + width + 1)).collect::<Vec<f64>>());
    let anti = median(&mut blocks().map(|p| difference(p + 1, p + width)).collect::<Vec<f64>>());
    let names = if anti <= main { ["RGGB", "BGGR"] } else { ["GRBG", "GBRG"] };
    let [first, second] = names.map(|name| name.parse().ok());
    first.zip(second).map(|(first, second)| [first, second])
}
