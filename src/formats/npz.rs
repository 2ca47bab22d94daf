//! `.npz`: the archives in which two data sets come, read only.
//!
//! `spk` is (T,H,W) (UHSR), `arr_0` is (H,W,T) (SpikingSIM). Arrays in an archive are
//! deflated, so they cannot be mapped: the packed stream is held in memory, an eighth of
//! the array.

use std::io::{Cursor, Read};

use crate::error::{Error, Kind, Result};
use crate::formats::{Codec, Layout, npy};
use crate::npy::{Archive, Header};
use crate::spikes::{Geometry, set_bit};

pub(super) use crate::npy::ARCHIVE_MAGIC as MAGIC;

/// Largest packed stream held in memory.
const MAX_PACKED: u64 = 1 << 30;

/// Deflate makes at most 1032 bytes out of one; a header that claims more lies.
const MAX_RATIO: u64 = 1032;

/// A stream in memory.
pub(super) struct Stream {
    pub(super) geometry: Geometry,
    pub(super) packed: Vec<u8>,
}

/// Reads the stream in an archive.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Stream> {
    let bad = |found: String| {
        Error::new(Kind::Input, name)
            .found(found)
            .expected("an .npz archive with spk (T,H,W) or arr_0 (H,W,T)")
    };
    let mut archive = Archive::new(name, Cursor::new(bytes))?;
    let arrays = archive.arrays();
    let Some(key) = ["spk", "arr_0"].into_iter().find(|k| arrays.iter().any(|n| n == k)) else {
        return Err(bad(format!("arrays [{}]", arrays.join(", "))));
    };
    let mut file = archive.entry(key)?;
    let subject = format!("{name}: {key}");
    let array = npy::meaning(&subject, &Header::read(&subject, &mut file)?)?;
    let claims = array
        .data_bytes()
        .filter(|&n| n <= MAX_RATIO.saturating_mul(bytes.len() as u64))
        .ok_or_else(|| bad(format!("an array {:?}, more than it holds", array.shape)))?;
    let [a, b, c] = array.shape;
    let (last, readouts, height, width) = match key {
        "spk" => (false, a, b, c),
        _ => (true, c, a, b),
    };
    let geometry = geometry(name, height, width)?;
    let packed = (geometry.frame_bytes() as u64).saturating_mul(readouts);
    if claims == 0 || packed > MAX_PACKED {
        return Err(bad(format!("an array {:?}", array.shape))
            .remedy("unpack larger arrays to .npy, which is mapped"));
    }
    let io = |e: std::io::Error| bad(format!("{key}: {e}"));
    let readouts = readouts as usize;
    let packed = if last {
        readouts_last(name, geometry, readouts, &mut file, io)
    } else {
        readouts_first(name, geometry, readouts, &mut file, io)
    }?;
    Ok(Stream { geometry, packed })
}

fn geometry(name: &str, height: u64, width: u64) -> Result<Geometry> {
    let side = |n| u32::try_from(n).unwrap_or(u32::MAX);
    Geometry::new(side(width), side(height)).map_err(|e| Error::new(Kind::Input, name).found(e))
}

fn readouts_first(
    name: &str,
    geometry: Geometry,
    readouts: usize,
    file: &mut impl Read,
    io: impl Fn(std::io::Error) -> Error,
) -> Result<Vec<u8>> {
    let codec = Codec::new(Layout::NpyBytes, geometry)?;
    let size = geometry.frame_bytes();
    let mut frame = vec![0; geometry.pixels()];
    let mut packed = vec![0; size * readouts];
    for (t, packed) in packed.chunks_exact_mut(size).enumerate() {
        file.read_exact(&mut frame).map_err(&io)?;
        codec.decode(&frame, packed).map_err(|e| e.within(format_args!("{name}: readout {t}")))?;
    }
    Ok(packed)
}

fn readouts_last(
    name: &str,
    geometry: Geometry,
    readouts: usize,
    file: &mut impl Read,
    io: impl Fn(std::io::Error) -> Error,
) -> Result<Vec<u8>> {
    let size = geometry.frame_bytes();
    let mut times = vec![0; readouts];
    let mut packed = vec![0; size * readouts];
    for pixel in 0..geometry.pixels() {
        file.read_exact(&mut times).map_err(&io)?;
        if let Some(t) = times.iter().position(|&value| value > 1) {
            return Err(Error::new(Kind::Input, name)
                .found(format_args!("the value {} at pixel {pixel}, readout {t}", times[t]))
                .expected("0 or 1"));
        }
        for (frame, _) in packed.chunks_exact_mut(size).zip(&times).filter(|(_, value)| **value == 1) {
            set_bit(frame, pixel);
        }
    }
    Ok(packed)
}
