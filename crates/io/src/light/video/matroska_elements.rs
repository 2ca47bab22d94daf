//! Elements of Matroska and WebM files that ffprobe does not report (RFC 9559).

use spikelane::unstable::inputs::InputFile;

/// Maximum size of the description of the tracks that is read.
const MAX_TRACKS_BYTES: u64 = 1 << 24;

const SEGMENT: u64 = 0x1853_8067;
const TRACKS: u64 = 0x1654_AE6B;
const TRACK: u64 = 0xAE;
const VIDEO: u64 = 0xE0;
const PIXEL_WIDTH: u64 = 0xB0;
const PIXEL_HEIGHT: u64 = 0xBA;
const PIXEL_CROP: [[u64; 2]; 2] = [[0x54CC, 0x54DD], [0x54BB, 0x54AA]];

/// Returns the width and height that the first video track shows if it crops its frames (`PixelCrop*`).
pub(super) fn cropped_size(file: &InputFile) -> Option<(u32, u32)> {
    let mut at = 0;
    while at < file.len() {
        // An identifier and a size have at most 12 bytes.
        let mut head = [0; 12];
        let head = &mut head[..(file.len() - at).min(12) as usize];
        file.read_at(at, head).ok()?;
        let (id, size, header) = element_head(head)?;
        at += header as u64;
        if id == TRACKS && size.is_some_and(|size| size <= MAX_TRACKS_BYTES) {
            let mut bytes = vec![0; size?.min(file.len() - at) as usize];
            file.read_at(at, &mut bytes).ok()?;
            return crop(&bytes);
        }
        // The elements of a segment follow its head, and a segment can have an unknown size.
        if id != SEGMENT {
            at = at.checked_add(size?)?;
        }
    }
    None
}

fn crop(tracks: &[u8]) -> Option<(u32, u32)> {
    let video = Elements(tracks).filter(|(id, _)| *id == TRACK).find_map(|(_, track)| child(track, VIDEO))?;
    let number = |id: u64| {
        let bytes = child(video, id).filter(|bytes| bytes.len() <= 4).unwrap_or_default();
        bytes.iter().fold(0, |all, byte| all << 8 | u32::from(*byte))
    };
    let [cropped_columns, cropped_rows] =
        PIXEL_CROP.map(|ids| ids.map(number).into_iter().fold(0, u32::saturating_add));
    let size = (
        number(PIXEL_WIDTH).saturating_sub(cropped_columns),
        number(PIXEL_HEIGHT).saturating_sub(cropped_rows),
    );
    (cropped_columns > 0 || cropped_rows > 0).then_some(size)
}

fn child(element: &[u8], id: u64) -> Option<&[u8]> {
    Elements(element).find(|(found, _)| *found == id).map(|(_, data)| data)
}

/// The identifiers and data of consecutive elements.
struct Elements<'a>(&'a [u8]);

impl<'a> Iterator for Elements<'a> {
    type Item = (u64, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (id, size, header) = element_head(self.0)?;
        let data = self.0[header..].get(..usize::try_from(size?).ok()?)?;
        self.0 = &self.0[header + data.len()..];
        Some((id, data))
    }
}

/// Returns the identifier, the size (`None` if it is unknown) and the length of the head of an element.
fn element_head(bytes: &[u8]) -> Option<(u64, Option<u64>, usize)> {
    let number = |bytes: &[u8]| {
        let len = bytes.first()?.leading_zeros() as usize + 1;
        let value = bytes.get(..len)?.iter().fold(0_u64, |all, byte| all << 8 | u64::from(*byte));
        (len <= 8).then_some((value, len))
    };
    let (id, id_len) = number(bytes)?;
    let (marked, len) = number(&bytes[id_len..])?;
    // The first bit that is set marks the length. A number of ones means an unknown size.
    let size = marked & ((1 << (7 * len)) - 1);
    Some((id, (size != (1 << (7 * len)) - 1).then_some(size), id_len + len))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(id: u64, data: &[u8]) -> Vec<u8> {
        let id: Vec<u8> = id.to_be_bytes().into_iter().skip_while(|byte| *byte == 0).collect();
        [&id, &(0x1000_0000 | data.len() as u32).to_be_bytes()[..], data].concat()
    }

    fn cropped(bytes: &[u8]) -> Option<(u32, u32)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.mkv");
        std::fs::write(&path, bytes).unwrap();
        cropped_size(&InputFile::open(&path).unwrap())
    }

    fn file(video: &[(u64, &[u8])]) -> Vec<u8> {
        let video: Vec<u8> = video.iter().flat_map(|(id, data)| element(*id, data)).collect();
        let sound = element(TRACK, &element(0xE1, &[]));
        let tracks = [sound, element(TRACK, &element(VIDEO, &video))].concat();
        let tracks = element(TRACKS, &tracks);
        // A segment of unknown size.
        let segment =
            [&[0x18, 0x53, 0x80, 0x67, 0x01][..], &[0xFF; 7], &element(0xEC, &[0; 3]), &tracks].concat();
        [element(0x1A45_DFA3, &[1, 2, 3]), segment].concat()
    }

    #[test]
    fn the_size_after_the_crop_is_found() {
        let size: [(u64, &[u8]); 2] = [(PIXEL_WIDTH, &[1, 0x40]), (PIXEL_HEIGHT, &[240])];
        assert_eq!(cropped(&file(&size)), None);
        let all: Vec<_> =
            size.into_iter().chain([(0x54AA, &[10][..]), (0x54BB, &[20]), (0x54DD, &[6])]).collect();
        let whole = file(&all);
        assert_eq!(cropped(&whole), Some((314, 210)));
        for len in 0..whole.len() {
            let cut = cropped(&whole[..len]);
            assert!(cut.is_none() || len > whole.len() - 40, "{len}: {cut:?}");
        }
    }

    #[test]
    fn any_file_is_read() {
        for bytes in
            [&b""[..], b"\0", b"\0\0\0\0\0\0\0\0\0\0\0\0\0\0", &[0xFF; 40], b"RIFF\xff\xff\xff\xffAVI "]
        {
            assert_eq!(cropped(bytes), None, "{bytes:?}");
        }
    }
}
