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
            "The scene is large: rows {first} to {} were judged, which hold most of its even surface.",
            first + rows - 1
        ));
    }
    if let Some([fewest, most]) = setup.judged_readouts {
        let first = if fewest == most { fewest.to_string() } else { format!("{fewest} to {most}") };
        notes.push(format!(
            "The recordings are large: only the first {first} readouts of each were compared. A comparison of all readouts detects weaker and slower effects and takes longer in proportion."
        ));
    }
    if !held_out && alone {
        notes.push("No second set was given and this one cannot be cut: nothing was held out.".to_owned());
    } else if !held_out {
        notes.push(
            "No second set was given: the first half of every recording was fitted and the second half judged it, so effects must be stronger to be seen. A second set of the same scenes doubles what can be told.".to_owned(),
        );
    }
    if let Some(longest) = aside.iter().map(|a| a.1).max() {
        let shortest = aside.iter().map(|a| a.1).min().unwrap_or(longest);
        notes.push(format!(
            "Pixels began together, as they do in simulations and after a common reset: the first {shortest} to {longest} readouts of {} recordings, until they had drifted apart, were set aside. What happens only there cannot be seen.",
            aside.len()
        ));
    }
    notes
}

/// Why a set of which no statistic is beyond its limit is not explained.
pub(in crate::diagnose) fn open(gap: &Discrepancy) -> String {
    format!(
        "No statistic by itself is beyond what the final model's own sensors show, but the {}gap is {:.0} where theirs is \
         {:.0} and {:.0} is the most that counts as explained. Of clean sensors two in a hundred are this far off by chance.",
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
        "Not judged: {}. What was found is so strong that these numbers of the camera cannot be told beside it. Add it to the camera file \
         (camera.toml has it) with your own numbers of these, and diagnose again.",
        names.join(", ")
    )
}
