//! Aligns the fitted light levels with the stated levels, after excluding stated levels that are wrong.
//!
//! The recordings alone determine the levels `m` only up to one scale `s` and one shift `t`. Every pixel follows
//! `x = a m + d`. Here `x` is the charge per readout in thresholds, `a` the gain in thresholds per readout at full light,
//! and `d` the dark rate in thresholds per readout. Levels `s m + t` with gains `a / s` and dark rates `d - a t / s`
//! cause the same rates. The stated levels determine scale and shift. A dark recording determines the shift, because its
//! light is exactly 0.
//!
//! The found levels are aligned with the stated levels by least trimmed squares (Rousseeuw 1984). Of `n` lit levels, only
//! the `h = n - n/3` levels that agree best are fitted. If `h` of `n` values lie exactly on a line with `p` parameters,
//! the fit finds this line whenever `h >= (n + p + 1) / 2` (Rousseeuw and Leroy 1987, section 3.4). The remaining values
//! can be arbitrary. A level that is far off this line keeps a weight, but its uncertainty becomes 30 %. No level is
//! excluded. With a dark recording `p` is 1, and three lit levels suffice to find a wrong level. Without a dark
//! recording `p` is 2, and four lit levels are necessary.

use super::scale_posterior::{OUTLIER_UNCERTAINTY, StatedLevel, scale_posterior};
use crate::formulas::fit::solve_cholesky;

/// Smallest distance of an outlier from the line through the other levels, in stated standard deviations. One in two
/// thousand correctly stated levels exceeds this distance.
const OUTLIER_Z_THRESHOLD: f64 = 3.5;

/// Smallest error ratio for which the choice of trusted levels is ambiguous. The ratio is the posterior error of the scale
/// divided by the error for the trusted levels alone.
const AMBIGUITY_ERROR_RATIO: f64 = 1.5;

/// Alignment of found levels. The light is `scale * found + shift`.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub(super) scale: f64,
    pub(super) shift: f64,
    /// Relative standard error of the scale that all levels share.
    pub(super) scale_error: f64,
    /// Standard error of the shift in units of light. It is 0 if there is a dark recording.
    pub(super) shift_error: f64,
    /// Whether each level is off the line through the other levels.
    pub(super) is_outlier: Vec<bool>,
    /// Whether there are enough levels to identify a single wrong level.
    pub(super) is_outlier_identifiable: bool,
    /// Whether another set of levels agrees nearly as well as the trusted levels.
    pub(super) is_ambiguous: bool,
}

/// Aligns found levels with stated levels. Returns `None` if the levels do not determine a line.
pub(super) fn align_levels(levels: &[StatedLevel]) -> Option<Alignment> {
    let lit: Vec<StatedLevel> = levels.iter().copied().filter(|l| l.stated_light > 0.0).collect();
    let dark = levels.iter().find(|l| l.stated_light == 0.0);
    let parameters = if dark.is_some() { 1 } else { 2 };
    let (n, kept_count) = (lit.len(), lit.len() - lit.len() / 3);
    let can_trim = kept_count < n && kept_count >= (n + parameters).div_ceil(2);
    let mut line = match (dark, n) {
        (None, 0) => return None,
        (None, 1) => (lit[0].stated_light / lit[0].found_light, 0.0),
        _ if can_trim => fit_trimmed_line(&lit, dark, kept_count),
        _ => fit_weighted_line(&lit, dark)?.0,
    };
    let off = |(scale, shift): (f64, f64)| {
        move |l: &StatedLevel| (scale * l.found_light + shift - l.stated_light) / l.sd
    };
    // An uncertainty of 30 % reduces the weight of a level that is off the line.
    let widened = |is_off: &[bool]| -> Vec<StatedLevel> {
        let widen = |(l, off): (&StatedLevel, &bool)| StatedLevel {
            sd: if *off { OUTLIER_UNCERTAINTY * l.stated_light } else { l.sd },
            ..*l
        };
        lit.iter().zip(is_off).map(widen).collect()
    };
    let mut is_off = vec![false; n];
    if can_trim {
        // The line is refitted until the set of the levels that are off it no longer changes.
        for _ in 0..10 {
            let next: Vec<bool> = lit.iter().map(off(line)).map(|z| z.abs() > OUTLIER_Z_THRESHOLD).collect();
            line = fit_weighted_line(&widened(&next), dark)?.0;
            if next == is_off {
                break;
            }
            is_off = next;
        }
    }
    let [mut scale_error, mut shift_error] = match (dark, n) {
        (None, 1) => [lit[0].sd / lit[0].stated_light, 0.0],
        _ => fit_weighted_line(&widened(&is_off), dark)?.1,
    };
    if !can_trim {
        // Two levels may contradict each other. The errors are then enlarged to cover both levels.
        let worst = lit.iter().map(off(line)).fold(1.0_f64, |w, z| w.max(z.abs()));
        scale_error *= worst;
        shift_error *= worst;
    }
    let (mut doubtful, sure) = (false, [scale_error, shift_error]);
    if can_trim {
        let posterior = scale_posterior(&lit, dark, line, sure);
        (scale_error, shift_error) = (sure[0].max(posterior[0]), sure[1].max(posterior[1]));
        doubtful = scale_error > AMBIGUITY_ERROR_RATIO * sure[0];
    }
    let wrong = levels
        .iter()
        .map(|l| l.stated_light > 0.0 && can_trim && off(line)(l).abs() > OUTLIER_Z_THRESHOLD)
        .collect();
    let (scale, shift) = line;
    Some(Alignment {
        scale,
        shift,
        scale_error,
        shift_error,
        is_outlier: wrong,
        is_outlier_identifiable: can_trim,
        is_ambiguous: doubtful,
    })
}

/// Returns the line for which the sum of the `kept_count` smallest squared distances is least. The candidates are all
/// lines through two levels. With a dark level, the candidates are all lines through the dark level and one lit level.
fn fit_trimmed_line(lit: &[StatedLevel], dark: Option<&StatedLevel>, kept_count: usize) -> (f64, f64) {
    let mut best = (f64::INFINITY, (1.0, 0.0));
    for (i, p) in lit.iter().enumerate() {
        let others: Vec<&StatedLevel> = dark.map_or_else(|| lit[i + 1..].iter().collect(), |d| vec![d]);
        for q in others.into_iter().filter(|q| q.found_light != p.found_light) {
            let scale = (p.stated_light - q.stated_light) / (p.found_light - q.found_light);
            let shift = p.stated_light - scale * p.found_light;
            let mut squares: Vec<f64> = lit
                .iter()
                .map(|l| ((scale * l.found_light + shift - l.stated_light) / l.sd).powi(2))
                .collect();
            squares.sort_by(f64::total_cmp);
            let sum = squares[..kept_count].iter().sum();
            if sum < best.0 {
                best = (sum, (scale, shift));
            }
        }
    }
    best.1
}

/// Returns the weighted line through the levels. Also returns the relative error of its scale and the error of its shift.
fn fit_weighted_line(lit: &[StatedLevel], dark: Option<&StatedLevel>) -> Option<((f64, f64), [f64; 2])> {
    if let Some(dark) = dark {
        let (mut top, mut weight) = (0.0, 0.0);
        for l in lit {
            let (m, w) = (l.found_light - dark.found_light, l.sd.powi(-2));
            top += w * m * l.stated_light;
            weight += w * m * m;
        }
        let scale = top / weight;
        return scale
            .is_finite()
            .then(|| ((scale, -scale * dark.found_light), [weight.powf(-0.5) / scale, 0.0]));
    }
    let (mut h, mut g) = ([0.0; 4], [0.0; 2]);
    for l in lit {
        let (m, w) = (l.found_light, l.sd.powi(-2));
        h = [h[0] + w * m * m, h[1] + w * m, h[2] + w * m, h[3] + w];
        g = [g[0] + w * m * l.stated_light, g[1] + w * l.stated_light];
    }
    let (line, variance) = solve_cholesky(&h, &g, 2)?;
    Some(((line[0], line[1]), [variance[0].sqrt() / line[0], variance[1].sqrt()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates levels. The found light is `0.97 * stated * (1 + off) + shift`.
    fn levels_with_errors(stated: &[f64], off: &[f64], shift: f64) -> Vec<StatedLevel> {
        let stated_level = |(s, e): (&f64, &f64)| StatedLevel {
            found_light: 0.97 * s * (1.0 + e) + shift,
            stated_light: *s,
            sd: if *s == 0.0 { 1e-12 } else { 0.01 * s },
        };
        stated.iter().zip(off).map(stated_level).collect()
    }

    #[test]
    fn one_third_of_levels_may_be_outliers() {
        let stated = [0.0, 0.03, 0.1, 0.2, 0.3, 0.6, 0.9];
        let alignment =
            align_levels(&levels_with_errors(&stated, &[0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0], 0.0)).unwrap();
        // The weight of a level that is off is 1/900 of that of the four others, so two levels that are off by 10 % move the
        // scale by 2 * 0.1 / 900 / 4.
        assert!(
            (alignment.scale * 0.97 - 1.0).abs() < 7e-5 && alignment.is_outlier_identifiable,
            "{alignment:?}"
        );
        assert_eq!(alignment.is_outlier, [false, true, false, false, false, true, false]);
        // Four correct levels with errors of 1 % have a mean error of 0.5 %. Ambiguity adds a small share.
        assert!((0.005..0.006).contains(&alignment.scale_error) && !alignment.is_ambiguous, "{alignment:?}");
    }

    #[test]
    fn without_dark_four_levels_identify_an_outlier_and_three_do_not() {
        let off = [0.0, 0.0, 0.1, 0.0];
        let alignment = align_levels(&levels_with_errors(&[0.05, 0.2, 0.5, 0.9], &off, 0.01)).unwrap();
        assert_eq!(
            (alignment.is_outlier_identifiable, alignment.is_outlier),
            (true, vec![false, false, true, false])
        );
        // The level that is off has 1/900 of its stated weight.
        assert!((alignment.scale * 0.97 - 1.0).abs() < 2e-4 && (alignment.shift + 0.01 / 0.97).abs() < 1e-4);
        let alignment = align_levels(&levels_with_errors(&[0.05, 0.2, 0.5], &off[1..], 0.01)).unwrap();
        assert!(!alignment.is_outlier_identifiable);
    }

    #[test]
    fn interval_covers_two_contradicting_levels() {
        let alignment = align_levels(&levels_with_errors(&[0.0, 0.3, 0.6], &[0.0, 0.0, 0.1], 0.0)).unwrap();
        assert!(!alignment.is_outlier_identifiable && alignment.is_outlier.iter().all(|w| !w));
        let z = (alignment.scale * 0.97 - 1.0).abs() / alignment.scale_error;
        assert!(z < 1.96, "{z}: {alignment:?}");
    }

    #[test]
    fn error_covers_both_halves_of_contradicting_levels() {
        let off = [0.0, 0.0, 0.0, 0.1, 0.1];
        let alignment = align_levels(&levels_with_errors(&[0.0, 0.1, 0.3, 0.5, 0.8], &off, 0.0)).unwrap();
        for scale in [1.0, 1.0 / 1.1] {
            let z = (alignment.scale * 0.97 / scale - 1.0).abs() / alignment.scale_error;
            assert!(z < 1.96, "{z}: {alignment:?}");
        }
    }

    /// Creates a dark level and lit levels with a stated error of 1 %. The found light of lit level `i` is wrong by
    /// `off[i]` percent.
    fn levels_with_dark(off: &[f64]) -> Vec<StatedLevel> {
        let dark = StatedLevel { found_light: 0.0, stated_light: 0.0, sd: 1e-12 };
        let lit = off.iter().enumerate().map(|(k, e)| {
            let light = 0.2 + 0.1 * k as f64;
            StatedLevel { found_light: light * (1.0 + e / 100.0), stated_light: light, sd: 0.01 * light }
        });
        std::iter::once(dark).chain(lit).collect()
    }

    #[test]
    fn error_covers_both_of_two_equally_consistent_pairs() {
        // Either the first two levels are right, or the last two levels are right.
        let alignment = align_levels(&levels_with_dark(&[1.8, -1.7, -5.1])).unwrap();
        assert!(
            alignment.is_outlier_identifiable && (alignment.scale - 1.0).abs() < 2.0 * alignment.scale_error,
            "{alignment:?}"
        );
    }

    #[test]
    fn lamps_that_agree_have_the_error_of_their_mean() {
        let alignment = align_levels(&levels_with_dark(&[0.6, -0.4, -0.9, 1.2])).unwrap();
        assert!((0.005..0.0057).contains(&alignment.scale_error), "{alignment:?}");
    }

    #[test]
    fn a_clear_outlier_widens_the_error_little() {
        let alignment = align_levels(&levels_with_dark(&[0.6, -0.4, -0.9, 8.0])).unwrap();
        assert!((0.0057..0.0068).contains(&alignment.scale_error), "{alignment:?}");
    }
}
