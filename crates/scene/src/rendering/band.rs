//! Rasterization of triangles into a visibility buffer, one sample row at a time.
//!
//! Most triangles are small, so the computation of the ends of a span takes longer than the depth test of the span.
//! Therefore the ends are computed for four sample rows at once. The samples of a row are contiguous in memory, and the
//! depth test processes four samples of a span at once.

use wide::{f32x4, i32x4, u32x4};

use super::raster::{Batch, NO_TRIANGLE, SamplePattern, ScreenTriangle};

/// Number of sample rows, or of samples in a row, that are processed at once.
const LANES: usize = 4;

/// The samples of a band of pixel rows.
#[derive(Debug)]
pub(crate) struct Band {
    /// First pixel column of the band, and the number of columns. Other columns contain no drawn tile.
    left: usize,
    width: usize,
    samples_per_pixel: usize,
    /// `inverse_depths` and `triangle_ids` have `LANES` additional elements at the end. The last step of a span may
    /// write to these elements.
    inverse_depths: Vec<f32>,
    triangle_ids: Vec<u32>,
}

/// For four sample rows, the y coordinate of each row and the columns `from .. to` of the row inside a triangle.
struct Spans {
    from: [i32; LANES],
    to: [i32; LANES],
    y: [f32; LANES],
    /// Bit mask of the rows in which the span contains at least one column.
    nonempty_rows: u32,
}

/// Slopes of the edges of a triangle in columns per row. The first is the long edge. The second and third are the
/// edges above and below the middle corner.
struct EdgeSlopes([f32; 3]);

impl Band {
    /// Rasterizes triangles into the pixel rows from `top`. `runs` contains the column ranges of each row. Samples outside
    /// these ranges are skipped.
    pub(crate) fn fill(
        batches: &[Batch],
        pattern: &SamplePattern,
        runs: &[Vec<(usize, usize)>],
        width: usize,
        top: usize,
    ) -> Self {
        let rows = runs.len();
        let left = runs.iter().filter_map(|r| r.first()).map(|run| run.0).min().unwrap_or(0);
        let drawn_width = runs.iter().filter_map(|r| r.last()).map(|run| run.1).max().unwrap_or(0) - left;
        let count = if drawn_width == 0 { 0 } else { drawn_width * rows * pattern.rows() + LANES };
        let mut band = Self {
            left,
            width: drawn_width,
            samples_per_pixel: pattern.rows(),
            inverse_depths: vec![0.0; count],
            triangle_ids: vec![NO_TRIANGLE; count],
        };
        if count == 0 {
            return band;
        }
        let offsets = padded_offsets(pattern);
        let (low, high) = (top as f32, (top + rows) as f32);
        for batch in batches.iter().filter(|b| b.min_y < high && b.max_y > low) {
            for flat in &batch.triangles {
                if flat.y[0] < high && flat.y[2] > low {
                    band.draw_triangle(flat, &offsets, (runs, width), top);
                }
            }
        }
        band
    }

    fn draw_triangle(
        &mut self,
        flat: &ScreenTriangle,
        offsets: &[(f32x4, f32x4)],
        (runs, image_width): (&[Vec<(usize, usize)>], usize),
        top: usize,
    ) {
        let first = (flat.y[0] as usize).max(top);
        let last = (flat.y[2] as usize).min(top + runs.len() - 1);
        let sides = EdgeSlopes::from_triangle(flat);
        for row in first..=last {
            let mut runs = runs[row - top].as_slice();
            // A triangle overlaps the only run of a row that is drawn as a whole.
            if *runs != [(0, image_width)] {
                let (low, high) = sides.row_extent(flat, row as f32);
                runs = &runs[runs.partition_point(|run| (run.1 as f32) < low)..];
                if runs.first().is_none_or(|run| run.0 as f32 > high) {
                    continue;
                }
            }
            for (four, &(dx, dy)) in offsets.iter().enumerate() {
                let Some(spans) = sides.spans(flat, dy + row as f32, dx, image_width) else { continue };
                let mut some = spans.nonempty_rows;
                while some != 0 {
                    let lane = some.trailing_zeros() as usize;
                    some &= some - 1;
                    let line = (row - top) * self.samples_per_pixel + four * LANES + lane;
                    let (from, to) = (spans.from[lane] as usize, spans.to[lane] as usize);
                    let (y, dx) = (spans.y[lane], dx.to_array()[lane]);
                    for &(first, end) in runs {
                        let (from, to) = (from.max(first), to.min(end));
                        if from < to {
                            let x = from as f32 + dx - flat.x[0];
                            let start = flat.inverse_depth
                                + flat.inverse_depth_slope.0 * x
                                + flat.inverse_depth_slope.1 * (y - flat.y[0]);
                            self.draw_span(line * self.width + from - self.left, to - from, start, flat);
                        }
                    }
                }
            }
        }
    }

    /// Applies the depth test to the samples of a span. The sample with the larger inverse depth is nearer to the
    /// camera.
    fn draw_span(&mut self, at: usize, count: usize, start: f32, flat: &ScreenTriangle) {
        const STEPS: f32x4 = f32x4::new([0.0, 1.0, 2.0, 3.0]);
        let (slope, nearest, id) =
            (f32x4::splat(flat.inverse_depth_slope.0), f32x4::splat(flat.nearest_inverse_depth), flat.id);
        for done in (0..count).step_by(LANES) {
            let place = at + done..at + done + LANES;
            let (Some(z), Some(ids)) =
                (self.inverse_depths.get_mut(place.clone()), self.triangle_ids.get_mut(place))
            else {
                return;
            };
            let step = STEPS + done as f32;
            let here = (slope * step + start).fast_min(nearest);
            let (old, names) = (take_lanes(z), u32x4::new(take_lanes(ids)));
            let nearer = here.simd_gt(f32x4::new(old)) & step.simd_lt(f32x4::splat(count as f32));
            z.copy_from_slice(&nearer.bitselect(here, f32x4::new(old)).to_array());
            let chosen = bytemuck::cast::<f32x4, u32x4>(nearer).bitselect(u32x4::splat(id), names);
            ids.copy_from_slice(&chosen.to_array());
        }
    }

    /// Returns the number of samples at which a triangle is visible.
    pub(crate) fn covered_samples(&self) -> u32 {
        self.triangle_ids.iter().filter(|&&id| id != NO_TRIANGLE).count() as u32
    }

    /// Returns the triangle ids at all samples, in an unspecified order.
    pub(crate) fn sample_ids(&self) -> &[u32] {
        &self.triangle_ids
    }

    /// Returns the triangle id at sample `k` of a pixel.
    pub(crate) fn triangle_id(&self, row: usize, column: usize, k: usize) -> u32 {
        // Columns to the left of the band wrap to large numbers, so one comparison is sufficient.
        let column = column.wrapping_sub(self.left);
        if column >= self.width {
            return NO_TRIANGLE;
        }
        self.triangle_ids[(row * self.samples_per_pixel + k) * self.width + column]
    }
}

/// Copies `list`, which has four elements, to an array.
fn take_lanes<T: Copy + Default>(list: &[T]) -> [T; LANES] {
    let mut out = [T::default(); LANES];
    out.copy_from_slice(list);
    out
}

/// Returns the sample offsets of the pattern in groups of four. The last group is padded with rows whose y is
/// infinite, so no triangle covers these rows.
fn padded_offsets(pattern: &SamplePattern) -> Vec<(f32x4, f32x4)> {
    let lanes = |four: &[(f32, f32)]| {
        let lane = |i: usize| four.get(i).copied().unwrap_or((0.0, f32::INFINITY));
        let all = [lane(0), lane(1), lane(2), lane(3)];
        (f32x4::new(all.map(|o| o.0)), f32x4::new(all.map(|o| o.1)))
    };
    pattern.offsets.chunks(LANES).map(lanes).collect()
}

impl EdgeSlopes {
    fn from_triangle(flat: &ScreenTriangle) -> Self {
        Self([(0, 2), (0, 1), (1, 2)].map(|(a, b)| (flat.x[b] - flat.x[a]) / (flat.y[b] - flat.y[a])))
    }

    /// Returns the smallest and the largest x coordinate of the triangle in the pixel row that starts at `y`.
    ///
    /// The formulas are those of [`spans`](Self::spans). Rounding keeps the order of numbers, so the samples of the row are
    /// within these bounds.
    fn row_extent(&self, flat: &ScreenTriangle, y: f32) -> (f32, f32) {
        let Self([long, upper, lower]) = *self;
        let [top, middle, bottom] = flat.y;
        let (from, to) = (y.max(top), (y + 1.0).min(bottom));
        let (a, b) = ((from - top) * long + flat.x[0], (to - top) * long + flat.x[0]);
        let (mut low, mut high) = (a.min(b), a.max(b));
        let mut add = |x: f32| (low, high) = (low.min(x), high.max(x));
        if from < middle {
            add((from - top) * upper + flat.x[0]);
            add((to.min(middle) - top) * upper + flat.x[0]);
        }
        if to > middle {
            add((from.max(middle) - middle) * lower + flat.x[1]);
            add((to - middle) * lower + flat.x[1]);
        }
        (low, high)
    }

    /// Returns the columns inside the triangle for four sample rows. The rows are at `y`, and the samples have the
    /// offsets `dx` within their pixels.
    ///
    /// Returns `None` if the triangle covers no sample in any of the four rows.
    #[inline]
    fn spans(&self, flat: &ScreenTriangle, y: f32x4, dx: f32x4, width: usize) -> Option<Spans> {
        let Self([long, upper, lower]) = *self;
        let [top, middle, bottom] = flat.y.map(f32x4::splat);
        // The comparisons include one edge and exclude the opposite edge. A sample on an edge of two triangles
        // therefore belongs to only one of the triangles.
        let outside = y.simd_lt(top) | !y.simd_lt(bottom);
        if outside.to_bitmask() == 0b1111 {
            return None;
        }
        let (below, above) = (y - top, y - middle);
        let a = below * long + flat.x[0];
        let b = y.simd_lt(middle).bitselect(below * upper + flat.x[0], above * lower + flat.x[1]);
        let columns = f32x4::splat(width as f32);
        let place = |x: f32x4| ceil_nonnegative((x - dx).fast_max(f32x4::ZERO).fast_min(columns));
        let (from, to) = (place(a.fast_min(b)), place(a.fast_max(b)));
        let some = to.simd_gt(from) & !bytemuck::cast::<f32x4, i32x4>(outside);
        let some = some.to_bitmask();
        (some != 0).then(|| Spans {
            from: from.to_array(),
            to: to.to_array(),
            y: y.to_array(),
            nonempty_rows: some,
        })
    }
}

/// Returns the smallest integers that are not less than `x`. All elements of `x` must be nonnegative.
///
/// `ceil` of the standard library is slower.
fn ceil_nonnegative(x: f32x4) -> i32x4 {
    let below = x.fast_trunc_int();
    // A SIMD comparison that is true is the integer -1. Where truncation reduced the value, the subtraction therefore
    // adds 1.
    below - bytemuck::cast::<f32x4, i32x4>(f32x4::from_i32x4(below).simd_lt(x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Draws;

    /// Rasterizes one sample at a time, according to the mathematical definition of a triangle's edges.
    fn draw_reference(
        flats: &[ScreenTriangle],
        pattern: &SamplePattern,
        runs: &[(usize, usize)],
        width: usize,
        rows: usize,
    ) -> Vec<u32> {
        let mut ids = vec![NO_TRIANGLE; width * rows * pattern.rows()];
        let mut inverse = vec![0.0f32; ids.len()];
        for flat in flats {
            let EdgeSlopes([long, upper, lower]) = EdgeSlopes::from_triangle(flat);
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
                        let start = flat.inverse_depth
                            + flat.inverse_depth_slope.0 * start
                            + flat.inverse_depth_slope.1 * (y - flat.y[0]);
                        let here =
                            (start + flat.inverse_depth_slope.0 * i as f32).min(flat.nearest_inverse_depth);
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
    fn band_samples_equal_a_per_sample_rasterizer() {
        let draws = Draws::new(5, "band");
        let (width, rows) = (61, 7);
        for (case, (samples, runs)) in
            [(0, vec![(0, 61)]), (4, vec![(3, 20), (41, 61)]), (16, vec![(0, 61)]), (16, vec![(9, 10)])]
                .into_iter()
                .enumerate()
        {
            let flats: Vec<ScreenTriangle> = (0..200)
                .map(|i| {
                    let value =
                        |k: u64, low, high| draws.range_f32(2000 * case as u64 + 10 * i + k, low, high);
                    let (x, y, size) = (value(0, -9.0, 70.0), value(1, -3.0, 8.0), value(2, 0.1, 30.0));
                    let mut y = [y, y + size * value(3, 0.0, 1.0), y + size * value(4, 0.0, 1.0)];
                    y.sort_by(f32::total_cmp);
                    let x = [x, x + size * value(5, -1.0, 1.0), x + size * value(6, -1.0, 1.0)];
                    let slope = (value(7, -0.01, 0.01), value(8, -0.01, 0.01));
                    ScreenTriangle {
                        x,
                        y,
                        inverse_depth: value(9, 0.01, 1.0),
                        inverse_depth_slope: slope,
                        nearest_inverse_depth: 1.2,
                        id: i as u32,
                    }
                })
                .filter(|flat| flat.y[0] >= 0.0 && flat.y[0] < rows as f32)
                .collect();
            let pattern = SamplePattern::new(samples);
            let expected = draw_reference(&flats, &pattern, &runs, width, rows);
            let batch = Batch { triangles: flats, min_y: 0.0, max_y: 99.0 };
            let band = Band::fill(&[batch], &pattern, &vec![runs.clone(); rows], width, 0);
            let actual: Vec<u32> = (0..rows * pattern.rows())
                .flat_map(|line| (0..width).map(move |x| (line, x)))
                .map(|(line, x)| band.triangle_id(line / pattern.rows(), x, line % pattern.rows()))
                .collect();
            assert_eq!(actual, expected, "{samples} samples");
            let shown = expected.iter().filter(|&&id| id != NO_TRIANGLE).count();
            assert_eq!(band.covered_samples() as usize, shown);
            assert!(shown > 30, "{shown}");
        }
    }
}
