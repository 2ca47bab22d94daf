//! Sealed suites: the seeds are secret until a stated time, and a published commitment proves that nobody changed them.
//!
//! The organizer seals a suite and publishes the commitment, which is the BLAKE3 digest of the secret file. The secret
//! file contains a random nonce of 32 bytes, so nobody can find the seeds by trying. After the submissions, the organizer
//! publishes the secret file. Everybody compares its digest with the commitment and generates the sealed suite.

use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{PlainName, deserialize_digest, read_bytes, read_text, utf8_bytes};
use spikelane_io::storage::Digest;

use crate::suite::{Suite, check_camera};

/// Version of the formats of both files.
const FORMAT_VERSION: u32 = 1;

/// Maximum size of a sealed suite and of a secret in bytes.
const MAX_SEAL_BYTES: u64 = 1 << 20;

/// Maximum number of secret seeds.
pub const MAX_SEEDS: usize = 1000;

/// The public file of a sealed suite.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Commitment {
    format_version: u32,
    /// Name of the suite.
    pub suite: PlainName,
    /// Version of the suite.
    pub version: String,
    /// Digest of the text of the suite.
    pub suite_text: String,
    /// Number of secret seeds.
    pub seeds: usize,
    /// Whether the camera is secret.
    pub has_secret_camera: bool,
    /// Digest of the secret file, as `blake3:<hex>`.
    #[serde(deserialize_with = "deserialize_digest")]
    pub commitment: String,
}

/// The secret file of a sealed suite.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Secret {
    format_version: u32,
    /// Random hex digits.
    nonce: String,
    suite: PlainName,
    version: String,
    suite_text: String,
    /// The secret seeds. Each seed replaces the scored split by a split of the same number of sequences.
    pub seeds: Vec<u64>,
    /// The secret camera as TOML, or `None` if the camera of the suite is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
}

/// A sealed suite: the public file and the bytes of the secret file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SealedSuite {
    /// The bytes of the public file.
    pub public: Vec<u8>,
    /// The bytes of the secret file.
    pub secret: Vec<u8>,
    /// The commitment.
    pub commitment: String,
}

/// Draws secret seeds from the random numbers of the operating system.
///
/// # Errors
/// [`ErrorKind::Usage`] if `count` is 0 or too large, and [`ErrorKind::Io`] if the system has no random numbers.
pub fn random_seeds(count: usize) -> Result<Vec<u64>> {
    check_seed_count(count)?;
    let mut seeds = Vec::with_capacity(count);
    for _ in 0..count {
        let mut bytes = [0; 8];
        fill_random(&mut bytes)?;
        seeds.push(u64::from_le_bytes(bytes));
    }
    Ok(seeds)
}

/// Reads secret seeds from a file with one whole number per line.
///
/// # Errors
/// [`ErrorKind::Input`] if a line is not a whole number or if there are too few or too many numbers.
pub fn read_seeds(path: &Path) -> Result<Vec<u64>> {
    let text = read_text(path, "a list of seeds")?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let seeds = lines
        .map(|(index, line)| {
            line.trim().parse().map_err(|_| {
                // The line is a secret, so the message does not contain the line.
                Error::new(ErrorKind::Input, format_args!("{}: line {}", path.display(), index + 1))
                    .found("another text")
                    .expected("a whole number from 0 to 18446744073709551615")
            })
        })
        .collect::<Result<Vec<u64>>>()?;
    check_seed_count(seeds.len())?;
    Ok(seeds)
}

/// Seals a suite.
///
/// `camera` is the text of a secret camera: the keys of a camera file, with `preset` for a preset that the keys change.
///
/// # Errors
/// [`ErrorKind::Config`] if the revealed suite would be invalid, and [`ErrorKind::Io`] if the system has no random
/// numbers.
pub fn seal(suite: &Suite, seeds: Vec<u64>, camera: Option<String>) -> Result<SealedSuite> {
    let mut nonce = [0; 32];
    fill_random(&mut nonce)?;
    let secret = Secret {
        format_version: FORMAT_VERSION,
        nonce: nonce.iter().map(|byte| format!("{byte:02x}")).collect(),
        suite: suite.name.clone(),
        version: suite.version.clone(),
        suite_text: Digest::hash_bytes(suite.text.as_bytes()),
        seeds,
        camera,
    };
    // A suite that cannot be generated must not be sealed.
    revealed_suite(suite, &secret, "blake3:")?;
    let bytes = to_json(&secret)?;
    let commitment = Digest::hash_bytes(&bytes);
    let public = Commitment {
        format_version: FORMAT_VERSION,
        suite: secret.suite,
        version: secret.version,
        suite_text: secret.suite_text,
        seeds: secret.seeds.len(),
        has_secret_camera: secret.camera.is_some(),
        commitment: commitment.clone(),
    };
    Ok(SealedSuite { public: to_json(&public)?, secret: bytes, commitment })
}

/// Opens a sealed suite. Compares the secret file with the commitment, and returns the suite with the secret seeds.
///
/// # Errors
/// * [`ErrorKind::Corrupt`] if the secret file is not the file that was sealed.
/// * [`ErrorKind::Config`] if a file is invalid, or if `suite` is not the sealed suite.
pub fn reveal(suite: &Suite, public: &Path, secret: &Path) -> Result<Suite> {
    let commitment: Commitment = read(public, "a sealed suite", |c: &Commitment| c.format_version)?;
    let bytes = read_bytes(secret, "a secret", MAX_SEAL_BYTES)?;
    let digest = Digest::hash_bytes(&bytes);
    if digest != commitment.commitment {
        return Err(Error::new(ErrorKind::Corrupt, secret.display())
            .found(&digest)
            .expected(format_args!("{}, the commitment in {}", commitment.commitment, public.display()))
            .remedy("use the secret file that belongs to the commitment"));
    }
    let secret: Secret = read(secret, "a secret", |s: &Secret| s.format_version)?;
    let text = Digest::hash_bytes(suite.text.as_bytes());
    let is_same = |name: &PlainName, version: &str, sealed: &str| {
        *name == suite.name && version == suite.version && sealed == text
    };
    if !is_same(&commitment.suite, &commitment.version, &commitment.suite_text)
        || !is_same(&secret.suite, &secret.version, &secret.suite_text)
    {
        return Err(Error::new(ErrorKind::Config, public.display())
            .found(format_args!("suite {} {}", commitment.suite, commitment.version))
            .expected(format_args!("suite {} {} of this program", suite.name, suite.version))
            .remedy("use the suite file and the release with which the suite was sealed"));
    }
    revealed_suite(suite, &secret, &digest)
}

/// Reads the name of the suite from the public file of a sealed suite.
///
/// # Errors
/// [`ErrorKind::Config`] if the file is invalid.
pub fn sealed_name(public: &Path) -> Result<String> {
    let commitment: Commitment = read(public, "a sealed suite", |c: &Commitment| c.format_version)?;
    Ok(commitment.suite.to_string())
}

/// Replaces the scored split by one split for each secret seed, and the camera by the secret camera.
fn revealed_suite(suite: &Suite, secret: &Secret, commitment: &str) -> Result<Suite> {
    check_seed_count(secret.seeds.len())?;
    let invalid = |found: &dyn std::fmt::Display| Error::new(ErrorKind::Config, "sealed suite").found(found);
    let mut table: Table = suite.text.parse().map_err(|e| invalid(&e))?;
    let scored = suite.splits.iter().find(|split| split.is_scored);
    let sequences = scored.map_or(1, |split| i64::from(split.sequences));
    let split = |(index, seed): (usize, &u64)| {
        let mut split = Table::new();
        split.insert("name".into(), Value::String(format!("sealed-{index:03}")));
        split.insert("seed".into(), Value::String(seed.to_string()));
        split.insert("sequences".into(), Value::Integer(sequences));
        split.insert("scored".into(), Value::Boolean(true));
        Value::Table(split)
    };
    table.insert("splits".into(), Value::Array(secret.seeds.iter().enumerate().map(split).collect()));
    table.insert("sealed".into(), Value::String(commitment.to_owned()));
    table.remove("digest");
    if let Some(text) = &secret.camera {
        let camera: Table = text.parse().map_err(|e| invalid(&e))?;
        check_camera(Some(&Value::Table(camera.clone())))?;
        let dataset = table.get_mut("dataset").and_then(Value::as_table_mut);
        let dataset = dataset.ok_or_else(|| invalid(&"no table dataset"))?;
        dataset.insert("camera".into(), Value::Table(camera));
    }
    Suite::parse(&toml::to_string(&table).map_err(|e| invalid(&e))?)
}

fn check_seed_count(count: usize) -> Result<()> {
    if (1..=MAX_SEEDS).contains(&count) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Usage, "secret seeds").found(count).expected(format_args!("1 to {MAX_SEEDS}")))
}

fn fill_random(bytes: &mut [u8]) -> Result<()> {
    getrandom::fill(bytes).map_err(|e| {
        Error::new(ErrorKind::Io, "random numbers of the operating system")
            .found(e)
            .remedy("write the seeds to a file")
    })
}

fn to_json(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value)
        .map_err(|e| Error::new(ErrorKind::Config, "sealed suite").found(e))?;
    text.push(b'\n');
    Ok(text)
}

fn read<T: for<'a> Deserialize<'a>>(path: &Path, what: &str, version: impl Fn(&T) -> u32) -> Result<T> {
    let text = read_bytes(path, what, MAX_SEAL_BYTES)?;
    let invalid = |found: &dyn std::fmt::Display| {
        Error::new(ErrorKind::Config, path.display()).found(found).expected(what)
    };
    let value: T = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| invalid(&e))?;
    if version(&value) != FORMAT_VERSION {
        return Err(
            invalid(&format_args!("version {} of the format", version(&value))).expected(FORMAT_VERSION)
        );
    }
    Ok(value)
}
