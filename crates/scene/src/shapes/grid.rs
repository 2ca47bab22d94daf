//! A grid that lists the items near each place.

use glam::Vec2;

/// A rectangle of square cells. For each cell, the grid contains the items that overlap the cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    origin: Vec2,
    cell_m: f32,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    items: Vec<u16>,
}

impl Grid {
    /// Builds a grid of the items in `things`. Each element is (lower corner, upper corner, item) of a rectangle. Each
    /// cell lists its items in the order of `things`.
    pub(crate) fn new(cell_m: f32, things: &[(Vec2, Vec2, u16)]) -> Self {
        let low = things.iter().fold(Vec2::MAX, |m, t| m.min(t.0));
        let high = things.iter().fold(Vec2::MIN, |m, t| m.max(t.1));
        if things.is_empty() {
            return Self { cell_m, ..Self::default() };
        }
        let size = (high - low) / cell_m;
        let (columns, rows) = (size.x as usize + 1, size.y as usize + 1);
        let mut lists: Vec<Vec<u16>> = vec![Vec::new(); columns * rows];
        for (a, b, item) in things {
            let (a, b) = ((*a - low) / cell_m, (*b - low) / cell_m);
            for row in a.y as usize..=b.y as usize {
                for column in a.x as usize..=b.x as usize {
                    lists[row * columns + column].push(*item);
                }
            }
        }
        let mut grid = Self { origin: low, cell_m, columns, rows, starts: vec![0], items: Vec::new() };
        for list in lists {
            grid.items.extend(list);
            grid.starts.push(grid.items.len() as u32);
        }
        grid
    }

    /// Returns the items that overlap the cell that contains `p`.
    pub(crate) fn items_at(&self, p: Vec2) -> &[u16] {
        let q = (p - self.origin) / self.cell_m;
        // NaN fails these comparisons, so NaN is outside the grid.
        if !(q.x >= 0.0 && q.y >= 0.0 && q.x < self.columns as f32 && q.y < self.rows as f32) {
            return &[];
        }
        let cell = q.y as usize * self.columns + q.x as usize;
        &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}
