//! Suggestions for misspelled names.

use strsim::osa_distance;

/// Returns the element of `names` with the smallest optimal string alignment distance to `word`.
///
/// The distance counts insertions, deletions, substitutions and swaps of neighbors. Returns `None` if the smallest
/// distance exceeds `min(ceil(letters / 3), 4)`, where `letters` is the number of letters of `word`. Case is ignored,
/// and spaces and underscores are replaced by hyphens.
pub fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let normalize = |name: &str| name.to_lowercase().replace([' ', '_'], "-");
    let word = normalize(word);
    let allowed = word.chars().count().div_ceil(3).min(4);
    let distances = names.into_iter().map(|name| (osa_distance(&word, &normalize(name)), name));
    let (distance, name) = distances.min_by_key(|(distance, _)| *distance)?;
    (distance <= allowed).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typo_finds_its_name_and_another_word_finds_none() {
        let names = ["physical", "scsim-code", "spike-zoo"];
        assert_eq!(nearest("phsyical", names), Some("physical"));
        assert_eq!(nearest("scsim_code", names), Some("scsim-code"));
        assert_eq!(nearest("nothing", names), None);
        assert_eq!(nearest("x", names), None);
    }

    #[test]
    fn letters_that_are_missing_wrong_or_swapped_count_one_each() {
        // The maximum distance is 2 for a word of four letters.
        for (word, expected) in
            [("pnru", Some("prnu")), ("prnuu", Some("prnu")), ("pu", None), ("abnu", Some("prnu"))]
        {
            assert_eq!(nearest(word, ["prnu"]), expected, "{word}");
        }
    }
}
