//! Streams of random draws, and the seeds of a run.

use super::mix::mix64;

/// The stream of random draws of an effect. Its number is derived from the name of the effect.
///
/// The number depends only on the name, so a new effect never changes the draws of another effect.
///
/// # Examples
/// ```
/// use spikelane::{RandomStream, effects};
/// let stream = RandomStream::from_name("prnu");
/// assert_eq!(effects::find("prnu")?.stream(), stream);
/// assert_ne!(RandomStream::from_name("dark_current"), stream);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RandomStream(u64);

impl RandomStream {
    /// Returns the stream named `name`. Its number is the FNV-1a hash of the name after a finalizer.
    ///
    /// # Examples
    /// ```
    /// use spikelane::RandomStream;
    /// const MY_NOISE: RandomStream = RandomStream::from_name("my_noise");
    /// assert_ne!(MY_NOISE.id(), RandomStream::from_name("my_noise/fine").id());
    /// ```
    #[must_use]
    pub const fn from_name(name: &str) -> Self {
        let bytes = name.as_bytes();
        let mut h = 0xcbf2_9ce4_8422_2325_u64;
        let mut i = 0;
        while i < bytes.len() {
            h = (h ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
            i += 1;
        }
        Self(mix64(h))
    }

    /// Returns the number of the stream, which is an input of the hash.
    #[must_use]
    pub const fn id(self) -> u64 {
        self.0
    }
}

/// The seeds that determine all random draws of a run.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, Simulator, effects};
/// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?).with_effect(effects::find("shot_noise")?.typical());
/// let record = |seeds| Simulator::new(&camera, seeds)?.run(&[51u8; 32 * 24], 20);
///
/// let seeds = Seeds { camera: 1, shot: 2, sequence: 0 };
/// assert_eq!(record(seeds)?, record(seeds)?);
/// // The next recording of this camera has other noise.
/// assert_ne!(record(Seeds { sequence: 1, ..seeds })?, record(seeds)?);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Seeds {
    /// Seed of the fixed pattern, which identifies the camera.
    pub camera: u64,
    /// Seed of the temporal noise, together with [`Seeds::sequence`].
    pub shot: u64,
    /// Number of the recording. Each recording of a camera has a different number.
    pub sequence: u64,
}
