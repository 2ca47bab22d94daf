//! Counts in messages.

use std::fmt::{self, Display};

/// A count and the singular of its noun. The plural is regular: `frames`, `entries`.
///
/// # Examples
/// ```
/// use spikelane::unstable::Count;
/// assert_eq!(Count(1, "frame").to_string(), "1 frame");
/// assert_eq!(Count(2_u64, "array").to_string(), "2 arrays");
/// assert_eq!(Count(0_u64, "entry").to_string(), "0 entries");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Count<N>(pub N, pub &'static str);

impl<N: Display + PartialEq + From<u8>> Display for Count<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(count, noun) = self;
        if *count == N::from(1) {
            return write!(f, "{count} {noun}");
        }
        match noun.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'o', 'u'])) {
            Some(stem) => write!(f, "{count} {stem}ies"),
            None => write!(f, "{count} {noun}s"),
        }
    }
}
