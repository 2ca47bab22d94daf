//! Creates the folders that loaders expect. The folders contain links to the files of the sequences.

use std::path::Path;

use super::ssl_csc;
use crate::hidden_file::link_or_copy;
use crate::{DatasetOptions, SequenceEntry, Split};
use spikelane::error::Result;
use spikelane::unstable::inputs::{InnerPath, PlainName};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage::folders;

/// Returns the paths of a sequence's files in the loaders' folders, relative to the folder of the split.
fn split_paths(id: &PlainName) -> [InnerPath; 11] {
    let at = |folder: &'static str, ending| InnerPath::from(folder).join(id.with_ending(ending));
    let [ssl_csc_stream, ssl_csc_sidecar, ssl_csc_image] = ssl_csc::paths(id);
    [
        ssl_csc_stream,
        ssl_csc_sidecar,
        ssl_csc_image,
        at("spike", ".dat"),
        at("spike", ".json"),
        at("clean", ".dat"),
        at("clean", ".json"),
        at("gt", ".png"),
        at("mot", ""),
        at("kitti/label_02", ".txt"),
        at("kitti/calib", ".txt"),
    ]
}

/// Returns the paths of a sequence's labels in SpikeCV's folders, relative to the folder of the dataset.
fn spikecv_paths(split: Split, id: &PlainName) -> impl Iterator<Item = InnerPath> {
    ["boxes", "depth", "flow"].into_iter().flat_map(move |kind| {
        let root = InnerPath::from("spikecv").join(kind).join(split.name());
        [root.join("spike").join(id), root.join(kind).join(id)]
    })
}

/// Creates links to the streams and the ground truth of a sequence in the loaders' folders.
///
/// Hard links use no disk space and look like regular files. If the file system does not support hard links, files are
/// copied. The function returns the number of copied files. Existing files are not replaced.
pub(crate) fn link_sequence(options: &DatasetOptions, entry: &SequenceEntry) -> Result<u64> {
    let (root, access, id) = (&options.output, options.access(), &entry.id);
    let sequence = entry.path().resolve_in(root, access)?;
    let resolve = |name: &'static str| InnerPath::from(name).resolve_in(&sequence, access);
    let split = InnerPath::from(entry.split.name());
    let sidecar = Sidecar::read(&resolve("stream.json")?)?;
    let mut copied = 0;
    for (file, folder) in [("stream.dat", "spike"), ("stream.clean.dat", "clean")] {
        let name = id.with_ending(".dat");
        let folder = split.join(folder);
        copied += link_or_copy(&resolve(file)?, root, &folder.join(&name))?;
        // In the loaders' folders, each stream has its own sidecar. The file name of the stream is the name of the
        // sequence.
        let stream = StreamFacts { file: name.to_string(), ..sidecar.stream_facts(file).clone() };
        let link_sidecar = Sidecar { stream, clean: None, images: None, ..sidecar.clone() };
        link_sidecar.write(&folders::create_parents(root, &folder.join(id.with_ending(".json")))?, true)?;
    }
    copied += link_or_copy(&resolve("gt.png")?, root, &split.join("gt").join(id.with_ending(".png")))?;
    ssl_csc::write(options, entry, &sequence)?;
    Ok(copied)
}

/// Removes partial files that killed processes left in the dataset's own folders. No other process may write to these
/// folders at the same time.
pub(crate) fn remove_partials(folder: &Path) -> Result<()> {
    folders::remove_partials(folder, |_| true)?;
    folders::remove_partials_in(folder, &"sequences".into())?;
    for split in Split::ALL.map(|split| InnerPath::from(split.name())) {
        folders::remove_partials_in(folder, &split)?;
        for kind in ["spike", "clean", "gt", "spk/spikelane", "gt/spikelane"] {
            folders::remove_partials_in(folder, &split.join(kind))?;
        }
    }
    Ok(())
}

/// Removes the files of a sequence from the loaders' folders.
pub(crate) fn unlink_sequence(options: &DatasetOptions, id: &PlainName) -> Result<()> {
    for split in Split::ALL {
        for path in split_paths(id) {
            folders::remove(&options.output, &InnerPath::from(split.name()).join(path))?;
        }
        for path in spikecv_paths(split, id) {
            folders::remove(&options.output, &path)?;
        }
    }
    Ok(())
}
