//! `.npz`: the archives in which two data sets come, read only.
//!
//! `spk` is (T,H,W) (UHSR), `arr_0` is (H,W,T) (SpikingSIM). Arrays in an archive are
//! deflated, so they cannot be mapped: the packed stream is held in memory, an eighth of
//! the array.

use std::io::{Cursor, Read};

use crate::error::{Error, Kind, Result};
use crate::formats::{Codec, Layout, npy};
use crate::spikes::{Geometry, set_bit};

/// First bytes of an archive.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";

/// Largest packed stream held in memory.
const MAX_PACKED: u64 = 1 << 30;

/// Deflate makes at most 1032 bytes out of one; a header that claims more lies.
const MAX_RATIO: u64 = 1032;

/// A stream in memory.
pub(super) struct Archive {
    pub(super) geometry: Geometry,
    pub(super) packed: Vec<u8>,
}

/// Reads the stream in an archive.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Archive> {
    let bad = |found: String| {
        Error::new(Kind::Input, name)
            .found(found)
            .expected("an .npz archive with spk (T,H,W) or arr_0 (H,W,T)")
    };
    let mut zip = npyz::zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| bad(e.to_string()))?;
    let names: Vec<String> = zip.file_names().map(String::from).collect();
    let Some(key) = ["spk.npy", "arr_0.npy"]
        .into_iter()
        .find(|k| names.iter().any(|n| n == k))
    else {
        return Err(bad(format!("arrays [{}]", names.join(", "))));
    };
    let mut file = zip.by_name(key).map_err(|e| bad(e.to_string()))?;
    let array = read_header(&format!("{name}: {key}"), &mut file)?;
    let claims = array
        .data_bytes()
        .filter(|&n| n <= MAX_RATIO.saturating_mul(bytes.len() as u64))
        .ok_or_else(|| bad(format!("an array {:?}, more than it holds", array.shape)))?;
    if claims == 0 || claims / 8 > MAX_PACKED {
        return Err(bad(format!("an array {:?}", array.shape))
            .remedy("unpack larger arrays to .npy, which is mapped"));
    }
    let io = |e: std::io::Error| bad(format!("{key}: {e}"));
    if key == "spk.npy" {
        frames_first(name, &array, &mut file, io)
    } else {
        frames_last(name, &array, &mut file, io)
    }
}

/// Reads just the header, which says itself how long it is.
fn read_header(name: &str, file: &mut impl Read) -> Result<npy::Array> {
    let io = |e| Error::io(name, e);
    let mut bytes = vec![0; 12];
    file.read_exact(&mut bytes).map_err(io)?;
    // Version 1 counts in two bytes, so two of the twelve are text already.
    let len = match bytes[6] {
        1 => usize::from(u16::from_le_bytes([bytes[8], bytes[9]])).saturating_sub(2),
        _ => u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize,
    };
    // `parse` refuses long headers; it need not be given all of one.
    let mut text = Vec::new();
    file.take(len.min(1 << 16) as u64)
        .read_to_end(&mut text)
        .map_err(io)?;
    bytes.extend(text);
    npy::parse(name, &bytes)
}

fn geometry(name: &str, height: u64, width: u64) -> Result<Geometry> {
    let side = |n| u32::try_from(n).unwrap_or(u32::MAX);
    Geometry::new(side(width), side(height)).map_err(|e| Error::new(Kind::Input, name).found(e))
}

fn frames_first(
    name: &str,
    array: &npy::Array,
    file: &mut impl Read,
    io: impl Fn(std::io::Error) -> Error,
) -> Result<Archive> {
    let [readouts, height, width] = array.shape;
    let geometry = geometry(name, height, width)?;
    let codec = Codec::new(Layout::NpyBytes, geometry)?;
    let mut frame = vec![0; geometry.pixels()];
    let size = geometry.frame_bytes();
    let mut packed = Vec::new();
    for t in 0..readouts as usize {
        file.read_exact(&mut frame).map_err(&io)?;
        packed.resize((t + 1) * size, 0);
        codec
            .decode(&frame, &mut packed[t * size..])
            .map_err(|e| e.within(format_args!("{name}: readout {t}")))?;
    }
    Ok(Archive { geometry, packed })
}

fn frames_last(
    name: &str,
    array: &npy::Array,
    file: &mut impl Read,
    io: impl Fn(std::io::Error) -> Error,
) -> Result<Archive> {
    let [height, width, readouts] = array.shape;
    let geometry = geometry(name, height, width)?;
    let (size, readouts) = (geometry.frame_bytes(), readouts as usize);
    // Padding can weigh more than pixels: 1x1 takes a byte a readout.
    if (size as u64).saturating_mul(readouts as u64) > MAX_PACKED {
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("{readouts} readouts of {geometry}"))
            .expected(format_args!("a stream of at most {MAX_PACKED} bytes")));
    }
    let mut packed = vec![0; size * readouts];
    let mut times = vec![0; readouts];
    for pixel in 0..geometry.pixels() {
        file.read_exact(&mut times).map_err(&io)?;
        for (t, &value) in times.iter().enumerate() {
            match value {
                0 => {}
                1 => set_bit(&mut packed[t * size..(t + 1) * size], pixel),
                _ => {
                    return Err(Error::new(Kind::Input, name)
                        .found(format_args!(
                            "the value {value} at pixel {pixel}, readout {t}"
                        ))
                        .expected("0 or 1"));
                }
            }
        }
    }
    Ok(Archive { geometry, packed })
}
