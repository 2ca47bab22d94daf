//! `.npz`: archives of arrays, read only.
//!
//! Arrays in an archive are deflated, so they cannot be mapped: the packed stream is held in memory, an eighth
//! of an array of bytes. UHSR's key `spk` is (T, H, W) and SpikingSIM's `arr_0` is (H, W, T), but `arr_0` is also what
//! NumPy calls every array that was given no name, so the size decides. RSIR's `seq` holds eight
//! successive readouts of a pixel in a byte, the first one in the lowest bit, and `length` their number.

use std::io::{Read, Seek};

use super::{Array, Axes, Packing, meaning, pack};
use crate::Archive;
use crate::formats::source::Source;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Geometry, set_bit};
use spikelane::unstable::inputs;
use spikelane::unstable::npy::{Element, Header};

pub(crate) use crate::ARCHIVE_MAGIC as MAGIC;

/// Deflate makes at most 1032 bytes out of one; a header that claims more lies.
const MAX_RATIO: u64 = 1032;

/// What the caller knows of an archive.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Entry<'a> {
    /// The array's name.
    pub(crate) key: Option<&'a str>,
    /// Size of a frame.
    pub(crate) geometry: Option<Geometry>,
    /// Whether the axes are said to be (T, H, W).
    pub(crate) readouts_first: bool,
}

/// Reads the stream in an archive; also says which array it was.
pub(crate) fn read(name: &str, source: &Source, wanted: Entry<'_>) -> Result<(Packing, String)> {
    let mut archive = Archive::new(name, source.reader())?;
    let arrays = archive.arrays();
    let key = key(name, &arrays, wanted.key)?;
    let rsir = key == "seq" && arrays.iter().any(|a| a == "length");
    let length = if rsir { Some(length(name, &mut archive)?) } else { None };
    let mut file = archive.entry(&key)?;
    let subject = format!("{name}: {key}");
    let header = Header::read(&subject, &mut file)?;
    let array = meaning(&subject, &header)?;
    if array.data_bytes().is_none_or(|n| n > MAX_RATIO.saturating_mul(source.len() as u64)) {
        return Err(Error::new(Kind::Input, subject)
            .found(format_args!("an array {:?}, more than it holds", array.shape))
            .expected("an archive that numpy.savez wrote"));
    }
    let packing = match length {
        Some(length) => eight_a_byte(&subject, &array, length, &mut file)?,
        None => pack(&subject, &array, axes(&subject, &array, &key, wanted)?, &mut file)?,
    };
    if let Some(other) = wanted.geometry.filter(|&g| g != packing.geometry) {
        return Err(super::npy::other_geometry(&subject, packing.geometry, other));
    }
    Ok((packing, key))
}

/// The array that holds the stream.
fn key(name: &str, arrays: &[String], wanted: Option<&str>) -> Result<String> {
    if arrays.is_empty() {
        return Err(Error::new(Kind::Input, name)
            .found("a zip archive without NumPy arrays")
            .expected("an .npz that numpy.savez wrote")
            .remedy("unpack it; of a file of PyTorch save the array with numpy.save"));
    }
    let has = |key: &str| arrays.iter().any(|a| a == key);
    let found = match (wanted, arrays) {
        (Some(key), _) => has(key).then_some(key),
        (None, [only]) => Some(only.as_str()),
        (None, _) => ["spk", "seq", "arr_0"].into_iter().find(|key| has(key)),
    };
    found.map(str::to_owned).ok_or_else(|| {
        Error::new(Kind::Usage, name)
            .found(format_args!("arrays [{}]", arrays.join(", ")))
            .expected(wanted.map_or("one that is known: spk, seq or arr_0".to_owned(), |k| format!("'{k}'")))
            .remedy("name the array with --key")
    })
}

/// The order of axes that the size, the key or the name of the layout tells.
fn axes(subject: &str, array: &Array, key: &str, wanted: Entry<'_>) -> Result<Axes> {
    if wanted.readouts_first {
        return Ok(Axes::First);
    }
    match wanted.geometry {
        Some(geometry) => match Axes::of(array.shape, geometry)[..] {
            [one] => Ok(one),
            [] => Err(super::npy::no_order(subject, array.shape, geometry)),
            _ if key == "spk" => Ok(Axes::First),
            _ => Err(ambiguous(subject, array.shape, "name --layout npy-bytes for the first")),
        },
        None if key == "spk" => Ok(Axes::First),
        None => Err(ambiguous(subject, array.shape, "give the size, --width and --height")),
    }
}

/// The error for an array whose readouts may be its first axis or its last.
pub(crate) fn ambiguous(subject: &str, shape: [u64; 3], remedy: &str) -> Error {
    let told = |axes: Axes| match axes.meaning(shape) {
        Some((readouts, g)) => {
            format!(
                "{readouts} readouts of {g}, axes {} (--width {} --height {})",
                axes.name(),
                g.width(),
                g.height()
            )
        }
        None => format!("nothing, axes {}", axes.name()),
    };
    Error::new(Kind::Usage, subject)
        .found(format_args!("shape {shape:?}, which is {}, or {}", told(Axes::First), told(Axes::Last)))
        .expected("to be told which")
        .remedy(remedy)
}

/// The one number of RSIR's `length`.
fn length(name: &str, archive: &mut Archive<impl Read + Seek>) -> Result<u64> {
    let mut bytes = Vec::new();
    let subject = format!("{name}: length");
    archive.entry("length")?.take(1 << 16).read_to_end(&mut bytes).map_err(|e| Error::io(&subject, e))?;
    let (_, values) = spikelane::unstable::npy::read_values(&subject, &bytes)?;
    match values[..] {
        [n] if (1.0..=1e12).contains(&n) && n.fract() == 0.0 => Ok(n as u64),
        _ => Err(Error::new(Kind::Input, subject)
            .found(format_args!("{} values", values.len()))
            .expected("one number of readouts, as RSIR has it")),
    }
}

/// Unpacks eight successive readouts of each byte.
fn eight_a_byte(subject: &str, array: &Array, length: u64, source: &mut impl Read) -> Result<Packing> {
    let bad = |found: String| {
        Error::new(Kind::Input, subject).found(found).expected("RSIR's seq: u8 of (readouts / 8, H, W)")
    };
    let (groups, geometry) = Axes::First
        .meaning(array.shape)
        .filter(|(groups, _)| length <= groups.saturating_mul(8) && length > groups.saturating_mul(8) - 8)
        .ok_or_else(|| bad(format!("shape {:?} for a length of {length}", array.shape)))?;
    if array.element != Element::U8 || array.fortran {
        return Err(bad(format!("{} elements", array.element)));
    }
    let size = geometry.frame_bytes();
    if (size as u64).saturating_mul(length) > 1 << 30 {
        return Err(bad(format!("{length} readouts, beyond 1 GiB of packed frames")));
    }
    let mut packed = inputs::zeroed(subject, size * length as usize)?;
    let mut bytes = inputs::zeroed(subject, geometry.pixels())?;
    for group in 0..groups as usize {
        source.read_exact(&mut bytes).map_err(|e| bad(e.to_string()))?;
        for (t, frame) in packed.chunks_exact_mut(size).skip(8 * group).take(8).enumerate() {
            bytes.iter().enumerate().filter(|(_, b)| *b >> t & 1 == 1).for_each(|(p, _)| set_bit(frame, p));
        }
    }
    Ok(Packing { geometry, packed })
}
