//! One recording of a set: its light and the quantities that are measured in it.

use std::hash::{Hash as _, Hasher};

use crate::recordings::scan::{PixelScan, Scan, ScanOptions, scan};
use crate::thresholds::{
    COMPARED_RATES, MAX_INTERVAL_RATE, MIN_RESPONSE_HALF_PERIOD, MIN_UNIFORM_PIXELS, SURFACE_RADIUS,
};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::inputs;
use spikelane_calibrate::unstable::Sources;
use spikelane_calibrate::{Stimulus, StimulusPattern};
use spikelane_io::formats::StreamReader;
use spikelane_measure::select_uniform;

/// The protocol of one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedScene {
    /// Path of the file.
    pub name: String,
    /// Stated light.
    pub light: Stimulus,
    /// Number of judged readouts.
    pub readouts: usize,
    /// Number of earlier readouts of the same recording.
    pub first_readout: usize,
    /// The static scene under unknown light, if the recording shows one.
    pub static_scene: Option<StaticScene>,
    /// Relative standard deviation of the stated light.
    pub light_uncertainty: f64,
    /// Sources of the light.
    pub(crate) sources: Sources,
    /// Relative deviation of the found light from the stated light. Sensors are simulated at the found light.
    pub light_offset: f64,
}

impl RecordedScene {
    /// Returns the last component of the path.
    pub(crate) fn file_name(&self) -> String {
        let last = std::path::Path::new(&self.name).file_name();
        last.map_or_else(|| self.name.clone(), |name| name.to_string_lossy().into_owned())
    }

    /// Returns the stated light in words.
    pub(crate) fn light_description(&self) -> String {
        match self.light {
            Stimulus::Level(0.0) => "dark".to_owned(),
            Stimulus::Level(level) => format!("{level}"),
            Stimulus::Scene(StimulusPattern::Square { high, low, half_period }) => {
                format!("{high} and {low} alternating, {half_period} readouts each")
            }
            Stimulus::Scene(StimulusPattern::Checkerboard { high, low, cell }) => {
                format!("squares of {cell} pixels, {high} and {low}")
            }
            _ => "a static scene of unknown light".to_owned(),
        }
    }

    /// Returns the level of uniform light, or `None` for other light.
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        self.light.level()
    }

    /// Returns the found light, with which the statistics compare the rates.
    pub(crate) fn found_light(&self) -> Stimulus {
        self.light.scale(1.0 + self.light_offset)
    }

    /// Returns whether the light is constant over time.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        !matches!(self.light, Stimulus::Scene(StimulusPattern::Square { .. }))
    }

    /// Returns the mean light.
    #[must_use]
    pub fn brightness(&self) -> f64 {
        match self.light {
            Stimulus::Level(level) => level,
            Stimulus::Scene(
                StimulusPattern::Square { high, low, .. } | StimulusPattern::Checkerboard { high, low, .. },
            ) => 0.5 * (high + low),
            _ => self.static_scene.as_ref().map_or(0.0, |s| s.mean),
        }
    }

    /// Returns the brightest light.
    pub(crate) fn max_light(&self) -> f64 {
        match self.light {
            Stimulus::Scene(
                StimulusPattern::Square { high, low, .. } | StimulusPattern::Checkerboard { high, low, .. },
            ) => high.max(low),
            _ => self.static_scene.as_ref().map_or(self.brightness(), |s| s.brightest),
        }
    }

    /// Returns whether the halves of rows are compared, which requires many spikes under constant light.
    pub(crate) fn has_row_halves(&self) -> bool {
        self.is_constant() && self.static_scene.is_none() && self.brightness() >= 0.09
    }

    /// Returns whether the light is constant and so low that all intervals are measured.
    pub(crate) fn is_dim(&self) -> bool {
        self.is_constant() && self.brightness() < MAX_INTERVAL_RATE
    }

    /// Returns the half period of a square wave in readouts, if it is long enough for the response to a step.
    pub(crate) fn half_period(&self) -> Option<usize> {
        let Stimulus::Scene(StimulusPattern::Square { half_period, .. }) = self.light else { return None };
        Some(half_period as usize).filter(|h| *h >= MIN_RESPONSE_HALF_PERIOD)
    }

    /// Returns the quantities that are measured in the recording.
    pub(crate) fn scan_options(&self) -> ScanOptions {
        ScanOptions {
            with_intervals: self.is_dim(),
            with_row_halves: self.has_row_halves(),
            half_period: self.half_period(),
        }
    }
}

/// A static scene under unknown light, as the rates of a recording show it.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticScene {
    /// Rate of every pixel, in spikes per readout.
    rates: Vec<f64>,
    /// Mean rates around each pixel: the scene without the fixed pattern of the pixels.
    pub(crate) surface: Vec<f64>,
    /// Pixels in uniform areas whose rates in both halves of the recording agree.
    uniform: Vec<usize>,
    /// Mean rate of the uniform pixels.
    pub(crate) mean: f64,
    /// Highest rate of a pixel.
    pub(crate) brightest: f64,
    /// Share of the pixels that changed in patches, if the scene moves.
    pub(crate) moving_share: Option<f64>,
}

impl StaticScene {
    /// Measures the scene in the first `readouts` of a recording.
    ///
    /// # Errors
    /// If the recording cannot be read, does not look like an image at its size, or has too few uniform, static pixels.
    pub(crate) fn read(reader: &StreamReader, readouts: usize) -> Result<Self> {
        // The uniform areas of a scene are unknown until its width, height and layout are right.
        if let Some(warning) = reader.layout_guesses()?.warning() {
            return Err(Error::new(ErrorKind::Input, reader.name())
                .found(format_args!("a wrong size or layout ({warning})")));
        }
        let geometry = reader.geometry();
        let mut bytes = inputs::zeroed_vec(reader.name(), readouts * geometry.frame_bytes())?;
        reader.read_frames(0, &mut bytes)?;
        let scan = scan(SpikeFramesRef::new(geometry, &bytes)?, ScanOptions::default())?;
        let rates: Vec<f64> = scan.pixels.iter().map(|p| p.rate).collect();
        let half = |p: &PixelScan, late: bool| -> u32 {
            let (a, b) = p.blocks.split_at(p.blocks.len() / 2);
            if late { b.iter().sum() } else { a.iter().sum() }
        };
        let is_static = |p: &usize| half(&scan.pixels[*p], false).abs_diff(half(&scan.pixels[*p], true)) <= 2;
        // A limit of 6 % over 11x11 pixels is below the contrast of an edge and above the spread of the pixels.
        let uniform = select_uniform(&rates, geometry.width(), &COMPARED_RATES, 5, 0.06);
        let uniform: Vec<usize> = uniform.into_iter().filter(is_static).collect();
        if uniform.len() < MIN_UNIFORM_PIXELS {
            return Err(Error::new(ErrorKind::Input, reader.name())
                .found(format_args!(
                    "{} static pixels of uniform areas with rates from {} to {} (mean rate of all pixels: {:.4})",
                    uniform.len(),
                    COMPARED_RATES.start,
                    COMPARED_RATES.end,
                    rates.iter().sum::<f64>() / rates.len() as f64
                ))
                .expected(format_args!("at least {MIN_UNIFORM_PIXELS}"))
                .remedy("record a uniform surface that does not move, at rates within this range"));
        }
        let mean = uniform.iter().map(|p| rates[*p]).sum::<f64>() / uniform.len() as f64;
        let brightest = rates.iter().copied().fold(0.0, f64::max);
        let surface = spikelane_measure::box_means(&rates, geometry.width(), SURFACE_RADIUS);
        let motion = scan.motion(readouts);
        let moving_share = motion.is_moving.then_some(motion.moving_share);
        Ok(Self { rates, surface, uniform, mean, brightest, moving_share })
    }

    /// Hashes all fields exactly.
    pub(crate) fn hash_exactly(&self, into: &mut impl Hasher) {
        let Self { rates, surface, uniform, mean, brightest, moving_share } = self;
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        (bits(rates), bits(surface), uniform, bits(&[*mean, *brightest]), moving_share.map(f64::to_bits))
            .hash(into);
    }

    /// Counts the uniform pixels in a range of pixels.
    pub(crate) fn uniform_in(&self, pixels: std::ops::Range<usize>) -> usize {
        self.uniform.iter().filter(|p| pixels.contains(p)).count()
    }

    /// Reduces the scene to a range of pixels.
    pub(crate) fn cut(&mut self, pixels: std::ops::Range<usize>) {
        self.rates = self.rates[pixels.clone()].to_vec();
        self.surface = self.surface[pixels.clone()].to_vec();
        self.uniform.retain(|p| pixels.contains(p));
        self.uniform.iter_mut().for_each(|p| *p -= pixels.start);
        self.mean =
            self.uniform.iter().map(|p| self.rates[*p]).sum::<f64>() / self.uniform.len().max(1) as f64;
        self.brightest = self.rates.iter().copied().fold(0.0, f64::max);
    }

    /// Reduces a scan to the uniform pixels.
    pub(crate) fn retain_uniform(&self, scan: &mut Scan) {
        let width = scan.geometry.width();
        scan.contrast = self.neighbor_contrast(scan, width);
        scan.pixels = self.uniform.iter().map(|p| scan.pixels[*p]).collect();
    }

    /// Returns the standard deviation of the relative difference between neighbors in a row. On a uniform surface, the
    /// differences are the fixed pattern of the camera.
    ///
    /// Rates of a few dozen intervals are fractions with small numbers, and many pixels share one. A median of the
    /// differences jumps from one fraction to the next. The mean of differences that are cut at three deviations does
    /// not jump, and hot pixels hardly move it.
    fn neighbor_contrast(&self, scan: &Scan, width: usize) -> f64 {
        let pairs = self.uniform.windows(2).filter(|w| w[1] == w[0] + 1 && w[1] % width != 0);
        let rate = |p: usize| scan.pixels[p].rate;
        let mut steps: Vec<f64> = pairs.map(|w| (rate(w[1]) - rate(w[0])).abs()).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let limit = 3.0 * 1.4826 * spikelane_measure::median(&mut steps);
        let mean = steps.iter().map(|step| step.min(limit)).sum::<f64>() / steps.len() as f64;
        // The mean of the size of a normal number is sqrt(2 / pi).
        (std::f64::consts::PI / 2.0).sqrt() * mean / self.mean
    }
}
