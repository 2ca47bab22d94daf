//! Benchmark suites. A suite is a TOML file that determines every bit of the streams, references and labels.
//!
//! The file states the scenes, the camera, the seeds and the metrics. A *split* is a set of sequences with its own seed.
//! A *curve* varies one quantity and keeps the scenes, so the scores show at which value a method fails. The splits and
//! the points of the curves are *groups*, and each group is a data set of [`spikelane_dataset`].

mod curve;
mod file;
mod published;
mod task;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{Access, PlainName, read_text_up_to};
use spikelane_dataset::{Cameras, Content, DatasetLayout, DatasetOptions, Splits, config};
use spikelane_scene::SCENE_VERSION;

use crate::Metric;

pub use curve::{Curve, CurvePoint, CurveValue, Quantity};
pub(crate) use file::{check_camera, find_metric};
pub(crate) use task::TRIVIAL_DEPTH_M;
pub use task::Task;

/// The suites of this crate: the name and the text of the file.
const BUILTIN: [(&str, &str); 11] = [
    ("quick", include_str!("../../suites/quick.toml")),
    ("reconstruction", include_str!("../../suites/reconstruction.toml")),
    ("low-light", include_str!("../../suites/low-light.toml")),
    ("high-speed", include_str!("../../suites/high-speed.toml")),
    ("color", include_str!("../../suites/color.toml")),
    ("flow", include_str!("../../suites/flow.toml")),
    ("depth", include_str!("../../suites/depth.toml")),
    ("detection", include_str!("../../suites/detection.toml")),
    ("tracking", include_str!("../../suites/tracking.toml")),
    ("stress", include_str!("../../suites/stress.toml")),
    ("blind", include_str!("../../suites/blind.toml")),
];

/// Maximum size of a suite file in bytes.
pub const MAX_SUITE_BYTES: u64 = 1 << 20;

/// Name of the split whose sequences are scored.
const SCORED_SPLIT: &str = "test";

/// Maximum number of sequences of one split.
const MAX_SPLIT_SEQUENCES: u32 = 10_000;

/// A set of sequences with its own seed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SuiteSplit {
    /// Name. The split `test` is scored, and the other splits are for training.
    pub name: PlainName,
    /// Seed of the scenes, the cameras and the noise.
    pub seed: u64,
    /// Number of sequences.
    pub sequences: u32,
    /// Whether the sequences are scored.
    pub is_scored: bool,
}

/// A benchmark suite.
///
/// # Examples
/// ```
/// use spikelane_benchmark::suite::{Suite, Task};
/// let suite = Suite::builtin("quick")?;
/// assert_eq!((suite.name.as_str(), suite.task), ("quick", Task::Reconstruction));
/// assert!(suite.metrics.iter().any(|metric| metric.id() == "psnr/1"));
/// // The suite has a split for testing and at least one curve.
/// assert!(suite.groups(&[])?.len() > 1);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Suite {
    /// Name.
    pub name: PlainName,
    /// Semantic version. A change of the streams, references or metrics raises it.
    pub version: String,
    /// The question that the suite answers, in one sentence.
    pub description: String,
    /// Version of the scenes that the suite requires.
    pub scene_version: u32,
    /// The release of spikelane that has this version of the scenes.
    pub release: String,
    /// The task of the methods.
    pub task: Task,
    /// The metrics. The first metric is the primary metric.
    pub metrics: Vec<&'static Metric>,
    /// The splits.
    pub splits: Vec<SuiteSplit>,
    /// The curves.
    pub curves: Vec<Curve>,
    /// The digest of the generated suite, if the suite is published.
    pub digest: Option<String>,
    /// The commitment of a sealed suite whose seeds are revealed.
    pub sealed: Option<String>,
    /// The text of the file.
    pub text: String,
    options: DatasetOptions,
}

/// The sequences of a split or of one point of a curve.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Group {
    /// Name of the group and of its folder.
    pub name: PlainName,
    /// Name of the split whose seed determines the scenes.
    pub split: PlainName,
    /// The point of a curve, or `None` for a split.
    pub point: Option<CurvePoint>,
    /// Whether the sequences are scored.
    pub is_scored: bool,
    /// The data set of the group. Its output folder is relative to the folder of the generated suite.
    pub options: DatasetOptions,
}

impl Group {
    /// Returns the number of sequences.
    #[must_use]
    pub fn sequences(&self) -> usize {
        match &self.options.content {
            Content::Scenes(scenes) => scenes.sequences as usize,
            Content::Inputs(_) => 0,
        }
    }
}

impl Suite {
    /// Returns the names of the suites of this crate.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// Returns the suite of this crate with the name `name`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if there is no such suite, and the errors of [`Suite::parse`].
    pub fn builtin(name: &str) -> Result<Self> {
        let (_, text) = BUILTIN.iter().find(|(known, _)| *known == name).ok_or_else(|| {
            Error::new(ErrorKind::Usage, "suite")
                .found(format_args!("`{name}`"))
                .expected(format_args!(
                    "{}, or the path of a suite file",
                    Self::builtin_names().collect::<Vec<_>>().join(", ")
                ))
                .with_suggestion(name, Self::builtin_names())
        })?;
        Self::parse(text)
    }

    /// Returns the suite of this crate with the name `name_or_path`, or reads the suite file at this path.
    ///
    /// A path ends with `.toml`.
    ///
    /// # Errors
    /// The errors of [`Suite::builtin`], and [`ErrorKind::Io`] if the file cannot be read.
    pub fn load(name_or_path: &str) -> Result<Self> {
        if !name_or_path.ends_with(".toml") {
            return Self::builtin(name_or_path);
        }
        Self::read(Path::new(name_or_path))
    }

    /// Reads a suite file.
    ///
    /// # Errors
    /// The errors of [`Suite::parse`], and [`ErrorKind::Io`] if the file cannot be read.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text_up_to(path, "a suite", MAX_SUITE_BYTES)?;
        Self::parse(&text).map_err(|e| e.with_context(path.display()))
    }

    /// Parses the text of a suite file.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if a key is unknown or a value is invalid, if the suite requires another version of the
    /// scenes or of a metric, or if two splits share a scene.
    pub fn parse(text: &str) -> Result<Self> {
        let suite = file::parse(text)?;
        suite.check_scene_version()?;
        suite.check_options()?;
        suite.check_disjoint_splits()?;
        let mut names = BTreeSet::new();
        for group in suite.groups(&suite.other_splits())? {
            group.options.check()?;
            if !names.insert(group.name.as_str().to_owned()) {
                return Err(config_error("suite")
                    .found(format_args!("two groups with the name {}", group.name))
                    .expected("one group of each name"));
            }
        }
        Ok(suite)
    }

    /// Returns the groups that are scored, and the splits `further`, such as `train`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if there is no such split, and [`ErrorKind::Config`] if a curve cannot vary its quantity.
    pub fn groups(&self, further: &[String]) -> Result<Vec<Group>> {
        if let Some(unknown) = further.iter().find(|name| self.split(name).is_none()) {
            return Err(Error::new(ErrorKind::Usage, format_args!("split of suite {}", self.name))
                .found(format_args!("`{unknown}`"))
                .expected(self.splits.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", "))
                .with_suggestion(unknown, self.splits.iter().map(|s| s.name.as_str())));
        }
        let is_chosen =
            |split: &&SuiteSplit| split.is_scored || further.iter().any(|name| *name == split.name.as_str());
        let mut groups = Vec::new();
        for split in self.splits.iter().filter(is_chosen) {
            groups.push(Group {
                name: split.name.clone(),
                split: split.name.clone(),
                point: None,
                is_scored: split.is_scored,
                options: self.group_options(split, split.sequences, &split.name),
            });
        }
        let Some(split) = self.splits.iter().find(|split| split.is_scored) else { return Ok(groups) };
        for curve in &self.curves {
            for value in &curve.values {
                let name =
                    PlainName::parse(ErrorKind::Config, "curve", &format!("{}-{}", curve.name, value.label))?;
                let mut options = self.group_options(split, curve.sequences, &name);
                curve.quantity.apply(value, &mut options)?;
                let point = CurvePoint { curve: curve.name.clone(), value: value.label.clone(), x: value.x };
                groups.push(Group {
                    name,
                    split: split.name.clone(),
                    point: Some(point),
                    is_scored: true,
                    options,
                });
            }
        }
        Ok(groups)
    }

    /// Returns the names of the splits that are not scored.
    #[must_use]
    pub fn other_splits(&self) -> Vec<String> {
        self.splits.iter().filter(|s| !s.is_scored).map(|s| s.name.to_string()).collect()
    }

    /// Returns the index of the readout that the output belongs to.
    #[must_use]
    pub fn reference_readout(&self) -> u64 {
        self.task.reference_readout(self.readouts())
    }

    /// Returns the number of readouts of a stream.
    #[must_use]
    pub fn readouts(&self) -> u64 {
        match &self.options.content {
            Content::Scenes(scenes) => scenes.readouts(),
            Content::Inputs(_) => 0,
        }
    }

    /// Returns the number of readouts between two labeled readouts, or 0 without labels.
    #[must_use]
    pub fn interval_readouts(&self) -> u64 {
        match &self.options.content {
            Content::Scenes(scenes) => task::interval_readouts(scenes),
            Content::Inputs(_) => 0,
        }
    }

    fn split(&self, name: &str) -> Option<&SuiteSplit> {
        self.splits.iter().find(|split| split.name.as_str() == name)
    }

    fn group_options(&self, split: &SuiteSplit, sequences: u32, name: &PlainName) -> DatasetOptions {
        let mut options = self.options.clone();
        (options.seed, options.scene_seed, options.camera_seed) = (split.seed, split.seed, split.seed);
        if let Content::Scenes(scenes) = &mut options.content {
            scenes.sequences = sequences;
        }
        options.splits = Splits::default();
        options.splits.test = if split.is_scored { 1.0 } else { 0.0 };
        options.output = PathBuf::from("groups").join(name.as_str());
        options
    }

    fn check_scene_version(&self) -> Result<()> {
        if self.scene_version == SCENE_VERSION {
            return Ok(());
        }
        Err(config_error(format_args!("suite {} {}", self.name, self.version))
            .found(format_args!("scene version {}", self.scene_version))
            .expected(format_args!("{SCENE_VERSION}, the scene version of this program"))
            .remedy(format_args!(
                "generate this suite with spikelane {}, which has its scene version",
                self.release
            )))
    }

    /// Checks the data set that the groups have in common.
    fn check_options(&self) -> Result<()> {
        if self.options.dataset_layout != DatasetLayout::SpikeCv {
            return Err(config_error("dataset.dataset_layout")
                .found(self.options.dataset_layout)
                .expected("spikecv, which does not change the exposure of the scenes"));
        }
        self.task.check(&self.options)
    }

    /// Checks that no scene, camera or noise of a split occurs in another split.
    fn check_disjoint_splits(&self) -> Result<()> {
        let mut seeds = BTreeSet::new();
        for split in &self.splits {
            if split.sequences == 0 || split.sequences > MAX_SPLIT_SEQUENCES {
                return Err(config_error(format_args!("split {}", split.name))
                    .found(format_args!("{} sequences", split.sequences))
                    .expected(format_args!("1 to {MAX_SPLIT_SEQUENCES}")));
            }
            let options = self.group_options(split, split.sequences, &split.name);
            for index in 0..u64::from(split.sequences) {
                if !seeds.insert(options.scene_seed_for(&options.scene_id(index))) {
                    return Err(config_error(format_args!("split {}", split.name))
                        .found(format_args!("scene {index}, which is also a scene of another split"))
                        .expected("splits without common scenes")
                        .remedy("give each split another seed"));
                }
            }
        }
        Ok(())
    }

    /// Returns the camera that all sequences share, or an error if each sequence has its own camera.
    fn single_camera(options: &DatasetOptions, quantity: Quantity) -> Result<()> {
        match options.cameras {
            Cameras::Single => Ok(()),
            _ => Err(config_error(format_args!("curve of {}", quantity.name()))
                .found("several cameras")
                .expected("one camera, so that the curve varies only one quantity")),
        }
    }
}

fn config_error(subject: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Config, subject)
}

/// Parses the table `dataset` of a suite.
fn dataset_options(table: toml::Table) -> Result<DatasetOptions> {
    let text = toml::to_string(&table).map_err(|e| config_error("dataset").found(e))?;
    config::from_toml(&text, Path::new(""), Access::Read)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builtin_suites_are_valid_and_their_names_match() {
        for name in Suite::builtin_names() {
            let suite = Suite::builtin(name).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(suite.name.as_str(), name);
        }
    }

    #[test]
    fn another_scene_version_is_refused_with_the_release_that_has_it() {
        let text = BUILTIN[0].1.replace(&format!("scene_version = {SCENE_VERSION}"), "scene_version = 999");
        let error = Suite::parse(&text).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Config);
        assert!(error.to_string().contains("999") && error.to_string().contains("spikelane 0."), "{error}");
    }

    #[test]
    fn splits_with_one_seed_are_refused() {
        let suite = Suite::builtin("quick").unwrap();
        let seeds: Vec<u64> = suite.splits.iter().map(|s| s.seed).collect();
        let text = suite.text.replace(&format!("seed = {}\n", seeds[1]), &format!("seed = {}\n", seeds[0]));
        assert!(Suite::parse(&text).unwrap_err().to_string().contains("also a scene of another split"));
    }

    #[test]
    fn a_suite_reads_no_camera_file() {
        let text = Suite::builtin("quick").unwrap().text;
        for camera in ["\"mine.toml\"", "{ file = \"mine.toml\" }", "{ maps = { gain = \"gain.npy\" } }"] {
            let mut table: toml::Table = text.parse().unwrap();
            let value: toml::Table = format!("camera = {camera}").parse().unwrap();
            let dataset = table["dataset"].as_table_mut().unwrap();
            dataset.insert("camera".into(), value["camera"].clone());
            let error = Suite::parse(&toml::to_string(&table).unwrap()).unwrap_err();
            assert!(error.to_string().contains("camera"), "{camera}: {error}");
        }
    }

    #[test]
    fn the_points_of_a_curve_share_their_scenes() {
        let suite = Suite::builtin("reconstruction").unwrap();
        let groups = suite.groups(&[]).unwrap();
        let seeds =
            |g: &Group| (0..2).map(|i| g.options.scene_seed_for(&g.options.scene_id(i))).collect::<Vec<_>>();
        let points: Vec<_> = groups.iter().filter(|g| g.point.is_some()).collect();
        assert!(points.len() > 4 && points.iter().all(|g| seeds(g) == seeds(&groups[0])));
    }
}
