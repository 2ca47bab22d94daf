//! The command of a method, with placeholders for the files and numbers of a sequence.

use std::path::PathBuf;

use spikelane::error::{Error, ErrorKind, Result};

use crate::generated::GeneratedSequence;

/// The files of one sequence.
pub(super) struct SequenceJob<'a> {
    pub sequence: &'a GeneratedSequence,
    pub stream: PathBuf,
    pub output: PathBuf,
}

/// Names of the placeholders.
const PLACEHOLDERS: [&str; 10] = [
    "stream",
    "output",
    "width",
    "height",
    "readouts",
    "readout",
    "interval",
    "readout_hz",
    "white_rate",
    "mosaic",
];

/// A command that is split into words.
///
/// Spaces separate words. Single or double quotes enclose spaces, and there is no other quotation: a backslash is a
/// backslash. `{NAME}` is a placeholder, `{{` is `{`, and `}}` is `}`. No shell reads the command.
///
/// # Examples
/// ```
/// use spikelane_benchmark::run::CommandTemplate;
/// let command = CommandTemplate::parse("python 'my method.py' --in={stream} {output}")?;
/// assert_eq!(command.words(), ["python", "my method.py", "--in={stream}", "{output}"]);
/// assert!(CommandTemplate::parse("python my.py {steam}").is_err());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandTemplate {
    words: Vec<String>,
}

impl CommandTemplate {
    /// Splits a command into words and checks its placeholders.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the command is empty, if a quote or a brace is not closed, or if a placeholder is unknown.
    pub fn parse(text: &str) -> Result<Self> {
        let words = split_words(text)?;
        if words.is_empty() {
            return Err(usage_error(text).found("no word").expected("a program and its arguments"));
        }
        for word in &words {
            expand(word, &|_| Some(String::new()))?;
        }
        Ok(Self { words })
    }

    /// Returns the words, in which placeholders are not replaced.
    #[must_use]
    pub fn words(&self) -> &[String] {
        &self.words
    }

    /// Returns whether a word contains the placeholder `name`.
    #[must_use]
    pub fn has_placeholder(&self, name: &str) -> bool {
        let found = std::cell::Cell::new(false);
        for word in &self.words {
            let _ = expand(word, &|key| {
                found.set(found.get() || key == name);
                Some(String::new())
            });
        }
        found.get()
    }

    /// Returns whether a word contains a placeholder.
    #[must_use]
    pub fn has_placeholders(&self) -> bool {
        PLACEHOLDERS.iter().any(|name| self.has_placeholder(name))
    }

    /// Returns the words for a sequence.
    pub(super) fn words_for(&self, job: &SequenceJob<'_>) -> Result<Vec<String>> {
        let value = |key: &str| {
            Some(match key {
                "stream" => job.stream.display().to_string(),
                "output" => job.output.display().to_string(),
                "width" => job.sequence.width.to_string(),
                "height" => job.sequence.height.to_string(),
                "readouts" => job.sequence.readouts.to_string(),
                "readout" => job.sequence.reference_readout.to_string(),
                "interval" => job.sequence.interval_readouts.to_string(),
                "readout_hz" => job.sequence.readout_hz.to_string(),
                "white_rate" => job.sequence.white_rate.to_string(),
                "mosaic" => job.sequence.mosaic.as_ref().map_or("none", |m| &m.pattern).to_owned(),
                _ => return None,
            })
        };
        self.words.iter().map(|word| expand(word, &value)).collect()
    }
}

fn usage_error(text: &str) -> Error {
    Error::new(ErrorKind::Usage, format_args!("command `{text}`"))
}

/// Splits a command at spaces outside quotes.
fn split_words(text: &str) -> Result<Vec<String>> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None::<char>);
    for c in text.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '\'' | '"') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, c) if c.is_whitespace() => words.extend(word.take()),
            (_, c) => word.get_or_insert_default().push(c),
        }
    }
    if let Some(open) = quote {
        return Err(usage_error(text)
            .found(format_args!("an open quote {open}"))
            .expected("a closing quote"));
    }
    words.extend(word);
    Ok(words)
}

/// Replaces the placeholders of a word.
fn expand(word: &str, value: &dyn Fn(&str) -> Option<String>) -> Result<String> {
    let mut text = String::new();
    let mut rest = word;
    while let Some(at) = rest.find(['{', '}']) {
        text.push_str(&rest[..at]);
        let brace = &rest[at..=at];
        rest = &rest[at + 1..];
        if let Some(after) = rest.strip_prefix(brace) {
            text.push_str(brace);
            rest = after;
            continue;
        }
        let placeholder = rest.split_once('}').filter(|_| brace == "{");
        let Some((name, after)) = placeholder.filter(|(name, _)| PLACEHOLDERS.contains(name)) else {
            let name = placeholder.map_or("", |(name, _)| name);
            return Err(usage_error(word)
                .found(if name.is_empty() { "a single brace".into() } else { format!("{{{name}}}") })
                .expected(format_args!("{{{}}}, or a doubled brace", PLACEHOLDERS.join("}, {")))
                .with_suggestion(name, PLACEHOLDERS));
        };
        text.push_str(&value(name).unwrap_or_default());
        rest = after;
    }
    Ok(text + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_and_braces_follow_the_documented_rule() {
        let words = |text: &str| CommandTemplate::parse(text).map(|c| c.words);
        assert_eq!(words("a  'b c' \"d'e\" ''").unwrap(), ["a", "b c", "d'e", ""]);
        assert_eq!(words(r"C:\tools\m.exe x'y z'w").unwrap(), [r"C:\tools\m.exe", "xy zw"]);
        assert_eq!(expand("{{x}} {width}px", &|_| Some("4".into())).unwrap(), "{x} 4px");
        for wrong in ["", "  ", "a 'b", "a {", "a }", "a {strem}", "a {stream"] {
            assert_eq!(words(wrong).unwrap_err().kind(), ErrorKind::Usage, "{wrong}");
        }
        let error = words("a {strem}").unwrap_err();
        assert!(error.to_string().contains("did you mean stream"), "{error}");
    }
}
