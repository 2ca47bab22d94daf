//! The inputs of a plan: a sorted list that is written once, and of which each shard reads its part.

use std::fs::File;
use std::io::{BufWriter, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::dataset::from;
use crate::dataset::stamp::{self, Stamp};
use crate::dataset::{DatasetOptions, Inputs};
use crate::draws::Stream;
use crate::error::{Error, Kind, Result};
use crate::storage::{Digest, steps};

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
    pub(super) id: String,
    pub(super) path: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) frames: Option<u64>,
    pub(super) bytes: u64,
    pub(super) time_ns: i64,
}

/// The inputs of shard `number`, from the list in `folder`.
pub(super) fn frozen(folder: &Path, pieces: &[Piece], number: u64) -> Result<Vec<Frozen>> {
    let path = folder.join(LIST);
    let bad = |found: &dyn std::fmt::Display| {
        Error::new(Kind::Corrupt, path.display())
            .found(found)
            .expected("the list that was written with the plan")
            .remedy("copy it again, or plan anew")
    };
    let piece = usize::try_from(number).ok().and_then(|n| pieces.get(n));
    let piece = piece.ok_or_else(|| bad(&format_args!("no part for shard {number}")))?;
    let mut file = File::open(&path).map_err(|e| Error::io(path.display(), e))?;
    let mut text = Vec::new();
    let read = file.seek(SeekFrom::Start(piece.offset));
    read.and_then(|_| file.take(piece.bytes).read_to_end(&mut text))
        .map_err(|e| Error::io(path.display(), e))?;
    if Digest::of(&text) != piece.digest {
        return Err(bad(&format_args!("another digest in the part of shard {number}")));
    }
    let lines = text.split(|&b| b == b'\n').filter(|l| !l.is_empty());
    lines.map(|line| serde_json::from_slice(line).map_err(|e| bad(&e))).collect()
}

/// Writes the list of inputs, sorted, and says how many there are and where each shard's part lies.
pub(super) fn freeze(options: &DatasetOptions, inputs: &Inputs, per_shard: u64) -> Result<(u64, Vec<Piece>)> {
    let path = options.output.join(LIST);
    let hidden = options.output.join(format!(".{LIST}.{}.partial", std::process::id()));
    let io = |e| Error::io(path.display(), e);
    let _draft = Draft(&hidden);
    let mut file = BufWriter::new(File::create(&hidden).map_err(io)?);
    let mut pieces: Vec<Piece> = Vec::new();
    let (mut count, mut at) = (0u64, 0u64);
    let mut digest = Digest::new();
    let mut names = Vec::new();
    from::each(inputs, &options.output, &mut |found| {
        let Stamp { bytes, time_ns } = stamp::of(&inputs.folder.join(&found.path))?;
        names.push(Stream::named(&found.id).id());
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
