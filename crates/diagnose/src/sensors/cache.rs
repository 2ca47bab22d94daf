//! A folder of simulated vectors, with one file per vector. Later diagnoses can reuse them.
//!
//! A vector depends on the protocol, the camera, the lamps, the seed, and the code of the simulation. The key of a
//! vector is a hash of all these inputs, to the last bit. [`RESULTS_VERSION`] stands for the code.

use std::fs;
use std::hash::{Hash as _, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use spikelane::error::{Error, Result};
use spikelane::unstable::kernels::Backend;
use spikelane_io::storage::{write_small, write_small_unsynced};

/// Version of the simulated values. Increase it with each change of the values. The test
/// `sensors::cache_key::tests::changed_results_have_another_version` fails if the values change and the version
/// does not.
pub(crate) const RESULTS_VERSION: u32 = 2;

/// Name of a file that marks a folder as a cache. Backup programs skip such folders
/// (<https://bford.info/cachedir/>).
const TAG_NAME: &str = "CACHEDIR.TAG";
const TAG_CONTENTS: &str = "Signature: 8a477f597d28d172789f06886806bc55
# Simulations that spikelane keeps for further diagnoses. Any file of this folder may be deleted: it is made again when it is needed.
";

/// The cached simulations of this version in a folder.
///
/// A file appears only when it is complete. An interrupted diagnosis therefore leaves only valid files, and several
/// processes can use one folder.
#[derive(Clone, Debug)]
pub(crate) struct SimulationCache(Arc<Folder>);

#[derive(Debug)]
struct Folder {
    path: PathBuf,
    hits: AtomicUsize,
    misses: AtomicUsize,
}

/// Key of a cached vector.
pub(crate) type Key = blake3::Hash;

impl SimulationCache {
    /// Opens the cache in `folder`, and creates the folder if it does not exist.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(format!("{}-{RESULTS_VERSION}", env!("CARGO_PKG_VERSION")));
        let with_remedy =
            |e: Error| e.remedy("choose another folder for simulations, or allow writing to this folder");
        fs::create_dir_all(&path)
            .map_err(|e| Error::io(path.display(), e).expected("a folder that can be created"))
            .map_err(with_remedy)?;
        write_small(&path.join(TAG_NAME), TAG_CONTENTS.as_bytes(), true).map_err(with_remedy)?;
        Ok(Self(Arc::new(Folder { path, hits: AtomicUsize::new(0), misses: AtomicUsize::new(0) })))
    }

    /// Returns the number of vectors that were read from the folder.
    pub(crate) fn hit_count(&self) -> usize {
        self.0.hits.load(Ordering::Relaxed)
    }

    /// Returns the number of vectors that were simulated because the folder did not contain them.
    pub(crate) fn miss_count(&self) -> usize {
        self.0.misses.load(Ordering::Relaxed)
    }

    /// Returns the key of the data that `hash` adds to a hasher. The key also depends on the operating system and
    /// the instruction set, because these change the last digit of Fourier transforms and logarithms.
    pub(crate) fn key(&self, hash: impl FnOnce(&mut KeyHasher)) -> Key {
        let mut hasher = KeyHasher(blake3::Hasher::new());
        let sets = Backend::ALL.into_iter().filter(|b| b.is_available()).map(Backend::name);
        let machine = [std::env::consts::OS, std::env::consts::ARCH].into_iter().chain(sets);
        machine.for_each(|name| name.hash(&mut hasher));
        hash(&mut hasher);
        hasher.0.finalize()
    }

    /// Returns the vector of `key` from the folder. If the folder does not contain it, `simulate` computes it, and
    /// the cache stores it.
    pub(crate) fn get_or_simulate(
        &self,
        key: Key,
        simulate: impl FnOnce() -> Result<Vec<f64>>,
    ) -> Result<Vec<f64>> {
        let path = self.0.path.join(key.to_hex().as_str());
        if let Some(values) = fs::read(&path).ok().and_then(|bytes| decode(&bytes, &key)) {
            self.0.hits.fetch_add(1, Ordering::Relaxed);
            return Ok(values);
        }
        let values = simulate()?;
        self.0.misses.fetch_add(1, Ordering::Relaxed);
        // An error of writing, for example on a full disk, must not end a diagnosis.
        let _ = write_small_unsynced(&path, &encode(&values, &key));
        Ok(values)
    }
}

/// A hasher of a key, for any type that implements `Hash`.
pub(crate) struct KeyHasher(blake3::Hasher);

impl Hasher for KeyHasher {
    fn write(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// Returns the first 8 bytes of the digest, as the trait requires. Keys use all bytes.
    fn finish(&self) -> u64 {
        let [a, b, c, d, e, f, g, h, ..] = *self.0.finalize().as_bytes();
        u64::from_le_bytes([a, b, c, d, e, f, g, h])
    }
}

/// Returns the contents of a file: the values, and their digest with the key. With another key, the digest of the
/// same file is invalid.
fn encode(values: &[f64], key: &Key) -> Vec<u8> {
    let mut bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let seal = blake3::keyed_hash(key.as_bytes(), &bytes);
    bytes.extend(seal.as_bytes());
    bytes
}

/// Returns the values of a file. Returns `None` if the file is incomplete or damaged, or belongs to another key.
fn decode(bytes: &[u8], key: &Key) -> Option<Vec<f64>> {
    let (values, seal) = bytes.split_last_chunk::<{ blake3::OUT_LEN }>()?;
    let (values, rest) = values.as_chunks::<8>();
    let is_complete = rest.is_empty() && blake3::keyed_hash(key.as_bytes(), values.as_flattened()) == *seal;
    is_complete.then(|| values.iter().map(|v| f64::from_le_bytes(*v)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUES: [f64; 4] = [0.1, -0.0, f64::MIN_POSITIVE / 8.0, 1e300];

    fn key_of(cache: &SimulationCache, what: u32) -> Key {
        cache.key(|hasher| hasher.write_u32(what))
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn processes_share_cached_vectors_by_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/deep");
        let (first, second) = (SimulationCache::open(&path).unwrap(), SimulationCache::open(&path).unwrap());
        let key = key_of(&first, 1);
        assert_eq!(first.get_or_simulate(key, || Ok(VALUES.to_vec())).unwrap(), VALUES);
        let found = second.get_or_simulate(key_of(&second, 1), || unreachable!()).unwrap();
        assert_eq!(bits(&found), bits(&VALUES));
        assert_eq!(second.get_or_simulate(key_of(&second, 2), || Ok(vec![2.0])).unwrap(), [2.0]);
        assert_eq!(
            [first.hit_count(), first.miss_count(), second.hit_count(), second.miss_count()],
            [0, 1, 1, 1]
        );
    }

    #[test]
    fn incomplete_damaged_and_foreign_files_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let cache = SimulationCache::open(folder.path()).unwrap();
        let [key, other] = [1, 2].map(|what| key_of(&cache, what));
        let path = |key: &Key| cache.0.path.join(key.to_hex().as_str());
        let complete = encode(&VALUES, &key);
        let mut damaged = complete.clone();
        damaged[9] ^= 1;
        let torn: Vec<Vec<u8>> = (0..complete.len()).map(|n| complete[..n].to_vec()).collect();
        let longer = [complete.clone(), vec![0]].concat();
        let wrong = [damaged, longer, vec![0; complete.len()], encode(&VALUES, &other)];
        for bytes in torn.iter().chain(&wrong) {
            fs::write(path(&key), bytes).unwrap();
            assert_eq!(cache.get_or_simulate(key, || Ok(VALUES.to_vec())).unwrap(), VALUES);
            assert_eq!(fs::read(path(&key)).unwrap(), complete, "{} bytes", bytes.len());
        }
        assert_eq!((cache.hit_count(), cache.miss_count()), (0, torn.len() + wrong.len()));
    }

    #[test]
    fn an_unusable_folder_is_an_error_and_a_deleted_folder_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "mine").unwrap();
        let refused = SimulationCache::open(&file).unwrap_err();
        assert!(refused.to_string().contains("choose another folder"), "{refused}");
        assert_eq!(fs::read(&file).unwrap(), b"mine");
        let cache = SimulationCache::open(&folder.path().join("gone")).unwrap();
        fs::remove_dir_all(folder.path().join("gone")).unwrap();
        assert_eq!(cache.get_or_simulate(key_of(&cache, 1), || Ok(vec![1.0])).unwrap(), [1.0]);
    }
}
