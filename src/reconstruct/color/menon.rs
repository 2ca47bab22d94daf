//! Demosaicing of Bayer patterns with directional filters and an a posteriori decision (Menon, Andriani and Calvagno
//! 2007).

use crate::sensor::Mosaic;
use crate::spikes::Geometry;

/// Weights of the differences of the chrominance around a pixel, for the horizontal direction. The center is in the
/// middle. The kernel of the vertical direction is the transpose.
const GRADIENT_KERNEL: [[f32; 5]; 5] = [
    [1.0, 0.0, 1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0],
    [3.0, 0.0, 3.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0],
    [1.0, 0.0, 1.0, 0.0, 0.0],
];

#[derive(Clone, Copy, PartialEq)]
enum Direction {
    Horizontal,
    Vertical,
}

use Direction::{Horizontal, Vertical};

/// Returns index `i + offset` of a line of `len` pixels, reflected at the first and the last pixel. A reflection keeps
/// the phase of a pattern of two pixels.
pub(super) fn reflected(i: usize, offset: isize, len: usize) -> usize {
    let at = i as isize + offset;
    let last = len as isize - 1;
    (if at < 0 {
        -at
    } else if at > last {
        2 * last - at
    } else {
        at
    }) as usize
}

/// The pixels of an image.
#[derive(Clone, Copy)]
struct Grid {
    width: usize,
    height: usize,
}

impl Grid {
    /// Returns the index of the pixel `offset` pixels to the right of pixel `p` or below it. Borders reflect.
    fn beside(self, p: usize, offset: isize, direction: Direction) -> usize {
        let (row, col) = (p / self.width, p % self.width);
        match direction {
            Horizontal => row * self.width + reflected(col, offset, self.width),
            Vertical => reflected(row, offset, self.height) * self.width + col,
        }
    }

    /// Returns the mean of the two neighbors of pixel `p` in `direction`.
    fn pair_mean(self, p: usize, direction: Direction, value: impl Fn(usize) -> f32) -> f32 {
        0.5 * (value(self.beside(p, -1, direction)) + value(self.beside(p, 1, direction)))
    }

    /// Returns the mean of pixel `p` and its two neighbors in `direction`.
    fn triple_mean(self, p: usize, direction: Direction, value: impl Fn(usize) -> f32) -> f32 {
        [-1, 0, 1].map(|i| value(self.beside(p, i, direction))).iter().sum::<f32>() / 3.0
    }
}

/// Returns red, green and blue of every pixel of a Bayer mosaic, row-major.
pub(super) fn demosaic(values: &[f32], geometry: Geometry, mosaic: &Mosaic) -> Vec<f32> {
    let grid = Grid { width: geometry.width(), height: geometry.height() };
    let own = mosaic.channel_map(geometry);
    let (green, directions) = green_plane(values, &own, grid);
    let mut planes = [values.to_vec(), green, values.to_vec()];
    fill_red_and_blue(&mut planes, &own, &directions, grid);
    refine(&mut planes, values, &own, &directions, grid);
    (0..values.len()).flat_map(|p| [planes[0][p], planes[1][p], planes[2][p]]).collect()
}

/// Returns green of every pixel, and the direction in which it was interpolated.
fn green_plane(values: &[f32], own: &[usize], grid: Grid) -> (Vec<f32>, Vec<Direction>) {
    let pixels = values.len();
    let in_direction = |direction: Direction| -> Vec<f32> {
        let green = |p: usize| {
            let at = |offset: isize| values[grid.beside(p, offset, direction)];
            0.5 * (at(-1) + at(1)) + 0.5 * at(0) - 0.25 * (at(-2) + at(2))
        };
        (0..pixels).map(|p| if own[p] == 1 { values[p] } else { green(p) }).collect()
    };
    let candidates = [Horizontal, Vertical].map(in_direction);
    let scores = [Horizontal, Vertical].map(|direction| {
        let green = &candidates[usize::from(direction == Vertical)];
        // Red or blue minus green. The next pixel of the same color is two pixels away.
        let chrominance: Vec<f32> =
            (0..pixels).map(|p| if own[p] == 1 { 0.0 } else { values[p] - green[p] }).collect();
        let difference: Vec<f32> =
            (0..pixels).map(|p| (chrominance[p] - chrominance[grid.beside(p, 2, direction)]).abs()).collect();
        local_sum(&difference, direction, grid)
    });
    let direction = |p: usize| if scores[1][p] >= scores[0][p] { Horizontal } else { Vertical };
    let directions: Vec<Direction> = (0..pixels).map(direction).collect();
    let green = (0..pixels).map(|p| candidates[usize::from(directions[p] == Vertical)][p]).collect();
    (green, directions)
}

/// Returns the sums of `values` with the weights of [`GRADIENT_KERNEL`]. Values outside the image are 0.
fn local_sum(values: &[f32], direction: Direction, grid: Grid) -> Vec<f32> {
    let sum = |p: usize| {
        let (row, col) = (p / grid.width, p % grid.width);
        let mut sum = 0.0;
        for r in row.saturating_sub(2)..(row + 3).min(grid.height) {
            for c in col.saturating_sub(2)..(col + 3).min(grid.width) {
                let (i, j) = (r + 2 - row, c + 2 - col);
                let weight = match direction {
                    Horizontal => GRADIENT_KERNEL[i][j],
                    Vertical => GRADIENT_KERNEL[j][i],
                };
                sum += weight * values[r * grid.width + c];
            }
        }
        sum
    };
    (0..values.len()).map(sum).collect()
}

/// Returns the direction in which the neighbors of a green pixel are pixels of `channel`.
fn direction_to(channel: usize, p: usize, own: &[usize], grid: Grid) -> Direction {
    if own[grid.beside(p, 1, Horizontal)] == channel { Horizontal } else { Vertical }
}

fn fill_red_and_blue(planes: &mut [Vec<f32>; 3], own: &[usize], directions: &[Direction], grid: Grid) {
    for p in (0..own.len()).filter(|p| own[*p] == 1) {
        for channel in [0, 2] {
            let direction = direction_to(channel, p, own, grid);
            let green = &planes[1];
            let difference = grid.pair_mean(p, direction, |q| planes[channel][q])
                - grid.pair_mean(p, direction, |q| green[q]);
            planes[channel][p] = planes[1][p] + difference;
        }
    }
    // Red at blue pixels, and blue at red pixels. The neighbors in both directions are green pixels.
    for p in (0..own.len()).filter(|p| own[*p] != 1) {
        let (known, unknown) = (own[p], 2 - own[p]);
        let difference = grid.pair_mean(p, directions[p], |q| planes[unknown][q])
            - grid.pair_mean(p, directions[p], |q| planes[known][q]);
        planes[unknown][p] = planes[known][p] + difference;
    }
}

/// Smooths the differences between the colors.
fn refine(planes: &mut [Vec<f32>; 3], values: &[f32], own: &[usize], directions: &[Direction], grid: Grid) {
    let old_green = planes[1].clone();
    for p in (0..own.len()).filter(|p| own[*p] != 1) {
        let known = &planes[own[p]];
        planes[1][p] = values[p] - grid.triple_mean(p, directions[p], |q| known[q] - old_green[q]);
    }
    for channel in [0, 2] {
        let difference: Vec<f32> = (0..own.len()).map(|p| planes[channel][p] - planes[1][p]).collect();
        for p in (0..own.len()).filter(|p| own[*p] == 1) {
            let direction = direction_to(channel, p, own, grid);
            planes[channel][p] = planes[1][p] + grid.pair_mean(p, direction, |q| difference[q]);
        }
    }
    let red_minus_blue: Vec<f32> = (0..own.len()).map(|p| planes[0][p] - planes[2][p]).collect();
    for p in 0..own.len() {
        let mean = || grid.triple_mean(p, directions[p], |q| red_minus_blue[q]);
        match own[p] {
            0 => planes[2][p] = planes[0][p] - mean(),
            2 => planes[0][p] = planes[2][p] + mean(),
            _ => {}
        }
    }
}
