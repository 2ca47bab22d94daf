//! What a reader must know besides what was found.

use super::diagnosis::{Discrepancy, ParameterMismatch};
use crate::diagnose::protocol::recorded_set::Setup;

/// How the diagnosis came about: how much of the recordings was judged, and by what. `aside` are readouts at the start of recordings.
pub(in crate::diagnose) fn of_the_sets(
    setup: &Setup,
    aside: &[(String, usize)],
    held_out: bool,
    alone: bool,
) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some((first, rows)) = setup.row_band {
        notes.push(format!(
            "The scene is large: only rows {first} to {} were compared, which contain most of the uniform surface.",
            first + rows - 1
        ));
    }
    if let Some([fewest, most]) = setup.judged_readouts {
        let first = if fewest == most { fewest.to_string() } else { format!("{fewest} to {most}") };
        notes.push(format!(
            "The recordings are large: only the first {first} readouts of each were compared. A comparison of all readouts detects weaker and slower effects and takes longer in proportion."
        ));
    }
    if setup.only_still() {
        notes.push(static_scene(setup));
    }
    if !held_out && alone {
        let most = if setup.only_still() {
            " At most one effect is named, because nothing tests a second one."
        } else {
            ""
        };
        notes.push(format!(
            "There is no second recording set, and the recordings of this set cannot be split: no recordings were held out.{most}"
        ));
    } else if !held_out {
        notes.push(
            "There is no second recording set: effects were fitted to the first half of every recording and tested on the second half, so only stronger effects are detectable. A second set of the same scenes doubles the number of readouts for both steps.".to_owned(),
        );
    }
    if let Some(longest) = aside.iter().map(|a| a.1).max() {
        let shortest = aside.iter().map(|a| a.1).min().unwrap_or(longest);
        notes.push(format!(
            "The pixels start with the same charge, as in simulations and after a common reset. The first {shortest} to {longest} readouts of {} recordings, in which pixels fire together, were excluded. Effects that occur only in these readouts are not detectable.",
            aside.len()
        ));
    }
    notes
}

/// What static scenes of unknown light show.
fn static_scene(setup: &Setup) -> String {
    let longest = setup.recordings.iter().map(|s| s.readouts).max().unwrap_or(0);
    format!(
        "The light of the scene is unknown and was estimated from the recorded rates. Static scenes therefore show noise of single pixels over time, and an upper limit of the spread between adjacent pixels. In {longest} readouts, or {:.1} ms, an oscillation below {:.0} Hz looks like a drift. Recordings of known light show the other effects.",
        1e3 * longest as f64 / setup.readout_hz,
        setup.lowest_line_hz()
    )
}

/// Why a set of which no statistic is beyond its limit is not explained.
pub(in crate::diagnose) fn open(gap: &Discrepancy) -> String {
    format!(
        "No single statistic exceeds its limit, but the {}discrepancy is {:.0}, the noise floor of the final model is {:.0}, and the \
         largest discrepancy that counts as explained is {:.0}. By chance, 2 % of the sensors without missing effects exceed this limit.",
        if gap.is_held_out() { "held-out " } else { "" },
        gap.held_out_set.last().copied().unwrap_or_default(),
        gap.noise_floor,
        gap.limit()
    )
}

/// Which numbers are not said to be wrong beside effects that they stood in for, or that stray much themselves. Beside row noise of 20 mV
/// the noise of the light was said to be 0.16 (0.11 to 0.21) of what it was.
pub(in crate::diagnose) fn unjudged(wrong: &[ParameterMismatch]) -> String {
    let names: Vec<&str> = wrong.iter().map(|m| m.parameter.as_str()).collect();
    format!(
        "Not tested: {}. The found effects are so strong that the recordings do not determine these parameters of the camera. Add the found \
         effects, which camera.toml contains, to your camera file with your own values of these parameters, and diagnose again.",
        names.join(", ")
    )
}
