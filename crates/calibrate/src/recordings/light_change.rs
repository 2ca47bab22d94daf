//! Removes changes of the light that all pixels share from the rates and the intervals of a level.
//!
//! A lamp that flickers or drifts changes the intervals of all pixels. Their variance then contains the change of the lamp,
//! and it would be mistaken for noise of the camera. The frame totals show the change ([`LightCourse`]). Spike times that
//! are measured by the integrated light instead of readouts ([`LightClock`]) no longer contain it: between two spikes a
//! pixel integrates one threshold, whatever the course of the light is.
//!
//! **Pixels.** Let `m` be the relative change of the mean charge of all pixels. The charge `x_p` of a pixel contains the dark
//! rate `d_p`, which does not change. Its relative change is `m (1 - d_p / x_p) / (1 - d / x)`, where `d` and `x` are the
//! means over all pixels.
//!
//! **What remains.** The estimate of the change has the noise of the mean phase of all `P` pixels. Without any filter, its
//! variance is `1 / (12 P)` squared thresholds. It does not grow with the number of intervals of a span, so it changes the
//! constant part of the variance and not the noise per spike.

use super::drift::drifting_share;
use super::observations::{ChangeRemoval, Flicker, LightLevel};
use spikelane::error::Result;
use spikelane::spikes::span_rate;
use spikelane_measure::{LightClock, LightCourse, Statistics, finite_values, median_and_spread};

/// Largest number of readouts whose frame totals are examined. Sixteen times as many bytes are needed.
pub(super) const MAX_EXAMINED_READOUTS: usize = 1 << 20;

/// Smallest contribution of a change of the light to the noise per spike, divided by the standard error of this noise. A
/// smaller contribution is not removed, because it changes the error of the noise by less than 1 %.
const MIN_NOISE_CONTRIBUTION: f64 = 0.1;

/// Largest relative change of the mean rate between the halves of a recording that is removed. A recording with a larger change
/// contains two levels of light, and not one.
const MAX_REMOVED_DRIFT: f64 = 0.2;

/// Smallest distance of the mean start phase from one half for which the pixels did not start with independent phases. For
/// a hundred pixels with independent phases, it is 3.5 standard deviations of the mean.
const MIN_COMMON_START: f64 = 0.1;

/// Phase spread, in cycles, at which pixels that started together fire independently. The frame totals then oscillate by
/// `exp(-(2 pi 0.56)^2 / 2)`, which is 0.002 of the oscillation at the start.
const INDEPENDENT_PHASE_SPREAD: f64 = 0.56;

/// Largest share of a recording that the start may take.
const MAX_START_SHARE: f64 = 0.125;

/// A change of the light of a level that must be removed.
pub(super) struct PendingRemoval {
    pub(super) level: String,
    course: LightCourse,
    first_spikes: Vec<u32>,
    last_spikes: Vec<u32>,
    early_counts: Vec<u32>,
}

/// Sets the flicker of a level. Returns the change of the light if it must be removed.
///
/// # Errors
/// Those of [`LightCourse::from_totals`].
pub(super) fn examine(
    level: &mut LightLevel,
    statistics: Statistics,
    hz: f64,
) -> Result<Option<PendingRemoval>> {
    let (Some(frames), Some(counts)) = (&statistics.frames, &statistics.counts) else { return Ok(None) };
    let totals = &frames.totals;
    let course = LightCourse::from_totals(totals, &level.rate, start_readouts(level))?;
    level.flicker = course.lines.first().map(|l| Flicker { frequency_hz: l.frequency * hz, depth: l.depth });
    if level.light == 0.0 {
        return Ok(None);
    }
    let is_one_level = level.rate_change.is_none_or(|change| change.value.abs() <= MAX_REMOVED_DRIFT);
    let is_known = course.has_slow_part && totals.len() == level.readouts as usize && is_one_level;
    let flickers = level.flicker.is_some();
    level.change_removal = match flickers || level.drifts() || contributes_to_noise(level, &course) {
        true if is_known => ChangeRemoval::Removed,
        false if is_known => ChangeRemoval::Negligible,
        _ if flickers => ChangeRemoval::Impossible,
        _ => ChangeRemoval::Unknown,
    };
    let removed = level.change_removal == ChangeRemoval::Removed;
    Ok(removed.then(|| PendingRemoval {
        level: level.name.clone(),
        course,
        first_spikes: counts.first_spike.clone(),
        last_spikes: counts.last_spike.clone(),
        early_counts: statistics.counts_before_split.unwrap_or_default(),
    }))
}

/// Returns the number of readouts after which the phases of the pixels are independent.
///
/// If rates spread by the share `s`, the phases of pixels that start together spread by `s` cycles per interval.
fn start_readouts(level: &LightLevel) -> usize {
    if level.start_offset <= MIN_COMMON_START {
        return 0;
    }
    let (rate, spread) = median_and_spread(&mut finite_values(&level.rate));
    let limit = MAX_START_SHARE * f64::from(level.readouts);
    (INDEPENDENT_PHASE_SPREAD / spread).min(limit).max((1.0 / rate).min(limit)) as usize
}

/// Returns whether the change of the light adds more than a negligible part to the noise per spike.
fn contributes_to_noise(level: &LightLevel, course: &LightCourse) -> bool {
    let Some(noise) = &level.interval_noise else { return false };
    let mut known: Vec<f64> = noise.map.iter().copied().filter(|s| s.is_finite()).collect();
    let pixels = known.len() as f64;
    let error = median_and_spread(&mut known).1 / pixels.sqrt();
    let variances = span_variances(level, course);
    let points: Vec<(f64, f64, f64)> = variances.iter().map(|(lag, v)| (*lag, *v, 1.0)).collect();
    crate::formulas::fit::fit_line(&points).is_some_and(|line| line.a.abs() > MIN_NOISE_CONTRIBUTION * error)
}

/// Returns, for each lag of the level in intervals, the variance of spans that the change of the light causes, in squared
/// thresholds.
fn span_variances(level: &LightLevel, course: &LightCourse) -> Vec<(f64, f64)> {
    let rate = level.median_rate();
    let lags = level.interval_noise.iter().flat_map(|noise| &noise.lags);
    lags.map(|lag| (f64::from(*lag), course.span_variance(f64::from(*lag) / rate) * rate * rate)).collect()
}

impl PendingRemoval {
    /// Returns the clock of the light. `dark` contains the rate of each pixel in the dark.
    ///
    /// # Errors
    /// Those of [`LightClock::new`].
    pub(super) fn clock(&self, level: &LightLevel, dark: &[f64]) -> Result<LightClock> {
        let light_share = |p: usize| {
            let (x, d) = (level.rate[p], dark[p]);
            if x > 0.0 && d.is_finite() { (1.0 - d / x).clamp(0.0, 1.0) } else { 1.0 }
        };
        let mean = mean_light_share(level, dark);
        LightClock::new(
            &self.course.changes,
            (0..dark.len()).map(|p| (light_share(p) / mean) as f32).collect(),
        )
    }

    /// Computes the rates of the level by the clock of the light.
    pub(super) fn correct_rates(&self, level: &mut LightLevel, clock: &LightClock, dark: &[f64]) {
        let mean = mean_light_share(level, dark);
        if let Some(flicker) = &mut level.flicker {
            flicker.depth /= mean;
        }
        for p in 0..level.rate.len() {
            let [first, last] = [self.first_spikes[p], self.last_spikes[p]];
            if let Some(rate) = span_rate(level.spikes[p], first, last) {
                let by_light = clock.time(p, last) - clock.time(p, first);
                level.rate[p] = rate * f64::from(last - first) / by_light;
            }
        }
        let variances = span_variances(level, &self.course);
        level.removed_variance = variances.iter().map(|(lag, v)| v / lag).fold(0.0, f64::max);
        if let Some(split) = self.early_counts.first().map(|_| level.readouts / 2) {
            let first_half: f64 = self.course.changes[..split as usize].iter().sum();
            level.drifting_share = drifting_share(level, &self.early_counts, f64::from(split) + first_half);
        }
    }
}

/// Returns the share of the mean charge that comes from the light.
fn mean_light_share(level: &LightLevel, dark: &[f64]) -> f64 {
    let known = || level.rate.iter().zip(dark).filter(|(x, d)| x.is_finite() && d.is_finite());
    let (x, d) = known().fold((0.0, 0.0), |(x, d), (rate, dark)| (x + rate, d + dark));
    if d < x { 1.0 - d / x } else { 1.0 }
}

/// Returns the rate of each pixel in the dark: of the dark level, or on the line through the two dimmest levels.
pub(super) fn dark_rates(levels: &[LightLevel]) -> Vec<f64> {
    match levels {
        [dark, ..] if dark.light == 0.0 => dark.rate.clone(),
        [first, second, ..] => {
            let ratio = first.light / (second.light - first.light);
            let rates = first.rate.iter().zip(&second.rate);
            rates.map(|(x, y)| (x - ratio * (y - x)).clamp(0.0, x.max(0.0))).collect()
        }
        _ => levels.iter().flat_map(|l| vec![0.0; l.rate.len()]).collect(),
    }
}
