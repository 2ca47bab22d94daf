//! Generates the data of a suite, and verifies it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, deserialize_digest, read_bytes, utf8_bytes};
use spikelane_dataset::{
    self as dataset, DatasetEstimate, DatasetOptions, DatasetReader, SequenceEntry, SequenceProgress,
};
use spikelane_io::simulate::MosaicFacts;
use spikelane_io::storage::{self, Digest, OutputSet};

use crate::suite::{CurvePoint, Group, Suite};

/// File names in the folder of a generated suite.
const SUITE_FILE: &str = "suite.toml";
const INDEX_FILE: &str = "suite.json";

/// Version of the format of `suite.json`.
const FORMAT_VERSION: u32 = 1;

/// Maximum size of `suite.json` in bytes.
const MAX_INDEX_BYTES: u64 = 64 << 20;

/// A file of a sequence that methods or metrics read.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GeneratedFile {
    /// Path in the folder of the sequence.
    pub path: InnerPath,
    /// Length in bytes.
    pub bytes: u64,
    /// Digest of the bytes, as `blake3:<hex>`.
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
}

/// A generated sequence.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GeneratedSequence {
    /// Name of the sequence, which is unique in its group.
    pub id: PlainName,
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Number of readouts.
    pub readouts: u64,
    /// Number of readouts per second.
    pub readout_hz: f64,
    /// The readout that the output belongs to, counted from 0.
    pub reference_readout: u64,
    /// Number of readouts between two labeled readouts, or 0 without labels.
    pub interval_readouts: u64,
    /// Spikes per readout of a pixel with the light 1.
    pub white_rate: f64,
    /// The color filters of a color camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mosaic: Option<MosaicFacts>,
    /// The files. The first file is the stream.
    pub files: Vec<GeneratedFile>,
}

/// A generated group.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GeneratedGroup {
    /// Name of the group and of its folder.
    pub name: PlainName,
    /// Name of the split whose seed determines the scenes.
    pub split: PlainName,
    /// The point of a curve, or `None` for a split.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<CurvePoint>,
    /// Whether the sequences are scored.
    pub is_scored: bool,
    /// The sequences.
    pub sequences: Vec<GeneratedSequence>,
}

/// The content of `suite.json`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
struct Index {
    format_version: u32,
    name: PlainName,
    version: String,
    #[serde(deserialize_with = "deserialize_digest")]
    digest: String,
    groups: Vec<GeneratedGroup>,
}

/// A generated suite in a folder.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GeneratedSuite {
    /// The folder.
    pub folder: PathBuf,
    /// The suite.
    pub suite: Suite,
    /// The digest of all files that methods and metrics read.
    pub digest: String,
    /// The groups.
    pub groups: Vec<GeneratedGroup>,
}

/// How a suite is generated.
#[derive(Clone, Debug)]
pub struct GenerateOptions {
    /// Output folder.
    pub output: PathBuf,
    /// Names of further splits, such as `train`.
    pub splits: Vec<String>,
    /// Number of threads. The bits do not depend on it.
    pub threads: usize,
    /// Whether to continue an interrupted generation.
    pub resume: bool,
}

/// The progress of a generation.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct GenerateProgress<'a> {
    /// Name of the current group.
    pub group: &'a str,
    /// Number of finished sequences of all groups.
    pub finished_sequences: usize,
    /// Number of sequences of all groups.
    pub sequence_count: usize,
    /// Progress of the data set of the group.
    pub dataset: SequenceProgress<'a>,
}

/// The result of a generation.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct GenerateReport {
    /// Number of sequences that were generated.
    pub generated: usize,
    /// Number of existing sequences that passed verification.
    pub verified: usize,
    /// Notes for the user about the light of generated sequences. Each note is one line.
    pub notes: Vec<String>,
    /// The digest of the suite.
    pub digest: String,
}

/// Estimates the cost of a suite. Nothing is written.
///
/// # Errors
/// The errors of [`Suite::groups`] and of [`spikelane_dataset::estimate`].
pub fn estimate(suite: &Suite, options: &GenerateOptions) -> Result<DatasetEstimate> {
    let mut sum = DatasetEstimate::default();
    for group in suite.groups(&options.splits)? {
        let one = dataset::estimate(&group_options(&group, options))?;
        sum.sequences += one.sequences;
        sum.readouts = sum.readouts.saturating_add(one.readouts);
        sum.bytes = sum.bytes.saturating_add(one.bytes);
    }
    Ok(sum)
}

/// Generates a suite. The bits do not depend on the machine, the number of threads or the number of interruptions.
///
/// # Errors
/// * [`ErrorKind::Exists`] if the folder contains a suite and `resume` is false.
/// * [`ErrorKind::Config`] if the folder contains another suite.
/// * [`ErrorKind::Corrupt`] if the suite states a digest and the generated digest differs.
/// * The errors of [`spikelane_dataset::generate`] and of `progress`.
pub fn generate(
    suite: &Suite,
    options: &GenerateOptions,
    progress: &mut dyn FnMut(GenerateProgress<'_>) -> Result<()>,
) -> Result<GenerateReport> {
    let _claim = OutputSet::claim_folder(&options.output)?;
    let suite_path = InnerPath::from(SUITE_FILE).resolve_in(&options.output, Access::Write)?;
    let index_path = InnerPath::from(INDEX_FILE).resolve_in(&options.output, Access::Write)?;
    let groups = suite.groups(&options.splits)?;
    let is_begun = suite_path.try_exists().map_err(|e| Error::io(suite_path.display(), e))?;
    if is_begun {
        check_same_suite(suite, &suite_path, options)?;
    }
    let needed = estimate(suite, options)?.bytes;
    if let Some(free) = storage::free_space(&options.output)?.filter(|&free| needed > free) {
        return Err(Error::new(ErrorKind::Space, options.output.display())
            .found(format_args!("{} free", Count(free, "byte")))
            .expected(format_args!("about {needed}"))
            .remedy("choose another disk"));
    }
    if !is_begun {
        storage::write_small(&suite_path, suite.text.as_bytes(), false)?;
    }
    let mut report = GenerateReport::default();
    let mut generated = Vec::new();
    let sequence_count = groups.iter().map(Group::sequences).sum();
    let mut finished = 0;
    for group in &groups {
        let data = group_options(group, options);
        let name = group.name.as_str();
        let made = dataset::generate(&data, &mut |dataset| {
            progress(GenerateProgress {
                group: name,
                finished_sequences: finished + dataset.index,
                sequence_count,
                dataset,
            })
        })?;
        if let Some(failure) = made.failures.first() {
            let subject = format_args!("{name}/{}", failure.input).to_string();
            return Err(Error::new(ErrorKind::Input, subject).found(&failure.reason));
        }
        report.generated += made.generated;
        report.verified += made.verified_sequences;
        report.notes.extend(made.notes.iter().map(|note| format!("{name}: {note}")));
        finished += group.sequences();
        generated.push(indexed_group(suite, group, &data)?);
    }
    report.digest = suite_digest(suite, &generated);
    if let Some(published) = suite.digest.as_ref().filter(|published| **published != report.digest) {
        return Err(Error::new(ErrorKind::Corrupt, format_args!("suite {} {}", suite.name, suite.version))
            .found(&report.digest)
            .expected(format_args!("{published}, the published digest"))
            .remedy("report the machine and the version of the program"));
    }
    let index = Index {
        format_version: FORMAT_VERSION,
        name: suite.name.clone(),
        version: suite.version.clone(),
        digest: report.digest.clone(),
        groups: generated,
    };
    let text = serde_json::to_vec_pretty(&index)
        .map_err(|e| Error::new(ErrorKind::Config, index_path.display()).found(e))?;
    storage::write_small(&index_path, &text, true)?;
    Ok(report)
}

impl GeneratedSuite {
    /// Opens a generated suite. The streams are not verified.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if the folder contains no finished suite.
    /// * [`ErrorKind::Config`] if a file is invalid.
    /// * [`ErrorKind::Corrupt`] if the digest does not belong to the listed files.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = |name: &'static str| InnerPath::from(name).resolve_in(folder, Access::Read);
        let suite = Suite::read(&path(SUITE_FILE)?).map_err(|e| match e.io_error() {
            Some(source) if source.kind() == std::io::ErrorKind::NotFound => e
                .expected("the folder of a generated suite")
                .remedy("check the path, or generate the suite in this folder first"),
            _ => e,
        })?;
        let index_path = path(INDEX_FILE)?;
        let text = match read_bytes(&index_path, "a generated suite", MAX_INDEX_BYTES) {
            Err(e) if e.io_error().is_some_and(|e| e.kind() == std::io::ErrorKind::NotFound) => {
                return Err(Error::new(ErrorKind::Input, folder.display())
                    .found("an unfinished suite")
                    .expected("a generated suite")
                    .remedy(format_args!("continue the generation with {}", Setting("resume"))));
            }
            other => other?,
        };
        let invalid =
            |found: &dyn std::fmt::Display| Error::new(ErrorKind::Config, index_path.display()).found(found);
        let index: Index = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| invalid(&e))?;
        if index.format_version != FORMAT_VERSION {
            return Err(invalid(&format_args!("version {} of the format", index.format_version))
                .expected(FORMAT_VERSION));
        }
        for group in &index.groups {
            for sequence in &group.sequences {
                let files: Vec<_> = sequence.files.iter().map(|file| file.path.as_str()).collect();
                if files != suite.task.files(sequence.readouts)
                    || sequence.reference_readout != suite.task.reference_readout(sequence.readouts)
                    || sequence.interval_readouts != suite.interval_readouts()
                {
                    return Err(invalid(&format_args!("other files of {}/{}", group.name, sequence.id))
                        .expected("the files of the task"));
                }
            }
        }
        let digest = suite_digest(&suite, &index.groups);
        if digest != index.digest {
            return Err(Error::new(ErrorKind::Corrupt, index_path.display())
                .found(format_args!("files with the digest {digest}"))
                .expected(index.digest)
                .remedy("generate the suite again"));
        }
        Ok(Self { folder: folder.to_owned(), suite, digest, groups: index.groups })
    }

    /// Returns the scored sequences with their groups.
    pub fn scored(&self) -> impl Iterator<Item = (&GeneratedGroup, &GeneratedSequence)> {
        self.groups
            .iter()
            .filter(|group| group.is_scored)
            .flat_map(|group| group.sequences.iter().map(move |sequence| (group, sequence)))
    }

    /// Returns the path of a file of a sequence after its length and digest are verified.
    ///
    /// # Errors
    /// [`ErrorKind::Corrupt`] if the file was changed, shortened or removed. The error names the file.
    pub fn verified_path(&self, group: &PlainName, id: &PlainName, file: &GeneratedFile) -> Result<PathBuf> {
        let folder = InnerPath::from("groups").join(group).join("sequences").join(id);
        let inner = InnerPath::parse(
            ErrorKind::Config,
            INDEX_FILE,
            &format!("{}/{}", folder.as_str(), file.path.as_str()),
        )?;
        let path = inner.resolve_in(&self.folder, Access::Read)?;
        let corrupt = |found: &dyn std::fmt::Display, expected: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Corrupt, path.display())
                .found(found)
                .expected(expected)
                .remedy(format_args!("generate the suite again with {}", Setting("resume")))
        };
        let bytes = match std::fs::metadata(&path) {
            Ok(metadata) => metadata.len(),
            Err(e) => return Err(corrupt(&e, &Count(file.bytes, "byte"))),
        };
        if bytes != file.bytes {
            return Err(corrupt(&Count(bytes, "byte"), &Count(file.bytes, "byte")));
        }
        let digest = Digest::hash_file(&path)?;
        if digest != file.digest {
            return Err(corrupt(&digest, &file.digest));
        }
        Ok(path)
    }

    /// Verifies all files of the suite that methods and metrics read. Returns one error for each faulty file.
    ///
    /// # Errors
    /// The errors of `progress`, which is called with the number of verified sequences.
    pub fn verify(&self, progress: &mut dyn FnMut(u64) -> Result<()>) -> Result<Vec<Error>> {
        let (mut faults, mut done) = (Vec::new(), 0);
        for group in &self.groups {
            for sequence in &group.sequences {
                for file in &sequence.files {
                    faults.extend(self.verified_path(&group.name, &sequence.id, file).err());
                }
                done += 1;
                progress(done)?;
            }
        }
        Ok(faults)
    }
}

impl GeneratedSequence {
    /// Returns the stream.
    #[must_use]
    pub fn stream(&self) -> Option<&GeneratedFile> {
        self.files.first()
    }
}

/// Returns the options of the data set of a group.
fn group_options(group: &Group, options: &GenerateOptions) -> DatasetOptions {
    let mut data = group.options.clone();
    data.output = options.output.join(&data.output);
    data.threads = options.threads;
    data.resume = options.resume;
    data
}

fn check_same_suite(suite: &Suite, path: &Path, options: &GenerateOptions) -> Result<()> {
    let folder = options.output.display();
    if !options.resume {
        return Err(Error::new(ErrorKind::Exists, folder)
            .found("an existing suite")
            .expected("a folder without a suite")
            .remedy(format_args!(
                "set {} to continue this suite, or choose another folder",
                Setting("resume")
            )));
    }
    let old = Suite::read(path)?;
    if old.text == suite.text {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, folder)
        .found(format_args!("suite {} {} with another text", old.name, old.version))
        .expected(format_args!("suite {} {}", suite.name, suite.version))
        .remedy("choose another folder"))
}

/// Returns the group as it is listed in `suite.json`.
fn indexed_group(suite: &Suite, group: &Group, data: &DatasetOptions) -> Result<GeneratedGroup> {
    let reader = DatasetReader::open(&data.output, false)?;
    let sequence = |entry: &&SequenceEntry| indexed_sequence(suite, &reader, entry, data);
    Ok(GeneratedGroup {
        name: group.name.clone(),
        split: group.split.clone(),
        point: group.point.clone(),
        is_scored: group.is_scored,
        sequences: reader.done_entries().iter().map(sequence).collect::<Result<_>>()?,
    })
}

fn indexed_sequence(
    suite: &Suite,
    reader: &DatasetReader,
    entry: &SequenceEntry,
    data: &DatasetOptions,
) -> Result<GeneratedSequence> {
    let task = suite.task;
    let record = reader.sequence(entry)?.record()?;
    let camera = data.camera_for(entry.id.as_str())?;
    let sensor = camera.sensor;
    let readouts = entry.readouts.unwrap_or(0);
    let find = |name: &String| {
        let file = record.files.iter().find(|file| file.path.as_str() == name);
        file.map(|f| GeneratedFile { path: f.path.clone(), bytes: f.bytes, digest: f.digest.clone() })
            .ok_or_else(|| Error::new(ErrorKind::Corrupt, entry.id.as_str()).found(format_args!("no {name}")))
    };
    Ok(GeneratedSequence {
        id: entry.id.clone(),
        width: sensor.geometry.width() as u32,
        height: sensor.geometry.height() as u32,
        readouts,
        readout_hz: sensor.readout_hz,
        reference_readout: task.reference_readout(readouts),
        interval_readouts: suite.interval_readouts(),
        white_rate: sensor.thresholds_at_full_scale,
        mosaic: camera.window_mosaic().as_ref().map(MosaicFacts::new),
        files: task.files(readouts).iter().map(find).collect::<Result<_>>()?,
    })
}

/// Returns the digest of a suite. It is the digest of one line for the suite, one line for each metric, and one line for
/// each file of each scored sequence, in the order of the index.
///
/// Further splits do not change the digest.
fn suite_digest(suite: &Suite, groups: &[GeneratedGroup]) -> String {
    let mut digest = Digest::new();
    let mut line = |text: String| digest.update(text.as_bytes());
    line(format!("suite {} {} scenes {}\n", suite.name, suite.version, suite.scene_version));
    suite.metrics.iter().for_each(|metric| line(format!("metric {}\n", metric.id())));
    for group in groups.iter().filter(|group| group.is_scored) {
        for sequence in &group.sequences {
            if let Some(mosaic) = &sequence.mosaic {
                line(format!("{}/{} mosaic {}\n", group.name, sequence.id, serde_json::json!(mosaic)));
            }
            let GeneratedSequence { id, width, height, readouts, readout_hz, white_rate, .. } = sequence;
            for file in &sequence.files {
                line(format!(
                    "{}/{id} {width}x{height} {readouts} {readout_hz} {white_rate} {} {} {}\n",
                    group.name,
                    file.path.as_str(),
                    file.bytes,
                    file.digest
                ));
            }
        }
    }
    digest.to_text()
}
