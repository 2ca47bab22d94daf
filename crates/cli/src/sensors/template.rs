//! Implements `spikelane record --template`. It writes a recording set for a folder of recordings. The user adds the light
//! levels.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_calibrate::UNSPECIFIED_LIGHT;
use spikelane_io::formats::StreamReader;
use spikelane_io::storage;

use crate::common::{count_spikes, file_name, sidecar_beside};

/// Number of readouts from which the rate of a recording is measured. The rate helps users to identify recordings.
const RATE_SAMPLE_READOUTS: usize = 500;

/// A stream in the folder.
struct StreamInfo {
    file: String,
    geometry: Geometry,
    readouts: usize,
    rate: f64,
    readout_hz: Option<f64>,
    layout: &'static str,
}

/// Writes `folder/recordings.toml`, which lists every stream in the folder. Returns the path of this file.
///
/// # Errors
/// * [`ErrorKind::Input`] if the folder contains no stream, or streams of different sizes.
/// * If a file cannot be read or written.
pub(crate) fn write(
    folder: &Path,
    size: Option<Geometry>,
    readout_hz: Option<f64>,
    force: bool,
) -> Result<PathBuf> {
    let mut streams =
        find_streams(folder)?.iter().map(|path| read_stream_info(path, size)).collect::<Result<Vec<_>>>()?;
    // The recordings are sorted from dark to bright, so that users can compare the order with their light levels.
    streams.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    let path = folder.join("recordings.toml");
    storage::write_small(&path, template_text(folder, &streams, readout_hz)?.as_bytes(), force)?;
    Ok(path)
}

fn find_streams(folder: &Path) -> Result<Vec<PathBuf>> {
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
        return Err(Error::new(ErrorKind::Input, folder.display())
            .found("no recording")
            .expected("streams that end in .dat, .npy or .npz: dark and flat fields of known light"));
    }
    Ok(all)
}

fn read_stream_info(path: &Path, size: Option<Geometry>) -> Result<StreamInfo> {
    let reader = StreamReader::open(path, None, size)?;
    let readouts = reader.readouts();
    let first = readouts / 2 - RATE_SAMPLE_READOUTS.min(readouts) / 2;
    let range = first..first + RATE_SAMPLE_READOUTS.min(readouts);
    let counted_readouts = range.len();
    let count = count_spikes(&reader, range)?;
    let sidecar = sidecar_beside(path)?;
    Ok(StreamInfo {
        file: file_name(path),
        geometry: reader.geometry(),
        readouts,
        rate: count as f64 / (counted_readouts.max(1) * reader.geometry().pixels()) as f64,
        readout_hz: sidecar.and_then(|(_, s)| s.readout_hz),
        layout: reader.layout().name(),
    })
}

fn template_text(folder: &Path, streams: &[StreamInfo], readout_hz: Option<f64>) -> Result<String> {
    let one = &streams[0];
    if let Some(other) = streams.iter().find(|f| f.geometry != one.geometry) {
        return Err(Error::new(ErrorKind::Input, folder.join(&other.file).display())
            .found(other.geometry)
            .expected(format_args!("{}, the size of {}", one.geometry, one.file))
            .remedy("put the recordings of each camera into a separate folder"));
    }
    let hz = readout_hz.or_else(|| streams.iter().find_map(|f| f.readout_hz));
    let mut text = format!(
        "# Recordings of one camera. Set the light of each recording: 0 in the dark, otherwise a fraction of the light that\n# gives one spike per readout (0.25 if a pixel fires at every fourth readout). Then run: spikelane calibrate {}\nwidth = {}\nheight = {}\nreadout_hz = {:.1}{}\n# light_uncertainty = 0.01  # relative, of all levels\n# [camera]  # printed in reports\n# name = \"\"\n# serial = \"\"\n# temperature_c = 25.0\n# date = \"\"\n",
        folder.join("recordings.toml").display(),
        one.geometry.width(),
        one.geometry.height(),
        hz.unwrap_or(20_000.0),
        if hz.is_none() { "  # assumed: set the rate of your camera" } else { "" },
    );
    for f in streams {
        let _ = write!(
            text,
            "\n[[recording]]  # {}, mean rate {:.4}\nfile = \"{}\"\nlayout = \"{}\"\n{}\n",
            Count(f.readouts, "readout"),
            f.rate,
            f.file.replace('\\', "\\\\").replace('"', "\\\""),
            f.layout,
            UNSPECIFIED_LIGHT
        );
    }
    Ok(text)
}
