//! Measurements of a recording set: for each uniform level, the data of each pixel.

use super::color_filters::{ColorFilters, PixelClasses};
use super::light_unit::SATURATION_RATE;
use super::recorded_camera::RecordedCamera;
use super::sources::Sources;
use crate::formulas::robust::{regular_weights, standardize};
use spikelane::sensor::Mosaic;
use spikelane::spikes::{Geometry, span_rate};
use spikelane_measure::{Estimate, detect_mosaic, finite_values, median};

/// Smallest number of spikes from which a rate is computed from spike times. Two spikes form one interval.
///
/// A larger minimum would bias slow pixels. Consider a pixel that fires 2.5 times on average. With a minimum of three
/// spikes, its rate would be computed from the count whenever it fires twice. Its mean rate would be a tenth too low.
pub(crate) const MIN_TIMED_SPIKES: u32 = 2;

/// Highest rate of a pixel whose interval variance is used, in spikes per readout.
pub(crate) const MAX_GROWTH_RATE: f64 = 0.2;

/// Smallest number of pixels whose interval noise is standardized together.
const MIN_GROUP_PIXELS: usize = 200;
/// Largest number of groups of pixels with similar numbers of spikes.
const MAX_SPIKE_GROUPS: usize = 10;

/// Phase variance of every pixel at one light level. The variance of a span of `n` intervals is `n` times the variance
/// per spike, plus the end variance.
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalNoise {
    /// Variance per spike of each pixel, in squared thresholds of this pixel. NaN if the pixel has too few intervals, or
    /// an interval that noise cannot explain, such as an interval that a false spike divides.
    pub map: Vec<f64>,
    /// Variance that both ends of a span contribute, in readouts squared. It is NaN where `map` is NaN.
    pub end_variance: Vec<f64>,
    /// Lags in intervals. The map was fitted to the variances at these lags.
    pub lags: Vec<u32>,
}

/// Strongest oscillation of the light during a recording.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Flicker {
    /// Frequency in hertz.
    pub frequency_hz: f64,
    /// Amplitude of the oscillation, divided by the mean light. In a dark recording, it is divided by the mean rate.
    pub depth: f64,
}

/// Whether the change of the light during a recording was removed from the rates and intervals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ChangeRemoval {
    /// No frame totals show the course of the light.
    #[default]
    Unknown,
    /// The frame totals show that the light changes by a negligible amount.
    Negligible,
    /// Rates and intervals are measured by the integrated light.
    Removed,
    /// The light changes, but the frame totals do not show its course.
    Impossible,
}

/// Measurements at one uniform light level. Maps are row-major, with one entry per pixel.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LightLevel {
    /// File name of the recording.
    pub name: String,
    /// Light level. Light 1 causes one spike per readout.
    pub light: f64,
    /// Relative standard deviation of the light, if the set states it.
    pub light_uncertainty: Option<f64>,
    /// Sources of the light.
    pub(crate) sources: Sources,
    /// Number of readouts. It is 0 for a rate map of unknown length.
    pub readouts: u32,
    /// Number of spikes of each pixel.
    pub spikes: Vec<u32>,
    /// Rate of each pixel in spikes per readout, computed from spike times. For a pixel with fewer than two spikes, it
    /// is computed from the spike count.
    pub rate: Vec<f64>,
    /// Share of the pixels whose spike counts differ between the halves of the recording by more than a static scene
    /// allows.
    pub drifting_share: f64,
    /// Change of the mean rate of all pixels between the first and the second half of the recording, divided by the
    /// mean rate. `None` if unknown.
    pub rate_change: Option<Estimate>,
    /// Distance of the mean start phase of the pixels from one half, in spikes. It is 0 for independent start phases, and
    /// at most 0.5, if all pixels start empty or full.
    pub start_offset: f64,
    /// Strongest oscillation of the light. `None` if there is none, or if it is unknown.
    pub flicker: Option<Flicker>,
    pub(crate) change_removal: ChangeRemoval,
    /// Largest variance per spike that the removed change of the light would cause, in squared thresholds.
    pub(crate) removed_variance: f64,
    /// Phase noise per spike. It is measured only for dim levels.
    pub interval_noise: Option<IntervalNoise>,
}

impl LightLevel {
    /// Creates a level from three values of each pixel: the spike count, the first spike and the last spike. `first` and
    /// `last` contain readout numbers, or `u32::MAX` for a pixel without spikes.
    ///
    /// # Examples
    /// ```
    /// use spikelane_calibrate::LightLevel;
    /// // Pixel 0 fires three times in the readouts 10 to 30, and pixel 1 never fires.
    /// let level = LightLevel::from_counts("flat.dat", 0.1, 100, vec![3, 0], &[10, u32::MAX], &[30, u32::MAX]);
    /// assert_eq!(level.rate, [0.1, 0.0]);
    /// ```
    #[must_use]
    pub fn from_counts(
        name: &str,
        light: f64,
        readouts: u32,
        count: Vec<u32>,
        first: &[u32],
        last: &[u32],
    ) -> Self {
        let counted = |p: usize| f64::from(count[p]) / f64::from(readouts);
        let rate = |p: usize| span_rate(count[p], first[p], last[p]).unwrap_or_else(|| counted(p));
        let rate: Vec<f64> = (0..count.len()).map(rate).collect();
        // The product of the rate and the time of the first spike is the part of a cycle that was left at the start.
        let fired = (0..count.len()).filter(|p| count[*p] >= MIN_TIMED_SPIKES);
        let left: Vec<f64> = fired.map(|p| (rate[p] * (f64::from(first[p]) + 0.5)).min(1.0)).collect();
        let mean = left.iter().sum::<f64>() / left.len() as f64;
        let start_offset = if left.is_empty() { 0.5 } else { (mean - 0.5).abs().min(0.5) };
        Self {
            name: name.to_owned(),
            light,
            light_uncertainty: None,
            sources: Sources::default(),
            readouts,
            spikes: count,
            rate,
            drifting_share: 0.0,
            rate_change: None,
            start_offset,
            flicker: None,
            change_removal: ChangeRemoval::Unknown,
            removed_variance: 0.0,
            interval_noise: None,
        }
    }

    /// Creates a level from known rates.
    #[must_use]
    pub fn from_rates(name: &str, light: f64, readouts: u32, spikes: Vec<u32>, rate: Vec<f64>) -> Self {
        let nowhere = vec![0; spikes.len()];
        Self { rate, ..Self::from_counts(name, light, readouts, spikes, &nowhere, &nowhere) }
    }

    /// Returns the median rate of each class of pixels in spikes per readout. It is NaN for a class without pixels. The
    /// median of a sensor with a mosaic of filters is between the classes, and it is not a linear function of the light.
    /// The median of one class is.
    pub(crate) fn class_median_rates(&self, classes: &PixelClasses) -> Vec<f64> {
        let mut rates = vec![Vec::new(); classes.count()];
        for (p, rate) in self.rate.iter().enumerate().filter(|(_, rate)| rate.is_finite()) {
            rates[classes.class(p)].push(*rate);
        }
        rates.iter_mut().map(|rates| median(rates)).collect()
    }

    /// Returns the mean over the classes of pixels of their median rates. It is a linear function of the light. Returns 1,
    /// the rate of a saturated pixel, if a class is saturated.
    pub(crate) fn typical_rate(&self, classes: &PixelClasses) -> f64 {
        let mut rates = self.class_median_rates(classes);
        rates.retain(|rate| rate.is_finite());
        if rates.iter().any(|rate| *rate > SATURATION_RATE) {
            return 1.0;
        }
        rates.iter().sum::<f64>() / rates.len() as f64
    }

    /// Returns whether most pixels of every class fire at nearly every readout.
    pub(crate) fn is_saturated(&self, classes: &PixelClasses) -> bool {
        let mut rates = self.class_median_rates(classes);
        rates.retain(|rate| rate.is_finite());
        rates.iter().all(|rate| *rate > SATURATION_RATE)
    }

    /// Returns the median rate of the pixels in spikes per readout.
    #[must_use]
    pub fn median_rate(&self) -> f64 {
        median(&mut finite_values(&self.rate))
    }

    /// Returns, for each pixel of the level, the probability that its interval noise is not an outlier.
    ///
    /// Pixels with similar numbers of spikes are standardized together, because the lags and the error of an estimate depend
    /// on this number.
    pub(crate) fn interval_weights(&self) -> Vec<f64> {
        let Some(noise) = &self.interval_noise else { return Vec::new() };
        let mut weights = vec![0.0; noise.map.len()];
        let mut used: Vec<usize> = (0..weights.len())
            .filter(|p| noise.map[*p].is_finite() && self.rate[*p] < MAX_GROWTH_RATE)
            .collect();
        used.sort_by_key(|p| self.spikes[*p]);
        let size = used.len().div_ceil(MAX_SPIKE_GROUPS).max(MIN_GROUP_PIXELS);
        let standardized =
            |group: &[usize]| standardize(&group.iter().map(|p| noise.map[*p]).collect::<Vec<_>>());
        let all: Vec<f64> = used.chunks(size).flat_map(standardized).collect();
        used.iter().zip(regular_weights(&all)).for_each(|(p, w)| weights[*p] = w);
        weights
    }
}

/// The uniform levels of a set, and the file names of the set's other recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Observations {
    /// Width and height of the sensor.
    pub geometry: Geometry,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The levels in ascending order of light.
    pub levels: Vec<LightLevel>,
    /// File names of the recordings whose light is not uniform. The estimators do not use these recordings.
    pub other_recordings: Vec<String>,
    /// Color filters of the camera.
    pub filters: ColorFilters,
    /// Description of the camera, if the set has one.
    pub camera: Option<RecordedCamera>,
}

impl Observations {
    /// Returns the two possible Bayer patterns of recordings without stated filters, or `None` if they have no such
    /// pattern. The brightest level without a saturated pixel class shows it.
    #[must_use]
    pub fn detected_mosaics(&self) -> Option<[Mosaic; 2]> {
        if self.filters != ColorFilters::Unknown {
            return None;
        }
        let width = self.geometry.width();
        let classes = PixelClasses::new(&ColorFilters::Unknown, width, false);
        // A rate map of unknown length has no counts.
        let is_usable = |l: &&LightLevel| l.readouts > 0 && l.typical_rate(&classes) < 1.0;
        let brightest = self.levels.iter().rfind(is_usable)?;
        detect_mosaic(&brightest.spikes, width)
    }

    /// Returns the classes of the pixels.
    pub(crate) fn pixel_classes(&self) -> PixelClasses {
        PixelClasses::new(&self.filters, self.geometry.width(), self.detected_mosaics().is_some())
    }
}
