//! The color filters of a measured camera, and the light behind each filter.

use crate::recordings::color_filters::{ColorFilters, PixelClasses};
use crate::recordings::light_unit::SATURATION_RATE;
use crate::{Recording, RecordingSet};
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Mosaic;
use spikelane::spikes::Geometry;
use spikelane_measure::{MeasureOptions, detect_mosaic, measure_stream};

/// The channels of a measured camera. A gray camera has one channel.
#[derive(Clone, Debug)]
pub(super) struct MeasuredFilters {
    mosaic: Option<Mosaic>,
    is_declared: bool,
    /// Channel of each pixel.
    channel: Vec<usize>,
    /// Number of pixels of each channel.
    pixels: Vec<f64>,
    /// Light of the lamps behind each filter, divided by the light behind the filter that transmits the most.
    light: Vec<f64>,
}

impl MeasuredFilters {
    fn gray(geometry: Geometry) -> Self {
        let pixels = geometry.pixels();
        Self {
            mosaic: None,
            is_declared: false,
            channel: vec![0; pixels],
            pixels: vec![pixels as f64],
            light: vec![1.0],
        }
    }

    /// Returns the filters of `set`: those that the set states, else those that its brightest recording without saturated
    /// pixels shows. `levels` are the recordings of uniform light in ascending order of light.
    pub(super) fn measure(set: &RecordingSet, levels: &[(f64, &Recording)]) -> Result<Self> {
        let geometry = set.geometry()?;
        let width = geometry.width();
        let filters = set.color_filters()?;
        if filters == ColorFilters::Absent {
            return Ok(Self::gray(geometry));
        }
        let classes = PixelClasses::new(&filters, width, true);
        let channel: Vec<usize> = (0..geometry.pixels()).map(|p| classes.class(p)).collect();
        let mut pixels = vec![0.0; classes.count()];
        channel.iter().for_each(|c| pixels[*c] += 1.0);
        let mut found = Self {
            mosaic: Some(classes.mosaic().clone()),
            is_declared: classes.are_declared,
            light: vec![1.0; pixels.len()],
            channel,
            pixels,
        };
        let mut bright = None;
        for (_, recording) in levels.iter().rev().filter(|(light, _)| *light > 0.0) {
            let counts = spike_counts(set, recording)?;
            let rates = found.channel_means(&counts.0, counts.1);
            if rates.iter().all(|rate| *rate < SATURATION_RATE) {
                bright = Some((counts.0, rates));
                break;
            }
        }
        let Some((counts, bright)) = bright else { return Ok(Self::gray(geometry)) };
        if !found.is_declared && detect_mosaic(&counts, width).is_none() {
            return Ok(Self::gray(geometry));
        }
        let dark = match levels.first() {
            Some((light, recording)) if *light == 0.0 => {
                let (counts, readouts) = spike_counts(set, recording)?;
                found.channel_means(&counts, readouts)
            }
            _ => vec![0.0; bright.len()],
        };
        let response: Vec<f64> = bright.iter().zip(&dark).map(|(b, d)| (b - d).max(0.0)).collect();
        let most = response.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        found.light = response.iter().map(|r| r / most).collect();
        Ok(found)
    }

    /// Returns the letters of the channels. The list is empty for a gray camera.
    pub(super) fn names(&self) -> Vec<char> {
        self.mosaic.iter().flat_map(|mosaic| mosaic.channels()).map(|c| c.name).collect()
    }

    /// Returns the mean of `counts` per readout over the pixels of each channel.
    pub(super) fn channel_means(&self, counts: &[u32], readouts: u32) -> Vec<f64> {
        let mut sums = vec![0.0; self.pixels.len()];
        counts.iter().zip(&self.channel).for_each(|(n, c)| sums[*c] += f64::from(*n));
        sums.iter().zip(&self.pixels).map(|(sum, n)| sum / (n * f64::from(readouts)).max(1.0)).collect()
    }

    /// Returns the light on each pixel of `camera`, divided by the light of the lamp. A camera without color filters is
    /// compared behind the filters of the measured camera.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the camera has other filters than the set states.
    pub(super) fn pixel_light(&self, camera: &Camera) -> Result<Vec<f32>> {
        let geometry = camera.sensor.geometry;
        let Some(mosaic) = camera.window_mosaic() else {
            return Ok(self.channel.iter().map(|c| self.light[*c] as f32).collect());
        };
        if let Some(measured) = self.mosaic.as_ref().filter(|_| self.is_declared)
            && measured.to_string() != mosaic.to_string()
        {
            return Err(Error::new(ErrorKind::Usage, format_args!("camera {}", camera.name))
                .found(format_args!("the mosaic {mosaic}"))
                .expected(format_args!(
                    "the mosaic {measured} of the recordings, or a camera without a mosaic"
                )));
        }
        Ok(mosaic.channel_map(geometry).iter().map(|c| mosaic.channels()[*c].white() as f32).collect())
    }
}

/// Returns the spike counts of a recording and its number of readouts.
fn spike_counts(set: &RecordingSet, recording: &Recording) -> Result<(Vec<u32>, u32)> {
    let options =
        MeasureOptions { frames: false, intervals: false, series_readouts: 0, ..MeasureOptions::default() };
    let statistics = measure_stream(&set.reader(recording)?, &options, &mut |_| {})?;
    Ok((statistics.counts.map(|counts| counts.count).unwrap_or_default(), statistics.readouts))
}
