//! Every pixel's line `x = a light + d` over the uniform levels, and what is left of it.
//!
//! The weights depend on the levels alone, so that the fit is the same statistic for every camera;
//! `calibrate` has the efficient estimator.

use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::scan::Scan;

/// Rates above this tell little: the pixel fires at nearly every readout.
const SATURATED: f64 = 0.985;

/// Maps of a set.
pub(in crate::diagnose) struct Lines {
    pub gain: Vec<f64>,
    pub dark: Vec<f64>,
    /// Recording and what its rates leave, relative.
    pub residuals: Vec<(usize, Vec<f64>)>,
}

impl Lines {
    pub(crate) fn expected(&self, p: usize, light: f64) -> f64 {
        self.gain[p] * light + self.dark[p]
    }
}

/// The scale on which a level's rate is judged: the light, or a hundredth in the dark.
fn scale(light: f64) -> f64 {
    light.max(0.01)
}

/// `None` without two levels.
pub(in crate::diagnose) fn lines(setup: &Setup, scans: &[Scan]) -> Option<Lines> {
    let levels: Vec<(usize, f64)> = setup
        .recordings
        .iter()
        .enumerate()
        .filter_map(|(k, s)| Some((k, s.found_light().level()?)))
        .collect();
    if levels.len() < 2 {
        return None;
    }
    let n = scans[0].pixels.len();
    let mut fitted = Lines { gain: vec![0.0; n], dark: vec![0.0; n], residuals: Vec::new() };
    let weighed: Vec<(usize, f64, f64)> = levels.iter().map(|(k, l)| (*k, *l, scale(*l).powi(-2))).collect();
    for p in 0..n {
        (fitted.gain[p], fitted.dark[p]) = line(&weighed, |k| scans[k].pixels[p].rate);
    }
    for (k, light) in &levels {
        let off = |p: usize| {
            let rate = scans[*k].pixels[p].rate;
            // A pixel that never fires does not follow a lamp's error as the others do: a hundredth of such pixels would be
            // the others' tail.
            let dead = rate <= 0.0 && *light > 0.0;
            if dead || rate > SATURATED {
                f64::NAN
            } else {
                (rate - fitted.expected(p, *light)) / scale(*light)
            }
        };
        fitted.residuals.push((*k, (0..n).map(off).collect()));
    }
    Some(fitted)
}

/// The line over levels, each with its weight.
fn line(levels: &[(usize, f64, f64)], rate: impl Fn(usize) -> f64) -> (f64, f64) {
    let (mut s0, mut s1, mut s2, mut y0, mut y1) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (k, light, w) in levels {
        let f = rate(*k);
        if f > SATURATED {
            continue;
        }
        s0 += w;
        s1 += w * light;
        s2 += w * light * light;
        y0 += w * f;
        y1 += w * light * f;
    }
    let det = s0 * s2 - s1 * s1;
    if det <= 1e-9 * s0 * s2 {
        return (0.0, 0.0);
    }
    ((s0 * y1 - s1 * y0) / det, (s2 * y0 - s1 * y1) / det)
}
