//! What is known of a tar that is whole.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::dataset::stamp::{self, Stamp};
use crate::storage::Digest;

/// A tar that is whole.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Packed {
    /// Its name beside the shard's folder.
    pub(crate) file: String,
    pub(crate) bytes: u64,
    /// Time in nanoseconds since 1970.
    pub(crate) time_ns: i64,
    pub(crate) digest: String,
}

impl Packed {
    /// Whether the file at `path` is still it: by size and time, or by its digest.
    pub(crate) fn holds(&self, path: &Path, verify: bool) -> bool {
        let Ok(found) = stamp::at(path) else { return false };
        if verify {
            return found.bytes == self.bytes && Digest::of_file(path).is_ok_and(|d| d == self.digest);
        }
        found == Stamp { bytes: self.bytes, time_ns: self.time_ns }
    }
}
