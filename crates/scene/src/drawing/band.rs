//! Triangles to sample rows: a visibility buffer filled scan line by scan line.
//!
//! A row of samples is a plain span of memory. Most triangles are small, so that finding where a span begins and
//! ends takes longer than its depth test: four rows of samples do so side by side, and a span goes in steps of four.

use wide::{f32x4, i32x4, u32x4};

use super::raster::{Batch, Flat, NOTHING, Pattern};

/// Rows of samples, or samples of a row, that go side by side.
const LANES: usize = 4;

/// The samples of a band of pixel rows.
#[derive(Debug)]
pub(crate) struct Band {
    width: usize,
    samples: usize,
    /// Both with room behind the last sample for the last step of its span.
    inverse: Vec<f32>,
    ids: Vec<u32>,
}

/// Columns `from .. to` of four rows of samples that lie in a triangle, and where in `y` those rows are.
struct Spans {
    from: [i32; LANES],
    to: [i32; LANES],
    y: [f32; LANES],
    /// The rows with any column, as bits.
    some: u32,
}

/// A triangle's sides: columns a row, of the long one and of those above and below its middle corner.
struct Sides([f32; 3]);

impl Band {
    /// Rasterises all that reaches into some runs of columns of the pixel rows `top .. top + rows`.
    pub(crate) fn fill(
        batches: &[Batch],
        pattern: &Pattern,
        runs: &[(usize, usize)],
        width: usize,
        top: usize,
        rows: usize,
    ) -> Self {
        let count = width * rows * pattern.rows() + LANES;
        let mut band =
            Self { width, samples: pattern.rows(), inverse: vec![0.0; count], ids: vec![NOTHING; count] };
        if runs.is_empty() {
            return band;
        }
        let offsets = padded(pattern);
        let (low, high) = (top as f32, (top + rows) as f32);
        for batch in batches.iter().filter(|b| b.low < high && b.high > low) {
            for flat in &batch.flats {
                if flat.y[0] < high && flat.y[2] > low {
                    band.draw(flat, &offsets, runs, (top, rows));
                }
            }
        }
        band
    }

    fn draw(
        &mut self,
        flat: &Flat,
        offsets: &[(f32x4, f32x4)],
        runs: &[(usize, usize)],
        (top, rows): (usize, usize),
    ) {
        let first = (flat.y[0] as usize).max(top);
        let last = (flat.y[2] as usize).min(top + rows - 1);
        let sides = Sides::of(flat);
        for row in first..=last {
            for (four, &(dx, dy)) in offsets.iter().enumerate() {
                let Some(spans) = sides.spans(flat, dy + row as f32, dx, self.width) else { continue };
                let mut some = spans.some;
                while some != 0 {
                    let lane = some.trailing_zeros() as usize;
                    some &= some - 1;
                    let line = (row - top) * self.samples + four * LANES + lane;
                    let (from, to) = (spans.from[lane] as usize, spans.to[lane] as usize);
                    let (y, dx) = (spans.y[lane], dx.to_array()[lane]);
                    for &(first, end) in runs {
                        let (from, to) = (from.max(first), to.min(end));
                        if from < to {
                            let x = from as f32 + dx - flat.x[0];
                            let start = flat.inverse + flat.slope.0 * x + flat.slope.1 * (y - flat.y[0]);
                            self.span(line * self.width + from, to - from, start, flat);
                        }
                    }
                }
            }
        }
    }

    /// The depth test along a row; larger inverse depth is nearer.
    fn span(&mut self, at: usize, count: usize, start: f32, flat: &Flat) {
        const STEPS: f32x4 = f32x4::new([0.0, 1.0, 2.0, 3.0]);
        let (slope, nearest, id) = (f32x4::splat(flat.slope.0), f32x4::splat(flat.nearest), flat.id);
        for done in (0..count).step_by(LANES) {
            let place = at + done..at + done + LANES;
            let (Some(z), Some(ids)) = (self.inverse.get_mut(place.clone()), self.ids.get_mut(place)) else {
                return;
            };
            let step = STEPS + done as f32;
            let here = (slope * step + start).fast_min(nearest);
            let (old, names) = (four(z), u32x4::new(four(ids)));
            let nearer = here.simd_gt(f32x4::new(old)) & step.simd_lt(f32x4::splat(count as f32));
            z.copy_from_slice(&nearer.bitselect(here, f32x4::new(old)).to_array());
            let chosen = bytemuck::cast::<f32x4, u32x4>(nearer).bitselect(u32x4::splat(id), names);
            ids.copy_from_slice(&chosen.to_array());
        }
    }

    /// Samples that show anything.
    pub(crate) fn covered(&self) -> u32 {
        self.ids.iter().filter(|&&id| id != NOTHING).count() as u32
    }

    /// The triangles at sample `k` of a row of pixels.
    pub(crate) fn line(&self, row: usize, k: usize) -> &[u32] {
        &self.ids[(row * self.samples + k) * self.width..][..self.width]
    }

    /// The triangle at sample `k` of a pixel.
    pub(crate) fn id(&self, row: usize, column: usize, k: usize) -> u32 {
        self.ids[(row * self.samples + k) * self.width + column]
    }
}

/// Four neighbours.
fn four<T: Copy + Default>(list: &[T]) -> [T; LANES] {
    let mut out = [T::default(); LANES];
    out.copy_from_slice(list);
    out
}

/// The pattern's offsets in fours; rows that fill up the last four lie below everything.
fn padded(pattern: &Pattern) -> Vec<(f32x4, f32x4)> {
    let lanes = |four: &[(f32, f32)]| {
        let lane = |i: usize| four.get(i).copied().unwrap_or((0.0, f32::INFINITY));
        let all = [lane(0), lane(1), lane(2), lane(3)];
        (f32x4::new(all.map(|o| o.0)), f32x4::new(all.map(|o| o.1)))
    };
    pattern.offsets.chunks(LANES).map(lanes).collect()
}

impl Sides {
    fn of(flat: &Flat) -> Self {
        Self([(0, 2), (0, 1), (1, 2)].map(|(a, b)| (flat.x[b] - flat.x[a]) / (flat.y[b] - flat.y[a])))
    }

    /// Columns of the samples at rows `y`, which stand at `dx` in their pixels; none where all four are empty.
    #[inline]
    fn spans(&self, flat: &Flat, y: f32x4, dx: f32x4, width: usize) -> Option<Spans> {
        let Self([long, upper, lower]) = *self;
        let [top, middle, bottom] = flat.y.map(f32x4::splat);
        // Half-open in both directions: an edge belongs to one neighbour only.
        let outside = y.simd_lt(top) | !y.simd_lt(bottom);
        if outside.to_bitmask() == 0b1111 {
            return None;
        }
        let (below, above) = (y - top, y - middle);
        let a = below * long + flat.x[0];
        let b = y.simd_lt(middle).bitselect(below * upper + flat.x[0], above * lower + flat.x[1]);
        let columns = f32x4::splat(width as f32);
        let place = |x: f32x4| at_least((x - dx).fast_max(f32x4::ZERO).fast_min(columns));
        let (from, to) = (place(a.fast_min(b)), place(a.fast_max(b)));
        let some = to.simd_gt(from) & !bytemuck::cast::<f32x4, i32x4>(outside);
        let some = some.to_bitmask();
        (some != 0).then(|| Spans { from: from.to_array(), to: to.to_array(), y: y.to_array(), some })
    }
}

/// The least integers that are not below `x`, which is not negative; a call of the system's `ceil` takes longer.
fn at_least(x: f32x4) -> i32x4 {
    let below = x.fast_trunc_int();
    // A comparison that holds is -1.
    below - bytemuck::cast::<f32x4, i32x4>(f32x4::from_i32x4(below).simd_lt(x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Draws;

    /// One sample after the other, as the sides of a triangle say it.
    fn plain(
        flats: &[Flat],
        pattern: &Pattern,
        runs: &[(usize, usize)],
        width: usize,
        rows: usize,
    ) -> Vec<u32> {
        let mut ids = vec![NOTHING; width * rows * pattern.rows()];
        let mut inverse = vec![0.0f32; ids.len()];
        for flat in flats {
            let Sides([long, upper, lower]) = Sides::of(flat);
            for (line, (ids, inverse)) in ids.chunks_mut(width).zip(inverse.chunks_mut(width)).enumerate() {
                let (dx, dy) = pattern.offsets[line % pattern.rows()];
                let y = (line / pattern.rows()) as f32 + dy;
                if y < flat.y[0] || y >= flat.y[2] {
                    continue;
                }
                let a = flat.x[0] + (y - flat.y[0]) * long;
                let upper = flat.x[0] + (y - flat.y[0]) * upper;
                let lower = flat.x[1] + (y - flat.y[1]) * lower;
                let b = if y < flat.y[1] { upper } else { lower };
                for &(first, end) in runs {
                    let covers = |x: &usize| *x as f32 >= a.min(b) - dx && (*x as f32) < a.max(b) - dx;
                    let columns: Vec<usize> = (first..end).filter(covers).collect();
                    for (i, &x) in columns.iter().enumerate() {
                        let start = columns[0] as f32 + dx - flat.x[0];
                        let start = flat.inverse + flat.slope.0 * start + flat.slope.1 * (y - flat.y[0]);
                        let here = (start + flat.slope.0 * i as f32).min(flat.nearest);
                        if here > inverse[x] {
                            (inverse[x], ids[x]) = (here, flat.id);
                        }
                    }
                }
            }
        }
        ids
    }

    #[test]
    fn samples_show_what_each_of_them_sees_alone() {
        let draws = Draws::new(5, "band");
        let (width, rows) = (61, 7);
        for (case, (samples, runs)) in
            [(0, vec![(0, 61)]), (4, vec![(3, 20), (41, 61)]), (16, vec![(0, 61)]), (16, vec![(9, 10)])]
                .into_iter()
                .enumerate()
        {
            let flats: Vec<Flat> = (0..200)
                .map(|i| {
                    let value =
                        |k: u64, low, high| draws.range_f32(2000 * case as u64 + 10 * i + k, low, high);
                    let (x, y, size) = (value(0, -9.0, 70.0), value(1, -3.0, 8.0), value(2, 0.1, 30.0));
                    let mut y = [y, y + size * value(3, 0.0, 1.0), y + size * value(4, 0.0, 1.0)];
                    y.sort_by(f32::total_cmp);
                    let x = [x, x + size * value(5, -1.0, 1.0), x + size * value(6, -1.0, 1.0)];
                    let slope = (value(7, -0.01, 0.01), value(8, -0.01, 0.01));
                    Flat { x, y, inverse: value(9, 0.01, 1.0), slope, nearest: 1.2, id: i as u32 }
                })
                .filter(|flat| flat.y[0] >= 0.0 && flat.y[0] < rows as f32)
                .collect();
            let pattern = Pattern::new(samples);
            let expected = plain(&flats, &pattern, &runs, width, rows);
            let batch = Batch { flats, low: 0.0, high: 99.0 };
            let band = Band::fill(&[batch], &pattern, &runs, width, 0, rows);
            assert_eq!(band.ids[..expected.len()], expected, "{samples} samples");
            let shown = expected.iter().filter(|&&id| id != NOTHING).count();
            assert_eq!(band.covered() as usize, shown);
            assert!(shown > 30, "{shown}");
        }
    }
}
