//! Calibration maps as SpikeNeRF and RSIR publish them, as a set of rate maps.
//!
//! Their archive holds three maps of one value per pixel. `D_light` (or `D`) is the mean number of empty readouts between
//! two spikes under uniform light of 335 lux, so that the rate is `1 / (1 + D)`. `Nd` is the light, in lux, that would
//! fire as often as the dark current does; as `1 / D` is proportional to the light, the pixel waits `D (335 + Nd) / Nd`
//! readouts in the dark. `Nl`, the response to light relative to other pixels, follows from these two.
//! (`SpikeNeRF`, `spike_helpers.py`, function `noise`.)

use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::recordings::{RateMap, RecordingSet};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::npy;
use spikelane_io::Archive;
use spikelane_io::storage::write_small;
use spikelane_measure::upper_median;

/// Light of `D_light`, in lux.
const LUX: f64 = 335.0;

/// Readouts per second of the camera that was calibrated; the maps do not say.
const READOUT_HZ: f64 = 20_000.0;

/// Writes the rates in the dark and under light that the maps of `archive` (`.npz`) amount to into `folder`, as
/// `rate_dark.npy` and `rate_light.npy`, with a `recordings.toml` of them; returns its path. The light of the brighter
/// map is what its median rate exceeds the dark's by.
///
/// # Errors
/// [`Kind::Input`] when the archive lacks a map, or one holds impossible values; [`Kind::Exists`] and others
/// when a file cannot be written.
pub fn import_maps(archive: &Path, folder: &Path, force: bool) -> Result<PathBuf> {
    let (shape, waits) = map(archive, &["D_light", "D"])?;
    let (other, dark_lux) = map(archive, &["Nd"])?;
    let impossible = |found: String| {
        Error::new(Kind::Input, archive.display())
            .found(found)
            .expected("maps D_light and Nd of one size, above 0 and finite")
    };
    if shape != other {
        return Err(impossible(format!("D_light of {shape:?} and Nd of {other:?}")));
    }
    if let Some(bad) = waits.iter().find(|d| !(d.is_finite() && **d > 0.0)) {
        return Err(impossible(format!("D_light of {bad}")));
    }
    if let Some(bad) = dark_lux.iter().find(|n| !(n.is_finite() && **n >= 0.0)) {
        return Err(impossible(format!("Nd of {bad}")));
    }
    // A pixel that never fires in the dark has Nd 0, and a wait without end.
    let dark_rate = |(d, n): (&f64, &f64)| n / (n + d * (LUX + n));
    let dark: Vec<f64> = waits.iter().zip(&dark_lux).map(dark_rate).collect();
    let light: Vec<f64> = waits.iter().map(|d| 1.0 / (1.0 + d)).collect();
    let level = upper_median(&mut light.clone()) - upper_median(&mut dark.clone());
    if level <= 0.0 {
        return Err(impossible("a median rate under light that is not above the dark's".into()));
    }
    let width = shape[1] as usize;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let mut rate_maps = Vec::new();
    for (file, rates, light) in [("rate_dark.npy", &dark, 0.0), ("rate_light.npy", &light, level)] {
        write_small(&folder.join(file), &npy::map_to_bytes(rates, width)?, force)?;
        rate_maps.push(RateMap { file: file.to_owned(), light, light_uncertainty: None, readouts: None });
    }
    let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    let set = RecordingSet {
        width: side(shape[1]),
        height: side(shape[0]),
        readout_hz: READOUT_HZ,
        layout: None,
        light_uncertainty: None,
        simulated: None,
        recordings: Vec::new(),
        rate_maps,
        folder: folder.to_path_buf(),
    };
    let path = folder.join("recordings.toml");
    write_small(&path, set.to_toml()?.as_bytes(), force)?;
    Ok(path)
}

/// The first map of these names, and its shape.
fn map(path: &Path, names: &[&str]) -> Result<([u64; 2], Vec<f64>)> {
    let name = path.display().to_string();
    let mut archive = Archive::new(&name, BufReader::new(InputFile::open(path)?.into_reader()))?;
    let arrays = archive.arrays();
    let Some(key) = names.iter().find(|key| arrays.iter().any(|a| a == *key)) else {
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("arrays [{}]", arrays.join(", ")))
            .expected("calibration maps D_light (or D), Nd and Nl")
            .remedy("give a recording set (.toml) for anything else"));
    };
    let subject = format!("{name}: {key}");
    let (header, values) = npy::read_map(&subject, &mut archive.entry(key)?)?;
    let shape = <[u64; 2]>::try_from(&header.shape[..]).ok().filter(|s| s.iter().all(|n| *n > 0));
    let shape = shape.ok_or_else(|| {
        Error::new(Kind::Input, &subject)
            .found(format_args!("shape {:?}", header.shape))
            .expected("(height, width)")
    })?;
    Ok((shape, values))
}
