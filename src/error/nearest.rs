//! Which known name a mistyped one was meant to be.

/// The nearest of `names`, if it is so near that a person would have meant it: a third of the letters, or a
/// word of which it is a part.
pub(super) fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase().replace([' ', '_'], "-");
    let far = |name: &str| edits(&word, &name.to_lowercase().replace([' ', '_'], "-"));
    let allowed = word.chars().count().div_ceil(3).min(4);
    let found = names.into_iter().map(|name| (far(name), name)).min_by_key(|(edits, _)| *edits)?;
    (found.0 <= allowed).then_some(found.1)
}

/// Letters to insert, leave out, replace or exchange with a neighbour: the optimal string alignment distance.
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let same = a[i - 1] == b[j - 1];
            let mut least = (last[j] + 1).min(row[j - 1] + 1).min(last[j - 1] + usize::from(!same));
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(before[j - 2] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_count_letters_that_are_missing_wrong_or_exchanged() {
        for (a, b, n) in [("", "abc", 3), ("prnu", "prnu", 0), ("pnru", "prnu", 1), ("prnuu", "prnu", 1)] {
            assert_eq!((edits(a, b), edits(b, a)), (n, n), "{a} {b}");
        }
    }

    #[test]
    fn a_slip_finds_its_name_and_a_stranger_finds_none() {
        let names = ["physical", "scsim-code", "spike-zoo"];
        assert_eq!(nearest("phsyical", names), Some("physical"));
        assert_eq!(nearest("scsim_code", names), Some("scsim-code"));
        assert_eq!(nearest("nothing", names), None);
        assert_eq!(nearest("x", names), None);
    }
}
