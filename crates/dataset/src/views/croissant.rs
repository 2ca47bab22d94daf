//! Croissant 1.0 (MLCommons): `croissant.json`, by which search engines and loaders know the dataset.

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use super::metadata;
use crate::{DatasetOptions, Split};
use spikelane::error::{Error, Kind, Result};
use spikelane_io::storage::{self, trees};
use spikelane_measure::report::with_known;

const NAME: &str = "croissant.json";

/// Describes the tables of the splits, which name the files of every sequence; `about` says what the dataset is.
pub(super) fn write(options: &DatasetOptions, tables: &[(Split, String)], about: &str) -> Result<()> {
    let path = options.output.join(NAME);
    if tables.is_empty() {
        return trees::remove(&options.output, &NAME.into());
    }
    let described = described(options, tables, about);
    let text = serde_json::to_vec_pretty(&described)
        .map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
    storage::write_small(&path, &text, true)
}

fn described(options: &DatasetOptions, tables: &[(Split, String)], about: &str) -> Value {
    let files: Vec<Value> = tables.iter().map(|(split, text)| file(*split, text)).collect();
    let records: Vec<Value> = tables.iter().map(|(split, text)| record_set(*split, text)).collect();
    let name = options.output.file_name().unwrap_or_default().to_string_lossy();
    // A name begins the file's own identifiers: letters, digits and dashes.
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let all = json!({
        "@context": context(), "@type": "sc:Dataset", "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": plain, "description": about, "distribution": files, "recordSet": records,
    });
    let known = [
        ("license", options.licence.as_deref().map(licence)),
        ("version", options.data_version.as_deref().map(Into::into)),
    ];
    with_known(all, known)
}

/// Identifiers of SPDX have pages; other words stay.
fn licence(text: &str) -> Value {
    if text.chars().all(|c| c.is_ascii_alphanumeric() || "-.+".contains(c)) {
        return format!("https://spdx.org/licenses/{text}.html").into();
    }
    text.into()
}

fn file(split: Split, text: &str) -> Value {
    let split = split.name();
    json!({
        "@type": "cr:FileObject", "@id": format!("{split}-table"), "name": format!("{split}-table"),
        "description": "A line a sequence: its picture of ground truth, its noisy and its clean stream.",
        "contentUrl": format!("{split}/{}", metadata::NAME), "contentSize": format!("{} B", text.len()),
        "encodingFormat": "application/jsonlines", "sha256": sha256(text),
    })
}

/// In hexadecimal digits.
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
        field("file_name", "Text", "Picture of ground truth, below the split's folder."),
        field("spike", "Text", "Noisy stream: a bit a pixel and readout, below the split's folder."),
        field("clean", "Text", "Its twin without noise."),
        field("readouts", "Integer", "Readouts of each stream."),
        field("camera_seed", "Text", "Seed of the fixed pattern."),
        field("record", "Text", "Digest of the sequence's record."),
    ];
    // Keys that no line has are no columns of a reader.
    for (name, what) in [("input", "Path of the input."), ("scene_seed", "Seed of the scene.")] {
        if text.contains(&format!("\"{name}\":")) {
            fields.push(field(name, "Text", what));
        }
    }
    json!({
        "@type": "cr:RecordSet", "@id": split, "name": split, "key": {"@id": format!("{split}/id")}, "field": fields,
    })
}

/// The context that version 1.0 of the specification gives.
fn context() -> Value {
    let own = |name: &str| (name.to_owned(), Value::from(format!("cr:{name}")));
    let mut all: serde_json::Map<String, Value> = [
        "citeAs",
        "column",
        "extract",
        "field",
        "fileProperty",
        "fileObject",
        "fileSet",
        "format",
        "includes",
        "isLiveDataset",
        "jsonPath",
        "key",
        "md5",
        "parentField",
        "path",
        "recordSet",
        "references",
        "regex",
        "repeated",
        "replace",
        "separator",
        "source",
        "subField",
        "transform",
    ]
    .into_iter()
    .map(own)
    .collect();
    let further = [
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
    all.extend(further.map(|(key, value)| (key.to_owned(), value)));
    all.into()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_digest_is_that_of_the_standard_example() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(super::sha256("abc"), expected);
    }
}
