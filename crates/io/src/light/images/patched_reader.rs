//! A reader of a file in which some bytes are replaced.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use spikelane::error::Result;
use spikelane::unstable::inputs::{InputFile, InputReader};

/// A reader that replaces bytes. Decoders thereby read a file with another header.
pub(super) struct PatchedReader {
    file: InputReader<InputFile>,
    /// Offsets and new values of bytes, in the order of the offsets.
    patches: Vec<(u64, u8)>,
}

impl PatchedReader {
    /// Opens a file. `patches` must be sorted by the offset.
    pub(super) fn open(path: &Path, patches: Vec<(u64, u8)>) -> Result<Self> {
        Ok(Self { file: InputFile::open(path)?.into_reader(), patches })
    }
}

impl Read for PatchedReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let start = self.file.stream_position()?;
        let read = self.file.read(bytes)?;
        let first = self.patches.partition_point(|(offset, _)| *offset < start);
        for (offset, value) in &self.patches[first..] {
            match bytes[..read].get_mut((offset - start) as usize) {
                Some(byte) => *byte = *value,
                None => break,
            }
        }
        Ok(read)
    }
}

impl Seek for PatchedReader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_replaced_for_every_size_of_a_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, b"0123456789").unwrap();
        for size in 1..=10 {
            let mut reader = PatchedReader::open(&path, vec![(0, b'a'), (4, b'b'), (9, b'c')]).unwrap();
            let mut all: Vec<u8> = Vec::new();
            let mut part = vec![0; size];
            loop {
                let read = reader.read(&mut part).unwrap();
                if read == 0 {
                    break;
                }
                all.extend(&part[..read]);
            }
            assert_eq!(all, b"a123b5678c", "{size}");
        }
    }
}
