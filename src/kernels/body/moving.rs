//! The body of plans of which something moves: light that changes with the readout or comes from
//! neighbours, thresholds that are not where they were, state that lingers. In scalar code:
//!
//! ```text
//! charge -= leak * (charge + threshold);
//! charge += increment(light(t), dark(t)) + noise_of_quanta(t) + coupling * neighbours_that_fired(t - 1);
//! let offset = row_noise(t) + slow(t) + adapted - droop * share_that_fired(t - 1);
//! fired = charge >= noise + offset + comparator(t); // `charge` is counted from the threshold
//! if fired { charge -= threshold + noise + offset; adapted += rise; }
//! ```
//!
//! One vector and one readout at a time, and the plan is asked at run time. It is a case of its own, so
//! that plans without these operations do not carry their tests. `docs/why/performance.md` states its speed.
//!
//! A vector stays in registers over all readouts of a batch, unless pixels act on each other: then all vectors of the
//! sensor step one readout, and what was computed from their light waits in memory for the next.

use crate::kernels::body::any_rules;
use crate::kernels::body::arriving::{dark, optics, seen, select_f};
use crate::kernels::body::increment::{Fine, Increment, fixed};
use crate::kernels::body::lingering::Lingering;
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step::{hash, stays_below};
use crate::kernels::body::{NONE, SURPLUS};
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::modulation::Around;
use crate::kernels::{Job, Light};
use crate::plan::{Moving, StateParts};

/// Runs a plan of which something moves.
#[inline(always)]
pub(super) fn moving<L: Lanes>(l: L, job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    let Some(moving) = job.plan.moving() else { return };
    if moving.couples() && job.batch.readouts() > 1 {
        return frame_by_frame(l, job, moving, state, out);
    }
    let around = &job.batch.modulation().around;
    let bytes = job.tile_bytes();
    let mut at = 0;
    while at < job.pixels() {
        let mut vector = Vector::load(l, job, moving, state, at);
        for (readouts, light) in job.batch.segments() {
            vector.see(l, job, moving, light);
            for (k, t) in readouts.clone().enumerate() {
                let fired = vector.readout(l, job, moving, t, weight(light, k), around);
                l.store_bits(&mut out[t * bytes..][..bytes], at / 8, fired);
            }
        }
        vector.store(l, state, at);
        at += L::N;
    }
}

/// Pixels that act on each other: all vectors of the sensor at one readout after the other.
#[inline(always)]
fn frame_by_frame<L: Lanes>(
    l: L,
    job: &Job<'_>,
    moving: &Moving,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    let mut around = job.batch.modulation().around.clone();
    let bytes = job.tile_bytes();
    let mut vectors = Vec::with_capacity(job.pixels() / L::N);
    while vectors.len() < job.pixels() / L::N {
        vectors.push(Vector::load(l, job, moving, state, vectors.len() * L::N));
    }
    for (readouts, light) in job.batch.segments() {
        for vector in &mut vectors {
            vector.see(l, job, moving, light);
        }
        for (k, t) in readouts.clone().enumerate() {
            let (weight, bits) = (weight(light, k), &mut out[t * bytes..][..bytes]);
            for (i, vector) in vectors.iter_mut().enumerate() {
                let fired = vector.readout(l, job, moving, t, weight, &around);
                l.store_bits(bits, i * L::N / 8, fired);
                l.store(state.fired, i * L::N, vector.pixels.fired);
            }
            around.follow(job.plan, moving, state.fired);
        }
    }
    for (i, vector) in vectors.iter().enumerate() {
        vector.store(l, state, i * L::N);
    }
}

/// The weight of readout `k` of a segment, on a way between frames.
#[inline(always)]
fn weight(light: &Light<'_>, k: usize) -> Option<f32> {
    match light {
        Light::Held(_) => None,
        Light::Between { weights, .. } => Some(weights[k]),
    }
}

/// A vector of pixels and the light that it sees.
struct Vector<L: Lanes> {
    constants: Constants<L>,
    /// The tables' dark current; that of `constants` may switch.
    dark: L::Float,
    moved: Moved<L>,
    pixels: Pixels<L>,
    lingering: Lingering<L>,
    /// Light of the segment's frame, and the way from it to the next.
    start: L::Float,
    way: L::Float,
    /// Increments of the last readout's light, and whether no surplus can come of them.
    ready: Option<(Increment<L>, Option<Fine<L>>, bool)>,
}

impl<L: Lanes> Vector<L> {
    #[inline(always)]
    fn load(l: L, job: &Job<'_>, moving: &Moving, state: &StateParts<'_>, at: usize) -> Self {
        let p = job.range().start + at;
        let constants = Constants { clip: true, ..Constants::load::<NONE, SURPLUS, true>(l, job, p) };
        Self {
            constants,
            dark: constants.dark,
            moved: Moved::load(l, moving, p),
            pixels: Pixels::load::<NONE, SURPLUS, true>(l, state, at),
            lingering: Lingering::load(l, state, at),
            start: l.splat_f(0.0),
            way: l.splat_f(0.0),
            ready: None,
        }
    }

    #[inline(always)]
    fn store(&self, l: L, state: &mut StateParts<'_>, at: usize) {
        self.pixels.store::<NONE, SURPLUS, true>(l, state, at);
        self.lingering.store(l, state, at);
    }

    /// The light of a segment.
    #[inline(always)]
    fn see(&mut self, l: L, job: &Job<'_>, moving: &Moving, light: &Light<'_>) {
        let p = self.constants.p;
        (self.start, self.way) = match *light {
            Light::Held(samples) => (optics(l, job, moving, samples, p), l.splat_f(0.0)),
            Light::Between { from, to, .. } => {
                let start = optics(l, job, moving, from, p);
                (start, l.sub_f(optics(l, job, moving, to, p), start))
            }
        };
        self.ready = None;
    }

    /// Readout `t`, `weight` of the way between the frames if they are two; returns the reported bits.
    #[inline(always)]
    fn readout(
        &mut self,
        l: L,
        job: &Job<'_>,
        moving: &Moving,
        t: usize,
        weight: Option<f32>,
        around: &Around,
    ) -> L::Mask {
        let steady = weight.is_none() && !moving.varies();
        if !steady || self.ready.is_none() {
            let light = match weight {
                Some(weight) => l.add_f(self.start, l.mul_f(self.way, l.splat_f(weight))),
                None => self.start,
            };
            let light = seen(l, job, moving, t, light, &mut self.lingering);
            self.constants.dark = dark(l, job, moving, &self.constants, self.dark, t, &mut self.lingering);
            let increment = Increment::new::<true, true>(l, &self.constants, light);
            let fine = if increment.any_fine { Fine::new(l, job, self.constants.p, light) } else { None };
            // What waits may be from brighter light.
            let at_once = self.constants.released == 0;
            let below = job.plan.rules().surplus && at_once && !any_rules::needs_words(job) && fine.is_none();
            let below = below && stays_below(l, &self.constants, &increment, &self.pixels, self.moved.sway);
            self.ready = Some((increment, fine, below));
        }
        let Some((increment, fine, below)) = &self.ready else { return l.greater(l.splat(0), l.splat(0)) };
        let (c, pixels, lingering) = (&self.constants, &mut self.pixels, &mut self.lingering);
        readout(
            l,
            job,
            moving,
            t,
            c,
            &self.moved,
            around,
            (increment, fine.as_ref(), *below),
            pixels,
            lingering,
        )
    }
}

/// Constants of the rules about thresholds.
struct Moved<L: Lanes> {
    /// Steps x 65,536.
    threshold: L::Float,
    row: L::Word,
    /// The most by which it is off, in steps.
    sway: L::Half,
    /// The first row and the pixels of the next one, where there are no others.
    two_rows: Option<(usize, L::Mask)>,
}

impl<L: Lanes> Moved<L> {
    #[inline(always)]
    fn load(l: L, moving: &Moving, p: usize) -> Self {
        let row = l.load_words(&moving.rows, p);
        let (first, last) = (moving.rows[p], moving.rows[p + L::N - 1]);
        let two_rows = (last - first < 2).then(|| (first as usize, l.greater_w(row, l.splat_w(first))));
        Self { threshold: l.load_f(&moving.threshold, p), row, sway: l.load(&moving.sway, p), two_rows }
    }

    /// Every pixel's number of those that are given for all rows. To choose between two is faster than to look each one up.
    #[inline(always)]
    fn of_row(&self, l: L, rows: &[f32]) -> L::Float {
        let Some((first, next)) = self.two_rows else { return l.gather_f(rows, self.row) };
        let last = rows.len() - 1;
        select_f(l, next, l.splat_f(rows[last.min(first + 1)]), l.splat_f(rows[last.min(first)]))
    }
}

/// One readout of `N` pixels; returns the reported bits.
#[inline(always)]
fn readout<L: Lanes>(
    l: L,
    job: &Job<'_>,
    moving: &Moving,
    t: usize,
    c: &Constants<L>,
    moved: &Moved<L>,
    around: &Around,
    (increment, fine, below): (&Increment<L>, Option<&Fine<L>>, bool),
    pixel: &mut Pixels<L>,
    lingering: &mut Lingering<L>,
) -> L::Mask {
    // What moves is taken apart, so that nothing of it is forgotten.
    let Moving {
        leak,
        coupling,
        adaptation,
        // `optics`, `bent` and `seen` have these of the light,
        crosstalk: _,
        quadratic: _,
        peak: _,
        schedule: _,
        lag: _,
        // `dark` this of the dark current,
        telegraph: _,
        // `offsets` these of the threshold,
        row_noise: _,
        slow: _,
        droop: _,
        comparator: _,
        // and `Moved` these of the pixels.
        threshold: _,
        sway: _,
        rows: _,
    } = moving;
    if *leak != 0.0 {
        let stored = l.add_f(l.to_f(pixel.word(l)), moved.threshold);
        let lost = fixed(l, l.mul_f(stored, l.splat_f(-leak)), true);
        pixel.add_word(l, lost);
    }
    any_rules::gather_charge(l, job, t, c, increment, fine, pixel);
    if *coupling != 0.0 {
        let count = l.to_f(l.widen(l.load(&around.neighbours, c.p)));
        let given = l.mul_f(l.mul_f(count, l.splat_f(*coupling)), moved.threshold);
        pixel.add_word(l, fixed(l, given, true));
    }
    if !job.plan.tables().ceiling.is_empty() {
        pixel.charge = l.min(pixel.charge, c.ceiling);
    }
    let words = any_rules::needs_words(job);
    let fired = if moving.moves_threshold() {
        let offsets = offsets(l, job, moving, t, c, moved, around.droop, lingering);
        if words {
            any_rules::compare_words(l, job, t, c, Some(offsets), pixel)
        } else {
            any_rules::compare_moved(l, job, t, c, offsets, below, pixel)
        }
    } else if words {
        any_rules::compare_words(l, job, t, c, None, pixel)
    } else {
        any_rules::compare(l, job, t, c, below, pixel)
    };
    if job.plan.rules().lost_increment != 0.0 || moving.couples() {
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
    }
    if let Some(adaptation) = adaptation {
        let rise = select_f(l, fired, l.splat_f(adaptation.rise), l.splat_f(0.0));
        let fallen = l.mul_f(lingering.adapted, l.splat_f(adaptation.fall));
        let adapted = l.add_f(l.sub_f(lingering.adapted, fallen), rise);
        lingering.adapted = l.min_f(adapted, l.splat_f(adaptation.highest));
    }
    any_rules::flip(l, job, t, c, fired)
}

/// By how much the threshold is off, and what is compared with besides; steps x 65,536.
#[inline(always)]
fn offsets<L: Lanes>(
    l: L,
    job: &Job<'_>,
    moving: &Moving,
    t: usize,
    c: &Constants<L>,
    moved: &Moved<L>,
    droop: f32,
    lingering: &mut Lingering<L>,
) -> (L::Word, Option<L::Word>) {
    let modulation = job.batch.modulation();
    let mut offset = l.splat_f(0.0);
    if moving.row_noise != 0.0 {
        let height = moving.height();
        offset = moved.of_row(l, &modulation.rows[t * height..][..height]);
    }
    if let Some(slow) = moving.slow {
        let z = l.to_f(l.widen(l.gauss(hash(l, c.pair_keys, &modulation.slow[t]))));
        let kept = l.mul_f(lingering.slow, l.splat_f(slow.kept));
        let next = l.add_f(kept, l.mul_f(z, l.splat_f(slow.step)));
        lingering.slow = l.max_f(l.min_f(next, l.splat_f(slow.bound)), l.splat_f(-slow.bound));
        offset = l.add_f(offset, lingering.slow);
    }
    if moving.adaptation.is_some() {
        offset = l.add_f(offset, lingering.adapted);
    }
    if moving.droop != 0.0 {
        offset = l.add_f(offset, l.splat_f(droop));
    }
    let offset = fixed(l, l.mul_f(offset, moved.threshold), true);
    if moving.comparator == 0.0 {
        return (offset, None);
    }
    let z = l.to_f(l.widen(l.gauss(hash(l, c.pair_keys, &modulation.comparator[t]))));
    let only = l.mul_f(l.mul_f(z, l.splat_f(moving.comparator)), moved.threshold);
    (offset, Some(fixed(l, only, true)))
}
