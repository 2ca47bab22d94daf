//! What SpikeCV reads beside the data: a `config.yaml` for each kind of label, and for those of scenes folders of their own.
//!
//! One configuration names one ending, so detection and tracking, depth, and flow each have a root below `spikecv`.

use super::links::{link, put};
use super::mot;
use crate::frames::LabelledFrame;
use crate::{DatasetOptions, Entry, Structure};
use spikelane::error::Result;
use spikelane::unstable::inputs::{InnerPath, PlainName};
use spikelane_io::storage;

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
    let (root, access, id) = (&options.output, options.access(), &entry.id);
    let own = |file: InnerPath| entry.path().join(file).below(root, access);
    let mut copied = 0;
    for (kind, numbers, ending) in KINDS {
        let folder = InnerPath::from("spikecv").join(kind);
        put(root, &folder.join("config.yaml"), text(options, numbers, ending, kind).as_bytes())?;
        let split = folder.join(entry.split.name());
        let stream = split.join("spike").join(id).join(id.with(".dat"));
        copied += link(&own("stream.dat".into())?, root, &stream)?;
        let labels = split.join(kind).join(id);
        if kind == "boxes" {
            put(root, &labels.join(id.with(".txt")), mot::text(frames).as_bytes())?;
            continue;
        }
        // Forward flow leads to the next labelled readout, and the last has none.
        let (what, count) =
            if kind == "flow" { (".forward.flo", frames.len() - 1) } else { (".depth.npy", frames.len()) };
        for frame in &frames[..count] {
            let name = PlainName::number(frame.readout, 6);
            let from = own(InnerPath::from("labels").join(name.with(what)))?;
            copied += link(&from, root, &labels.join(name.with(".").with(ending)))?;
        }
    }
    Ok(copied)
}
