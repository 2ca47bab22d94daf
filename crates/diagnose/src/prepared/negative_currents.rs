//! Detects whether a camera keeps negative dark currents. Some models keep them, and others set them to zero.
//!
//! No parameter of the base model distinguishes both. Measured with three cameras, in each of which one pixel of
//! two hundred had a negative current: for one of them, the tails of the rates about the lines of the pixels
//! deviated by 6.4 standard deviations. The deviations were in the dark recording and in the dimmest flat.

use crate::recordings::scan::Scan;
use crate::recordings::setup::Setup;
use crate::statistics::order::Spread;
use crate::thresholds::{FAINT_PIXELS, MAX_DIM_LIGHT, MIN_CHARGE_DEFICIT_SDS, MIN_SINGLE_DEFICIT_SDS};
use spikelane_calibrate::fit_line;

/// Returns whether some pixels without a spike in the dark recording also have too little charge in dim light.
pub(crate) fn has_negative_currents(setup: &Setup, scans: &[Scan]) -> bool {
    let level = |k: usize| setup.recordings[k].level().map(|light| (k, light));
    let levels: Vec<(usize, f64)> = (0..scans.len()).filter_map(level).collect();
    let Some((dark, _)) = levels.iter().find(|l| l.1 == 0.0).copied() else { return false };
    let dim: Vec<(usize, f64)> = levels.into_iter().filter(|l| l.1 > 0.0 && l.1 <= MAX_DIM_LIGHT).collect();
    if dim.len() < 2 {
        return false;
    }
    let short = |p: usize| {
        let rate = scans[dark].pixels[p].rate;
        let point = |(k, light): &(usize, f64)| (*light, scans[*k].pixels[p].rate, light.powi(2));
        let points: Vec<(f64, f64, f64)> = dim.iter().map(point).collect();
        // Weights are the inverse squares of the light. A dead pixel is excluded, because its rate contains no
        // information.
        let is_alive = points.iter().all(|point| point.1 > 0.0);
        fit_line(&points).filter(|_| is_alive).map(|line| (rate, line.d - rate))
    };
    let mut all: Vec<(f64, f64)> = (0..scans[dark].pixels.len()).filter_map(short).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let silent = all.iter().take_while(|x| x.0 == 0.0).count();
    let faint: Vec<f64> = all[silent..].iter().take(FAINT_PIXELS).map(|x| x.1).collect();
    if faint.len() < FAINT_PIXELS / 2 {
        return false;
    }
    let usual = Spread::of(&faint);
    let below = |by: f64| all[..silent].iter().filter(|x| x.1 < usual.median() - by * usual.sd()).count();
    below(MIN_SINGLE_DEFICIT_SDS) > 0 || below(MIN_CHARGE_DEFICIT_SDS) > 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::extent::ReadoutSelection;
    use crate::recordings::extent::RecordingPart;
    use crate::sensors::model::Model;
    use crate::sensors::model::published;
    use crate::sensors::simulate::scans;
    use spikelane::effects::dark_current;

    /// Simulates a published sensor of 48x48 pixels, in which about ten pixels have a negative dark current.
    /// Returns whether negative currents are detected.
    fn told(kept_below: bool, seed: u64) -> bool {
        let folder = tempfile::tempdir().unwrap();
        let lights = [0.0, 0.03, 0.1, 0.3];
        let mut toml = "width = 48\nheight = 48\nreadout_hz = 20000.0\n".to_owned();
        for (i, light) in lights.iter().enumerate() {
            std::fs::write(folder.path().join(format!("{i}.dat")), vec![0; 3000 * 48 * 6]).unwrap();
            toml += &format!("[[recording]]\nfile = \"{i}.dat\"\nlight = {light:?}\n");
        }
        std::fs::write(folder.path().join("recordings.toml"), toml).unwrap();
        let set = spikelane_calibrate::RecordingSet::open(&folder.path().join("recordings.toml")).unwrap();
        let setup = Setup::new(&set, RecordingPart::Whole, ReadoutSelection::Leading).unwrap();
        let camera = published(&setup).unwrap();
        let below = if kept_below { 0.0 } else { 1.0 };
        let dark =
            camera.effect(dark_current::EFFECT.name).unwrap().clone().with_value("negative", below).unwrap();
        let model = Model::base(camera.with_effect(dark), &setup);
        let sample = model.sample(&[], &[]).unwrap();
        has_negative_currents(&setup, &scans(&setup, &sample, seed).unwrap())
    }

    #[test]
    fn currents_below_zero_are_told_from_none() {
        for seed in 0..6 {
            assert!(!told(false, seed), "{seed}");
            assert!(told(true, seed), "{seed}");
        }
    }
}
