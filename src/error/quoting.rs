//! Text of files in messages.

use std::borrow::Cow;

/// Largest number of characters of the text of a file in a message.
const MAX_QUOTED_CHARS: usize = 200;

/// Returns the first 200 characters of `text`. If characters are missing, the length of `text` follows.
///
/// # Examples
/// ```
/// use spikelane::error::excerpt;
/// assert_eq!(excerpt("short"), "short");
/// let long = excerpt(&"x".repeat(1000)).into_owned();
/// assert_eq!(long, "x".repeat(200) + "... (1000 characters)");
/// ```
pub fn excerpt(text: &str) -> Cow<'_, str> {
    match text.char_indices().nth(MAX_QUOTED_CHARS) {
        None => Cow::Borrowed(text),
        Some((end, _)) => Cow::Owned(format!("{}... ({} characters)", &text[..end], text.chars().count())),
    }
}

/// Returns the place and the reason of a fault in a TOML text. The message of the parser also quotes the whole line.
#[cfg(feature = "presets")]
pub fn toml_fault(error: &toml::de::Error) -> String {
    let text = error.to_string();
    match text.lines().next() {
        Some(place) if error.span().is_some() => format!("{place}: {}", error.message()),
        _ => text.trim_end().to_owned(),
    }
}
