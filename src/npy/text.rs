//! The text of a header: a Python dictionary of three keys.

/// What the text says.
#[derive(Debug, Default)]
pub(super) struct Said {
    pub(super) descr: String,
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
}

/// Reads `{'descr': '|u1', 'fortran_order': False, 'shape': (2, 3), }` in any order of keys;
/// the error says what was found instead.
pub(super) fn parse(text: &[u8]) -> Result<Said, String> {
    let text = std::str::from_utf8(text).map_err(|_| "a header that is no text")?.trim();
    let body = text.strip_prefix('{').and_then(|t| t.strip_suffix('}'));
    let mut rest = body.ok_or("a header that is no dictionary")?.trim_start();
    let (mut descr, mut fortran, mut shape) = (None, None, None);
    while !rest.is_empty() {
        let (key, behind) = quoted(rest).ok_or("a header with a key that is no text")?;
        let value = behind.trim_start().strip_prefix(':').ok_or("a header with a key without value")?;
        let value = value.trim_start();
        let behind = match key {
            "descr" if value.starts_with('[') => return Err("a structured type".into()),
            "descr" => {
                let (found, behind) = quoted(value).ok_or("a header whose descr is no text")?;
                descr = Some(found.to_owned());
                behind
            }
            "fortran_order" => {
                let (found, behind) = truth(value).ok_or("a header whose fortran_order is no truth value")?;
                fortran = Some(found);
                behind
            }
            "shape" => {
                let (found, behind) = tuple(value).ok_or("a header whose shape is no tuple of lengths")?;
                shape = Some(found);
                behind
            }
            other => return Err(format!("a header with the key '{other}'")),
        };
        let behind = behind.trim_start();
        rest = match behind.strip_prefix(',') {
            Some(more) => more.trim_start(),
            None if behind.is_empty() => behind,
            None => return Err("a header with something behind a value".into()),
        };
    }
    match (descr, fortran, shape) {
        (Some(descr), Some(fortran), Some(shape)) => Ok(Said { descr, fortran, shape }),
        (None, ..) => Err("a header without descr".into()),
        (_, None, _) => Err("a header without fortran_order".into()),
        _ => Err("a header without shape".into()),
    }
}

/// A text in quotes of either kind, and what follows.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| "'\"".contains(*c))?;
    text[1..].split_once(quote)
}

fn truth(text: &str) -> Option<(bool, &str)> {
    let of = |word, value| text.strip_prefix(word).map(|rest| (value, rest));
    of("True", true).or(of("False", false))
}

/// `(2, 3)`, `(2,)` or `()`; Python 2 wrote `(2L, 3L)`.
fn tuple(text: &str) -> Option<(Vec<u64>, &str)> {
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
