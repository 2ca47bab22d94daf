//! The tables by which Hugging Face's `imagefolder` knows the pictures of each split: `SPLIT/metadata.jsonl`.

use serde_json::json;

use crate::{DatasetOptions, Entry, Split};
use spikelane::error::Result;
use spikelane::unstable::inputs::InnerPath;
use spikelane_io::storage::{self, trees};
use spikelane_measure::report::with_known;

/// Its name in the folder of a split.
pub(super) const NAME: &str = "metadata.jsonl";

#[derive(Default)]
pub(super) struct Tables {
    splits: [String; 3],
}

impl Tables {
    pub(super) fn add(&mut self, entry: &Entry, split: usize) {
        let id = &entry.id;
        // Seeds exceed the integers of some readers, and some take a text of digits for a number.
        let about = json!({
            "file_name": format!("gt/{id}.png"), "id": id, "spike": format!("spike/{id}.dat"),
            "clean": format!("clean/{id}.dat"), "readouts": entry.readouts,
            "camera_seed": format!("{:#x}", entry.seeds[0]), "record": entry.digest,
        });
        let more = [
            ("input", entry.input.as_deref().map(Into::into)),
            ("scene_seed", entry.scene_seed.map(|s| format!("{s:#x}").into())),
        ];
        self.splits[split] += &format!("{}\n", with_known(about, more));
    }

    /// Writes the tables; returns those that are not empty, by their split.
    pub(super) fn write(self, options: &DatasetOptions) -> Result<Vec<(Split, String)>> {
        let mut written = Vec::new();
        for (split, text) in Split::ALL.into_iter().zip(self.splits) {
            let path = InnerPath::from(split.name()).join(NAME);
            if text.is_empty() {
                trees::remove(&options.output, &path)?;
            } else {
                storage::write_small(&trees::prepare(&options.output, &path)?, text.as_bytes(), true)?;
                written.push((split, text));
            }
        }
        Ok(written)
    }
}
