//! Tiles of an image, and the selection of tiles that are drawn.

/// Number of pixel rows that are rasterized together.
pub(crate) const BAND_ROWS: usize = 16;
/// Number of pixel columns of a tile. A tile has as many rows as a band.
const TILE_COLUMNS: usize = 40;

/// The tiles of an image, and the selection of tiles that are drawn.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    width: usize,
    height: usize,
    across: usize,
    is_drawn: Vec<bool>,
    draws_all: bool,
    /// Whether the light of each pixel is not needed. The vector is empty if the light of all pixels is needed.
    is_light_skipped: Vec<bool>,
}

impl Tiles {
    /// Selects all tiles of an image.
    pub(crate) fn all(width: usize, height: usize) -> Self {
        Self::from_fn(width, height, |_| true)
    }

    /// Selects the tiles for which `on` returns true. Tiles are numbered row by row from the top left.
    pub(crate) fn from_fn(width: usize, height: usize, on: impl Fn(usize) -> bool) -> Self {
        let across = width.div_ceil(TILE_COLUMNS);
        let on: Vec<bool> = (0..across * height.div_ceil(BAND_ROWS)).map(on).collect();
        let all = on.iter().all(|&on| on);
        Self { width, height, across, is_drawn: on, draws_all: all, is_light_skipped: Vec::new() }
    }

    /// Returns the number of tiles per row, and the total number of tiles.
    pub(crate) fn row_and_total_counts(&self) -> (usize, usize) {
        (self.across, self.is_drawn.len())
    }

    /// Returns whether any tile is drawn.
    pub(crate) fn has_any(&self) -> bool {
        self.is_drawn.iter().any(|&on| on)
    }

    /// Returns the ranges of pixel columns and rows of a tile.
    pub(crate) fn extent(&self, tile: usize) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let (x, y) = (tile % self.across * TILE_COLUMNS, tile / self.across * BAND_ROWS);
        (x..(x + TILE_COLUMNS).min(self.width), y..(y + BAND_ROWS).min(self.height))
    }

    /// Returns the indices of the pixels of a tile. The indices refer to the whole image.
    pub(crate) fn pixels(&self, tile: usize) -> impl Iterator<Item = usize> {
        let ((columns, rows), width) = (self.extent(tile), self.width);
        rows.flat_map(move |y| columns.clone().map(move |x| y * width + x))
    }

    /// Marks the light of some pixels of a tile as not needed. `pixels` is true for these pixels. Their labels are
    /// still computed.
    pub(crate) fn skip_light(&mut self, tile: usize, pixels: &[bool]) {
        let (columns, rows) = self.extent(tile);
        self.is_light_skipped.resize(self.width * self.height, false);
        for (row, pixels) in rows.zip(pixels.chunks(columns.len())) {
            let at = row * self.width;
            self.is_light_skipped[at + columns.start..at + columns.end].copy_from_slice(pixels);
        }
    }

    /// Returns whether the light of a pixel in a drawn tile is needed.
    pub(crate) fn needs_light(&self, x: usize, y: usize) -> bool {
        self.is_light_skipped.get(y * self.width + x).is_none_or(|out| !out)
    }

    /// Returns a value for each pixel of a band. The value is true if the light of any pixel at most two rows and two
    /// columns away is needed.
    ///
    /// Only at these pixels, direct sunlight must be computed.
    pub(crate) fn near_needed_light(&self, band: usize) -> Vec<bool> {
        let top = band * BAND_ROWS;
        let rows = BAND_ROWS.min(self.height - top);
        if self.is_light_skipped.is_empty() {
            return vec![true; rows * self.width];
        }
        let mut near = Vec::with_capacity(rows * self.width);
        let mut column = vec![false; self.width];
        for y in top..top + rows {
            column.fill(false);
            for row in y.saturating_sub(2)..(y + 3).min(self.height) {
                let left_out = &self.is_light_skipped[row * self.width..][..self.width];
                column.iter_mut().zip(left_out).for_each(|(any, out)| *any |= !out);
            }
            let end = self.width;
            near.extend((0..end).map(|x| column[x.saturating_sub(2)..(x + 3).min(end)].contains(&true)));
        }
        near
    }

    /// Returns the column ranges of band `band` that are drawn, in ascending order.
    pub(crate) fn runs(&self, band: usize) -> Vec<(usize, usize)> {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for tile in (band * self.across..(band + 1) * self.across).filter(|&tile| self.is_drawn[tile]) {
            let (columns, _) = self.extent(tile);
            match runs.last_mut() {
                Some(run) if run.1 == columns.start => run.1 = columns.end,
                _ => runs.push((columns.start, columns.end)),
            }
        }
        runs
    }

    /// Returns whether a rectangle of the image may overlap a drawn tile. The coordinates are in pixels.
    pub(crate) fn may_overlap(&self, (left, top): (f32, f32), (right, bottom): (f32, f32)) -> bool {
        if self.draws_all {
            return true;
        }
        // `as` saturates, so a value outside the range of `usize` is converted to the nearest limit.
        let column = |x: f32| (x.max(0.0) as usize / TILE_COLUMNS).min(self.across - 1);
        let row = |y: f32| (y.max(0.0) as usize / BAND_ROWS).min(self.is_drawn.len() / self.across - 1);
        let columns = column(left)..=column(right);
        (row(top)..=row(bottom)).any(|y| columns.clone().any(|x| self.is_drawn[y * self.across + x]))
    }
}

#[cfg(test)]
mod tests {
    use super::Tiles;

    #[test]
    fn runs_join_adjacent_tiles_and_end_at_the_edge() {
        let tiles = Tiles::from_fn(100, 20, |i| i != 1);
        assert_eq!(tiles.row_and_total_counts(), (3, 6));
        assert_eq!(tiles.runs(0), [(0, 40), (80, 100)]);
        assert_eq!(tiles.runs(1), [(0, 100)]);
        assert_eq!(tiles.extent(5), (80..100, 16..20));
        assert!(tiles.may_overlap((30.0, 3.0), (50.0, 4.0)) && !tiles.may_overlap((41.0, 3.0), (79.0, 15.5)));
    }
}
