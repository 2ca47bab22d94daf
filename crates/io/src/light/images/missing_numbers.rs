//! Detects missing numbers in the file names of an image folder.

use std::path::PathBuf;

use spikelane::unstable::Count;

/// Maximum number of missing numbers that a note lists.
const MAX_LISTED_NUMBERS: usize = 8;

/// Returns a note that lists the numbers that are missing between the numbers in the file names. Returns `None` if no
/// number is missing, or if the numbers do not increase in regular steps.
pub(in crate::light) fn missing_numbers_note(files: &[PathBuf]) -> Option<String> {
    let names: Vec<NumberedName<'_>> =
        files.iter().filter_map(|f| NumberedName::parse(f.file_stem()?.to_str()?)).collect();
    let pairs = || names.windows(2).filter(|w| w[0].around == w[1].around && w[0].number < w[1].number);
    let mut steps: Vec<u64> = pairs().map(|w| w[1].number - w[0].number).collect();
    steps.sort_unstable();
    // If at most half of the steps equal the smallest step, the numbers are probably times.
    let step = *steps.first()?;
    if steps.iter().filter(|s| **s == step).count() * 2 <= steps.len() {
        return None;
    }
    let missing = pairs().flat_map(|w| {
        let gap = w[1].number - w[0].number;
        // If a gap is not a multiple of the step, another numbering starts after the gap, and no image is missing.
        let missing_steps = if gap.is_multiple_of(step) { gap / step } else { 1 };
        (1..missing_steps).map(|k| w[0].number + k * step)
    });
    let count: u64 = pairs().map(|w| (w[1].number - w[0].number) / step - 1).sum();
    let mut listed: Vec<String> = missing.take(MAX_LISTED_NUMBERS + 1).map(|n| n.to_string()).collect();
    if listed.is_empty() {
        return None;
    }
    if listed.len() > MAX_LISTED_NUMBERS {
        listed[MAX_LISTED_NUMBERS] = "...".to_owned();
    }
    let (number, is) = if count == 1 { ("number", "is") } else { ("numbers", "are") };
    Some(format!(
        "{number} {} {is} missing ({count} of {}): each gap is skipped, so every later image is one frame too early per missing image",
        listed.join(", "),
        Count(files.len() as u64 + count, "image"),
    ))
}

/// A file name that is split at the last number in the name.
struct NumberedName<'a> {
    around: (&'a str, &'a str),
    number: u64,
}

impl<'a> NumberedName<'a> {
    fn parse(stem: &'a str) -> Option<Self> {
        let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
        let start = stem[..end]
            .rfind(|c: char| !c.is_ascii_digit())
            .map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
        Some(Self { around: (&stem[..start], &stem[end..]), number: stem[start..end].parse().ok()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note_for(names: &[&str]) -> Option<String> {
        missing_numbers_note(&names.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn missing_numbers_are_named() {
        assert!(
            note_for(&["0001.png", "0002.png", "0004.png", "0005.png"])
                .unwrap()
                .starts_with("number 3 is missing (1 of 5")
        );
        assert!(
            note_for(&["a10.png", "a20.png", "a30.png", "a60.png"])
                .unwrap()
                .starts_with("numbers 40, 50 are missing")
        );
        assert!(note_for(&["é1_l.png", "é2_l.png", "é3_l.png", "é5_l.png"]).unwrap().contains("number 4 is"));
        let many: Vec<String> = (0..30).chain(100..130).map(|n| format!("{n}.png")).collect();
        let many = note_for(&many.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
        assert!(many.contains("37, ... are missing (70 of 130"), "{many}");
    }

    #[test]
    fn whole_sequences_times_and_names_are_left_alone() {
        assert_eq!(note_for(&["1.png", "2.png", "3.png"]), None);
        assert_eq!(note_for(&["1.png"]), None);
        assert_eq!(note_for(&["left.png", "right.png"]), None);
        assert_eq!(note_for(&["a1.png", "a2.png", "b7.png", "b8.png"]), None);
        // The numbers are camera times in milliseconds.
        assert_eq!(
            note_for(&["1403636579763.png", "1403636579813.png", "1403636579864.png", "1403636579913.png"]),
            None
        );
    }
}
