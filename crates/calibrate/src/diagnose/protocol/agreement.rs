//! Whether sets hold enough, and were recorded alike.

use super::recorded::Scene;
use super::recorded_set::Setup;
use spikelane::error::{Error, Kind, Result};

/// What every diagnosis needs.
pub(in crate::diagnose) fn poor(setup: &Setup, with_camera: bool) -> Result<()> {
    let of_one_kind = setup.maps || setup.scenes.iter().any(|s| s.still.is_some());
    // Maps, or a still scene, judge a camera that is given.
    if with_camera && of_one_kind {
        return Ok(());
    }
    let levels: Vec<f64> = setup.scenes.iter().filter_map(Scene::level).collect();
    let lit = levels.iter().filter(|l| **l > 0.0).count();
    if levels.len() >= 3 && lit >= 2 && setup.geometry.width() >= 8 && setup.geometry.height() >= 8 {
        return Ok(());
    }
    let remedy = if of_one_kind {
        "give the camera's model with --camera: maps and still scenes tell too little to calibrate one"
    } else {
        "record the dark, flats at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation, steps and a checkerboard"
    };
    Err(Error::new(Kind::Input, "recording set")
        .found(format_args!("{} uniform levels, {lit} of them lit, at {}", levels.len(), setup.geometry))
        .expected("the dark and two or more lit levels, 8x8 pixels or more")
        .remedy(remedy))
}

/// Whether two sets were recorded alike; else what differs first.
pub(in crate::diagnose) fn same_protocol(a: &Setup, b: &Setup) -> Result<()> {
    let key = |s: &Setup, k: usize| s.scenes.get(k).map(|x| (format!("{:?}", x.light), x.readouts));
    let size = |s: &Setup| format!("{} at {} readouts per second", s.geometry, s.readout_hz);
    let other = (0..a.scenes.len().max(b.scenes.len())).find(|k| key(a, *k) != key(b, *k));
    let said = |s: &Setup| match other {
        _ if size(a) != size(b) => size(s),
        Some(k) => s.scenes.get(k).map_or_else(
            || format!("{} recordings", s.scenes.len()),
            |x| format!("{} of light {:?} with {} readouts", x.file_name(), x.light, x.readouts),
        ),
        None => String::new(),
    };
    if other.is_none() && size(a) == size(b) {
        return Ok(());
    }
    Err(Error::new(Kind::Input, "held-out recordings").found(said(b)).expected(format_args!(
        "the same scenes in the same order, as long as those of the first set: {}",
        said(a)
    )))
}
