//! Numbers in the file names of a folder whose order differs from the order of the files.

use std::path::PathBuf;

/// Returns a note if the names contain decimal fractions, negative numbers or hexadecimal numbers that the order of the
/// files does not follow. The files are sorted by their whole numbers: `0.5` comes before `0.25`, and `-1` before `-2`.
pub(in crate::light) fn name_order_note(files: &[PathBuf]) -> Option<String> {
    let stems: Option<Vec<&str>> = files.iter().map(|f| f.file_stem()?.to_str()).collect();
    let stems = stems?;
    let (kind, at) = first_unordered_decimal(&stems)
        .map(|at| ("decimal or negative", at))
        .or_else(|| first_unordered_hexadecimal(&stems).map(|at| ("hexadecimal", at)))?;
    Some(format!(
        "the files are sorted by the whole numbers in their names, so {} comes before {}, which is not the order of {kind} numbers; to change the order, rename the files to whole numbers",
        stems[at],
        stems[at + 1]
    ))
}

/// Returns the index of the first file whose number exceeds the next number. Returns `None` if the names do not differ in
/// one number only.
fn first_unordered_decimal(stems: &[&str]) -> Option<usize> {
    let names: Option<Vec<DecimalName<'_>>> = stems.iter().map(|stem| DecimalName::parse(stem)).collect();
    let mut names = names?;
    // If all names have a hyphen, the hyphens are separators. They do not change the order, because fractions of names
    // with and without the sign have the same order of absolute values.
    if names.iter().all(|name| name.value.is_sign_negative()) {
        names.iter_mut().for_each(|name| name.value = name.value.abs());
    }
    let first = names.first()?.around;
    if names.iter().any(|name| name.around != first) {
        return None;
    }
    names.windows(2).position(|pair| pair[0].value > pair[1].value)
}

/// Returns the index of the first name that exceeds the next name, if all names are hexadecimal numbers of one length.
fn first_unordered_hexadecimal(stems: &[&str]) -> Option<usize> {
    let len = stems.first()?.len();
    let is_hexadecimal = |stem: &&str| stem.len() == len && stem.bytes().all(|b| b.is_ascii_hexdigit());
    if !stems.iter().all(is_hexadecimal) {
        return None;
    }
    let lower = |stem: &str| stem.to_ascii_lowercase();
    stems.windows(2).position(|pair| lower(pair[0]) > lower(pair[1]))
}

/// A file name that is split at its last number, with a sign and a fraction.
struct DecimalName<'a> {
    around: (&'a str, &'a str),
    value: f64,
}

impl<'a> DecimalName<'a> {
    fn parse(stem: &'a str) -> Option<Self> {
        let bytes = stem.as_bytes();
        let digits_before = |end: usize| bytes[..end].iter().rev().take_while(|b| b.is_ascii_digit()).count();
        let end = bytes.iter().rposition(u8::is_ascii_digit)? + 1;
        let mut start = end - digits_before(end);
        if start > 0 && matches!(bytes[start - 1], b'.' | b',') && digits_before(start - 1) > 0 {
            start -= 1 + digits_before(start - 1);
        }
        if start > 0 && bytes[start - 1] == b'-' {
            start -= 1;
        }
        let value = stem[start..end].replace(',', ".").parse().ok()?;
        Some(Self { around: (&stem[..start], &stem[end..]), value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note_for(names: &[&str]) -> Option<String> {
        name_order_note(&names.iter().map(|name| PathBuf::from(format!("{name}.png"))).collect::<Vec<_>>())
    }

    #[test]
    fn numbers_in_another_order_than_the_files_are_reported() {
        for (names, pair) in [
            (&["f0.5", "f0.25", "f1.0"][..], "f0.5 comes before f0.25"),
            (&["0,5", "0,25"], "0,5 comes before 0,25"),
            (&["-1", "-2", "0"], "-1 comes before -2"),
            (&["t-0.5", "t-0.75", "t0"], "t-0.5 comes before t-0.75"),
            (&["1a", "0f", "19"], "1a comes before 0f"),
        ] {
            assert!(
                note_for(names).is_some_and(|note| note.contains(pair)),
                "{names:?}: {:?}",
                note_for(names)
            );
        }
    }

    #[test]
    fn numbers_in_the_order_of_the_files_are_not_reported() {
        for names in [
            &["0.00", "0.25", "0.50", "1.00"][..],
            &["f-1", "f-2", "f-10"],
            &["0001", "0002", "0010"],
            &["1", "2", "10"],
            &["0a", "0b", "0c"],
            &["left", "right"],
            &["a1.5", "b1.25"],
            &["cam-1_0.5s", "cam-1_1.5s"],
            &["é"],
            &[],
        ] {
            assert_eq!(note_for(names), None, "{names:?}");
        }
    }
}
