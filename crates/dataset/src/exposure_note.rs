//! A note about generated sequences whose light is outside the range of the camera.

use spikelane::simulate::ExposureFault;
use spikelane::unstable::Count;

/// The faults of the generated sequences. A data set can have a million sequences, so there is one note for all.
#[derive(Default)]
pub(super) struct ExposureFaults {
    first: Option<(String, ExposureFault)>,
    faulty: u64,
    sequences: u64,
}

impl ExposureFaults {
    /// Adds the fault of the sequence `id`, if any.
    pub(super) fn add(&mut self, id: &str, fault: Option<ExposureFault>) {
        self.sequences += 1;
        if let Some(fault) = fault {
            self.faulty += 1;
            self.first.get_or_insert_with(|| (id.to_owned(), fault));
        }
    }

    /// Returns one line about all faults.
    pub(super) fn note(&self) -> Option<String> {
        let (id, fault) = self.first.as_ref()?;
        let warning = fault.warning(id);
        let sequences = Count(self.sequences, "generated sequence");
        Some(if self.sequences == 1 {
            warning.to_string()
        } else {
            format!("{} of {sequences} have unsuitable light: {warning}", self.faulty)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::{Camera, Seeds, Sensor, Simulator};

    #[test]
    fn one_line_names_the_first_sequence_and_the_number_of_sequences() {
        let mut simulator =
            Simulator::new(&Camera::ideal(Sensor::new(8, 1, 20_000.0).unwrap()), Seeds::default()).unwrap();
        simulator.run(&[255_u8; 8], 40).unwrap();
        let mut faults = ExposureFaults::default();
        faults.add("a", None);
        assert_eq!(faults.note(), None);
        faults.add("b", simulator.exposure_fault());
        faults.add("c", simulator.exposure_fault());
        let note = faults.note().unwrap();
        assert!(
            note.starts_with("2 of 3 generated sequences have unsuitable light: b: found 100 %"),
            "{note}"
        );
    }
}
