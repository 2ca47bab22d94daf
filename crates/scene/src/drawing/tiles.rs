//! A picture in tiles, some of which are drawn.

/// Rows of pixels that are rasterised together.
pub(crate) const BAND_ROWS: usize = 16;
/// Columns of a tile; its rows are those of a band.
const COLUMNS: usize = 40;

/// Which tiles of a picture are drawn.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    width: usize,
    height: usize,
    across: usize,
    on: Vec<bool>,
    all: bool,
    /// Pixels whose light nobody asks for; empty where there is none.
    left_out: Vec<bool>,
}

impl Tiles {
    /// All tiles of a picture.
    pub(crate) fn all(width: usize, height: usize) -> Self {
        Self::chosen(width, height, |_| true)
    }

    /// The tiles, by number from the top left, for which `on` holds.
    pub(crate) fn chosen(width: usize, height: usize, on: impl Fn(usize) -> bool) -> Self {
        let across = width.div_ceil(COLUMNS);
        let on: Vec<bool> = (0..across * height.div_ceil(BAND_ROWS)).map(on).collect();
        let all = on.iter().all(|&on| on);
        Self { width, height, across, on, all, left_out: Vec::new() }
    }

    /// How many tiles lie in a row, and how many there are.
    pub(crate) fn counts(&self) -> (usize, usize) {
        (self.across, self.on.len())
    }

    /// Whether any tile is drawn.
    pub(crate) fn any(&self) -> bool {
        self.on.iter().any(|&on| on)
    }

    /// Pixel columns and rows of a tile.
    pub(crate) fn extent(&self, tile: usize) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let (x, y) = (tile % self.across * COLUMNS, tile / self.across * BAND_ROWS);
        (x..(x + COLUMNS).min(self.width), y..(y + BAND_ROWS).min(self.height))
    }

    /// Numbers of a tile's pixels in the picture.
    pub(crate) fn pixels(&self, tile: usize) -> impl Iterator<Item = usize> {
        let ((columns, rows), width) = (self.extent(tile), self.width);
        rows.flat_map(move |y| columns.clone().map(move |x| y * width + x))
    }

    /// Asks for no light of some pixels of a tile; its labels are made all the same.
    pub(crate) fn leave_out(&mut self, tile: usize, pixels: &[bool]) {
        let (columns, rows) = self.extent(tile);
        self.left_out.resize(self.width * self.height, false);
        for (row, pixels) in rows.zip(pixels.chunks(columns.len())) {
            let at = row * self.width;
            self.left_out[at + columns.start..at + columns.end].copy_from_slice(pixels);
        }
    }

    /// Whether the light of a pixel of a tile that is drawn is asked for.
    pub(crate) fn lights(&self, x: usize, y: usize) -> bool {
        self.left_out.get(y * self.width + x).is_none_or(|out| !out)
    }

    /// Where sun or shade may matter: pixels up to two beside one whose light is asked for.
    pub(crate) fn near_light(&self, band: usize) -> Vec<bool> {
        let top = band * BAND_ROWS;
        let rows = BAND_ROWS.min(self.height - top);
        if self.left_out.is_empty() {
            return vec![true; rows * self.width];
        }
        let mut near = Vec::with_capacity(rows * self.width);
        let mut column = vec![false; self.width];
        for y in top..top + rows {
            column.fill(false);
            for row in y.saturating_sub(2)..(y + 3).min(self.height) {
                let left_out = &self.left_out[row * self.width..][..self.width];
                column.iter_mut().zip(left_out).for_each(|(any, out)| *any |= !out);
            }
            let end = self.width;
            near.extend((0..end).map(|x| column[x.saturating_sub(2)..(x + 3).min(end)].contains(&true)));
        }
        near
    }

    /// The runs of columns that are drawn in band `band`, ascending.
    pub(crate) fn runs(&self, band: usize) -> Vec<(usize, usize)> {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for tile in (band * self.across..(band + 1) * self.across).filter(|&tile| self.on[tile]) {
            let (columns, _) = self.extent(tile);
            match runs.last_mut() {
                Some(run) if run.1 == columns.start => run.1 = columns.end,
                _ => runs.push((columns.start, columns.end)),
            }
        }
        runs
    }

    /// Whether a rectangle of the image, in pixels, may meet a tile that is drawn.
    pub(crate) fn meet(&self, (left, top): (f32, f32), (right, bottom): (f32, f32)) -> bool {
        if self.all {
            return true;
        }
        // A float becomes the nearest integer that there is.
        let column = |x: f32| (x.max(0.0) as usize / COLUMNS).min(self.across - 1);
        let row = |y: f32| (y.max(0.0) as usize / BAND_ROWS).min(self.on.len() / self.across - 1);
        let columns = column(left)..=column(right);
        (row(top)..=row(bottom)).any(|y| columns.clone().any(|x| self.on[y * self.across + x]))
    }
}

#[cfg(test)]
mod tests {
    use super::Tiles;

    #[test]
    fn runs_join_neighbours_and_end_at_the_edge() {
        let tiles = Tiles::chosen(100, 20, |i| i != 1);
        assert_eq!(tiles.counts(), (3, 6));
        assert_eq!(tiles.runs(0), [(0, 40), (80, 100)]);
        assert_eq!(tiles.runs(1), [(0, 100)]);
        assert_eq!(tiles.extent(5), (80..100, 16..20));
        assert!(tiles.meet((30.0, 3.0), (50.0, 4.0)) && !tiles.meet((41.0, 3.0), (79.0, 15.5)));
    }
}
