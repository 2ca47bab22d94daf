//! Writes the folders that `CSPK` reads, the training loader of SSL-CSC (Dong et al. 2025).
//!
//! The loader pairs the streams in `SPLIT/spk/NAME` with the images in `SPLIT/gt/NAME` in the order of their file names.
//! A stream has its top row first, and the lowest bit of a byte is the leftmost pixel. The loader uses the first 41
//! readouts and the filters RGGB. An image is an array of the shape (1, 3, height, width) with codes from 0 to 255.

use std::path::Path;

use crate::hidden_file::write_if_changed;
use crate::{DatasetLayout, DatasetOptions, SequenceEntry};
use image::{ColorType, DynamicImage};
use serde_json::json;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::inputs::{self, InnerPath, PlainName};
use spikelane::unstable::npy::{self, Element};
use spikelane_io::formats::{Layout, StreamReader, StreamWriter};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage::folders;

/// Number of readouts that the loader uses. The image shows the light of the middle one.
const READOUTS: usize = 41;

/// Filters of the loader.
const PATTERN: &str = "RGGB";

/// Returns the paths of a sequence's stream, sidecar and image, relative to the folder of the split.
pub(super) fn paths(id: &PlainName) -> [InnerPath; 3] {
    [("spk/spikelane", ".dat"), ("spk/spikelane", ".json"), ("gt/spikelane", ".npy")]
        .map(|(folder, ending)| InnerPath::from(folder).join(id.with_ending(ending)))
}

/// Checks that the loader can read the streams of the camera.
///
/// # Errors
/// [`ErrorKind::Usage`] if the layout of the data set is that of SSL-CSC and the camera has other filters than RGGB.
pub(crate) fn check_camera(options: &DatasetOptions) -> Result<()> {
    let mosaic = options.camera.window_mosaic().map(|mosaic| mosaic.to_string());
    if options.dataset_layout != DatasetLayout::SslCsc || mosaic.as_deref() == Some(PATTERN) {
        return Ok(());
    }
    let found = mosaic.map_or_else(|| "a gray camera".to_owned(), |mosaic| format!("the mosaic {mosaic}"));
    Err(Error::new(ErrorKind::Usage, Setting("dataset_layout"))
        .found(format_args!("{} and {found}", options.dataset_layout))
        .expected(format_args!("the mosaic {PATTERN}, which the loader assumes")))
}

/// Writes the middle readouts of a sequence and its ground truth. `sequence` is the folder of the sequence.
pub(super) fn write(options: &DatasetOptions, entry: &SequenceEntry, sequence: &Path) -> Result<()> {
    if options.dataset_layout != DatasetLayout::SslCsc {
        return Ok(());
    }
    let split = InnerPath::from(entry.split.name());
    let resolve = |name: &'static str| InnerPath::from(name).resolve_in(sequence, options.access());
    let to = |path: InnerPath| folders::create_parents(&options.output, &split.join(path));
    let [stream_path, sidecar_path, image_path] = paths(&entry.id);
    let sidecar =
        write_middle_readouts(&resolve("stream.dat")?, &resolve("stream.json")?, &to(stream_path)?)?;
    sidecar.write(&to(sidecar_path)?, true)?;
    let path = resolve("gt.png")?;
    let image = image::open(&path).map_err(|e| Error::new(ErrorKind::Input, path.display()).found(e))?;
    if image.color() != ColorType::Rgb8 {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found("a gray image")
            .expected("colors, which a color camera receives"));
    }
    write_if_changed(&options.output, &split.join(image_path), &planar_array(image)?)
}

/// Writes the readouts around the middle of a stream, which is the readout of the ground truth. Returns their sidecar.
fn write_middle_readouts(from: &Path, sidecar: &Path, to: &Path) -> Result<Sidecar> {
    let stream = StreamReader::open(from, None, None)?;
    let original = Sidecar::read(sidecar)?;
    let (geometry, readouts) = (stream.geometry(), READOUTS as u64);
    if stream.readouts() < READOUTS {
        return Err(Error::new(ErrorKind::Input, stream.name())
            .found(format_args!("{} readouts", stream.readouts()))
            .expected(format_args!("at least {READOUTS}, which the loader uses"))
            .remedy("simulate more readouts for each sequence"));
    }
    let first = stream.readouts() / 2 - READOUTS / 2;
    let mut packed = inputs::zeroed_vec(stream.name(), READOUTS * geometry.frame_bytes())?;
    stream.read_frames(first, &mut packed)?;
    let mut writer = StreamWriter::create(to, Layout::DatTop, geometry, readouts, true)?;
    writer.write_frames(0, &packed)?;
    let facts = StreamFacts::new(&writer.finish()?, geometry, readouts);
    let range = json!({
        "file": original.stream.file, "layout": original.layout, "readouts": [first, first + READOUTS],
        "missing_frames": 0,
    });
    Ok(Sidecar {
        readout_hz: original.readout_hz,
        mosaic: original.mosaic,
        converted_from: Some(range),
        command: original.command,
        ..Sidecar::new(geometry, Layout::DatTop, readouts, facts)
    })
}

/// Returns an array with the red, the green and the blue codes of an image.
fn planar_array(image: DynamicImage) -> Result<Vec<u8>> {
    let image = image.into_rgb8();
    let shape = [1, 3, u64::from(image.height()), u64::from(image.width())];
    let plane = |color: usize| image.pixels().map(move |pixel| [pixel[color]]);
    let codes: Vec<[u8; 1]> = (0..3).flat_map(plane).collect();
    npy::to_bytes(Element::U8, &shape, codes.into_iter())
}
