//! What SpikeCV reads beside the data: a `config.yaml` for each kind of label, and for those of scenes folders of their own.
//!
//! One configuration names one ending, so detection and tracking, depth, and flow each have a root below `spikecv`.

use super::links::{link, put};
use super::mot;
use crate::dataset::frames::LabelledFrame;
use crate::dataset::{DatasetOptions, Entry, Structure};
use crate::error::Result;
use crate::storage;

/// Kinds of labels: the folder, SpikeCV's numbers, the ending.
const KINDS: [(&str, &str, &str); 3] =
    [("boxes", "[4, 5]", "txt"), ("depth", "[3.1]", "npy"), ("flow", "[2]", "flo")];

fn text(options: &DatasetOptions, numbers: &str, ending: &str, labels: &str) -> String {
    let geometry = options.camera.sensor.geometry;
    let name = options.output.file_name().unwrap_or_default().to_string_lossy();
    format!(
        "filename: {}\nspike_w: {}\nspike_h: {}\nis_labeled: true\nlabeled_data_type: {numbers}\n\
         labeled_data_suffix: {ending}\ndata_field_identifier: spike\nlabel_field_identifier: {labels}\n",
        serde_json::Value::from(name.as_ref()),
        geometry.width(),
        geometry.height(),
    )
}

/// The configuration of the ground truth, in the dataset's folder.
pub(crate) fn config(options: &DatasetOptions) -> Result<()> {
    if options.structure != Structure::SpikeCv {
        return Ok(());
    }
    let text = text(options, "[1]", "png", "gt");
    storage::write_small(&options.output.join("config.yaml"), text.as_bytes(), true)
}

/// Puts stream and labels of a sequence of scenes where SpikeCV looks: `spikecv/KIND/SPLIT/spike/ID/ID.dat` and
/// `spikecv/KIND/SPLIT/KIND/ID/...`. Returns how many files had to be copied.
pub(super) fn link_labels(options: &DatasetOptions, entry: &Entry, frames: &[LabelledFrame]) -> Result<u64> {
    if options.structure != Structure::SpikeCv {
        return Ok(0);
    }
    let (sequence, id) = (entry.folder(&options.output), &entry.id);
    let mut copied = 0;
    for (kind, numbers, ending) in KINDS {
        let root = options.output.join("spikecv").join(kind);
        put(&root, "config.yaml", text(options, numbers, ending, kind).as_bytes())?;
        let split = root.join(&entry.split);
        copied += link(&sequence.join("stream.dat"), &split.join("spike").join(id), &format!("{id}.dat"))?;
        let labels = split.join(kind).join(id);
        if kind == "boxes" {
            put(&labels, &format!("{id}.txt"), mot::text(frames).as_bytes())?;
            continue;
        }
        // Forward flow leads to the next labelled readout, and the last has none.
        let (what, count) =
            if kind == "flow" { ("forward.flo", frames.len() - 1) } else { ("depth.npy", frames.len()) };
        for frame in &frames[..count] {
            let from = sequence.join(format!("labels/{:06}.{what}", frame.readout));
            copied += link(&from, &labels, &format!("{:06}.{ending}", frame.readout))?;
        }
    }
    Ok(copied)
}
