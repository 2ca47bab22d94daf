//! Finds videos and image folders in a folder and its subfolders.

use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::spec::path_name;
use crate::{DatasetOptions, InputContent, Pictures};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::draws::RandomStream;
use spikelane::unstable::inputs::{Access, PlainName, check_link, path_from_text, read_text_up_to};
use spikelane_io::light::{TIME_FILE_NAMES, check_is_video, image_file, image_files};

/// Extensions of files that may contain several frames.
const VIDEO_EXTENSIONS: [&str; 19] = [
    "mp4", "mkv", "mov", "avi", "webm", "m4v", "mpg", "mpeg", "ts", "mts", "wmv", "flv", "ogv", "3gp", "gif",
    "mxf", "y4m", "npy", "npz",
];

/// Maximum size of a list of inputs in bytes.
const MAX_LIST_BYTES: u64 = 1 << 30;

/// An input file or folder that becomes a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Input {
    /// Unique name of the sequence. The name is derived from the path.
    pub id: PlainName,
    /// Path relative to the searched folder.
    pub path: PathBuf,
    /// Number of frames. `None` if the folder listing does not determine the number.
    pub frames: Option<u64>,
}

/// Returns the inputs in `folder` and its subfolders, in the order of their paths.
///
/// Links to folders are not followed. Hidden entries are skipped. The folder `excluded`, which is the output folder,
/// is also skipped.
///
/// # Examples
/// ```
/// use spikelane_dataset::discover_inputs;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// for name in ["b.mp4", "a.npy", "notes.txt"] {
///     std::fs::write(folder.path().join(name), []).map_err(|e| spikelane::Error::io(name, e))?;
/// }
/// let inputs = discover_inputs(folder.path(), &folder.path().join("out"))?;
/// let paths: Vec<_> = inputs.iter().map(|input| input.path.display().to_string()).collect();
/// assert_eq!(paths, ["a.npy", "b.mp4"]);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Io`] if a folder cannot be listed.
/// * [`ErrorKind::Input`] if no input is found, or if an input is a link to a file outside the folder.
pub fn discover_inputs(folder: &Path, excluded: &Path) -> Result<Vec<Input>> {
    let mut all = Vec::new();
    for_each_in_folder(folder, excluded, Pictures::Video, Access::Read, &mut |input| {
        all.push(input);
        Ok(())
    })?;
    Ok(all)
}

/// Calls `visit` for each input of a dataset in the order of the paths. If the dataset has a list of inputs, only the
/// inputs in the list are used. Otherwise all inputs in the folder are used.
///
/// If there is a list, the whole list is in memory. Otherwise only the names in one folder at a time are in memory.
pub(super) fn for_each_input(
    options: &DatasetOptions,
    inputs: &InputContent,
    visit: &mut dyn FnMut(Input) -> Result<()>,
) -> Result<()> {
    match &inputs.list {
        Some(list) => for_each_in_list(list, inputs, options.follow_links, visit),
        None => {
            let access = options.access();
            for_each_in_folder(&inputs.folder, &options.output, inputs.pictures, access, visit)
        }
    }
}

fn for_each_in_folder(
    folder: &Path,
    except: &Path,
    pictures: Pictures,
    access: Access,
    visit: &mut dyn FnMut(Input) -> Result<()>,
) -> Result<()> {
    let folder_name = path_name(folder);
    let (mut inputs, mut others) = (0u64, 0u64);
    walk_inputs(folder, except, &mut |path, what| match what {
        PathKind::Pictures(names) if pictures == Pictures::Stills => {
            for name in names {
                inputs += 1;
                let picture = path.join(name);
                check_link(folder, &folder.join(&picture), access)?;
                visit(still_input(picture, &folder_name)?)?;
            }
            Ok(())
        }
        PathKind::Pictures(names) if names.len() > 1 => {
            inputs += 1;
            check_pictures(&folder.join(&path), pictures, access == Access::ReadThroughLinks)?;
            let frames = Some(names.len() as u64);
            visit(Input { id: sequence_id(&path, &folder_name)?, path, frames })
        }
        PathKind::Video => {
            inputs += 1;
            check_link(folder, &folder.join(&path), access)?;
            visit(Input { id: sequence_id(&path, &folder_name)?, path, frames: None })
        }
        PathKind::Pictures(_) | PathKind::Other => {
            others += 1;
            Ok(())
        }
    })?;
    if inputs > 0 {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, folder.display())
        .found(format_args!("neither a video nor a folder of images among {}", Count(others, "file")))
        .expected("at least one video, or a folder of two or more images")
        .remedy(format_args!(
            "add a video or a folder of images, or set {} to convert every picture into its own sequence",
            Setting("stills")
        )))
}

/// Calls `visit` for the inputs in a list. Each line contains one path, which is relative to `folder`. Empty lines are
/// skipped.
fn for_each_in_list(
    list: &Path,
    inputs: &InputContent,
    follow_links: bool,
    visit: &mut dyn FnMut(Input) -> Result<()>,
) -> Result<()> {
    let folder = &inputs.folder;
    let text = read_text_up_to(list, "a list of inputs", MAX_LIST_BYTES)?;
    let mut lines: Vec<(&str, usize)> =
        text.lines().zip(1..).map(|(line, n)| (line.trim_end(), n)).filter(|(l, _)| !l.is_empty()).collect();
    lines.sort_unstable();
    lines.dedup_by_key(|(line, _)| *line);
    if lines.is_empty() {
        return Err(Error::new(ErrorKind::Input, list.display())
            .found("no path")
            .expected("one path per line"));
    }
    for (line, n) in lines {
        let input_path = path_from_text(folder, line);
        let line = if input_path == folder.join(line) { line.to_owned() } else { line.replace('\\', "/") };
        let metadata = fs::metadata(&input_path).map_err(|e| {
            Error::io(format_args!("{}: line {n}: {}", list.display(), input_path.display()), e)
        })?;
        let images = if metadata.is_dir() { Some(image_files(&input_path, follow_links)?) } else { None };
        if let (Some(images), Pictures::Stills) = (&images, inputs.pictures) {
            let mut names: Vec<_> = images.iter().filter_map(|image| image.file_name()).collect();
            names.sort_unstable();
            names.iter().try_for_each(|name| visit(still_input(Path::new(&line).join(name), "clip")?))?;
            continue;
        }
        if images.is_some() {
            check_pictures(&input_path, inputs.pictures, follow_links)?;
        }
        let frames = images.map(|images| images.len() as u64);
        visit(Input { id: sequence_id(Path::new(&line), "clip")?, path: PathBuf::from(line), frames })?;
    }
    Ok(())
}

/// Returns the input of a picture that is a sequence of its own.
fn still_input(path: PathBuf, folder_name: &str) -> Result<Input> {
    Ok(Input { id: sequence_id(&path, folder_name)?, path, frames: Some(1) })
}

/// Checks that a folder of pictures is a video, unless the user states it.
fn check_pictures(folder: &Path, pictures: Pictures, follow_links: bool) -> Result<()> {
    if pictures != Pictures::Auto {
        return Ok(());
    }
    check_is_video(folder, follow_links).map_err(|e| match e.kind() {
        ErrorKind::Input => e.remedy(format_args!(
            "set {} to convert every picture into its own sequence, or set {} if the pictures are the frames of a video, all of one size",
            Setting("stills"),
            Setting("video")
        )),
        _ => e,
    })
}

/// Returns the files in the folder of the inputs and its subfolders that are neither an input nor a part of an input. The
/// paths are relative to the folder.
///
/// If a folder contains a single image, such as a cover or a thumbnail, the image is a skipped file, unless every picture
/// is a sequence.
///
/// # Errors
/// [`ErrorKind::Io`] if a folder cannot be listed.
pub fn skipped_files(inputs: &InputContent, excluded: &Path) -> Result<Vec<PathBuf>> {
    let mut others = Vec::new();
    walk_inputs(&inputs.folder, excluded, &mut |path, what| {
        match what {
            PathKind::Other => others.push(path),
            PathKind::Pictures(names) if names.len() == 1 && inputs.pictures != Pictures::Stills => {
                others.push(path.join(&names[0]));
            }
            _ => {}
        }
        Ok(())
    })?;
    others.sort();
    Ok(others)
}

/// Returns a readable and unique name. The name consists of the alphanumeric characters of the path and a hash of the
/// whole path. If the input is the searched folder itself, its name `folder_name` replaces the path.
///
/// If the path is not ASCII or has more than 60 bytes, only the hash distinguishes the names of similar paths. The hash
/// then has 64 bits. If it had 32 bits, about a hundred duplicates would occur in a million names.
fn sequence_id(path: &Path, folder_name: &str) -> Result<PlainName> {
    // The manifest of a dataset is UTF-8, so it could not name the input.
    let text = path.to_str().ok_or_else(|| {
        Error::new(ErrorKind::Input, path.display())
            .found("a name that is not UTF-8")
            .expected("a name that the manifest can contain")
            .remedy("rename the input")
    })?;
    let readable = if text.is_empty() { folder_name } else { text };
    let ascii: String =
        readable.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(60).collect();
    let ascii = ascii.trim_matches('-');
    let name = if ascii.is_empty() { "clip" } else { ascii };
    let hash = RandomStream::from_name(text).id();
    let id = if text.is_ascii() && text.len() <= 60 {
        format!("{name}-{:08x}", hash as u32)
    } else {
        format!("{name}-{hash:016x}")
    };
    PlainName::parse(ErrorKind::Input, path.display(), &id)
}

/// Returns the path of the input that has the name `name` in a manifest or a plan.
///
/// An input from a list may be outside the folder, because the user chooses the paths of the list. An input from a
/// searched folder must be inside that folder, also after its links are followed, unless `access` allows other links.
///
/// # Errors
/// * [`ErrorKind::Corrupt`] if a path from a searched folder is outside that folder.
/// * [`ErrorKind::Input`] if `access` forbids a link along the path.
pub(super) fn input_path(inputs: &InputContent, name: &Path, access: Access) -> Result<PathBuf> {
    let path = inputs.folder.join(name);
    if inputs.list.is_some() {
        return Ok(path);
    }
    if name.components().all(|part| matches!(part, Component::Normal(_))) {
        for part in path.ancestors().take(name.components().count()) {
            check_link(&inputs.folder, part, access)?;
        }
        return Ok(path);
    }
    Err(Error::new(ErrorKind::Corrupt, name.display())
        .found("a path that points outside the input folder")
        .expected(format_args!("an input inside {}", inputs.folder.display()))
        .remedy("plan the dataset again, or generate the dataset in another folder"))
}

/// Kind of a path in a folder.
enum PathKind {
    /// A folder and the sorted names of its pictures, at least one.
    Pictures(Vec<OsString>),
    /// A file that may contain several frames.
    Video,
    Other,
}

fn walk_inputs(
    folder: &Path,
    except: &Path,
    visit: &mut dyn FnMut(PathBuf, PathKind) -> Result<()>,
) -> Result<()> {
    let except = fs::canonicalize(except).ok();
    walk_below(folder, Path::new(""), except.as_deref(), visit)
}

fn walk_below(
    root: &Path,
    below: &Path,
    except: Option<&Path>,
    visit: &mut dyn FnMut(PathBuf, PathKind) -> Result<()>,
) -> Result<()> {
    let folder = root.join(below);
    let refused = |e| Error::io(folder.display(), e);
    let (mut pictures, mut names) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(&folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let (name, kind) = (entry.file_name(), entry.file_type().map_err(refused)?);
        let path = Path::new(&name);
        if name.as_encoded_bytes().starts_with(b".") {
            continue;
        }
        if kind.is_dir() {
            names.push((name, true));
        } else if image_file::is_image(path) {
            pictures.push(name);
        } else if is_video(path) {
            names.push((name, false));
        } else if !TIME_FILE_NAMES.iter().any(|times| name == *times) {
            visit(below.join(&name), PathKind::Other)?;
        }
    }
    if !pictures.is_empty() {
        pictures.sort_unstable();
        visit(below.to_owned(), PathKind::Pictures(pictures))?;
    }
    names.sort_unstable();
    for (name, is_folder) in names {
        let path = below.join(&name);
        if !is_folder {
            visit(path, PathKind::Video)?;
        } else if except.is_none() || fs::canonicalize(root.join(&path)).ok().as_deref() != except {
            walk_below(root, &path, except, visit)?;
        }
    }
    Ok(())
}

fn is_video(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    ending.is_some_and(|e| VIDEO_EXTENSIONS.contains(&e.as_str()))
}
