//! Recordings of a set, read and measured.

use super::all::vector;
use super::rate_maps;
use crate::RecordingSet;
use crate::diagnose::events::located::{Located, places};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::bits::PixelBits;
use crate::diagnose::recording::scan::{Scan, scan_turned};
use spikelane::error::Result;
use spikelane::spikes::SpikeFramesRef;

/// A measured set: its vector of statistics and the scans that it comes from.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Measured {
    pub scans: Vec<Scan>,
    pub values: Vec<f64>,
    pub located: Located,
}

/// Reads and measures the recordings of `set`.
pub(in crate::diagnose) fn measure(setup: &Setup, set: &RecordingSet) -> Result<Measured> {
    if setup.has_rate_maps {
        let values = rate_maps::measured(setup, set)?;
        return Ok(Measured { scans: Vec::new(), values, located: Located::default() });
    }
    let (mut scans, mut located) = (Vec::new(), Vec::new());
    for (scene, recording) in setup.recordings.iter().zip(&set.recordings) {
        let bytes = setup.part(set, recording, scene)?;
        let frames = SpikeFramesRef::new(setup.geometry, &bytes)?;
        let bits = PixelBits::new(frames)?;
        let mut found = scan_turned(frames, &bits, scene.look());
        if let Some(still) = &scene.static_scene {
            still.keep(&mut found);
        }
        located.push(places(frames, &bits, &found, scene));
        scans.push(found);
    }
    let values = vector(setup, &scans).values;
    Ok(Measured { scans, values, located: Located(located) })
}
