//! The sequences of a dataset before they are made.

use crate::from::{self, Input};
use crate::manifest::Entry;
use crate::{DatasetOptions, Drives, Inputs, Work};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::PlainName;
use spikelane_io::formats::Layout;
use spikelane_io::light::READOUTS_PER_FRAME;

/// A sequence that is not made yet.
pub(super) fn planned(
    options: &DatasetOptions,
    id: PlainName,
    input: Option<String>,
    readouts: Option<u64>,
) -> Result<Entry> {
    let seeds = options.seeds(id.as_str());
    let scene = matches!(options.work, Work::Drives(_)).then(|| options.seed_of_scene(id.as_str()));
    Ok(Entry {
        scene_seed: scene,
        bytes: expected_bytes(options, readouts)?,
        input,
        readouts,
        ..Entry::new(id, [seeds.camera, seeds.shot, seeds.sequence])
    })
}

/// The scene of number `index`, not made yet.
pub(super) fn planned_scene(options: &DatasetOptions, drives: &Drives, index: u64) -> Result<Entry> {
    let id = PlainName::parse(Kind::Config, "id", &options.scene_id(index))?;
    planned(options, id, None, Some(drives.readouts()))
}

/// The sequence of an input.
pub(super) fn new_input(options: &DatasetOptions, inputs: &Inputs, found: Input) -> Result<Entry> {
    let each = inputs.readouts_per_frame.unwrap_or(READOUTS_PER_FRAME);
    let readouts = found.frames.map(|n| n.saturating_mul(each));
    planned(options, found.id, Some(found.path.to_string_lossy().into_owned()), readouts)
}

pub(super) fn entries(options: &DatasetOptions) -> Result<Vec<Entry>> {
    let all: Result<Vec<Entry>> = match &options.work {
        Work::Drives(d) => (0..u64::from(d.sequences)).map(|i| planned_scene(options, d, i)).collect(),
        Work::Inputs(i) => {
            let mut all = Vec::new();
            from::each(i, &options.output, &mut |found| {
                all.push(new_input(options, i, found)?);
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

/// Bytes of a sequence: streams exactly, pictures and labels by rule of thumb.
pub(super) fn expected_bytes(options: &DatasetOptions, readouts: Option<u64>) -> Result<Option<u64>> {
    let Some(readouts) = readouts else { return Ok(None) };
    let geometry = options.camera.sensor.geometry;
    let streams = u128::from(Layout::Dat.file_bytes(geometry, readouts)?) * 2;
    let (pixels, readouts) = (geometry.pixels() as u128, u128::from(readouts));
    let kept = u128::from(options.images.form.bytes_per_pixel());
    let rest = match &options.work {
        Work::Drives(d) => {
            let every = options.images.every.unwrap_or(u64::from(d.readouts_per_image)).max(1);
            let images = readouts.div_ceil(every.into());
            // A grey PNG of a street takes about two thirds of a byte per pixel; a labelled image 9
            // bytes of maps, and twice 9 bytes of flow with its mask.
            let picture = pixels * kept * 2 / 3 + if d.npy { 4 * pixels } else { 0 };
            let labelled = u128::from(d.images).checked_div(d.label_every.into()).map_or(0, |n| n + 1);
            // KITTI's pictures: depth and twice flow; EXR: three floats.
            let label = 27 + if d.kitti { 8 } else { 0 } + if d.exr { 12 } else { 0 };
            images * picture + labelled * label * pixels
        }
        Work::Inputs(_) => {
            let every = options.images.every.map(|n| u128::from(n.max(1)));
            2 * pixels + every.map_or(0, |n| readouts.div_ceil(n) * pixels * kept)
        }
    };
    // Of 64-bit readouts and at most 2^28 pixels the sum has less than 128 bits.
    let all = u64::try_from(streams + rest).map_err(|_| {
        Error::new(Kind::Config, "dataset")
            .found(format_args!("sequences of {} bytes", streams + rest))
            .expected("sequences that a disk can hold")
            .remedy("give fewer readouts or a smaller camera")
    })?;
    Ok(Some(all))
}
