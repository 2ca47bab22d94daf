//! What computes: two programs may differ in a vector's last bit, and the same one on two machines, too.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Digest of the files whose code computes, and of the instructions by which some of it chooses its way.
///
/// The bytes of a program change with every line of its source that matters, which no number that somebody has to raise does.
pub(super) fn digest() -> Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(env!("CARGO_PKG_VERSION").as_bytes());
    hasher.update(&instructions().map(u8::from));
    for path in files()? {
        let unread = |e| {
            Error::io(path.display(), e)
                .expected("the file of the running program, by which its simulations are known")
                .remedy("start the program again, or keep no simulations")
        };
        hasher.update_reader(File::open(&path).map_err(unread)?).map_err(unread)?;
    }
    Ok(hasher.finalize())
}

/// Instructions that Fourier transforms and a system's logarithm have ways of their own for.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fn instructions() -> [bool; 5] {
    [
        is_x86_feature_detected!("sse4.1"),
        is_x86_feature_detected!("avx"),
        is_x86_feature_detected!("fma"),
        is_x86_feature_detected!("avx2"),
        is_x86_feature_detected!("avx512f"),
    ]
}

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
fn instructions() -> [bool; 0] {
    []
}

/// The files: those of the program, of the shared library that this code is in, and of the system's mathematics.
fn files() -> Result<Vec<PathBuf>> {
    // Stays the running one when another is built in its place.
    let own = Path::new("/proc/self/exe");
    let Ok(maps) = fs::read_to_string("/proc/self/maps") else {
        let path = std::env::current_exe().map_err(|e| {
            Error::io("the running program", e)
                .expected("its file, by which its simulations are known")
                .remedy("keep no simulations on this system")
        })?;
        return Ok(vec![path]);
    };
    let program = fs::read_link(own).unwrap_or_default();
    let mut all = of_maps(&maps, digest as fn() -> Result<blake3::Hash> as usize);
    all.retain(|path| *path != program);
    all.insert(0, own.to_owned());
    Ok(all)
}

/// The mapped files that hold the code at an address, or the system's mathematics.
fn of_maps(maps: &str, address: usize) -> Vec<PathBuf> {
    let file = |line: &str| -> Option<PathBuf> {
        let (range, rest) = line.split_once(' ')?;
        let (from, to) = range.split_once('-')?;
        let [from, to] = [from, to].map(|end| usize::from_str_radix(end, 16).ok());
        let path = &rest[rest.find('/')?..];
        let name = path.rsplit('/').next()?;
        let mathematics = ["libm.", "libm-", "libc.", "libc-", "ld-musl"].iter().any(|s| name.starts_with(s));
        let code = rest.get(2..3)? == "x";
        (code && (mathematics || (from?..to?).contains(&address))).then(|| path.into())
    };
    maps.lines().filter_map(file).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_known_by_its_own_code_and_its_mathematics() {
        let maps = "\
            55d0-55e0 r-xp 00000000 fd:00 7   /usr/bin/python3\n\
            7000-7100 r--p 00000000 fd:00 8   /lib/libm.so.6\n\
            7100-7200 r-xp 00001000 fd:00 8   /lib/libm.so.6\n\
            8000-8100 r-xp 00000000 fd:00 9   /lib/libmagic.so\n\
            9000-9100 r-xp 00000000 fd:00 10   /my lib/native.so (deleted)\n\
            9200-9300 rw-p 00000000 00:00 0\n\
            a000-a100 r-xp 00000000 00:00 0   [vdso]\n";
        let found = |address| of_maps(maps, address);
        assert_eq!(found(0x9080), [Path::new("/lib/libm.so.6"), Path::new("/my lib/native.so (deleted)")]);
        assert_eq!(found(0x55d0), [Path::new("/usr/bin/python3"), Path::new("/lib/libm.so.6")]);
        assert_eq!(found(0x55e0), [Path::new("/lib/libm.so.6")]);
    }

    #[test]
    fn it_stays_the_same_while_it_runs() {
        assert_eq!(digest().unwrap(), digest().unwrap());
        assert!(!files().unwrap().is_empty());
    }
}
