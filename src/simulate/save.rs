//! Saved runs: the state of a simulator, and the identity of its camera and seeds. The Python and C libraries use the
//! same format.

use crate::error::{Result, bail, error};
use crate::plan::SimulatorState;
use crate::presets::fingerprint;
use crate::simulate::Simulator;

/// The first bytes of a saved run. They identify the format and its version.
const MAGIC: &[u8; 8] = b"spkrun02";

/// Length in bytes of the magic and the header. The header contains five little-endian 64-bit words: the fingerprint of
/// the camera, the three seeds, and the maximum light.
const HEADER_BYTES: usize = 8 + 5 * 8;

/// Length in bytes of the [`fingerprint`] after the header. It is the fingerprint of the bytes of the state, which are
/// last in the saved run.
const FINGERPRINT_BYTES: usize = 8;

impl Simulator {
    /// Returns the state of this simulator, its seeds and its maximum light as bytes. [`Simulator::restore`] reads these
    /// bytes.
    ///
    /// `camera_fingerprint` is the [`crate::presets::fingerprint`] of the bytes of the camera.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Seeds, Simulator, presets};
    /// let mut camera = presets::builtin("scsim-paper")?;
    /// camera.sensor.geometry = spikelane::Geometry::new(32, 24)?;
    /// let fingerprint = presets::fingerprint(&presets::to_bytes(&camera)?);
    /// let light = [51u8; 32 * 24];
    ///
    /// let mut simulator = Simulator::new(&camera, Seeds::default())?;
    /// simulator.run(&light, 7)?;
    /// let saved = simulator.save(fingerprint);
    ///
    /// let mut resumed = Simulator::new(&camera, Seeds::default())?;
    /// resumed.restore(fingerprint, &saved)?;
    /// assert_eq!(resumed.run(&light, 20)?, simulator.run(&light, 20)?);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn save(&self, camera_fingerprint: u64) -> Vec<u8> {
        let mut bytes = header(self, camera_fingerprint);
        let state = self.state().to_bytes();
        bytes.extend(fingerprint(&state).to_le_bytes());
        bytes.extend(state);
        bytes
    }

    /// Restores the state from the result of [`Simulator::save`]. This simulator then returns the bits that the saved
    /// simulator would have returned next.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, ErrorKind, Seeds, Sensor, Simulator};
    /// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
    /// let saved = Simulator::new(&camera, Seeds { sequence: 1, ..Seeds::default() })?.save(0);
    ///
    /// let error = Simulator::new(&camera, Seeds::default())?.restore(0, &saved).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Usage);
    /// assert_eq!(error.parts().found, "a state of other seeds");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the call fails, this simulator is unchanged. Returns
    /// * [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the version, the camera, the seeds or the maximum light differ.
    /// * [`ErrorKind::Corrupt`](crate::ErrorKind::Corrupt) if the bytes have changed since they were saved.
    /// * [`ErrorKind::Input`](crate::ErrorKind::Input) if no run can produce the state.
    pub fn restore(&mut self, camera_fingerprint: u64, bytes: &[u8]) -> Result<()> {
        let bad = |found: &str| {
            error!(Usage, "saved state"; found "{found}"; expected "a state of this camera and these seeds";
                remedy "create the simulator with the arguments of the saved run")
        };
        let header = header(self, camera_fingerprint);
        if !bytes.starts_with(MAGIC) || bytes.len() < HEADER_BYTES + FINGERPRINT_BYTES {
            let version = bytes.starts_with(&MAGIC[..6]);
            return Err(if version {
                bad("a state of another version")
                    .remedy("simulate from the start and save the state with this version")
            } else {
                bad("other data")
            });
        }
        let (own, rest) = bytes.split_at(HEADER_BYTES);
        for (part, found) in [
            (8..16, "a state of another camera"),
            (16..40, "a state of other seeds"),
            (40..HEADER_BYTES, "a state with another max light"),
        ] {
            if own[part.clone()] != header[part] {
                return Err(bad(found));
            }
        }
        let (stored, rest) = rest.split_at(FINGERPRINT_BYTES);
        if stored != fingerprint(rest).to_le_bytes() {
            bail!(Corrupt, "saved state"; found "data that does not match its checksum";
                expected "unchanged data of a saved state";
                remedy "save the state again, or simulate from the start");
        }
        let state = SimulatorState::from_bytes(rest, &self.plan().initial_state())?;
        self.set_state(state)
    }
}

fn header(simulator: &Simulator, camera: u64) -> Vec<u8> {
    let (seeds, light) = (simulator.plan().seeds(), simulator.plan().max_light());
    let mut bytes = MAGIC.to_vec();
    let words = [camera, seeds.camera, seeds.shot, seeds.sequence, light.to_bits()];
    words.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    bytes
}
