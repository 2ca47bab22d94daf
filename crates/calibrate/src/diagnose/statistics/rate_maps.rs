//! Statistics of a set of which only maps of rates are known.

use super::entry::Vector;
use super::maps::{self, Map};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::{RecordingSet, measure_levels};
use spikelane::error::{Error, ErrorKind, Result};

/// Statistics of measured rate maps: the darkest and the brightest of them.
pub(in crate::diagnose) fn measured(setup: &Setup, set: &RecordingSet) -> Result<Vec<f64>> {
    let observed = measure_levels(set, &mut |_, _| {})?;
    let (Some(dark), Some(bright)) = (observed.levels.first(), observed.levels.last()) else {
        return Err(Error::new(ErrorKind::Input, "rate maps")
            .found("none")
            .expected("one dark rate map and one lit rate map"));
    };
    let step = bright.light - dark.light;
    let gain: Vec<f64> = bright.rate.iter().zip(&dark.rate).map(|(b, d)| (b - d) / step).collect();
    Ok(of_lines(&gain, &dark.rate, setup).values)
}

/// Statistics of the maps of gain and dark current, in thresholds.
pub(in crate::diagnose) fn of_lines(gain: &[f64], dark: &[f64], setup: &Setup) -> Vector {
    let mut v = Vector { statistics: Vec::new(), values: Vec::new() };
    maps::of_lines(&mut v, &Map::new(gain), &Map::new(dark), setup.geometry.width());
    v
}
