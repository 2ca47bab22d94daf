//! Where readouts are lost and repeated, and recordings that have them there.

use spikelane::effects::{Definition, EventKind};

/// Kinds of what happens to whole readouts: lost ones, repeated ones.
pub(in crate::diagnose) const KINDS: usize = 2;

/// Where they are in a recording, one kind after the other; `None` where they cannot be told. A lost readout is said by the
/// first one behind it.
pub(in crate::diagnose) type Places = [Option<Vec<usize>>; KINDS];

/// The kind of an effect that happens to whole readouts.
pub(in crate::diagnose) fn kind(effect: &Definition) -> Option<usize> {
    match effect.event_kind? {
        EventKind::DroppedReadouts => Some(0),
        EventKind::RepeatedReadouts => Some(1),
        EventKind::Pixels => None,
    }
}

/// Loses and repeats readouts of a recording that has as many more as are lost.
pub(in crate::diagnose) fn put_in(
    frames: &mut Vec<u8>,
    bytes: usize,
    places: &[Option<&[usize]>; KINDS],
    skip: usize,
) {
    let lost = places[0].unwrap_or(&[]);
    for (before, place) in lost.iter().enumerate().rev() {
        let at = (skip + place + before) * bytes;
        frames.drain(at..at + bytes);
    }
    for place in places[1].unwrap_or(&[]) {
        let at = (skip + place) * bytes;
        frames.copy_within(at - bytes..at, at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_loses_and_repeats_the_readouts_that_it_is_told_to() {
        // Readouts of two bytes, of which the first is skipped; 1, 4 and 5 of the others are lost.
        let frames: Vec<u8> = (0..11_u8).flat_map(|t| [t, t]).collect();
        let put = |lost: &[usize], repeated: &[usize]| {
            let mut frames = frames.clone();
            put_in(&mut frames, 2, &[Some(lost), Some(repeated)], 1);
            frames.chunks(2).map(|f| f[0]).collect::<Vec<u8>>()
        };
        assert_eq!(put(&[1, 3, 3], &[]), [0, 1, 3, 4, 7, 8, 9, 10]);
        // A readout that repeats one that is a copy itself is the same once more.
        assert_eq!(put(&[1, 3, 3], &[1, 2, 5]), [0, 1, 1, 1, 7, 8, 8, 10]);
        assert_eq!(put(&[], &[]).len(), 11);
    }
}
