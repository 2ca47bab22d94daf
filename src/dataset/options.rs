//! What a dataset is asked to be.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::dataset::work::{Drives, Structure, Work, ground_truth};
use crate::draws::hash::mix64;
use crate::draws::{Seeds, Stream};
use crate::effects::Camera;
use crate::error::{Error, Kind, Result};
use crate::light::Rate;
use crate::presets;
use crate::report::with_known;
use crate::scene::labels::can_write_exr;
use crate::scene::{SamplesPerPixel, SceneOptions};
use crate::simulate::ImageForm;

/// A dataset.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DatasetOptions {
    /// The folder that it becomes.
    pub output: PathBuf,
    /// What is made.
    pub work: Work,
    /// The camera.
    pub camera: Camera,
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
    /// Share of the sequences that are for testing, 0 to 1.
    pub test_share: f64,
    /// SPDX identifier or words under which the dataset is given on; the user's choice.
    pub licence: Option<String>,
    /// Threads; they change no byte.
    pub threads: usize,
    /// Go on with a dataset that was begun.
    pub resume: bool,
}

crate::setters::with_methods!(DatasetOptions {
    with_output: output: PathBuf,
    with_work: work: Work,
    with_camera: camera: Camera,
    with_seed: seed: u64,
    with_scene_seed: scene_seed: u64,
    with_images: images: Images,
    with_camera_seed: camera_seed: u64,
    with_structure: structure: Structure,
    with_test_share: test_share: f64,
    with_licence: licence: Option<String>,
    with_threads: threads: usize,
    with_resume: resume: bool,
});

/// Which clear images are kept, and how they are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Images {
    /// Readouts from one to the next, from readout 0 on. Without it those of a scene's own images are
    /// kept, and of given inputs none.
    pub every: Option<u64>,
    /// How they are stored.
    pub form: ImageForm,
}

/// What a dataset will take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Estimate {
    /// Sequences that are not done.
    pub sequences: usize,
    /// Their readouts; unknown ones (videos) are not counted.
    pub readouts: u64,
    /// Bytes on the disk, about.
    pub bytes: u64,
    /// Inputs whose length only their end will tell.
    pub unknown: usize,
}

impl DatasetOptions {
    /// A dataset of this work in a folder, all seeds 0, a fifth of it for testing, on one thread.
    #[must_use]
    pub fn new(output: PathBuf, work: Work, camera: Camera) -> Self {
        Self {
            output,
            work,
            camera,
            seed: 0,
            scene_seed: 0,
            images: Images::default(),
            camera_seed: 0,
            structure: Structure::default(),
            test_share: 0.2,
            licence: None,
            threads: 1,
            resume: false,
        }
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
        let empty = empty || self.images.every == Some(0);
        if empty || !(0.0..=1.0).contains(&self.test_share) {
            return Err(Error::new(Kind::Usage, "dataset")
                .found(if empty { "nothing to make" } else { "a share outside 0 to 1" })
                .expected("at least one sequence, image and readout, and a test share from 0 to 1"));
        }
        match &self.work {
            Work::Drives(drives) => {
                if drives.exr {
                    can_write_exr()?;
                }
                scene_options(self, drives)?.check()
            }
            Work::Inputs(_) => Ok(()),
        }
    }

    /// Seeds of sequence `id`: one camera for all, noise of its own for each.
    #[must_use]
    pub fn seeds(&self, id: &str) -> Seeds {
        Seeds { camera: self.camera_seed, shot: self.seed, sequence: Stream::named(id).id() }
    }

    /// Seed of the scene of sequence `id`.
    #[must_use]
    pub fn seed_of_scene(&self, id: &str) -> u64 {
        mix64(mix64(self.scene_seed) ^ Stream::named(&format!("scene {id}")).id())
    }

    fn split_draw(&self, id: &str) -> u64 {
        mix64(mix64(self.scene_seed) ^ Stream::named(&format!("split {id}")).id())
    }

    /// Which of `ids` are for testing.
    ///
    /// Of scenes, whose number is fixed, exactly the test share, rounded (and at least one on either
    /// side if the share asks for both and there are two): those with the lowest draws. Of given inputs
    /// each one draws on its own, so that an input added later moves no other one.
    #[must_use]
    pub fn tests(&self, ids: &[String]) -> Vec<bool> {
        let draws: Vec<u64> = ids.iter().map(|id| self.split_draw(id)).collect();
        if matches!(self.work, Work::Inputs(_)) {
            let share = |draw: u64| ((draw >> 11) as f64) / (1u64 << 53) as f64;
            return draws.iter().map(|&d| share(d) >= 1.0 - self.test_share).collect();
        }
        let (n, both) = (ids.len(), self.test_share > 0.0 && self.test_share < 1.0 && ids.len() > 1);
        let wanted = (self.test_share * n as f64).round() as usize;
        let wanted = if both { wanted.clamp(1, n - 1) } else { wanted };
        // Two sequences with one draw would be two names with one hash of 64 bits.
        draws.iter().map(|d| draws.iter().filter(|other| *other < d).count() < wanted).collect()
    }

    /// Everything that decides bytes, to compare a resumed dataset with the one begun.
    ///
    /// # Errors
    /// When the camera cannot be written down.
    pub fn facts(&self) -> Result<Value> {
        let work = match &self.work {
            Work::Drives(d) => with_known(
                json!({
                    "kind": "drives", "sequences": d.sequences, "images": d.images,
                    "readouts_per_image": d.readouts_per_image, "label_every": d.label_every,
                    "samples": if d.samples == SamplesPerPixel::Four { 4 } else { 16 }, "npy": d.npy,
                    "kitti": d.kitti, "exr": d.exr,
                }),
                [
                    ("lighting", d.lighting.map(|l| l.name().into())),
                    ("flicker_hz", d.flicker_hz.map(Into::into)),
                    ("vehicles", d.vehicles.map(Into::into)),
                    ("speed_kmh", d.speed_kmh.map(Into::into)),
                    ("white_cd_m2", d.white_cd_m2.map(Into::into)),
                ],
            ),
            Work::Inputs(i) => with_known(
                json!({
                    "kind": "inputs", "folder": i.folder.display().to_string(),
                    "readouts_per_frame": i.readouts_per_frame, "insertion": i.insertion.to_string(),
                    "fit": i.fit.to_string(),
                }),
                [("transfer", i.transfer.map(|t| t.to_string().into()))],
            ),
        };
        let images = json!({ "as": self.images.form.name() });
        Ok(json!({
            "work": work, "camera": presets::to_toml(&self.camera)?.text, "seed": self.seed,
            "scene_seed": self.scene_seed, "camera_seed": self.camera_seed,
            "structure": self.structure.name(), "test_share": self.test_share,
            "ground_truth": ground_truth(self.structure),
            "images": with_known(images, [("every", self.images.every.map(Into::into))]),
            "version": env!("CARGO_PKG_VERSION"),
        }))
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

/// What every scene of the dataset is asked to be.
pub(super) fn scene_options(options: &DatasetOptions, drives: &Drives) -> Result<SceneOptions> {
    let geometry = options.camera.sensor.geometry;
    Ok(SceneOptions {
        width: geometry.width() as u32,
        height: geometry.height() as u32,
        lighting: drives.lighting,
        // One more readout than needed, so that rounding leaves the last one inside.
        duration_s: (drives.readouts() as f64 / options.rate()?.hz()).max(2e-3),
        speed_kmh: drives.speed_kmh,
        vehicles: drives.vehicles,
        flicker_hz: drives.flicker_hz,
        fov_deg: None,
    })
}
