//! Streams of random draws, and the seeds of a run.

use super::mix::mix64;

/// The stream of random draws of an effect. Its number is derived from the name of the effect.
///
/// The number depends only on the name, so a new effect never changes the draws of another effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RandomStream(u64);

impl RandomStream {
    /// Returns the stream named `name`. Its number is the FNV-1a hash of the name after a finalizer.
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
