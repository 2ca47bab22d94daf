//! When a silent pixel is a dead one.

use super::Counts;
use super::estimate::median;

/// A pixel below this share of its neighbours' rate is a defect of its own.
const MARGIN: f64 = 0.5;

/// Chance that any pixel of a recording is called dead and is not.
const CHANCE: f64 = 0.01;

/// Whether a pixel that fires at `rate` times a half cannot be silent for `readouts` readouts, on a sensor of `pixels` pixels.
///
/// Readouts that fire independently leave a pixel of rate `f` silent with the chance `(1 - f)^T`, and that is the most: a
/// pixel that gathers charge fires `f T` times to one spike, whatever its phase, and noise only brings it nearer to the
/// independent one. Any pixel of the sensor may be the silent one (Bonferroni), so it is impossible where
/// `pixels (1 - rate / 2)^T < 0.01`, and where even a regular pixel would have fired, `rate / 2 T > 2`. At a rate of 0.2
/// and 100,000 pixels that takes 153 readouts.
#[must_use]
pub fn silence_is_impossible(rate: f64, readouts: u32, pixels: usize) -> bool {
    let (least, readouts) = (MARGIN * rate.clamp(0.0, 1.0), f64::from(readouts));
    readouts * (-least).ln_1p() < (CHANCE / pixels as f64).ln() && least * readouts > 2.0
}

/// Pixels that never fired though their neighbours make that impossible: by the median rate of the 5x5 box without the
/// pixel, in which silent neighbours count as 0. Of a dark corner nothing is known.
pub(super) fn dead(counts: &Counts, width: usize) -> Vec<usize> {
    let (height, readouts) = (counts.count.len() / width, counts.readouts());
    let impossible = |p: &usize| {
        let (row, col) = (p / width, p % width);
        let rows = row.saturating_sub(2)..(row + 3).min(height);
        let around = rows.flat_map(|r| {
            let cols = col.saturating_sub(2)..(col + 3).min(width);
            cols.map(move |c| r * width + c)
        });
        let others = around.filter(|q| q != p);
        let mut rates: Vec<f64> = others.map(|q| f64::from(counts.count[q]) / f64::from(readouts)).collect();
        silence_is_impossible(median(&mut rates), readouts, counts.count.len())
    };
    (0..counts.count.len()).filter(|p| counts.count[*p] == 0).filter(impossible).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_of_a_fifth_takes_153_readouts() {
        let found = (1..1000).find(|t| silence_is_impossible(0.2, *t, 100_000));
        assert_eq!(found, Some(153));
        assert!(!silence_is_impossible(f64::NAN, 1000, 10), "no neighbours tell nothing");
        assert!(!silence_is_impossible(0.0, u32::MAX, 10));
    }
}
