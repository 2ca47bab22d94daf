//! Natural order of file names: `img2` before `img10`.

use std::cmp::Ordering;

/// Compares two names. Sequences of ASCII digits compare as numbers of any length.
///
/// If two names differ only in leading zeros, their numbers are equal. The function then compares the bytes of the
/// names, so that the order is total.
///
/// # Examples
/// ```
/// use spikelane_io::light::natural_order::natural_cmp;
/// let mut names = ["img10.png", "img2.png", "img1.png"];
/// names.sort_by(|a, b| natural_cmp(a, b));
/// assert_eq!(names, ["img1.png", "img2.png", "img10.png"]);
/// ```
#[must_use]
pub fn natural_cmp(a: &str, b: &str) -> Ordering {
    let (mut x, mut y) = (a.as_bytes(), b.as_bytes());
    while let (Some(&p), Some(&q)) = (x.first(), y.first()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n) = (number(&mut x), number(&mut y));
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
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

/// Removes the leading digits from `text`, and returns these digits without leading zeros.
fn number<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|b| !b.is_ascii_digit());
    let (digits, rest) = text.split_at(end.unwrap_or(text.len()));
    *text = rest;
    let zeros = digits.iter().take_while(|b| **b == b'0').count();
    &digits[zeros..]
}
