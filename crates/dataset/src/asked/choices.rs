//! What follows from a sequence's name: its seeds, its light, its camera, and what it is for.

use super::cameras::Cameras;
use super::options::DatasetOptions;
use super::splits::{Split, Splits};
use super::work::Work;
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::draws::hash::mix64;
use spikelane::unstable::draws::{Seeds, Stream};
use spikelane_scene::Lighting;

impl DatasetOptions {
    /// Seeds of sequence `id`: its camera's, and noise of its own.
    #[must_use]
    pub fn seeds(&self, id: &str) -> Seeds {
        Seeds { camera: self.camera_seed_of(id), shot: self.seed, sequence: Stream::named(id).id() }
    }

    /// Seed of the scene of sequence `id`.
    #[must_use]
    pub fn seed_of_scene(&self, id: &str) -> u64 {
        mix64(mix64(self.scene_seed) ^ Stream::named(&format!("scene {id}")).id())
    }

    /// The light of the scene of sequence `id`; meaningless for given inputs.
    fn light_of(&self, id: &str) -> Lighting {
        self.chosen_light(id).unwrap_or_else(|| Lighting::drawn(self.seed_of_scene(id)))
    }

    /// The light of the scene of sequence `id`, where the dataset says which are to choose from.
    pub(crate) fn chosen_light(&self, id: &str) -> Option<Lighting> {
        let Work::Drives(drives) = &self.work else { return None };
        let draw = mix64(mix64(self.scene_seed) ^ Stream::named(&format!("light {id}")).id());
        let index = draw.checked_rem(drives.lighting.len() as u64)?;
        drives.lighting.get(index as usize).copied()
    }

    /// The name of sequence `index` of drawn scenes: as many digits as the last one needs, four at least.
    #[must_use]
    pub fn scene_id(&self, index: u64) -> String {
        let sequences = if let Work::Drives(drives) = &self.work { drives.sequences } else { 0 };
        let width = sequences.saturating_sub(1).to_string().len().max(4);
        format!("scene-{index:0width$}")
    }

    /// A number that follows from the camera seed and a sequence's name.
    fn camera_draw(&self, id: &str) -> u64 {
        mix64(mix64(self.camera_seed) ^ Stream::named(&format!("camera {id}")).id())
    }

    /// Which of `n` cameras takes sequence `id`.
    fn camera_index(&self, id: &str, n: usize) -> usize {
        (self.camera_draw(id) % n.max(1) as u64) as usize
    }

    /// Seed of the fixed pattern of sequence `id`: each of several cameras has one, and so has each drawn one.
    #[must_use]
    pub fn camera_seed_of(&self, id: &str) -> u64 {
        match &self.cameras {
            Cameras::One => self.camera_seed,
            Cameras::Several(all) => self.camera_seed.wrapping_add(self.camera_index(id, all.len()) as u64),
            Cameras::Drawn(_) => self.camera_draw(id),
        }
    }

    /// The camera that takes sequence `id`.
    ///
    /// # Errors
    /// [`spikelane::Kind::Config`] when the numbers drawn make no camera together.
    pub fn camera_of(&self, id: &str) -> Result<Camera> {
        match &self.cameras {
            Cameras::One => Ok(self.camera.clone()),
            Cameras::Several(all) => {
                Ok(all.get(self.camera_index(id, all.len())).unwrap_or(&self.camera).clone())
            }
            Cameras::Drawn(distribution) => {
                let mut camera = distribution.draw(self.camera_draw(id))?;
                camera.sensor.geometry = self.camera.sensor.geometry;
                camera.sensor.readout_hz = self.camera.sensor.readout_hz;
                Ok(camera)
            }
        }
    }

    /// The options with which sequence `id` is made: its own camera alone.
    pub(crate) fn of_sequence(&self, id: &str) -> Result<Self> {
        Ok(Self { camera: self.camera_of(id)?, ..self.clone() })
    }

    fn split_draw(&self, id: &str) -> u64 {
        mix64(mix64(self.scene_seed) ^ Stream::named(&format!("split {id}")).id())
    }

    /// What each of `ids`, all sequences of the dataset, is for.
    ///
    /// Of scenes, whose number is fixed, exactly the shares, rounded (and at least one for training and for
    /// testing, if the test share is neither 0 nor 1 and there are two): those with the lowest draws are for
    /// testing, the next for validation. Split by light, every light gives its share to within one scene. Of given
    /// inputs each one draws on its own, so that an input added later moves no other one.
    #[must_use]
    pub fn splits(&self, ids: &[String]) -> Vec<Split> {
        if matches!(self.work, Work::Inputs(_)) {
            return ids.iter().map(|id| self.split_alone(id)).collect();
        }
        self.split_named(ids.len(), &|i| ids[i].clone())
    }

    /// What each of the dataset's drawn scenes is for, by its number.
    pub(crate) fn scene_splits(&self) -> Vec<Split> {
        let Work::Drives(drives) = &self.work else { return Vec::new() };
        self.split_named(drives.sequences as usize, &|i| self.scene_id(i as u64))
    }

    fn split_named(&self, n: usize, id: &dyn Fn(usize) -> String) -> Vec<Split> {
        let Splits { validation, test, by_light } = self.splits;
        let both = test > 0.0 && test < 1.0 && n > 1;
        let tests = (test * n as f64).round() as usize;
        let tests = if both { tests.clamp(1, n - 1) } else { tests };
        let validations = ((validation * n as f64).round() as usize).min(n - tests);
        let place = |i: usize| {
            let id = id(i);
            (if by_light { self.light_of(&id) as usize } else { 0 }, self.split_draw(&id), i)
        };
        let mut order: Vec<(usize, u64, usize)> = (0..n).map(place).collect();
        order.sort_unstable();
        let mut all = vec![Split::Train; n];
        let mut left: Vec<usize> = order.into_iter().map(|(.., i)| i).collect();
        for (split, wanted) in [(Split::Test, tests), (Split::Validation, validations)] {
            let of = left.len();
            let mut place = 0;
            left.retain(|&i| {
                let chosen = if by_light { spread(place, wanted, of) } else { place < wanted };
                place += 1;
                if chosen {
                    all[i] = split;
                }
                !chosen
            });
        }
        all
    }

    /// The split of an input, which depends on nothing but its name.
    pub(crate) fn split_alone(&self, id: &str) -> Split {
        let share = (self.split_draw(id) >> 11) as f64 / (1u64 << 53) as f64;
        if share >= 1.0 - self.splits.test {
            Split::Test
        } else if share >= 1.0 - self.splits.test - self.splits.validation {
            Split::Validation
        } else {
            Split::Train
        }
    }
}

/// Whether place `p` of `n` is one of `wanted` at even distances; of any run of m places m wanted / n are, to
/// within one.
fn spread(p: usize, wanted: usize, n: usize) -> bool {
    let before = |p: usize| p as u128 * wanted as u128 / n as u128;
    before(p + 1) > before(p)
}
