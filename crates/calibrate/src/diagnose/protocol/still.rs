//! A static scene of which only the rates are known.

use std::hash::{Hash as _, Hasher};

use crate::diagnose::recording::pixel::PixelScan;
use crate::diagnose::recording::scan::{Look, Scan, scan};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::inputs;
use spikelane_io::formats::StreamReader;
use spikelane_measure::select_uniform;

/// Radius of the neighborhood whose mean stands for the scene.
const SURFACE: usize = 2;

/// Rates of the compared pixels, in spikes per readout. Slower pixels have too few intervals, and faster pixels have
/// too few readouts per interval.
const RATES: std::ops::Range<f64> = 0.05..0.45;

/// Fewest even, static pixels.
const FEWEST: usize = 500;

/// A static scene as its own rates show it.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticScene {
    /// Rate of every pixel, in spikes per readout.
    rates: Vec<f64>,
    /// Means of the pixels around each: the scene without the pixels' own pattern.
    pub(in crate::diagnose) surface: Vec<f64>,
    /// Pixels in even surroundings whose halves agree.
    even: Vec<usize>,
    /// Mean rate of those.
    pub(in crate::diagnose) mean: f64,
    /// Highest rate.
    pub(in crate::diagnose) brightest: f64,
    /// Share of the pixels that changed in patches, where the scene moved.
    pub(in crate::diagnose) moved: Option<f64>,
}

impl StaticScene {
    /// Measures the scene in the first `readouts` of a recording.
    ///
    /// # Errors
    /// If the recording cannot be read, does not look like an image at its size, or has too few uniform, static pixels.
    pub(in crate::diagnose) fn of(reader: &StreamReader, readouts: usize) -> Result<Self> {
        // The uniform areas of a scene are unknown until its width, height and layout are right.
        if let Some(warning) = reader.layout_guesses()?.warning() {
            return Err(Error::new(ErrorKind::Input, reader.name())
                .found(format_args!("a wrong size or layout ({warning})")));
        }
        let geometry = reader.geometry();
        let mut bytes = inputs::zeroed_vec(reader.name(), readouts * geometry.frame_bytes())?;
        reader.read_frames(0, &mut bytes)?;
        let scan = scan(SpikeFramesRef::new(geometry, &bytes)?, Look::default())?;
        let rates: Vec<f64> = scan.pixels.iter().map(|p| p.rate).collect();
        let half = |p: &PixelScan, late: bool| -> u32 {
            let (a, b) = p.blocks.split_at(p.blocks.len() / 2);
            if late { b.iter().sum() } else { a.iter().sum() }
        };
        let steady = |p: &usize| half(&scan.pixels[*p], false).abs_diff(half(&scan.pixels[*p], true)) <= 2;
        // Within 6 % over 11x11 pixels: less than any edge, more than the pixels' own spread.
        let even = select_uniform(&rates, geometry.width(), &RATES, 5, 0.06);
        let even: Vec<usize> = even.into_iter().filter(steady).collect();
        if even.len() < FEWEST {
            return Err(Error::new(ErrorKind::Input, reader.name())
                .found(format_args!(
                    "{} static pixels of uniform areas with rates from {} to {} (mean rate of all pixels: {:.4})",
                    even.len(),
                    RATES.start,
                    RATES.end,
                    rates.iter().sum::<f64>() / rates.len() as f64
                ))
                .expected(format_args!("at least {FEWEST}"))
                .remedy("record a uniform surface that does not move, at rates within this range"));
        }
        let mean = even.iter().map(|p| rates[*p]).sum::<f64>() / even.len() as f64;
        let brightest = rates.iter().copied().fold(0.0, f64::max);
        let surface = spikelane_measure::box_means(&rates, geometry.width(), SURFACE);
        let found = scan.motion(readouts);
        let moved = found.is_moving.then_some(found.moving_share);
        Ok(Self { rates, surface, even, mean, brightest, moved })
    }

    /// All of it, to the bit.
    pub(in crate::diagnose) fn hash_exactly(&self, into: &mut impl Hasher) {
        let Self { rates, surface, even, mean, brightest, moved } = self;
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        (bits(rates), bits(surface), even, bits(&[*mean, *brightest]), moved.map(f64::to_bits)).hash(into);
    }

    /// Even pixels within a range of pixels.
    pub(in crate::diagnose) fn even_in(&self, pixels: std::ops::Range<usize>) -> usize {
        self.even.iter().filter(|p| pixels.contains(p)).count()
    }

    /// Keeps a range of pixels.
    pub(in crate::diagnose) fn cut(&mut self, pixels: std::ops::Range<usize>) {
        self.rates = self.rates[pixels.clone()].to_vec();
        self.surface = self.surface[pixels.clone()].to_vec();
        self.even.retain(|p| pixels.contains(p));
        self.even.iter_mut().for_each(|p| *p -= pixels.start);
        self.mean = self.even.iter().map(|p| self.rates[*p]).sum::<f64>() / self.even.len().max(1) as f64;
        self.brightest = self.rates.iter().copied().fold(0.0, f64::max);
    }

    /// Leaves only the even pixels in a scan.
    pub(in crate::diagnose) fn keep(&self, scan: &mut Scan) {
        let width = scan.geometry.width();
        scan.contrast = self.contrast(scan, width);
        scan.pixels = self.even.iter().map(|p| scan.pixels[*p]).collect();
    }

    /// Deviation of a pixel's rate from that of the one to its right, relative: on an even surface the camera's own pattern.
    ///
    /// Rates of a few dozen intervals are fractions with small numbers, and many pixels share one. A median of their steps jumps from
    /// one fraction to the next. The mean of steps that are cut at three deviations does not, and hot pixels hardly move it.
    fn contrast(&self, scan: &Scan, width: usize) -> f64 {
        let pairs = self.even.windows(2).filter(|w| w[1] == w[0] + 1 && w[1] % width != 0);
        let rate = |p: usize| scan.pixels[p].rate;
        let mut steps: Vec<f64> = pairs.map(|w| (rate(w[1]) - rate(w[0])).abs()).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let most = 3.0 * 1.4826 * spikelane_measure::median(&mut steps);
        let mean = steps.iter().map(|step| step.min(most)).sum::<f64>() / steps.len() as f64;
        // The mean of the size of a normal number is sqrt(2 / pi).
        (std::f64::consts::PI / 2.0).sqrt() * mean / self.mean
    }
}
