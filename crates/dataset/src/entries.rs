//! The entries of planned sequences.

use crate::discover::{self, Input};
use crate::manifest::SequenceEntry;
use crate::{Content, DatasetOptions, InputContent, SceneContent};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::PlainName;
use spikelane_io::formats::Layout;
use spikelane_io::light::DEFAULT_READOUTS_PER_FRAME;

/// Returns the entry of a sequence that is not generated yet.
pub(super) fn planned_entry(
    options: &DatasetOptions,
    id: PlainName,
    input: Option<String>,
    readouts: Option<u64>,
) -> Result<SequenceEntry> {
    let seeds = options.seeds(id.as_str());
    let scene = matches!(options.content, Content::Scenes(_)).then(|| options.scene_seed_for(id.as_str()));
    Ok(SequenceEntry {
        scene_seed: scene,
        bytes: expected_bytes(options, readouts)?,
        input,
        readouts,
        ..SequenceEntry::new(id, [seeds.camera, seeds.shot, seeds.sequence])
    })
}

/// Returns the planned entry of scene number `index`.
pub(super) fn planned_scene_entry(
    options: &DatasetOptions,
    drives: &SceneContent,
    index: u64,
) -> Result<SequenceEntry> {
    let id = PlainName::parse(ErrorKind::Config, "id", &options.scene_id(index))?;
    planned_entry(options, id, None, Some(drives.readouts()))
}

/// Returns the planned entry of an input.
pub(super) fn planned_input_entry(
    options: &DatasetOptions,
    inputs: &InputContent,
    input: Input,
) -> Result<SequenceEntry> {
    let each = inputs.readouts_per_frame.unwrap_or(DEFAULT_READOUTS_PER_FRAME);
    let readouts = input.frames.map(|n| n.saturating_mul(each));
    planned_entry(options, input.id, Some(input.path.to_string_lossy().into_owned()), readouts)
}

pub(super) fn planned_entries(options: &DatasetOptions) -> Result<Vec<SequenceEntry>> {
    let all: Result<Vec<SequenceEntry>> = match &options.content {
        Content::Scenes(d) => {
            (0..u64::from(d.sequences)).map(|i| planned_scene_entry(options, d, i)).collect()
        }
        Content::Inputs(i) => {
            let mut all = Vec::new();
            discover::for_each_input(options, i, &mut |found| {
                all.push(planned_input_entry(options, i, found)?);
                Ok(())
            })?;
            Ok(all)
        }
    };
    let mut all = all?;
    let ids: Vec<_> = all.iter().map(|e| e.id.to_string()).collect();
    for (entry, split) in all.iter_mut().zip(options.splits(&ids)) {
        entry.split = split;
    }
    Ok(all)
}

/// Returns the expected number of bytes of a sequence. The size of streams is exact, and the size of images and labels
/// is an estimate.
pub(super) fn expected_bytes(options: &DatasetOptions, readouts: Option<u64>) -> Result<Option<u64>> {
    let Some(readouts) = readouts else { return Ok(None) };
    let geometry = options.camera.sensor.geometry;
    let streams = u128::from(Layout::Dat.file_bytes(geometry, readouts)?) * 2;
    let (pixels, readouts) = (geometry.pixels() as u128, u128::from(readouts));
    let pixel_bytes = u128::from(options.images.format.bytes_per_pixel());
    let rest = match &options.content {
        Content::Scenes(d) => {
            let every = options.images.every.unwrap_or(u64::from(d.readouts_per_image)).max(1);
            let images = readouts.div_ceil(every.into());
            // A gray PNG of a street scene has about 2/3 byte per pixel. A labeled image has 9 bytes per pixel for
            // maps, and 9 bytes per pixel for each of the two flow fields with mask.
            let picture = pixels * pixel_bytes * 2 / 3 + if d.npy { 4 * pixels } else { 0 };
            let labeled =
                u128::from(d.images_per_scene).checked_div(d.label_every.into()).map_or(0, |n| n + 1);
            // KITTI files have 8 bytes per pixel for depth and two flow fields. EXR files have 12 bytes per pixel for
            // three floats.
            let label = 27 + if d.kitti { 8 } else { 0 } + if d.exr { 12 } else { 0 };
            images * picture + labeled * label * pixels
        }
        Content::Inputs(_) => {
            let every = options.images.every.map(|n| u128::from(n.max(1)));
            2 * pixels + every.map_or(0, |n| readouts.div_ceil(n) * pixels * pixel_bytes)
        }
    };
    // Numbers of readouts have 64 bits, and a frame has at most 2^28 pixels. Therefore the sum fits in 128 bits.
    let all = u64::try_from(streams + rest).map_err(|_| {
        Error::new(ErrorKind::Config, "dataset")
            .found(format_args!("sequences of {}", Count(streams + rest, "byte")))
            .expected("sequences that fit on a disk")
            .remedy(format_args!("reduce {}, or use a smaller camera", Setting("readouts")))
    })?;
    Ok(Some(all))
}
