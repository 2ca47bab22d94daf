//! The patterns of the moving chart, each a function of a place and a time.

use crate::spikes::Geometry;

/// Light around the patterns, the customary middle grey.
pub const GROUND: f32 = 0.18;

const DARK: f32 = 0.02;
const BRIGHT: f32 = 0.85;
/// Pairs of spokes; a power of two, so that repeated squaring turns one angle into this many.
const SPOKES: u32 = 16;
const STAR_TURNS_PER_S: f64 = 2.0;
const BAR_WIDTHS_PER_S: f64 = 2.5;

pub(super) fn wedge_top(height: usize) -> usize {
    height - (height * 3 / 20).max(1)
}

/// Where the patterns are, in pixels from the upper left corner, and how they stand.
pub(super) struct Scene {
    pub(super) wedge_top: usize,
    pub(super) star: Disc,
    pub(super) square: Square,
    pub(super) bars: [Bars; 2],
}

pub(super) struct Disc {
    centre: [f32; 2],
    radius: f32,
    turn: [f32; 2],
}

pub(super) struct Square {
    centre: [f32; 2],
    half: f32,
    axis: [f32; 2],
}

pub(super) struct Bars {
    rows: [f32; 2],
    cols: [f32; 2],
    period: f32,
    offset: f32,
}

impl Scene {
    pub(super) fn new(geometry: Geometry, seconds: f64) -> Self {
        let (w, top) = (geometry.width() as f32, wedge_top(geometry.height()));
        let h = top as f32;
        let split = w * 0.56;
        let phase = core::f64::consts::TAU * fract(seconds * STAR_TURNS_PER_S);
        // The star repeats after one pair of spokes, so only that angle matters.
        let turn = phase * f64::from(SPOKES);
        let slant = 5.0_f64.to_radians();
        let column = [split, w - 0.03 * w];
        let run = |speed: f64, period: f32| {
            let moved = seconds * speed * f64::from(w) / f64::from(period);
            (fract(moved) * f64::from(period)) as f32
        };
        let (fine, coarse) = ((w / 50.0).max(2.0), (w / 12.5).max(4.0));
        Self {
            wedge_top: top,
            star: Disc {
                centre: [split * 0.5, h * 0.5],
                radius: (split.min(h) * 0.5 - 1.0) * 0.94,
                turn: [libm::cos(turn) as f32, libm::sin(turn) as f32],
            },
            square: Square {
                centre: [(column[0] + column[1]) * 0.5, h * 0.27],
                half: ((column[1] - column[0]) * 0.38).min(h * 0.2),
                axis: [libm::cos(slant) as f32, libm::sin(slant) as f32],
            },
            bars: [
                Bars {
                    rows: [h * 0.55, h * 0.74],
                    cols: column,
                    period: fine,
                    offset: run(BAR_WIDTHS_PER_S * 0.2, fine),
                },
                Bars {
                    rows: [h * 0.78, h * 0.97],
                    cols: column,
                    period: coarse,
                    offset: run(-BAR_WIDTHS_PER_S, coarse),
                },
            ],
        }
    }

    /// Light at the pixel whose centre is `(x, y)`.
    pub(super) fn light(&self, x: f32, y: f32) -> f32 {
        let mut light = self.star.over(GROUND, x, y);
        light = self.square.over(light, x, y);
        for bars in &self.bars {
            light = bars.over(light, x, y);
        }
        light
    }
}

fn fract(x: f64) -> f64 {
    x - libm::floor(x)
}

/// How much of a pixel lies inside an edge at signed distance `d` (inside is negative).
fn coverage(d: f32) -> f32 {
    (0.5 - d).clamp(0.0, 1.0)
}

pub(super) fn mix(from: f32, to: f32, part: f32) -> f32 {
    from + (to - from) * part
}

/// What a pixel sees of the star, however it stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spokes {
    /// How much of the pixel lies inside the star.
    pub(super) inside: f32,
    /// Cosine and sine of the angle of the spokes there.
    pub(super) angle: [f32; 2],
    /// Pixels from an edge for each radian of that angle.
    pub(super) reach: f32,
}

impl Disc {
    pub(super) fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        self.spokes(x, y).map_or(under, |spokes| mix(under, self.light(&spokes), spokes.inside))
    }

    /// What turns with nothing; `None` outside and in the very centre.
    pub(super) fn spokes(&self, x: f32, y: f32) -> Option<Spokes> {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let r = (dx * dx + dy * dy).sqrt();
        let inside = coverage(r - self.radius);
        if inside == 0.0 || r == 0.0 {
            return None;
        }
        let (mut c, mut s) = (dx / r, dy / r);
        for _ in 0..SPOKES.trailing_zeros() {
            (c, s) = (c * c - s * s, 2.0 * c * s);
        }
        Some(Spokes { inside, angle: [c, s], reach: r / SPOKES as f32 })
    }

    /// Light of the spokes as the star stands.
    pub(super) fn light(&self, spokes: &Spokes) -> f32 {
        let [c, s] = spokes.angle;
        let wave = s * self.turn[0] - c * self.turn[1];
        // Near an edge the sine is the angle, so this is the distance to it in pixels; where
        // spokes are thinner than a pixel it fades to their mean, as an area would.
        mix(DARK, BRIGHT, coverage(-wave * spokes.reach))
    }
}

impl Square {
    pub(super) fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let u = dx * self.axis[0] + dy * self.axis[1];
        let v = dy * self.axis[0] - dx * self.axis[1];
        let outer = coverage(u.abs() - self.half) * coverage(v.abs() - self.half);
        let inner = self.half * 0.5;
        let hole = coverage(u.abs() - inner) * coverage(v.abs() - inner);
        mix(mix(under, BRIGHT, outer), DARK, hole)
    }
}

impl Bars {
    pub(super) fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        match self.inside(x, y) {
            0.0 => under,
            inside => mix(under, self.light(x), inside),
        }
    }

    /// How much of the pixel lies among the bars.
    pub(super) fn inside(&self, x: f32, y: f32) -> f32 {
        span(y, self.rows) * span(x, self.cols)
    }

    /// Light of the bars in the column of pixels centred at `x`.
    pub(super) fn light(&self, x: f32) -> f32 {
        // The exact area of the bars within the pixel: a difference of two integrals.
        let at = x - self.offset + self.period;
        let bright = self.filled(at + 0.5) - self.filled(at - 0.5);
        mix(DARK, BRIGHT, bright.clamp(0.0, 1.0))
    }

    /// Length of bright bars from 0 to `x`.
    fn filled(&self, x: f32) -> f32 {
        let whole = (x / self.period).floor();
        let half = self.period * 0.5;
        whole * half + (x - whole * self.period).min(half)
    }
}

/// How much of the pixel centred at `x` lies in `[from, to]`.
fn span(x: f32, [from, to]: [f32; 2]) -> f32 {
    ((x + 0.5).min(to) - (x - 0.5).max(from)).clamp(0.0, 1.0)
}
