//! One recording of a set: its light, and the quantities that are measured in it.

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

/// The protocol of one recording: its light and its readouts.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedScene {
    /// Path of the file.
    pub name: String,
    /// Stated light.
    pub light: Stimulus,
    /// Number of readouts that are compared with the model.
    pub readouts: usize,
    /// Number of readouts of the recording before the first compared readout.
    pub first_readout: usize,
    /// The static scene of unknown light, or `None` if the light is stated.
    pub static_scene: Option<StaticScene>,
    /// Relative standard deviation of the stated light.
    pub light_uncertainty: f64,
    /// Sources of the light.
    pub(crate) sources: Sources,
    /// Relative deviation of the found light from the stated light. The found light is the light at which simulated
    /// sensors have the measured rates.
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

    /// Returns the light of the recording as found from its rates. The statistics compare the rates at this light.
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

    /// Returns whether the halves of rows are compared. This requires many spikes under constant, stated light.
    pub(crate) fn has_row_halves(&self) -> bool {
        self.is_constant() && self.static_scene.is_none() && self.brightness() >= 0.09
    }

    /// Returns whether the light is constant and low. All intervals of such a recording are measured.
    pub(crate) fn is_dim(&self) -> bool {
        self.is_constant() && self.brightness() < MAX_INTERVAL_RATE
    }

    /// Returns the half period of a square wave in readouts. Returns `None` for other light, or if the half period
    /// is too short to measure the response to a step.
    pub(crate) fn half_period(&self) -> Option<usize> {
        let Stimulus::Scene(StimulusPattern::Square { half_period, .. }) = self.light else { return None };
        Some(half_period as usize).filter(|h| *h >= MIN_RESPONSE_HALF_PERIOD)
    }

    /// Returns which optional quantities are measured in the recording.
    pub(crate) fn scan_options(&self) -> ScanOptions {
        ScanOptions {
            with_intervals: self.is_dim(),
            with_row_halves: self.has_row_halves(),
            half_period: self.half_period(),
        }
    }
}

/// A static scene of unknown light. Its light is estimated from the rates of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticScene {
    /// Rate of every pixel, in spikes per readout.
    rates: Vec<f64>,
    /// Mean rate in the square around each pixel. It shows the scene without the fixed pattern of the pixels.
    pub(crate) surface: Vec<f64>,
    /// Indices of the pixels in uniform areas whose rates agree between both halves of the recording.
    uniform: Vec<usize>,
    /// Mean rate of the uniform pixels.
    pub(crate) mean: f64,
    /// Highest rate of a pixel.
    pub(crate) brightest: f64,
    /// Share of the pixels that changed in patches. `None` if the scene does not move.
    pub(crate) moving_share: Option<f64>,
}

impl StaticScene {
    /// Measures the scene in the first `readouts` of a recording.
    ///
    /// # Errors
    /// If the recording cannot be read, does not look like an image at its size, or has too few uniform, static pixels.
    pub(crate) fn read(reader: &StreamReader, readouts: usize) -> Result<Self> {
        // If the width, the height or the layout is wrong, the uniform areas of the scene cannot be found.
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
        // The limit of 6 % over 11x11 pixels is below the contrast of an edge, and above the spread of the pixels.
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

    /// Hashes the bits of all fields.
    pub(crate) fn hash_exactly(&self, into: &mut impl Hasher) {
        let Self { rates, surface, uniform, mean, brightest, moving_share } = self;
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        (bits(rates), bits(surface), uniform, bits(&[*mean, *brightest]), moving_share.map(f64::to_bits))
            .hash(into);
    }

    /// Returns the number of uniform pixels in a range of pixels.
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

    /// Removes all pixels from a scan except the uniform pixels.
    pub(crate) fn retain_uniform(&self, scan: &mut Scan) {
        let width = scan.geometry.width();
        scan.contrast = self.neighbor_contrast(scan, width);
        scan.pixels = self.uniform.iter().map(|p| scan.pixels[*p]).collect();
    }

    /// Returns the standard deviation of the relative difference between neighbors in a row. On a uniform surface,
    /// the fixed pattern of the camera causes these differences.
    ///
    /// The rates come from a few dozen intervals, so they are fractions of small numbers, and many pixels have the
    /// same rate. The median of the differences would jump from one fraction to the next. The result is instead
    /// computed from the mean of the differences, limited to three standard deviations. This mean does not jump,
    /// and hot pixels hardly change it.
    fn neighbor_contrast(&self, scan: &Scan, width: usize) -> f64 {
        let pairs = self.uniform.windows(2).filter(|w| w[1] == w[0] + 1 && w[1] % width != 0);
        let rate = |p: usize| scan.pixels[p].rate;
        let mut steps: Vec<f64> = pairs.map(|w| (rate(w[1]) - rate(w[0])).abs()).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let limit = 3.0 * 1.4826 * spikelane_measure::median(&mut steps);
        let mean = steps.iter().map(|step| step.min(limit)).sum::<f64>() / steps.len() as f64;
        // The mean absolute value of a standard normal variable is sqrt(2 / pi).
        (std::f64::consts::PI / 2.0).sqrt() * mean / self.mean
    }
}
