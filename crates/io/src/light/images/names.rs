//! The extensions of file names, their order, and the numbers in them.

use std::cmp::Ordering;
use std::ops::Range;
use std::path::{Path, PathBuf};

use spikelane::error::Setting;
use spikelane::unstable::Count;

/// File extensions of images.
pub const EXTENSIONS: [&str; 18] = [
    "png", "jpg", "jpeg", "tif", "tiff", "exr", "bmp", "pgm", "ppm", "pnm", "pbm", "webp", "apng", "pfm",
    "hdr", "fits", "fit", "fts",
];

/// Maximum number of missing numbers that a note lists.
const MAX_LISTED_NUMBERS: usize = 8;

/// Numbers of digits of times since 1970 in milliseconds, microseconds and nanoseconds.
const UNIX_TIME_DIGITS: [usize; 3] = [13, 16, 19];

/// Returns whether the file name has one of the [`EXTENSIONS`].
#[must_use]
pub fn is_image(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| EXTENSIONS.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// Compares two names. Sequences of ASCII digits compare as numbers of any length.
///
/// If two names differ only in leading zeros, their numbers are equal. The function then compares the bytes of the
/// names, so that the order is total.
///
/// # Examples
/// ```
/// use spikelane_io::light::natural_cmp;
/// let mut names = ["img10.png", "img2.png", "img1.png"];
/// names.sort_by(|a, b| natural_cmp(a, b));
/// assert_eq!(names, ["img1.png", "img2.png", "img10.png"]);
/// ```
#[must_use]
pub fn natural_cmp(a: &str, b: &str) -> Ordering {
    let (mut x, mut y) = (a.as_bytes(), b.as_bytes());
    while let (Some(&p), Some(&q)) = (x.first(), y.first()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            whole_cmp(leading_digits(&mut x), leading_digits(&mut y))
        } else {
            (x, y) = (&x[1..], &y[1..]);
            p.cmp(&q)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

/// Removes the leading digits from `text` and returns them.
fn leading_digits<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|b| !b.is_ascii_digit());
    let (digits, rest) = text.split_at(end.unwrap_or(text.len()));
    *text = rest;
    digits
}

/// Compares whole numbers of any length.
fn whole_cmp(a: &[u8], b: &[u8]) -> Ordering {
    let significant = |digits: &[u8]| digits.iter().take_while(|b| **b == b'0').count();
    let (a, b) = (&a[significant(a)..], &b[significant(b)..]);
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

/// Sorts the files of a folder: by the decimal numbers in their names if all names differ in one decimal number only, and
/// otherwise in natural order. The names are compared without their extensions, so that `a.jpg` comes before `a (1).jpg`.
pub(in crate::light) fn sort_by_name(files: &mut [PathBuf]) {
    let stem = |file: &'_ PathBuf| file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    files.sort_by(|a, b| natural_cmp(&stem(a), &stem(b)).then_with(|| a.cmp(b)));
    let Some(numbers) = stems(files).and_then(|stems| Numbers::parse(&stems)) else { return };
    if numbers.are_decimal() {
        let order = numbers.order();
        let sorted: Vec<PathBuf> = order.into_iter().map(|i| files[i].clone()).collect();
        files.clone_from_slice(&sorted);
    }
}

fn stems(files: &[PathBuf]) -> Option<Vec<&str>> {
    files.iter().map(|f| f.file_stem()?.to_str()).collect()
}

/// Returns the decimal numbers in which the names of sorted files differ, if all names differ in one decimal number only.
pub(in crate::light) fn decimal_numbers(stems: &[&str]) -> Option<Vec<f64>> {
    let numbers = Numbers::parse(stems).filter(Numbers::are_decimal)?;
    numbers.0.iter().map(Number::value).collect()
}

/// Returns a note about the order of the files of a folder and the times in their names.
///
/// * The names are sorted by decimal numbers, or contain times since 1970. The numbers are not used as times. If
///   `has_times` is true, the folder has other times, and the function returns `None`.
/// * The names are sorted by their whole numbers, and this order is not the order of their decimal or hexadecimal numbers.
pub(in crate::light) fn name_order_note(files: &[PathBuf], has_times: bool) -> Option<String> {
    let stems = stems(files)?;
    let numbers = Numbers::parse(&stems);
    if let (Some(numbers), [first, .., last]) = (&numbers, &stems[..])
        && (numbers.are_decimal() || numbers.are_unix_times())
    {
        return (!has_times).then(|| {
            format!(
                "the files are sorted by the numbers in their names, from {first} to {last}; these numbers are not used as times: to use them, write the times in seconds into timestamps.txt, one per line, or set {}",
                Setting("input_fps")
            )
        });
    }
    let (kind, at) = numbers
        .and_then(|numbers| numbers.0.windows(2).position(|pair| pair[0].cmp(&pair[1]).is_gt()))
        .map(|at| ("decimal or negative", at))
        .or_else(|| first_unordered_hexadecimal(&stems).map(|at| ("hexadecimal", at)))?;
    Some(format!(
        "the files are sorted by the whole numbers in their names, so {} comes before {}, which is not the order of {kind} numbers; to change the order, rename the files to whole numbers",
        stems[at],
        stems[at + 1]
    ))
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

/// Returns a note that lists the numbers that are missing between the numbers in the file names. Returns `None` if no
/// number is missing, or if the numbers do not increase in regular steps.
pub(in crate::light) fn missing_numbers_note(files: &[PathBuf]) -> Option<String> {
    let split = |file: &'_ Path| -> Option<(String, u64)> {
        let stem = file.file_stem()?.to_str()?;
        let digits = last_digits(stem)?;
        let around = format!("{}\0{}", &stem[..digits.start], &stem[digits.end..]);
        Some((around, stem[digits].parse().ok()?))
    };
    let names: Vec<(String, u64)> = files.iter().filter_map(|file| split(file)).collect();
    let pairs = || names.windows(2).filter(|w| w[0].0 == w[1].0 && w[0].1 < w[1].1).map(|w| (w[0].1, w[1].1));
    let mut steps: Vec<u64> = pairs().map(|(a, b)| b - a).collect();
    steps.sort_unstable();
    // If at most half of the steps equal the smallest step, the numbers are probably times.
    let step = *steps.first()?;
    if steps.iter().filter(|s| **s == step).count() * 2 <= steps.len() {
        return None;
    }
    let missing = pairs().flat_map(|(a, b)| {
        // If a gap is not a multiple of the step, another numbering starts after the gap, and no image is missing.
        let missing_steps = if (b - a).is_multiple_of(step) { (b - a) / step } else { 1 };
        (1..missing_steps).map(move |k| a + k * step)
    });
    let count: u64 = pairs().map(|(a, b)| (b - a) / step - 1).sum();
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

/// Returns the position of the last digits of a name.
fn last_digits(stem: &str) -> Option<Range<usize>> {
    let end = stem.bytes().rposition(|b| b.is_ascii_digit())? + 1;
    Some(end - digits_before(stem, end)..end)
}

fn digits_before(stem: &str, end: usize) -> usize {
    stem.as_bytes()[..end].iter().rev().take_while(|b| b.is_ascii_digit()).count()
}

/// A decimal number.
#[derive(Clone, Copy, Debug)]
struct Number<'a> {
    is_negative: bool,
    whole: &'a str,
    fraction: &'a str,
}

impl Number<'_> {
    fn cmp(&self, other: &Self) -> Ordering {
        let fraction = |number: &Self| number.fraction.trim_end_matches('0').to_owned();
        let magnitude = |a: &Self, b: &Self| {
            whole_cmp(a.whole.as_bytes(), b.whole.as_bytes()).then_with(|| fraction(a).cmp(&fraction(b)))
        };
        match (self.is_negative, other.is_negative) {
            (false, false) => magnitude(self, other),
            (true, true) => magnitude(other, self),
            (negative, _) => {
                if negative {
                    Ordering::Less
                } else {
                    Ordering::Greater
                }
            }
        }
    }

    fn value(&self) -> Option<f64> {
        let magnitude: f64 = format!("{}.{}", self.whole, self.fraction).parse().ok()?;
        Some(if self.is_negative { -magnitude } else { magnitude })
    }
}

/// The numbers of names that differ in one number only.
struct Numbers<'a>(Vec<Number<'a>>);

impl<'a> Numbers<'a> {
    /// Splits each name at its last number, with a sign and a fraction. Returns `None` if the names also differ elsewhere.
    fn parse(stems: &[&'a str]) -> Option<Self> {
        let (mut numbers, mut around) = (Vec::new(), None);
        for stem in stems {
            let digits = last_digits(stem)?;
            let (mut start, mut fraction_start) = (digits.start, digits.end);
            let is_point = |at: usize| at > 0 && matches!(stem.as_bytes()[at - 1], b'.' | b',');
            if is_point(start) && digits_before(stem, start - 1) > 0 {
                let whole_start = start - 1 - digits_before(stem, start - 1);
                // A name with three parts is a version or an address, and no decimal number.
                if !is_point(whole_start) {
                    (start, fraction_start) = (whole_start, start);
                }
            }
            let whole =
                &stem[start..if fraction_start < digits.end { fraction_start - 1 } else { digits.end }];
            let is_negative = start > 0 && stem.as_bytes()[start - 1] == b'-';
            let place = (&stem[..start - usize::from(is_negative)], &stem[digits.end..]);
            if *around.get_or_insert(place) != place {
                return None;
            }
            numbers.push(Number { is_negative, whole, fraction: &stem[fraction_start..digits.end] });
        }
        // If all names have a hyphen after a word, the hyphens are separators.
        let (before, _) = around?;
        if before.ends_with(char::is_alphanumeric) && numbers.iter().all(|number| number.is_negative) {
            numbers.iter_mut().for_each(|number| number.is_negative = false);
        }
        Some(Self(numbers))
    }

    /// Returns whether the names have fractions or signs. Two counters with a point between them, such as 1.9 and 1.10, are
    /// no decimal numbers.
    fn are_decimal(&self) -> bool {
        let fractions = self.0.iter().map(|number| number.fraction).filter(|text| !text.is_empty());
        let fractions: Vec<&str> = fractions.collect();
        let Some(first) = fractions.first() else { return self.0.iter().any(|number| number.is_negative) };
        fractions.iter().all(|text| text.len() == first.len())
            || !fractions.iter().any(|text| text.len() > 1 && text.ends_with('0'))
    }

    /// Returns whether the numbers are times since 1970: whole numbers of one length, larger than every count of frames.
    fn are_unix_times(&self) -> bool {
        let digits = |number: &Number<'_>| number.whole.len();
        let is_time = |number: &Number<'_>| {
            UNIX_TIME_DIGITS.contains(&digits(number))
                && !number.whole.starts_with('0')
                && !number.is_negative
        };
        self.0.len() > 1 && self.0.iter().all(is_time)
    }

    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.0.len()).collect();
        order.sort_by(|&a, &b| self.0[a].cmp(&self.0[b]));
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(|name| PathBuf::from(format!("{name}.png"))).collect()
    }

    fn note_for(names: &[&str]) -> Option<String> {
        let mut files = paths(names);
        sort_by_name(&mut files);
        name_order_note(&files, false)
    }

    #[test]
    fn decimal_and_negative_numbers_determine_the_order() {
        for sorted in [
            &["frame_0", "frame_0.025", "frame_0.05", "frame_0.1", "frame_1"][..],
            &["0,25", "0,5"],
            &["-2", "-1", "0", "1"],
            &["-0.5", "-0.25", "0"],
            &["-10", "-9.5", "-1"],
            &["t=-1.5s", "t=-1.25s", "t=0s", "t=0.125s"],
            &["t-0.5", "t-0.75", "t-1.0"],
            &["1305031102.175304", "1305031102.211214"],
        ] {
            let mut files = paths(sorted);
            files.reverse();
            sort_by_name(&mut files);
            assert_eq!(files, paths(sorted));
            let note = note_for(sorted).unwrap();
            assert!(note.contains("not used as times") && note.contains(sorted[0]), "{note}");
            assert_eq!(name_order_note(&files, true), None);
        }
        assert!(note_for(&["1403636579763", "1403636579813"]).unwrap().contains("not used as times"));
        assert_eq!(decimal_numbers(&["t=-1.5s", "t=0s"]), Some(vec![-1.5, 0.0]));
    }

    #[test]
    fn numbers_in_another_order_than_the_files_are_reported() {
        for (names, pair) in [
            (&["1.8", "1.9", "1.10"][..], "1.9 comes before 1.10"),
            (&["0f", "1a", "19"], "1a comes before 19"),
        ] {
            assert!(
                note_for(names).is_some_and(|note| note.contains(pair)),
                "{names:?}: {:?}",
                note_for(names)
            );
        }
    }

    #[test]
    fn whole_numbers_and_words_are_in_natural_order() {
        for names in [
            &["f-1", "f-2", "f-10"][..],
            &["0001", "0002", "0010"],
            &["1", "2", "10"],
            &["v1.2.9", "v1.2.10"],
            &["0a", "0b", "0c"],
            &["left", "right"],
            &["IMG_170431", "IMG_170431 (1)", "IMG_170431 (2)", "IMG_170432"],
            &["a1.5", "b1.25"],
            &["cam-1_0.5s", "cam-2_1.5s"],
            &["é"],
            &[],
        ] {
            assert_eq!(note_for(names), None, "{names:?}");
            let mut files = paths(names);
            files.reverse();
            sort_by_name(&mut files);
            assert_eq!(files, paths(names));
        }
    }

    fn missing(names: &[&str]) -> Option<String> {
        missing_numbers_note(&paths(names))
    }

    #[test]
    fn missing_numbers_are_named() {
        assert!(
            missing(&["0001", "0002", "0004", "0005"]).unwrap().starts_with("number 3 is missing (1 of 5")
        );
        assert!(missing(&["a10", "a20", "a30", "a60"]).unwrap().starts_with("numbers 40, 50 are missing"));
        assert!(missing(&["é1_l", "é2_l", "é3_l", "é5_l"]).unwrap().contains("number 4 is"));
        let many: Vec<String> = (0..30).chain(100..130).map(|n| n.to_string()).collect();
        let many = missing(&many.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
        assert!(many.contains("37, ... are missing (70 of 130"), "{many}");
    }

    #[test]
    fn whole_sequences_times_and_names_are_left_alone() {
        for names in [
            &["1", "2", "3"][..],
            &["1"],
            &["left", "right"],
            &["a1", "a2", "b7", "b8"],
            // The numbers are camera times in milliseconds.
            &["1403636579763", "1403636579813", "1403636579864", "1403636579913"],
        ] {
            assert_eq!(missing(names), None, "{names:?}");
        }
    }
}
