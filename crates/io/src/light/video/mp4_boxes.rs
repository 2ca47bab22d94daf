//! Boxes of MP4 and QuickTime files that ffprobe does not report.

use std::io::{Read, Seek, SeekFrom};

use spikelane::unstable::inputs::InputFile;

/// Maximum size of a box that is read. The box `moov` has about 20 bytes per frame.
const MAX_BOX_BYTES: u64 = 1 << 25;

/// What the boxes state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mp4Boxes {
    /// The frames per second that a Sony camera captured: `captureFps` in the XML of the box `meta`.
    pub capture_hz: Option<f64>,
    /// Width and height of the clean aperture in pixels (box `clap`).
    pub clean_aperture: Option<(u32, u32)>,
}

/// Reads the boxes of a file. Files of other formats have none.
pub(super) fn read(file: &InputFile) -> Mp4Boxes {
    let mut found = Mp4Boxes::default();
    let (len, mut reader) = (file.len(), file.reader());
    let mut at = 0;
    while at < len {
        let mut head = [0; 16];
        let has_head =
            reader.seek(SeekFrom::Start(at)).and_then(|_| reader.read_exact(&mut head[..8])).is_ok();
        let kind = [head[4], head[5], head[6], head[7]];
        if !has_head || !kind.iter().all(|byte| byte.is_ascii_graphic() || *byte == b' ') {
            break;
        }
        let (mut size, mut header) = (u64::from(u32::from_be_bytes([head[0], head[1], head[2], head[3]])), 8);
        if size == 1 {
            if reader.read_exact(&mut head[8..]).is_err() {
                break;
            }
            size = head[8..].iter().fold(0, |all, byte| all << 8 | u64::from(*byte));
            header = 16;
        } else if size == 0 {
            size = len - at;
        }
        if size < header {
            break;
        }
        let body = size - header;
        if matches!(&kind, b"meta" | b"uuid" | b"moov") && body <= MAX_BOX_BYTES {
            let mut bytes = Vec::new();
            if reader.by_ref().take(body).read_to_end(&mut bytes).is_err() {
                break;
            }
            if &kind == b"moov" {
                found.clean_aperture = found.clean_aperture.or_else(|| clean_aperture(&bytes));
            } else {
                found.capture_hz = found.capture_hz.or_else(|| capture_hz(&bytes));
            }
        }
        at = at.saturating_add(size);
    }
    found
}

/// Returns the position after the first `name` in `bytes`.
fn after(bytes: &[u8], name: &[u8]) -> Option<usize> {
    bytes.windows(name.len()).position(|part| part == name).map(|at| at + name.len())
}

/// Returns the rate in the attribute `captureFps="240.00p"`.
fn capture_hz(xml: &[u8]) -> Option<f64> {
    let start = after(xml, b"captureFps=\"")?;
    let text: String = xml[start..]
        .iter()
        .map(|byte| char::from(*byte))
        .take_while(|c| c.is_ascii_digit() || *c == '.')
        .take(16)
        .collect();
    text.parse().ok()
}

/// Returns the whole numbers of columns and rows in the box `clap`.
fn clean_aperture(moov: &[u8]) -> Option<(u32, u32)> {
    // The size of the box is 40.
    let start = after(moov, b"\0\0\0\x28clap")?;
    let number = |i: usize| {
        let bytes = moov.get(start + 4 * i..start + 4 * i + 4)?;
        Some(u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    Some((number(0)?.checked_div(number(1)?)?, number(2)?.checked_div(number(3)?)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_bytes(bytes: &[u8]) -> Mp4Boxes {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.mp4");
        std::fs::write(&path, bytes).unwrap();
        read(&InputFile::open(&path).unwrap())
    }

    fn mp4_box(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
        [&(body.len() as u32 + 8).to_be_bytes()[..], kind, body].concat()
    }

    #[test]
    fn the_rate_of_capture_and_the_clean_aperture_are_found() {
        let xml = b"<VideoFrame videoCodec=\"AVC\" captureFps=\"119.88p\" formatFps=\"23.98p\"/>";
        let numbers: Vec<u8> =
            [1440_u32, 1, 1080, 1, 0, 1, 0, 1].into_iter().flat_map(u32::to_be_bytes).collect();
        let large = [&[0, 0, 0, 1][..], b"mdat", &24_u64.to_be_bytes(), &[0; 8]].concat();
        let boxes = [
            mp4_box(b"ftyp", b"isom"),
            large,
            mp4_box(b"moov", &mp4_box(b"clap", &numbers)),
            mp4_box(b"meta", xml),
        ];
        let wanted = Mp4Boxes { capture_hz: Some(119.88), clean_aperture: Some((1440, 1080)) };
        assert_eq!(read_bytes(&boxes.concat()), wanted);
    }

    #[test]
    fn any_file_is_read_without_an_error() {
        for bytes in [
            &b""[..],
            b"\0\0",
            b"\0\0\0\x04ftyp",
            b"\0\0\0\x01ftyp\0",
            b"RIFF\xff\xff\xff\xffAVI ",
            b"\0\0\0\0moov\0\0\0\x28clap",
        ] {
            assert_eq!(read_bytes(bytes), Mp4Boxes::default(), "{bytes:?}");
        }
    }
}
