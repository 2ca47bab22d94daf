//! The properties of a finished tar file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::fingerprint::{self, Fingerprint};
use crate::record::intact_or_none;
use spikelane::error::Result;
use spikelane::unstable::inputs::{PlainName, deserialize_digest};

/// A finished tar file of a shard.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct ShardTar {
    /// Name of the file. The file is beside the folder of the shard.
    pub(crate) file: PlainName,
    pub(crate) bytes: u64,
    /// Modification time in nanoseconds since the start of 1970.
    pub(crate) mtime_ns: i64,
    #[serde(deserialize_with = "deserialize_digest")]
    pub(crate) digest: String,
}

impl ShardTar {
    /// Returns whether the file at `path` is unchanged. If `verify` is true, the digest of the file is compared with
    /// the recorded digest. Otherwise the size and the modification time are compared.
    ///
    /// # Errors
    /// The errors of `stop`.
    pub(crate) fn is_intact(
        &self,
        path: &Path,
        verify: bool,
        stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<bool> {
        let Ok(current) = fingerprint::file_fingerprint(path) else { return Ok(false) };
        if !verify {
            return Ok(current == Fingerprint { bytes: self.bytes, mtime_ns: self.mtime_ns });
        }
        stop()?;
        if current.bytes != self.bytes {
            return Ok(false);
        }
        Ok(intact_or_none(fingerprint::file_digest(path, stop))?.is_some_and(|digest| digest == self.digest))
    }
}
