//! Writes a shard as one tar file. The member names follow the convention of webdataset, and `pack_schema` defines the
//! members.
//!
//! The members that belong to one sequence are consecutive. The name of a member consists of the name of the sequence,
//! a dot, and the kind of the file. Members are sorted, and their times and owners are zero. The digest of the tar
//! therefore depends only on the sequences.

use std::collections::BTreeSet;
use std::io::{self, Cursor, Read, Write};
use std::path::{Path, PathBuf};

use super::journal::JournalEntry;
use super::tar_file::ShardTar;
use crate::fingerprint::{self, Fingerprint};
use crate::manifest::sequence_path;
use crate::pack_schema::{self, SampleDescription};
use crate::record;
use crate::{SequenceFiles, SequenceRecord, SequenceStatus};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath, InputFile, PlainName};
use spikelane_io::storage::{Digest, FileWriter};

/// A member of the tar, with its name and the sources of its bytes.
struct Member {
    name: String,
    pieces: Vec<Piece>,
}

/// A source of bytes.
enum Piece {
    File { path: PathBuf, bytes: u64 },
    Bytes(Vec<u8>),
}

impl Piece {
    fn len(&self) -> u64 {
        match self {
            Self::File { bytes, .. } => *bytes,
            Self::Bytes(bytes) => bytes.len() as u64,
        }
    }

    fn open(&self) -> io::Result<Box<dyn Read + '_>> {
        match self {
            Self::File { path, bytes } => {
                let file = InputFile::open(path).map_err(io::Error::other)?;
                if file.len() != *bytes {
                    let text =
                        format!("{}: {}, not {bytes} as recorded", path.display(), Count(file.len(), "byte"));
                    return Err(io::Error::other(text));
                }
                Ok(Box::new(file.into_reader()))
            }
            Self::Bytes(bytes) => Ok(Box::new(Cursor::new(bytes))),
        }
    }
}

impl Member {
    fn from_bytes(name: &InnerPath, bytes: Vec<u8>) -> Self {
        Self { name: name.to_string(), pieces: vec![Piece::Bytes(bytes)] }
    }

    fn len(&self) -> u64 {
        self.pieces.iter().map(Piece::len).sum()
    }
}

/// Reads pieces one after the other. Only one file is open.
struct PieceReader<'a> {
    rest: std::slice::Iter<'a, Piece>,
    open: Option<Box<dyn Read + 'a>>,
}

impl Read for PieceReader<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(open) = &mut self.open {
                let count = open.read(bytes)?;
                if count > 0 || bytes.is_empty() {
                    return Ok(count);
                }
            }
            let Some(next) = self.rest.next() else { return Ok(0) };
            self.open = Some(next.open()?);
        }
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
        build_tar(&mut counter, &members, &|m| Box::new(io::repeat(0).take(m.len())))
            .map_err(|e| Error::io(path.display(), e))?;
        counter.0
    };
    let writer = FileWriter::create(path, length, true)?;
    let mut out = DigestWriter { writer, digest: Digest::new(), failed: None, stop };
    let built =
        build_tar(&mut out, &members, &|m| Box::new(PieceReader { rest: m.pieces.iter(), open: None }));
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
        let mut members = sequence_members(line, &folder, &record, access)?;
        members.sort_by(|a, b| a.name.cmp(&b.name));
        all.append(&mut members);
    }
    Ok(all)
}

/// Returns the members of one sequence.
fn sequence_members(
    line: &JournalEntry,
    folder: &Path,
    record: &SequenceRecord,
    access: Access,
) -> Result<Vec<Member>> {
    let id: &PlainName = &line.entry.id;
    let files = SequenceFiles::in_folder(folder.to_owned(), access);
    let sidecar = files.sidecar()?;
    let description = serde_json::to_vec_pretty(&SampleDescription::new(&line.entry, record, sidecar)?)
        .map_err(|e| Error::new(ErrorKind::Config, folder.display()).found(e))?;
    let name = |ending| pack_schema::member_name(id, ending);
    let mut members = vec![
        Member::from_bytes(&name(pack_schema::DESCRIPTION), description),
        Member::from_bytes(&name(pack_schema::SPLIT), line.entry.split.name().into()),
    ];
    let wrong = |found: String| {
        Error::new(ErrorKind::Corrupt, folder.display())
            .found(found)
            .expected("the files of a complete sequence")
            .remedy("remove the folder and run the shard again")
    };
    let (mut inner, mut paths) = (Vec::new(), BTreeSet::new());
    let record_path = InnerPath::from(record::FILE_NAME);
    let record_file = files.open(&record_path)?;
    let listed = record.files.iter().map(|file| (&file.path, file.bytes));
    for (path, bytes) in listed.chain([(&record_path, record_file.len())]) {
        if !paths.insert(path.as_str()) {
            return Err(wrong(format!("{path} twice in the record")));
        }
        let file = Piece::File { path: path.resolve_in(folder, access)?, bytes };
        match pack_schema::file_member(path) {
            Some(ending) => members.push(Member { name: name(ending).to_string(), pieces: vec![file] }),
            None => add_inner_member(&mut inner, path, file)
                .map_err(|e| Error::io(folder.join(path.as_str()).display(), e))?,
        }
    }
    if let Some((missing, _)) = pack_schema::FILE_MEMBERS.iter().find(|(file, _)| !paths.contains(file)) {
        return Err(wrong(format!("no {missing} in the record")));
    }
    // Two empty blocks end a tar.
    inner.push(Piece::Bytes(vec![0; 2 * TAR_BLOCK_BYTES as usize]));
    members.push(Member { name: name(pack_schema::INNER_TAR).to_string(), pieces: inner });
    Ok(members)
}

/// Adds a file to the pieces of an inner tar: the header, the file and the padding.
fn add_inner_member(inner: &mut Vec<Piece>, path: &InnerPath, file: Piece) -> io::Result<()> {
    let mut header = header(file.len());
    header.set_path(path.as_str())?;
    header.set_cksum();
    let padding = file.len().next_multiple_of(TAR_BLOCK_BYTES) - file.len();
    inner.extend([Piece::Bytes(header.as_bytes().to_vec()), file, Piece::Bytes(vec![0; padding as usize])]);
    Ok(())
}

/// Size of the blocks of a tar in bytes.
const TAR_BLOCK_BYTES: u64 = 512;

/// Returns the header of a regular file without a name.
fn header(bytes: u64) -> tar::Header {
    let mut header = tar::Header::new_ustar();
    header.set_entry_type(tar::EntryType::Regular);
    header.set_mode(0o644);
    header.set_size(bytes);
    header.set_mtime(0);
    header.set_uid(0);
    header.set_gid(0);
    header
}

fn build_tar<'a>(
    out: &mut dyn Write,
    members: &'a [Member],
    open: &dyn Fn(&'a Member) -> Box<dyn Read + 'a>,
) -> io::Result<()> {
    let mut tar = tar::Builder::new(out);
    for member in members {
        tar.append_data(&mut header(member.len()), &member.name, open(member))?;
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
