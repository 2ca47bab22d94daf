//! Options of a dataset.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::cameras::Cameras;
use super::content::{
    Content, DatasetLayout, ReferenceImageOptions, SceneContent, ground_truth_facts, path_name,
};
use super::splits::Splits;
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::presets;
use spikelane::unstable::inputs::Access;
use spikelane_io::light::Rate;
use spikelane_measure::report::insert_present;
use spikelane_scene::labels::check_exr_support;
use spikelane_scene::{Exposure, Lens, Lighting, SCENE_VERSION, SceneOptions};

/// Options of a dataset.
#[derive(Clone, Debug)]
pub struct DatasetOptions {
    /// Output folder of the dataset.
    pub output: PathBuf,
    /// Source of the light.
    pub content: Content,
    /// The camera, or the first of several cameras. All cameras have the geometry and the readout rate of this camera.
    pub camera: Camera,
    /// Cameras that record the sequences.
    pub cameras: Cameras,
    /// Seed of the noise in all sequences.
    pub seed: u64,
    /// Seed of the scenes. It also determines the split of each sequence.
    pub scene_seed: u64,
    /// Specifies which reference images are written.
    pub images: ReferenceImageOptions,
    /// Seed of the fixed patterns of the cameras.
    pub camera_seed: u64,
    /// Folder layout and ground-truth codes that the loader expects.
    pub dataset_layout: DatasetLayout,
    /// Fractions of the sequences for training, validation and testing.
    pub splits: Splits,
    /// Version of the data, if the user specifies one.
    pub data_version: Option<String>,
    /// License of the dataset, if the user specifies one. The license is an SPDX identifier or other text.
    pub license: Option<String>,
    /// Number of threads. The bytes of the dataset do not depend on the number of threads.
    pub threads: usize,
    /// Whether to resume an existing dataset.
    pub resume: bool,
    /// Whether links to files outside the dataset's folder are followed when files are read. When files are written,
    /// links are never followed.
    pub follow_links: bool,
}

spikelane::unstable::with_methods!(DatasetOptions {
    with_output: output: PathBuf,
    with_content: content: Content,
    with_camera: camera: Camera,
    with_cameras: cameras: Cameras,
    with_seed: seed: u64,
    with_scene_seed: scene_seed: u64,
    with_images: images: ReferenceImageOptions,
    with_camera_seed: camera_seed: u64,
    with_dataset_layout: dataset_layout: DatasetLayout,
    with_splits: splits: Splits,
    with_data_version: data_version: Option<String>,
    with_license: license: Option<String>,
    with_threads: threads: usize,
    with_resume: resume: bool,
    with_follow_links: follow_links: bool,
});

impl DatasetOptions {
    /// Returns options for the content `work` in the folder `output`. All seeds are 0, a fifth of the sequences is for
    /// testing, and the number of threads is one.
    #[must_use]
    pub fn new(output: PathBuf, work: Content, camera: Camera) -> Self {
        Self {
            output,
            content: work,
            camera,
            cameras: Cameras::Single,
            seed: 0,
            scene_seed: 0,
            images: ReferenceImageOptions::default(),
            camera_seed: 0,
            dataset_layout: DatasetLayout::default(),
            splits: Splits::default_shares(),
            data_version: None,
            license: None,
            threads: 1,
            resume: false,
            follow_links: false,
        }
    }

    /// Returns the access mode for reading files in the dataset's folder.
    pub(crate) const fn access(&self) -> Access {
        Access::for_reading(self.follow_links)
    }

    /// Checks the options. The caller must do this before anything is written.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`] if an option is out of range, or if the options require EXR and the build does not
    ///   support EXR.
    /// * [`ErrorKind::Config`] if the geometry or the readout rate of the cameras differs.
    pub fn check(&self) -> Result<()> {
        let empty = match &self.content {
            Content::Scenes(d) => d.sequences == 0 || d.readouts() == 0,
            Content::Inputs(i) => i.readouts_per_frame == Some(0),
        };
        if empty || self.images.every == Some(0) {
            return Err(Error::new(ErrorKind::Usage, "dataset")
                .found("no data to generate")
                .expected("at least one sequence, image and readout"));
        }
        if let Content::Scenes(d) = &self.content {
            check_at_most("sequences", d.sequences.into(), MAX_SEQUENCES)?;
            check_at_most("readouts of a sequence", d.readouts(), MAX_READOUTS)?;
        }
        self.splits.check(&self.content)?;
        self.cameras.check(&self.camera)?;
        match &self.content {
            Content::Scenes(drives) => {
                if drives.exr {
                    check_exr_support()?;
                }
                scene_options(self, drives, drives.lighting.first().copied())?.check()
            }
            Content::Inputs(_) => Ok(()),
        }
    }

    /// Returns the options that determine the bytes of the dataset. When a dataset is resumed, these options are
    /// compared with the manifest. Of the folder and the list of inputs, they contain the names without the paths. Digests
    /// of the inputs detect another folder of the same name.
    ///
    /// # Errors
    /// The errors of [`presets::to_toml`].
    pub fn manifest_options(&self) -> Result<Value> {
        let work = match &self.content {
            Content::Scenes(d) => insert_present(
                serde_json::to_value(d).map_err(|e| Error::new(ErrorKind::Config, "dataset").found(e))?,
                [("source", Some("drives".into())), ("scene_version", Some(SCENE_VERSION.into()))],
            ),
            Content::Inputs(i) => insert_present(
                json!({
                    "source": "inputs", "folder": path_name(&i.folder),
                    "readouts_per_frame": i.readouts_per_frame, "interpolation": i.interpolation.to_string(),
                    "resize_mode": i.resize_mode.to_string(),
                }),
                [
                    ("list", i.list.as_ref().map(|l| path_name(l).into())),
                    ("transfer", i.transfer.map(|t| t.to_string().into())),
                    ("full_scale", i.full_scale.map(Into::into)),
                    ("accept_damage", i.accept_damage.then(|| true.into())),
                ],
            ),
        };
        let images = json!({ "format": self.images.format.name() });
        let facts = json!({
            "content": work, "camera": presets::to_toml(&self.camera)?.text, "seed": self.seed,
            "scene_seed": self.scene_seed, "camera_seed": self.camera_seed,
            "dataset_layout": self.dataset_layout.name(), "test_share": self.splits.test,
            "ground_truth": ground_truth_facts(self.dataset_layout),
            "images": insert_present(images, [("every", self.images.every.map(Into::into))]),
            "version": env!("CARGO_PKG_VERSION"),
        });
        let more = [
            ("cameras", self.cameras.extra_camera_texts()?.map(Into::into)),
            ("validation_share", (self.splits.validation > 0.0).then(|| self.splits.validation.into())),
            ("split_by_light", self.splits.stratify_by_lighting.then(|| true.into())),
        ];
        Ok(insert_present(facts, more))
    }

    /// Returns the readout rate as a fraction.
    ///
    /// # Errors
    /// The errors of [`Rate::new`].
    pub fn rate(&self) -> Result<Rate> {
        // A `Rate` has at most six decimal places.
        let micro = (self.camera.sensor.readout_hz * 1e6).round();
        Rate::new(micro as u64, 1_000_000)
    }
}

/// Maximum number of sequences. The names and splits of all sequences are in memory, and each sequence needs a few
/// hundred bytes.
pub(crate) const MAX_SEQUENCES: u64 = 10_000_000;

/// Maximum number of readouts of a scene. The instants of all readouts are in memory, and each instant needs 8 bytes.
const MAX_READOUTS: u64 = 1 << 26;

fn check_at_most(what: &str, value: u64, limit: u64) -> Result<()> {
    if value <= limit {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Usage, "dataset")
        .found(format_args!("{value} {what}"))
        .expected(format_args!("at most {limit}"))
        .remedy("generate several datasets"))
}

/// Returns the scene options of a scene of the dataset with the lighting `lighting`.
pub(crate) fn scene_options(
    options: &DatasetOptions,
    drives: &SceneContent,
    lighting: Option<Lighting>,
) -> Result<SceneOptions> {
    let geometry = options.camera.sensor.geometry;
    Ok(SceneOptions {
        width: geometry.width() as u32,
        height: geometry.height() as u32,
        lighting,
        // The duration includes one readout more than necessary. Otherwise rounding could put the last readout outside
        // the drive.
        duration_s: (drives.readouts() as f64 / options.rate()?.hz()).max(2e-3),
        speed_kmh: drives.speed_kmh,
        vehicles: drives.vehicles,
        flicker_hz: drives.flicker_hz,
        fov_deg: None,
        // All scenes have the lens of one camera.
        lens: Some(if drives.ideal_lens { Lens::IDEAL } else { Lens::from_seed(options.scene_seed) }),
        exposure: match (drives.white_cd_m2, drives.lock_exposure) {
            (Some(white), _) => Exposure::Fixed(white),
            (None, true) => Exposure::Locked,
            (None, false) => Exposure::Automatic,
        },
    })
}
