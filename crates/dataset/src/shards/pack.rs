//! Writes a shard as one tar file. The member names follow the convention of webdataset.
//!
//! The members that belong to one sequence are consecutive. The name of a member consists of the name of the sequence,
//! a dot, and the kind of the file. Members are sorted, and their times and owners are zero. The digest of the tar
//! therefore depends only on the sequences.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::journal::JournalEntry;
use super::tar_file::ShardTar;
use crate::SequenceStatus;
use crate::fingerprint::{self, Fingerprint};
use crate::manifest::sequence_path;
use crate::record::{self, SequenceRecord};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, InputFile, PlainName, read_bytes};
use spikelane_io::storage::{Digest, FileWriter};

/// Returns the name of a sequence's file in the tar. The part of the name before the first dot is the name of the
/// sequence.
pub(super) fn member_name(id: &PlainName, path: &InnerPath) -> String {
    let what = match path.as_str() {
        record::FILE_NAME => "json".to_owned(),
        "stream.dat" => "spk.dat".to_owned(),
        "stream.clean.dat" => "clean.dat".to_owned(),
        "reference.png" => "png".to_owned(),
        other => {
            let (stem, ending) = other.rsplit_once('.').unwrap_or((other, "bin"));
            format!("{}.{ending}", stem.replace(['/', '.'], "-"))
        }
    };
    format!("{id}.{what}")
}

/// A member of the tar, with its name, its size, and the source of its bytes.
struct Member {
    name: String,
    bytes: u64,
    source: MemberSource,
}

enum MemberSource {
    File(PathBuf),
    Text(String),
}

impl Member {
    /// Returns the member for the file at `path`. If `seeds` is true, the file is JSON, and integers of more than 63
    /// bits are converted to text.
    fn from_file(name: String, path: PathBuf, seeds: bool) -> Result<Self> {
        if seeds {
            let text = read_bytes(&path, "a record or sidecar", record::MAX_RECORD_BYTES)?;
            let read = serde_json::from_slice(&text);
            let mut value: Value =
                read.map_err(|e| Error::new(ErrorKind::Corrupt, path.display()).found(e))?;
            if integers_to_text(&mut value) {
                let text = format!("{value:#}");
                return Ok(Self { name, bytes: text.len() as u64, source: MemberSource::Text(text) });
            }
        }
        let bytes = InputFile::open(&path)?.len();
        Ok(Self { name, bytes, source: MemberSource::File(path) })
    }
}

/// Returns whether a file of a sequence is a JSON file that contains seeds.
fn holds_seeds(path: &str) -> bool {
    matches!(path, record::FILE_NAME | "stream.json")
}

/// Converts integers of more than 63 bits to text. Returns whether `value` contained such integers.
///
/// Programs that read packed shards load JSON into Arrow tables, and Arrow tables do not accept integers of more than
/// 63 bits.
fn integers_to_text(value: &mut Value) -> bool {
    match value {
        Value::Number(n) if n.is_u64() && !n.is_i64() => {
            *value = n.to_string().into();
            true
        }
        Value::Array(all) => all.iter_mut().fold(false, |any, v| integers_to_text(v) | any),
        Value::Object(all) => all.values_mut().fold(false, |any, v| integers_to_text(v) | any),
        _ => false,
    }
}

/// Reads the bytes of a member from a file.
struct MemberReader {
    file: InputFile,
    position: u64,
}

impl Read for MemberReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let left = self.file.len() - self.position;
        let len = usize::try_from(left).map_or(bytes.len(), |left| left.min(bytes.len()));
        self.file.read_at(self.position, &mut bytes[..len]).map_err(io::Error::other)?;
        self.position += len as u64;
        Ok(len)
    }
}

/// Writes the finished sequences in the shard's folder as one tar file at `path`. If `stop` returns an error, the
/// function ends immediately.
pub(super) fn write_tar(
    path: &Path,
    folder: &Path,
    lines: &[JournalEntry],
    access: Access,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<ShardTar> {
    let members = list_members(folder, lines, access, stop)?;
    // The length is computed first, so that the disk space can be reserved before the first write.
    let length = {
        let mut counter = ByteCounter::default();
        build_tar(&mut counter, &members, &|m| Ok(Box::new(io::repeat(0).take(m.bytes))))
            .map_err(|e| Error::io(path.display(), e))?;
        counter.0
    };
    let writer = FileWriter::create(path, length, true)?;
    let mut out = DigestWriter { writer, digest: Digest::new(), failed: None, stop };
    let built = build_tar(&mut out, &members, &|m| match &m.source {
        MemberSource::File(path) => {
            let file = InputFile::open(path).map_err(io::Error::other)?;
            Ok(Box::new(MemberReader { file, position: 0 }.take(m.bytes)))
        }
        MemberSource::Text(text) => Ok(Box::new(text.as_bytes())),
    });
    if let Some(error) = out.failed.take() {
        return Err(error);
    }
    built.map_err(|e| Error::io(path.display(), e))?;
    let digest = out.digest.to_text();
    out.writer.finish()?;
    let Fingerprint { bytes, mtime_ns: time_ns } = fingerprint::file_fingerprint(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let file = PlainName::parse(ErrorKind::Input, path.display(), &name)?;
    Ok(ShardTar { file, bytes, mtime_ns: time_ns, digest })
}

fn list_members(
    shard: &Path,
    lines: &[JournalEntry],
    access: Access,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<Member>> {
    let mut all = Vec::new();
    let mut done: Vec<_> = lines.iter().filter(|l| l.entry.status == SequenceStatus::Done).collect();
    done.sort_by(|a, b| a.entry.id.cmp(&b.entry.id));
    for line in done {
        let id = &line.entry.id;
        let folder = sequence_path(id).resolve_in(shard, access)?;
        let digest = line.entry.digest.as_deref().unwrap_or_default();
        let record = SequenceRecord::verify(&folder, digest, access, stop)?;
        let mut members = Vec::new();
        for file in record.files.iter().map(|f| f.path.clone()).chain([record::FILE_NAME.into()]) {
            let path = file.resolve_in(&folder, access)?;
            members.push(Member::from_file(member_name(id, &file), path, holds_seeds(file.as_str()))?);
        }
        let split = line.entry.split.name().to_owned();
        let name = format!("{id}.split.txt");
        members.push(Member { name, bytes: split.len() as u64, source: MemberSource::Text(split) });
        members.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(pair) = members.windows(2).find(|pair| pair[0].name == pair[1].name) {
            return Err(Error::new(ErrorKind::Config, folder.display())
                .found(format_args!("two files with the name {} in the archive", pair[0].name))
                .expected("different names"));
        }
        all.append(&mut members);
    }
    Ok(all)
}

fn build_tar<'a>(
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
struct ByteCounter(u64);

impl Write for ByteCounter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes bytes to the file and adds the bytes to the digest.
struct DigestWriter<'a> {
    writer: FileWriter,
    digest: Digest,
    failed: Option<Error>,
    stop: &'a mut dyn FnMut() -> Result<()>,
}

impl Write for DigestWriter<'_> {
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
        assert!(integers_to_text(&mut value));
        let expected = serde_json::json!({"a": ["18446744073709551615", 1, -3, 2.5], "b": {"c": "9223372036854775808", "d": i64::MAX}});
        assert_eq!(value, expected);
        assert!(!integers_to_text(&mut value), "nothing is left to change");
    }

    #[test]
    fn all_before_the_first_dot_is_the_sequence() {
        for (path, name) in [
            ("record.json", "scene-0001.json"),
            ("stream.dat", "scene-0001.spk.dat"),
            ("stream.clean.dat", "scene-0001.clean.dat"),
            ("stream.json", "scene-0001.stream.json"),
            ("reference.png", "scene-0001.png"),
            ("gt.png", "scene-0001.gt.png"),
            ("images/000022.png", "scene-0001.images-000022.png"),
            ("labels/000012.depth.npy", "scene-0001.labels-000012-depth.npy"),
            ("labels/000012.backward.flo", "scene-0001.labels-000012-backward.flo"),
        ] {
            let id = PlainName::parse(ErrorKind::Input, "id", "scene-0001").unwrap();
            assert_eq!(member_name(&id, &InnerPath::from(path)), name);
        }
    }
}
