//! Folders as the field's loaders expect them, made of links to the sequences' files.

use std::fs;
use std::path::Path;

use crate::dataset::{DatasetOptions, Entry, Structure};
use crate::error::{Error, Result};
use crate::simulate::{Sidecar, StreamFacts};
use crate::storage;

/// Puts the stream and the clear image of a sequence where loaders look.
///
/// Hard links cost no space and look like files everywhere; where the disk has none, copies.
pub(super) fn place(options: &DatasetOptions, entry: &Entry) -> Result<()> {
    let sequence = options.output.join("sequences").join(&entry.id);
    let split = options.output.join(&entry.split);
    let sidecar = Sidecar::read(&sequence.join("stream.json"))?;
    for (file, folder) in [("stream.dat", "spike"), ("stream.clean.dat", "clean")] {
        let name = format!("{}.dat", entry.id);
        link(&sequence.join(file), &split.join(folder), &name)?;
        // Here each has a folder of its own, and its name.
        let stream = StreamFacts { file: name, ..sidecar.facts(file).clone() };
        let own = Sidecar { stream, clean: None, images: None, ..sidecar.clone() };
        own.write(&split.join(folder).join(format!("{}.json", entry.id)), true)?;
    }
    link(&sequence.join("gt.png"), &split.join("gt"), &format!("{}.png", entry.id))
}

/// Takes a sequence out of them.
pub(super) fn displace(options: &DatasetOptions, id: &str) {
    for split in ["train", "test"] {
        for file in ["spike/ID.dat", "spike/ID.json", "clean/ID.dat", "clean/ID.json", "gt/ID.png"] {
            // Most are not there; one that cannot be removed fails when it is placed again.
            let _ = fs::remove_file(options.output.join(split).join(file.replace("ID", id)));
        }
    }
}

fn link(from: &Path, folder: &Path, name: &str) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let (to, hidden) = (folder.join(name), folder.join(format!(".{name}.partial")));
    let _ = fs::remove_file(&hidden);
    if fs::hard_link(from, &hidden).is_err() {
        fs::copy(from, &hidden).map_err(|e| Error::io(to.display(), e))?;
    }
    // Renaming a link over another link to the same file does nothing and leaves both.
    let renamed = fs::rename(&hidden, &to).map_err(|e| Error::io(to.display(), e));
    let _ = fs::remove_file(&hidden);
    renamed
}

/// SpikeCV reads this beside the data.
pub(super) fn config(options: &DatasetOptions) -> Result<()> {
    if options.structure != Structure::SpikeCv {
        return Ok(());
    }
    let geometry = options.camera.sensor.geometry;
    let name = options.output.file_name().unwrap_or_default().to_string_lossy();
    let text = format!(
        "filename: {}\nspike_w: {}\nspike_h: {}\nis_labeled: true\nlabeled_data_type: [1]\n\
         labeled_data_suffix: png\ndata_field_identifier: spike\nlabel_field_identifier: gt\n",
        serde_json::Value::from(name.as_ref()),
        geometry.width(),
        geometry.height(),
    );
    storage::write_small(&options.output.join("config.yaml"), text.as_bytes(), true)
}
