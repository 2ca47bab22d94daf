//! The sequences of a dataset before they are made.

use crate::dataset::from::{self, Input};
use crate::dataset::manifest::Entry;
use crate::dataset::{DatasetOptions, Inputs, Work};
use crate::error::Result;
use crate::formats::Layout;
use crate::light::READOUTS_PER_FRAME;

/// A sequence that is not made yet.
pub(super) fn planned(
    options: &DatasetOptions,
    id: String,
    input: Option<String>,
    readouts: Option<u64>,
) -> Result<Entry> {
    let seeds = options.seeds(&id);
    let scene = matches!(options.work, Work::Drives(_)).then(|| options.seed_of_scene(&id));
    Ok(Entry {
        scene_seed: scene,
        seeds: [seeds.camera, seeds.shot, seeds.sequence],
        bytes: expected_bytes(options, readouts)?,
        input,
        readouts,
        id,
        ..Entry::default()
    })
}

/// The sequence of an input.
pub(super) fn new_input(options: &DatasetOptions, inputs: &Inputs, found: Input) -> Result<Entry> {
    let each = inputs.readouts_per_frame.unwrap_or(READOUTS_PER_FRAME);
    let readouts = found.frames.map(|n| n.saturating_mul(each));
    planned(options, found.id, Some(found.path.to_string_lossy().into_owned()), readouts)
}

pub(super) fn entries(options: &DatasetOptions) -> Result<Vec<Entry>> {
    let all: Result<Vec<Entry>> = match &options.work {
        Work::Drives(d) => (0..u64::from(d.sequences))
            .map(|i| planned(options, options.scene_id(i), None, Some(d.readouts())))
            .collect(),
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
    let ids: Vec<_> = all.iter().map(|e| e.id.clone()).collect();
    for (entry, split) in all.iter_mut().zip(options.splits(&ids)) {
        split.name().clone_into(&mut entry.split);
    }
    Ok(all)
}

/// Bytes of a sequence: streams exactly, pictures and labels by rule of thumb.
pub(super) fn expected_bytes(options: &DatasetOptions, readouts: Option<u64>) -> Result<Option<u64>> {
    let Some(readouts) = readouts else { return Ok(None) };
    let geometry = options.camera.sensor.geometry;
    let streams = 2 * Layout::Dat.file_bytes(geometry, readouts)?;
    let pixels = geometry.pixels() as u64;
    let kept = options.images.form.bytes_per_pixel();
    let rest = match &options.work {
        Work::Drives(d) => {
            let every = options.images.every.unwrap_or(u64::from(d.readouts_per_image)).max(1);
            let images = readouts.div_ceil(every);
            // A grey PNG of a street takes about two thirds of a byte per pixel; a labelled image 9
            // bytes of maps, and twice 9 bytes of flow with its mask.
            let picture = pixels * kept * 2 / 3 + if d.npy { 4 * pixels } else { 0 };
            let labelled = u64::from(d.images).checked_div(u64::from(d.label_every)).map_or(0, |n| n + 1);
            // KITTI's pictures: depth and twice flow; EXR: three floats.
            let label = 27 + if d.kitti { 8 } else { 0 } + if d.exr { 12 } else { 0 };
            images * picture + labelled * label * pixels
        }
        Work::Inputs(_) => {
            2 * pixels + options.images.every.map_or(0, |n| readouts.div_ceil(n.max(1)) * pixels * kept)
        }
    };
    Ok(Some(streams + rest))
}
