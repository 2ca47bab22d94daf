//! `spikelane record --template`: from a folder of own recordings to a recording set that waits for its levels.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use spikelane::{Error, Geometry, Kind, Result};
use spikelane_calibrate::UNTOLD;
use spikelane_io::formats::Reader;
use spikelane_io::simulate::Sidecar;
use spikelane_io::storage;

use crate::shared::stream::{file_name, spikes_in};

/// Readouts that are counted to tell recordings apart.
const LOOK: usize = 500;

/// A stream of the folder.
struct Found {
    file: String,
    geometry: Geometry,
    readouts: usize,
    rate: f64,
    readout_hz: Option<f64>,
    layout: &'static str,
}

/// Writes `folder/recordings.toml`, which lists every stream of the folder, and returns its path.
///
/// # Errors
/// [`Kind::Input`] when the folder holds no stream or streams of different sizes; those of reading and writing.
pub(crate) fn write(
    folder: &Path,
    size: Option<Geometry>,
    readout_hz: Option<f64>,
    force: bool,
) -> Result<PathBuf> {
    let mut found = streams(folder)?.iter().map(|path| look(path, size)).collect::<Result<Vec<_>>>()?;
    // Darkest first, as a person lists them.
    found.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    let path = folder.join("recordings.toml");
    storage::write_small(&path, text(folder, &found, readout_hz)?.as_bytes(), force)?;
    Ok(path)
}

fn streams(folder: &Path) -> Result<Vec<PathBuf>> {
    let refused = |e| Error::io(folder.display(), e);
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if path.is_file() && ["dat", "npy", "npz"].contains(&&*ending) {
            all.push(path);
        }
    }
    all.sort();
    if all.is_empty() {
        return Err(Error::new(Kind::Input, folder.display())
            .found("no recording")
            .expected("streams that end in .dat, .npy or .npz: the dark, and flat fields of known light"));
    }
    Ok(all)
}

fn look(path: &Path, size: Option<Geometry>) -> Result<Found> {
    let reader = Reader::open(path, None, size)?;
    let readouts = reader.readouts();
    let first = readouts / 2 - LOOK.min(readouts) / 2;
    let range = first..first + LOOK.min(readouts);
    let looked = range.len();
    let count = spikes_in(&reader, range)?;
    let sidecar = Sidecar::beside(path).ok().flatten();
    Ok(Found {
        file: file_name(path),
        geometry: reader.geometry(),
        readouts,
        rate: count as f64 / (looked.max(1) * reader.geometry().pixels()) as f64,
        readout_hz: sidecar.and_then(|(_, s)| s.readout_hz),
        layout: reader.layout().name(),
    })
}

fn text(folder: &Path, found: &[Found], readout_hz: Option<f64>) -> Result<String> {
    let one = &found[0];
    if let Some(other) = found.iter().find(|f| f.geometry != one.geometry) {
        return Err(Error::new(Kind::Input, folder.join(&other.file).display())
            .found(other.geometry)
            .expected(format_args!("{}, the size of {}", one.geometry, one.file))
            .remedy("keep the recordings of one camera in a folder of their own"));
    }
    let hz = readout_hz.or_else(|| found.iter().find_map(|f| f.readout_hz));
    let mut text = format!(
        "# Recordings of one camera. Each needs its light: 0 with the cap on, else the fraction of the light that gives\n\
         # one spike per readout (a pixel that fires every fourth readout sees 0.25). Then: spikelane calibrate {}\n\
         width = {}\nheight = {}\nreadout_hz = {:.1}{}\n# light_uncertainty = 0.01  # relative, of all levels\n",
        folder.join("recordings.toml").display(),
        one.geometry.width(),
        one.geometry.height(),
        hz.unwrap_or(20_000.0),
        if hz.is_none() { "  # assumed: say what yours has" } else { "" },
    );
    for f in found {
        let _ = write!(
            text,
            "\n[[recording]]  # {} readouts, mean rate {:.4}\nfile = \"{}\"\nlayout = \"{}\"\n{}\n",
            f.readouts,
            f.rate,
            f.file.replace('\\', "\\\\").replace('"', "\\\""),
            f.layout,
            UNTOLD
        );
    }
    Ok(text)
}
