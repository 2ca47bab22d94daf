//! Every video and every folder of images below a folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::draws::Stream;
use crate::error::{Error, Kind, Result};
use crate::light::{TIMES, picture};
use crate::storage::Digest;

/// Endings of files that hold many frames.
const MOVING: [&str; 19] = [
    "mp4", "mkv", "mov", "avi", "webm", "m4v", "mpg", "mpeg", "ts", "mts", "wmv", "flv", "ogv", "3gp", "gif",
    "mxf", "y4m", "npy", "npz",
];

/// Something that becomes a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Input {
    /// Name of the sequence: from the path, unique.
    pub id: String,
    /// Path below the folder that was searched.
    pub path: PathBuf,
    /// Frames, when a look at the folder tells.
    pub frames: Option<u64>,
}

/// Finds them in the order of their paths; links to folders are not followed, hidden
/// entries and the folder `except` (the output, if it lies below) are passed over.
///
/// # Errors
/// [`Kind::Io`] when a folder cannot be listed; [`Kind::Input`] when nothing is found.
pub fn inputs(folder: &Path, except: &Path) -> Result<Vec<Input>> {
    let found = search(folder, except)?;
    if found.inputs.is_empty() {
        return Err(Error::new(Kind::Input, folder.display())
            .found(format_args!("neither a video nor a folder of images among {} files", found.others.len()))
            .expected("at least one video, or a folder of two or more images")
            .remedy("'spikelane simulate' holds a single picture, or moves over it (--motion)"));
    }
    let own = fs::canonicalize(folder).ok().and_then(|f| Some(f.file_name()?.to_string_lossy().into_owned()));
    let own = own.unwrap_or_else(|| "clip".to_owned());
    let named = |(path, frames): (PathBuf, _)| Input { id: id(&path, &own), path, frames };
    Ok(found.inputs.into_iter().map(named).collect())
}

/// The files below a folder that become no sequence and belong to none, by their paths below it. A picture that
/// lies by itself, such as a cover or a thumbnail, is one of them.
///
/// # Errors
/// [`Kind::Io`] when a folder cannot be listed.
pub fn skipped(folder: &Path, except: &Path) -> Result<Vec<PathBuf>> {
    let mut others = search(folder, except)?.others;
    others.sort();
    Ok(others)
}

/// What lies below a folder.
#[derive(Default)]
struct Found {
    inputs: BTreeMap<PathBuf, Option<u64>>,
    others: Vec<PathBuf>,
}

fn search(folder: &Path, except: &Path) -> Result<Found> {
    let mut found = Found::default();
    walk(folder, folder, fs::canonicalize(except).ok().as_deref(), &mut found)?;
    Ok(found)
}

/// Readable and unique: the path's letters, or those of the searched folder itself, and a hash of the whole path.
fn id(path: &Path, own: &str) -> String {
    let text = path.to_string_lossy();
    let readable = if text.is_empty() { own } else { &*text };
    let plain: String =
        readable.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(60).collect();
    let plain = plain.trim_matches('-');
    let name = if plain.is_empty() { "clip" } else { plain };
    format!("{name}-{:08x}", Stream::named(&text).id() as u32)
}

fn walk(root: &Path, folder: &Path, except: Option<&Path>, found: &mut Found) -> Result<()> {
    let refused = |e| Error::io(folder.display(), e);
    let mut pictures = Vec::new();
    for entry in fs::read_dir(folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(refused)?);
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        if kind.is_dir() {
            if fs::canonicalize(&path).ok().as_deref() != except {
                walk(root, &path, except, found)?;
            }
        } else if picture::is_picture(&path) {
            pictures.push(below(root, &path));
        } else if is_moving(&path) {
            found.inputs.insert(below(root, &path), None);
        } else if path.file_name().is_some_and(|name| name != TIMES) {
            found.others.push(below(root, &path));
        }
    }
    match pictures.len() {
        0 => {}
        1 => found.others.append(&mut pictures),
        n => drop(found.inputs.insert(below(root, folder), Some(n as u64))),
    }
    Ok(())
}

/// Digest of an input: of a file its bytes, of a folder the names and digests of its images.
///
/// # Errors
/// [`Kind::Io`] when it cannot be read.
pub(super) fn digest(path: &Path) -> Result<String> {
    if !path.is_dir() {
        return Digest::of_file(path);
    }
    let mut lines = Vec::new();
    for entry in fs::read_dir(path).map_err(|e| Error::io(path.display(), e))? {
        let image = entry.map_err(|e| Error::io(path.display(), e))?.path();
        if image.is_file() && picture::is_picture(&image) {
            let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
            lines.push(format!("{name} {}\n", Digest::of_file(&image)?));
        }
    }
    lines.sort();
    Ok(Digest::of(lines.concat().as_bytes()))
}

fn below(root: &Path, path: &Path) -> PathBuf {
    path.strip_prefix(root).unwrap_or(path).to_owned()
}

fn is_moving(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    ending.is_some_and(|e| MOVING.contains(&e.as_str()))
}
