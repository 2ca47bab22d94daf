//! Numbers of whole recordings, real and simulated, side by side.

use serde::Serialize;

use super::times::{Line, Times};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::draws::Seeds;

/// Lags of the variance of spike times that are listed.
pub(super) const LAGS: [usize; 4] = [1, 8, 16, 32];

/// Shares of the pixels whose dark rates are listed; the last is the highest of all.
pub(super) const SHARES: [f64; 5] = [0.01, 0.5, 0.99, 0.9999, 1.0];

/// What whole recordings say, in natural units.
#[derive(Clone, Debug, Serialize)]
pub struct Numbers {
    /// The camera, or `real`.
    pub name: String,
    /// Mean square of what 1, 8, 16 and 32 intervals take more or less than at the pixel's rate, in readouts squared, over the pixels that have
    /// half as many intervals again; absent where none has.
    pub d: [Option<f64>; LAGS.len()],
    /// Share of intervals shorter than both whole numbers about the pixel's mean.
    pub early: f64,
    /// Share of longer ones.
    pub late: f64,
    /// Rates in the dark that 1 %, half, 99 %, 99.99 % and all of the pixels do not exceed, in spikes per readout; absent where no map was given.
    pub dark: Option<[f64; SHARES.len()]>,
}

impl Numbers {
    /// Of one camera's recordings, at pixels that are `used`; means over the recordings.
    pub(super) fn of(
        name: &str,
        recordings: &[Times],
        used: &[bool],
        dark: Option<[f64; SHARES.len()]>,
    ) -> Self {
        let all: Vec<[f64; LAGS.len() + 2]> =
            recordings.iter().map(|times| measure(times, &times.lines(), used)).collect();
        let mean = |i: usize| all.iter().map(|m| m[i]).sum::<f64>() / all.len() as f64;
        Self {
            name: name.to_owned(),
            d: std::array::from_fn(|i| Some(mean(i)).filter(|d| d.is_finite())),
            early: mean(LAGS.len()),
            late: mean(LAGS.len() + 1),
            dark,
        }
    }

    /// A line of a table of text.
    #[must_use]
    pub fn text(&self) -> String {
        let d: String = self.d.iter().map(|d| format!("{:>8}", variance(*d))).collect();
        let flips = format!("{:>8.0}{:>8.0}", 1e6 * self.early, 1e6 * self.late);
        let dark = self.dark.iter().flatten().map(|r| format!("{r:>8.4}")).collect::<String>();
        format!("{:<16}{d}{flips}{dark}", self.name)
    }

    /// What stands above such lines.
    #[must_use]
    pub fn head(&self) -> String {
        let d: String = LAGS.iter().map(|n| format!("{:>8}", format!("D({n})"))).collect();
        let dark =
            if self.dark.is_some() { "   dark rates: 1 %, median, 99 %, 99.99 %, highest" } else { "" };
        format!("{:<16}{d}{:>8}{:>8}{dark}", "", "early", "late")
    }
}

/// A variance, if there is one.
pub(super) fn variance(d: Option<f64>) -> String {
    d.map_or("none".to_owned(), |d| format!("{d:.4}"))
}

fn measure(times: &Times, lines: &[Line], used: &[bool]) -> [f64; LAGS.len() + 2] {
    let mut found = [[0.0; 2]; LAGS.len() + 2];
    for p in (0..lines.len()).filter(|p| used[*p] && lines[*p].rate.is_finite() && lines[*p].rate <= 1.0) {
        let (spikes, mean) = (times.of_pixel(p), 1.0 / lines[p].rate);
        for (sum, n) in
            found.iter_mut().zip(LAGS).filter(|(_, n)| 2 * spikes.len() > 3 * n && spikes.len() > n + 1)
        {
            let square = |run: &[u32]| (f64::from(run[n] - run[0]) - n as f64 * mean).powi(2);
            sum[0] += spikes.windows(n + 1).map(square).sum::<f64>() / (spikes.len() - n) as f64;
            sum[1] += 1.0;
        }
        for pair in spikes.windows(2) {
            let interval = f64::from(pair[1] - pair[0]);
            found[LAGS.len()][0] += f64::from(u8::from(interval < mean.floor()));
            found[LAGS.len() + 1][0] += f64::from(u8::from(interval > mean.ceil()));
            found[LAGS.len()][1] += 1.0;
            found[LAGS.len() + 1][1] += 1.0;
        }
    }
    // Without an interval nothing is early or late; a variance of none is left out.
    let mean = |i: usize| if i >= LAGS.len() && found[i][1] == 0.0 { 0.0 } else { found[i][0] / found[i][1] };
    std::array::from_fn(mean)
}

/// Dark rates of a camera with its fixed pattern.
pub(super) fn dark_of(camera: &Camera, seeds: Seeds) -> Result<[f64; SHARES.len()]> {
    let model = camera.model(seeds)?;
    let rate = |p: usize| {
        let law = model.law(p);
        law.dark / law.threshold
    };
    Ok(quantiles((0..model.circuit.pixels()).map(rate).collect()))
}

/// The values that the [`SHARES`] do not exceed.
pub(super) fn quantiles(mut values: Vec<f64>) -> [f64; SHARES.len()] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    SHARES.map(|share| {
        values.get(((share * last as f64).round() as usize).min(last)).copied().unwrap_or(f64::NAN)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::Geometry;

    #[test]
    fn regular_spikes_have_no_variance_and_one_that_comes_late_is_counted() {
        let geometry = Geometry::new(8, 1).unwrap();
        // The first pixel fires at every fifth readout; the second too, but once a readout late.
        let bit = |t: usize, late: usize| u8::from(t.is_multiple_of(5) && t != 50 || t == 50 + late);
        let packed: Vec<u8> = (0..100).map(|t| bit(t, 0) | bit(t, 1) << 1).collect();
        let times = Times::of_packed(geometry, &packed).unwrap();
        let only = |p: usize| (0..8).map(|q| q == p).collect::<Vec<_>>();
        let first = Numbers::of("first", std::slice::from_ref(&times), &only(0), None);
        assert!(first.d[0].unwrap() < 1e-20 && first.early == 0.0 && first.late == 0.0, "{first:?}");
        let second = Numbers::of("second", std::slice::from_ref(&times), &only(1), None);
        // Of nineteen intervals one has six readouts and the next four; the line through all is close to five.
        assert!((second.d[0].unwrap() - 2.0 / 19.0).abs() < 0.01, "{second:?}");
        assert!(second.early + second.late >= 1.0 / 19.0, "{second:?}");
    }

    #[test]
    fn quantiles_are_values_of_the_pixels() {
        let found = quantiles((0..10_001).rev().map(f64::from).collect());
        assert_eq!(found, [100.0, 5000.0, 9900.0, 9999.0, 10_000.0]);
    }
}
