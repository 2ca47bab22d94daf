//! A recording turned round: one row of bits for every pixel.
//!
//! All statistics along time are then operations on whole words.

use super::pixel::PixelScan;
use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::inputs;
use spikelane::unstable::kernels::{BitOps, I16Lanes, Task, dispatch_task};
use spikelane::unstable::threads;

/// Runs of pixels that are looked at side by side. A fixed number: sums of parts depend on where they are cut.
pub(in crate::diagnose) const BANDS: usize = 8;

/// The bits of a recording by pixel: bit `t % 64` of word `t / 64` of a pixel is its readout `t`.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct PixelBits {
    pub geometry: Geometry,
    pub readouts: usize,
    /// Words of a pixel.
    pub words: usize,
    data: Vec<u64>,
}

/// Groups of 64 pixels that are turned together: a cache line of every frame holds as many.
const GROUPS: usize = 8;

impl PixelBits {
    /// # Errors
    /// [`Kind::Memory`](spikelane::Kind::Memory) when the system has no memory for the bits, or for a scan of them.
    pub(crate) fn new(frames: SpikeFramesRef<'_>) -> Result<Self> {
        let geometry = frames.geometry();
        let readouts = frames.readouts();
        let words = readouts.div_ceil(64);
        let groups = geometry.pixels().div_ceil(64);
        let mut data = inputs::zeroed_vec(
            format_args!("{readouts} readouts of {geometry} pixels"),
            groups * 64 * words,
        )?;
        // The scan of all pixels, once by band and once joined, and four maps.
        let per_pixel = 2 * size_of::<PixelScan>() + 4 * size_of::<f64>();
        inputs::check_memory(format_args!("scan of {geometry} pixels"), per_pixel * geometry.pixels())?;
        let turn = |(i, pixels): (usize, &mut [u64])| {
            dispatch_task(Turning { frames, first: i * GROUPS, words, pixels });
        };
        let parts: Vec<_> = data.chunks_mut(GROUPS * 64 * words.max(1)).enumerate().collect();
        threads::map(parts, turn);
        Ok(Self { geometry, readouts, words, data })
    }

    pub(crate) fn pixel(&self, p: usize) -> &[u64] {
        &self.data[p * self.words..(p + 1) * self.words]
    }
}

/// The bits of some groups of 64 pixels from the `first` on, on their way to `words` words of each.
struct Turning<'a> {
    frames: SpikeFramesRef<'a>,
    first: usize,
    words: usize,
    pixels: &'a mut [u64],
}

impl Task for Turning<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) {
        let bytes = self.frames.geometry().frame_bytes();
        let mut block = [0u64; 64];
        for (w, frames) in self.frames.as_bytes().chunks(64 * bytes).enumerate() {
            for (group, pixels) in self.pixels.chunks_exact_mut(64 * self.words).enumerate() {
                let at = 8 * (self.first + group);
                // Behind the last readout there is nothing.
                block[frames.len() / bytes..].fill(0);
                for (word, frame) in block.iter_mut().zip(frames.chunks_exact(bytes)) {
                    *word = word_at(frame, at);
                }
                b.transpose(&mut block);
                for (pixel, word) in pixels.chunks_exact_mut(self.words).zip(&block) {
                    pixel[w] = *word;
                }
            }
        }
    }
}

/// Eight bytes from `at`, zeros behind the end.
#[inline(always)]
pub(in crate::diagnose) fn word_at(bytes: &[u8], at: usize) -> u64 {
    match bytes.get(at..).and_then(|rest| rest.first_chunk::<8>()) {
        Some(whole) => u64::from_le_bytes(*whole),
        None => {
            let rest = bytes.get(at..).unwrap_or(&[]);
            rest.iter().enumerate().fold(0, |word, (i, b)| word | u64::from(*b) << (8 * i))
        }
    }
}

/// Spikes in blocks of time that end at `ends`, which rise.
#[inline(always)]
pub(in crate::diagnose) fn count_blocks<const N: usize>(words: &[u64], ends: &[usize; N]) -> [u32; N] {
    let (mut word, mut before, mut total) = (0, 0, 0);
    let mut counts = [0; N];
    // No `map`: its closure would be a call, without the instruction that counts.
    for (count, end) in counts.iter_mut().zip(ends) {
        while word < end / 64 {
            total += words[word].count_ones();
            word += 1;
        }
        let rest = if end % 64 == 0 { 0 } else { (words[word] & ((1 << (end % 64)) - 1)).count_ones() };
        *count = total + rest - before;
        before = total + rest;
    }
    counts
}

/// Spikes in a stretch of time.
#[inline(always)]
pub(in crate::diagnose) fn count_between(words: &[u64], from: usize, to: usize) -> u32 {
    count_blocks(words, &[from, to])[1]
}

/// Readouts at which both pixels fired, and at which one fired a readout after the other.
#[inline(always)]
pub(in crate::diagnose) fn coincidences(a: &[u64], b: &[u64]) -> [u64; 2] {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let both = |a: u64, b: u64| u64::from((a & b).count_ones());
    let (mut same, mut late) = (0, 0);
    if let ([a, ..], [b, ..]) = (a, b) {
        same += both(*a, *b);
        late += both(a << 1, *b) + both(b << 1, *a);
    }
    // Bits come from the word before, not from one sum to the next: eight words are taken at once then.
    for i in 1..n {
        same += both(a[i], b[i]);
        late += both(a[i] << 1 | a[i - 1] >> 63, b[i]) + both(b[i] << 1 | b[i - 1] >> 63, a[i]);
    }
    [same, late]
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::{bit, set_bit};

    #[test]
    fn every_bit_of_a_recording_is_found_under_its_pixel() {
        let geometry = Geometry::new(13, 11).unwrap();
        let readouts = 150;
        let mut bytes = vec![0; readouts * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            (0..geometry.pixels()).filter(|p| (p * 7 + t * t) % 5 == 0).for_each(|p| set_bit(frame, p));
        }
        let turned = PixelBits::new(SpikeFramesRef::new(geometry, &bytes).unwrap()).unwrap();
        for (t, frame) in bytes.chunks_exact(geometry.frame_bytes()).enumerate() {
            for p in 0..geometry.pixels() {
                let found = turned.pixel(p)[t / 64] >> (t % 64) & 1 != 0;
                assert_eq!(found, bit(frame, p), "pixel {p}, readout {t}");
            }
        }
        let early =
            |p: usize| bytes.chunks_exact(geometry.frame_bytes()).take(70).filter(|f| bit(f, p)).count();
        assert!((0..143).all(|p| count_blocks(turned.pixel(p), &[70])[0] as usize == early(p)));
    }
}
