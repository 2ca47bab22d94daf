//! Folders as the field's loaders expect them, made of links to the sequences' files.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::{DatasetOptions, Entry, Split};
use spikelane::error::{Error, Result};
use spikelane::unstable::inputs::{InnerPath, PlainName, read_bytes};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage::{same_file, steps, trees};

/// What a sequence becomes for loaders, in the folder of its split.
fn in_split(id: &PlainName) -> [InnerPath; 8] {
    let at = |folder: &'static str, ending| InnerPath::from(folder).join(id.with(ending));
    [
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

/// What the labels of a sequence become for SpikeCV, in the dataset's folder.
fn in_spikecv(split: Split, id: &PlainName) -> impl Iterator<Item = InnerPath> {
    ["boxes", "depth", "flow"].into_iter().flat_map(move |kind| {
        let root = InnerPath::from("spikecv").join(kind).join(split.name());
        [root.join("spike").join(id), root.join(kind).join(id)]
    })
}

/// Puts the stream and the clear image of a sequence where loaders look.
///
/// Hard links cost no space and look like files everywhere; where the disk has none, copies, whose number is returned.
/// What is there already stays.
pub(crate) fn place(options: &DatasetOptions, entry: &Entry) -> Result<u64> {
    let (root, access, id) = (&options.output, options.access(), &entry.id);
    let sequence = entry.path().below(root, access)?;
    let own = |name: &'static str| InnerPath::from(name).below(&sequence, access);
    let split = InnerPath::from(entry.split.name());
    let sidecar = Sidecar::read(&own("stream.json")?)?;
    let mut copied = 0;
    for (file, folder) in [("stream.dat", "spike"), ("stream.clean.dat", "clean")] {
        let name = id.with(".dat");
        let folder = split.join(folder);
        copied += link(&own(file)?, root, &folder.join(&name))?;
        // Here each has a folder of its own, and its name.
        let stream = StreamFacts { file: name.to_string(), ..sidecar.facts(file).clone() };
        let own = Sidecar { stream, clean: None, images: None, ..sidecar.clone() };
        own.write(&trees::prepare(root, &folder.join(id.with(".json")))?, true)?;
    }
    copied += link(&own("gt.png")?, root, &split.join("gt").join(id.with(".png")))?;
    Ok(copied)
}

/// Removes what killed runs left in the dataset's own folders; nobody else may be at work there.
pub(crate) fn clean(folder: &Path) -> Result<()> {
    trees::remove_partials(folder, |_| true)?;
    trees::remove_partials_in(folder, &"sequences".into())?;
    for split in Split::ALL.map(|split| InnerPath::from(split.name())) {
        trees::remove_partials_in(folder, &split)?;
        for kind in ["spike", "clean", "gt"] {
            trees::remove_partials_in(folder, &split.join(kind))?;
        }
    }
    Ok(())
}

/// Takes a sequence out of them.
pub(crate) fn displace(options: &DatasetOptions, id: &PlainName) -> Result<()> {
    for split in Split::ALL {
        for path in in_split(id) {
            trees::remove(&options.output, &InnerPath::from(split.name()).join(path))?;
        }
        for path in in_spikecv(split, id) {
            trees::remove(&options.output, &path)?;
        }
    }
    Ok(())
}

/// Gives a file another name, `inner` below `root`; returns 1 if that took a copy.
///
/// The hidden name follows from the name, so that the next attempt takes the place of one that was killed.
pub(super) fn link(from: &Path, root: &Path, inner: &InnerPath) -> Result<u64> {
    let to = trees::prepare(root, inner)?;
    if same(from, &to) {
        return Ok(0);
    }
    let hidden = hidden(&to);
    let io = |e| Error::io(to.display(), e);
    // The file itself: a link to a link would break where the first one is relative.
    let from = fs::canonicalize(from).map_err(|e| Error::io(from.display(), e))?;
    let _ = fs::remove_file(&hidden);
    let mut copied = 0;
    if fs::hard_link(&from, &hidden).is_err() {
        let mut file = trees::create(&hidden)?;
        let source = spikelane::unstable::inputs::InputFile::open(&from)?;
        std::io::copy(&mut source.reader(), &mut file).map_err(io)?;
        steps::sync_file(&file, &hidden)?;
        copied = 1;
    }
    // Renaming a link over another link to the same file does nothing and leaves both.
    let renamed = steps::rename(&hidden, &to);
    let _ = fs::remove_file(&hidden);
    renamed.map(|()| copied)
}

/// Writes a small file, `inner` below `root`; one with these bytes stays.
pub(super) fn put(root: &Path, inner: &InnerPath, bytes: &[u8]) -> Result<()> {
    let to = trees::prepare(root, inner)?;
    if read_bytes(&to, "a file of the data set", bytes.len() as u64).is_ok_and(|found| found == bytes) {
        return Ok(());
    }
    let hidden = hidden(&to);
    let mut file = trees::create(&hidden)?;
    file.write_all(bytes).map_err(|e| Error::io(to.display(), e))?;
    steps::sync_file(&file, &hidden)?;
    steps::rename(&hidden, &to)
}

/// The hidden name of a file in the making, beside it.
fn hidden(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.partial"))
}

/// Whether two names are of one file.
fn same(a: &Path, b: &Path) -> bool {
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => same_file(&a, &b) == Some(true),
        _ => false,
    }
}
