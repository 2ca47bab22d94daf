//! Writes `croissant.json` in format Croissant 1.0 (MLCommons). The file describes the dataset for search engines and
//! loaders.

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::{DatasetOptions, SequenceEntry, Split};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::InnerPath;
use spikelane_io::storage::{self, folders};
use spikelane_measure::report::insert_present;

const FILE_NAME: &str = "croissant.json";

/// Describes the tables of the splits. Each table lists the files of every sequence in one split. `description` is a
/// description of the dataset.
pub(super) fn write(options: &DatasetOptions, tables: &[(Split, String)], description: &str) -> Result<()> {
    let path = options.output.join(FILE_NAME);
    if tables.is_empty() {
        return folders::remove(&options.output, &FILE_NAME.into());
    }
    let described = metadata_json(options, tables, description);
    let text = serde_json::to_vec_pretty(&described)
        .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
    storage::write_small(&path, &text, true)
}

fn metadata_json(options: &DatasetOptions, tables: &[(Split, String)], description: &str) -> Value {
    let files: Vec<Value> = tables.iter().map(|(split, text)| file_object(*split, text)).collect();
    let records: Vec<Value> = tables.iter().map(|(split, text)| record_set(*split, text)).collect();
    let name = options.output.file_name().unwrap_or_default().to_string_lossy();
    // The identifiers in the file start with the dataset's name. Identifiers must consist of letters, digits and
    // dashes.
    let ascii: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let all = json!({
        "@context": context(), "@type": "sc:Dataset", "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": ascii, "description": description, "distribution": files, "recordSet": records,
    });
    let known = [
        ("license", options.license.as_deref().map(license_value)),
        ("version", options.data_version.as_deref().map(Into::into)),
    ];
    insert_present(all, known)
}

/// Returns the URL of the license page if `text` is an SPDX identifier. Other text is returned unchanged.
fn license_value(text: &str) -> Value {
    if text.chars().all(|c| c.is_ascii_alphanumeric() || "-.+".contains(c)) {
        return format!("https://spdx.org/licenses/{text}.html").into();
    }
    text.into()
}

fn file_object(split: Split, text: &str) -> Value {
    let split = split.name();
    json!({
        "@type": "cr:FileObject", "@id": format!("{split}-table"), "name": format!("{split}-table"),
        "description": "One line per sequence: its ground truth image, its noisy stream and its clean stream.",
        "contentUrl": format!("{split}/{}", TABLE_NAME), "contentSize": format!("{} B", text.len()),
        "encodingFormat": "application/jsonlines", "sha256": sha256(text),
    })
}

/// Returns the SHA-256 digest as hexadecimal digits.
fn sha256(text: &str) -> String {
    Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn record_set(split: Split, text: &str) -> Value {
    let split = split.name();
    let field = |name: &str, kind: &str, what: &str| {
        json!({
            "@type": "cr:Field", "@id": format!("{split}/{name}"), "name": name, "description": what,
            "dataType": format!("sc:{kind}"),
            "source": {"fileObject": {"@id": format!("{split}-table")}, "extract": {"column": name}},
        })
    };
    let mut fields = vec![
        field("id", "Text", "Name of the sequence."),
        field("file_name", "Text", "Ground truth image, in the folder of the split."),
        field("spike", "Text", "Noisy stream: one bit per pixel and readout, in the folder of the split."),
        field("clean", "Text", "Clean stream: the noisy stream without noise."),
        field("readouts", "Integer", "Readouts of each stream."),
        field("camera_seed", "Text", "Seed of the fixed pattern."),
        field("record", "Text", "Digest of the record of the sequence."),
    ];
    // The table has a column `input` or `scene_seed` only if one of its lines contains this key.
    for (name, what) in [("input", "Path of the input."), ("scene_seed", "Seed of the scene.")] {
        if text.contains(&format!("\"{name}\":")) {
            fields.push(field(name, "Text", what));
        }
    }
    json!({
        "@type": "cr:RecordSet", "@id": split, "name": split, "key": {"@id": format!("{split}/id")}, "field": fields,
    })
}

/// Returns the context that version 1.0 of the specification defines.
fn context() -> Value {
    let terms = "citeAs column extract field fileProperty fileObject fileSet format includes isLiveDataset jsonPath key md5 \
                 parentField path recordSet references regex repeated replace separator source subField transform";
    let mut all: serde_json::Map<String, Value> =
        terms.split(' ').map(|name| (name.to_owned(), format!("cr:{name}").into())).collect();
    let entries = [
        ("@language", json!("en")),
        ("@vocab", json!("https://schema.org/")),
        ("conformsTo", json!("dct:conformsTo")),
        ("cr", json!("http://mlcommons.org/croissant/")),
        ("rai", json!("http://mlcommons.org/croissant/RAI/")),
        ("dct", json!("http://purl.org/dc/terms/")),
        ("sc", json!("https://schema.org/")),
        ("data", json!({"@id": "cr:data", "@type": "@json"})),
        ("dataType", json!({"@id": "cr:dataType", "@type": "@vocab"})),
        ("examples", json!({"@id": "cr:examples", "@type": "@json"})),
    ];
    all.extend(entries.map(|(key, value)| (key.to_owned(), value)));
    all.into()
}

/// Name of the table in the folder of a split.
const TABLE_NAME: &str = "metadata.jsonl";

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
            let path = InnerPath::from(split.name()).join(TABLE_NAME);
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

#[cfg(test)]
mod tests {
    #[test]
    fn a_digest_is_that_of_the_standard_example() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(super::sha256("abc"), expected);
    }
}
