//! What a dataset holds, in numbers: an overview of its sequences from their records and labels.

mod page;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::{Entry, Manifest, Record, Status, frames};
use spikelane::error::Result;
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane::unstable::threads;
use spikelane_io::simulate::Sidecar;

pub use page::html;

/// Pictures that the page shows, evenly chosen.
const PICTURES: usize = 12;

/// Five numbers of a quantity over the sequences that have it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Sequences, or boxes, that have it.
    pub count: usize,
    /// Least.
    pub least: f64,
    /// A tenth is not above it.
    pub tenth: f64,
    /// Half is not above it.
    pub median: f64,
    /// Nine tenths are not above it.
    pub ninth: f64,
    /// Greatest.
    pub greatest: f64,
}

impl Spread {
    /// The spread of finite values; none of none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.retain(|v| v.is_finite());
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        Some(Self {
            count: values.len(),
            least: values[0],
            tenth: at(0.1),
            median: at(0.5),
            ninth: at(0.9),
            greatest: values[last],
        })
    }
}

/// An overview.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// Sequences that are done, of each split.
    pub splits: BTreeMap<String, u64>,
    /// Sequences of each light; of drawn scenes.
    pub lights: BTreeMap<String, u64>,
    /// Sequences of each camera, by its name.
    pub cameras: BTreeMap<String, u64>,
    /// Sequences set aside.
    pub set_aside: u64,
    /// Readouts of all noisy streams.
    pub readouts: u64,
    /// Bytes of all files of sequences.
    pub bytes: u64,
    /// Boxes of each class over all labelled readouts.
    pub boxes: BTreeMap<String, u64>,
    /// Quantities by name, with their unit in it.
    pub quantities: BTreeMap<String, Spread>,
    /// The digest of the dataset, see [`Manifest::digest`].
    pub digest: String,
    /// Clear pictures of some sequences: their names and where they lie.
    #[serde(skip)]
    pub pictures: Vec<(String, PathBuf)>,
    /// Histograms of quantities that differ: middle and share of each bin.
    #[serde(skip)]
    pub histograms: BTreeMap<String, Vec<(f64, f64)>>,
}

/// Reads the records, sidecars and boxes of a dataset whose sequences lie in folders; with `follow_links` links may leave
/// the dataset's folder.
///
/// # Errors
/// [`Input`](spikelane::Kind::Input) for packed shards, which have no folders; those of reading.
pub fn stats(folder: &Path, follow_links: bool) -> Result<Stats> {
    let access = Access::reading(follow_links);
    let manifest = Manifest::read_below(folder, access)?;
    let mut stats = Stats { digest: manifest.digest(), ..Stats::default() };
    let mut values: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for entry in &manifest.entries {
        threads::check();
        match entry.status {
            Status::Done => stats.take(folder, entry, access, &mut values)?,
            Status::Failed => stats.set_aside += 1,
            Status::Planned => {}
        }
    }
    let done: Vec<&Entry> = manifest.entries.iter().filter(|e| e.status == Status::Done).collect();
    let shown = done.len().min(PICTURES);
    for i in 0..shown {
        let entry = done[i * done.len() / shown];
        let picture = entry.path().join("clear.png").below(folder, access)?;
        stats.pictures.push((entry.id.to_string(), picture));
    }
    for (name, values) in values {
        if let Some(bins) = histogram(&values) {
            stats.histograms.insert(name.clone(), bins);
        }
        stats.quantities.extend(Spread::of(values).map(|spread| (name, spread)));
    }
    Ok(stats)
}

/// Fewest values that a histogram says more of than the five numbers of a [`Spread`].
const HISTOGRAM: usize = 25;

/// Middle and share of each bin between the least and the greatest value, about as many bins as the root of the values; none
/// of few values, and none where all are one.
fn histogram(values: &[f64]) -> Option<Vec<(f64, f64)>> {
    const MOST: usize = 24;
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().min_by(f64::total_cmp)?, finite().max_by(f64::total_cmp)?);
    let of = finite().count();
    let bins = of.isqrt().min(MOST);
    let width = (high - low) / bins as f64;
    if of < HISTOGRAM || width <= 0.0 || !width.is_finite() {
        return None;
    }
    let mut counts = vec![0u64; bins];
    finite().for_each(|v| counts[(((v - low) / width) as usize).min(bins - 1)] += 1);
    let share = |count: &u64| *count as f64 / of as f64;
    Some(counts.iter().enumerate().map(|(i, n)| (low + (i as f64 + 0.5) * width, share(n))).collect())
}

/// A number for people: whole ones as they are, others with four digits that count.
#[must_use]
pub fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        return format!("{value}");
    }
    let before = value.abs().log10().floor().max(-9.0) as i32;
    let after = usize::try_from(3 - before).unwrap_or(0);
    let text = format!("{value:.after$}");
    if after == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
}

impl Stats {
    fn take(
        &mut self,
        folder: &Path,
        entry: &Entry,
        access: Access,
        values: &mut BTreeMap<String, Vec<f64>>,
    ) -> Result<()> {
        let place = entry.unpacked(folder, access)?;
        let record = Record::read_below(&place, access)?;
        let sidecar = Sidecar::read(&InnerPath::from("stream.json").below(&place, access)?)?;
        *self.splits.entry(entry.split.name().to_owned()).or_default() += 1;
        if let Some(light) = record.about["lighting"].as_str() {
            *self.lights.entry(light.to_owned()).or_default() += 1;
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
            add(name, record.about[key].as_f64());
        }
        self.boxes(&place, access, &mut add)
    }

    fn boxes(&mut self, place: &Path, access: Access, add: &mut dyn FnMut(&str, Option<f64>)) -> Result<()> {
        for frame in frames::read(place, access)? {
            add("speed of the camera, m/s", Some(frame.camera.speed_mps));
            add("vehicles seen in a frame", Some(frame.seen().count() as f64));
            for found in frame.seen() {
                *self.boxes.entry(found.class.clone()).or_default() += 1;
                add("depth of a box, m", Some(found.centre_camera_m[2]));
                add("pixels of a box", Some(found.visible_pixels as f64));
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
        assert_eq!(histogram(&values[..HISTOGRAM - 1]), None);
        assert_eq!(histogram(&[3.0; 2 * HISTOGRAM]), None);
        assert_eq!(histogram(&[f64::NAN]), None);
    }

    #[test]
    fn numbers_for_people_have_four_digits_that_count() {
        let said = [3.0, 20000.0, 307.071, 0.021_812, -13.06621, 0.000_012_345, 20_000.4].map(number);
        assert_eq!(said, ["3", "20000", "307.1", "0.02181", "-13.07", "0.00001234", "20000"]);
    }

    #[test]
    fn a_spread_is_of_finite_values_and_of_none_there_is_none() {
        let spread = Spread::of((0..=10).map(f64::from).chain([f64::NAN]).collect()).unwrap();
        assert_eq!((spread.count, spread.least, spread.tenth, spread.median), (11, 0.0, 1.0, 5.0));
        assert_eq!((spread.ninth, spread.greatest), (9.0, 10.0));
        assert_eq!(Spread::of(vec![f64::INFINITY]), None);
    }
}
