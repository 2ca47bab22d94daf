//! Text in markup.

use std::fmt::{self, Display, Write as _};

/// Text whose markup characters are escaped when the text is displayed.
pub(super) struct EscapedText<T>(pub T);

impl<T: AsRef<str>> Display for EscapedText<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.as_ref().chars().try_for_each(|c| match c {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\'' => f.write_str("&#x27;"),
            // XML and HTML do not allow these characters.
            '\0'..='\u{8}' | '\u{b}' | '\u{c}' | '\u{e}'..='\u{1f}' => f.write_char('\u{fffd}'),
            c => f.write_char(c),
        })
    }
}
