//! Folders as the field's loaders expect them, made of links to the sequences' files.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

use crate::dataset::{DatasetOptions, Entry, Split};
use crate::error::{Error, Result};
use crate::simulate::{Sidecar, StreamFacts};
use crate::storage::{steps, trees};

/// What the labels of a sequence become for loaders.
const LABEL_FOLDERS: [&str; 9] = [
    "SPLIT/mot/ID",
    "SPLIT/kitti/label_02/ID.txt",
    "SPLIT/kitti/calib/ID.txt",
    "spikecv/boxes/SPLIT/spike/ID",
    "spikecv/boxes/SPLIT/boxes/ID",
    "spikecv/depth/SPLIT/spike/ID",
    "spikecv/depth/SPLIT/depth/ID",
    "spikecv/flow/SPLIT/spike/ID",
    "spikecv/flow/SPLIT/flow/ID",
];

/// Puts the stream and the clear image of a sequence where loaders look.
///
/// Hard links cost no space and look like files everywhere; where the disk has none, copies, whose number is returned.
/// What is there already stays.
pub(crate) fn place(options: &DatasetOptions, entry: &Entry) -> Result<u64> {
    let sequence = entry.folder(&options.output);
    let split = options.output.join(&entry.split);
    let sidecar = Sidecar::read(&sequence.join("stream.json"))?;
    let mut copied = 0;
    for (file, folder) in [("stream.dat", "spike"), ("stream.clean.dat", "clean")] {
        let name = format!("{}.dat", entry.id);
        copied += link(&sequence.join(file), &split.join(folder), &name)?;
        // Here each has a folder of its own, and its name.
        let stream = StreamFacts { file: name, ..sidecar.facts(file).clone() };
        let own = Sidecar { stream, clean: None, images: None, ..sidecar.clone() };
        own.write(&split.join(folder).join(format!("{}.json", entry.id)), true)?;
    }
    copied += link(&sequence.join("gt.png"), &split.join("gt"), &format!("{}.png", entry.id))?;
    Ok(copied)
}

/// Removes what killed runs left in the dataset's own folders; nobody else may be at work there.
pub(crate) fn clean(folder: &Path) -> Result<()> {
    trees::remove_partials(folder, |_| true)?;
    trees::remove_partials(&folder.join("sequences"), |_| true)?;
    for split in Split::ALL.map(Split::name) {
        let split = folder.join(split);
        trees::remove_partials(&split, |_| true)?;
        for kind in ["spike", "clean", "gt"] {
            trees::remove_partials(&split.join(kind), |_| true)?;
        }
    }
    Ok(())
}

/// Takes a sequence out of them.
pub(crate) fn displace(options: &DatasetOptions, id: &str) {
    for split in Split::ALL.map(Split::name) {
        for file in ["spike/ID.dat", "spike/ID.json", "clean/ID.dat", "clean/ID.json", "gt/ID.png"] {
            // Most are not there; one that cannot be removed fails when it is placed again.
            let _ = fs::remove_file(options.output.join(split).join(file.replace("ID", id)));
        }
        for folder in LABEL_FOLDERS {
            let place = options.output.join(folder.replace("SPLIT", split).replace("ID", id));
            let _ = fs::remove_dir_all(&place).or_else(|_| fs::remove_file(&place));
        }
    }
}

/// Gives a file another name in `folder`; returns 1 if that took a copy.
///
/// The hidden name follows from the name, so that the next attempt takes the place of one that was killed.
pub(super) fn link(from: &Path, folder: &Path, name: &str) -> Result<u64> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let (to, hidden) = (folder.join(name), folder.join(format!(".{name}.partial")));
    if same(from, &to) {
        return Ok(0);
    }
    let _ = fs::remove_file(&hidden);
    let mut copied = 0;
    if fs::hard_link(from, &hidden).is_err() {
        fs::copy(from, &hidden).map_err(|e| Error::io(to.display(), e))?;
        steps::sync_file(&fs::File::open(&hidden).map_err(|e| Error::io(to.display(), e))?, &hidden)?;
        copied = 1;
    }
    // Renaming a link over another link to the same file does nothing and leaves both.
    let renamed = steps::rename(&hidden, &to);
    let _ = fs::remove_file(&hidden);
    renamed.map(|()| copied)
}

/// Writes a small file in a folder that is made where it is missing; one with these bytes stays.
pub(super) fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    let (to, hidden) = (folder.join(name), folder.join(format!(".{name}.partial")));
    if fs::read(&to).is_ok_and(|found| found == bytes) {
        return Ok(());
    }
    let io = |e| Error::io(to.display(), e);
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let mut file = fs::File::create(&hidden).map_err(io)?;
    file.write_all(bytes).map_err(io)?;
    steps::sync_file(&file, &hidden)?;
    steps::rename(&hidden, &to)
}

/// Whether two names are of one file.
fn same(a: &Path, b: &Path) -> bool {
    let number = |path: &Path| fs::metadata(path).ok().map(|m| (m.dev(), m.ino()));
    number(a).is_some_and(|n| Some(n) == number(b))
}
