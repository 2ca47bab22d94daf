//! Suggestions for mistyped names.

use strsim::osa_distance;

/// The name of `names` with the smallest optimal string alignment distance to `word` (insertions, deletions, substitutions and
/// swaps of neighbors), if it is at most a third of the letters of `word`, rounded up, and at most 4.
///
/// Case is ignored, and spaces and underscores count as hyphens.
pub(super) fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace([' ', '_'], "-");
    let word = plain(word);
    let allowed = word.chars().count().div_ceil(3).min(4);
    let distances = names.into_iter().map(|name| (osa_distance(&word, &plain(name)), name));
    let (distance, name) = distances.min_by_key(|(distance, _)| *distance)?;
    (distance <= allowed).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_finds_its_name_and_a_stranger_finds_none() {
        let names = ["physical", "scsim-code", "spike-zoo"];
        assert_eq!(nearest("phsyical", names), Some("physical"));
        assert_eq!(nearest("scsim_code", names), Some("scsim-code"));
        assert_eq!(nearest("nothing", names), None);
        assert_eq!(nearest("x", names), None);
    }

    #[test]
    fn letters_that_are_missing_wrong_or_swapped_count_one_each() {
        // A word of four letters allows a distance of 2.
        for (word, found) in
            [("pnru", Some("prnu")), ("prnuu", Some("prnu")), ("pu", None), ("abnu", Some("prnu"))]
        {
            assert_eq!(nearest(word, ["prnu"]), found, "{word}");
        }
    }
}
