//! A run as bytes that say what they belong to: the state, the camera and the seeds. Python and C write the same.

use crate::error::{Error, Kind, Result};
use crate::plan::State;
use crate::presets::key;
use crate::simulate::Simulator;

/// Before a saved state: the format and its version.
const MAGIC: &[u8; 8] = b"spkrun02";

/// After the magic, 64-bit words, little-endian: the camera's key, its three seeds, the greatest light.
const HEADER: usize = 8 + 5 * 8;

/// After the header: the [`key`] of the bytes that follow, which are the state.
const KEY: usize = 8;

impl Simulator {
    /// All that it remembers, and what that belongs to; [`Simulator::restore`] goes on from it. `camera` is the
    /// [`crate::presets::key`] of the camera's bytes.
    #[must_use]
    pub fn save(&self, camera: u64) -> Vec<u8> {
        let mut bytes = header(self, camera);
        let state = self.state().to_bytes();
        bytes.extend(key(&state).to_le_bytes());
        bytes.extend(state);
        bytes
    }

    /// Goes on from bytes of [`Simulator::save`], with the same bits.
    ///
    /// # Errors
    /// [`Kind::Usage`] for bytes of another version, camera, seeds or greatest light, [`Kind::Corrupt`] for bytes that
    /// changed since they were saved, [`Kind::Input`] for a state that no run leaves behind; nothing has changed then.
    pub fn restore(&mut self, camera: u64, bytes: &[u8]) -> Result<()> {
        let bad = |found: &str| {
            Error::new(Kind::Usage, "saved state")
                .found(found)
                .expected("a state of this camera and these seeds")
                .remedy("make the simulator with the same arguments")
        };
        let header = header(self, camera);
        if !bytes.starts_with(MAGIC) || bytes.len() < HEADER + KEY {
            let version = bytes.starts_with(&MAGIC[..6]);
            return Err(if version {
                bad("a state of another version").remedy("save it with this version: simulate from the start")
            } else {
                bad("other bytes")
            });
        }
        let (own, rest) = bytes.split_at(HEADER);
        for (part, found) in [
            (8..16, "a state of another camera"),
            (16..40, "a state of other seeds"),
            (40..HEADER, "a state for another greatest light"),
        ] {
            if own[part.clone()] != header[part] {
                return Err(bad(found));
            }
        }
        let (stored, rest) = rest.split_at(KEY);
        if stored != key(rest).to_le_bytes() {
            return Err(Error::new(Kind::Corrupt, "saved state")
                .found("bytes that do not match their key")
                .expected("the bytes that were saved")
                .remedy("save it again, or simulate from the start"));
        }
        let state = State::from_bytes(rest, &self.plan().start())?;
        self.resume(state)
    }
}

fn header(simulator: &Simulator, camera: u64) -> Vec<u8> {
    let (seeds, light) = (simulator.plan().seeds(), simulator.plan().greatest_light());
    let mut bytes = MAGIC.to_vec();
    let words = [camera, seeds.camera, seeds.shot, seeds.sequence, light.to_bits()];
    words.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    bytes
}
