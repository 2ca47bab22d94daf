//! Which things are near a place: a flat grid of lists.

use glam::Vec2;

/// A rectangle of square cells, each with the things that reach into it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    low: Vec2,
    cell_m: f32,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    items: Vec<u16>,
}

impl Grid {
    /// A grid of the rectangles `(low, high, item)`, in their order.
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
        let mut grid = Self { low, cell_m, columns, rows, starts: vec![0], items: Vec::new() };
        for list in lists {
            grid.items.extend(list);
            grid.starts.push(grid.items.len() as u32);
        }
        grid
    }

    /// What reaches into the cell of `p`.
    pub(crate) fn at(&self, p: Vec2) -> &[u16] {
        let q = (p - self.low) / self.cell_m;
        // Not a number fails this comparison too.
        if !(q.x >= 0.0 && q.y >= 0.0 && q.x < self.columns as f32 && q.y < self.rows as f32) {
            return &[];
        }
        let cell = q.y as usize * self.columns + q.x as usize;
        &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}
