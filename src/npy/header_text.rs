//! The text of a header: a Python dictionary with three keys.

/// The values in the header text.
#[derive(Debug, Default)]
pub(super) struct HeaderFields {
    pub(super) descr: String,
    pub(super) is_fortran_order: bool,
    pub(super) shape: Vec<u64>,
}

/// Parses `{'descr': '|u1', 'fortran_order': False, 'shape': (2, 3), }`. The keys may be in any order.
///
/// The error describes the unexpected text.
pub(super) fn parse(text: &[u8]) -> Result<HeaderFields, String> {
    let text = std::str::from_utf8(text).map_err(|_| "a header that is not text")?.trim();
    let body = text.strip_prefix('{').and_then(|t| t.strip_suffix('}'));
    let mut rest = body.ok_or("a header that is not a dictionary")?.trim_start();
    let (mut descr, mut fortran, mut shape) = (None, None, None);
    while !rest.is_empty() {
        let (key, behind) = parse_quoted(rest).ok_or("a header with a key that is not text")?;
        let value = behind.trim_start().strip_prefix(':').ok_or("a header with a key without a value")?;
        let value = value.trim_start();
        let behind = match key {
            "descr" if value.starts_with('[') => return Err("a structured type".into()),
            "descr" => {
                let (parsed, behind) = parse_quoted(value).ok_or("a header whose descr is not text")?;
                descr = Some(parsed.to_owned());
                behind
            }
            "fortran_order" => {
                let (parsed, behind) =
                    parse_bool(value).ok_or("a header whose fortran_order is not a Boolean value")?;
                fortran = Some(parsed);
                behind
            }
            "shape" => {
                let (parsed, behind) =
                    parse_shape(value).ok_or("a header whose shape is not a tuple of lengths")?;
                shape = Some(parsed);
                behind
            }
            other => return Err(format!("a header with the key '{other}'")),
        };
        let behind = behind.trim_start();
        rest = match behind.strip_prefix(',') {
            Some(more) => more.trim_start(),
            None if behind.is_empty() => behind,
            None => return Err("a header with trailing characters after a value".into()),
        };
    }
    match (descr, fortran, shape) {
        (Some(descr), Some(fortran), Some(shape)) => {
            Ok(HeaderFields { descr, is_fortran_order: fortran, shape })
        }
        (None, ..) => Err("a header without descr".into()),
        (_, None, _) => Err("a header without fortran_order".into()),
        _ => Err("a header without shape".into()),
    }
}

/// Parses a string in single or double quotes. Returns its contents and the text after the closing quote.
fn parse_quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| "'\"".contains(*c))?;
    text[1..].split_once(quote)
}

fn parse_bool(text: &str) -> Option<(bool, &str)> {
    let parse_word = |word, value| text.strip_prefix(word).map(|rest| (value, rest));
    parse_word("True", true).or(parse_word("False", false))
}

/// Parses a tuple such as `(2, 3)`, `(2,)`, `()`, or `(2L, 3L)` from Python 2. Returns the values and the text after the
/// tuple.
fn parse_shape(text: &str) -> Option<(Vec<u64>, &str)> {
    let (inside, rest) = text.strip_prefix('(')?.split_once(')')?;
    let inside = inside.trim();
    let inside = inside.strip_suffix(',').unwrap_or(inside);
    if inside.is_empty() {
        return Some((Vec::new(), rest));
    }
    let side = |s: &str| {
        let digits = s.trim().trim_end_matches('L');
        digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?
    };
    Some((inside.split(',').map(side).collect::<Option<_>>()?, rest))
}
