//! Lists of shard numbers in the form that users and array jobs write, such as `3,7-9`.

use spikelane::error::{Error, ErrorKind, Result, Setting};

/// Returns the shard numbers that `text` lists, in ascending order and without duplicates.
///
/// The text is either `all`, or a list of numbers and ranges that are separated by commas.
///
/// # Examples
/// ```
/// use spikelane_dataset::shards::shard_numbers::parse_shards;
/// assert_eq!(parse_shards("3,7-9", 10)?, [3, 7, 8, 9]);
/// assert_eq!(parse_shards("all", 3)?, [0, 1, 2]);
/// assert_eq!(parse_shards("7-12", 10).unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`] if the text is invalid, or if a number is not less than `shards`.
pub fn parse_shards(text: &str, shards: u64) -> Result<Vec<u64>> {
    if text == "all" {
        return Ok((0..shards).collect());
    }
    let bad = || {
        Error::new(ErrorKind::Usage, Setting("shards")).found(format_args!("`{text}`")).expected(
            format_args!("a number from 0 to {}, a list such as 3,7-9, or all", shards.saturating_sub(1)),
        )
    };
    let mut all = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |t: &str| t.trim().parse::<u64>().map_err(|_| bad());
        let (first, last) = (number(first)?, number(last)?);
        if first > last || last >= shards {
            return Err(bad());
        }
        all.extend(first..=last);
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// Formats numbers as a list that Slurm's `--array=` accepts. `numbers` must be in ascending order.
///
/// # Examples
/// ```
/// use spikelane_dataset::shards::shard_numbers::format_shards;
/// assert_eq!(format_shards(&[3, 7, 8, 9]), "3,7-9");
/// ```
#[must_use]
pub fn format_shards(numbers: &[u64]) -> String {
    let mut runs: Vec<(u64, u64)> = Vec::new();
    for &n in numbers {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == n => *last = n,
            _ => runs.push((n, n)),
        }
    }
    let one = |&(first, last): &(u64, u64)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    runs.iter().map(one).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_their_text_are_inverse() {
        for (text, normalized) in [("3,7-9", "3,7-9"), ("0", "0"), ("9,8,3-3,7", "3,7-9"), ("all", "0-9")] {
            let numbers = parse_shards(text, 10).unwrap();
            assert_eq!(format_shards(&numbers), normalized);
            assert_eq!(parse_shards(normalized, 10).unwrap(), numbers);
        }
        assert_eq!(format_shards(&[]), "");
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for text in ["", "10", "3-", "9-3", "3,,4", "-1", "5-12", "x", "0x1"] {
            assert_eq!(parse_shards(text, 10).unwrap_err().kind(), ErrorKind::Usage, "{text}");
        }
    }
}
