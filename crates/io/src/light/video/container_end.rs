//! The ends of GIF and Ogg files. ffmpeg reads these files without an error if they are truncated.

use std::io::{self, Read};

/// Returns a description of the end of a truncated file. `container` is ffmpeg's name of the format. Other formats and
/// unknown blocks are not checked.
pub(super) fn truncation(container: &str, mut file: impl Read) -> Option<&'static str> {
    let (result, description) = match container {
        "gif" => (find_trailer(&mut file), "the end of the file before the trailer of the GIF"),
        "ogg" => (skip_pages(&mut file), "the end of the file inside a page of the Ogg"),
        _ => return None,
    };
    result.is_err_and(|e| e.kind() == io::ErrorKind::UnexpectedEof).then_some(description)
}

/// Reads the pages of an Ogg file (RFC 3533).
fn skip_pages(file: &mut impl Read) -> io::Result<()> {
    loop {
        let mut start = [0; 4];
        if io::copy(&mut file.by_ref().take(4), &mut &mut start[..])? == 0 || &start != b"OggS" {
            return Ok(());
        }
        let header: [u8; 23] = bytes(file)?;
        let mut segments = [0; 255];
        let segments = &mut segments[..header[22].into()];
        file.read_exact(segments)?;
        skip(file, segments.iter().map(|len| u64::from(*len)).sum())?;
    }
}

fn find_trailer(file: &mut impl Read) -> io::Result<()> {
    const EXTENSION: u8 = 0x21;
    const IMAGE: u8 = 0x2C;
    let header: [u8; 13] = bytes(file)?;
    skip(file, color_table_bytes(header[10]))?;
    loop {
        let [kind] = bytes(file)?;
        match kind {
            EXTENSION => skip(file, 1)?,
            IMAGE => {
                let descriptor: [u8; 9] = bytes(file)?;
                // The size of the codes follows the color table.
                skip(file, color_table_bytes(descriptor[8]) + 1)?;
            }
            _ => return Ok(()),
        }
        loop {
            let [len] = bytes(file)?;
            if len == 0 {
                break;
            }
            skip(file, len.into())?;
        }
    }
}

/// Returns the size of the color table that the flags of a header announce.
fn color_table_bytes(flags: u8) -> u64 {
    if flags & 0x80 == 0 { 0 } else { 3 << ((flags & 7) + 1) }
}

fn bytes<const N: usize>(file: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn skip(file: &mut impl Read, len: u64) -> io::Result<()> {
    let skipped = io::copy(&mut file.by_ref().take(len), &mut io::sink())?;
    if skipped == len { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gif_is_complete_with_its_trailer() {
        let gif = [
            &b"GIF89a\x04\0\x02\0\x80\0\0"[..],
            &[0; 6],
            b"\x21\xF9\x04\0\x0A\0\0\0",
            b"\x2C\0\0\0\0\x04\0\x02\0\0\x02\x03\x84\x8F\x05\0",
            b"\x3B",
        ]
        .concat();
        let is_truncated = |bytes: &[u8]| truncation("gif", bytes).is_some();
        assert!(!is_truncated(&gif));
        assert!((0..gif.len()).all(|len| is_truncated(&gif[..len])));
        assert!(!is_truncated(&[&gif[..], b"text after the trailer"].concat()));
    }

    #[test]
    fn an_ogg_consists_of_whole_pages() {
        let page = [&b"OggS"[..], &[0; 22], &[2, 3, 1], b"data"].concat();
        let ogg = page.repeat(2);
        let is_truncated = |bytes: &[u8]| truncation("ogg", bytes).is_some();
        for len in 4..=ogg.len() {
            let is_whole = len == page.len() || len == ogg.len();
            // The start of the word OggS is not a page.
            let is_in_word = (1..4).contains(&(len % page.len()));
            assert_eq!(is_truncated(&ogg[..len]), !is_whole && !is_in_word, "{len}");
        }
    }
}
