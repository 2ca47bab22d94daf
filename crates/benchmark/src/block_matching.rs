//! Optical flow by block matching, from coarse to fine.
//!
//! For every pixel of the first image, the block around the pixel is compared with blocks of the second image. The
//! displacement with the smallest mean squared difference is the flow. A pyramid of images extends the range of the
//! search: each level has half the size of the next finer level, and its flow is the start of the search there.

use spikelane::error::ErrorKind;
use spikelane::reconstruct::{gaussian_blur, tfp};
use spikelane::{Error, Geometry, SpikeFramesRef};

/// Standard deviation of the Gaussian blur of both images in pixels. Blur removes noise that blocks cannot match.
const BLUR_SIGMA_PX: f64 = 1.0;

/// The options of block matching.
///
/// # Examples
/// ```
/// use spikelane_benchmark::block_matching::BlockMatching;
/// let options = BlockMatching { block_radius_px: 9, ..BlockMatching::default() };
/// assert_eq!(options.search_radius_px, 2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockMatching {
    /// Half the side of a block in pixels. The side is `2 radius + 1`.
    pub block_radius_px: usize,
    /// Largest distance of the search from its start at every level of the pyramid, in pixels along each axis.
    pub search_radius_px: usize,
    /// Shortest side of the coarsest level in pixels. A larger side than that of the images gives a single level.
    pub min_coarsest_side_px: usize,
    /// Relative increase of the cost at a distance of 1 pixel from the start of the search. The increase grows with the
    /// square of the distance.
    ///
    /// Where the images have no texture, all blocks match equally well, and the noise would select the displacement. The
    /// increase then selects a displacement close to the start.
    pub distance_penalty: f64,
}

impl Default for BlockMatching {
    fn default() -> Self {
        Self { block_radius_px: 6, search_radius_px: 2, min_coarsest_side_px: 24, distance_penalty: 0.1 }
    }
}

/// Returns the displacement of every pixel from `first` to `second`, in pixels to the right and downward.
///
/// 1. Both images are blurred by a Gaussian with a standard deviation of 1 pixel.
/// 2. Means of 2x2 pixels give the next coarser level, while the shorter side is at least twice
///    [`BlockMatching::min_coarsest_side_px`].
/// 3. At each level, the search around the start `s` minimizes `m(d) (1 + p |d - s|^2)`. Here `m(d)` is the mean squared
///    difference of the block and the block at the whole displacement `d`, and `p` is
///    [`BlockMatching::distance_penalty`]. Pixels outside an image are not compared. A displacement with less than a
///    quarter of the block inside both images is not considered.
/// 4. Parabolas through `m` at three neighboring displacements, one per axis, give the fraction of the displacement.
/// 5. The median of 3x3 pixels, one per axis, removes single wrong displacements. Twice this flow, rounded, is the start at
///    the next finer level. At the coarsest level, the start is zero.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::block_matching::{BlockMatching, flow_between_images};
/// let geometry = Geometry::new(96, 64)?;
/// let image = |shift: f64| -> Vec<f32> {
///     let light = |x: f64, y: f64| (0.4 * x).sin() + (0.3 * y + 0.1 * x).cos();
///     (0..96 * 64).map(|p| light((p % 96) as f64 - shift, (p / 96) as f64) as f32).collect()
/// };
/// let flow = flow_between_images(&image(0.0), &image(5.5), geometry, BlockMatching::default())?;
/// let [right, down] = flow[32 * 96 + 48];
/// assert!((right - 5.5).abs() < 0.1 && down.abs() < 0.1);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Input`] if an image has a wrong size or a value that is not finite, or if a radius or the penalty is out of
/// range: a radius is 1 to 64, and the penalty is at least 0.
pub fn flow_between_images(
    first: &[f32],
    second: &[f32],
    geometry: Geometry,
    options: BlockMatching,
) -> spikelane::Result<Vec<[f32; 2]>> {
    check_options(options)?;
    let mut pyramid = Vec::new();
    for (name, image) in [("first image", first), ("second image", second)] {
        check_image(name, image, geometry)?;
        let values = gaussian_blur(image, geometry, BLUR_SIGMA_PX);
        let mut levels = vec![Level { width: geometry.width(), height: geometry.height(), values }];
        while let Some(finest) = levels.last()
            && finest.width.min(finest.height) >= 2 * options.min_coarsest_side_px.max(1)
        {
            levels.push(finest.downsample());
        }
        pyramid.push(levels);
    }
    let [first, second] = &pyramid[..] else { return Ok(Vec::new()) };
    let mut coarser: Option<(usize, Vec<[f32; 2]>)> = None;
    for (first, second) in first.iter().zip(second).rev() {
        let start = match &coarser {
            None => vec![[0; 2]; first.values.len()],
            Some((width, flow)) => upsample(flow, *width, first),
        };
        let flow = median_of_neighbors(&search(first, second, &start, options), first);
        coarser = Some((first.width, flow));
    }
    Ok(coarser.map_or_else(Vec::new, |(_, flow)| flow))
}

/// Returns the flow between two readouts of a stream, in pixels to the right and downward.
///
/// The images are spike counts ([`tfp`]) of the windows around both readouts. The windows should not overlap: common
/// spikes show no motion.
///
/// # Errors
/// The errors of [`flow_between_images`], and [`ErrorKind::Usage`] if a readout is outside the stream.
pub fn flow_between_readouts(
    frames: SpikeFramesRef,
    [first, second]: [usize; 2],
    half_window: usize,
    options: BlockMatching,
) -> spikelane::Result<Vec<[f32; 2]>> {
    let [first, second] = [tfp(frames, first, half_window)?, tfp(frames, second, half_window)?];
    flow_between_images(&first, &second, frames.geometry(), options)
}

/// Largest radius of a block or of a search in pixels. It limits the run time.
const MAX_RADIUS_PX: usize = 64;

fn check_options(options: BlockMatching) -> spikelane::Result<()> {
    let wrong = |subject: &str, found: &dyn std::fmt::Display, expected: &str| {
        Err(Error::new(ErrorKind::Input, subject).found(found).expected(expected))
    };
    for (name, radius) in
        [("block radius", options.block_radius_px), ("search radius", options.search_radius_px)]
    {
        if !(1..=MAX_RADIUS_PX).contains(&radius) {
            return wrong(name, &radius, "1 to 64 pixels");
        }
    }
    if !(options.distance_penalty >= 0.0 && options.distance_penalty.is_finite()) {
        return wrong("distance penalty", &options.distance_penalty, "a finite number of at least 0");
    }
    Ok(())
}

fn check_image(name: &str, image: &[f32], geometry: Geometry) -> spikelane::Result<()> {
    let wrong = |found: String| {
        Err(Error::new(ErrorKind::Input, name)
            .found(found)
            .expected(format_args!("{} finite values", geometry.pixels())))
    };
    if image.len() != geometry.pixels() {
        return wrong(format!("{} values", image.len()));
    }
    match image.iter().position(|x| !x.is_finite()) {
        Some(index) => wrong(format!("an infinite value or NaN at index {index}")),
        None => Ok(()),
    }
}

/// An image of the pyramid.
struct Level {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Level {
    /// Returns the image at half the size. Each pixel is the mean of 2x2 pixels. An odd last row or column is omitted.
    fn downsample(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mean = |p: usize| {
            let [above, below] =
                [0, 1].map(|k| &self.values[(p / width * 2 + k) * self.width + p % width * 2..]);
            (above[0] + above[1] + below[0] + below[1]) / 4.0
        };
        Self { width, height, values: (0..width * height).map(mean).collect() }
    }
}

/// Returns the start of the search at `level` from the flow of the next coarser level, which has `width` columns.
fn upsample(flow: &[[f32; 2]], width: usize, level: &Level) -> Vec<[i32; 2]> {
    let height = flow.len() / width;
    let start = |p: usize| {
        let (x, y) = ((p % level.width / 2).min(width - 1), (p / level.width / 2).min(height - 1));
        flow[y * width + x].map(|component| (2.0 * component).round() as i32)
    };
    (0..level.values.len()).map(start).collect()
}

/// Returns the flow of one level.
fn search(first: &Level, second: &Level, start: &[[i32; 2]], options: BlockMatching) -> Vec<[f32; 2]> {
    let blocks = Blocks { first, second, radius: options.block_radius_px as i32 };
    let reach = options.search_radius_px as i32;
    let of_pixel = |(p, &[u, v]): (usize, &[i32; 2])| {
        let (x, y) = ((p % first.width) as i32, (p / first.width) as i32);
        let mut best: Option<(f64, i32, [i32; 2])> = None;
        for dv in -reach..=reach {
            for du in -reach..=reach {
                let (squared_distance, d) = (du * du + dv * dv, [u + du, v + dv]);
                let Some(difference) = blocks.difference([x, y], d) else { continue };
                let cost = difference * (1.0 + options.distance_penalty * f64::from(squared_distance));
                // Among equal costs, the displacement that is closest to the start is selected.
                if best.is_none_or(|(least, nearest, _)| {
                    cost < least || cost == least && squared_distance < nearest
                }) {
                    best = Some((cost, squared_distance, d));
                }
            }
        }
        let Some((_, _, best)) = best else { return [u as f32, v as f32] };
        [0, 1].map(|axis| best[axis] as f32 + blocks.fraction([x, y], best, axis))
    };
    start.iter().enumerate().map(of_pixel).collect()
}

/// Compares blocks of two images of one size.
struct Blocks<'a> {
    first: &'a Level,
    second: &'a Level,
    radius: i32,
}

impl Blocks<'_> {
    /// Returns the mean squared difference between the block around `(x, y)` and the block at the displacement `(u, v)`,
    /// or `None` if less than a quarter of the block is inside both images.
    fn difference(&self, [x, y]: [i32; 2], [u, v]: [i32; 2]) -> Option<f64> {
        // Returns the offsets from the center at which both blocks are inside their images.
        let inside = |at: i32, shift: i32, length: usize| {
            let low = (-self.radius).max(-at).max(-at - shift);
            let high = self.radius.min(length as i32 - 1 - at).min(length as i32 - 1 - at - shift);
            (low <= high).then(|| (low, (high - low + 1) as usize))
        };
        let (left, columns) = inside(x, u, self.first.width)?;
        let (top, rows) = inside(y, v, self.first.height)?;
        let side = 2 * self.radius as usize + 1;
        if 4 * columns * rows < side * side {
            return None;
        }
        let row = |level: &Level, x: i32, y: i32| y as usize * level.width + x as usize;
        // Each column has its own sum, so the compiler can add several columns at once.
        let mut sums = [0.0f32; 2 * MAX_RADIUS_PX + 1];
        let sums = &mut sums[..columns];
        for line in top..top + rows as i32 {
            let a = &self.first.values[row(self.first, x + left, y + line)..][..columns];
            let b = &self.second.values[row(self.second, x + u + left, y + v + line)..][..columns];
            for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
                *sum += (a - b) * (a - b);
            }
        }
        let sum: f32 = sums.iter().sum();
        Some(f64::from(sum) / (columns * rows) as f64)
    }

    /// Returns the position of the minimum of the parabola through three neighboring differences, limited to 0.5 pixels from
    /// the middle. The result is 0 if the parabola has no minimum or if a difference is missing.
    fn fraction(&self, at: [i32; 2], best: [i32; 2], axis: usize) -> f32 {
        let neighbor = |step: i32| {
            let mut d = best;
            d[axis] += step;
            self.difference(at, d)
        };
        let (Some(before), Some(middle), Some(after)) = (neighbor(-1), neighbor(0), neighbor(1)) else {
            return 0.0;
        };
        let curvature = before - 2.0 * middle + after;
        if curvature <= 0.0 {
            return 0.0;
        }
        // The penalty of the distance can select a displacement beside the smallest difference.
        (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) as f32
    }
}

/// Returns the median of the 3x3 pixels around every pixel, for each axis. Pixels outside the level are not counted.
fn median_of_neighbors(flow: &[[f32; 2]], level: &Level) -> Vec<[f32; 2]> {
    let near = |at: usize, length: usize| at.saturating_sub(1)..(at + 2).min(length);
    let median = |p: usize| {
        [0, 1].map(|axis| {
            let mut values: Vec<f32> = near(p / level.width, level.height)
                .flat_map(|y| near(p % level.width, level.width).map(move |x| y * level.width + x))
                .map(|q| flow[q][axis])
                .collect();
            values.sort_unstable_by(f32::total_cmp);
            values[values.len() / 2]
        })
    };
    (0..flow.len()).map(median).collect()
}
