//! Names of settings in messages, which each interface spells in its own way.

use std::borrow::Cow;
use std::fmt;

/// Characters of the private use area that enclose a key in the text of a message.
const BEGIN: char = '\u{e000}';
const END: char = '\u{e001}';

/// The key of a setting in a message, such as `Setting("width")`.
///
/// A library does not know whether its caller sets a command-line flag, a parameter or a field. [`super::Error`]
/// therefore stores the key, and [`super::Error::render`] replaces the key by its spelling. [`render_settings`]
/// replaces the keys in other texts.
///
/// ```
/// use spikelane::error::{Error, ErrorKind, Setting};
///
/// let error = Error::new(ErrorKind::Usage, "a.dat")
///     .remedy(format_args!("set {} and {}", Setting("width"), Setting("height")));
/// assert_eq!(error.to_string(), "a.dat: set `width` and `height`");
/// assert_eq!(error.render(&|key| format!("--{key}")), "a.dat: set --width and --height");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting(pub &'static str);

/// Writes the key in a form that [`render_settings`] finds.
impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{BEGIN}{}{END}", self.0)
    }
}

/// Returns the default spelling of a key, in backticks.
pub(super) fn quoted(key: &str) -> String {
    format!("`{key}`")
}

/// Returns `text` with the key of each [`Setting`] replaced by `spell(key)`.
///
/// A file name may contain the enclosing characters too. The text between them is replaced only if it has the form of a
/// key.
///
/// # Examples
/// ```
/// use spikelane::error::{Setting, render_settings};
/// let text = format!("{} has no effect on still images", Setting("frame_rate"));
/// let flag = |key: &str| format!("--{}", key.replace('_', "-"));
/// assert_eq!(render_settings(&text, &flag), "--frame-rate has no effect on still images");
/// ```
pub fn render_settings<'a>(text: &'a str, spell: &dyn Fn(&str) -> String) -> Cow<'a, str> {
    if !text.contains(BEGIN) {
        return Cow::Borrowed(text);
    }
    let is_key = |key: &str| !key.is_empty() && key.bytes().all(|b| b.is_ascii_lowercase() || b == b'_');
    let mut rendered = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(BEGIN) {
        rendered += before;
        rest = match after.split_once(END) {
            Some((key, behind)) if is_key(key) => {
                rendered += &spell(key);
                behind
            }
            _ => {
                rendered.push(BEGIN);
                after
            }
        };
    }
    Cow::Owned(rendered + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_is_spelled_as_the_interface_spells_it() {
        let text = format!("set {} and {}, or neither", Setting("width"), Setting("missing_frames"));
        assert_eq!(render_settings(&text, &quoted), "set `width` and `missing_frames`, or neither");
        let parameter = |key: &str| format!("{key}=");
        assert_eq!(render_settings(&text, &parameter), "set width= and missing_frames=, or neither");
    }

    #[test]
    fn other_text_between_the_enclosing_characters_stays() {
        for text in ["no setting", "a\u{e000}b", "\u{e000}A file.dat\u{e001}", "\u{e001}\u{e000}\u{e001}"] {
            assert_eq!(render_settings(text, &quoted), text);
        }
    }
}
