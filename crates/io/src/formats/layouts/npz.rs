//! `.npz` archives of arrays. Archives can be read but not written.
//!
//! Arrays in an archive are usually compressed with deflate, so a frame cannot be read at an arbitrary offset. The
//! whole stream is therefore packed into memory. The packed stream has an eighth of the size of an array of bytes.
//!
//! The array depends on the program that wrote the archive:
//! * UHSR writes `spk` with axes (T, H, W).
//! * SpikingSIM writes `arr_0` with axes (H, W, T). NumPy also uses the name `arr_0` for every array saved without a
//!   name, so the geometry decides.
//! * RSIR writes `seq`. Each byte contains eight successive readouts of a pixel, and the lowest bit is the first
//!   readout. The array `length` contains the number of readouts.

use std::io::{Read, Seek};

use super::array::{PackedStream, ReadoutAxis, incomplete_array_error, pack};
use super::npy::{ArrayHeader, array_header, axis_order_error, geometry_error};
use crate::Archive;
use crate::formats::source::ByteSource;
use spikelane::error::{Error, Result, Setting, bail, error};
use spikelane::spikes::{Geometry, set_bit};
use spikelane::unstable::npy::{self, Element, Header};
use spikelane::unstable::{Count, inputs};

/// The largest compression ratio of deflate. A header is invalid if it declares more data than this ratio times the
/// length of the archive.
const MAX_RATIO: u64 = 1032;

/// What the caller specifies about an archive.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ArchiveHint<'a> {
    /// Name of the array.
    pub(crate) key: Option<&'a str>,
    /// Geometry of a frame.
    pub(crate) geometry: Option<Geometry>,
    /// Whether the caller specified the axis order (T, H, W).
    pub(crate) readouts_first: bool,
}

/// Reads the stream in an archive. Returns the stream and the name of the array that contains the stream.
pub(crate) fn read(
    name: &str,
    source: &ByteSource,
    wanted: ArchiveHint<'_>,
) -> Result<(PackedStream, String)> {
    let mut archive = Archive::new(name, source.reader())?;
    let arrays = archive.array_names();
    let key = find_key(name, &arrays, wanted.key)?;
    let rsir = key == "seq" && arrays.iter().any(|a| a == "length");
    let length = if rsir { Some(read_length(name, &mut archive)?) } else { None };
    let mut file = archive.entry(&key)?;
    let subject = format!("{name}: {key}");
    let header = Header::read(&subject, &mut file)?;
    let array = array_header(&subject, &header)?;
    if array.data_bytes().is_none_or(|n| n > MAX_RATIO.saturating_mul(source.len() as u64)) {
        bail!(Input, "{subject}"; found "an array {}, larger than the archive", npy::shape_text(&array.shape);
            expected "an archive written by numpy.savez");
    }
    let packing = match length {
        Some(length) => unpack_eight_per_byte(&subject, &array, length, &mut file)?,
        None => pack(&subject, &array, find_readout_axis(&subject, &array, &key, wanted)?, &mut file)?,
    };
    if let Some(other) = wanted.geometry.filter(|&g| g != packing.geometry) {
        return Err(geometry_error(&subject, packing.geometry, other));
    }
    Ok((packing, key))
}

/// Returns the name of the array that contains the stream.
fn find_key(name: &str, arrays: &[String], wanted: Option<&str>) -> Result<String> {
    if arrays.is_empty() {
        bail!(Input, "{name}"; found "a zip archive without NumPy arrays";
            expected "an .npz file written by numpy.savez";
            remedy "unpack the archive; save the array of a PyTorch file with numpy.save");
    }
    let has = |key: &str| arrays.iter().any(|a| a == key);
    let chosen_key = match (wanted, arrays) {
        (Some(key), _) => has(key).then_some(key),
        (None, [only]) => Some(only.as_str()),
        (None, _) => ["spk", "seq", "arr_0"].into_iter().find(|key| has(key)),
    };
    chosen_key.map(str::to_owned).ok_or_else(|| {
        error!(Usage, "{name}"; found "arrays [{}]", arrays.join(", ");
            expected "{}", wanted.map_or("an array named spk, seq or arr_0".to_owned(), |k| format!("'{k}'"));
            remedy "name the array with {}", Setting("key"))
    })
}

/// Returns the axis order. The order follows from the specified layout, the geometry or the name of the array.
fn find_readout_axis(
    subject: &str,
    array: &ArrayHeader,
    key: &str,
    wanted: ArchiveHint<'_>,
) -> Result<ReadoutAxis> {
    if wanted.readouts_first {
        return Ok(ReadoutAxis::First);
    }
    match wanted.geometry {
        Some(geometry) => match ReadoutAxis::candidates(array.shape, geometry)[..] {
            [one] => Ok(one),
            [] => Err(axis_order_error(subject, array.shape, geometry)),
            _ if key == "spk" => Ok(ReadoutAxis::First),
            _ => Err(ambiguous_axes_error(
                subject,
                array.shape,
                format_args!("set {} to npy-bytes if the first axis is the time", Setting("layout")),
            )),
        },
        None if key == "spk" => Ok(ReadoutAxis::First),
        None => Err(ambiguous_axes_error(
            subject,
            array.shape,
            format_args!("set {} and {}", Setting("width"), Setting("height")),
        )),
    }
}

/// Returns the error for an array in which the first or the last axis can be the readout axis.
pub(crate) fn ambiguous_axes_error(subject: &str, shape: [u64; 3], remedy: std::fmt::Arguments<'_>) -> Error {
    let describe = |axes: ReadoutAxis| match axes.readouts_and_geometry(shape) {
        Some((readouts, g)) => {
            format!("{} of {g} (width x height), axes {}", Count(readouts, "readout"), axes.name())
        }
        None => format!("no stream, axes {}", axes.name()),
    };
    error!(Usage, "{subject}";
        found "shape {}, which is {}, or {}", npy::shape_text(&shape), describe(ReadoutAxis::First), describe(ReadoutAxis::Last);
        expected "unambiguous axes"; remedy "{remedy}")
}

/// Reads the only number in the array `length` of an RSIR archive.
fn read_length(name: &str, archive: &mut Archive<impl Read + Seek>) -> Result<u64> {
    let mut bytes = Vec::new();
    let subject = format!("{name}: length");
    archive.entry("length")?.take(1 << 16).read_to_end(&mut bytes).map_err(|e| Error::io(&subject, e))?;
    let (_, values) = spikelane::unstable::npy::read_values(&subject, &bytes)?;
    match values[..] {
        [n] if (1.0..=1e12).contains(&n) && n.fract() == 0.0 => Ok(n as u64),
        _ => Err(error!(Input, "{subject}"; found "{}", Count(values.len(), "value");
            expected "a single number: the number of readouts, as in RSIR")),
    }
}

/// Unpacks bytes that each contain eight successive readouts of one pixel.
fn unpack_eight_per_byte(
    subject: &str,
    array: &ArrayHeader,
    length: u64,
    source: &mut impl Read,
) -> Result<PackedStream> {
    let bad = |found: String| {
        error!(Input, "{subject}"; found "{found}";
            expected "the array seq of RSIR: u8 of (readouts / 8, H, W)")
    };
    let (groups, geometry) = ReadoutAxis::First
        .readouts_and_geometry(array.shape)
        .filter(|(groups, _)| length <= groups.saturating_mul(8) && length > groups.saturating_mul(8) - 8)
        .ok_or_else(|| bad(format!("shape {} for a length of {length}", npy::shape_text(&array.shape))))?;
    if array.element != Element::U8 || array.is_fortran_order {
        return Err(bad(format!("elements of type {}", array.element)));
    }
    let size = geometry.frame_bytes();
    if (size as u64).saturating_mul(length) > 1 << 30 {
        return Err(bad(format!("{}, more than 1 GiB of packed frames", Count(length, "readout"))));
    }
    let mut packed = inputs::zeroed_vec(subject, size * length as usize)?;
    let mut bytes = inputs::zeroed_vec(subject, geometry.pixels())?;
    for group in 0..groups as usize {
        source.read_exact(&mut bytes).map_err(|e| incomplete_array_error(subject, e))?;
        for (t, frame) in packed.chunks_exact_mut(size).skip(8 * group).take(8).enumerate() {
            bytes.iter().enumerate().filter(|(_, b)| *b >> t & 1 == 1).for_each(|(p, _)| set_bit(frame, p));
        }
    }
    Ok(PackedStream { geometry, packed })
}
