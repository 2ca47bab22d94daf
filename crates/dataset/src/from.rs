//! Every video and every folder of images below a folder.

use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::Inputs;
use crate::stamp::pictures_in;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::draws::Stream;
use spikelane::unstable::inputs::{PlainName, read_bytes};
use spikelane_io::light::{TIMES, picture};

/// Endings of files that hold many frames.
const MOVING: [&str; 19] = [
    "mp4", "mkv", "mov", "avi", "webm", "m4v", "mpg", "mpeg", "ts", "mts", "wmv", "flv", "ogv", "3gp", "gif",
    "mxf", "y4m", "npy", "npz",
];

/// The most that a list of inputs may hold, in bytes.
const MAX_LIST_BYTES: u64 = 1 << 30;

/// Something that becomes a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Input {
    /// Name of the sequence: from the path, unique.
    pub id: PlainName,
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
    let mut all = Vec::new();
    in_folder(folder, except, &mut |input| {
        all.push(input);
        Ok(())
    })?;
    Ok(all)
}

/// Tells `tell` the inputs of a dataset one after another, in the order of their paths: those of the list, or all below
/// the folder. Memory holds the names of one folder, or the list.
pub(super) fn each(inputs: &Inputs, except: &Path, tell: &mut dyn FnMut(Input) -> Result<()>) -> Result<()> {
    match &inputs.list {
        Some(list) => in_list(list, &inputs.folder, tell),
        None => in_folder(&inputs.folder, except, tell),
    }
}

fn in_folder(folder: &Path, except: &Path, tell: &mut dyn FnMut(Input) -> Result<()>) -> Result<()> {
    let own = fs::canonicalize(folder).ok().and_then(|f| Some(f.file_name()?.to_string_lossy().into_owned()));
    let own = own.unwrap_or_else(|| "clip".to_owned());
    let (mut found, mut others) = (0u64, 0u64);
    walk(folder, except, &mut |path, what| match what {
        What::Input(frames) => {
            found += 1;
            tell(Input { id: id(&path, &own)?, path, frames })
        }
        What::Other => {
            others += 1;
            Ok(())
        }
    })?;
    if found > 0 {
        return Ok(());
    }
    Err(Error::new(Kind::Input, folder.display())
        .found(format_args!("neither a video nor a folder of images among {others} files"))
        .expected("at least one video, or a folder of two or more images")
        .remedy("'spikelane simulate' holds a single picture, or moves over it (--motion)"))
}

/// The inputs that a text names, one path a line, relative to `folder`; empty lines are passed over.
fn in_list(list: &Path, folder: &Path, tell: &mut dyn FnMut(Input) -> Result<()>) -> Result<()> {
    let bytes = read_bytes(list, "a list of inputs", MAX_LIST_BYTES)?;
    let text = str::from_utf8(&bytes)
        .map_err(|e| Error::new(Kind::Input, list.display()).found(e).expected("one path a line"))?;
    let mut lines: Vec<(&str, usize)> =
        text.lines().zip(1..).map(|(line, n)| (line.trim_end(), n)).filter(|(l, _)| !l.is_empty()).collect();
    lines.sort_unstable();
    lines.dedup_by_key(|(line, _)| *line);
    if lines.is_empty() {
        return Err(Error::new(Kind::Input, list.display()).found("no path").expected("one path a line"));
    }
    for (line, n) in lines {
        let whole = folder.join(line);
        let found = fs::metadata(&whole)
            .map_err(|e| Error::io(format_args!("{}: line {n}: {}", list.display(), whole.display()), e))?;
        let frames = if found.is_dir() { Some(pictures_in(&whole)?.len() as u64) } else { None };
        tell(Input { id: id(Path::new(line), "clip")?, path: PathBuf::from(line), frames })?;
    }
    Ok(())
}

/// The files below a folder that become no sequence and belong to none, by their paths below it. A picture that
/// lies by itself, such as a cover or a thumbnail, is one of them.
///
/// # Errors
/// [`Kind::Io`] when a folder cannot be listed.
pub fn skipped(folder: &Path, except: &Path) -> Result<Vec<PathBuf>> {
    let mut others = Vec::new();
    walk(folder, except, &mut |path, what| {
        if matches!(what, What::Other) {
            others.push(path);
        }
        Ok(())
    })?;
    others.sort();
    Ok(others)
}

/// Readable and unique: the path's letters, or those of the searched folder itself, and a hash of the whole path.
///
/// Where letters are left out, only the hash tells paths apart; 32 bits would give a hundred of a million names twice.
fn id(path: &Path, own: &str) -> Result<PlainName> {
    let text = path.to_string_lossy();
    let readable = if text.is_empty() { own } else { &*text };
    let plain: String =
        readable.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(60).collect();
    let plain = plain.trim_matches('-');
    let name = if plain.is_empty() { "clip" } else { plain };
    let hash = Stream::named(&text).id();
    let id = if text.is_ascii() && text.len() <= 60 {
        format!("{name}-{:08x}", hash as u32)
    } else {
        format!("{name}-{hash:016x}")
    };
    PlainName::parse(Kind::Input, path.display(), &id)
}

/// Returns the path of the input that a manifest or a plan calls `name`.
///
/// The paths of a list are the user's own words and may lead anywhere. Of a folder that was searched they lie below it,
/// under any names that its files have.
///
/// # Errors
/// [`Kind::Corrupt`] for a path that leaves a folder that was searched.
pub(super) fn located(inputs: &Inputs, name: &Path) -> Result<PathBuf> {
    let inside = || name.components().all(|part| matches!(part, Component::Normal(_)));
    if inputs.list.is_some() || inside() {
        return Ok(inputs.folder.join(name));
    }
    Err(Error::new(Kind::Corrupt, name.display())
        .found("a path that leaves the folder of inputs")
        .expected(format_args!("an input below {}", inputs.folder.display()))
        .remedy("plan the data set anew, or make it in another folder"))
}

/// What a path below a folder is.
enum What {
    /// A sequence of so many frames, where a look at the folder tells.
    Input(Option<u64>),
    Other,
}

fn walk(folder: &Path, except: &Path, tell: &mut dyn FnMut(PathBuf, What) -> Result<()>) -> Result<()> {
    let except = fs::canonicalize(except).ok();
    walk_below(folder, Path::new(""), except.as_deref(), tell)
}

fn walk_below(
    root: &Path,
    below: &Path,
    except: Option<&Path>,
    tell: &mut dyn FnMut(PathBuf, What) -> Result<()>,
) -> Result<()> {
    let folder = root.join(below);
    let refused = |e| Error::io(folder.display(), e);
    let (mut pictures, mut one) = (0u64, None);
    let mut names = Vec::new();
    for entry in fs::read_dir(&folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let (name, kind) = (entry.file_name(), entry.file_type().map_err(refused)?);
        let path = Path::new(&name);
        if name.as_encoded_bytes().starts_with(b".") {
            continue;
        }
        if kind.is_dir() {
            names.push((name, true));
        } else if picture::is_picture(path) {
            pictures += 1;
            one.get_or_insert(name);
        } else if is_moving(path) {
            names.push((name, false));
        } else if name != TIMES {
            tell(below.join(&name), What::Other)?;
        }
    }
    match (pictures, one) {
        (1, Some(name)) => tell(below.join(name), What::Other)?,
        (0, _) => {}
        _ => tell(below.to_owned(), What::Input(Some(pictures)))?,
    }
    names.sort_unstable();
    for (name, is_folder) in names {
        let path = below.join(&name);
        if !is_folder {
            tell(path, What::Input(None))?;
        } else if except.is_none() || fs::canonicalize(root.join(&path)).ok().as_deref() != except {
            walk_below(root, &path, except, tell)?;
        }
    }
    Ok(())
}

fn is_moving(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    ending.is_some_and(|e| MOVING.contains(&e.as_str()))
}
