//! Tiles of an image, and the selection of pixels that are drawn.

use std::ops::Range;

/// Number of pixel rows that are rasterized together.
pub(crate) const BAND_ROWS: usize = 16;
/// Number of pixel columns of a tile. A tile has as many rows as a band.
const TILE_COLUMNS: usize = 40;
/// Side of a block in pixels. Triangles that overlap no block with a drawn pixel are not drawn.
const BLOCK: usize = 4;

/// The tiles of an image, and the selection of pixels that are drawn.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    width: usize,
    height: usize,
    across: usize,
    /// For each row, the ranges of columns that are drawn, in ascending order.
    row_runs: Vec<Vec<(usize, usize)>>,
    /// Whether the light of each pixel is needed. The list is empty if the light of all drawn pixels is needed.
    needs_light: Vec<bool>,
    /// For each corner of a block, the number of drawn blocks above and to the left of the corner. The list is empty if
    /// all pixels are drawn.
    block_counts: Vec<u32>,
}

impl Tiles {
    /// Selects all pixels of an image.
    pub(crate) fn all(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            across: width.div_ceil(TILE_COLUMNS),
            row_runs: vec![vec![(0, width)]; height],
            needs_light: Vec::new(),
            block_counts: Vec::new(),
        }
    }

    /// Selects the tiles for which `on` returns true. Tiles are numbered row by row from the top left.
    pub(crate) fn from_fn(width: usize, height: usize, on: impl Fn(usize) -> bool) -> Self {
        let mut tiles = Self::all(width, height);
        let (_, count) = tiles.row_and_total_counts();
        let mut is_drawn = vec![false; width * height];
        for tile in (0..count).filter(|&tile| on(tile)) {
            tiles.pixels(tile).for_each(|at| is_drawn[at] = true);
        }
        tiles.select(&is_drawn);
        tiles
    }

    /// Selects the pixels whose light is needed. Pixels up to `reach` rows and columns away are drawn too, but have no
    /// light. The sunlight of a pixel depends on the pixels around it.
    pub(crate) fn from_pixels(width: usize, height: usize, needs_light: Vec<bool>, reach: usize) -> Self {
        let mut tiles = Self::all(width, height);
        tiles.select(&dilate(&needs_light, width, reach));
        tiles.needs_light = needs_light;
        tiles
    }

    fn select(&mut self, is_drawn: &[bool]) {
        let (w, h) = (self.width.div_ceil(BLOCK), self.height.div_ceil(BLOCK));
        let mut blocks = vec![0u32; w * h];
        for (y, row) in is_drawn.chunks(self.width).enumerate() {
            let runs = &mut self.row_runs[y];
            runs.clear();
            let mut x = 0;
            while let Some(start) = row[x..].iter().position(|&on| on).map(|k| x + k) {
                let end = row[start..].iter().position(|&on| !on).map_or(self.width, |k| start + k);
                runs.push((start, end));
                (start / BLOCK..=(end - 1) / BLOCK).for_each(|k| blocks[y / BLOCK * w + k] = 1);
                x = end;
            }
        }
        self.block_counts = vec![0; (w + 1) * (h + 1)];
        for y in 0..h {
            let mut sum = 0;
            for x in 0..w {
                sum += blocks[y * w + x];
                self.block_counts[(y + 1) * (w + 1) + x + 1] = self.block_counts[y * (w + 1) + x + 1] + sum;
            }
        }
    }

    /// Returns the number of tiles per row, and the total number of tiles.
    pub(crate) fn row_and_total_counts(&self) -> (usize, usize) {
        (self.across, self.across * self.height.div_ceil(BAND_ROWS))
    }

    /// Returns the ranges of pixel columns and rows of a tile.
    pub(crate) fn extent(&self, tile: usize) -> (Range<usize>, Range<usize>) {
        let (x, y) = (tile % self.across * TILE_COLUMNS, tile / self.across * BAND_ROWS);
        (x..(x + TILE_COLUMNS).min(self.width), y..(y + BAND_ROWS).min(self.height))
    }

    /// Returns the indices of the pixels of a tile. The indices refer to the whole image.
    pub(crate) fn pixels(&self, tile: usize) -> impl Iterator<Item = usize> + use<> {
        let ((columns, rows), width) = (self.extent(tile), self.width);
        rows.flat_map(move |y| columns.clone().map(move |x| y * width + x))
    }

    /// Returns whether the light of a drawn pixel is needed.
    pub(crate) fn needs_light(&self, x: usize, y: usize) -> bool {
        self.needs_light.is_empty() || self.needs_light[y * self.width + x]
    }

    /// Returns the column ranges that are drawn in each row of band `band`, in ascending order.
    pub(crate) fn band_runs(&self, band: usize) -> &[Vec<(usize, usize)>] {
        &self.row_runs[band * BAND_ROWS..((band + 1) * BAND_ROWS).min(self.height)]
    }

    /// Returns whether a rectangle of the image may contain a drawn pixel. The coordinates are in pixels.
    pub(crate) fn may_overlap(&self, (left, top): (f32, f32), (right, bottom): (f32, f32)) -> bool {
        if self.block_counts.is_empty() {
            return true;
        }
        let (w, h) = (self.width.div_ceil(BLOCK), self.height.div_ceil(BLOCK));
        // `as` saturates, so a value outside the range of `usize` is converted to the nearest limit.
        let column = |x: f32| (x.max(0.0) as usize / BLOCK).min(w - 1);
        let row = |y: f32| (y.max(0.0) as usize / BLOCK).min(h - 1);
        let (x0, x1, y0, y1) = (column(left), column(right) + 1, row(top), row(bottom) + 1);
        let count = |x: usize, y: usize| self.block_counts[y * (w + 1) + x];
        count(x1, y1) + count(x0, y0) > count(x0, y1) + count(x1, y0)
    }
}

/// Returns whether each pixel is at most `reach` rows and columns away from a pixel of `needed`.
fn dilate(needed: &[bool], width: usize, reach: usize) -> Vec<bool> {
    let height = needed.len() / width;
    let mut near = Vec::with_capacity(needed.len());
    let mut column = vec![false; width];
    for y in 0..height {
        column.fill(false);
        for row in y.saturating_sub(reach)..(y + reach + 1).min(height) {
            column.iter_mut().zip(&needed[row * width..]).for_each(|(any, on)| *any |= on);
        }
        if !column.contains(&true) {
            near.extend_from_slice(&column);
            continue;
        }
        let window = |x: usize| x.saturating_sub(reach)..(x + reach + 1).min(width);
        near.extend((0..width).map(|x| column[window(x)].contains(&true)));
    }
    near
}

#[cfg(test)]
mod tests {
    use super::Tiles;

    #[test]
    fn runs_join_adjacent_tiles_and_end_at_the_edge() {
        let tiles = Tiles::from_fn(100, 20, |i| i != 1);
        assert_eq!(tiles.row_and_total_counts(), (3, 6));
        assert_eq!(tiles.band_runs(0)[15], [(0, 40), (80, 100)]);
        assert_eq!(tiles.band_runs(1)[3], [(0, 100)]);
        assert_eq!(tiles.extent(5), (80..100, 16..20));
        assert!(tiles.may_overlap((30.0, 3.0), (50.0, 4.0)) && !tiles.may_overlap((41.0, 3.0), (79.0, 15.5)));
    }

    #[test]
    fn pixels_are_drawn_with_their_surroundings() {
        let mut needed = vec![false; 50 * 30];
        needed[10 * 50 + 20] = true;
        let tiles = Tiles::from_pixels(50, 30, needed, 2);
        for (row, runs) in tiles.band_runs(0).iter().enumerate() {
            assert_eq!(runs.as_slice(), if (8..=12).contains(&row) { &[(18, 23)][..] } else { &[] }, "{row}");
        }
        assert!(tiles.needs_light(20, 10) && !tiles.needs_light(21, 10));
        assert!(tiles.may_overlap((0.0, 0.0), (19.0, 9.0)) && !tiles.may_overlap((30.0, 0.0), (49.0, 29.0)));
    }
}
