//! What a dataset holds, in numbers: an overview of its sequences from their records and labels.

mod page;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::dataset::{Entry, Manifest, Record, Status, frames};
use crate::error::Result;
use crate::simulate::Sidecar;

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

/// Reads the records, sidecars and boxes of a dataset whose sequences lie in folders.
///
/// # Errors
/// [`Input`](crate::Kind::Input) for packed shards, which have no folders; those of reading.
pub fn stats(folder: &Path) -> Result<Stats> {
    let manifest = Manifest::read(folder)?;
    let mut stats = Stats { digest: manifest.digest(), ..Stats::default() };
    let mut values: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for entry in &manifest.entries {
        match entry.status {
            Status::Done => stats.take(folder, entry, &mut values)?,
            Status::Failed => stats.set_aside += 1,
            Status::Planned => {}
        }
    }
    let done: Vec<&Entry> = manifest.entries.iter().filter(|e| e.status == Status::Done).collect();
    let shown = done.len().min(PICTURES);
    for i in 0..shown {
        let entry = done[i * done.len() / shown];
        stats.pictures.push((entry.id.clone(), entry.folder(folder).join("clear.png")));
    }
    for (name, values) in values {
        if let Some(bins) = histogram(&values) {
            stats.histograms.insert(name.clone(), bins);
        }
        stats.quantities.extend(Spread::of(values).map(|spread| (name, spread)));
    }
    Ok(stats)
}

/// Middle and share of each of some bins between the least and the greatest value; none where all are one.
fn histogram(values: &[f64]) -> Option<Vec<(f64, f64)>> {
    const BINS: usize = 24;
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().min_by(f64::total_cmp)?, finite().max_by(f64::total_cmp)?);
    let width = (high - low) / BINS as f64;
    if width <= 0.0 || !width.is_finite() {
        return None;
    }
    let mut counts = [0u64; BINS];
    finite().for_each(|v| counts[(((v - low) / width) as usize).min(BINS - 1)] += 1);
    let of = finite().count() as f64;
    Some((0..BINS).map(|i| (low + (i as f64 + 0.5) * width, counts[i] as f64 / of)).collect())
}

impl Stats {
    fn take(&mut self, folder: &Path, entry: &Entry, values: &mut BTreeMap<String, Vec<f64>>) -> Result<()> {
        let place = entry.unpacked(folder)?;
        let (record, sidecar) = (Record::read(&place)?, Sidecar::read(&place.join("stream.json"))?);
        *self.splits.entry(entry.split.clone()).or_default() += 1;
        if let Some(light) = record.about["lighting"].as_str() {
            *self.lights.entry(light.to_owned()).or_default() += 1;
        }
        if let Some(camera) = &sidecar.camera {
            *self.cameras.entry(camera.name.clone()).or_default() += 1;
        }
        self.readouts += sidecar.readouts;
        self.bytes += record.bytes();
        let mut add = |name: &str, value: Option<f64>| {
            if let Some(value) = value {
                values.entry(name.to_owned()).or_default().push(value);
            }
        };
        add("rate, spikes a readout", Some(sidecar.stream.mean_rate));
        add("rate without noise, spikes a readout", sidecar.clean.as_ref().map(|c| c.mean_rate));
        add("readouts", Some(sidecar.readouts as f64));
        add("bytes", Some(record.bytes() as f64));
        for (name, key) in [
            ("motion, pixels a readout at most", "max_px_per_readout"),
            ("white, cd/m2", "white_cd_m2"),
            ("vehicles", "vehicles"),
            ("frames of the input", "frames"),
        ] {
            add(name, record.about[key].as_f64());
        }
        self.boxes(&place, &mut add)
    }

    fn boxes(&mut self, place: &Path, add: &mut dyn FnMut(&str, Option<f64>)) -> Result<()> {
        for frame in frames::read(place)? {
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
    fn a_histogram_shares_out_finite_values_and_there_is_none_of_one_value() {
        let bins = histogram(&[0.0, 1.0, 24.0, f64::NAN]).unwrap();
        assert_eq!((bins[0], bins[1].1, bins[23].1), ((0.5, 1.0 / 3.0), 1.0 / 3.0, 1.0 / 3.0));
        assert_eq!(histogram(&[3.0, 3.0]), None);
        assert_eq!(histogram(&[f64::NAN]), None);
    }

    #[test]
    fn a_spread_is_of_finite_values_and_of_none_there_is_none() {
        let spread = Spread::of((0..=10).map(f64::from).chain([f64::NAN]).collect()).unwrap();
        assert_eq!((spread.count, spread.least, spread.tenth, spread.median), (11, 0.0, 1.0, 5.0));
        assert_eq!((spread.ninth, spread.greatest), (9.0, 10.0));
        assert_eq!(Spread::of(vec![f64::INFINITY]), None);
    }
}
