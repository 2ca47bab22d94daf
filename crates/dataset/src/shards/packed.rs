//! What is known of a tar that is whole.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::record::if_intact;
use crate::stamp::{self, Stamp};
use spikelane::error::Result;
use spikelane::unstable::inputs::PlainName;

/// A tar that is whole.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Packed {
    /// Its name beside the shard's folder.
    pub(crate) file: PlainName,
    pub(crate) bytes: u64,
    /// Time in nanoseconds since 1970.
    pub(crate) time_ns: i64,
    pub(crate) digest: String,
}

impl Packed {
    /// Whether the file at `path` is still it: by size and time, or by its digest.
    ///
    /// # Errors
    /// Those of `stop`.
    pub(crate) fn holds(
        &self,
        path: &Path,
        verify: bool,
        stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<bool> {
        let Ok(found) = stamp::at(path) else { return Ok(false) };
        if !verify {
            return Ok(found == Stamp { bytes: self.bytes, time_ns: self.time_ns });
        }
        stop()?;
        if found.bytes != self.bytes {
            return Ok(false);
        }
        Ok(if_intact(stamp::digest_of_file(path, stop))?.is_some_and(|digest| digest == self.digest))
    }
}
