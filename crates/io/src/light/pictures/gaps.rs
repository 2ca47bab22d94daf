//! Numbers that are missing among the names of a folder.

use std::path::PathBuf;

/// Numbers that a note lists.
const LISTED: usize = 8;

/// A line that says which numbers are missing, when names are numbered at one step and some are not there.
pub(in crate::light) fn note(files: &[PathBuf]) -> Option<String> {
    let names: Vec<Numbered<'_>> =
        files.iter().filter_map(|f| Numbered::of(f.file_stem()?.to_str()?)).collect();
    let pairs = || names.windows(2).filter(|w| w[0].around == w[1].around && w[0].number < w[1].number);
    let mut steps: Vec<u64> = pairs().map(|w| w[1].number - w[0].number).collect();
    steps.sort_unstable();
    // The smallest step has to be the usual one, else names hold times or something else.
    let step = *steps.first()?;
    if steps.iter().filter(|s| **s == step).count() * 2 <= steps.len() {
        return None;
    }
    let missing = pairs().flat_map(|w| {
        let gap = w[1].number - w[0].number;
        // A gap that is no whole number of steps is another count, not a lost picture.
        let whole = if gap.is_multiple_of(step) { gap / step } else { 1 };
        (1..whole).map(|k| w[0].number + k * step)
    });
    let count: u64 = pairs().map(|w| (w[1].number - w[0].number) / step - 1).sum();
    let mut listed: Vec<String> = missing.take(LISTED + 1).map(|n| n.to_string()).collect();
    if listed.is_empty() {
        return None;
    }
    if listed.len() > LISTED {
        listed[LISTED] = "...".to_owned();
    }
    let (number, is) = if count == 1 { ("number", "is") } else { ("numbers", "are") };
    Some(format!(
        "{number} {} {is} missing ({count} of {} pictures): the others follow each other as if nothing were, and time \
         shifts by a frame at each",
        listed.join(", "),
        files.len() as u64 + count
    ))
}

/// A name with its last number.
struct Numbered<'a> {
    around: (&'a str, &'a str),
    number: u64,
}

impl<'a> Numbered<'a> {
    fn of(stem: &'a str) -> Option<Self> {
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

    fn of(names: &[&str]) -> Option<String> {
        note(&names.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn missing_numbers_are_named() {
        assert!(
            of(&["0001.png", "0002.png", "0004.png", "0005.png"])
                .unwrap()
                .starts_with("number 3 is missing (1 of 5")
        );
        assert!(
            of(&["a10.png", "a20.png", "a30.png", "a60.png"])
                .unwrap()
                .starts_with("numbers 40, 50 are missing")
        );
        assert!(of(&["é1_l.png", "é2_l.png", "é3_l.png", "é5_l.png"]).unwrap().contains("number 4 is"));
        let many: Vec<String> = (0..30).chain(100..130).map(|n| format!("{n}.png")).collect();
        let many = of(&many.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
        assert!(many.contains("37, ... are missing (70 of 130"), "{many}");
    }

    #[test]
    fn whole_sequences_times_and_names_are_left_alone() {
        assert_eq!(of(&["1.png", "2.png", "3.png"]), None);
        assert_eq!(of(&["1.png"]), None);
        assert_eq!(of(&["left.png", "right.png"]), None);
        assert_eq!(of(&["a1.png", "a2.png", "b7.png", "b8.png"]), None);
        // Times of a camera.
        assert_eq!(
            of(&["1403636579763.png", "1403636579813.png", "1403636579864.png", "1403636579913.png"]),
            None
        );
    }
}
