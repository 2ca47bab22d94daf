//! Which of the stated light levels to believe.
//!
//! Recordings alone tell the levels `m` up to one scale and one shift: with `x = a m + d` in every pixel, levels `s m + t` with gains `a / s`
//! and dark rates `d - a t / s` give the same rates. Stated levels fix both, and the dark, which is dark, fixes
//! the shift. So what was found is laid onto what was stated by least trimmed squares (Rousseeuw 1984): of `n` lit levels the
//! `n - n/3` that agree best decide. A fit of `p` numbers to `h` of `n` values is exact for them whatever the others
//! are if `h >= (n + p + 1) / 2` (Rousseeuw and Leroy 1987, section 3.4). With the dark `p` is 1, and three lit levels suffice for one
//! that is wrong; without it `p` is 2, and it takes four.

use super::doubt::{Stated, doubt};
use crate::formulas::solve::solve;

/// A level that is further from the line of the others, in its stated deviations, is named. Of levels that are as good as stated one in
/// two thousand is.
const FAR: f64 = 3.5;

/// An error that is so many times that of the believed levels is told.
const DOUBTFUL: f64 = 1.5;

/// How found levels become light: `scale * found + shift`.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub(super) scale: f64,
    pub(super) shift: f64,
    /// Relative standard error of the scale that all levels share.
    pub(super) scale_error: f64,
    /// Standard error of the shift, 0 where the dark was recorded.
    pub(super) shift_error: f64,
    /// Levels that lie off the line of the others.
    pub(super) wrong: Vec<bool>,
    /// Whether one wrong level could be told from the others.
    pub(super) told: bool,
    /// Whether other levels than the ones that were believed agree nearly as well.
    pub(super) doubtful: bool,
}

/// Lays found levels onto stated ones; `None` where more than a third of them lie off the line of the rest.
pub(super) fn align(levels: &[Stated]) -> Option<Alignment> {
    let lit: Vec<Stated> = levels.iter().copied().filter(|l| l.light > 0.0).collect();
    let dark = levels.iter().find(|l| l.light == 0.0);
    let parameters = if dark.is_some() { 1 } else { 2 };
    let (n, kept) = (lit.len(), lit.len() - lit.len() / 3);
    let told = kept < n && kept >= (n + parameters).div_ceil(2);
    let mut line = match (dark, n) {
        (None, 0) => return None,
        (None, 1) => (lit[0].light / lit[0].found, 0.0),
        _ if told => trimmed(&lit, dark, kept),
        _ => weighted(&lit, dark, &vec![true; n])?.0,
    };
    let off = |(scale, shift): (f64, f64)| move |l: &Stated| (scale * l.found + shift - l.light) / l.sd;
    let mut believed = vec![true; n];
    if told {
        // The trimmed line is refined by all levels that agree with it, until these stay the same.
        for _ in 0..10 {
            let agree: Vec<bool> = lit.iter().map(off(line)).map(|z| z.abs() <= FAR).collect();
            if agree.iter().filter(|a| **a).count() < kept {
                return None;
            }
            line = weighted(&lit, dark, &agree)?.0;
            if agree == believed {
                break;
            }
            believed = agree;
        }
    }
    let [mut scale_error, mut shift_error] = match (dark, n) {
        (None, 1) => [lit[0].sd / lit[0].light, 0.0],
        _ => weighted(&lit, dark, &believed)?.1,
    };
    if !told {
        // Two levels that contradict each other: whichever is right lies within.
        let worst = lit.iter().map(off(line)).fold(1.0_f64, |w, z| w.max(z.abs()));
        scale_error *= worst;
        shift_error *= worst;
    }
    let (mut doubtful, sure) = (false, [scale_error, shift_error]);
    if told {
        let held = doubt(&lit, dark, line, sure);
        (scale_error, shift_error) = (sure[0].max(held[0]), sure[1].max(held[1]));
        doubtful = scale_error > DOUBTFUL * sure[0];
    }
    let wrong = levels.iter().map(|l| l.light > 0.0 && told && off(line)(l).abs() > FAR).collect();
    let (scale, shift) = line;
    Some(Alignment { scale, shift, scale_error, shift_error, wrong, told, doubtful })
}

/// The line through two levels, or through the dark and one, of which the `kept` nearest levels are nearest.
fn trimmed(lit: &[Stated], dark: Option<&Stated>, kept: usize) -> (f64, f64) {
    let mut best = (f64::INFINITY, (1.0, 0.0));
    for (i, p) in lit.iter().enumerate() {
        let others: Vec<&Stated> = dark.map_or_else(|| lit[i + 1..].iter().collect(), |d| vec![d]);
        for q in others.into_iter().filter(|q| q.found != p.found) {
            let scale = (p.light - q.light) / (p.found - q.found);
            let shift = p.light - scale * p.found;
            let mut squares: Vec<f64> =
                lit.iter().map(|l| ((scale * l.found + shift - l.light) / l.sd).powi(2)).collect();
            squares.sort_by(f64::total_cmp);
            let sum = squares[..kept].iter().sum();
            if sum < best.0 {
                best = (sum, (scale, shift));
            }
        }
    }
    best.1
}

/// The weighted line of the believed levels, and the errors of its scale (relative) and of its shift.
fn weighted(lit: &[Stated], dark: Option<&Stated>, believed: &[bool]) -> Option<((f64, f64), [f64; 2])> {
    let used = lit.iter().zip(believed).filter(|(_, b)| **b).map(|(l, _)| l);
    if let Some(dark) = dark {
        let (mut top, mut weight) = (0.0, 0.0);
        for l in used {
            let (m, w) = (l.found - dark.found, l.sd.powi(-2));
            top += w * m * l.light;
            weight += w * m * m;
        }
        let scale = top / weight;
        return scale.is_finite().then(|| ((scale, -scale * dark.found), [weight.powf(-0.5) / scale, 0.0]));
    }
    let (mut h, mut g) = ([0.0; 4], [0.0; 2]);
    for l in used {
        let (m, w) = (l.found, l.sd.powi(-2));
        h = [h[0] + w * m * m, h[1] + w * m, h[2] + w * m, h[3] + w];
        g = [g[0] + w * m * l.light, g[1] + w * l.light];
    }
    let (line, variance) = solve(&h, &g, 2)?;
    Some(((line[0], line[1]), [variance[0].sqrt() / line[0], variance[1].sqrt()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found levels are the true ones up to a scale of 0.97 and, without the dark, a shift.
    fn levels(stated: &[f64], off: &[f64], shift: f64) -> Vec<Stated> {
        let of = |(s, e): (&f64, &f64)| Stated {
            found: 0.97 * s * (1.0 + e) + shift,
            light: *s,
            sd: if *s == 0.0 { 1e-12 } else { 0.01 * s },
        };
        stated.iter().zip(off).map(of).collect()
    }

    #[test]
    fn a_third_of_the_levels_may_be_wrong_by_a_tenth() {
        let stated = [0.0, 0.03, 0.1, 0.2, 0.3, 0.6, 0.9];
        let found = align(&levels(&stated, &[0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0], 0.0)).unwrap();
        assert!((found.scale * 0.97 - 1.0).abs() < 1e-12 && found.told, "{found:?}");
        assert_eq!(found.wrong, [false, true, false, false, false, true, false]);
        // Four good levels of 1 %, and a little doubt.
        assert!((0.005..0.006).contains(&found.scale_error) && !found.doubtful, "{found:?}");
    }

    #[test]
    fn without_the_dark_four_levels_tell_one_that_is_wrong_and_three_do_not() {
        let off = [0.0, 0.0, 0.1, 0.0];
        let found = align(&levels(&[0.05, 0.2, 0.5, 0.9], &off, 0.01)).unwrap();
        assert_eq!((found.told, found.wrong), (true, vec![false, false, true, false]));
        assert!((found.scale * 0.97 - 1.0).abs() < 1e-9 && (found.shift + 0.01 / 0.97).abs() < 1e-9);
        let found = align(&levels(&[0.05, 0.2, 0.5], &off[1..], 0.01)).unwrap();
        assert!(!found.told);
    }

    #[test]
    fn of_two_levels_that_contradict_each_other_the_interval_holds_both() {
        let found = align(&levels(&[0.0, 0.3, 0.6], &[0.0, 0.0, 0.1], 0.0)).unwrap();
        assert!(!found.told && found.wrong.iter().all(|w| !w));
        let z = (found.scale * 0.97 - 1.0).abs() / found.scale_error;
        assert!(z < 1.96, "{z}: {found:?}");
    }

    #[test]
    fn where_half_of_the_levels_disagree_with_the_others_nothing_is_chosen() {
        let off = [0.0, 0.0, 0.0, 0.1, 0.1];
        assert!(align(&levels(&[0.0, 0.1, 0.3, 0.5, 0.8], &off, 0.0)).is_none());
    }

    /// Lamps of 1 %, found off by so many per cent, and the dark.
    fn with_dark(off: &[f64]) -> Vec<Stated> {
        let dark = Stated { found: 0.0, light: 0.0, sd: 1e-12 };
        let lit = off.iter().enumerate().map(|(k, e)| {
            let light = 0.2 + 0.1 * k as f64;
            Stated { found: light * (1.0 + e / 100.0), light, sd: 0.01 * light }
        });
        std::iter::once(dark).chain(lit).collect()
    }

    #[test]
    fn two_pairs_of_lamps_that_agree_alike_are_both_held_by_the_error() {
        // The first two are right, or the last two.
        let found = align(&with_dark(&[1.8, -1.7, -5.1])).unwrap();
        assert!(found.told && (found.scale - 1.0).abs() < 2.0 * found.scale_error, "{found:?}");
    }

    #[test]
    fn lamps_that_agree_have_the_error_of_their_mean() {
        let found = align(&with_dark(&[0.6, -0.4, -0.9, 1.2])).unwrap();
        assert!((0.005..0.0057).contains(&found.scale_error), "{found:?}");
    }

    #[test]
    fn a_lamp_that_is_plainly_off_widens_little() {
        let found = align(&with_dark(&[0.6, -0.4, -0.9, 8.0])).unwrap();
        assert!((0.0057..0.0068).contains(&found.scale_error), "{found:?}");
    }
}
