//! Scans a recording set for faults of its recordings.

use crate::faults::fault::Fault;
use crate::faults::levels::{Point, check, dark_rate, points};
use crate::faults::motion::{foreign_patterns, motion_fault};
use crate::faults::unsteady_light::{drift_faults, oscillation_faults};
use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::scan::{BLOCK_COUNT, Scan};
use crate::recordings::setup::Setup;
use crate::statistics::order::Spread;
use spikelane_calibrate::unstable::SATURATION_RATE;
use spikelane_calibrate::{LightLevel, Stimulus, StimulusPattern};

/// The faults of a recording set, and the consequences for its recordings.
pub(crate) struct FaultScan {
    pub faults: Vec<Fault>,
    /// Indices of the excluded recordings.
    pub dropped: Vec<usize>,
    /// Relative standard deviation of the light of each recording: the stated one, or a larger one if the levels
    /// contradict the stated one.
    pub light_uncertainties: Vec<f64>,
}

pub(crate) fn scan_for_faults(setup: &Setup, scans: &[Scan]) -> FaultScan {
    let stated = setup.recordings.iter().map(|r| r.light_uncertainty).collect();
    let mut seen = FaultScan { faults: Vec::new(), dropped: Vec::new(), light_uncertainties: stated };
    if setup.has_rate_maps {
        return seen;
    }
    let width = setup.geometry.width();
    let constant = (0..scans.len()).filter(|k| setup.recordings[*k].is_constant());
    seen.take(constant.filter_map(|k| Some((k, motion_fault(&setup.recordings[k], &scans[k])?))).collect());
    let level_of =
        |k: usize| setup.recordings[k].level().map(|_| (k, light_level(&setup.recordings[k], &scans[k])));
    let mut levels: Vec<(usize, LightLevel)> = (0..scans.len()).filter_map(level_of).collect();
    let pick = |levels: &mut Vec<(usize, LightLevel)>, seen: &FaultScan| {
        levels.retain(|(k, _)| !seen.dropped.contains(k))
    };
    pick(&mut levels, &seen);
    seen.take(foreign_patterns(&levels, width));
    pick(&mut levels, &seen);
    seen.take(drift_faults(&levels));
    pick(&mut levels, &seen);
    for (scene, fault) in oscillation_faults(setup, scans) {
        match scene {
            Some(k) if !seen.dropped.contains(&k) => seen.take(vec![(k, fault)]),
            Some(_) => {}
            None => seen.faults.push(fault),
        }
    }
    pick(&mut levels, &seen);
    // A recording with several sources has no lamp of its own, because its light is the sum of its sources.
    levels.retain(|(k, _)| !setup.recordings[*k].sources.is_sum());
    let mut lit = points(&levels, |k| setup.recordings[k].light_uncertainty);
    lit.extend(bright_squares(setup, scans, dark_rate(&levels)));
    let lamps = check(&lit);
    seen.faults.extend(lamps.faults(&lit, |k| setup.recordings[k].file_name()));
    for (k, uncertainty) in seen.light_uncertainties.iter_mut().enumerate() {
        *uncertainty = lamps.uncertainty(k, *uncertainty);
    }
    seen
}

impl FaultScan {
    fn take(&mut self, found: Vec<(usize, Fault)>) {
        for (k, fault) in found {
            self.dropped.push(k);
            self.faults.push(fault);
        }
    }

    /// Adds the result of the scan of another set. `place` names the other set and is appended to the file names of
    /// its faults.
    pub(crate) fn and(&mut self, more: Self, place: &str) {
        let Self { faults, dropped, light_uncertainties } = more;
        let known =
            |f: &Fault| self.faults.iter().any(|own| own.kind == f.kind && own.recording == f.recording);
        let new: Vec<Fault> = faults.into_iter().filter(|f| !known(f)).collect();
        self.faults.extend(new.into_iter().map(|f| {
            let recording = f.recording.map(|file| format!("{file}{place}"));
            Fault { recording, ..f }
        }));
        self.dropped.extend(dropped);
        for (own, more) in self.light_uncertainties.iter_mut().zip(light_uncertainties) {
            *own = own.max(more);
        }
    }
}

/// Returns the number of spikes of each pixel in the first half of a recording.
fn first_half_counts(scan: &Scan) -> Vec<u32> {
    scan.pixels.iter().map(|p| p.blocks[..BLOCK_COUNT / 2].iter().sum()).collect()
}

/// Returns the level of a recording with its rates, including the change of the rates from the first to the second
/// half.
fn light_level(scene: &RecordedScene, scan: &Scan) -> LightLevel {
    let counts = scan.pixels.iter().map(|p| p.count).collect();
    let rates = scan.pixels.iter().map(|p| p.rate).collect();
    let light = scene.level().unwrap_or_else(|| scene.brightness());
    LightLevel::from_rates(&scene.file_name(), light, scene.readouts as u32, counts, rates)
        .with_first_half(&first_half_counts(scan))
}

/// Returns the level of the bright squares of the first checkerboard. Pixels at the edges of the squares are
/// excluded. `dark` is the rate in the dark.
fn bright_squares(setup: &Setup, scans: &[Scan], dark: f64) -> Option<Point> {
    let board = |k: usize| match setup.recordings[k].light {
        Stimulus::Scene(StimulusPattern::Checkerboard { high, cell, .. }) => {
            Some((k, high, cell.max(1) as usize))
        }
        _ => None,
    };
    let (k, high, cell) = (0..scans.len()).find_map(board)?;
    let width = setup.geometry.width();
    let inside = |p: &usize| {
        let (row, col) = (p / width, p % width);
        let edge = |at: usize| at.is_multiple_of(cell) || at % cell == cell - 1;
        (row / cell + col / cell).is_multiple_of(2) && !edge(row) && !edge(col)
    };
    let rates: Vec<f64> =
        (0..scans[k].pixels.len()).filter(inside).map(|p| scans[k].pixels[p].rate).collect();
    let usual = Spread::of(&rates).trimmed;
    (rates.len() >= 100 && usual < SATURATION_RATE).then_some(Point {
        recording: None,
        light: high,
        response: (usual - dark) / high,
        uncertainty: setup.recordings[k].light_uncertainty,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::fault::FaultKind;

    #[test]
    fn what_two_takes_show_is_said_once_and_set_aside_in_both() {
        let fault = |file: &str| Fault::new(file, FaultKind::LightDrift, "drifts".to_owned());
        let mut seen = FaultScan {
            faults: vec![fault("a.dat")],
            dropped: vec![3],
            light_uncertainties: vec![0.01, 0.3],
        };
        let faults = vec![fault("a.dat"), fault("b.dat")];
        let more = FaultScan { faults, dropped: vec![3, 4], light_uncertainties: vec![0.02, 0.01] };
        seen.and(more, " of the held-out set");
        assert_eq!(seen.faults.len(), 2);
        assert_eq!(seen.faults[1].recording.as_deref(), Some("b.dat of the held-out set"));
        assert_eq!(
            (seen.dropped.as_slice(), seen.light_uncertainties),
            ([3, 3, 4].as_slice(), vec![0.02, 0.3])
        );
    }
}
