//! The positions of the members of a tar, which is not unpacked.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::ops::Range;
use std::path::PathBuf;

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{InnerPath, InputFile};

/// Maximum number of members. A shard of half a million sequences has fewer.
const MAX_MEMBERS: usize = 4 << 20;

/// Maximum length in bytes of a name that is too long for the header of a member.
const MAX_LONG_NAME_BYTES: u64 = 4096;

/// An open tar, and the position of each member.
#[derive(Debug)]
pub(super) struct TarIndex {
    file: InputFile,
    members: BTreeMap<String, Range<u64>>,
}

impl TarIndex {
    /// Reads the headers of all members.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if a member is not a regular file with a plain name inside the tar, if two members have one
    /// name, or if the tar is truncated.
    pub(super) fn read(file: InputFile) -> Result<Self> {
        let subject = file.path().display().to_string();
        let wrong = |found: String| {
            Error::new(ErrorKind::Input, &subject)
                .found(found)
                .expected("regular files with different plain names, as in a shard that was packed")
                .remedy(format_args!("generate the shard again with {}", Setting("pack")))
        };
        let damaged = |e: std::io::Error| wrong(e.to_string());
        let mut archive = tar::Archive::new(file.reader());
        let mut members = BTreeMap::new();
        let mut long_name: Option<Vec<u8>> = None;
        // Raw entries are read, because the crate would read long names and extended headers of any size into memory.
        for entry in archive.entries_with_seek().map_err(damaged)?.raw(true) {
            let mut entry = entry.map_err(damaged)?;
            let (kind, start, size) = (entry.header().entry_type(), entry.raw_file_position(), entry.size());
            if kind.is_gnu_longname() && size <= MAX_LONG_NAME_BYTES {
                let mut name = Vec::new();
                entry.read_to_end(&mut name).map_err(damaged)?;
                name.truncate(name.iter().position(|&byte| byte == 0).unwrap_or(name.len()));
                long_name = Some(name);
                continue;
            }
            let name = long_name.take().unwrap_or_else(|| entry.path_bytes().into_owned());
            let name = String::from_utf8_lossy(&name);
            let name = InnerPath::parse(ErrorKind::Input, &subject, &name)?;
            if !kind.is_file() {
                return Err(wrong(format!("{name} of type {:?}", char::from(kind.as_byte()))));
            }
            let end = start.checked_add(size).filter(|&end| end <= file.len());
            let Some(end) = end else {
                return Err(wrong(format!("{name} of {}, which exceeds the file", Count(size, "byte"))));
            };
            if members.len() == MAX_MEMBERS {
                return Err(wrong(format!("more than {MAX_MEMBERS} members")));
            }
            if members.insert(name.to_string(), start..end).is_some() {
                return Err(wrong(format!("two members {name}")));
            }
        }
        Ok(Self { file, members })
    }

    /// Returns the names of all members in alphabetical order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.members.keys().map(String::as_str)
    }

    /// Opens the member `name`. Errors refer to it as `path`.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if no such member exists.
    pub(super) fn open(&self, name: &str, path: PathBuf) -> Result<InputFile> {
        match self.members.get(name) {
            Some(range) => self.file.part(range.clone(), path),
            None => Err(Error::io(path.display(), std::io::ErrorKind::NotFound.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tar::{Builder, EntryType, Header};

    /// Returns the index of a tar that `build` writes.
    fn index(build: impl FnOnce(&mut Builder<Vec<u8>>)) -> Result<TarIndex> {
        let mut tar = Builder::new(Vec::new());
        build(&mut tar);
        index_bytes(&tar.into_inner().unwrap())
    }

    fn index_bytes(bytes: &[u8]) -> Result<TarIndex> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("000000.tar");
        std::fs::write(&path, bytes).unwrap();
        TarIndex::read(InputFile::open(&path)?)
    }

    /// Returns a header with a name that is not checked.
    fn header(name: &str, kind: EntryType, size: u64) -> Header {
        let mut header = Header::new_ustar();
        header.as_mut_bytes()[..name.len()].copy_from_slice(name.as_bytes());
        header.set_entry_type(kind);
        header.set_size(size);
        header.set_cksum();
        header
    }

    fn add(tar: &mut Builder<Vec<u8>>, name: &str, bytes: &[u8]) {
        tar.append(&header(name, EntryType::Regular, bytes.len() as u64), bytes).unwrap();
    }

    #[test]
    fn members_are_read_in_place() {
        let long = format!("{}.json", "x".repeat(200));
        let tar = index(|tar| {
            add(tar, "a.json", b"one");
            let mut header = header("", EntryType::Regular, 5);
            tar.append_data(&mut header, &long, &b"three"[..]).unwrap();
            add(tar, "b.json", b"");
        })
        .unwrap();
        assert_eq!(tar.names().collect::<Vec<_>>(), ["a.json", "b.json", &long]);
        for (name, bytes) in [("a.json", &b"one"[..]), ("b.json", b""), (&long, b"three")] {
            assert_eq!(tar.open(name, name.into()).unwrap().read_all("a member", 5).unwrap(), bytes);
        }
        assert_eq!(tar.open("c.json", "c.json".into()).unwrap_err().kind(), ErrorKind::Io);
    }

    #[test]
    fn names_that_lead_elsewhere_and_links_are_refused() {
        for (name, kind) in [
            ("../a.json", EntryType::Regular),
            ("/etc/passwd", EntryType::Regular),
            ("a\\b", EntryType::Regular),
            ("a.json", EntryType::Symlink),
            ("a.json", EntryType::Link),
            ("a.json", EntryType::Fifo),
            ("a.json", EntryType::GNUSparse),
            ("a.json", EntryType::XHeader),
            ("a", EntryType::Directory),
        ] {
            let read = index(|tar| tar.append(&header(name, kind, 0), &b""[..]).unwrap());
            assert_eq!(read.unwrap_err().kind(), ErrorKind::Input, "{name} {kind:?}");
        }
    }

    #[test]
    fn two_members_of_one_name_are_refused() {
        let read = index(|tar| ["a.json", "a.json"].iter().for_each(|name| add(tar, name, b"x")));
        assert!(read.unwrap_err().to_string().contains("two members a.json"));
    }

    #[test]
    fn sizes_beyond_the_file_are_refused() {
        for (kind, size) in
            [(EntryType::Regular, 1 << 40), (EntryType::Regular, 2000), (EntryType::GNULongName, 1 << 40)]
        {
            let mut bytes = header("a.json", kind, size).as_bytes().to_vec();
            bytes.resize(2048, 0);
            assert_eq!(index_bytes(&bytes).unwrap_err().kind(), ErrorKind::Input, "{kind:?} {size}");
        }
    }
}
