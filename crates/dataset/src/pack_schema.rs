//! The schema of packed shards: the members of each sequence, and the keys of the description.
//!
//! Loaders convert packs to tables. A table requires the same members in every sequence, and one type for each key.
//! Files whose number differs between sequences are therefore in one inner tar, and the description has no optional
//! keys. `docs/reference/shards.md` lists the schema for users.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::manifest::SequenceEntry;
use crate::{SequenceRecord, SequenceStatus, Split};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{InnerPath, PlainName, deserialize_digest};
use spikelane_io::simulate::Sidecar;

/// The files of every sequence that are members of the pack, and the endings of these members.
pub(super) const FILE_MEMBERS: [(&str, &str); 4] = [
    ("stream.dat", "spk.dat"),
    ("stream.clean.dat", "clean.dat"),
    ("reference.png", "png"),
    ("gt.png", "gt.png"),
];

/// Ending of the inner tar. It contains all other files of the sequence under their paths.
pub(super) const INNER_TAR: &str = "files.tar";

/// Ending of the member that contains the [`SampleDescription`].
pub(super) const DESCRIPTION: &str = "json";

/// Ending of the member that contains the name of the split.
pub(super) const SPLIT: &str = "split.txt";

/// Maximum size of a description in bytes. The longest text is the path of an input.
pub(super) const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;

/// Returns the name of a member. The text before the first dot is the name of the sequence.
pub(super) fn member_name(id: &PlainName, ending: &'static str) -> InnerPath {
    InnerPath::from(id.with_ending(".").with_ending(ending))
}

/// Returns the ending of the member that contains the file `path`. Returns `None` if the file is in the inner tar.
pub(super) fn file_member(path: &InnerPath) -> Option<&'static str> {
    FILE_MEMBERS.into_iter().find(|(file, _)| *file == path.as_str()).map(|(_, ending)| ending)
}

/// The description of a sequence in a pack. Every sequence has every key, and each key has one type.
///
/// A text is empty if the sequence does not have the property. Seeds are texts, because they can exceed the integers of
/// Arrow.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct SampleDescription {
    pub(super) id: PlainName,
    pub(super) split: Split,
    pub(super) content: String,
    pub(super) input: String,
    pub(super) lighting: String,
    pub(super) scene_seed: String,
    pub(super) camera: String,
    pub(super) camera_seed: String,
    pub(super) shot_seed: String,
    pub(super) sequence_seed: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) readouts: u64,
    pub(super) readout_hz: f64,
    pub(super) mean_rate: f64,
    pub(super) clean_mean_rate: f64,
    pub(super) reference_readout: u64,
    pub(super) reference_transfer: String,
    pub(super) rate_at_255: f64,
    pub(super) frames_above_max_light: u64,
    pub(super) bytes: u64,
    #[serde(deserialize_with = "deserialize_digest")]
    pub(super) record_digest: String,
}

impl SampleDescription {
    /// Collects the description from the files of a finished sequence.
    ///
    /// # Errors
    /// [`ErrorKind::Corrupt`] if a file lacks a key of the schema.
    pub(super) fn new(entry: &SequenceEntry, record: &SequenceRecord, sidecar: Sidecar) -> Result<Self> {
        let missing = |file: &str, key: &str| {
            Error::new(ErrorKind::Corrupt, format_args!("{}/{file}", entry.id))
                .found(format_args!("no key {key}"))
                .expected("the key")
                .remedy("remove the sequence and run the shard again")
        };
        let fact =
            |value: &Value, key| if value.is_null() { Err(missing("record.json", key)) } else { Ok(()) };
        let facts = &record.facts;
        let (reference, truth) = (&facts["reference_readout"], &facts["ground_truth"]["rate_at_255"]);
        fact(reference, "reference_readout")?;
        fact(truth, "ground_truth.rate_at_255")?;
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let [camera_seed, shot_seed, sequence_seed] = entry.seeds.map(|seed| seed.to_string());
        Ok(Self {
            id: entry.id.clone(),
            split: entry.split,
            content: text(&facts["content"]),
            input: entry.input.clone().unwrap_or_default(),
            lighting: text(&facts["lighting"]),
            scene_seed: entry.scene_seed.map(|seed| seed.to_string()).unwrap_or_default(),
            camera: sidecar.camera.ok_or_else(|| missing("stream.json", "camera"))?.name,
            camera_seed,
            shot_seed,
            sequence_seed,
            width: sidecar.width,
            height: sidecar.height,
            readouts: sidecar.readouts,
            readout_hz: sidecar.readout_hz.ok_or_else(|| missing("stream.json", "readout_hz"))?,
            mean_rate: sidecar.stream.mean_rate,
            clean_mean_rate: sidecar.clean.ok_or_else(|| missing("stream.json", "clean"))?.mean_rate,
            reference_readout: reference.as_u64().unwrap_or_default(),
            reference_transfer: text(&facts["reference_transfer"]),
            rate_at_255: truth.as_f64().unwrap_or_default(),
            frames_above_max_light: facts["frames_above_max_light"].as_u64().unwrap_or_default(),
            bytes: record.bytes(),
            record_digest: entry.digest.clone().unwrap_or_default(),
        })
    }

    /// Returns the manifest entry of the sequence.
    ///
    /// # Errors
    /// [`ErrorKind::Corrupt`] if a seed is not an integer of 64 bits. `subject` names the member in the error.
    pub(super) fn entry(self, subject: impl std::fmt::Display) -> Result<SequenceEntry> {
        let seed = |text: &str| {
            text.parse::<u64>().map_err(|e| {
                Error::new(ErrorKind::Corrupt, &subject)
                    .found(format_args!("the seed {text:?}: {e}"))
                    .expected("an integer of 64 bits as text")
            })
        };
        let present = |text: String| Some(text).filter(|text| !text.is_empty());
        let seeds = [seed(&self.camera_seed)?, seed(&self.shot_seed)?, seed(&self.sequence_seed)?];
        Ok(SequenceEntry {
            split: self.split,
            input: present(self.input),
            scene_seed: present(self.scene_seed).as_deref().map(seed).transpose()?,
            readouts: Some(self.readouts),
            bytes: Some(self.bytes),
            digest: present(self.record_digest),
            status: SequenceStatus::Done,
            ..SequenceEntry::new(self.id, seeds)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_before_the_first_dot_is_the_sequence() {
        let id = PlainName::parse(ErrorKind::Input, "id", "scene-0001").unwrap();
        let names = FILE_MEMBERS.map(|(_, ending)| member_name(&id, ending).as_str().to_owned());
        assert_eq!(names, ["spk.dat", "clean.dat", "png", "gt.png"].map(|e| format!("scene-0001.{e}")));
        assert_eq!(file_member(&"stream.dat".into()), Some("spk.dat"));
        assert_eq!(file_member(&"images/000000.png".into()), None);
    }
}
