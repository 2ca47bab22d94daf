//! What pixels do together in a recording: whole readouts, rows and neighbors.

use std::ops::Range;

use super::bits::{PixelBits, coincidences, word_at};
use super::pixel::PixelScan;
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::kernels::dispatch;
use spikelane::unstable::threads;

/// Spikes of each readout, and bits that changed from one to the next.
pub(in crate::diagnose) fn totals(frames: SpikeFramesRef<'_>) -> [Vec<u32>; 2] {
    dispatch(
        #[inline(always)]
        || {
            let bytes = frames.geometry().frame_bytes();
            let (mut totals, mut changes) = (vec![0; frames.readouts()], vec![0; frames.readouts()]);
            // The first frame stands before itself: a change that is none.
            let mut before = &frames.as_bytes()[..bytes.min(frames.as_bytes().len())];
            let places = totals.iter_mut().zip(&mut changes);
            for (frame, (total, change)) in frames.as_bytes().chunks_exact(bytes).zip(places) {
                [*total, *change] = counted(before, frame);
                before = frame;
            }
            changes.drain(..changes.len().min(1));
            [totals, changes]
        },
    )
}

/// Spikes of the second frame, and its bits that differ from the first.
#[inline(always)]
fn counted(before: &[u8], frame: &[u8]) -> [u32; 2] {
    let (a, b) = (before.as_chunks::<8>().0, frame.as_chunks::<8>().0);
    let (mut total, mut change) = (0, 0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (u64::from_le_bytes(*a), u64::from_le_bytes(*b));
        total += u64::from(b.count_ones());
        change += u64::from((a ^ b).count_ones());
    }
    let (a, b) = (word_at(before, 8 * a.len()), word_at(frame, 8 * b.len()));
    [total as u32 + b.count_ones(), change as u32 + (a ^ b).count_ones()]
}

/// Rows gain or lose together: `(var(l + r) - var(l - r)) / 4` over readouts, mean over rows.
pub(in crate::diagnose) fn row_halves(bits: &PixelBits) -> f64 {
    if bits.geometry.width() < 4 || bits.readouts < 2 {
        return 0.0;
    }
    let of_row = |row: usize| {
        dispatch(
            #[inline(always)]
            || halves_of_row(bits, row),
        )
    };
    // Summed in order: a sum of parts would depend on who took which.
    let rows: Vec<f64> = threads::map(0..bits.geometry.height(), of_row);
    rows.iter().sum::<f64>() / bits.geometry.height() as f64
}

/// Words that are taken side by side.
const WIDE: usize = 8;

/// Binary digits of the largest number of pixels in half a row.
const DIGITS: usize = 28;

/// How many pixels of a half row fired, in binary, at each of `64 * WIDE` readouts: for every digit a word of bits.
type Digits = [[u64; WIDE]];

/// The numbers of the spikes of `pixels` from word `w` on.
#[inline(always)]
fn add_up(bits: &PixelBits, pixels: Range<usize>, w: usize, number: &mut Digits) {
    number.fill([0; WIDE]);
    for p in pixels {
        let words = &bits.pixel(p)[w..];
        let mut carry = [0; WIDE];
        match words.first_chunk::<WIDE>() {
            Some(whole) => carry = *whole,
            None => carry[..words.len()].copy_from_slice(words),
        }
        for digit in number.iter_mut() {
            for i in 0..WIDE {
                let both = digit[i] & carry[i];
                digit[i] ^= carry[i];
                carry[i] = both;
            }
        }
    }
}

/// Adds the products of two numbers to `sums`.
#[inline(always)]
fn add_products(a: &Digits, b: &Digits, sums: &mut [u64; WIDE]) {
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            for k in 0..WIDE {
                sums[k] += u64::from((a[k] & b[k]).count_ones()) << (i + j);
            }
        }
    }
}

/// The correlation of the halves of one row.
#[inline(always)]
fn halves_of_row(bits: &PixelBits, row: usize) -> f64 {
    let (width, n) = (bits.geometry.width(), bits.readouts as f64);
    let (start, middle, end) = (row * width, row * width + width / 2, (row + 1) * width);
    let mut room = [[[0; WIDE]; DIGITS]; 2];
    let [l, r] = room.each_mut().map(|number| &mut number[..=(end - middle).ilog2() as usize]);
    let [mut l1, mut r1, mut lr, mut l2, mut r2] = [[0; WIDE]; 5];
    for w in (0..bits.words).step_by(WIDE) {
        add_up(bits, start..middle, w, l);
        add_up(bits, middle..end, w, r);
        add_products(l, &[[!0; WIDE]], &mut l1);
        add_products(r, &[[!0; WIDE]], &mut r1);
        add_products(l, r, &mut lr);
        add_products(l, l, &mut l2);
        add_products(r, r, &mut r2);
    }
    let mean = |sums: &[u64; WIDE]| sums.iter().sum::<u64>() as f64 / n;
    let (l1, r1, lr) = (mean(&l1), mean(&r1), mean(&lr));
    let scale = ((mean(&l2) - l1 * l1) * (mean(&r2) - r1 * r1)).sqrt();
    if scale > 0.0 { (lr - l1 * r1) / scale } else { 0.0 }
}

pub(in crate::diagnose) fn neighbors(bits: &PixelBits, pixels: &[PixelScan]) -> [f64; 4] {
    let of_row = |row: usize| {
        dispatch(
            #[inline(always)]
            || neighbors_of_row(bits, pixels, row),
        )
    };
    let rows: Vec<[[f64; 2]; 4]> = threads::map(0..bits.geometry.height(), of_row);
    std::array::from_fn(|k| {
        let sum = |i: usize| rows.iter().map(|r| r[k][i]).sum::<f64>();
        let (found, chance) = (sum(0), sum(1));
        if chance > 0.0 { found / chance - 1.0 } else { 0.0 }
    })
}

/// Coincidences found and expected by chance: beside and below at lag 0, then at lag 1.
#[inline(always)]
fn neighbors_of_row(bits: &PixelBits, pixels: &[PixelScan], row: usize) -> [[f64; 2]; 4] {
    let (width, n) = (bits.geometry.width(), pixels.len());
    let mut sums = [[0.0; 2]; 4];
    // Half of the pairs, like the squares of one color.
    for p in (row * width + row % 2..(row + 1) * width).step_by(2) {
        let others = [(p % width + 1 < width, p + 1), (p + width < n, p + width)];
        for (k, (inside, q)) in others.into_iter().enumerate() {
            if !inside {
                continue;
            }
            let chance = f64::from(pixels[p].count) * f64::from(pixels[q].count) / bits.readouts as f64;
            let [same, late] = coincidences(bits.pixel(p), bits.pixel(q));
            sums[k][0] += same as f64;
            sums[k][1] += chance;
            sums[k + 2][0] += late as f64;
            sums[k + 2][1] += 2.0 * chance;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::{Geometry, bit, set_bit};

    /// Readouts that are no whole number of words, rows and frames that are none of bytes.
    fn recording(geometry: Geometry) -> Vec<u8> {
        let mut bytes = vec![0; 700 * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            let fires = |p: &usize| (p * 2_654_435 + t * t * 40_503 + t * p) % 7 < 1 + t % 4;
            (0..geometry.pixels()).filter(fires).for_each(|p| set_bit(frame, p));
        }
        bytes
    }

    #[test]
    fn words_of_bits_say_what_a_visit_of_each_bit_says() {
        let geometry = Geometry::new(13, 11).unwrap();
        let bytes = recording(geometry);
        let frames = SpikeFramesRef::new(geometry, &bytes).unwrap();
        let [found, changes] = totals(frames);
        let on = |t: usize, p: usize| bit(frames.frame(t).as_bytes(), p);
        let bits = PixelBits::new(frames).unwrap();
        for t in 0..700 {
            assert_eq!(found[t] as usize, (0..143).filter(|p| on(t, *p)).count());
            let changed = |t: usize| (0..143).filter(|p| on(t - 1, *p) != on(t, *p)).count();
            assert!(t == 0 || changes[t - 1] as usize == changed(t));
        }
        assert_eq!(changes.len(), 699);
        let both =
            |p: usize, q: usize, lag: usize| (lag..700).filter(|t| on(t - lag, p) && on(*t, q)).count();
        for (p, q) in [(0, 1), (17, 30), (141, 142)] {
            let wanted = [both(p, q, 0), both(p, q, 1) + both(q, p, 1)];
            assert_eq!(coincidences(bits.pixel(p), bits.pixel(q)).map(|n| n as usize), wanted);
        }
        let half = |t: usize, row: usize, from: usize, to: usize| {
            (from..to).filter(|c| on(t, 13 * row + c)).count() as f64
        };
        let correlation = |row: usize| {
            let mean = |f: &dyn Fn(f64, f64) -> f64| {
                (0..700).map(|t| f(half(t, row, 0, 6), half(t, row, 6, 13))).sum::<f64>() / 700.0
            };
            let (l, r) = (mean(&|l, _| l), mean(&|_, r| r));
            let scale = ((mean(&|l, _| l * l) - l * l) * (mean(&|_, r| r * r) - r * r)).sqrt();
            if scale > 0.0 { (mean(&|l, r| l * r) - l * r) / scale } else { 0.0 }
        };
        assert_eq!(row_halves(&bits), (0..11).map(correlation).sum::<f64>() / 11.0);
    }
}
