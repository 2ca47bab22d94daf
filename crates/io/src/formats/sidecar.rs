//! The facts about a stream that the reader reads from the JSON sidecar.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::formats::size::stream_settings;
use crate::formats::writer::sidecar_path;
use crate::formats::{EVENTS_LAYOUT, Layout};
use spikelane::error::{Error, Result, bail, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{
    Access, MAX_TEXT_BYTES, check_link, not_found_as_none, read_bytes, utf8_bytes,
};

/// Facts about a stream, read from the sidecar of the stream. Fields of missing keys are `None`, and unknown keys are
/// ignored.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SidecarFacts {
    pub(super) geometry: Option<Geometry>,
    pub(super) layout: Option<Layout>,
    pub(super) readouts: Option<u64>,
    /// The path of the sidecar.
    pub(super) path: Option<PathBuf>,
}

#[derive(Deserialize)]
struct SidecarKeys {
    width: Option<u32>,
    height: Option<u32>,
    layout: Option<String>,
    readouts: Option<u64>,
    file: Option<String>,
}

/// Returns the facts in the sidecar beside `path`. If no sidecar exists, all facts are `None`.
pub(super) fn read_beside(path: &Path) -> Result<SidecarFacts> {
    find_sidecar(path)?.map_or(Ok(SidecarFacts::default()), |sidecar| read(&sidecar, path))
}

/// Returns the path of the sidecar beside a stream, or `None` if there is no sidecar.
///
/// # Errors
/// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the system cannot find out whether there is a sidecar.
/// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the sidecar is a symbolic link to a file in another folder, because the user did not name
///   that file. If the stream is a symbolic link, the folder of its target is also allowed.
pub fn find_sidecar(stream: &Path) -> Result<Option<PathBuf>> {
    let mut found = None;
    for path in candidates(stream) {
        let metadata = std::fs::metadata(&path).map_err(|e| Error::io(path.display(), e));
        if not_found_as_none(metadata)?.is_some_and(|metadata| metadata.is_file()) {
            found = Some(path);
            break;
        }
    }
    let Some(path) = found else { return Ok(None) };
    check_beside(&path, stream)?;
    Ok(Some(path))
}

/// Rejects a file that describes a stream if it is a symbolic link to another folder. The folder of the stream itself is
/// allowed, because a user may link a stream and the files beside it.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is such a link.
pub(super) fn check_beside(path: &Path, stream: &Path) -> Result<()> {
    let folder = |path: &Path| path.canonicalize().ok().and_then(|real| real.parent().map(Path::to_owned));
    match check_link(path.parent().unwrap_or(Path::new("")), path, Access::Read) {
        Err(e) if folder(path) != folder(stream) => Err(
            e.remedy(format_args!("copy the file there, or remove the link and set {}", stream_settings()))
        ),
        _ => Ok(()),
    }
}

/// Returns the possible paths of the sidecar of a stream. The most specific path is first.
///
/// `STEM.dat.json` comes before `STEM.json`. `convert` writes `STEM.dat.json`, because two streams with different
/// layouts may share a stem. The clean stream `STEM.clean.dat` shares `STEM.json` with `STEM.dat`.
fn candidates(path: &Path) -> Vec<PathBuf> {
    let mut paths = vec![sidecar_path(path), path.with_extension("json")];
    let stem = path.with_extension("");
    if stem.extension().is_some_and(|ending| ending == "clean") {
        paths.push(stem.with_extension("json"));
    }
    paths
}

fn read(path: &Path, stream: &Path) -> Result<SidecarFacts> {
    let text = read_bytes(path, "a sidecar", MAX_TEXT_BYTES)
        .map_err(|e| e.remedy(format_args!("set {} to ignore the sidecar", stream_settings())))?;
    let facts = parse(&path.display().to_string(), &text, stream)?;
    Ok(SidecarFacts { path: Some(path.to_path_buf()), ..facts })
}

/// Parses the text of the sidecar `name` of `stream`.
pub(super) fn parse(name: &str, text: &[u8], stream: &Path) -> Result<SidecarFacts> {
    let bad = |found: String| {
        error!(Config, "{name}"; found "{found}";
            expected "a JSON object with width, height, layout, readouts";
            remedy "set {} to ignore the sidecar", stream_settings())
    };
    let keys: SidecarKeys = serde_json::from_slice(&utf8_bytes(text)).map_err(|e| bad(e.to_string()))?;
    let geometry = match (keys.width, keys.height) {
        (Some(w), Some(h)) => {
            Some(Geometry::new(w, h).map_err(|_| bad(format!("a camera of {w}x{h} pixels")))?)
        }
        (None, None) => None,
        _ => return Err(bad("only one of width and height".into())),
    };
    if keys.layout.as_deref() == Some(EVENTS_LAYOUT) {
        bail!(Input, "{}", stream.display(); found "a list of events, as stated in the sidecar";
            expected "a stream of frames"; remedy "select the stream from which the list was made");
    }
    let layout = match keys.layout {
        Some(name) => Some(Layout::parse(&name).map_err(|_| bad(format!("layout '{name}'")))?),
        None => None,
    };
    // The sidecar of `STEM.dat` is `STEM.json`, and it may also be found for `STEM.npy`. The two streams may be from
    // one camera, but have different layouts. Therefore only the geometry is used.
    let described = keys.file.as_deref().map_or(stream, Path::new);
    if described.extension() != stream.extension() {
        return Ok(SidecarFacts { geometry, ..SidecarFacts::default() });
    }
    Ok(SidecarFacts { geometry, layout, readouts: keys.readouts, path: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::ErrorKind;

    #[test]
    fn unknown_keys_are_left_alone_and_wrong_ones_refused() {
        let facts =
            parse("s", br#"{"width":8,"height":2,"layout":"dat-top","x":[{}]}"#, Path::new("s.dat")).unwrap();
        assert_eq!(facts.geometry, Geometry::new(8, 2).ok());
        assert_eq!(facts.layout, Some(Layout::DatTop));
        assert_eq!(facts.readouts, None);
        for wrong in [
            &br#"{"width":"8","height":2}"#[..],
            br#"{"width":8}"#,
            br#"{"width":0,"height":2}"#,
            br#"{"layout":"avi"}"#,
            br#"{"readouts":-1}"#,
            b"{",
            b"",
        ] {
            assert_eq!(parse("s", wrong, Path::new("s.dat")).unwrap_err().kind(), ErrorKind::Config);
        }
    }

    #[test]
    fn a_sidecar_of_another_extension_tells_the_geometry_only() {
        let text = br#"{"width":8,"height":2,"layout":"dat","readouts":3,"file":"run.dat"}"#;
        let facts = parse("s", text, Path::new("a/run.npy")).unwrap();
        assert_eq!(facts, SidecarFacts { geometry: Geometry::new(8, 2).ok(), ..SidecarFacts::default() });
        let moved = parse("s", text, Path::new("b/moved.dat")).unwrap();
        assert_eq!((moved.layout, moved.readouts), (Some(Layout::Dat), Some(3)));
    }

    #[test]
    fn the_clean_twin_shares_the_sidecar() {
        let paths = candidates(Path::new("a/run.clean.dat"));
        let expected = ["a/run.clean.dat.json", "a/run.clean.json", "a/run.json"];
        assert_eq!(paths, expected.map(PathBuf::from));
    }

    #[cfg(unix)]
    #[test]
    fn a_sidecar_is_read_through_a_link_only_where_its_stream_lies() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        for folder in ["data", "links", "other"] {
            std::fs::create_dir(at(folder)).unwrap();
        }
        std::fs::write(at("data/c.dat"), [0; 8]).unwrap();
        std::fs::write(at("data/c.json"), r#"{"width":8,"height":2}"#).unwrap();
        symlink(at("data/c.dat"), at("links/c.dat")).unwrap();
        symlink(at("data/c.json"), at("links/c.json")).unwrap();
        assert_eq!(read_beside(&at("links/c.dat")).unwrap().geometry, Geometry::new(8, 2).ok());
        std::fs::write(at("other/c.dat"), [0; 8]).unwrap();
        symlink(at("data/c.json"), at("other/c.json")).unwrap();
        assert_eq!(read_beside(&at("other/c.dat")).unwrap_err().kind(), ErrorKind::Input);
        symlink(at("other/c.dat"), at("other/d.dat")).unwrap();
        std::fs::write(at("other/e.json"), r#"{"width":8,"height":2}"#).unwrap();
        symlink("e.json", at("other/d.json")).unwrap();
        assert_eq!(read_beside(&at("other/d.dat")).unwrap().geometry, Geometry::new(8, 2).ok());
    }
}
