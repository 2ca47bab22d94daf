//! What a dataset is asked to be.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::cameras::Cameras;
use super::splits::Splits;
use super::work::{Drives, Images, Structure, Work, ground_truth};
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::presets;
use spikelane::unstable::inputs::Access;
use spikelane_io::light::Rate;
use spikelane_measure::report::with_known;
use spikelane_scene::labels::can_write_exr;
use spikelane_scene::{Lighting, SceneOptions};

/// A dataset.
#[derive(Clone, Debug)]
pub struct DatasetOptions {
    /// The folder that it becomes.
    pub output: PathBuf,
    /// What is made.
    pub work: Work,
    /// The camera, or the first of them: its size and readout rate are those of all.
    pub camera: Camera,
    /// Which cameras take the sequences.
    pub cameras: Cameras,
    /// The noise of all sequences follows from this seed.
    pub seed: u64,
    /// The scenes, and which sequences are for testing, follow from this one.
    pub scene_seed: u64,
    /// Clear images that are kept.
    pub images: Images,
    /// Which camera of the kind: fixes the fixed pattern of all sequences.
    pub camera_seed: u64,
    /// Whose folders and codes.
    pub structure: Structure,
    /// Shares of the sequences for training, validation and testing.
    pub splits: Splits,
    /// The version of the data, in the user's words.
    pub data_version: Option<String>,
    /// SPDX identifier or words under which the dataset is given on; the user's choice.
    pub licence: Option<String>,
    /// Threads; they change no byte.
    pub threads: usize,
    /// Go on with a dataset that was begun.
    pub resume: bool,
    /// Follow links that leave the dataset's folder when its files are read. Writing never follows links.
    pub follow_links: bool,
}

spikelane::unstable::with_methods!(DatasetOptions {
    with_output: output: PathBuf,
    with_work: work: Work,
    with_camera: camera: Camera,
    with_cameras: cameras: Cameras,
    with_seed: seed: u64,
    with_scene_seed: scene_seed: u64,
    with_images: images: Images,
    with_camera_seed: camera_seed: u64,
    with_structure: structure: Structure,
    with_splits: splits: Splits,
    with_data_version: data_version: Option<String>,
    with_licence: licence: Option<String>,
    with_threads: threads: usize,
    with_resume: resume: bool,
    with_follow_links: follow_links: bool,
});

impl DatasetOptions {
    /// A dataset of this work in a folder, all seeds 0, a fifth of it for testing, on one thread.
    #[must_use]
    pub fn new(output: PathBuf, work: Work, camera: Camera) -> Self {
        Self {
            output,
            work,
            camera,
            cameras: Cameras::One,
            seed: 0,
            scene_seed: 0,
            images: Images::default(),
            camera_seed: 0,
            structure: Structure::default(),
            splits: Splits::usual(),
            data_version: None,
            licence: None,
            threads: 1,
            resume: false,
            follow_links: false,
        }
    }

    /// How files of the dataset's folder are read.
    pub(crate) const fn access(&self) -> Access {
        Access::reading(self.follow_links)
    }

    /// Refuses what makes no sense before anything is written.
    ///
    /// # Errors
    /// [`Kind::Usage`].
    pub fn check(&self) -> Result<()> {
        let empty = match &self.work {
            Work::Drives(d) => d.sequences == 0 || d.readouts() == 0,
            Work::Inputs(i) => i.readouts_per_frame == Some(0),
        };
        if empty || self.images.every == Some(0) {
            return Err(Error::new(Kind::Usage, "dataset")
                .found("nothing to make")
                .expected("at least one sequence, image and readout"));
        }
        if let Work::Drives(d) = &self.work {
            at_most("sequences", d.sequences.into(), MAX_SEQUENCES)?;
            at_most("readouts of a sequence", d.readouts(), MAX_READOUTS)?;
        }
        self.splits.check(&self.work)?;
        self.cameras.check(&self.camera)?;
        match &self.work {
            Work::Drives(drives) => {
                if drives.exr {
                    can_write_exr()?;
                }
                scene_options(self, drives, drives.lighting.first().copied())?.check()
            }
            Work::Inputs(_) => Ok(()),
        }
    }

    /// Everything that decides bytes, to compare a resumed dataset with the one begun.
    ///
    /// # Errors
    /// When the camera cannot be written down.
    pub fn facts(&self) -> Result<Value> {
        let work = match &self.work {
            Work::Drives(d) => with_known(
                serde_json::to_value(d).map_err(|e| Error::new(Kind::Config, "dataset").found(e))?,
                [("kind", Some("drives".into()))],
            ),
            Work::Inputs(i) => with_known(
                json!({
                    "kind": "inputs", "folder": i.folder.display().to_string(),
                    "readouts_per_frame": i.readouts_per_frame, "insertion": i.insertion.to_string(),
                    "fit": i.fit.to_string(),
                }),
                [
                    ("list", i.list.as_ref().map(|l| l.display().to_string().into())),
                    ("transfer", i.transfer.map(|t| t.to_string().into())),
                ],
            ),
        };
        let images = json!({ "as": self.images.form.name() });
        let facts = json!({
            "work": work, "camera": presets::to_toml(&self.camera)?.text, "seed": self.seed,
            "scene_seed": self.scene_seed, "camera_seed": self.camera_seed,
            "structure": self.structure.name(), "test_share": self.splits.test,
            "ground_truth": ground_truth(self.structure),
            "images": with_known(images, [("every", self.images.every.map(Into::into))]),
            "version": env!("CARGO_PKG_VERSION"),
        });
        let more = [
            ("cameras", self.cameras.texts()?.map(Into::into)),
            ("validation_share", (self.splits.validation > 0.0).then(|| self.splits.validation.into())),
            ("split_by_light", self.splits.by_light.then(|| true.into())),
        ];
        Ok(with_known(facts, more))
    }

    /// The readout rate as a fraction.
    ///
    /// # Errors
    /// [`Kind::Config`] when it is no rate.
    pub fn rate(&self) -> Result<Rate> {
        // Six places are what a rate's text may hold.
        let micro = (self.camera.sensor.readout_hz * 1e6).round();
        Rate::new(micro as u64, 1_000_000)
    }
}

/// The most sequences of a dataset: their names and splits are held in memory, some hundred bytes each.
pub(crate) const MAX_SEQUENCES: u64 = 10_000_000;

/// The most readouts of a scene: their instants are held in memory, 8 bytes each.
const MAX_READOUTS: u64 = 1 << 26;

fn at_most(what: &str, found: u64, most: u64) -> Result<()> {
    if found <= most {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, "dataset")
        .found(format_args!("{found} {what}"))
        .expected(format_args!("at most {most}"))
        .remedy("make several data sets"))
}

/// What every scene of the dataset is asked to be.
pub(crate) fn scene_options(
    options: &DatasetOptions,
    drives: &Drives,
    lighting: Option<Lighting>,
) -> Result<SceneOptions> {
    let geometry = options.camera.sensor.geometry;
    Ok(SceneOptions {
        width: geometry.width() as u32,
        height: geometry.height() as u32,
        lighting,
        // One more readout than needed, so that rounding leaves the last one inside.
        duration_s: (drives.readouts() as f64 / options.rate()?.hz()).max(2e-3),
        speed_kmh: drives.speed_kmh,
        vehicles: drives.vehicles,
        flicker_hz: drives.flicker_hz,
        fov_deg: None,
    })
}
