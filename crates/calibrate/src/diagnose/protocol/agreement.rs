//! Whether sets hold enough, and were recorded alike.

use super::recorded::RecordedScene;
use super::recorded_set::Setup;
use spikelane::error::{Error, ErrorKind, Result, Setting};

/// What every diagnosis needs.
pub(in crate::diagnose) fn poor(setup: &Setup, with_camera: bool) -> Result<()> {
    let of_one_kind = setup.has_rate_maps || setup.recordings.iter().any(|s| s.static_scene.is_some());
    // Maps, or a still scene, judge a camera that is given.
    if with_camera && of_one_kind {
        return Ok(());
    }
    let levels: Vec<f64> = setup.recordings.iter().filter_map(RecordedScene::level).collect();
    let lit = levels.iter().filter(|l| **l > 0.0).count();
    if levels.len() >= 3 && lit >= 2 && setup.geometry.width() >= 8 && setup.geometry.height() >= 8 {
        return Ok(());
    }
    let remedy = if of_one_kind {
        format!("set {}: maps and static scenes are not sufficient for a calibration", Setting("camera"))
    } else {
        "record a dark recording, flat fields at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation, steps and a checkerboard"
            .to_owned()
    };
    Err(Error::new(ErrorKind::Input, "recording set")
        .found(format_args!("{} uniform levels, of which {lit} are lit, at {}", levels.len(), setup.geometry))
        .expected("a dark level and at least two lit levels, at least 8x8 pixels")
        .remedy(remedy))
}

/// Whether two sets were recorded alike; else what differs first.
pub(in crate::diagnose) fn same_protocol(a: &Setup, b: &Setup) -> Result<()> {
    let names = |x: &RecordedScene| x.sources.sources.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    let key =
        |s: &Setup, k: usize| s.recordings.get(k).map(|x| (format!("{:?}", x.light), names(x), x.readouts));
    let size = |s: &Setup| format!("{} at {} readouts per second", s.geometry, s.readout_hz);
    let other = (0..a.recordings.len().max(b.recordings.len())).find(|k| key(a, *k) != key(b, *k));
    let said = |s: &Setup| match other {
        _ if size(a) != size(b) => size(s),
        Some(k) => s.recordings.get(k).map_or_else(
            || format!("{} recordings", s.recordings.len()),
            |x| {
                let of =
                    if names(x).is_empty() { String::new() } else { format!(" of {}", names(x).join(", ")) };
                format!("{} of light {:?}{of} with {} readouts", x.file_name(), x.light, x.readouts)
            },
        ),
        None => String::new(),
    };
    if other.is_none() && size(a) == size(b) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, "held-out recordings").found(said(b)).expected(format_args!(
        "the same scenes in the same order and of the same length as in the first set: {}",
        said(a)
    )))
}
