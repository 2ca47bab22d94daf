//! The list of the inputs of a plan. The list is sorted and written once. Each shard reads a slice of the list.

use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::discover;
use crate::fingerprint::{self, Fingerprint};
use crate::hidden_file::HiddenFile;
use crate::{DatasetOptions, InputContent};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::draws::RandomStream;
use spikelane::unstable::inputs::{
    Access, InnerPath, InputFile, PARTIAL_ENDING, PlainName, deserialize_digest, zeroed_vec,
};
use spikelane_io::storage::{Digest, folders, sync};

/// File name of the list in the plan's folder.
const FILE_NAME: &str = "inputs.jsonl";

/// The slice of the list that one shard reads.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct ListSlice {
    pub(super) offset: u64,
    pub(super) bytes: u64,
    #[serde(deserialize_with = "deserialize_digest")]
    pub(super) digest: String,
}

/// An input at the time when the plan was made. It is stored as one line of the list.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct PlannedInput {
    pub(super) id: PlainName,
    pub(super) path: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) frames: Option<u64>,
    pub(super) bytes: u64,
    pub(super) mtime_ns: i64,
}

/// Maximum size in bytes of the slice of one shard.
const MAX_SLICE_BYTES: u64 = 1 << 30;

/// Checks that the slices of the list are contiguous, and that the number of slices equals the number of shards.
pub(super) fn check_slices(pieces: &[ListSlice], shards: u64) -> Result<()> {
    let wrong = |found: &dyn std::fmt::Display| {
        Err(Error::new(ErrorKind::Config, "pieces")
            .found(found)
            .expected("one part of the list for each shard"))
    };
    if pieces.len() as u64 != shards {
        return wrong(&format_args!("{} for {}", Count(pieces.len(), "part"), Count(shards, "shard")));
    }
    let mut end = 0u64;
    for (number, piece) in pieces.iter().enumerate() {
        if piece.offset != end || piece.bytes > MAX_SLICE_BYTES {
            return wrong(&format_args!(
                "{} from {} on for shard {number}",
                Count(piece.bytes, "byte"),
                piece.offset,
            ));
        }
        // The sum cannot overflow, because each slice has at most 2^30 bytes and all slice descriptions are in memory.
        end += piece.bytes;
    }
    Ok(())
}

/// Reads the inputs of shard `number` from the list in `folder`. The shard has `sequences` inputs.
pub(super) fn read_inputs(
    folder: &Path,
    pieces: &[ListSlice],
    number: u64,
    sequences: u64,
    access: Access,
) -> Result<Vec<PlannedInput>> {
    let path = InnerPath::from(FILE_NAME).resolve_in(folder, access)?;
    let bad = |found: &dyn std::fmt::Display| {
        Error::new(ErrorKind::Corrupt, path.display())
            .found(found)
            .expected("the list that was written with the plan")
            .remedy("copy the list again, or plan again")
    };
    let piece = usize::try_from(number).ok().and_then(|n| pieces.get(n));
    let piece = piece.ok_or_else(|| bad(&format_args!("no part for shard {number}")))?;
    let file = InputFile::open(&path)?;
    let end = piece.offset.checked_add(piece.bytes).filter(|&end| end <= file.len());
    let len = end.and_then(|_| usize::try_from(piece.bytes).ok());
    let len = len.ok_or_else(|| bad(&Count(file.len(), "byte")))?;
    let mut text = zeroed_vec(path.display(), len)?;
    file.read_at(piece.offset, &mut text)?;
    if Digest::hash_bytes(&text) != piece.digest {
        return Err(bad(&format_args!("another digest in the part of shard {number}")));
    }
    let mut all = Vec::new();
    for line in text.split(|&b| b == b'\n').filter(|l| !l.is_empty()) {
        all.push(serde_json::from_slice(line).map_err(|e| bad(&e))?);
    }
    if all.len() as u64 != sequences {
        return Err(bad(&format_args!("{} in the part of shard {number}", Count(all.len(), "input"))));
    }
    Ok(all)
}

/// Writes the sorted list of inputs. Returns the number of inputs and the slice of each shard.
pub(super) fn write_list(
    options: &DatasetOptions,
    inputs: &InputContent,
    per_shard: u64,
) -> Result<(u64, Vec<ListSlice>)> {
    let path = options.output.join(FILE_NAME);
    let hidden = options.output.join(format!(".{FILE_NAME}.{}{PARTIAL_ENDING}", std::process::id()));
    let io = |e| Error::io(path.display(), e);
    let _draft = HiddenFile(&hidden);
    let mut file = BufWriter::new(folders::create(&hidden)?);
    let mut pieces: Vec<ListSlice> = Vec::new();
    let (mut count, mut at) = (0u64, 0u64);
    let mut digest = Digest::new();
    let mut names = Vec::new();
    discover::for_each_input(options, inputs, &mut |found| {
        let path = discover::input_path(inputs, &found.path, options.access())?;
        let Fingerprint { bytes, mtime_ns: time_ns } =
            fingerprint::input_fingerprint(&path, options.follow_links)?;
        names.push(RandomStream::from_name(found.id.as_str()).id());
        // The path is converted to text, because the manifest and the record also store the path as text.
        let path = PathBuf::from(found.path.to_string_lossy().into_owned());
        let line = PlannedInput { id: found.id, path, frames: found.frames, bytes, mtime_ns: time_ns };
        let mut line =
            serde_json::to_vec(&line).map_err(|e| Error::new(ErrorKind::Input, "path").found(e))?;
        line.push(b'\n');
        if count.is_multiple_of(per_shard) {
            finish_slice(&mut pieces, &mut digest);
            pieces.push(ListSlice { offset: at, bytes: 0, digest: String::new() });
        }
        digest.update(&line);
        if let Some(piece) = pieces.last_mut() {
            piece.bytes += line.len() as u64;
            if piece.bytes > MAX_SLICE_BYTES {
                return Err(Error::new(ErrorKind::Usage, Setting("sequences_per_shard"))
                    .found(format_args!("more than {MAX_SLICE_BYTES} bytes of names in one shard"))
                    .expected("fewer sequences per shard"));
            }
        }
        at += line.len() as u64;
        count += 1;
        file.write_all(&line).map_err(io)
    })?;
    finish_slice(&mut pieces, &mut digest);
    let file = file.into_inner().map_err(|e| io(e.into_error()))?;
    sync::sync_file(&file, &hidden)?;
    names.sort_unstable();
    if names.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(Error::new(ErrorKind::Input, inputs.folder.display())
            .found("two inputs whose sequences have the same name")
            .expected("paths with different hashes")
            .remedy("rename one of the inputs"));
    }
    sync::rename(&hidden, &path)?;
    sync::sync_folder(&options.output)?;
    Ok((count, pieces))
}

fn finish_slice(pieces: &mut [ListSlice], digest: &mut Digest) {
    if let Some(piece) = pieces.last_mut() {
        piece.digest = std::mem::take(digest).to_text();
    }
}
