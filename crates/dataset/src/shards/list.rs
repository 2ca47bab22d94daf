//! The inputs of a plan: a sorted list that is written once, and of which each shard reads its part.

use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::from;
use crate::stamp::{self, Stamp};
use crate::{DatasetOptions, Inputs};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::draws::Stream;
use spikelane::unstable::inputs::{Access, InnerPath, InputFile, PlainName, zeroed};
use spikelane_io::storage::{Digest, steps, trees};

/// Its name in the folder of the plan.
const LIST: &str = "inputs.jsonl";

/// A shard's part of the list.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Piece {
    pub(super) offset: u64,
    pub(super) bytes: u64,
    pub(super) digest: String,
}

/// An input as it was when the plan was made: a line of the list.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Frozen {
    pub(super) id: PlainName,
    pub(super) path: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) frames: Option<u64>,
    pub(super) bytes: u64,
    pub(super) time_ns: i64,
}

/// The most that a shard's part of the list may hold, in bytes.
const MAX_PIECE_BYTES: u64 = 1 << 30;

/// Refuses parts that do not follow one another, or of which there is not one for each shard.
pub(super) fn check(pieces: &[Piece], shards: u64) -> Result<()> {
    let wrong = |found: &dyn std::fmt::Display| {
        Err(Error::new(Kind::Config, "pieces").found(found).expected("one part of the list for each shard"))
    };
    if pieces.len() as u64 != shards {
        return wrong(&format_args!("{} parts for {shards} shards", pieces.len()));
    }
    let mut end = 0u64;
    for (number, piece) in pieces.iter().enumerate() {
        if piece.offset != end || piece.bytes > MAX_PIECE_BYTES {
            return wrong(&format_args!("{} bytes from {} on for shard {number}", piece.bytes, piece.offset));
        }
        // Below 2^30 times the number of parts, which are in memory.
        end += piece.bytes;
    }
    Ok(())
}

/// The `sequences` inputs of shard `number`, from the list in `folder`.
pub(super) fn frozen(
    folder: &Path,
    pieces: &[Piece],
    number: u64,
    sequences: u64,
    access: Access,
) -> Result<Vec<Frozen>> {
    let path = InnerPath::from(LIST).below(folder, access)?;
    let bad = |found: &dyn std::fmt::Display| {
        Error::new(Kind::Corrupt, path.display())
            .found(found)
            .expected("the list that was written with the plan")
            .remedy("copy it again, or plan anew")
    };
    let piece = usize::try_from(number).ok().and_then(|n| pieces.get(n));
    let piece = piece.ok_or_else(|| bad(&format_args!("no part for shard {number}")))?;
    let file = InputFile::open(&path)?;
    let end = piece.offset.checked_add(piece.bytes).filter(|&end| end <= file.len());
    let len = end.and_then(|_| usize::try_from(piece.bytes).ok());
    let len = len.ok_or_else(|| bad(&format_args!("{} bytes", file.len())))?;
    let mut text = zeroed(path.display(), len)?;
    file.read_at(piece.offset, &mut text)?;
    if Digest::of(&text) != piece.digest {
        return Err(bad(&format_args!("another digest in the part of shard {number}")));
    }
    let mut all = Vec::new();
    for line in text.split(|&b| b == b'\n').filter(|l| !l.is_empty()) {
        all.push(serde_json::from_slice(line).map_err(|e| bad(&e))?);
    }
    if all.len() as u64 != sequences {
        return Err(bad(&format_args!("{} inputs in the part of shard {number}", all.len())));
    }
    Ok(all)
}

/// Writes the list of inputs, sorted, and says how many there are and where each shard's part lies.
pub(super) fn freeze(options: &DatasetOptions, inputs: &Inputs, per_shard: u64) -> Result<(u64, Vec<Piece>)> {
    let path = options.output.join(LIST);
    let hidden = options.output.join(format!(".{LIST}.{}.partial", std::process::id()));
    let io = |e| Error::io(path.display(), e);
    let _draft = Draft(&hidden);
    let mut file = BufWriter::new(trees::create(&hidden)?);
    let mut pieces: Vec<Piece> = Vec::new();
    let (mut count, mut at) = (0u64, 0u64);
    let mut digest = Digest::new();
    let mut names = Vec::new();
    from::each(inputs, &options.output, &mut |found| {
        let Stamp { bytes, time_ns } = stamp::of(&from::located(inputs, &found.path)?)?;
        names.push(Stream::named(found.id.as_str()).id());
        // As text the path is what the manifest and the record will hold.
        let path = PathBuf::from(found.path.to_string_lossy().into_owned());
        let line = Frozen { id: found.id, path, frames: found.frames, bytes, time_ns };
        let mut line = serde_json::to_vec(&line).map_err(|e| Error::new(Kind::Input, "path").found(e))?;
        line.push(b'\n');
        if count.is_multiple_of(per_shard) {
            finish(&mut pieces, &mut digest);
            pieces.push(Piece { offset: at, bytes: 0, digest: String::new() });
        }
        digest.update(&line);
        if let Some(piece) = pieces.last_mut() {
            piece.bytes += line.len() as u64;
            if piece.bytes > MAX_PIECE_BYTES {
                return Err(Error::new(Kind::Usage, "--per-shard")
                    .found(format_args!("more than {MAX_PIECE_BYTES} bytes of names in one shard"))
                    .expected("fewer sequences of a shard"));
            }
        }
        at += line.len() as u64;
        count += 1;
        file.write_all(&line).map_err(io)
    })?;
    finish(&mut pieces, &mut digest);
    let file = file.into_inner().map_err(|e| io(e.into_error()))?;
    steps::sync_file(&file, &hidden)?;
    names.sort_unstable();
    if names.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(Error::new(Kind::Input, inputs.folder.display())
            .found("two inputs whose sequences would have one name")
            .expected("paths whose hashes differ")
            .remedy("rename one of them"));
    }
    steps::rename(&hidden, &path)?;
    steps::sync_folder(&options.output)?;
    Ok((count, pieces))
}

/// A hidden file that is gone in the end, under its own name or under none.
struct Draft<'a>(&'a Path);

impl Drop for Draft<'_> {
    fn drop(&mut self) {
        // Once renamed it is not there.
        let _ = std::fs::remove_file(self.0);
    }
}

fn finish(pieces: &mut [Piece], digest: &mut Digest) {
    if let Some(piece) = pieces.last_mut() {
        piece.digest = std::mem::take(digest).text();
    }
}
