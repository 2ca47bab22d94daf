//! The body of plans with the rarer operations: light that changes with the readout or comes from
//! neighbours, thresholds that move, state that lingers.
//!
//! One vector and one readout at a time, and the plan is asked at run time. It is a case of its own, so
//! that plans without these operations do not carry their tests. `docs/performance.md` states its speed.

use crate::kernels::increment::{Fine, Increment, cut_off, fixed, sample, scalar};
use crate::kernels::lanes::Lanes;
use crate::kernels::pixels::{Constants, Pixels};
use crate::kernels::step::hash;
use crate::kernels::{Job, Light, Samples, rare};
use crate::plan::{ADAPTED, Further, LATE, LOW, SLOW, StateParts};

/// Runs a plan with further rules.
#[inline(always)]
pub(super) fn general<L: Lanes>(l: L, job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    let Some(further) = job.plan.further() else { return };
    let mut at = 0;
    while at < job.pixels() {
        vector(l, job, further, state, out, at);
        at += L::N;
    }
}

/// All readouts of one vector.
#[inline(always)]
fn vector<L: Lanes>(
    l: L,
    job: &Job<'_>,
    further: &Further,
    state: &mut StateParts<'_>,
    out: &mut [u8],
    at: usize,
) {
    let p = job.range().start + at;
    let mut c = Constants { clip: true, ..Constants::load(l, job, p) };
    let dark = c.dark;
    let mut pixels = Pixels::load(l, state, at);
    let mut lingering = Lingering::load(l, state, at);
    let moved = Moved::load(l, further, p);
    let bytes = job.tile_bytes();
    for (readouts, light) in job.batch.segments() {
        let (start, way, weights) = match *light {
            Light::Held(samples) => (optics(l, job, further, samples, p), l.splat_f(0.0), None),
            Light::Between { from, to, weights } => {
                let start = optics(l, job, further, from, p);
                (start, l.sub_f(optics(l, job, further, to, p), start), Some(weights))
            }
        };
        let steady = weights.is_none() && !further.varies();
        let mut ready: Option<(Increment<L>, Option<Fine<L>>)> = None;
        for (k, t) in readouts.clone().enumerate() {
            if !steady || ready.is_none() {
                let light = match weights {
                    Some(weights) => l.add_f(start, l.mul_f(way, l.splat_f(weights[k]))),
                    None => start,
                };
                let light = seen(l, job, further, t, light, &mut lingering);
                c.dark = switched(l, job, further, &c, dark, t, &mut lingering);
                let increment = Increment::new::<true, true>(l, &c, light);
                let fine = if increment.any_fine { Fine::new(l, job, p, light) } else { None };
                ready = Some((increment, fine));
            }
            let Some((increment, fine)) = &ready else { return };
            let fired = readout(
                l,
                job,
                further,
                t,
                &c,
                &moved,
                increment,
                fine.as_ref(),
                &mut pixels,
                &mut lingering,
            );
            l.store_bits(&mut out[t * bytes..][..bytes], at / 8, fired);
        }
    }
    pixels.store(l, state, at);
    lingering.store(l, state, at);
}

/// Constants of the rules about thresholds.
struct Moved<L: Lanes> {
    /// Steps x 65,536.
    threshold: L::Float,
    row: L::Word,
}

impl<L: Lanes> Moved<L> {
    #[inline(always)]
    fn load(l: L, further: &Further, p: usize) -> Self {
        Self { threshold: l.load_f(&further.threshold, p), row: l.load_words(&further.rows, p) }
    }
}

/// What lingers, in registers.
struct Lingering<L: Lanes> {
    slow: L::Float,
    adapted: L::Float,
    late: L::Float,
    low: L::Half,
}

impl<L: Lanes> Lingering<L> {
    #[inline(always)]
    fn load(l: L, state: &StateParts<'_>, at: usize) -> Self {
        let low = &state.lingering[LOW];
        Self {
            slow: load(l, state, SLOW, at),
            adapted: load(l, state, ADAPTED, at),
            late: load(l, state, LATE, at),
            low: if low.is_empty() { l.splat(0) } else { l.load(low, at) },
        }
    }

    #[inline(always)]
    fn store(&self, l: L, state: &mut StateParts<'_>, at: usize) {
        store(l, state, SLOW, at, self.slow);
        store(l, state, ADAPTED, at, self.adapted);
        store(l, state, LATE, at, self.late);
        if !state.lingering[LOW].is_empty() {
            l.store(state.lingering[LOW], at, self.low);
        }
    }
}

#[inline(always)]
fn load<L: Lanes>(l: L, state: &StateParts<'_>, column: usize, at: usize) -> L::Float {
    if state.lingering[column].is_empty() {
        return l.splat_f(0.0);
    }
    let high = l.load(state.lingering[column], at);
    l.f_of_bits(l.join(high, l.load(state.lingering[column + 1], at)))
}

#[inline(always)]
fn store<L: Lanes>(l: L, state: &mut StateParts<'_>, column: usize, at: usize, value: L::Float) {
    if !state.lingering[column].is_empty() {
        let bits = l.bits_of_f(value);
        l.store(state.lingering[column], at, l.high(bits));
        l.store(state.lingering[column + 1], at, l.low(bits));
    }
}

/// Light of a frame after it has spread to neighbours, in 1/255 of full scale.
#[inline(always)]
fn optics<L: Lanes>(l: L, job: &Job<'_>, further: &Further, samples: Samples<'_>, p: usize) -> L::Float {
    let own = sample(l, samples, p);
    if further.crosstalk == 0.0 {
        return own;
    }
    let geometry = job.plan.geometry();
    let around = l.load_f(&around(samples, p, geometry.width(), geometry.pixels()), 0);
    let gained = l.sub_f(around, l.mul_f(own, l.splat_f(4.0)));
    l.add_f(own, l.mul_f(gained, l.splat_f(further.crosstalk * 0.25)))
}

/// Sum of the four neighbours' light of 32 pixels from `first` on; a missing neighbour is the pixel itself.
/// Plain code, once for every new frame.
#[inline(never)]
fn around(samples: Samples<'_>, first: usize, width: usize, pixels: usize) -> [f32; 32] {
    let mut sums = [0.0; 32];
    for (i, sum) in sums.iter_mut().enumerate().take(pixels.saturating_sub(first)) {
        let p = first + i;
        let col = p % width;
        let up = if p >= width { p - width } else { p };
        let down = if p + width < pixels { p + width } else { p };
        let left = if col > 0 { p - 1 } else { p };
        let right = if col + 1 < width { p + 1 } else { p };
        *sum =
            (scalar(samples, up) + scalar(samples, down)) + (scalar(samples, left) + scalar(samples, right));
    }
    sums
}

/// The light that turns into charge at this readout.
#[inline(always)]
fn seen<L: Lanes>(
    l: L,
    job: &Job<'_>,
    further: &Further,
    t: usize,
    light: L::Float,
    lingering: &mut Lingering<L>,
) -> L::Float {
    let mut light = cut_off(l, job.plan.rules().greatest_light, light, true);
    if further.schedule.is_some() {
        light = l.mul_f(light, l.splat_f(job.batch.modulation().factors[t]));
    }
    if further.quadratic != 0.0 {
        light = l.min_f(light, l.splat_f(further.peak));
        light = l.add_f(light, l.mul_f(l.mul_f(light, light), l.splat_f(further.quadratic)));
    }
    let Some(lag) = further.lag else { return light };
    let late = lingering.late;
    lingering.late = l.add_f(late, l.mul_f(l.sub_f(light, late), l.splat_f(lag.arriving)));
    l.add_f(light, l.mul_f(l.sub_f(late, light), l.splat_f(lag.fraction)))
}

/// The dark current of this readout.
#[inline(always)]
fn switched<L: Lanes>(
    l: L,
    job: &Job<'_>,
    further: &Further,
    c: &Constants<L>,
    dark: L::Float,
    t: usize,
    lingering: &mut Lingering<L>,
) -> L::Float {
    let Some(switch) = &further.telegraph else { return dark };
    let switches = rare::below(l, c.pair_keys, &job.batch.modulation().telegraph, t, switch.rate);
    let change = l.select(switches, l.splat(-1), l.splat(0));
    lingering.low = l.xor(lingering.low, change);
    let amplitude = l.load_f(&switch.amplitude, c.p);
    let is_low = l.greater(l.splat(0), lingering.low);
    let (less, more) = (l.sub_f(dark, amplitude), l.add_f(dark, amplitude));
    select_f(l, is_low, less, more)
}

#[inline(always)]
fn select_f<L: Lanes>(l: L, m: L::Mask, a: L::Float, b: L::Float) -> L::Float {
    l.f_of_bits(l.select_w(m, l.bits_of_f(a), l.bits_of_f(b)))
}

/// One readout of `N` pixels; returns the reported bits.
#[inline(always)]
fn readout<L: Lanes>(
    l: L,
    job: &Job<'_>,
    further: &Further,
    t: usize,
    c: &Constants<L>,
    moved: &Moved<L>,
    increment: &Increment<L>,
    fine: Option<&Fine<L>>,
    pixel: &mut Pixels<L>,
    lingering: &mut Lingering<L>,
) -> L::Mask {
    if further.leak != 0.0 {
        let stored = l.add_f(l.to_f(pixel.word(l)), moved.threshold);
        let lost = fixed(l, l.mul_f(stored, l.splat_f(-further.leak)), true);
        pixel.add_word(l, lost);
    }
    rare::gather_charge(l, job, t, c, increment, fine, pixel);
    let modulation = job.batch.modulation();
    if further.coupling != 0.0 {
        let count = l.to_f(l.widen(l.load(&modulation.neighbours, c.p)));
        let given = l.mul_f(l.mul_f(count, l.splat_f(further.coupling)), moved.threshold);
        pixel.add_word(l, fixed(l, given, true));
    }
    if !job.plan.tables().ceiling.is_empty() {
        pixel.charge = l.min(pixel.charge, c.ceiling);
    }
    let offsets = offsets(l, job, further, t, c, moved, lingering);
    let fired = rare::compare_words(l, job, t, c, Some(offsets), pixel);
    if job.plan.rules().lost_increment != 0.0 || further.couples() {
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
    }
    if let Some(adaptation) = further.adaptation {
        let rise = select_f(l, fired, l.splat_f(adaptation.rise), l.splat_f(0.0));
        let fallen = l.mul_f(lingering.adapted, l.splat_f(adaptation.fall));
        let adapted = l.add_f(l.sub_f(lingering.adapted, fallen), rise);
        lingering.adapted = l.min_f(adapted, l.splat_f(adaptation.highest));
    }
    rare::flip(l, job, t, c, fired)
}

/// By how much the threshold is off, and what is compared with besides; steps x 65,536.
#[inline(always)]
fn offsets<L: Lanes>(
    l: L,
    job: &Job<'_>,
    further: &Further,
    t: usize,
    c: &Constants<L>,
    moved: &Moved<L>,
    lingering: &mut Lingering<L>,
) -> (L::Word, L::Word) {
    let modulation = job.batch.modulation();
    let mut offset = l.splat_f(0.0);
    if further.row_noise != 0.0 {
        let height = further.height();
        offset = l.gather_f(&modulation.rows[t * height..][..height], moved.row);
    }
    if let Some(slow) = further.slow {
        let z = l.to_f(l.widen(l.gauss(hash(l, c.pair_keys, &modulation.slow[t]))));
        let kept = l.mul_f(lingering.slow, l.splat_f(slow.kept));
        let next = l.add_f(kept, l.mul_f(z, l.splat_f(slow.step)));
        lingering.slow = l.max_f(l.min_f(next, l.splat_f(slow.bound)), l.splat_f(-slow.bound));
        offset = l.add_f(offset, lingering.slow);
    }
    if further.adaptation.is_some() {
        offset = l.add_f(offset, lingering.adapted);
    }
    if further.droop != 0.0 {
        offset = l.add_f(offset, l.splat_f(modulation.droop));
    }
    let offset = fixed(l, l.mul_f(offset, moved.threshold), true);
    if further.comparator == 0.0 {
        return (offset, l.splat_w(0));
    }
    let z = l.to_f(l.widen(l.gauss(hash(l, c.pair_keys, &modulation.comparator[t]))));
    let only = l.mul_f(l.mul_f(z, l.splat_f(further.comparator)), moved.threshold);
    (offset, fixed(l, only, true))
}
