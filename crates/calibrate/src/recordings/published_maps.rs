//! Imports the calibration maps that SpikeNeRF and RSIR published, as a set of rate maps.
//!
//! The published archive contains three maps with one value per pixel:
//!
//! * `D_light` (or `D`), in readouts: the mean number of empty readouts between two spikes under uniform light of 335
//!   lux. The rate is `1 / (1 + D)` spikes per readout.
//! * `Nd`, in lux: the light at which the pixel would fire as often as it fires because of its dark current. `1 / D` is
//!   proportional to the light. In the dark the number of empty readouts between two spikes is therefore
//!   `D (335 + Nd) / Nd`.
//! * `Nl`: the response to light, divided by the response of other pixels. `Nl` can be computed from the other two maps
//!   and is not read.
//!
//! Source: `SpikeNeRF`, `spike_helpers.py`, function `noise`.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::recording_set::{RateMap, RecordingSet};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::npy;
use spikelane_io::Archive;
use spikelane_io::storage::write_small;
use spikelane_measure::upper_median;

/// Light at which the map `D_light` was measured, in lux.
const MAP_LIGHT_LUX: f64 = 335.0;

/// Readout rate of the calibrated camera in hertz. The published maps do not contain this rate.
const READOUT_HZ: f64 = 20_000.0;

/// Converts the maps of `archive` (`.npz`) to rates and writes them into `folder`. Returns the path of the new recording
/// set.
///
/// The files are `rate_dark.npy`, `rate_light.npy` and `recordings.toml`, which lists both rate maps. The light level of
/// `rate_light.npy` is its median rate minus the median rate of `rate_dark.npy`. If `force` is true, existing files are
/// replaced.
///
/// # Errors
/// * [`ErrorKind::Input`] if the archive lacks a map or contains impossible values.
/// * [`ErrorKind::Exists`] if a file exists and `force` is false.
/// * If a file cannot be written.
pub fn import_maps(archive: &Path, folder: &Path, force: bool) -> Result<PathBuf> {
    let (shape, waits) = read_map(archive, &["D_light", "D"])?;
    let (other, dark_lux) = read_map(archive, &["Nd"])?;
    let impossible = |found: String| {
        Error::new(ErrorKind::Input, archive.display())
            .found(found)
            .expected("maps D_light and Nd of the same size, finite and above 0")
    };
    if shape != other {
        return Err(impossible(format!(
            "D_light of {} and Nd of {}",
            npy::shape_text(&shape),
            npy::shape_text(&other)
        )));
    }
    if let Some(bad) = waits.iter().find(|d| !(d.is_finite() && **d > 0.0)) {
        return Err(impossible(format!("D_light of {bad}")));
    }
    if let Some(bad) = dark_lux.iter().find(|n| !(n.is_finite() && **n >= 0.0)) {
        return Err(impossible(format!("Nd of {bad}")));
    }
    // If a pixel never fires in the dark, `Nd = 0` and its wait is infinite. This form of the rate avoids a division by
    // `Nd` and returns 0.
    let dark_rate = |(d, n): (&f64, &f64)| n / (n + d * (MAP_LIGHT_LUX + n));
    let dark: Vec<f64> = waits.iter().zip(&dark_lux).map(dark_rate).collect();
    let light: Vec<f64> = waits.iter().map(|d| 1.0 / (1.0 + d)).collect();
    let level = upper_median(&mut light.clone()) - upper_median(&mut dark.clone());
    if level <= 0.0 {
        return Err(impossible("a median rate under light that does not exceed the dark rate".into()));
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
        source_repeatability: None,
        width: side(shape[1]),
        height: side(shape[0]),
        readout_hz: READOUT_HZ,
        layout: None,
        light_uncertainty: None,
        mosaic: None,
        simulated_camera: None,
        camera: None,
        recordings: Vec::new(),
        rate_maps,
        folder: folder.to_path_buf(),
    };
    let path = folder.join("recordings.toml");
    write_small(&path, set.to_toml()?.as_bytes(), force)?;
    Ok(path)
}

/// Reads the first of the arrays `names` that the archive contains. Returns the shape and the values of this array.
fn read_map(path: &Path, names: &[&str]) -> Result<([u64; 2], Vec<f64>)> {
    let name = path.display().to_string();
    let mut archive = Archive::new(&name, BufReader::new(InputFile::open(path)?.into_reader()))?;
    let arrays = archive.array_names();
    let Some(key) = names.iter().find(|key| arrays.iter().any(|a| a == *key)) else {
        return Err(Error::new(ErrorKind::Input, name)
            .found(format_args!("arrays [{}]", arrays.join(", ")))
            .expected("calibration maps D_light (or D), Nd and Nl")
            .remedy("use a recording set (.toml) for other data"));
    };
    let subject = format!("{name}: {key}");
    let (header, values) = npy::read_map(&subject, &mut archive.entry(key)?)?;
    let shape = <[u64; 2]>::try_from(&header.shape[..]).ok().filter(|s| s.iter().all(|n| *n > 0));
    let shape = shape.ok_or_else(|| {
        Error::new(ErrorKind::Input, &subject)
            .found(format_args!("shape {}", npy::shape_text(&header.shape)))
            .expected("(height, width)")
    })?;
    Ok((shape, values))
}
