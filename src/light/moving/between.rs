//! The light between two frames along the motion that they show.
//!
//! The optical flow between the frames is estimated both ways; the frame in between takes each
//! pixel from where it was and from where it goes to. Coarse to fine, least squares in windows (Lucas
//! and Kanade 1981, Bouguet's pyramid of 1999); in-between fields by splatting, as Baker et al. ("A
//! database and evaluation methodology for optical flow", IJCV 92, 2011, section 3.3.3) do.
//! It is an estimate: repeated patterns, transparency and motion beyond the pyramid's reach mislead
//! it. Where the motion found explains the two frames no better than standing still, light blends.

use crate::error::{Error, Kind, Result};
use crate::interpolation::catmull_rom;
use crate::light::frame::{Frame, OwnedSamples};
use crate::spikes::Geometry;

/// Half the side of the window in which motion is taken for uniform, in pixels.
const REACH: usize = 4;
/// Warps at every level of the pyramid.
const WARPS: usize = 6;
/// The shortest side of the coarsest level.
const COARSEST: usize = 20;
/// Mean square gradient, in codes of full scale squared, below which a window tells nothing: that
/// of noise with a standard deviation of 0.3 %.
const FLAT: f32 = 1e-5;

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

    /// Cubic (Catmull and Rom), the border's value outside. Straight lines between pixels would bend
    /// the motion found by up to 0.05 px where detail is 20 pixels wide.
    fn at(&self, x: f32, y: f32) -> f32 {
        let (x, y) = (x.clamp(0.0, (self.w - 1) as f32), y.clamp(0.0, (self.h - 1) as f32));
        let (c, r) = (x as usize, y as usize);
        let (across, down) = (catmull_rom(x - c as f32), catmull_rom(y - r as f32));
        let near = |i: usize, k: usize, n: usize| (i + k).saturating_sub(1).min(n - 1);
        let columns: [usize; 4] = std::array::from_fn(|k| near(c, k, self.w));
        let mut sum = 0.0;
        for (k, weight) in down.iter().enumerate() {
            let row = &self.v[near(r, k, self.h) * self.w..][..self.w];
            let line: f32 = columns.iter().zip(&across).map(|(&c, w)| w * row[c]).sum();
            sum += weight * line;
        }
        sum
    }

    fn inside(&self, x: f32, y: f32) -> bool {
        (-0.5..self.w as f32 - 0.5).contains(&x) && (-0.5..self.h as f32 - 0.5).contains(&y)
    }

    /// Mean over windows of `2 reach + 1` pixels, cut at the borders.
    fn mean(&self, reach: usize) -> Self {
        let rows = means(&self.v, self.w, 1, self.h, self.w, reach);
        let v = means(&rows, self.h, self.w, self.w, 1, reach);
        Self { v, ..*self }
    }

    /// Half the size, each pixel the mean of four.
    fn half(&self) -> Self {
        let (w, h) = (self.w.div_ceil(2), self.h.div_ceil(2));
        let at = |r: usize, c: usize| self.v[r.min(self.h - 1) * self.w + c.min(self.w - 1)];
        let mean = |r: usize, c: usize| {
            (at(2 * r, 2 * c) + at(2 * r, 2 * c + 1) + at(2 * r + 1, 2 * c) + at(2 * r + 1, 2 * c + 1)) / 4.0
        };
        let v = (0..w * h).map(|k| mean(k / w, k % w)).collect();
        Self { w, h, v }
    }

    /// Differences of neighbours to the right and below.
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

/// Running means along `count` lines of `n` values, `step` apart, the lines `line` apart.
fn means(v: &[f32], n: usize, step: usize, count: usize, line: usize, reach: usize) -> Vec<f32> {
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
            let taken = (i + reach).min(n - 1) + 1 - i.saturating_sub(reach);
            out[at(i)] = (sum / taken as f64) as f32;
        }
    }
    out
}

/// A displacement per pixel.
#[derive(Clone, Debug)]
struct Field {
    dx: Plane,
    dy: Plane,
}

impl Field {
    fn still(like: &Plane) -> Self {
        let zero = Plane { v: vec![0.0; like.v.len()], ..*like };
        Self { dx: zero.clone(), dy: zero }
    }

    /// The field of a level of twice the size.
    fn twice(&self, like: &Plane) -> Self {
        let finer = |p: &Plane| {
            let value = |k: usize| {
                let (r, c) = ((k / like.w) as f32, (k % like.w) as f32);
                2.0 * p.at((c - 0.5) / 2.0, (r - 0.5) / 2.0)
            };
            Plane { v: (0..like.v.len()).map(value).collect(), ..*like }
        };
        Self { dx: finer(&self.dx), dy: finer(&self.dy) }
    }

    /// What `picture` holds where the pixels go, `share` of the way.
    fn fetch(&self, picture: &Plane, share: f32) -> Plane {
        let value = |k: usize| {
            let (r, c) = ((k / picture.w) as f32, (k % picture.w) as f32);
            picture.at(c + share * self.dx.v[k], r + share * self.dy.v[k])
        };
        Plane { v: (0..picture.v.len()).map(value).collect(), ..*picture }
    }
}

/// The motion from `a` to `b`, coarse to fine.
fn motion(a: &Plane, b: &Plane) -> Field {
    let mut levels = vec![(a.clone(), b.clone())];
    while let Some((a, b)) = levels.last().filter(|(a, _)| a.w.min(a.h) >= 2 * COARSEST) {
        levels.push((a.half(), b.half()));
    }
    let mut field: Option<Field> = None;
    for (a, b) in levels.iter().rev() {
        let start = field.map_or_else(|| Field::still(a), |f| f.twice(a));
        field = Some(refined(a, b, start));
    }
    field.unwrap_or_else(|| Field::still(a))
}

fn refined(a: &Plane, b: &Plane, mut field: Field) -> Field {
    let (ax, ay) = a.gradients();
    for _ in 0..WARPS {
        let there = field.fetch(b, 1.0);
        let (bx, by) = there.gradients();
        let gx = ax.map2(&bx, |p, q| 0.5 * (p + q));
        let gy = ay.map2(&by, |p, q| 0.5 * (p + q));
        let change = there.map2(a, |p, q| p - q);
        let window = |p: &Plane, q: &Plane| p.map2(q, |x, y| x * y).mean(REACH);
        let (xx, xy, yy) = (window(&gx, &gx), window(&gx, &gy), window(&gy, &gy));
        let (xt, yt) = (window(&gx, &change), window(&gy, &change));
        for k in 0..a.v.len() {
            let (p, q, s) = (xx.v[k] + FLAT, xy.v[k], yy.v[k] + FLAT);
            let det = p * s - q * q;
            let (u, v) = ((q * yt.v[k] - s * xt.v[k]) / det, (q * xt.v[k] - p * yt.v[k]) / det);
            // A step is trusted as far as gradients reach.
            field.dx.v[k] += u.clamp(-1.0, 1.0);
            field.dy.v[k] += v.clamp(-1.0, 1.0);
        }
        field = Field { dx: field.dx.mean(1), dy: field.dy.mean(1) };
    }
    field
}

/// Two frames and the motion between them.
#[derive(Clone, Debug)]
pub struct Between {
    geometry: Geometry,
    from: Plane,
    to: Plane,
    /// Square roots of the light, in which dark detail counts as much as bright.
    codes: (Plane, Plane),
    forward: Way,
    backward: Way,
    /// How badly standing still explains the frames.
    still: Plane,
}

/// The motion from one frame to the other, and how much each pixel changes on it.
#[derive(Clone, Debug)]
struct Way {
    field: Field,
    change: Plane,
}

impl Way {
    fn new(a: &Plane, b: &Plane) -> Self {
        let field = motion(a, b);
        let change = field.fetch(b, 1.0).map2(a, |p, q| (p - q).abs());
        Self { field, change }
    }

    /// The field as seen at `share` of its way, times `sign`; where several pixels come together the
    /// one that changes least wins, where none comes the field stays as it is.
    fn splat(&self, share: f32, sign: f32) -> Field {
        let (field, change) = (&self.field, &self.change);
        let mut out = field.clone();
        let mut error = vec![f32::INFINITY; change.v.len()];
        for k in 0..change.v.len() {
            let x = (k % change.w) as f32 + share * field.dx.v[k];
            let y = (k / change.w) as f32 + share * field.dy.v[k];
            if !change.inside(x, y) {
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

impl Between {
    /// Estimates the motion from `from` to `to`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Between, Frame};
    /// let dark = Frame::dark(Geometry::new(64, 48)?);
    /// let middle = Between::new(&dark, &dark)?.at(0.5)?;
    /// assert_eq!(middle.max(), 0.0);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Kind::Usage`] when the frames differ in size.
    pub fn new(from: &Frame, to: &Frame) -> Result<Self> {
        if from.geometry() != to.geometry() {
            return Err(Error::new(Kind::Usage, "frames to insert between")
                .found(format_args!("{} and {}", from.geometry(), to.geometry()))
                .expected("two frames of one size"));
        }
        let geometry = from.geometry();
        let (w, h) = (geometry.width(), geometry.height());
        let plane = |f: &Frame| Plane { w, h, v: f.to_f32() };
        let (from, to) = (plane(from), plane(to));
        let code = |p: &Plane| Plane { v: p.v.iter().map(|x| x.sqrt()).collect(), ..*p };
        let codes = (code(&from), code(&to));
        let (forward, backward) = (Way::new(&codes.0, &codes.1), Way::new(&codes.1, &codes.0));
        let still = codes.0.map2(&codes.1, |p, q| (p - q).abs()).mean(2);
        Ok(Self { geometry, from, to, codes, forward, backward, still })
    }

    /// The motion from the first frame to the second, in pixels: to the right, and down.
    #[must_use]
    pub fn motion(&self) -> (&[f32], &[f32]) {
        (&self.forward.field.dx.v, &self.forward.field.dy.v)
    }

    /// The light at `weight` from the first frame (0) to the second (1), as floats.
    ///
    /// # Errors
    /// [`Kind::Usage`] when `weight` lies outside 0 to 1.
    pub fn at(&self, weight: f32) -> Result<Frame> {
        if !(0.0..=1.0).contains(&weight) {
            return Err(Error::new(Kind::Usage, "place between two frames")
                .found(weight)
                .expected("a number from 0 to 1"));
        }
        let fields = [self.forward.splat(weight, 1.0), self.backward.splat(1.0 - weight, -1.0)];
        let misfits = fields.each_ref().map(|f| self.misfit(f, weight));
        let light = (0..self.from.v.len())
            .map(|k| {
                let (early, late, still) = (misfits[0].v[k], misfits[1].v[k], self.still.v[k]);
                if still < early.min(late) {
                    let (a, b) = (self.from.v[k], self.to.v[k]);
                    return a + weight * (b - a);
                }
                self.blend(&fields[usize::from(late < early)], k, weight)
            })
            // A cubic may swing below the dark side of an edge.
            .map(|light| light.max(0.0))
            .collect();
        Frame::new(self.geometry, OwnedSamples::F32(light))
    }

    /// How badly a field at `weight` explains the two frames, around every pixel.
    fn misfit(&self, field: &Field, weight: f32) -> Plane {
        let (early, late) = (field.fetch(&self.codes.0, -weight), field.fetch(&self.codes.1, 1.0 - weight));
        early.map2(&late, |p, q| (p - q).abs()).mean(2)
    }

    fn blend(&self, field: &Field, k: usize, weight: f32) -> f32 {
        let (x, y) = ((k % self.from.w) as f32, (k / self.from.w) as f32);
        let (dx, dy) = (field.dx.v[k], field.dy.v[k]);
        let early = (x - weight * dx, y - weight * dy);
        let late = (x + (1.0 - weight) * dx, y + (1.0 - weight) * dy);
        let (a, b) = (self.from.at(early.0, early.1), self.to.at(late.0, late.1));
        // Beyond a border only one of the two has seen it.
        match (self.from.inside(early.0, early.1), self.to.inside(late.0, late.1)) {
            (true, false) => a,
            (false, true) => b,
            _ => a + weight * (b - a),
        }
    }
}
