//! A shard as one tar, in webdataset's naming.
//!
//! The members of a sequence follow one another; their names are the sequence's, a dot, and what the file is. Members are
//! sorted, their times are zero and their owner is nobody, so that the tar's digest follows from the sequences.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::journal::Line;
use super::packed::Packed;
use crate::Status;
use crate::manifest::sequence_path;
use crate::record::{self, Record};
use crate::stamp::{self, Stamp};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, InputFile, PlainName, read_bytes};
use spikelane_io::storage::{Digest, Writer};

/// The name of a sequence's file in the tar: all before the first dot is the sequence.
pub(super) fn member(id: &PlainName, path: &InnerPath) -> String {
    let what = match path.as_str() {
        record::NAME => "json".to_owned(),
        "stream.dat" => "spk.dat".to_owned(),
        "stream.clean.dat" => "clean.dat".to_owned(),
        "clear.png" => "png".to_owned(),
        other => {
            let (stem, ending) = other.rsplit_once('.').unwrap_or((other, "bin"));
            format!("{}.{ending}", stem.replace(['/', '.'], "-"))
        }
    };
    format!("{id}.{what}")
}

/// A member: its name, and where its bytes are.
struct Member {
    name: String,
    bytes: u64,
    from: From,
}

enum From {
    File(PathBuf),
    Text(String),
}

impl Member {
    /// The file at `path`; of JSON with `seeds` what stands for it.
    fn of(name: String, path: PathBuf, seeds: bool) -> Result<Self> {
        if seeds {
            let text = read_bytes(&path, "a record or sidecar", record::MAX_BYTES)?;
            let read = serde_json::from_slice(&text);
            let mut value: Value = read.map_err(|e| Error::new(Kind::Corrupt, path.display()).found(e))?;
            if narrow(&mut value) {
                let text = format!("{value:#}");
                return Ok(Self { name, bytes: text.len() as u64, from: From::Text(text) });
            }
        }
        let bytes = InputFile::open(&path)?.len();
        Ok(Self { name, bytes, from: From::File(path) })
    }
}

/// Whether a file of a sequence is JSON that holds seeds.
fn with_seeds(path: &str) -> bool {
    matches!(path, record::NAME | "stream.json")
}

/// Makes integers beyond 63 bits texts, since Arrow has none and readers of packs put JSON into its tables. Says whether
/// there were any.
fn narrow(value: &mut Value) -> bool {
    match value {
        Value::Number(n) if n.is_u64() && !n.is_i64() => {
            *value = n.to_string().into();
            true
        }
        Value::Array(all) => all.iter_mut().fold(false, |any, v| narrow(v) | any),
        Value::Object(all) => all.values_mut().fold(false, |any, v| narrow(v) | any),
        _ => false,
    }
}

/// The bytes of a member that lies in a file.
struct Contents {
    file: InputFile,
    position: u64,
}

impl Read for Contents {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let left = self.file.len() - self.position;
        let len = usize::try_from(left).map_or(bytes.len(), |left| left.min(bytes.len()));
        self.file.read_at(self.position, &mut bytes[..len]).map_err(io::Error::other)?;
        self.position += len as u64;
        Ok(len)
    }
}

/// Writes the sequences in the shard's folder that are done as one tar at `path`; an error of `stop` ends it at once.
pub(super) fn write(
    path: &Path,
    folder: &Path,
    lines: &[Line],
    access: Access,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Packed> {
    let members = members(folder, lines, access, stop)?;
    // The length first, so that the disk is reserved at once.
    let length = {
        let mut counter = Counter::default();
        build(&mut counter, &members, &|m| Ok(Box::new(io::repeat(0).take(m.bytes))))
            .map_err(|e| Error::io(path.display(), e))?;
        counter.0
    };
    let writer = Writer::create(path, length, true)?;
    let mut out = Out { writer, digest: Digest::new(), failed: None, stop };
    let built = build(&mut out, &members, &|m| match &m.from {
        From::File(path) => {
            let file = InputFile::open(path).map_err(io::Error::other)?;
            Ok(Box::new(Contents { file, position: 0 }.take(m.bytes)))
        }
        From::Text(text) => Ok(Box::new(text.as_bytes())),
    });
    if let Some(error) = out.failed.take() {
        return Err(error);
    }
    built.map_err(|e| Error::io(path.display(), e))?;
    let digest = out.digest.text();
    out.writer.finish()?;
    let Stamp { bytes, time_ns } = stamp::at(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let file = PlainName::parse(Kind::Input, path.display(), &name)?;
    Ok(Packed { file, bytes, time_ns, digest })
}

fn members(
    shard: &Path,
    lines: &[Line],
    access: Access,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<Member>> {
    let mut all = Vec::new();
    let mut done: Vec<_> = lines.iter().filter(|l| l.entry.status == Status::Done).collect();
    done.sort_by(|a, b| a.entry.id.cmp(&b.entry.id));
    for line in done {
        let id = &line.entry.id;
        let folder = sequence_path(id).below(shard, access)?;
        let digest = line.entry.digest.as_deref().unwrap_or_default();
        let record = Record::verify_below(&folder, digest, access, stop)?;
        let mut own = Vec::new();
        for file in record.files.iter().map(|f| f.path.clone()).chain([record::NAME.into()]) {
            let path = file.below(&folder, access)?;
            own.push(Member::of(member(id, &file), path, with_seeds(file.as_str()))?);
        }
        let split = line.entry.split.name().to_owned();
        let name = format!("{id}.split.txt");
        own.push(Member { name, bytes: split.len() as u64, from: From::Text(split) });
        own.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(pair) = own.windows(2).find(|pair| pair[0].name == pair[1].name) {
            return Err(Error::new(Kind::Config, folder.display())
                .found(format_args!("two files that would both be {}", pair[0].name))
                .expected("names that differ in the pack"));
        }
        all.append(&mut own);
    }
    Ok(all)
}

fn build<'a>(
    out: &mut dyn Write,
    members: &'a [Member],
    open: &dyn Fn(&'a Member) -> io::Result<Box<dyn Read + 'a>>,
) -> io::Result<()> {
    let mut tar = tar::Builder::new(out);
    for member in members {
        let mut header = tar::Header::new_ustar();
        header.set_entry_type(tar::EntryType::Regular);
        header.set_mode(0o644);
        header.set_size(member.bytes);
        header.set_mtime(0);
        header.set_uid(0);
        header.set_gid(0);
        tar.append_data(&mut header, &member.name, open(member)?)?;
    }
    tar.finish()
}

#[derive(Default)]
struct Counter(u64);

impl Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Into the file, through the digest.
struct Out<'a> {
    writer: Writer,
    digest: Digest,
    failed: Option<Error>,
    stop: &'a mut dyn FnMut() -> Result<()>,
}

impl Write for Out<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.digest.update(bytes);
        match (self.stop)().and_then(|()| self.writer.write_all(bytes)) {
            Ok(()) => Ok(bytes.len()),
            Err(e) => {
                let text = e.to_string();
                self.failed = Some(e);
                Err(io::Error::other(text))
            }
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_beyond_arrow_become_texts_and_others_stay() {
        let mut value =
            serde_json::json!({"a": [u64::MAX, 1, -3, 2.5], "b": {"c": 1u64 << 63, "d": i64::MAX}});
        assert!(narrow(&mut value));
        let expected = serde_json::json!({"a": ["18446744073709551615", 1, -3, 2.5], "b": {"c": "9223372036854775808", "d": i64::MAX}});
        assert_eq!(value, expected);
        assert!(!narrow(&mut value), "nothing is left to change");
    }

    #[test]
    fn all_before_the_first_dot_is_the_sequence() {
        for (path, name) in [
            ("record.json", "scene-0001.json"),
            ("stream.dat", "scene-0001.spk.dat"),
            ("stream.clean.dat", "scene-0001.clean.dat"),
            ("stream.json", "scene-0001.stream.json"),
            ("clear.png", "scene-0001.png"),
            ("gt.png", "scene-0001.gt.png"),
            ("images/000022.png", "scene-0001.images-000022.png"),
            ("labels/000012.depth.npy", "scene-0001.labels-000012-depth.npy"),
            ("labels/000012.backward.flo", "scene-0001.labels-000012-backward.flo"),
        ] {
            let id = PlainName::parse(Kind::Input, "id", "scene-0001").unwrap();
            assert_eq!(member(&id, &InnerPath::from(path)), name);
        }
    }
}
