//! Properties of a sequence that its name determines. These are its seeds, its lighting, its camera, and its split.

use super::cameras::Cameras;
use super::content::Content;
use super::options::DatasetOptions;
use super::splits::{Split, Splits};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::draws::hash::mix64;
use spikelane::unstable::draws::{RandomStream, Seeds};
use spikelane_scene::Lighting;

impl DatasetOptions {
    /// Returns the seeds of the camera and the noise of sequence `id`.
    #[must_use]
    pub fn seeds(&self, id: &str) -> Seeds {
        Seeds {
            camera: self.camera_seed_for(id),
            shot: self.seed,
            sequence: RandomStream::from_name(id).id(),
        }
    }

    /// Returns the scene seed of sequence `id`.
    #[must_use]
    pub fn scene_seed_for(&self, id: &str) -> u64 {
        mix64(mix64(self.scene_seed) ^ RandomStream::from_name(&format!("scene {id}")).id())
    }

    /// Returns the lighting of the scene of sequence `id`. The result has no meaning for inputs.
    fn scene_lighting(&self, id: &str) -> Lighting {
        self.listed_lighting(id).unwrap_or_else(|| Lighting::from_seed(self.scene_seed_for(id)))
    }

    /// Returns the lighting preset that the name `id` selects from the dataset's list. Returns `None` if the dataset
    /// has no list.
    pub(crate) fn listed_lighting(&self, id: &str) -> Option<Lighting> {
        let Content::Scenes(drives) = &self.content else { return None };
        let draw = mix64(mix64(self.scene_seed) ^ RandomStream::from_name(&format!("light {id}")).id());
        let index = draw.checked_rem(drives.lighting.len() as u64)?;
        drives.lighting.get(index as usize).copied()
    }

    /// Returns the name of scene `index`. The name has four digits, or more if the number of the last scene has more
    /// digits.
    #[must_use]
    pub fn scene_id(&self, index: u64) -> String {
        let sequences = if let Content::Scenes(drives) = &self.content { drives.sequences } else { 0 };
        let width = sequences.saturating_sub(1).to_string().len().max(4);
        format!("scene-{index:0width$}")
    }

    /// Returns a random number that depends only on the camera seed and on the name of a sequence.
    fn camera_random_number(&self, id: &str) -> u64 {
        mix64(mix64(self.camera_seed) ^ RandomStream::from_name(&format!("camera {id}")).id())
    }

    /// Returns the index of the camera that records sequence `id`. There are `n` cameras.
    fn camera_index(&self, id: &str, n: usize) -> usize {
        (self.camera_random_number(id) % n.max(1) as u64) as usize
    }

    /// Returns the seed of the fixed pattern of the camera that records sequence `id`.
    ///
    /// Each camera of a list has its own seed, and each drawn camera has its own seed.
    #[must_use]
    pub fn camera_seed_for(&self, id: &str) -> u64 {
        match &self.cameras {
            Cameras::Single => self.camera_seed,
            Cameras::List(all) => self.camera_seed.wrapping_add(self.camera_index(id, all.len()) as u64),
            Cameras::Distribution(_) => self.camera_random_number(id),
        }
    }

    /// Returns the camera that records sequence `id`.
    ///
    /// # Errors
    /// [`ErrorKind::Config`](spikelane::ErrorKind::Config) if the drawn parameters do not form a valid camera.
    pub fn camera_for(&self, id: &str) -> Result<Camera> {
        match &self.cameras {
            Cameras::Single => Ok(self.camera.clone()),
            Cameras::List(all) => {
                Ok(all.get(self.camera_index(id, all.len())).unwrap_or(&self.camera).clone())
            }
            Cameras::Distribution(distribution) => {
                let mut camera = distribution.draw(self.camera_random_number(id))?;
                camera.sensor.geometry = self.camera.sensor.geometry;
                camera.sensor.readout_hz = self.camera.sensor.readout_hz;
                Ok(camera)
            }
        }
    }

    /// Returns the options for sequence `id`. The field `camera` of the returned options is the camera that records
    /// this sequence.
    pub(crate) fn for_sequence(&self, id: &str) -> Result<Self> {
        Ok(Self { camera: self.camera_for(id)?, ..self.clone() })
    }

    fn split_random_number(&self, id: &str) -> u64 {
        mix64(mix64(self.scene_seed) ^ RandomStream::from_name(&format!("split {id}")).id())
    }

    /// Returns the split of each sequence in `ids`. `ids` must contain all sequences of the dataset.
    ///
    /// For scenes, the number of sequences in each split is the specified fraction of all scenes, rounded. If the
    /// dataset has two or more scenes, at least one scene is for testing and at least one is not. This rule does not
    /// apply to the test fractions 0 and 1. Each scene has a random number. Scenes with the smallest random numbers are
    /// for testing, and scenes with the next random numbers are for validation. If the splits are stratified by
    /// lighting, each split contains the specified fraction of the scenes of every preset. The deviation is at most one
    /// scene.
    ///
    /// The split of each input is drawn independently. If inputs are added later, the splits of the existing inputs do
    /// not change.
    #[must_use]
    pub fn splits(&self, ids: &[String]) -> Vec<Split> {
        if matches!(self.content, Content::Inputs(_)) {
            return ids.iter().map(|id| self.input_split(id)).collect();
        }
        self.assign_splits(ids.len(), &|i| ids[i].clone())
    }

    /// Returns the split of each scene, indexed by scene number.
    pub(crate) fn scene_splits(&self) -> Vec<Split> {
        let Content::Scenes(drives) = &self.content else { return Vec::new() };
        self.assign_splits(drives.sequences as usize, &|i| self.scene_id(i as u64))
    }

    fn assign_splits(&self, n: usize, id: &dyn Fn(usize) -> String) -> Vec<Split> {
        let Splits { validation, test, stratify_by_lighting: by_light } = self.splits;
        let both = test > 0.0 && test < 1.0 && n > 1;
        let tests = (test * n as f64).round() as usize;
        let tests = if both { tests.clamp(1, n - 1) } else { tests };
        let validations = ((validation * n as f64).round() as usize).min(n - tests);
        let place = |i: usize| {
            let id = id(i);
            (if by_light { self.scene_lighting(&id) as usize } else { 0 }, self.split_random_number(&id), i)
        };
        let mut order: Vec<(usize, u64, usize)> = (0..n).map(place).collect();
        order.sort_unstable();
        let mut all = vec![Split::Train; n];
        let mut left: Vec<usize> = order.into_iter().map(|(.., i)| i).collect();
        for (split, wanted) in [(Split::Test, tests), (Split::Validation, validations)] {
            let remaining = left.len();
            let mut place = 0;
            left.retain(|&i| {
                let chosen =
                    if by_light { is_evenly_spaced(place, wanted, remaining) } else { place < wanted };
                place += 1;
                if chosen {
                    all[i] = split;
                }
                !chosen
            });
        }
        all
    }

    /// Returns the split of an input. The split depends on the name of the input, but not on other inputs.
    pub(crate) fn input_split(&self, id: &str) -> Split {
        let share = (self.split_random_number(id) >> 11) as f64 / (1u64 << 53) as f64;
        if share >= 1.0 - self.splits.test {
            Split::Test
        } else if share >= 1.0 - self.splits.test - self.splits.validation {
            Split::Validation
        } else {
            Split::Train
        }
    }
}

/// Returns whether position `p` is one of `wanted` positions that are evenly spaced among `n` positions.
///
/// Any m consecutive positions contain m * wanted / n evenly spaced positions, with a deviation of at most one.
fn is_evenly_spaced(p: usize, wanted: usize, n: usize) -> bool {
    let before = |p: usize| p as u128 * wanted as u128 / n as u128;
    before(p + 1) > before(p)
}
