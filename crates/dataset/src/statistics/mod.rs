//! Statistics of the sequences of a dataset, computed from their records and labels.

mod html_report;

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::{DatasetReader, SequenceEntry, SequenceFiles, SequenceStatus};
use spikelane::error::Result;
use spikelane::unstable::threads;

pub use html_report::html_report;

/// Names of quantities of the light of scenes. `WHITE_SHARE` is followed by the lighting.
const SPECTRAL_SLOPE: &str = "slope of the spectrum of the light";
const LARGEST_STEP: &str = "largest step of the light in a readout, %";
const RENDER_RATE_AMPLITUDE: &str = "change at the render rate, %";
const WHITE_SHARE: &str = "at or above full scale";

/// Values of the light of real cameras or of ideal scenes, with their sources. The values of a quantity of scenes should be
/// near its reference.
pub const LIGHT_REFERENCES: [(&str, &str); 4] = [
    (SPECTRAL_SLOPE, "-2.3: a recording of a real spike camera"),
    (WHITE_SHARE, "below 5 %: exposure of a camera that keeps its highlights"),
    (LARGEST_STEP, "below the step of an edge that moves by a quarter pixel"),
    (RENDER_RATE_AMPLITUDE, "0: light that changes evenly; 100: frames that are held"),
];

/// Maximum number of reference images on the HTML page. The images are from sequences that are evenly spaced in the
/// list of sequences.
const MAX_SHOWN_IMAGES: usize = 12;

/// Maximum size in bytes of an image on the page.
const MAX_IMAGE_BYTES: u64 = 64 << 20;

/// Quantiles of a quantity of sequences or boxes. Sequences or boxes without a value of the quantity are not counted.
///
/// # Examples
/// ```
/// use spikelane_dataset::statistics::QuantileSummary;
/// let values = (0..=100).map(f64::from).chain([f64::NAN]).collect();
/// let summary = QuantileSummary::from_values(values).expect("finite values");
/// assert_eq!((summary.count, summary.p10, summary.median, summary.max), (101, 10.0, 50.0, 100.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QuantileSummary {
    /// Number of sequences or boxes that have the quantity.
    pub count: usize,
    /// Minimum.
    pub min: f64,
    /// 10 % quantile.
    pub p10: f64,
    /// Median.
    pub median: f64,
    /// 90 % quantile.
    pub p90: f64,
    /// Maximum.
    pub max: f64,
}

impl QuantileSummary {
    /// Returns the quantiles of the finite values. Returns `None` if no value is finite.
    #[must_use]
    pub fn from_values(mut values: Vec<f64>) -> Option<Self> {
        values.retain(|v| v.is_finite());
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        Some(Self {
            count: values.len(),
            min: values[0],
            p10: at(0.1),
            median: at(0.5),
            p90: at(0.9),
            max: values[last],
        })
    }
}

/// Statistics of a dataset.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DatasetStatistics {
    /// Number of finished sequences in each split.
    pub splits: BTreeMap<String, u64>,
    /// Number of scenes with each lighting preset.
    pub lighting: BTreeMap<String, u64>,
    /// Number of sequences that each camera recorded, by camera name.
    pub cameras: BTreeMap<String, u64>,
    /// Number of failed sequences.
    pub failed_sequences: u64,
    /// Total number of readouts of the noisy streams.
    pub readouts: u64,
    /// Total number of bytes of all files of all sequences.
    pub bytes: u64,
    /// Number of boxes of each class, summed over all labeled readouts.
    pub boxes: BTreeMap<String, u64>,
    /// Quantiles of each quantity. The key is the name of the quantity and includes the unit.
    pub quantities: BTreeMap<String, QuantileSummary>,
    /// The digest of the dataset; see [`Manifest::dataset_digest`](crate::Manifest::dataset_digest).
    pub digest: String,
    /// Names and PNG files of the reference images of some sequences.
    #[serde(skip)]
    pub reference_images: Vec<(String, Vec<u8>)>,
    /// Histogram of each quantity that varies. Each bin is (center, fraction of the values).
    #[serde(skip)]
    pub histograms: BTreeMap<String, Vec<(f64, f64)>>,
}

/// Computes the statistics of a dataset from its records, sidecars and boxes.
///
/// The sequences must be in folders, not in packed shards. If `follow_links` is true, files may be links to files
/// outside the dataset's folder.
///
/// # Errors
/// Those of [`DatasetReader::open`] and of reading.
pub fn dataset_statistics(path: &Path, follow_links: bool) -> Result<DatasetStatistics> {
    let dataset = DatasetReader::open(path, follow_links)?;
    let mut stats = DatasetStatistics { digest: dataset.dataset_digest(), ..DatasetStatistics::default() };
    let mut values: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut done = 0;
    let done_count = dataset.done_entries().len();
    let shown = done_count.min(MAX_SHOWN_IMAGES);
    for entry in dataset.entries() {
        threads::check_stop();
        match entry.status {
            SequenceStatus::Done => {
                let files = dataset.sequence(entry)?;
                stats.add_sequence(entry, &files, &mut values)?;
                if stats.reference_images.len() * done_count / shown == done {
                    let image = files.open(&"reference.png".into())?;
                    stats
                        .reference_images
                        .push((entry.id.to_string(), image.read_all("an image", MAX_IMAGE_BYTES)?));
                }
                done += 1;
            }
            SequenceStatus::Failed => stats.failed_sequences += 1,
            SequenceStatus::Planned => {}
        }
    }
    for (name, values) in values {
        if let Some(bins) = histogram(&values) {
            stats.histograms.insert(name.clone(), bins);
        }
        stats.quantities.extend(QuantileSummary::from_values(values).map(|spread| (name, spread)));
    }
    Ok(stats)
}

/// Minimum number of values of a histogram. With fewer values, a histogram contains little more information than a
/// [`QuantileSummary`].
const MIN_HISTOGRAM_VALUES: usize = 25;

/// Returns a histogram of `values` between their minimum and their maximum. Each bin is (center, fraction of the
/// values).
///
/// The number of bins is approximately the square root of the number of values. Returns `None` if there are too few
/// values or if all values are equal.
fn histogram(values: &[f64]) -> Option<Vec<(f64, f64)>> {
    const MAX_BINS: usize = 24;
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().min_by(f64::total_cmp)?, finite().max_by(f64::total_cmp)?);
    let n = finite().count();
    let bins = n.isqrt().min(MAX_BINS);
    let width = (high - low) / bins as f64;
    if n < MIN_HISTOGRAM_VALUES || width <= 0.0 || !width.is_finite() {
        return None;
    }
    let mut counts = vec![0u64; bins];
    finite().for_each(|v| counts[(((v - low) / width) as usize).min(bins - 1)] += 1);
    let share = |count: &u64| *count as f64 / n as f64;
    Some(counts.iter().enumerate().map(|(i, n)| (low + (i as f64 + 0.5) * width, share(n))).collect())
}

/// Formats a number for human readers. An integer is exact, and another number has four significant digits.
///
/// # Examples
/// ```
/// use spikelane_dataset::statistics::format_number;
/// assert_eq!([12_500.0, 0.2, 2.0 / 3.0].map(format_number), ["12500", "0.2", "0.6667"]);
/// ```
#[must_use]
pub fn format_number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        return format!("{value}");
    }
    let before = value.abs().log10().floor().max(-9.0) as i32;
    let after = usize::try_from(3 - before).unwrap_or(0);
    let text = format!("{value:.after$}");
    if after == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
}

impl DatasetStatistics {
    fn add_sequence(
        &mut self,
        entry: &SequenceEntry,
        files: &SequenceFiles,
        values: &mut BTreeMap<String, Vec<f64>>,
    ) -> Result<()> {
        let (record, sidecar) = (files.record()?, files.sidecar()?);
        *self.splits.entry(entry.split.name().to_owned()).or_default() += 1;
        if let Some(light) = record.facts["lighting"].as_str() {
            *self.lighting.entry(light.to_owned()).or_default() += 1;
        }
        if let Some(camera) = &sidecar.camera {
            *self.cameras.entry(camera.name.clone()).or_default() += 1;
        }
        self.readouts = self.readouts.saturating_add(sidecar.readouts);
        self.bytes = self.bytes.saturating_add(record.bytes());
        let mut add = |name: &str, value: Option<f64>| {
            if let Some(value) = value {
                values.entry(name.to_owned()).or_default().push(value);
            }
        };
        add("rate, spikes a readout", Some(sidecar.stream.mean_rate));
        add("rate without noise, spikes a readout", sidecar.clean.as_ref().map(|c| c.mean_rate));
        add("readouts", Some(sidecar.readouts as f64));
        add("size, MB", Some(record.bytes() as f64 / 1e6));
        for (name, key) in [
            ("motion, pixels a readout at most", "max_px_per_readout"),
            ("white, cd/m2", "white_cd_m2"),
            ("vehicles", "vehicles"),
            ("frames of the input", "frames"),
        ] {
            add(name, record.facts[key].as_f64());
        }
        let light = &record.facts["light_statistics"];
        for (name, key, factor) in [
            (SPECTRAL_SLOPE, "spectral_slope", 1.0),
            (LARGEST_STEP, "largest_step", 100.0),
            (RENDER_RATE_AMPLITUDE, "render_rate_amplitude", 100.0),
        ] {
            add(name, light[key].as_f64().map(|value| factor * value));
        }
        if let Some(lighting) = record.facts["lighting"].as_str() {
            let name = format!("{WHITE_SHARE}, {lighting}, %");
            add(&name, light["white_share"].as_f64().map(|share| 100.0 * share));
        }
        self.add_boxes(files, &mut add)
    }

    fn add_boxes(&mut self, files: &SequenceFiles, add: &mut dyn FnMut(&str, Option<f64>)) -> Result<()> {
        for frame in files.labeled_frames()? {
            add("speed of the camera, m/s", Some(frame.camera.speed_mps));
            add("vehicles seen in a frame", Some(frame.visible_vehicles().count() as f64));
            for label in frame.visible_vehicles() {
                *self.boxes.entry(label.class.clone()).or_default() += 1;
                add("depth of a box, m", Some(label.center_camera_m[2]));
                add("pixels of a box", Some(label.visible_pixels as f64));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_shares_out_finite_values_and_there_is_none_of_few_or_of_one() {
        let values: Vec<f64> = (0..100).map(f64::from).chain([f64::NAN]).collect();
        let bins = histogram(&values).unwrap();
        assert_eq!((bins.len(), bins[0].0, bins[0].1, bins[9].1), (10, 4.95, 0.1, 0.1));
        assert_eq!(histogram(&values[..MIN_HISTOGRAM_VALUES - 1]), None);
        assert_eq!(histogram(&[3.0; 2 * MIN_HISTOGRAM_VALUES]), None);
        assert_eq!(histogram(&[f64::NAN]), None);
    }

    #[test]
    fn numbers_for_people_have_four_digits_that_count() {
        let texts = [3.0, 20000.0, 307.071, 0.021_812, -13.06621, 0.000_012_345, 20_000.4].map(format_number);
        assert_eq!(texts, ["3", "20000", "307.1", "0.02181", "-13.07", "0.00001234", "20000"]);
    }

    #[test]
    fn a_spread_is_of_finite_values_and_of_none_there_is_none() {
        let spread =
            QuantileSummary::from_values((0..=10).map(f64::from).chain([f64::NAN]).collect()).unwrap();
        assert_eq!((spread.count, spread.min, spread.p10, spread.median), (11, 0.0, 1.0, 5.0));
        assert_eq!((spread.p90, spread.max), (9.0, 10.0));
        assert_eq!(QuantileSummary::from_values(vec![f64::INFINITY]), None);
    }
}
