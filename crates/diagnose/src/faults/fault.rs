//! Faults of recordings.

use serde::Serialize;

/// The kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// The scene moves.
    SceneMoves,
    /// The fixed pattern differs from that of the other recordings: another frame size, layout or camera.
    PatternMismatch,
    /// The light changes during the recording.
    LightDrift,
    /// The light of the recording differs from the stated one.
    LightMismatch,
    /// The lit levels scatter about a smooth response by more than the uncertainty of their light.
    LightScatter,
    /// The light oscillates, for example with the mains frequency.
    LightFlicker,
}

/// A fault of a recording, of its light or of its file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Fault {
    /// File name of the recording; `None` if the whole set has the fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
    /// Kind of the fault.
    pub kind: FaultKind,
    /// The finding in one sentence.
    pub description: String,
    /// Whether the recording was excluded.
    pub is_excluded: bool,
}

impl Fault {
    pub(super) fn new(recording: &str, kind: FaultKind, words: String) -> Self {
        Self { recording: Some(recording.to_owned()), kind, description: words, is_excluded: true }
    }

    /// Creates a fault of a lamp whose light differs from the stated light. The recording is not excluded.
    pub(super) fn of_lamp(recording: &str, words: String) -> Self {
        Self { is_excluded: false, ..Self::new(recording, FaultKind::LightMismatch, words) }
    }

    /// Creates a fault of the whole set. No recording is excluded.
    pub(super) fn of_set(kind: FaultKind, words: String) -> Self {
        Self { recording: None, kind, description: words, is_excluded: false }
    }

    /// Returns the file name and the description. If the recording was excluded, another sentence states this.
    #[must_use]
    pub fn sentence(&self) -> String {
        let file = self.recording.as_ref().map_or_else(String::new, |file| format!("{file}: "));
        let aside = if self.is_excluded { " This recording was excluded." } else { "" };
        format!("{file}{}{aside}", self.description)
    }
}
