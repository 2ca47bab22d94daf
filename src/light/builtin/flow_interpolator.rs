//! Interpolation of the light between two frames along the estimated motion.
//!
//! The optical flow between the frames is estimated in both directions. A pixel of the interpolated frame combines two
//! values: the light at its position in the previous frame, and the light at its position in the next frame. The flow is
//! estimated from coarse to fine by least squares in windows (Lucas and Kanade 1981, Bouguet's pyramid of 1999). The flow
//! at intermediate instants is computed by splatting (Baker et al., "A database and evaluation methodology for optical
//! flow", IJCV 92, 2011, section 3.3.3).
//!
//! The estimate is wrong for repeated patterns, for transparency and for motion beyond the range of the pyramid. At
//! pixels where a static scene explains the two frames better than the estimated motion, the light is blended without
//! motion.

use wide::f32x4;

use crate::error::{Result, bail};
use crate::light::catmull_rom::catmull_rom;
use crate::light::frame::{Frame, OwnedSamples};
use crate::spikes::Geometry;

/// Half the side of the window in which motion is assumed to be uniform, in pixels.
const WINDOW_RADIUS_PX: usize = 4;
/// Number of warps at every level of the pyramid.
const WARPS_PER_LEVEL: usize = 6;
/// Shortest side of the coarsest level, in pixels.
const MIN_COARSEST_SIDE_PX: usize = 20;
/// Regularization that is added to the mean square gradients of a window, in units of squared full scale.
///
/// It equals the mean square gradient of noise with a standard deviation of 0.3 %. A window with smaller gradients
/// contains no information about the motion.
const FLAT_GRADIENT: f32 = 1e-5;

/// One number per pixel.
#[derive(Clone, Debug)]
struct Plane {
    w: usize,
    h: usize,
    v: Vec<f32>,
}

impl Plane {
    fn map2(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self { v: self.v.iter().zip(&other.v).map(|(&a, &b)| f(a, b)).collect(), ..*self }
    }

    /// Returns the value at `(x, y)` by cubic interpolation (Catmull-Rom). Positions outside the plane are moved to its
    /// border.
    ///
    /// Linear interpolation would bias the estimated motion by up to 0.05 px if details are 20 pixels wide.
    fn at(&self, x: f32, y: f32) -> f32 {
        let (x, y) = (x.clamp(0.0, (self.w - 1) as f32), y.clamp(0.0, (self.h - 1) as f32));
        let (c, r) = (x as usize, y as usize);
        let (across, down) = (catmull_rom(x - c as f32), catmull_rom(y - r as f32));
        // The four columns are computed together.
        let [first, second, third, fourth] = self.neighborhood(c, r);
        let columns = (first * down[0] + second * down[1]) + (third * down[2] + fourth * down[3]);
        let [p, q, s, t] = (columns * f32x4::new(across)).to_array();
        (p + q) + (s + t)
    }

    /// Returns the 4x4 pixels around a position, row by row. `(c, r)` is the upper left of the four central pixels. Outside the
    /// plane, the border pixels are repeated.
    #[inline(always)]
    fn neighborhood(&self, c: usize, r: usize) -> [f32x4; 4] {
        if c > 0 && r > 0 && c + 3 <= self.w && r + 3 <= self.h {
            let corner = &self.v[(r - 1) * self.w + c - 1..];
            return [0, 1, 2, 3].map(|k| {
                let row = &corner[k * self.w..][..4];
                f32x4::new([row[0], row[1], row[2], row[3]])
            });
        }
        let near = |i: usize, k: usize, n: usize| (i + k).saturating_sub(1).min(n - 1);
        [0, 1, 2, 3].map(|k| {
            let row = &self.v[near(r, k, self.h) * self.w..][..self.w];
            f32x4::new([0, 1, 2, 3].map(|k| row[near(c, k, self.w)]))
        })
    }

    fn contains(&self, x: f32, y: f32) -> bool {
        (-0.5..self.w as f32 - 0.5).contains(&x) && (-0.5..self.h as f32 - 0.5).contains(&y)
    }

    /// Returns means of square windows with a side of `2 reach + 1` pixels. Windows are cut at the borders.
    fn box_mean(&self, reach: usize) -> Self {
        let rows = running_means(&self.v, self.w, 1, self.h, self.w, reach);
        let v = running_means(&rows, self.h, self.w, self.w, 1, reach);
        Self { v, ..*self }
    }

    /// Returns the plane at half the size. Each pixel is the mean of four pixels.
    fn downsample(&self) -> Self {
        let (w, h) = (self.w.div_ceil(2), self.h.div_ceil(2));
        let at = |r: usize, c: usize| self.v[r.min(self.h - 1) * self.w + c.min(self.w - 1)];
        let mean = |r: usize, c: usize| {
            (at(2 * r, 2 * c) + at(2 * r, 2 * c + 1) + at(2 * r + 1, 2 * c) + at(2 * r + 1, 2 * c + 1)) / 4.0
        };
        let v = (0..w * h).map(|k| mean(k / w, k % w)).collect();
        Self { w, h, v }
    }

    /// Returns the central differences in the direction to the right and in the direction downwards.
    fn gradients(&self) -> (Self, Self) {
        let (w, h) = (self.w, self.h);
        let at = |r: usize, c: usize| self.v[r * w + c];
        let x = |r: usize, c: usize| 0.5 * (at(r, (c + 1).min(w - 1)) - at(r, c.saturating_sub(1)));
        let y = |r: usize, c: usize| 0.5 * (at((r + 1).min(h - 1), c) - at(r.saturating_sub(1), c));
        let all = |f: &dyn Fn(usize, usize) -> f32| Self {
            v: (0..w * h).map(|k| f(k / w, k % w)).collect(),
            ..*self
        };
        (all(&x), all(&y))
    }
}

/// Returns running means along `count` lines of `n` values.
///
/// Successive values of a line are `step` elements apart. Successive lines are `line` elements apart.
fn running_means(v: &[f32], n: usize, step: usize, count: usize, line: usize, reach: usize) -> Vec<f32> {
    let mut out = vec![0.0; v.len()];
    for l in 0..count {
        let at = |i: usize| l * line + i * step;
        let mut sum: f64 = (0..reach.min(n)).map(|i| f64::from(v[at(i)])).sum();
        for i in 0..n {
            if i + reach < n {
                sum += f64::from(v[at(i + reach)]);
            }
            if i > reach {
                sum -= f64::from(v[at(i - reach - 1)]);
            }
            let window = (i + reach).min(n - 1) + 1 - i.saturating_sub(reach);
            out[at(i)] = (sum / window as f64) as f32;
        }
    }
    out
}

/// A displacement per pixel.
#[derive(Clone, Debug)]
struct FlowField {
    dx: Plane,
    dy: Plane,
}

impl FlowField {
    fn zero(like: &Plane) -> Self {
        let zero = Plane { v: vec![0.0; like.v.len()], ..*like };
        Self { dx: zero.clone(), dy: zero }
    }

    /// Returns the field at twice the size, for the next finer level of the pyramid.
    fn upsample(&self, like: &Plane) -> Self {
        let finer = |p: &Plane| {
            let value = |k: usize| {
                let (r, c) = ((k / like.w) as f32, (k % like.w) as f32);
                2.0 * p.at((c - 0.5) / 2.0, (r - 0.5) / 2.0)
            };
            Plane { v: (0..like.v.len()).map(value).collect(), ..*like }
        };
        Self { dx: finer(&self.dx), dy: finer(&self.dy) }
    }

    /// Returns the values of `picture` at the positions that the field, multiplied by `share`, assigns to the pixels.
    fn warp(&self, picture: &Plane, share: f32) -> Plane {
        let value = |k: usize| {
            let (r, c) = ((k / picture.w) as f32, (k % picture.w) as f32);
            picture.at(c + share * self.dx.v[k], r + share * self.dy.v[k])
        };
        Plane { v: (0..picture.v.len()).map(value).collect(), ..*picture }
    }
}

/// Estimates the motion from `a` to `b`, from coarse to fine.
fn estimate_motion(a: &Plane, b: &Plane) -> FlowField {
    let mut levels = vec![(a.clone(), b.clone())];
    while let Some((a, b)) = levels.last().filter(|(a, _)| a.w.min(a.h) >= 2 * MIN_COARSEST_SIDE_PX) {
        levels.push((a.downsample(), b.downsample()));
    }
    let mut field: Option<FlowField> = None;
    for (a, b) in levels.iter().rev() {
        let start = field.map_or_else(|| FlowField::zero(a), |f| f.upsample(a));
        field = Some(refine_level(a, b, start));
    }
    field.unwrap_or_else(|| FlowField::zero(a))
}

fn refine_level(a: &Plane, b: &Plane, mut field: FlowField) -> FlowField {
    let (ax, ay) = a.gradients();
    for _ in 0..WARPS_PER_LEVEL {
        let there = field.warp(b, 1.0);
        let (bx, by) = there.gradients();
        let gx = ax.map2(&bx, |p, q| 0.5 * (p + q));
        let gy = ay.map2(&by, |p, q| 0.5 * (p + q));
        let change = there.map2(a, |p, q| p - q);
        let window = |p: &Plane, q: &Plane| p.map2(q, |x, y| x * y).box_mean(WINDOW_RADIUS_PX);
        let (xx, xy, yy) = (window(&gx, &gx), window(&gx, &gy), window(&gy, &gy));
        let (xt, yt) = (window(&gx, &change), window(&gy, &change));
        for k in 0..a.v.len() {
            let (p, q, s) = (xx.v[k] + FLAT_GRADIENT, xy.v[k], yy.v[k] + FLAT_GRADIENT);
            let det = p * s - q * q;
            let (u, v) = ((q * yt.v[k] - s * xt.v[k]) / det, (q * xt.v[k] - p * yt.v[k]) / det);
            // A gradient describes the light within about one pixel, so a step is limited to one pixel.
            field.dx.v[k] += u.clamp(-1.0, 1.0);
            field.dy.v[k] += v.clamp(-1.0, 1.0);
        }
        field = FlowField { dx: field.dx.box_mean(1), dy: field.dy.box_mean(1) };
    }
    field
}

/// Two frames and the estimated motion between them.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{FlowInterpolator, Frame, OwnedSamples};
/// let geometry = Geometry::new(32, 24)?;
/// // A bright spot that moves four pixels to the right.
/// let spot = |center: f32| {
///     let light = |p: usize| {
///         let (x, y) = ((p % 32) as f32 - center, (p / 32) as f32 - 12.0);
///         (-(x * x + y * y) / 18.0).exp()
///     };
///     Frame::new(geometry, OwnedSamples::F32((0..geometry.pixels()).map(light).collect()))
/// };
/// let middle = FlowInterpolator::new(&spot(14.0)?, &spot(18.0)?)?.interpolate(0.5)?;
/// // Halfway, the spot is at column 16. Linear interpolation would reduce its light to 80 %.
/// assert!(middle.get(12, 16) > 0.95);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct FlowInterpolator {
    geometry: Geometry,
    from: Plane,
    to: Plane,
    /// Square roots of the light. They give similar weights to details in dark and bright regions.
    sqrt_light: (Plane, Plane),
    forward: MotionEstimate,
    backward: MotionEstimate,
    /// Absolute difference of the two frames at the same position, averaged in a window around each pixel.
    static_error: Plane,
}

/// The motion from one frame to the other frame, and the absolute change of each pixel along this motion.
#[derive(Clone, Debug)]
struct MotionEstimate {
    field: FlowField,
    change: Plane,
}

impl MotionEstimate {
    fn new(a: &Plane, b: &Plane) -> Self {
        let field = estimate_motion(a, b);
        let change = field.warp(b, 1.0).map2(a, |p, q| (p - q).abs());
        Self { field, change }
    }

    /// Moves the vector of each pixel by `share` of this vector, and returns the field of the moved vectors, multiplied
    /// by `sign`.
    ///
    /// If the vectors of several pixels arrive at one pixel, the vector of the pixel with the smallest change along its
    /// motion is stored. A pixel without an arriving vector keeps its own vector.
    fn splat(&self, share: f32, sign: f32) -> FlowField {
        let (field, change) = (&self.field, &self.change);
        let mut out = field.clone();
        let mut error = vec![f32::INFINITY; change.v.len()];
        for k in 0..change.v.len() {
            let x = (k % change.w) as f32 + share * field.dx.v[k];
            let y = (k / change.w) as f32 + share * field.dy.v[k];
            if !change.contains(x, y) {
                continue;
            }
            let at = (y + 0.5) as usize * change.w + (x + 0.5) as usize;
            if change.v[k] < error[at] {
                error[at] = change.v[k];
                (out.dx.v[at], out.dy.v[at]) = (field.dx.v[k], field.dy.v[k]);
            }
        }
        out.dx.v.iter_mut().chain(&mut out.dy.v).for_each(|d| *d *= sign);
        out
    }
}

impl FlowInterpolator {
    /// Estimates the motion from `from` to `to`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{FlowInterpolator, Frame};
    /// let dark = Frame::dark(Geometry::new(64, 48)?);
    /// let middle = FlowInterpolator::new(&dark, &dark)?.interpolate(0.5)?;
    /// assert_eq!(middle.max(), 0.0);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the frames differ in size.
    pub fn new(from: &Frame, to: &Frame) -> Result<Self> {
        if from.geometry() != to.geometry() {
            bail!(Usage, "frames to interpolate"; found "{} and {}", from.geometry(), to.geometry();
                expected "two frames of the same size");
        }
        let geometry = from.geometry();
        let (w, h) = (geometry.width(), geometry.height());
        let plane = |f: &Frame| Plane { w, h, v: f.to_f32() };
        let (from, to) = (plane(from), plane(to));
        let code = |p: &Plane| Plane { v: p.v.iter().map(|x| x.sqrt()).collect(), ..*p };
        let codes = (code(&from), code(&to));
        let (forward, backward) =
            (MotionEstimate::new(&codes.0, &codes.1), MotionEstimate::new(&codes.1, &codes.0));
        let still = codes.0.map2(&codes.1, |p, q| (p - q).abs()).box_mean(2);
        Ok(Self { geometry, from, to, sqrt_light: codes, forward, backward, static_error: still })
    }

    /// Returns the motion from the first frame to the second frame in pixels. The components are the motion to the right
    /// and downwards.
    #[must_use]
    pub fn motion(&self) -> (&[f32], &[f32]) {
        (&self.forward.field.dx.v, &self.forward.field.dy.v)
    }

    /// Returns the light at position `weight` between the first frame (0) and the second frame (1), as floats.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `weight` is outside 0 to 1.
    pub fn interpolate(&self, weight: f32) -> Result<Frame> {
        if !(0.0..=1.0).contains(&weight) {
            bail!(Usage, "position between two frames"; found "{weight}"; expected "a number from 0 to 1");
        }
        let fields = [self.forward.splat(weight, 1.0), self.backward.splat(1.0 - weight, -1.0)];
        let misfits = fields.each_ref().map(|f| self.warp_error(f, weight));
        let light = (0..self.from.v.len())
            .map(|k| {
                let (early, late, still) = (misfits[0].v[k], misfits[1].v[k], self.static_error.v[k]);
                if still < early.min(late) {
                    let (a, b) = (self.from.v[k], self.to.v[k]);
                    return a + weight * (b - a);
                }
                self.blend(&fields[usize::from(late < early)], k, weight)
            })
            // Cubic interpolation can return a negative value at the dark side of an edge.
            .map(|light| light.max(0.0))
            .collect();
        Frame::new(self.geometry, OwnedSamples::F32(light))
    }

    /// Returns the difference of the two frames after each is warped along `field` to position `weight`, averaged around
    /// every pixel.
    fn warp_error(&self, field: &FlowField, weight: f32) -> Plane {
        let (early, late) =
            (field.warp(&self.sqrt_light.0, -weight), field.warp(&self.sqrt_light.1, 1.0 - weight));
        early.map2(&late, |p, q| (p - q).abs()).box_mean(2)
    }

    fn blend(&self, field: &FlowField, k: usize, weight: f32) -> f32 {
        let (x, y) = ((k % self.from.w) as f32, (k / self.from.w) as f32);
        let (dx, dy) = (field.dx.v[k], field.dy.v[k]);
        let early = (x - weight * dx, y - weight * dy);
        let late = (x + (1.0 - weight) * dx, y + (1.0 - weight) * dy);
        let (a, b) = (self.from.at(early.0, early.1), self.to.at(late.0, late.1));
        // If one of the two positions is outside its frame, the light comes from the other frame only.
        match (self.from.contains(early.0, early.1), self.to.contains(late.0, late.1)) {
            (true, false) => a,
            (false, true) => b,
            _ => a + weight * (b - a),
        }
    }
}
