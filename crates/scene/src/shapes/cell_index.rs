//! Square cells of a plane, with a list of triangles for each cell.

use glam::Vec2;

/// Margin around each triangle, in units of one cell. The margin covers the rounding errors of the triangle's edges.
const MARGIN_CELLS: f32 = 1e-3;

/// Square cells. For each cell, the index contains the numbers of the triangles that overlap the cell.
#[derive(Debug)]
pub(super) struct CellIndex {
    size: (usize, usize),
    starts: Vec<u32>,
    items: Vec<u32>,
}

/// The number and the corners of a triangle. Coordinates are in units of one cell.
pub(super) type PlanarTriangle = (u32, [Vec2; 3]);

impl CellIndex {
    /// Builds `size.0` times `size.1` cells that start at the origin. Each cell lists its triangles in the order of
    /// `triangles`.
    pub(super) fn new(size: (usize, usize), triangles: impl Iterator<Item = PlanarTriangle> + Clone) -> Self {
        let mut counts = vec![0u32; size.0 * size.1];
        triangles.clone().for_each(|(_, corners)| for_each_cell(corners, size, |cell| counts[cell] += 1));
        let mut starts = vec![0];
        starts.extend(counts.iter_mut().scan(0, |end, count| {
            *end += std::mem::take(count);
            Some(*end)
        }));
        let mut items = vec![0u32; starts[counts.len()] as usize];
        triangles.for_each(|(number, corners)| {
            for_each_cell(corners, size, |cell| {
                items[(starts[cell] + counts[cell]) as usize] = number;
                counts[cell] += 1;
            });
        });
        Self { size, starts, items }
    }

    /// Renumbers the `count` triangles in the order in which the cells first list the triangles. Returns the old
    /// number of each triangle.
    ///
    /// The order of the triangles within a cell is unchanged. Triangles outside all cells have no new number.
    pub(super) fn renumber(&mut self, count: usize) -> Vec<u32> {
        let mut new = vec![u32::MAX; count];
        let mut old = Vec::with_capacity(count);
        for item in &mut self.items {
            let number = &mut new[*item as usize];
            if *number == u32::MAX {
                *number = old.len() as u32;
                old.push(*item);
            }
            *item = *number;
        }
        old
    }

    /// Returns the numbers of the triangles that may cover `place`. Returns `None` if `place` is outside all cells.
    pub(super) fn triangles_at(&self, place: Vec2) -> Option<&[u32]> {
        let inside = |x: f32, cells: usize| x >= 0.0 && x < cells as f32;
        // NaN fails these comparisons, so NaN is outside all cells.
        if !(inside(place.x, self.size.0) && inside(place.y, self.size.1)) {
            return None;
        }
        let cell = place.y as usize * self.size.0 + place.x as usize;
        Some(&self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize])
    }
}

/// Calls `each` for every cell that overlaps a triangle.
fn for_each_cell([a, b, c]: [Vec2; 3], size: (usize, usize), mut each: impl FnMut(usize)) {
    let (low, high) = (a.min(b).min(c) - MARGIN_CELLS, a.max(b).max(c) + MARGIN_CELLS);
    let outside = low.x >= size.0 as f32 || low.y >= size.1 as f32 || high.x < 0.0 || high.y < 0.0;
    if outside || size.0 == 0 || size.1 == 0 {
        return;
    }
    for row in low.y as usize..=(high.y as usize).min(size.1 - 1) {
        let (bottom, top) = (row as f32 - MARGIN_CELLS, row as f32 + 1.0 + MARGIN_CELLS);
        let (mut left, mut right) = (f32::MAX, f32::MIN);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = if p.y < q.y { (p, q) } else { (q, p) };
            if p.y > top || q.y < bottom {
                continue;
            }
            let at = |y: f32| if q.y > p.y { p.x + (q.x - p.x) * ((y - p.y) / (q.y - p.y)) } else { p.x };
            for x in
                [at(bottom.max(p.y)), at(top.min(q.y)), if q.y > p.y { at(p.y.max(bottom)) } else { q.x }]
            {
                (left, right) = (left.min(x), right.max(x));
            }
        }
        let (left, right) = (left - MARGIN_CELLS, right + MARGIN_CELLS);
        if right < 0.0 || left >= size.0 as f32 {
            continue;
        }
        for column in left.max(0.0) as usize..=(right as usize).min(size.0 - 1) {
            each(row * size.0 + column);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Draws;

    #[test]
    fn every_place_finds_the_triangles_that_cover_it() {
        let draws = Draws::new(3, "cells");
        let value = |i: u64| draws.range_f32(i, -4.0, 14.0);
        let triangles: Vec<PlanarTriangle> = (0..60)
            .map(|i| (i as u32, [0, 2, 4].map(|k| Vec2::new(value(6 * i + k), value(6 * i + k + 1)))))
            .collect();
        let columns = CellIndex::new((10, 7), triangles.iter().copied());
        let mut covered = 0;
        for i in 0..2000 {
            let place =
                Vec2::new(draws.range_f32(1000 + 2 * i, 0.0, 10.0), draws.range_f32(1001 + 2 * i, 0.0, 7.0));
            let listed = columns.triangles_at(place).unwrap();
            for (number, [a, b, c]) in &triangles {
                let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| (*q - *p).perp_dot(place - *p));
                if sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0) {
                    covered += 1;
                    assert!(listed.contains(number), "{place} and triangle {number}");
                }
            }
        }
        assert!(covered > 2000, "{covered}");
        assert!(
            columns.triangles_at(Vec2::new(-0.1, 3.0)).is_none()
                && columns.triangles_at(Vec2::new(3.0, 7.0)).is_none()
        );
    }

    #[test]
    fn new_numbers_mean_the_same_triangles_in_the_same_order() {
        let at = |x: f32| [Vec2::new(x, 0.2), Vec2::new(x + 2.5, 0.4), Vec2::new(x, 1.7)];
        let triangles: Vec<PlanarTriangle> =
            [5.0, 0.0, 2.0, 20.0].into_iter().map(at).zip(0..).map(|(t, i)| (i, t)).collect();
        let before = CellIndex::new((9, 2), triangles.iter().copied());
        let mut after = CellIndex::new((9, 2), triangles.iter().copied());
        let old = after.renumber(triangles.len());
        // The last triangle is outside all cells, so it has no new number.
        assert_eq!(old, [1, 2, 0]);
        assert_eq!(before.starts, after.starts);
        let renamed: Vec<u32> = after.items.iter().map(|&i| old[i as usize]).collect();
        assert_eq!(before.items, renamed);
    }
}
