//! Writes one table per split for the `imagefolder` loader of Hugging Face. The table `SPLIT/metadata.jsonl` lists the
//! images of the split.

use serde_json::json;

use crate::{DatasetOptions, SequenceEntry, Split};
use spikelane::error::Result;
use spikelane::unstable::inputs::InnerPath;
use spikelane_io::storage::{self, folders};
use spikelane_measure::report::insert_present;

/// Name of the table in the folder of a split.
pub(super) const FILE_NAME: &str = "metadata.jsonl";

#[derive(Default)]
pub(super) struct Tables {
    splits: [String; 3],
}

impl Tables {
    pub(super) fn add(&mut self, entry: &SequenceEntry, split: usize) {
        let id = &entry.id;
        // Seeds are written as hexadecimal text. Some programs cannot read integers of 64 bits, and other programs
        // convert decimal digits in text to a number.
        let annotation = json!({
            "file_name": format!("gt/{id}.png"), "id": id, "spike": format!("spike/{id}.dat"),
            "clean": format!("clean/{id}.dat"), "readouts": entry.readouts,
            "camera_seed": format!("{:#x}", entry.seeds[0]), "record": entry.digest,
        });
        let more = [
            ("input", entry.input.as_deref().map(Into::into)),
            ("scene_seed", entry.scene_seed.map(|s| format!("{s:#x}").into())),
        ];
        self.splits[split] += &format!("{}\n", insert_present(annotation, more));
    }

    /// Writes the tables. Returns the tables that are not empty, with their splits.
    pub(super) fn write(self, options: &DatasetOptions) -> Result<Vec<(Split, String)>> {
        let mut written = Vec::new();
        for (split, text) in Split::ALL.into_iter().zip(self.splits) {
            let path = InnerPath::from(split.name()).join(FILE_NAME);
            if text.is_empty() {
                folders::remove(&options.output, &path)?;
            } else {
                storage::write_small(
                    &folders::create_parents(&options.output, &path)?,
                    text.as_bytes(),
                    true,
                )?;
                written.push((split, text));
            }
        }
        Ok(written)
    }
}
