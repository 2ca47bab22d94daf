//! Numbers of shards as people and array jobs write them: `3,7-9`.

use spikelane::error::{Error, Kind, Result};

/// The numbers below `shards` that `text` names: numbers and ranges joined by commas, or `all`. Rising, each once.
///
/// # Errors
/// [`Kind::Usage`] for another text, or a number that is not below `shards`.
pub fn parse(text: &str, shards: u64) -> Result<Vec<u64>> {
    if text == "all" {
        return Ok((0..shards).collect());
    }
    let bad = || {
        Error::new(Kind::Usage, "--shard").found(format_args!("`{text}`")).expected(format_args!(
            "a number from 0 to {}, a list such as 3,7-9, or all",
            shards.saturating_sub(1)
        ))
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

/// Rising numbers in that form, as `--array=` of Slurm takes them.
#[must_use]
pub fn text(numbers: &[u64]) -> String {
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
        for (given, plain) in [("3,7-9", "3,7-9"), ("0", "0"), ("9,8,3-3,7", "3,7-9"), ("all", "0-9")] {
            let numbers = parse(given, 10).unwrap();
            assert_eq!(text(&numbers), plain);
            assert_eq!(parse(plain, 10).unwrap(), numbers);
        }
        assert_eq!(text(&[]), "");
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for given in ["", "10", "3-", "9-3", "3,,4", "-1", "5-12", "x", "0x1"] {
            assert_eq!(parse(given, 10).unwrap_err().kind(), Kind::Usage, "{given}");
        }
    }
}
