//! A folder of vectors, a file each.

use std::fs;
use std::hash::{Hash as _, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use spikelane::error::{Error, Result};
use spikelane::unstable::kernels::Backend;
use spikelane_io::storage::{write_small, write_small_unsynced};

/// Programs that make backups leave a folder out that holds this (<https://bford.info/cachedir/>).
const TAG: &str = "CACHEDIR.TAG";
const TAGGED: &str = "Signature: 8a477f597d28d172789f06886806bc55
# Simulations that spikelane keeps for further diagnoses. Any file of this folder may be deleted: it is made again when it is needed.
";

/// Version of the numbers that simulations give. Raise it in each change of them:
/// `sensors::key::tests::changed_results_have_another_version` fails until it is raised.
pub(in crate::diagnose) const RESULTS_VERSION: u32 = 1;

/// Those of this version in a folder. A file appears whole, so that what was made before a diagnosis was stopped is kept, and several
/// processes may use one folder.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Kept(Arc<Folder>);

#[derive(Debug)]
struct Folder {
    path: PathBuf,
    found: AtomicUsize,
    made: AtomicUsize,
}

/// What a vector is known by.
pub(in crate::diagnose) type Key = blake3::Hash;

impl Kept {
    /// `folder` is made if it is not there.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(format!("{}-{RESULTS_VERSION}", env!("CARGO_PKG_VERSION")));
        let asked =
            |e: Error| e.remedy("choose another folder for simulations, or allow writing to this folder");
        fs::create_dir_all(&path)
            .map_err(|e| Error::io(path.display(), e).expected("a folder that can be created"))
            .map_err(asked)?;
        write_small(&path.join(TAG), TAGGED.as_bytes(), true).map_err(asked)?;
        Ok(Self(Arc::new(Folder { path, found: AtomicUsize::new(0), made: AtomicUsize::new(0) })))
    }

    /// How many simulations were found since it was opened.
    pub(crate) fn found(&self) -> usize {
        self.0.found.load(Ordering::Relaxed)
    }

    /// How many were made since it was opened, as they were not there.
    pub(crate) fn made(&self) -> usize {
        self.0.made.load(Ordering::Relaxed)
    }

    /// The key of what `hash` hashes, on this kind of machine: Fourier transforms and a system's logarithms have a last digit for each
    /// system and instruction set.
    pub(crate) fn key(&self, hash: impl FnOnce(&mut Keyed)) -> Key {
        let mut keyed = Keyed(blake3::Hasher::new());
        let sets = Backend::ALL.into_iter().filter(|b| b.is_available()).map(Backend::name);
        let machine = [std::env::consts::OS, std::env::consts::ARCH].into_iter().chain(sets);
        machine.for_each(|name| name.hash(&mut keyed));
        hash(&mut keyed);
        keyed.0.finalize()
    }

    /// The vector of `key`, or what `simulate` makes, which is kept.
    pub(crate) fn or(&self, key: Key, simulate: impl FnOnce() -> Result<Vec<f64>>) -> Result<Vec<f64>> {
        let path = self.0.path.join(key.to_hex().as_str());
        if let Some(values) = fs::read(&path).ok().and_then(|bytes| opened(&bytes, &key)) {
            self.0.found.fetch_add(1, Ordering::Relaxed);
            return Ok(values);
        }
        let values = simulate()?;
        self.0.made.fetch_add(1, Ordering::Relaxed);
        // A disk that became full is no reason to give up a diagnosis.
        let _ = write_small_unsynced(&path, &sealed(&values, &key));
        Ok(values)
    }
}

/// A hasher that can be given anything that hashes itself.
pub(in crate::diagnose) struct Keyed(blake3::Hasher);

impl Hasher for Keyed {
    fn write(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The first part of the digest; keys are the whole one.
    fn finish(&self) -> u64 {
        let [a, b, c, d, e, f, g, h, ..] = *self.0.finalize().as_bytes();
        u64::from_le_bytes([a, b, c, d, e, f, g, h])
    }
}

/// The file of a vector: its values and the digest of them under its key, so that another key's file is none.
fn sealed(values: &[f64], key: &Key) -> Vec<u8> {
    let mut bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let seal = blake3::keyed_hash(key.as_bytes(), &bytes);
    bytes.extend(seal.as_bytes());
    bytes
}

/// The values of a file that is whole.
fn opened(bytes: &[u8], key: &Key) -> Option<Vec<f64>> {
    let (values, seal) = bytes.split_last_chunk::<{ blake3::OUT_LEN }>()?;
    let (values, rest) = values.as_chunks::<8>();
    let whole = rest.is_empty() && blake3::keyed_hash(key.as_bytes(), values.as_flattened()) == *seal;
    whole.then(|| values.iter().map(|v| f64::from_le_bytes(*v)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUES: [f64; 4] = [0.1, -0.0, f64::MIN_POSITIVE / 8.0, 1e300];

    fn key_of(kept: &Kept, what: u32) -> Key {
        kept.key(|hasher| hasher.write_u32(what))
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn another_process_finds_what_one_made_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/deep");
        let (first, second) = (Kept::open(&path).unwrap(), Kept::open(&path).unwrap());
        let key = key_of(&first, 1);
        assert_eq!(first.or(key, || Ok(VALUES.to_vec())).unwrap(), VALUES);
        let found = second.or(key_of(&second, 1), || unreachable!()).unwrap();
        assert_eq!(bits(&found), bits(&VALUES));
        assert_eq!(second.or(key_of(&second, 2), || Ok(vec![2.0])).unwrap(), [2.0]);
        assert_eq!([first.found(), first.made(), second.found(), second.made()], [0, 1, 1, 1]);
    }

    #[test]
    fn what_is_torn_damaged_or_of_another_key_is_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::open(folder.path()).unwrap();
        let [key, other] = [1, 2].map(|what| key_of(&kept, what));
        let path = |key: &Key| kept.0.path.join(key.to_hex().as_str());
        let whole = sealed(&VALUES, &key);
        let mut damaged = whole.clone();
        damaged[9] ^= 1;
        let torn: Vec<Vec<u8>> = (0..whole.len()).map(|n| whole[..n].to_vec()).collect();
        let longer = [whole.clone(), vec![0]].concat();
        let wrong = [damaged, longer, vec![0; whole.len()], sealed(&VALUES, &other)];
        for bytes in torn.iter().chain(&wrong) {
            fs::write(path(&key), bytes).unwrap();
            assert_eq!(kept.or(key, || Ok(VALUES.to_vec())).unwrap(), VALUES);
            assert_eq!(fs::read(path(&key)).unwrap(), whole, "{} bytes", bytes.len());
        }
        assert_eq!((kept.found(), kept.made()), (0, torn.len() + wrong.len()));
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_refused_and_one_that_goes_away_costs_no_result() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "mine").unwrap();
        let refused = Kept::open(&file).unwrap_err();
        assert!(refused.to_string().contains("choose another folder"), "{refused}");
        assert_eq!(fs::read(&file).unwrap(), b"mine");
        let kept = Kept::open(&folder.path().join("gone")).unwrap();
        fs::remove_dir_all(folder.path().join("gone")).unwrap();
        assert_eq!(kept.or(key_of(&kept, 1), || Ok(vec![1.0])).unwrap(), [1.0]);
    }
}
