//! A page that contains a short stream and works without a server.

use std::ops::Range;

use serde_json::json;
use spikelane::error::{Result, Setting, bail};
use spikelane::spikes::Crop;
use spikelane_io::formats::{Layout, StreamReader, convert_to};

use crate::jobs::summary;
use crate::page::{INDEX, STYLE, code};
use crate::sources::{OpenStream, Sources};

/// Largest page in bytes.
pub const MAX_PAGE_BYTES: usize = 20 << 20;

/// The policy of the page: it loads nothing.
const EXPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'";

/// Returns a self-contained HTML page with a part of a stream. The page contains the same modules as the viewer.
///
/// # Examples
/// ```
/// use spikelane_view::{SourceOptions, Sources, export_page};
/// let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("folder", e))?;
/// let path = folder.path().join("a.dat");
/// std::fs::write(&path, [0x55; 40]).map_err(|e| spikelane::Error::io("a.dat", e))?;
/// let options = spikelane_io::formats::OpenOptions::default().with_geometry(Some(spikelane::Geometry::new(8, 2)?));
/// let sources = Sources::open(&[path], &SourceOptions::default().with_open(options))?;
/// let page = export_page(&sources, 0..20, None)?;
/// assert!(page.starts_with("<!doctype html>") && !page.contains("http://"));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `sources` is not one stream, if the range or crop is outside the stream, or if the page would
/// exceed [`MAX_PAGE_BYTES`].
pub fn export_page(sources: &Sources, readouts: Range<usize>, crop: Option<Crop>) -> Result<String> {
    let (name, stream) = sources.only_stream()?;
    let full = stream.reader.geometry();
    let geometry = crop.map_or(Ok(full), |c| c.geometry(full))?;
    let page_bytes = code().len() + INDEX.len() + STYLE.len();
    let packed = geometry.frame_bytes().saturating_mul(readouts.len());
    let needed = (packed / 3).saturating_mul(4).saturating_add(page_bytes + (1 << 20));
    if needed > MAX_PAGE_BYTES {
        let readouts_limit = (MAX_PAGE_BYTES - page_bytes - (1 << 20)) / 4 * 3 / geometry.frame_bytes();
        bail!(Usage, "page of {} readouts", readouts.len(); found "{} MB", needed / 1_000_000;
            expected "at most {} MB", MAX_PAGE_BYTES / 1_000_000;
            remedy "choose at most {readouts_limit} readouts with {}, or choose fewer pixels with {}", Setting("readouts"), Setting("crop"));
    }
    let mut bytes = Vec::with_capacity(packed);
    convert_to(&stream.reader, readouts.clone(), crop, Layout::DatTop, |part| {
        bytes.extend_from_slice(part);
        Ok(())
    })?;
    let reader = StreamReader::from_bytes(name, bytes.clone(), Some(Layout::DatTop), Some(geometry))?;
    let clip = OpenStream::new(reader, stream.readout_hz).with_mosaic(stream.mosaic.clone());
    let defects = summary(&clip, &mut |_| {})?.value;
    let data = json!({
        "name": name, "width": geometry.width(), "height": geometry.height(), "readouts": readouts.len(),
        "readout_hz": stream.readout_hz, "first_readout": readouts.start, "summary": defects, "bits": base64(&bytes),
        "version": env!("CARGO_PKG_VERSION"),
    });
    // The text `</script>` in a name must not end the element.
    let data = data.to_string().replace('<', "\\u003c");
    let page = INDEX
        .replace("<link rel=\"icon\" href=\"icon.svg\">\n", "")
        .replace(
            "<link rel=\"stylesheet\" href=\"style.css\">",
            &format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{EXPORT_POLICY}\">\n<style>\n{STYLE}</style>"),
        )
        .replace(
            "<script type=\"module\" src=\"app.js\"></script>",
            &format!(
                "<script type=\"application/json\" id=\"embedded\">{data}</script>\n<script type=\"module\">\n{}</script>",
                code()
            ),
        );
    Ok(page)
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let word = group.iter().fold(0_u32, |word, b| word << 8 | u32::from(*b)) << (8 * (3 - group.len()));
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_has_the_examples_of_rfc_4648() {
        let examples = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        for (plain, encoded) in examples {
            assert_eq!(base64(plain.as_bytes()), encoded);
        }
    }

    #[test]
    fn joined_modules_import_and_export_nothing() {
        let all = code();
        assert!(!all.contains("\nimport ") && !all.contains("\nexport ") && !all.contains("</script"));
    }

    #[test]
    fn the_page_has_the_two_places_that_an_export_replaces() {
        assert!(INDEX.contains("<link rel=\"stylesheet\" href=\"style.css\">"));
        assert!(INDEX.contains("<script type=\"module\" src=\"app.js\"></script>"));
    }
}
