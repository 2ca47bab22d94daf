//! What a dataset is asked to be.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::dataset::{Images, sequence, truth};
use crate::draws::hash::mix64;
use crate::draws::{Seeds, Stream};
use crate::effects::Camera;
use crate::error::{Error, Kind, Result};
use crate::light::{Fit, Insertion, Rate, Transfer};
use crate::presets;
use crate::report::with_known;
use crate::scene::labels::can_write_exr;
use crate::scene::{Lighting, Samples};

/// Which loaders find their folders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Structure {
    /// `SPLIT/spike/ID.dat`, `SPLIT/gt/ID.png` and SpikeCV's `config.yaml`.
    #[default]
    SpikeCv,
    /// `SPLIT/spike/ID.dat` and `SPLIT/gt/ID.png`, as Spike-Zoo's base dataset.
    SpikeZoo,
}

impl Structure {
    /// The name in arguments and manifests.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpikeCv => "spikecv",
            Self::SpikeZoo => "spike-zoo",
        }
    }
}

impl std::str::FromStr for Structure {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        [Self::SpikeCv, Self::SpikeZoo].into_iter().find(|l| l.name() == name).ok_or_else(|| {
            Error::new(Kind::Usage, "dataset structure")
                .found(format_args!("`{name}`"))
                .expected("spikecv or spike-zoo")
        })
    }
}

/// Random driving scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct Drives {
    /// Number of scenes.
    pub sequences: u32,
    /// Clear images of each.
    pub images: u32,
    /// Readouts from one image to the next; light follows every readout.
    pub readouts_per_image: u32,
    /// Images from one labelled image to the next; 0 for no labels.
    pub label_every: u32,
    /// The light, or one drawn by each scene's seed.
    pub lighting: Option<Lighting>,
    /// Lamp flicker in hertz.
    pub flicker_hz: Option<f64>,
    /// Vehicles, or as many as the seed says.
    pub vehicles: Option<u32>,
    /// Wished speed in km/h, or what the seed says.
    pub speed_kmh: Option<f64>,
    /// Luminance of full scale in cd/m2 for all scenes, or each scene's own white.
    pub white_cd_m2: Option<f32>,
    /// Colour samples of a pixel.
    pub samples: Samples,
    /// Also the clear images as linear `f32`.
    pub npy: bool,
    /// Also depth and flow as KITTI's 16-bit PNGs.
    pub kitti: bool,
    /// Also the light of labelled images in colour, as EXR.
    pub exr: bool,
}

impl Drives {
    /// Names of datasets that are known.
    pub const PRESETS: [&'static str; 2] = ["rhdd", "tiny"];

    /// The dataset of that name.
    #[must_use]
    pub fn preset(name: &str) -> Option<Self> {
        match name {
            "rhdd" => Some(Self::rhdd()),
            "tiny" => Some(Self::tiny()),
            _ => None,
        }
    }

    /// Two scenes of 40 images, for a first try.
    #[must_use]
    pub fn tiny() -> Self {
        Self { sequences: 2, images: 40, label_every: 20, ..Self::rhdd() }
    }

    /// The dataset of the SCSim paper: 30 scenes of 500 images, one readout per image.
    #[must_use]
    pub const fn rhdd() -> Self {
        Self {
            sequences: 30,
            images: 500,
            readouts_per_image: 1,
            label_every: 25,
            lighting: None,
            flicker_hz: None,
            vehicles: None,
            speed_kmh: None,
            white_cd_m2: None,
            samples: Samples::Four,
            npy: false,
            kitti: false,
            exr: false,
        }
    }

    /// Readouts of one sequence.
    #[must_use]
    pub fn readouts(&self) -> u64 {
        u64::from(self.images) * u64::from(self.readouts_per_image)
    }
}

/// Videos and image folders below a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs {
    /// Where they lie.
    pub folder: PathBuf,
    /// Readouts of every frame; `None` as its times or rate say, see [`crate::light::Pace`].
    pub readouts_per_frame: Option<u64>,
    /// Light between frames.
    pub insertion: Insertion,
    /// How frames come to the camera's size.
    pub fit: Fit,
    /// Declared transfer function.
    pub transfer: Option<Transfer>,
}

/// Where the light of a dataset comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// Driving scenes.
    Drives(Drives),
    /// Given pictures.
    Inputs(Inputs),
}

/// A dataset.
#[derive(Clone, Debug)]
pub struct Options {
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

/// What a dataset will take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

impl Options {
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
                sequence::scene_options(self, drives)?.check()
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
                    "samples": if d.samples == Samples::Four { 4 } else { 16 }, "npy": d.npy,
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
            "ground_truth": truth::facts(self.structure),
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
