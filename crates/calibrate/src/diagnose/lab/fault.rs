//! A fault of the laboratory, in words.

use serde::Serialize;

/// What sort of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// The scene moves.
    Moves,
    /// The pixels' own pattern is not that of the other recordings: another frame size, layout or camera.
    OtherPattern,
    /// The light of a recording changes while it is recorded.
    LightDrifts,
    /// The light of a recording is not what was stated.
    LightOff,
    /// The lit levels scatter by more than what was taken as known of lamps.
    LightsScatter,
    /// The light swings, as that of a lamp on the mains does.
    LightSwings,
}

/// What is wrong with a recording, its light or its file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Fault {
    /// Its file; nothing where the whole set has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
    /// What sort.
    pub kind: FaultKind,
    /// What was found, in a sentence.
    pub words: String,
    /// Whether the recording was set aside.
    pub set_aside: bool,
}

impl Fault {
    pub(super) fn of(recording: &str, kind: FaultKind, words: String) -> Self {
        Self { recording: Some(recording.to_owned()), kind, words, set_aside: true }
    }

    /// A fault that leaves all recordings in.
    pub(super) fn of_set(kind: FaultKind, words: String) -> Self {
        Self { recording: None, kind, words, set_aside: false }
    }

    /// The sentence with its file, and what became of it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let file = self.recording.as_ref().map_or_else(String::new, |file| format!("{file}: "));
        let aside = if self.set_aside { " It was set aside." } else { "" };
        format!("{file}{}{aside}", self.words)
    }
}
