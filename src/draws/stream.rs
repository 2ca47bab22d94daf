//! Names of draws: the stream of an effect, and the seeds of a run.

use super::mix::mix64;

/// The stream of an effect: a number derived from its canonical name, so that
/// adding an effect never changes another's draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Stream(u64);

impl Stream {
    /// The stream named `name` (FNV-1a, then a finaliser).
    #[must_use]
    pub const fn named(name: &str) -> Self {
        let bytes = name.as_bytes();
        let mut h = 0xcbf2_9ce4_8422_2325_u64;
        let mut i = 0;
        while i < bytes.len() {
            h = (h ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
            i += 1;
        }
        Self(mix64(h))
    }

    /// The number that enters the hash.
    #[must_use]
    pub const fn id(self) -> u64 {
        self.0
    }
}

/// What fixes all randomness of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Seeds {
    /// Fixes the fixed pattern: which camera it is.
    pub camera: u64,
    /// Fixes the temporal noise, together with [`Seeds::sequence`].
    pub shot: u64,
    /// Tells recordings of one camera apart.
    pub sequence: u64,
}
