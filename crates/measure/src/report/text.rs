//! Text in HTML and in Markdown.

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

/// Returns text of a file as a part of a Markdown line or of a table cell.
///
/// Markdown shows the characters of the result as they are. They neither end the line or the cell, nor become HTML or a
/// comment. A control character becomes a space.
///
/// # Examples
/// ```
/// use spikelane_measure::report::markdown_text;
/// assert_eq!(markdown_text("a|b\n<!-- c -->"), r"a\|b &lt;\!-- c --&gt;");
/// ```
#[must_use]
pub fn markdown_text(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            c if c.is_ascii_punctuation() && !"-.,:/()".contains(c) => escaped.extend(['\\', c]),
            c => escaped.push(if is_line_break(c) { ' ' } else { c }),
        }
    }
    escaped
}

/// Returns an identifier of a file, such as a digest, as a Markdown code span. Text with other characters than ASCII letters,
/// digits and `-_.:` becomes [`markdown_text`].
///
/// # Examples
/// ```
/// use spikelane_measure::report::markdown_code;
/// assert_eq!((markdown_code("v-1.0"), markdown_code("`<")), ("`v-1.0`".into(), r"\`&lt;".into()));
/// ```
#[must_use]
pub fn markdown_code(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.:".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) { format!("`{text}`") } else { markdown_text(text) }
}

/// Returns whether a program may end a line at this character.
fn is_line_break(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}' | '\u{2029}')
}
